//! How much CPU time of the same work varies on this machine now.

use std::ops::ControlFlow;

use super::results::MachineNoise;
use super::statistics::mean_and_deviation;
use crate::compile::CompiledScene;
use crate::error::Result;
use crate::integrator::Session;
use crate::report::median;
use crate::scene::{RenderSettings, SceneDescription};

/// Pairs of runs.
const PAIRS: u32 = 9;

/// Least CPU seconds of a run: a shorter one measures the clock.
const LEAST_SECONDS: f64 = 0.05;

/// Spread from which every figure needs a warning.
pub(super) const SPREAD_WARNING: f64 = 0.05;

/// Renders the same samples twice, in turn, and compares the CPU times pair by pair.
pub(super) fn measure(
    scene: &SceneDescription,
    compiled: &CompiledScene,
    settings: &RenderSettings,
) -> Result<MachineNoise> {
    let run = |session: &mut Session<'_>, rounds: u32| {
        let before = session.cpu_seconds();
        for _ in 0..rounds {
            // Nobody observes, so nothing breaks.
            let _ = session.round(1, &|_| ControlFlow::Continue(()));
        }
        session.cpu_seconds() - before
    };
    let mut sessions = Vec::new();
    for _ in 0..2 {
        sessions.push(Session::new(scene, compiled, settings, 1)?);
    }
    let mut rounds = 1;
    while sessions
        .iter_mut()
        .map(|s| run(s, rounds))
        .fold(0.0, f64::max)
        < LEAST_SECONDS
    {
        rounds *= 2;
    }
    let (mut logarithms, mut seconds) = (Vec::new(), Vec::new());
    for pair in 0..PAIRS as usize {
        let mut times = [0.0; 2];
        for turn in [pair % 2, 1 - pair % 2] {
            times[turn] = run(&mut sessions[turn], rounds);
        }
        logarithms.push((times[1] / times[0]).ln());
        seconds.extend(times);
    }
    Ok(MachineNoise {
        pairs: PAIRS,
        seconds: median(&mut seconds),
        spread: mean_and_deviation(&logarithms).1,
    })
}
