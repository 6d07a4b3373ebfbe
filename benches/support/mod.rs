//! What the benches of the stages share: a scene, and a wave brought to the stage in question.
#![allow(dead_code, reason = "each bench uses some of it")]

use std::path::PathBuf;

use wavepath::compile::{CompiledScene, TILE, WorkItem, compile};
use wavepath::math::float::flush_denormals;
use wavepath::scene::{self, RenderSettings, SceneDescription};
use wavepath::stage::Kernels;
use wavepath::wave::Wave;

/// Samples per pixel in a work item.
pub(crate) const SAMPLES: u32 = 16;

/// The description of a scene of the repository.
pub(crate) fn load(name: &str) -> SceneDescription {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("scenes")
        .join(name);
    scene::load(&path, &[]).expect("the repository's scenes are sound")
}

/// Settings of the measured render: depth 16, roulette from depth 5, one thread.
pub(crate) fn settings() -> RenderSettings {
    RenderSettings {
        max_depth: Some(16),
        roulette_depth: 5,
        threads: 1,
        ..RenderSettings::default()
    }
}

/// A scene, its kernels, and a wave in the middle of a work item.
pub(crate) struct Bench {
    /// The scene.
    pub(crate) scene: CompiledScene,
    /// Its stages.
    pub(crate) kernels: Kernels,
    /// A tile in the middle of the image.
    pub(crate) item: WorkItem,
    /// The wave.
    pub(crate) wave: Wave,
}

impl Bench {
    /// The hexagonal room with exact Fresnel reflectance, 800 × 800.
    pub(crate) fn hexroom() -> Self {
        flush_denormals();
        let settings = settings();
        let scene = compile(&load("hexroom-exact.toml"), 0, 800, 800, &settings).expect("compiles");
        let kernels = Kernels::choose(scene.features, settings.force_features);
        let item = WorkItem {
            x: 400,
            y: 400,
            width: TILE,
            height: TILE,
            image_width: 800,
            block: 0,
            first_sample: 0,
            samples: SAMPLES,
        };
        let pixels = (TILE * TILE) as usize;
        let mut wave = Wave::new(
            settings.wave,
            scene.features,
            scene.branching,
            pixels * SAMPLES as usize,
            pixels,
        );
        wave.begin(&item);
        Self {
            scene,
            kernels,
            item,
            wave,
        }
    }

    /// Runs whole passes, so that the wave holds a mix of depths, then up to (not including) the
    /// stage called `stop`.
    pub(crate) fn advance(mut self, passes: usize, stop: &str) -> Self {
        for pass in 0..=passes {
            let last = pass == passes;
            let Self {
                scene,
                kernels,
                item,
                wave,
            } = &mut self;
            macro_rules! step {
                ($name:literal, $run:expr) => {
                    if last && stop == $name {
                        return self;
                    }
                    $run;
                };
            }
            step!("generate", (kernels.generate)(scene, item, wave));
            step!("intersect", (kernels.intersect)(scene, wave));
            step!("sort", (kernels.sort)(scene, wave));
            step!("emission", {
                kernels
                    .shade_escaped
                    .into_iter()
                    .for_each(|stage| stage(scene, wave));
                kernels
                    .shade_emission
                    .into_iter()
                    .for_each(|stage| stage(scene, wave));
            });
            step!("shade", {
                for stage in kernels.shade.iter().flatten() {
                    stage(scene, item, wave);
                }
            });
            step!(
                "connect",
                kernels
                    .connect
                    .into_iter()
                    .for_each(|stage| stage(scene, wave))
            );
            step!("roulette", (kernels.roulette)(scene, wave));
        }
        unreachable!("there is no stage {stop}");
    }
}
