//! Rays that leave a surface: they must neither meet it again nor pass what is near.

use glam::DVec3;

use super::closed_meshes::Random;
use super::rays::{Rays, narrow, wide};
use super::trial::{Figure, Trial};
use crate::accel::{self, Accel};
use crate::error::Result;
use crate::geometry::{Geometry, PrimitiveId, Triangle, spawn_origin, triangle_point};
use crate::math::{LANES, Vec3s};

/// Escapes from a closed room that are tolerated, by bounce.
const MOST_ESCAPES: f64 = 1e-7;

/// Sizes of scenes.
const SIZES: [f64; 5] = [1e-6, 1e-3, 1.0, 1e3, 1e7];

/// A turn about a skew axis.
fn turn() -> glam::DQuat {
    glam::DQuat::from_scaled_axis(DVec3::new(0.3, 1.1, -0.7))
}

/// Triangles of quads, each given by its corners in order; turned and scaled.
fn quads(size: f64, quads: &[[DVec3; 4]]) -> Geometry {
    let triangles = quads
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
        .map(|corners| Triangle {
            corners: corners.map(|p| narrow(turn() * p * size)),
        })
        .collect();
    Geometry {
        triangles,
        ..Geometry::default()
    }
}

/// The prism over a polygon in the xy plane, from z = −1 to 1.
fn prism(size: f64, plan: &[[f64; 2]]) -> Geometry {
    let at = |i: usize, z: f64| {
        let [x, y] = plan[i % plan.len()];
        DVec3::new(x, y, z)
    };
    let mut faces: Vec<[DVec3; 4]> = (0..plan.len())
        .map(|i| [at(i, -1.0), at(i + 1, -1.0), at(i + 1, 1.0), at(i, 1.0)])
        .collect();
    for z in [-1.0, 1.0] {
        // A triangle's fourth corner is its third: the second half has no area.
        faces.push([at(0, z), at(1, z), at(2, z), at(plan.len() - 1, z)]);
    }
    let mut geometry = quads(size, &faces);
    geometry.triangles.retain(|triangle| {
        let [a, b, c] = triangle.corners.map(wide);
        (b - a).cross(c - a) != DVec3::ZERO
    });
    geometry
}

/// The unit normal of a triangle.
fn normal(triangle: &Triangle) -> DVec3 {
    let [a, b, c] = triangle.corners.map(wide);
    (b - a).cross(c - a).normalize()
}

/// A ray (origin and direction), the triangle that it hits, and the direction in which it goes on.
type Departure = ([[f32; 3]; 2], u32, DVec3);

/// Origins of rays that go on along `out` from where rays that hit `id` did, by the renderer's lane code.
fn spawn(geometry: &Geometry, hits: &[Departure]) -> Vec<[f32; 3]> {
    hits.chunks(LANES)
        .flat_map(|group| {
            let lanes = |value: &dyn Fn(&Departure) -> DVec3| {
                let values: [[f64; 3]; LANES] =
                    std::array::from_fn(|i| value(&group[i.min(group.len() - 1)]).to_array());
                Vec3s::from_lanes(&values)
            };
            let triangle = |id: u32| geometry.triangles[id as usize];
            let corner = |k: usize| lanes(&|hit| wide(triangle(hit.1).corners[k]));
            let point = triangle_point(
                lanes(&|hit| wide(hit.0[0])),
                lanes(&|hit| wide(hit.0[1])),
                [corner(0), corner(1), corner(2)],
            );
            let normals = lanes(&|hit| normal(&triangle(hit.1)));
            let origins = spawn_origin(&point, normals, lanes(&|hit| hit.2)).to_lanes();
            (0..group.len())
                .map(move |i| origins[i].map(|x| x as f32))
                .collect::<Vec<_>>()
        })
        .collect()
}

/// Cosine-distributed bounces in a closed mesh about the origin; returns escapes and hits on the wall
/// just left.
fn bounce(accel: &dyn Accel, geometry: &Geometry, paths: usize, bounces: u64) -> [u64; 2] {
    let mut random = Random(3);
    let start = |random: &mut Random| ([0.0; 3], narrow(random.direction()));
    let mut rays = Rays::default();
    for _ in 0..paths {
        let (origin, direction) = start(&mut random);
        rays.push(origin, direction, PrimitiveId::NONE);
    }
    let [mut escapes, mut again] = [0; 2];
    for _ in 0..bounces {
        let hits = rays.closest(accel);
        let mut next = Rays::default();
        let mut spawned = Vec::new();
        for (i, &(_, id)) in hits.iter().enumerate() {
            if id == PrimitiveId::NONE {
                escapes += 1;
                let (origin, direction) = start(&mut random);
                next.push(origin, direction, PrimitiveId::NONE);
                continue;
            }
            again += u64::from(id == rays.skip(i));
            let ray = rays.ray(i);
            let normal = normal(&geometry.triangles[id as usize]);
            let inward = -normal * normal.dot(wide(ray[1])).signum();
            let out = (random.direction() + inward).normalize();
            spawned.push((ray, id, out));
        }
        for (origin, &(_, id, out)) in spawn(geometry, &spawned).into_iter().zip(&spawned) {
            next.push(origin, narrow(out), id);
        }
        rays = next;
    }
    [escapes, again]
}

pub(super) fn closed_room(trial: &mut Trial<'_>) -> Result<()> {
    let paths = 1_000;
    let bounces = match trial.leak_rays() {
        Some(rays) => rays.div_ceil(paths as u64),
        None => trial.count(200),
    };
    let cube = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let (sin, cos) = 10f64.to_radians().sin_cos();
    // An isosceles triangle with 20° at its tip, about the origin.
    let wedge = [[-cos, 0.0], [2.0 * cos, -3.0 * sin], [2.0 * cos, 3.0 * sin]];
    for (name, plan) in [("cube", &cube[..]), ("20° wedge", &wedge[..])] {
        for size in SIZES {
            let geometry = prism(size, plan);
            let samples = paths as u64 * bounces;
            let mut again = 0;
            trial.on_structures(
                format!("{name}, size {size:e}"),
                "no bounce escapes",
                |_, structure| {
                    let accel = accel::build(structure, &geometry)?;
                    let found = bounce(&*accel, &geometry, paths, bounces);
                    again += found[1];
                    Ok(Figure::share(found[0], samples, MOST_ESCAPES))
                },
            )?;
            trial.note(
                format!("{name}, size {size:e}"),
                "the wall just left is not hit",
                Figure::none_of(again, samples * trial.structures.len() as u64),
            );
        }
    }
    Ok(())
}

pub(super) fn self_hits(trial: &mut Trial<'_>) -> Result<()> {
    let (triangles, per_triangle) = (trial.count(1_000).min(4_000), 25);
    for (size, offset) in [
        (1e-6, 0.0),
        (1e-3, 0.0),
        (1.0, 0.0),
        (1e3, 0.0),
        (1e7, 0.0),
        (1.0, 10.0),
        (1.0, 1e6),
    ] {
        let mut random = Random(4);
        let center = offset * DVec3::new(0.6, -0.5, 0.62);
        let triangles: Vec<Triangle> = (0..triangles)
            .map(|_| Triangle {
                corners: [(); 3].map(|()| narrow(center + size * random.direction())),
            })
            .filter(|triangle| {
                let [a, b, c] = triangle.corners.map(wide);
                (b - a).cross(c - a) != DVec3::ZERO
            })
            .collect();
        let geometry = Geometry {
            triangles,
            ..Geometry::default()
        };
        let mut hits = Vec::new();
        for (id, triangle) in (0u32..).zip(&geometry.triangles) {
            let [a, b, c] = triangle.corners.map(wide);
            for _ in 0..per_triangle {
                let target =
                    a + random.uniform() * 0.5 * (b - a) + random.uniform() * 0.5 * (c - a);
                let from = target + 3.0 * size * random.direction();
                let ray = [narrow(from), narrow((target - from).normalize())];
                hits.push((ray, id, random.direction()));
            }
        }
        let mut rays = Rays::default();
        for (origin, &(_, id, out)) in spawn(&geometry, &hits).into_iter().zip(&hits) {
            rays.push(origin, narrow(out), id);
        }
        let samples = rays.len() as u64;
        let label = format!("size {size:e} at {offset:e}");
        trial.on_structures(label, "a plane is never met again", |_, structure| {
            let accel = accel::build(structure, &geometry)?;
            let hits = rays.closest(&*accel);
            let again = (0..hits.len()).filter(|&i| hits[i].1 == rays.skip(i));
            Ok(Figure::none_of(again.count() as u64, samples))
        })?;
    }
    Ok(())
}

/// Squares per side of a face of the cube.
const SQUARES: usize = 8;

pub(super) fn convex_neighbours(trial: &mut Trial<'_>) -> Result<()> {
    let count = trial.count(40_000);
    let squares: Vec<[DVec3; 4]> = (0..6 * SQUARES * SQUARES)
        .map(|square| {
            let (side, square) = (square / (SQUARES * SQUARES), square % (SQUARES * SQUARES));
            let coordinate = |i: usize| 2.0 * i as f64 / SQUARES as f64 - 1.0;
            let corner = |i: usize, j: usize| {
                let (u, v) = (
                    coordinate(square % SQUARES + i),
                    coordinate(square / SQUARES + j),
                );
                let w = if side < 3 { -1.0 } else { 1.0 };
                [
                    DVec3::new(u, v, w),
                    DVec3::new(w, u, v),
                    DVec3::new(v, w, u),
                ][side % 3]
            };
            [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)]
        })
        .collect();
    for size in SIZES {
        let geometry = quads(size, &squares);
        let mut random = Random(5);
        let mut hits = Vec::new();
        for _ in 0..count {
            let id = random.below(geometry.triangles.len());
            let triangle = &geometry.triangles[id];
            let [a, b, c] = triangle.corners.map(wide);
            let normal = normal(triangle);
            let outward = normal * normal.dot(a).signum();
            let (mut u, v) = (random.uniform(), random.uniform());
            if random.below(3) == 0 {
                u *= 1e-6;
            }
            let (u, v) = if u + v > 1.0 {
                (1.0 - u, 1.0 - v)
            } else {
                (u, v)
            };
            let target = a + u * (b - a) + v * (c - a);
            let aside = random.direction();
            let from = target + size * (aside + 1.5 * outward);
            let ray = [narrow(from), narrow((target - from).normalize())];
            // Half of them leave at a grazing angle.
            let lift = 1e-4
                + if random.below(2) == 0 {
                    0.0
                } else {
                    random.uniform()
                };
            let flat = (aside - aside.dot(outward) * outward).normalize();
            hits.push((ray, id as u32, (flat + lift * outward).normalize()));
        }
        let mut rays = Rays::default();
        for (origin, &(_, id, out)) in spawn(&geometry, &hits).into_iter().zip(&hits) {
            rays.push(origin, narrow(out), id);
        }
        let label = format!("size {size:e}, grazing by 1e-4");
        trial.on_structures(label, "convex: nothing is hit", |_, structure| {
            let accel = accel::build(structure, &geometry)?;
            let hits = rays.closest(&*accel);
            let wrong = hits.iter().filter(|hit| hit.1 != PrimitiveId::NONE);
            Ok(Figure::none_of(wrong.count() as u64, count))
        })?;
    }
    Ok(())
}

/// Gaps are tried down from 10⁻², four per decade.
const GAPS_PER_DECADE: i32 = 4;

pub(super) fn smallest_gap(trial: &mut Trial<'_>) -> Result<()> {
    let count = trial.count(4_000);
    for size in SIZES {
        trial.on_structures(
            format!("scene of size {size:e}"),
            "smallest gap with shadow",
            |_, structure| {
                let mut smallest = f64::INFINITY;
                for step in 2 * GAPS_PER_DECADE..=8 * GAPS_PER_DECADE {
                    let gap = 10f64.powf(-f64::from(step) / f64::from(GAPS_PER_DECADE));
                    let geometry = floor_and_plate(size, gap);
                    let accel = accel::build(structure, &geometry)?;
                    if !is_shadowed(&*accel, &geometry, size, count) {
                        break;
                    }
                    smallest = gap;
                }
                Ok(Figure::relative(smallest, 2e-6, count))
            },
        )?;
    }
    Ok(())
}

/// A floor of two triangles, and over it at a gap a plate of two, in units of `size`.
fn floor_and_plate(size: f64, gap: f64) -> Geometry {
    let square = |z: f64| {
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| DVec3::new(x, y, z))
    };
    quads(size, &[square(0.0), square(gap)])
}

/// Whether every ray that leaves the floor upwards meets the plate.
fn is_shadowed(accel: &dyn Accel, geometry: &Geometry, size: f64, count: u64) -> bool {
    let mut random = Random(6);
    let place = |p: DVec3| turn() * p * size;
    let hits: Vec<_> = (0..count)
        .map(|_| {
            let mut at = || 1.8 * random.uniform() - 0.9;
            let target = place(DVec3::new(at(), at(), 0.0));
            let [mut from, mut out] = [(); 2].map(|()| random.direction());
            from.z = from.z.abs() + 0.1;
            // Steep enough not to pass beside the plate.
            out.z = out.z.abs() + 0.5;
            let from = target + place(from);
            let ray = [narrow(from), narrow((target - from).normalize())];
            let local = turn().inverse() * (target / size);
            // The floor's diagonal runs from its first corner to its third.
            let id = u32::from(local.y > local.x);
            (ray, id, (turn() * out).normalize())
        })
        .collect();
    let mut rays = Rays::default();
    for (origin, &(_, id, out)) in spawn(geometry, &hits).into_iter().zip(&hits) {
        rays.push(origin, narrow(out), id);
    }
    rays.closest(accel)
        .iter()
        .all(|hit| hit.1 == 2 || hit.1 == 3)
}
