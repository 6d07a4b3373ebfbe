//! The wavefront and the reference, which share no material, light or intersection code, show the
//! same radiance on every scene of the repository, for every integrator, strategy, sampler and
//! acceleration structure.

use wavepath::reference::{RayCounts, Reference};
use wavepath::scene::{
    AccelKind, Budget, IntegratorKind, RenderSettings, SamplerKind, SceneDescription, Strategy,
};

use crate::builder::adorned_room;
use crate::renderer::STRUCTURES;
use crate::support::{estimate, load, picture, scene_files};
use crate::ztest::{ImageEstimate, compare};

const SIZE: [u32; 2] = [24, 24];
/// Samples per pixel of each picture.
const SAMPLES: u64 = 128;
/// Chance that one comparison of two right pictures fails. The seeds are fixed, so a comparison
/// that passes once passes always.
const FALSE_ALARM: f64 = 1e-4;

fn render(scene: &SceneDescription, camera: usize, settings: &RenderSettings) -> ImageEstimate {
    estimate(&picture(scene, camera, SIZE, settings).film)
}

/// The reference's picture; where nothing is biased, it is the same for every strategy.
fn reference(scene: &SceneDescription, camera: usize, settings: &RenderSettings) -> ImageEstimate {
    let settings = RenderSettings {
        seed: 77,
        ..settings.clone()
    };
    let [width, height] = SIZE;
    let reference = Reference::new(scene, camera, width, height, &settings).expect("a sound scene");
    let mut counts = RayCounts::default();
    ImageEstimate::from_samples(SIZE.map(|n| n as usize), SAMPLES, |x, y, sample| {
        reference
            .sample(x as u32, y as u32, sample, &mut counts)
            .to_array()
    })
}

fn check(ours: &ImageEstimate, reference: &ImageEstimate, label: &str) {
    let comparison = compare(ours, reference, FALSE_ALARM);
    assert!(comparison.passes(), "{label}: {comparison}");
}

/// Every combination that the wavefront can render a scene with.
fn combinations(base: &RenderSettings) -> Vec<RenderSettings> {
    let mut all = Vec::new();
    for strategy in [Strategy::Mis, Strategy::Nee, Strategy::Bsdf] {
        for sampler in [
            SamplerKind::Independent,
            SamplerKind::Stratified,
            SamplerKind::Sobol,
        ] {
            for accel in STRUCTURES {
                // All trees give the same bits; the sequence is shown with one.
                if sampler == SamplerKind::Sobol && accel != AccelKind::Bvh8 {
                    continue;
                }
                // Strata need blocks to fill; independent samples give the best variance one by one.
                let block = match sampler {
                    SamplerKind::Stratified => 8,
                    SamplerKind::Independent | SamplerKind::Sobol => 1,
                };
                all.push(RenderSettings {
                    strategy,
                    sampler,
                    accel,
                    block,
                    ..base.clone()
                });
            }
        }
    }
    all
}

/// Compares scenes `part`, `part + of`, … of the repository.
fn check_scenes(part: usize, of: usize, integrator: IntegratorKind) {
    for file in scene_files().iter().skip(part).step_by(of) {
        let name = file.file_name().expect("a file").to_string_lossy();
        let scene = load(&name);
        let base = RenderSettings {
            integrator,
            budget: Budget::Samples(SAMPLES),
            threads: 1,
            ..RenderSettings::from_defaults(&scene.render)
        };
        let mut reference_of = [const { None }; 3];
        for settings in combinations(&base) {
            if integrator == IntegratorKind::Whitted && settings.strategy != Strategy::Mis {
                continue;
            }
            // The strategies of a biased picture differ in what they leave out.
            let slot = if base.transparent_shadows {
                settings.strategy as usize
            } else {
                0
            };
            let expected =
                reference_of[slot].get_or_insert_with(|| reference(&scene, 0, &settings));
            check(
                &render(&scene, 0, &settings),
                expected,
                &format!("{name}, {settings:?}"),
            );
        }
    }
}

#[test]
fn path_tracing_agrees_on_the_first_half_of_the_scenes() {
    check_scenes(0, 2, IntegratorKind::Path);
}

#[test]
fn path_tracing_agrees_on_the_second_half_of_the_scenes() {
    check_scenes(1, 2, IntegratorKind::Path);
}

#[test]
fn whitted_agrees_on_every_scene() {
    check_scenes(0, 1, IntegratorKind::Whitted);
}

#[test]
fn smooth_normals_textures_and_opacity_agree_in_every_method() {
    let scene = adorned_room().build();
    for (integrator, transparent_shadows) in [
        (IntegratorKind::Path, false),
        (IntegratorKind::Path, true),
        (IntegratorKind::Whitted, false),
        (IntegratorKind::Whitted, true),
    ] {
        let base = RenderSettings {
            integrator,
            transparent_shadows,
            budget: Budget::Samples(SAMPLES),
            max_depth: Some(8),
            threads: 1,
            ..RenderSettings::default()
        };
        let mut reference_of = [const { None }; 3];
        for settings in combinations(&base) {
            // All trees give the same bits.
            if integrator == IntegratorKind::Whitted && settings.strategy != Strategy::Mis
                || !matches!(settings.accel, AccelKind::Linear | AccelKind::Bvh8)
            {
                continue;
            }
            let slot = if transparent_shadows {
                settings.strategy as usize
            } else {
                0
            };
            let expected =
                reference_of[slot].get_or_insert_with(|| reference(&scene, 0, &settings));
            let label = format!("{settings:?}");
            check(&render(&scene, 0, &settings), expected, &label);
        }
    }
}

#[test]
fn the_camera_on_the_edge_of_the_room_agrees_and_shows_no_line() {
    let scene = load("hexroom.toml");
    let camera = scene
        .cameras
        .iter()
        .position(|c| c.name == "2")
        .expect("camera 2");
    let settings = RenderSettings {
        budget: Budget::Samples(SAMPLES),
        block: 1,
        ..RenderSettings::from_defaults(&scene.render)
    };
    for accel in STRUCTURES {
        let ours = render(
            &scene,
            camera,
            &RenderSettings {
                accel,
                ..settings.clone()
            },
        );
        check(
            &ours,
            &reference(&scene, camera, &settings),
            &format!("{accel:?}"),
        );
    }
}

#[test]
fn depth_limits_mean_the_same_to_both() {
    let scene = load("hexroom.toml");
    for integrator in [IntegratorKind::Path, IntegratorKind::Whitted] {
        for depth in 1..=5 {
            let settings = RenderSettings {
                integrator,
                max_depth: Some(depth),
                budget: Budget::Samples(SAMPLES),
                block: 1,
                ..RenderSettings::from_defaults(&scene.render)
            };
            let label = format!("{integrator:?} at depth {depth}");
            check(
                &render(&scene, 0, &settings),
                &reference(&scene, 0, &settings),
                &label,
            );
        }
    }
}
