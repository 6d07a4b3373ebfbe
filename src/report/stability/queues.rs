//! Queues of any size, and scenes in which all paths die at once or none does.

use glam::DVec3;

use super::renders::{endless, path, whitted};
use super::scenes::{SceneBuilder, glass, glowing_room, lambertian, mirror};
use super::trial::{Figure, Trial};
use crate::error::Result;
use crate::scene::{BsdfDescription, Budget, RenderSettings, SceneDescription, Strategy};

/// A floor with a ball of glass and one of silver, a lamp and a sky.
fn still_life() -> SceneDescription {
    let mut scene = SceneBuilder::new();
    let [white, clear, silver] =
        [lambertian(0.7), glass(1.5), mirror(0.9)].map(|b| scene.matter(b));
    let lamp = scene.one_sided(BsdfDescription::Black, 4.0);
    scene.floor(2.0, 0.0, white);
    scene.ceiling(0.5, 2.0, lamp);
    scene.sphere([0.0, 0.6, 0.5], 0.5, clear);
    scene.sphere([0.0, -0.6, 0.5], 0.5, silver);
    scene.background(0.3);
    scene.window(
        [-3.0, 0.0, 1.0],
        [-2.0, 0.5, 1.2],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, -0.8],
    );
    scene.build()
}

pub(super) fn queue_sizes(trial: &mut Trial<'_>) -> Result<()> {
    let scene = still_life();
    let base = RenderSettings {
        budget: Budget::Samples(4),
        roulette_depth: 3,
        ..endless(Strategy::Mis)
    };
    for (name, settings) in [
        ("path", base.clone()),
        (
            "Whitted",
            RenderSettings {
                budget: base.budget,
                ..whitted(6)
            },
        ),
    ] {
        let expected = trial.picture(&scene, [33, 17], &settings)?.bits();
        for wave in [1, 2, 15, 16, 17, 255, 257, 4_095, 4_097, 100_000] {
            let settings = RenderSettings {
                wave,
                ..settings.clone()
            };
            let bits = trial.picture(&scene, [33, 17], &settings)?.bits();
            let wrong = bits.iter().zip(&expected).filter(|(a, b)| a != b).count();
            let figure = Figure::none_of(wrong as u64, expected.len() as u64);
            trial.note(
                format!("{wave} paths in flight, {name}"),
                "same bits as 4096",
                figure,
            );
        }
    }
    Ok(())
}

pub(super) fn all_or_none(trial: &mut Trial<'_>) -> Result<()> {
    // All paths end at the first hit, or at the depth limit and not before.
    for (label, bsdf, depth) in [
        ("all end at the first hit", BsdfDescription::Black, 9),
        ("none ends before depth 9", mirror(1.0), 9),
    ] {
        let scene = glowing_room(bsdf, 1.0, DVec3::ZERO, true).build();
        let settings = RenderSettings {
            budget: Budget::Samples(3),
            wave: 1_000,
            ..path(Strategy::Mis, depth)
        };
        let picture = trial.picture(&scene, [40, 30], &settings)?;
        let stats = &picture.stats;
        let (segments, cut) = if bsdf == BsdfDescription::Black {
            (1, 0)
        } else {
            (u64::from(depth), stats.paths)
        };
        let wrong = (stats.camera_rays + stats.bounce_rays).abs_diff(segments * stats.paths)
            + stats.truncated.abs_diff(cut)
            + stats.shadow_rays;
        trial.note(
            label,
            "rays sent = rays due",
            Figure::none_of(wrong, stats.paths),
        );
    }
    // What a black scene does not need is not sent.
    let mut scene = SceneBuilder::new();
    let black = scene.matter(lambertian(0.0));
    scene.floor(1.0, 0.0, black);
    scene.point_light([0.0, 0.0, 2.0], 7.0);
    scene.background(1.0);
    scene.aim([0.2, 0.1, 1.0], [0.0; 3]);
    let settings = RenderSettings {
        budget: Budget::Samples(4),
        ..path(Strategy::Mis, 9)
    };
    let picture = trial.picture(&scene.build(), [20, 20], &settings)?;
    let sent = picture.stats.shadow_rays + picture.stats.bounce_rays;
    trial.note(
        "albedo 0",
        "no shadow and no bounce ray",
        Figure::none_of(sent, picture.stats.paths),
    );
    Ok(())
}
