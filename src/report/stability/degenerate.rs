//! Input that is broken, repeated, or of sizes that do not belong together.

use std::fmt::Write;
use std::path::Path;

use glam::DVec3;

use super::closed_meshes::Random;
use super::rays::{Rays, flushed, narrow, wide};
use super::renders::{Picture, kind, path};
use super::scenes::{SceneBuilder, lambertian};
use super::trial::{Figure, Trial};
use crate::accel::{self, Structure};
use crate::error::{Error, ErrorKind, Result};
use crate::geometry::triangle::ShearRay;
use crate::geometry::{Geometry, PrimitiveId, Triangle};
use crate::integrator::clock::thread_cpu_seconds;
use crate::integrator::thread_pool;
use crate::scene::procedural;
use crate::scene::{
    self, BsdfDescription, Budget, Mesh, RenderSettings, SceneDescription, Strategy,
};

/// A scene file about an OBJ and an MTL file with these contents.
fn load_obj(obj: &str, mtl: &str) -> Result<SceneDescription> {
    let folder = tempfile::tempdir().map_err(|error| Error::io(&std::env::temp_dir(), &error))?;
    let text = r#"
        [film]
        width = 16
        height = 16
        [cameras.front]
        eye = [0.3, 0.4, 3.0]
        look_at = [0.3, 0.3, 0.0]
        up = [0.0, 1.0, 0.0]
        fov = 40.0
        [background]
        radiance = 1.0
        [materials.matte]
        type = "lambertian"
        reflectance = 0.6
        [[shapes]]
        type = "obj"
        file = "mesh.obj"
        material = "matte"
    "#;
    for (name, text) in [("scene.toml", text), ("mesh.obj", obj), ("mesh.mtl", mtl)] {
        let path = folder.path().join(name);
        std::fs::write(&path, text).map_err(|error| Error::io(&path, &error))?;
    }
    scene::load(&folder.path().join("scene.toml"), &[])
}

/// Two triangles and a square.
const SOUND: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0.2\nv -1 0 0.3\nf 1 2 3\nf 2 4 3\nf 1 3 5\n";
/// Faces that cannot be traced: points, lines, repeated indices, and what is not finite or too large.
const BROKEN: &str = "v nan 0 0\nv 1e19 0 0\nv 5 5 5\nv 0.5 0 0\nv 0 inf 0\n\
    f 1 2 6\nf 1 2 7\nf 1 1 2\nf 1 9 2\nf 2 3 1\nf 1 2\nf\nf 1 2 10\n";

pub(super) fn broken_faces(trial: &mut Trial<'_>) -> Result<()> {
    let sound = load_obj(SOUND, "")?;
    let broken = load_obj(&format!("{SOUND}{BROKEN}"), "")?;
    let faces = |scene: &SceneDescription| -> usize {
        let meshes = scene.shapes.iter().map(|shape| match &shape.geometry {
            scene::ShapeGeometry::Mesh(mesh) => mesh.faces.len(),
            _ => 0,
        });
        meshes.sum()
    };
    let left_over = faces(&broken).abs_diff(faces(&sound)) as u64;
    trial.note(
        "8 broken faces in an OBJ file",
        "all are removed",
        Figure::none_of(left_over, 8),
    );
    let untold = u64::from(broken.warnings.len() < 4);
    trial.note(
        "8 broken faces in an OBJ file",
        "and told of",
        Figure::none_of(untold, 1),
    );
    trial.on_structures(
        "8 broken faces in an OBJ file",
        "bits of the picture without",
        |trial, structure| {
            let settings = RenderSettings {
                accel: kind(structure),
                budget: Budget::Samples(4),
                ..path(Strategy::Mis, 4)
            };
            let with = trial.picture(&broken, [32, 32], &settings)?;
            let without = trial.picture(&sound, [32, 32], &settings)?;
            Ok(differing_bits(&with, &without))
        },
    )?;
    let mut refused = 0;
    let bad = [
        "f 1 2 99",
        "f 1 2 0",
        "f 1 -9 2",
        "f 1 x 2",
        "v 1 2",
        "f 1 2 3.5",
    ];
    for line in bad {
        refused +=
            u64::from(load_obj(&format!("{SOUND}{line}\n"), "").is_err_and(|e| e.place.is_some()));
    }
    trial.note(
        "indices that do not exist, words for numbers",
        "refused with file and line",
        Figure::none_of(bad.len() as u64 - refused, bad.len() as u64),
    );
    Ok(())
}

fn differing_bits(a: &Picture, b: &Picture) -> Figure {
    let (a, b) = (a.bits(), b.bits());
    let wrong = a.iter().zip(&b).filter(|(a, b)| a != b).count();
    Figure::none_of(wrong as u64, a.len() as u64)
}

/// Geometry of these triangles but for those without area.
fn geometry(corners: impl Iterator<Item = [DVec3; 3]>) -> Geometry {
    let triangles = corners
        .map(|corners| Triangle {
            corners: corners.map(narrow),
        })
        .filter(|triangle| {
            let [a, b, c] = triangle.corners.map(wide);
            (b - a).cross(c - a) != DVec3::ZERO
        })
        .collect();
    Geometry {
        triangles,
        ..Geometry::default()
    }
}

/// Distances of the nearest hits by the scalar test of all triangles.
fn plain_loop(geometry: &Geometry, rays: &Rays) -> Vec<f32> {
    (0..rays.len())
        .map(|i| {
            let [origin, direction] = rays.ray(i);
            let ray = ShearRay::new(origin, direction);
            let hits = geometry.triangles.iter().filter_map(|t| ray.intersect(t));
            hits.fold(f32::INFINITY, f32::min)
        })
        .collect()
}

/// Answers that differ from the plain loop. The scan has a test of its own, of which sliver hits may
/// differ: its answers must be hits of the scalar test's triangle or misses near an edge, so only rays
/// that hit well within count there.
fn against_plain_loop(
    trial: &mut Trial<'_>,
    label: &str,
    geometry: &Geometry,
    rays: &Rays,
    structures: &[Structure],
) -> Result<()> {
    let expected = flushed(|| plain_loop(geometry, rays));
    let samples = rays.len() as u64;
    trial.on(structures, label, "plain loop over all", |_, structure| {
        let accel = accel::build(structure, geometry)?;
        let hits = rays.closest(&*accel);
        let wrong = hits.iter().zip(&expected).filter(|((t, id), expected)| {
            let unsound = *id != PrimitiveId::NONE && *id as usize >= geometry.triangles.len();
            let apart = match structure {
                Structure::Linear => {
                    t.is_finite() != expected.is_finite()
                        || t.is_finite() && (t - **expected).abs() > 1e-3 * **expected
                }
                _ => t != *expected,
            };
            unsound || apart
        });
        Ok(Figure::none_of(wrong.count() as u64, samples))
    })
}

/// Rays to random points of triangles, from around them.
fn rays_to(geometry: &Geometry, count: u64, random: &mut Random) -> Rays {
    let mut rays = Rays::default();
    for _ in 0..count {
        let triangle = &geometry.triangles[random.below(geometry.triangles.len())];
        let [a, b, c] = triangle.corners.map(wide);
        let (u, v) = (0.05 + 0.4 * random.uniform(), 0.05 + 0.4 * random.uniform());
        let target = a + u * (b - a) + v * (c - a);
        let size = (b - a).length().max((c - a).length());
        let normal = (b - a)
            .normalize()
            .cross((c - a).normalize())
            .normalize_or(DVec3::Z);
        let direction = (random.direction() * 0.7 - normal).normalize();
        let origin = target - 2.0 * size * direction;
        rays.push(narrow(origin), narrow(direction), PrimitiveId::NONE);
    }
    rays
}

pub(super) fn depths(trial: &mut Trial<'_>) -> Result<()> {
    let count = trial.count(4_000);
    let mut random = Random(27);
    let unit = [DVec3::ZERO, DVec3::Y, DVec3::Z];
    // Differences of coordinates are multiples of 2⁻²⁴ of them; below x = 2⁻¹⁰² those are denormal, and are flushed
    // to zero. What is smaller cannot be told from a point, by any structure.
    let halving = geometry((0..1_600).map(|k| {
        let x = 2f64.powf(-f64::from(k) / 16.0);
        unit.map(|p| p * 0.01 * x + DVec3::X * x)
    }));
    let rays = rays_to(&halving, count, &mut random);
    let label = "x = 1 to 2^−100: differences below 2^−126 are flushed";
    let missed = flushed(|| plain_loop(&halving, &rays));
    let missed = missed.into_iter().filter(|t| t.is_infinite()).count();
    let figure = Figure::none_of(missed as u64, count);
    trial.note(label, "what is aimed at is hit", figure);
    against_plain_loop(trial, label, &halving, &rays, trial.structures)?;

    let nested = geometry((0..400).map(|k| {
        let size = 1.2f64.powi(k - 200);
        [
            DVec3::new(1.0, 0.0, 0.3),
            DVec3::new(-0.4, 0.8, 0.3),
            DVec3::new(-0.5, -0.7, 0.4),
        ]
        .map(|p| p * size)
    }));
    let rays = rays_to(&nested, count, &mut random);
    against_plain_loop(
        trial,
        "nested sizes 1e-16 to 1e16",
        &nested,
        &rays,
        trial.structures,
    )?;

    let mesh = procedural::icosphere(1.0, 3);
    let small = mesh
        .faces
        .iter()
        .map(|face| face.map(|v| mesh.positions[v as usize]));
    let far = [
        DVec3::new(1e15, 0.0, 0.0),
        DVec3::new(1e15, 1e15, 0.0),
        DVec3::new(1e15, 0.0, 1e15),
    ];
    let together = geometry(small.chain([far]));
    let mut rays = Rays::default();
    for _ in 0..count {
        let direction = random.direction();
        rays.push(
            narrow(-3.0 * direction + 0.3 * random.direction()),
            narrow(direction),
            PrimitiveId::NONE,
        );
    }
    against_plain_loop(
        trial,
        "a mesh of size 1 and a triangle of 1e15",
        &together,
        &rays,
        trial.structures,
    )
}

pub(super) fn limits(trial: &mut Trial<'_>) -> Result<()> {
    // Decided from the number alone, before anything is allocated.
    for (primitives, fits) in [(100_000_000, true), ((1 << 31) - 1, true), (1 << 31, false)] {
        let wrong = match accel::check_limit(primitives) {
            Ok(()) => !fits,
            Err(error) => fits || error.kind != ErrorKind::Limit,
        };
        trial.note(
            format!("{primitives} primitives"),
            if fits { "taken" } else { "refused" },
            Figure::none_of(wrong.into(), 1),
        );
    }
    Ok(())
}

pub(super) fn garbage(trial: &mut Trial<'_>) -> Result<()> {
    let meshes = trial.count(400);
    let mut random = Random(25);
    let mut scenes = Vec::new();
    for _ in 0..meshes {
        let shared = 10f64.powf(36.0 * random.uniform() - 18.0);
        let triangles = 1 + random.below(60);
        let corners: Vec<[DVec3; 3]> = (0..triangles)
            .map(|_| {
                [(); 3].map(|()| {
                    let size = if random.below(2) == 0 {
                        shared
                    } else {
                        10f64.powf(36.0 * random.uniform() - 18.0)
                    };
                    let mut p = random.direction() * size;
                    if random.below(4) == 0 {
                        p[random.below(3)] = 0.0;
                    }
                    p
                })
            })
            .collect();
        let garbage = geometry(corners.into_iter());
        if garbage.triangles.is_empty() {
            continue;
        }
        let rays = rays_to(&garbage, 64, &mut random);
        let expected = flushed(|| plain_loop(&garbage, &rays));
        scenes.push((garbage, rays, expected));
    }
    let samples = scenes.iter().map(|scene| scene.1.len() as u64).sum();
    trial.on_structures(
        format!("{} meshes of magnitudes 1e-18 to 1e18", scenes.len()),
        "plain loop; scan: an answer",
        |_, structure| {
            let mut wrong = 0;
            for (geometry, rays, expected) in &scenes {
                let accel = accel::build(structure, geometry)?;
                for ((t, id), expected) in rays.closest(&*accel).into_iter().zip(expected) {
                    let is_answer = if id == PrimitiveId::NONE {
                        t == f32::INFINITY
                    } else {
                        (id as usize) < geometry.triangles.len() && t > 0.0 && t.is_finite()
                    };
                    let same = t == *expected || structure == Structure::Linear;
                    wrong += u64::from(!is_answer || !same);
                }
            }
            Ok(Figure::none_of(wrong, samples))
        },
    )
}

pub(super) fn duplicates(trial: &mut Trial<'_>) -> Result<()> {
    let most = trial.count(20_000);
    let single = thread_pool(1)?;
    let corners = [DVec3::new(0.0, 0.0, 0.1), DVec3::X, DVec3::Y];
    for count in [1_000, 10_000, 100_000]
        .into_iter()
        .filter(|&count| count <= most.next_power_of_two())
    {
        let mut random = Random(26);
        let identical = geometry((0..count).map(|_| corners));
        let overlapping = geometry((0..count).map(|_| {
            let mut at = || DVec3::new(random.uniform(), random.uniform(), 0.0);
            [at(), at(), at()]
        }));
        let distinct = geometry((0..count).map(|_| {
            let at = random.direction();
            corners.map(|p| at + 0.01 * p)
        }));
        let mut rays = Rays::default();
        for _ in 0..100 {
            let direction = (DVec3::NEG_Z + 0.05 * random.direction()).normalize();
            rays.push([0.2, 0.2, 1.0], narrow(direction), PrimitiveId::NONE);
        }
        for (name, geometry) in [
            ("identical", &identical),
            ("coplanar, overlapping", &overlapping),
        ] {
            let label = format!("{count} triangles, {name}");
            trial.on_structures(&*label, "build time of distinct ones", |_, structure| {
                let time = |geometry: &Geometry| -> Result<f64> {
                    // One thread, whose time nothing else is part of.
                    single.install(|| {
                        let start = thread_cpu_seconds();
                        accel::build(structure, geometry).map(|_| thread_cpu_seconds() - start)
                    })
                };
                // The best of two, and of a millisecond at least: short times are noise.
                let ordinary = time(&distinct)?.min(time(&distinct)?).max(1e-3);
                let figure = time(geometry)?.min(time(geometry)?) / ordinary;
                Ok(Figure::time_ratio(figure, 10.0, count))
            })?;
        }
        trial.on_structures(
            format!("{count} triangles, identical"),
            "lowest of equal ids",
            |_, structure| {
                let accel = accel::build(structure, &identical)?;
                let hits = rays.closest(&*accel);
                let wrong = hits.iter().filter(|hit| hit.1 != 0).count();
                Ok(Figure::none_of(wrong as u64, rays.len() as u64))
            },
        )?;
    }
    Ok(())
}

/// A closed ball with these normals at its corners, about the origin.
fn ball(normal: impl Fn(usize, DVec3) -> DVec3) -> Mesh {
    let mesh = procedural::icosphere(1.0, 2);
    let unit = mesh.positions.iter().map(|p| p.normalize());
    Mesh {
        normals: unit
            .enumerate()
            .map(|(i, n)| narrow(normal(i, n)))
            .collect(),
        face_normals: mesh.faces.clone(),
        ..mesh
    }
}

type BentNormal = fn(usize, DVec3) -> DVec3;

pub(super) fn normals(trial: &mut Trial<'_>) -> Result<()> {
    let cases: [(&str, BentNormal); 5] = [
        ("normals inside out", |_, n| -n),
        ("every other normal inside out", |i, n| {
            if i % 2 == 0 { n } else { -n }
        }),
        ("normals of length 0", |_, _| DVec3::ZERO),
        ("normals not a number", |i, n| {
            if i % 3 == 0 { DVec3::NAN } else { n }
        }),
        ("normals turned by 89°", |_, n| {
            let (sin, cos) = 89f64.to_radians().sin_cos();
            cos * n + sin * n.any_orthonormal_vector()
        }),
    ];
    for (label, normal) in cases {
        let mut scene = SceneBuilder::new();
        let wall = scene.matter(lambertian(0.6));
        scene.attributed_mesh(ball(normal), wall);
        scene.background(1.0);
        let mut inside = scene.clone();
        inside.point_light([0.3, 0.2, 1.1], 50.0);
        inside.window(
            [0.1, 0.2, 0.1],
            [-1.0, 1.0, 0.8],
            [2.0, 0.0, 0.0],
            [0.0, -2.0, 0.0],
        );
        scene.window(
            [0.0, 0.0, 4.0],
            [-0.9, 0.9, 1.0],
            [1.8, 0.0, 0.0],
            [0.0, -1.8, 0.0],
        );
        let (inside, outside) = (inside.build(), scene.build());
        trial.on_structures(
            label,
            "a closed shell is dark inside",
            |trial, structure| {
                let settings = RenderSettings {
                    accel: kind(structure),
                    budget: Budget::Samples(4),
                    ..path(Strategy::Mis, 5)
                };
                let picture = trial.picture(&inside, [32, 32], &settings)?;
                Ok(Figure::absolute(
                    picture.worst_pixel(0.0),
                    0.0,
                    picture.film.total_samples(),
                ))
            },
        )?;
        // Directions alone are sampled: every path brings its albedo, or what it meets after more hits.
        let settings = RenderSettings {
            budget: Budget::Samples(16),
            ..path(Strategy::Bsdf, 6)
        };
        let picture = trial.picture(&outside, [32, 32], &settings)?;
        let brightest = (0..picture.film.len())
            .map(|pixel| picture.film.mean(pixel)[0])
            // The corners of the window are sky.
            .filter(|value| *value < 0.999)
            .fold(0.0, f64::max);
        trial.note(
            label,
            "never brighter than the sky",
            Figure::absolute(
                (brightest - 1.0).max(0.0),
                0.0,
                picture.film.total_samples(),
            ),
        );
    }
    Ok(())
}

pub(super) fn bad_reflectances(trial: &mut Trial<'_>) -> Result<()> {
    let values = [
        "2 2 2",
        "-1 -1 -1",
        "nan 0.5 inf",
        "0.5 0.5 0.5",
        "1e30 0 0",
    ];
    let (mut mtl, mut obj) = (
        String::new(),
        "mtllib mesh.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n".to_owned(),
    );
    for (i, kd) in values.into_iter().enumerate() {
        writeln!(mtl, "newmtl m{i}\nKd {kd}\nKs 0 0 0\nillum {}", i * 37).expect("memory");
        writeln!(obj, "v {i} 0 {i}\nusemtl m{i}\nf 1 2 {}", 4 + i).expect("memory");
    }
    let folder = tempfile::tempdir().map_err(|error| Error::io(&std::env::temp_dir(), &error))?;
    for (name, text) in [("mesh.obj", &obj), ("mesh.mtl", &mtl)] {
        let path = folder.path().join(name);
        std::fs::write(&path, text).map_err(|error| Error::io(&path, &error))?;
    }
    let label = "MTL with Kd 2, −1, NaN, inf, 1e30";
    // A clear refusal is as good as a clamp that is told of.
    let wrong = match scene::load(Path::new(&folder.path().join("mesh.obj")), &[]) {
        Err(error) => u64::from(error.place.is_none()),
        Ok(scene) => {
            let out_of_range = |bsdf: &BsdfDescription| match bsdf {
                BsdfDescription::Lambertian { reflectance }
                | BsdfDescription::Mirror { reflectance } => {
                    !(0..3).all(|k| (0.0..=1.0).contains(&reflectance[k]))
                }
                BsdfDescription::Glossy {
                    diffuse, specular, ..
                } => !(0..3).all(|k| (0.0..=1.0).contains(&(diffuse[k] + specular[k]))),
                _ => false,
            };
            let bad = scene
                .materials
                .iter()
                .filter(|m| out_of_range(&m.bsdf))
                .count();
            bad as u64 + u64::from(scene.warnings.is_empty())
        }
    };
    trial.note(
        label,
        "in [0, 1] and told of, or refused",
        Figure::none_of(wrong, 5),
    );
    Ok(())
}
