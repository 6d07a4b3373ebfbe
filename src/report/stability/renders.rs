//! Settings of renders whose result is known, and deviations from it.

use std::ops::ControlFlow;

use crate::accel::Structure;
use crate::compile::compile;
use crate::error::Result;
use crate::film::Film;
use crate::integrator::render;
use crate::integrator::stats::RenderStats;
use crate::scene::{AccelKind, IntegratorKind, RenderSettings, SceneDescription, Strategy};

/// Every strategy.
pub const STRATEGIES: [Strategy; 3] = [Strategy::Mis, Strategy::Nee, Strategy::Bsdf];

/// Every kind of structure but the automatic choice.
pub const STRUCTURES: [AccelKind; 5] = [
    AccelKind::Linear,
    AccelKind::Octree,
    AccelKind::Bvh2,
    AccelKind::Bvh8,
    AccelKind::Packet,
];

/// Relative error that is put down to roundings of f32 along some tens of segments.
pub(super) const ROUNDING: f64 = 1e-5;

/// The setting that chooses a structure.
pub(super) fn kind(structure: Structure) -> AccelKind {
    match structure {
        Structure::Linear => AccelKind::Linear,
        Structure::Octree => AccelKind::Octree,
        Structure::Bvh2 => AccelKind::Bvh2,
        Structure::Bvh8 => AccelKind::Bvh8,
        Structure::Packet => AccelKind::Packet,
    }
}

/// Path tracing to any depth, without roulette: for scenes that paths leave.
pub fn endless(strategy: Strategy) -> RenderSettings {
    RenderSettings {
        strategy,
        roulette_depth: u32::MAX,
        seed: 1,
        threads: 1,
        ..RenderSettings::default()
    }
}

/// Path tracing to this many segments, without roulette.
pub fn path(strategy: Strategy, max_depth: u32) -> RenderSettings {
    RenderSettings {
        max_depth: Some(max_depth),
        ..endless(strategy)
    }
}

/// Whitted's method to this many segments, without roulette.
pub fn whitted(max_depth: u32) -> RenderSettings {
    RenderSettings {
        integrator: IntegratorKind::Whitted,
        ..path(Strategy::Mis, max_depth)
    }
}

/// A finished render.
#[derive(Debug)]
pub(super) struct Picture {
    pub(super) film: Film,
    pub(super) stats: RenderStats,
}

impl Picture {
    /// The picture of camera 0.
    pub(super) fn render(
        scene: &SceneDescription,
        [width, height]: [u32; 2],
        settings: &RenderSettings,
    ) -> Result<Self> {
        let compiled = compile(scene, 0, width, height, settings)?;
        let outcome = render(scene, &compiled, settings, &|_| ControlFlow::Continue(()))?;
        Ok(Self {
            film: outcome.film,
            stats: outcome.stats,
        })
    }

    /// Values of all pixels and channels.
    fn values(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.film.len()).flat_map(|pixel| self.film.mean(pixel))
    }

    /// Largest relative error of a pixel against a value that all should have; absolute if that is 0.
    pub(super) fn worst_pixel(&self, expected: f64) -> f64 {
        let scale = if expected == 0.0 { 1.0 } else { expected };
        self.values()
            .map(|value| ((value - expected) / scale).abs())
            .fold(0.0, max_or_nan)
    }

    /// Bits of all pixels' means, and of their estimated errors where there are several blocks.
    pub(super) fn bits(&self) -> Vec<u64> {
        (0..self.film.len())
            .flat_map(|pixel| {
                let variance = self.film.variance(pixel).unwrap_or_default();
                self.film.mean(pixel).into_iter().chain(variance)
            })
            .map(f64::to_bits)
            .collect()
    }

    /// Mean of the first channel and its standard error, by the spread of blocks within pixels.
    pub(super) fn mean(&self) -> (f64, f64) {
        let film = &self.film;
        let n = film.len() as f64;
        let mean = (0..film.len()).map(|p| film.mean(p)[0]).sum::<f64>() / n;
        let variance: f64 = (0..film.len())
            .map(|p| film.variance(p).map_or(f64::INFINITY, |v| v[0]))
            .sum();
        (mean, variance.sqrt() / n)
    }

    /// By how many standard errors the mean of the first channel is off. Roundings count as part of the
    /// error, so that a render without noise passes too.
    pub(super) fn deviation(&self, expected: f64) -> f64 {
        let (mean, error) = self.mean();
        deviation(mean - expected, error, ROUNDING * expected.abs())
    }
}

/// A difference in standard errors after what is put down to rounding: 0 where that is all of it.
pub(super) fn deviation(difference: f64, error: f64, rounding: f64) -> f64 {
    let beyond = difference.abs() - rounding;
    if beyond <= 0.0 { 0.0 } else { beyond / error }
}

/// The larger number; NaN if either is.
pub(super) fn max_or_nan(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() {
        f64::NAN
    } else {
        a.max(b)
    }
}
