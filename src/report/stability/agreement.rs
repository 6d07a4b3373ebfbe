//! The same answers from every structure, quality, number of threads, integrator and renderer.

use super::closed_meshes::{ClosedMesh, Random};
use super::rays::{Rays, narrow};
use super::renders::{Picture, deviation, kind, max_or_nan, path, whitted};
use super::scenes::{SceneBuilder, glass, lambertian, mirror};
use super::trial::{Figure, Trial};
use crate::accel::{self, BuildOptions, BuildQuality, Structure};
use crate::error::Result;
use crate::film::Film;
use crate::geometry::PrimitiveId;
use crate::reference::{RayCounts, Reference};
use crate::scene::{
    BsdfDescription, Budget, RenderSettings, SceneDescription, ShapeGeometry, Strategy,
};

pub(super) fn same_hits(trial: &mut Trial<'_>) -> Result<()> {
    let count = trial.count(40_000);
    for mesh in [ClosedMesh::sphere(40, 2), ClosedMesh::sponge(2_112, 2)] {
        let mut random = Random(28);
        let mut rays = Rays::default();
        for _ in 0..count {
            rays.push(
                narrow(3.0 * random.direction()),
                narrow(random.direction()),
                PrimitiveId::NONE,
            );
        }
        let expected = rays.closest(&*accel::build(Structure::Bvh2, &mesh.geometry)?);
        for quality in [BuildQuality::Fast, BuildQuality::Medium, BuildQuality::Best] {
            trial.on_structures(
                format!("{}, builds {quality:?}", mesh.name),
                "bits of bvh2; of the scan: 4 u",
                |_, structure| {
                    let options = BuildOptions {
                        quality,
                        ..BuildOptions::default()
                    };
                    let accel = accel::build_with(structure, &mesh.geometry, &options)?;
                    let hits = rays.closest(&*accel);
                    let wrong = hits.iter().zip(&expected).filter(|(a, b)| {
                        // The scan has a test of its own: other roundings, and at an edge, which
                        // two triangles share, the other of the two.
                        let near = (a.0 - b.0).abs() <= 4.0 * f32::EPSILON * 4.0;
                        a != b && !(structure == Structure::Linear && near)
                    });
                    Ok(Figure::none_of(wrong.count() as u64, count))
                },
            )?;
        }
    }
    Ok(())
}

pub(super) fn same_bits(trial: &mut Trial<'_>) -> Result<()> {
    let scene = direct_scene();
    let base = RenderSettings {
        budget: Budget::Samples(18),
        ..path(Strategy::Mis, 6)
    };
    let settings = RenderSettings {
        threads: 1,
        ..base.clone()
    };
    let expected = Picture::render(&scene, [50, 37], &settings)?.bits();
    for threads in [2, 5, 64] {
        let settings = RenderSettings {
            threads,
            ..base.clone()
        };
        let bits = Picture::render(&scene, [50, 37], &settings)?.bits();
        let wrong = bits.iter().zip(&expected).filter(|(a, b)| a != b).count();
        let figure = Figure::none_of(wrong as u64, expected.len() as u64);
        trial.note(format!("{threads} threads"), "same bits as 1", figure);
    }
    Ok(())
}

/// A mirror, a ball of glass and a matte floor under a lamp and a point light: no light is indirect but by
/// mirror and glass.
fn direct_scene() -> SceneDescription {
    let mut scene = SceneBuilder::new();
    let [white, clear, silver] =
        [lambertian(0.6), glass(1.5), mirror(0.9)].map(|b| scene.matter(b));
    let lamp = scene.one_sided(BsdfDescription::Black, 4.0);
    scene.floor(2.0, 0.0, white);
    scene.ceiling(0.5, 3.0, lamp);
    scene.sphere([0.3, 0.8, 0.7], 0.5, clear);
    scene.quad(
        [
            [1.5, -2.0, 0.1],
            [1.5, 2.0, 0.1],
            [1.5, 2.0, 2.0],
            [1.5, -2.0, 2.0],
        ],
        silver,
    );
    scene.point_light([-1.0, 0.3, 1.2], 1.0);
    scene.window(
        [-3.0, 0.0, 1.5],
        [-2.0, 0.5, 1.6],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, -0.8],
    );
    scene.build()
}

/// Largest difference of the means of two pictures' rows of pixels, in standard errors.
fn worst_row(a: &Film, b: &Film) -> f64 {
    let width = a.width() as usize;
    (0..a.height() as usize)
        .map(|row| {
            let (mut difference, mut variance, mut sum) = (0.0, 0.0, 0.0);
            for pixel in row * width..(row + 1) * width {
                difference += a.mean(pixel)[0] - b.mean(pixel)[0];
                sum += a.mean(pixel)[0];
                for film in [a, b] {
                    variance += film.variance(pixel).map_or(f64::NAN, |v| v[0]);
                }
            }
            deviation(difference, variance.sqrt(), 1e-5 * sum)
        })
        .fold(0.0, max_or_nan)
}

pub(super) fn reference(trial: &mut Trial<'_>) -> Result<()> {
    let samples = trial.count(256).max(64);
    let scene = direct_scene();
    for (name, base) in [("path", path(Strategy::Mis, 6)), ("Whitted", whitted(6))] {
        let plain = Reference::new(
            &scene,
            0,
            24,
            24,
            &RenderSettings {
                seed: 77,
                ..base.clone()
            },
        )?;
        let mut counts = RayCounts::default();
        let mut film = Film::new(24, 24, false);
        for pixel in 0..film.len() {
            let (x, y) = (pixel as u32 % 24, pixel as u32 / 24);
            for sample in 0..samples {
                let radiance = plain.sample(x, y, sample, &mut counts);
                film.add_block(pixel, 1, radiance.to_array());
            }
        }
        trial.on_structures(
            format!("lane kernels, {name}"),
            "scalar f64 renderer, per row",
            |trial, structure| {
                let settings = RenderSettings {
                    accel: kind(structure),
                    budget: Budget::Samples(samples),
                    ..base.clone()
                };
                let picture = trial.picture(&scene, [24, 24], &settings)?;
                let taken = picture.film.total_samples();
                let worst = worst_row(&picture.film, &film);
                Ok(Figure::standard_errors_within(worst, 4.5, taken))
            },
        )?;
    }
    Ok(())
}

pub(super) fn whitted_and_path(trial: &mut Trial<'_>) -> Result<()> {
    let samples = trial.count(64);
    let mut mirrored = direct_scene();
    mirrored
        .shapes
        .retain(|shape| !matches!(shape.geometry, ShapeGeometry::Sphere { .. }));
    // Whitted's samples are at pixels' centres, so both look at one point: on the floor, and in the
    // mirror, where all that a path of three segments finds is light on what the mirror shows.
    for (label, scene, depth, at) in [
        (
            "direct light on a floor",
            &direct_scene(),
            2,
            [0.4, -1.0, 0.0],
        ),
        (
            "direct light beside glass",
            &direct_scene(),
            2,
            [-0.3, 0.6, 0.0],
        ),
        ("direct light in a mirror", &mirrored, 3, [1.5, 0.7, 0.6]),
    ] {
        let mut scene = scene.clone();
        let mut view = SceneBuilder::new();
        view.aim([-3.0, 0.0, 1.5], at);
        scene.cameras = view.build().cameras;
        let mut means = Vec::new();
        for settings in [path(Strategy::Mis, depth), whitted(depth)] {
            let settings = RenderSettings {
                budget: Budget::Samples(samples),
                seed: settings.integrator as u64,
                ..settings
            };
            means.push(trial.picture(&scene, [32, 32], &settings)?.mean());
        }
        let [(a, error_a), (b, error_b)] = [means[0], means[1]];
        let off = deviation(a - b, error_a.hypot(error_b), 1e-5 * a);
        // Two black pictures would agree too.
        let off = if a > 0.0 { off } else { f64::INFINITY };
        trial.note(
            label,
            "Whitted = path",
            Figure::standard_errors(off, 2 * 1_024 * samples),
        );
    }
    Ok(())
}
