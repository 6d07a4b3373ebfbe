//! What every structure must answer, whatever it is inside.

mod batches;

use glam::DVec3;

use super::*;
use crate::geometry::testing::{Mesh, Rng, cube, hexagonal_room, lane, lat_long_sphere, torus};
use crate::geometry::triangle::ShearRay;
use crate::geometry::{PrimitiveId, Sphere, Triangle, spawn_origin, triangle_point};
use crate::math::Vec3s;
use crate::math::lanes::padded;

/// The scan is the only one that is not a tree, and the only one with a triangle test of its own.
const TREES: [Structure; Structure::ALL.len() - 1] = {
    let [Structure::Linear, trees @ ..] = Structure::ALL else {
        panic!("the scan comes first");
    };
    trees
};

/// Rays in columns.
#[derive(Default)]
struct Rays {
    origin: [Vec<f32>; 3],
    direction: [Vec<f32>; 3],
    skip: Vec<u32>,
    len: usize,
}

impl Rays {
    fn push(&mut self, origin: [f32; 3], direction: [f32; 3], skip: u32) {
        for k in 0..3 {
            self.origin[k].truncate(self.len);
            self.direction[k].truncate(self.len);
            self.origin[k].push(origin[k]);
            self.direction[k].push(direction[k]);
        }
        self.skip.truncate(self.len);
        self.skip.push(skip);
        self.len += 1;
    }

    /// Pads with NaN, as a queue may.
    fn batch(&mut self) -> RayBatch<'_> {
        let padded = padded(self.len);
        for column in self.origin.iter_mut().chain(&mut self.direction) {
            column.resize(padded, f32::NAN);
        }
        self.skip.resize(padded, 0);
        let [ox, oy, oz] = &self.origin;
        let [dx, dy, dz] = &self.direction;
        RayBatch {
            len: self.len,
            origin: [ox, oy, oz],
            direction: [dx, dy, dz],
            skip: &self.skip,
        }
    }

    fn ray(&self, i: usize) -> ([f32; 3], [f32; 3]) {
        (
            [0, 1, 2].map(|k| self.origin[k][i]),
            [0, 1, 2].map(|k| self.direction[k][i]),
        )
    }

    fn closest(&mut self, accel: &dyn Accel) -> Vec<(f32, u32)> {
        let size = padded(self.len);
        let (mut t, mut primitive) = (vec![0.0; size], vec![0; size]);
        let mut counters = AccelCounters::default();
        let len = self.len;
        accel.closest(
            self.batch(),
            HitBatch {
                t: &mut t,
                primitive: &mut primitive,
            },
            &mut counters,
        );
        t.into_iter().zip(primitive).take(len).collect()
    }

    fn occluded(&mut self, accel: &dyn Accel, t_max: &[f32], target: &[u32]) -> Vec<bool> {
        self.occluded_counted(accel, t_max, target).0
    }

    fn occluded_counted(
        &mut self,
        accel: &dyn Accel,
        t_max: &[f32],
        target: &[u32],
    ) -> (Vec<bool>, AccelCounters) {
        let size = padded(self.len);
        let (mut t_max, mut target) = (t_max.to_vec(), target.to_vec());
        t_max.resize(size, f32::NAN);
        target.resize(size, 0);
        let mut occluded = vec![7; size];
        let len = self.len;
        let mut counters = AccelCounters::default();
        let rays = self.batch();
        accel.occluded(
            ShadowBatch {
                rays,
                t_max: &t_max,
                target: &target,
            },
            &mut occluded,
            &mut counters,
        );
        let occluded = occluded.into_iter().take(len).map(|o| o != 0).collect();
        (occluded, counters)
    }
}

fn normalized(v: [f64; 3]) -> [f32; 3] {
    DVec3::from_array(v)
        .normalize()
        .to_array()
        .map(|x| x as f32)
}

fn towards(from: [f32; 3], to: [f64; 3]) -> [f32; 3] {
    normalized([0, 1, 2].map(|k| to[k] - f64::from(from[k])))
}

fn geometry(mesh: &Mesh) -> Geometry {
    Geometry {
        triangles: mesh.triangles(),
        ..Geometry::default()
    }
}

fn built(structure: Structure, geometry: &Geometry) -> Box<dyn Accel> {
    build(structure, geometry).expect("few primitives")
}

/// Rays from `inside` (a function of the generator) in all directions, at vertices, at points on edges,
/// and along the axes with either sign of zero; with `level`, half of the last start on the level of a
/// vertex, which must stay inside for vertices within 0.3 extents of the middle.
fn adversarial(
    mesh: &Mesh,
    level: bool,
    n: usize,
    rng: &mut Rng,
    mut inside: impl FnMut(&mut Rng) -> [f32; 3],
) -> Rays {
    let mut rays = Rays::default();
    for i in 0..n {
        let mut origin = inside(rng);
        let face = mesh.faces[rng.below(mesh.faces.len())];
        let [a, b] = [face[0], face[1]].map(|v| mesh.positions[v].map(f64::from));
        let direction = match i % 4 {
            0 => rng.sphere(),
            1 => towards(origin, a),
            2 => {
                let s = f64::from(rng.uniform());
                towards(origin, [0, 1, 2].map(|k| a[k] + s * (b[k] - a[k])))
            }
            _ => {
                let axis = rng.below(3);
                let mut d = [0, 1, 2].map(|_| if rng.below(2) == 0 { 0.0 } else { -0.0 });
                d[axis] = if rng.below(2) == 0 { 1.0 } else { -1.0 };
                if rng.below(4) == 0 {
                    d[(axis + 1) % 3] = 10f32.powi(-7 - rng.below(38) as i32);
                }
                if level && rng.below(2) == 0 {
                    let other = (axis + 1) % 3;
                    let at = mesh.positions[face[0]][other];
                    let middle = mesh
                        .positions
                        .iter()
                        .map(|p| f64::from(p[other]))
                        .sum::<f64>()
                        / mesh.positions.len() as f64;
                    let reach = mesh
                        .positions
                        .iter()
                        .map(|p| (f64::from(p[other]) - middle).abs())
                        .fold(0.0, f64::max);
                    if (f64::from(at) - middle).abs() < 0.3 * reach {
                        origin[other] = at;
                    }
                }
                d
            }
        };
        rays.push(origin, direction, PrimitiveId::NONE);
    }
    rays
}

/// A point within a third of `size` of `center`.
fn near(center: [f32; 3], size: f32) -> impl FnMut(&mut Rng) -> [f32; 3] {
    move |rng| {
        let p = rng.sphere();
        let r = 0.3 * size * rng.uniform();
        [0, 1, 2].map(|k| center[k] + r * p[k])
    }
}

/// A room of groups, and the same with spheres in it.
fn room() -> Geometry {
    let (mesh, groups) = hexagonal_room();
    let spheres = [
        ([8.5, -2.8, -3.4], 1.6),
        ([5.5, -0.4, -1.6], 1.2),
        ([9.0, 2.6, 0.4], 1.5),
    ];
    let spheres = spheres
        .map(|(center, radius)| Sphere { center, radius })
        .to_vec();
    Geometry {
        triangles: mesh.triangles(),
        spheres,
        groups,
        segment_ends: None,
    }
}

fn point_in_room(rng: &mut Rng) -> [f32; 3] {
    [
        10.0 * rng.uniform(),
        10.0 * rng.uniform() - 5.0,
        9.9 * rng.uniform() - 4.95,
    ]
}

/// Triangles and spheres of all sizes at random places within about two units of the origin.
fn soup(triangles: usize, spheres: usize, rng: &mut Rng) -> Geometry {
    let corners = |rng: &mut Rng| {
        let (center, size) = (rng.sphere(), 0.01 + rng.uniform() * rng.uniform());
        [(); 3].map(|()| {
            let p = rng.sphere();
            [0, 1, 2].map(|k| center[k] + size * p[k])
        })
    };
    Geometry {
        triangles: (0..triangles)
            .map(|_| Triangle {
                corners: corners(rng),
            })
            .collect(),
        spheres: (0..spheres)
            .map(|_| Sphere {
                center: rng.sphere(),
                radius: 0.3 * rng.uniform() + 0.01,
            })
            .collect(),
        groups: Vec::new(),
        segment_ends: None,
    }
}

fn random_rays(n: usize, rng: &mut Rng, mut origin: impl FnMut(&mut Rng) -> [f32; 3]) -> Rays {
    let mut rays = Rays::default();
    for _ in 0..n {
        let (origin, direction) = (origin(rng), rng.sphere());
        rays.push(origin, direction, PrimitiveId::NONE);
    }
    rays
}

#[test]
fn no_ray_from_inside_a_closed_sphere_escapes() {
    let far = [148_376.0, 1_234.0, -223_423.0];
    let mut rng = Rng(1);
    for structure in Structure::ALL {
        for (scale, center) in [
            (2.0, [0.0; 3]),
            (2.0, far),
            (2.0, [1e6; 3]),
            (2e-6, [0.0; 3]),
            (2e7, [0.0; 3]),
        ] {
            // The linear scan is tried with shared edges (few triangles) and without.
            let sizes = if structure == Structure::Linear {
                [(12, 10_000), (4, 90_000)]
            } else {
                [(40, 50_000); 2]
            };
            for ((rows, n), jitter) in sizes.into_iter().zip([0.0, 0.3]) {
                let mesh = lat_long_sphere(rows, 2 * rows, jitter, &mut rng).placed(scale, center);
                let accel = built(structure, &geometry(&mesh));
                let mut rays = adversarial(&mesh, true, n, &mut rng, near(center, scale));
                let lost = rays
                    .closest(&*accel)
                    .iter()
                    .filter(|hit| hit.1 == PrimitiveId::NONE)
                    .count();
                assert_eq!(
                    lost, 0,
                    "{structure:?}: {rows} rows, size {scale}, at {center:?}, jitter {jitter}"
                );
            }
        }
    }
}

#[test]
fn no_ray_from_inside_a_torus_or_a_cube_or_a_room_of_merged_polygons_escapes() {
    let mut rng = Rng(2);
    let in_tube = |rng: &mut Rng| {
        let (sin, cos) = (rng.uniform() * std::f32::consts::TAU).sin_cos();
        let p = rng.sphere();
        [cos + 0.1 * p[0], sin + 0.1 * p[1], 0.1 * p[2]]
    };
    for structure in Structure::ALL {
        let mesh = torus(24, 12, 0.3);
        let accel = built(structure, &geometry(&mesh));
        let mut rays = adversarial(&mesh, false, 50_000, &mut rng, in_tube);
        assert!(
            rays.closest(&*accel)
                .iter()
                .all(|hit| hit.1 != PrimitiveId::NONE),
            "{structure:?}, torus"
        );

        for turned in [false, true] {
            let turn = if turned {
                rng.rotation()
            } else {
                [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            };
            let cube = cube().turned(turn);
            let groups = (0..12).map(|face| face / 2).collect();
            let accel = built(
                structure,
                &Geometry {
                    triangles: cube.triangles(),
                    groups,
                    ..Geometry::default()
                },
            );
            let mut rays = adversarial(&cube, true, 100_000, &mut rng, near([0.0; 3], 1.0));
            assert!(
                rays.closest(&*accel)
                    .iter()
                    .all(|hit| hit.1 != PrimitiveId::NONE),
                "{structure:?}, cube"
            );

            let (mesh, groups) = hexagonal_room();
            let mesh = mesh.turned(turn);
            let accel = built(
                structure,
                &Geometry {
                    triangles: mesh.triangles(),
                    groups,
                    ..Geometry::default()
                },
            );
            let place = |rng: &mut Rng| {
                let p = point_in_room(rng);
                turn.map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2])
            };
            let mut rays = adversarial(&mesh, !turned, 100_000, &mut rng, place);
            assert!(
                rays.closest(&*accel)
                    .iter()
                    .all(|hit| hit.1 != PrimitiveId::NONE),
                "{structure:?}, room"
            );
        }
    }
}

/// What f64 says of one triangle: distance, least barycentric coordinate, and a bound of what f32 may do
/// to the distance.
fn triangle_oracle(
    triangle: &Triangle,
    origin: DVec3,
    direction: DVec3,
) -> Option<(f64, f64, f64)> {
    let [a, b, c] = triangle
        .corners
        .map(|p| DVec3::from_array(p.map(f64::from)) - origin);
    let normal = (b - a).cross(c - a);
    let cosine = normal.normalize().dot(direction);
    let [u, v, w] = [
        direction.dot(b.cross(c)),
        direction.dot(c.cross(a)),
        direction.dot(a.cross(b)),
    ];
    let determinant = u + v + w;
    if determinant == 0.0 {
        return None;
    }
    let t = a.dot(normal) / direction.dot(normal);
    let least = (u / determinant).min(v / determinant).min(w / determinant);
    // The corners' images and the plane's equation carry no more than sixteen roundings of the distance
    // to the farthest corner, seen under the angle to the plane.
    let reach = a.length().max(b.length()).max(c.length());
    Some((
        t,
        least,
        f64::from(crate::math::float::gamma(16)) * reach / cosine.abs(),
    ))
}

fn sphere_oracle(sphere: &Sphere, origin: DVec3, direction: DVec3) -> Option<(f64, f64, f64)> {
    let radius = f64::from(sphere.radius);
    let arm = DVec3::from_array(sphere.center.map(f64::from)) - origin;
    let middle = arm.dot(direction);
    let inside = 1.0 - (arm - middle * direction).length_squared() / (radius * radius);
    let half = inside.max(0.0).sqrt() * radius;
    let t = if middle - half > 0.0 {
        middle - half
    } else {
        middle + half
    };
    let bound =
        f64::from(crate::math::float::gamma(16)) * (arm.length() + radius) / inside.abs().sqrt();
    Some((t, inside, bound))
}

#[test]
fn every_structure_agrees_with_f64() {
    let mut rng = Rng(3);
    let small = soup(60, 20, &mut rng);
    let large = soup(800, 200, &mut rng);
    let room = room();
    for (name, geometry, n) in [
        ("small", &small, 10_000),
        ("large", &large, 3_000),
        ("room", &room, 20_000),
    ] {
        let mut rays = random_rays(n, &mut rng, |rng| {
            if name == "room" {
                point_in_room(rng)
            } else {
                rng.sphere().map(|x| 2.0 * x)
            }
        });
        let answers: Vec<_> = Structure::ALL
            .map(|structure| rays.closest(&*built(structure, geometry)))
            .into();
        let (mut judged, mut hits) = (0, 0);
        for i in 0..n {
            let (origin, direction) = rays.ray(i);
            let [origin, direction] =
                [origin, direction].map(|v| DVec3::from_array(v.map(f64::from)));
            let direction = direction.normalize();
            let triangles = geometry
                .triangles
                .iter()
                .map(|t| triangle_oracle(t, origin, direction));
            let spheres = geometry
                .spheres
                .iter()
                .map(|s| sphere_oracle(s, origin, direction));
            // Near silhouettes, starts, and one another, f32 may rightly decide otherwise: such rays are
            // left out, and counted.
            let mut doubtful = false;
            let mut candidates = Vec::new();
            for (id, found) in triangles.chain(spheres).enumerate() {
                let Some((t, least, bound)) = found else {
                    continue;
                };
                let near = least.abs() < 1e-3 || t.abs() < 2.0 * bound || bound > 1e-3;
                let shared_edge = !geometry.groups.is_empty() && id < geometry.triangles.len();
                doubtful |= near
                    && least > -1e-3
                    && t > -2.0 * bound
                    && !(shared_edge && least.abs() < 1e-9);
                if least > 0.0 && t > 0.0 {
                    candidates.push((t, id as u32, bound));
                }
            }
            candidates.sort_by(|a, b| a.0.total_cmp(&b.0));
            if let [first, second, ..] = candidates[..] {
                doubtful |= second.0 - first.0 < 2.0 * (first.2 + second.2);
            }
            if doubtful {
                continue;
            }
            judged += 1;
            let part = |id: u32| {
                geometry
                    .groups
                    .get(id as usize)
                    .map_or(id, |group| group + 1_000_000)
            };
            for (structure, answer) in Structure::ALL.iter().zip(&answers) {
                let (t, id) = answer[i];
                match candidates.first() {
                    None => assert_eq!(
                        (t, id),
                        (f32::INFINITY, PrimitiveId::NONE),
                        "{structure:?} in {name}"
                    ),
                    Some(&(expected, part_of, bound)) => {
                        assert_eq!(part(id), part(part_of), "{structure:?} in {name}, ray {i}");
                        assert!(
                            (f64::from(t) - expected).abs() <= bound,
                            "{structure:?} in {name}: {t} {expected}"
                        );
                        hits += 1;
                    }
                }
            }
        }
        assert!(
            judged * 10 > n * 7,
            "only {judged} of {n} rays could be judged in {name}"
        );
        assert!(hits > n / 10, "{hits} hits in {name}");
    }
}

#[test]
fn all_trees_give_the_same_bits() {
    let mut rng = Rng(28);
    let mesh = lat_long_sphere(30, 60, 0.3, &mut rng);
    let soup = soup(700, 0, &mut rng);
    for geometry in [&geometry(&mesh), &soup] {
        let mut rays = adversarial(&mesh, true, 40_000, &mut rng, near([0.0; 3], 1.0));
        let [answers, others @ ..] = TREES.map(|s| rays.closest(&*built(s, geometry)));
        // And the plain loop, with its own way of choosing the lower id.
        for (i, answer) in answers.iter().enumerate().take(4_000) {
            let (origin, direction) = rays.ray(i);
            let ray = ShearRay::new(origin, direction);
            let nearest = (0u32..)
                .zip(&geometry.triangles)
                .filter_map(|(id, triangle)| Some((ray.intersect(triangle)?, id)))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            assert_eq!(
                *answer,
                nearest.unwrap_or((f32::INFINITY, PrimitiveId::NONE))
            );
        }
        assert!(others.iter().all(|other| *other == answers));
    }
}

#[test]
fn every_build_quality_gives_the_same_bits() {
    let mut rng = Rng(33);
    // A few triangles that are large against the others, and askew, are split at best quality.
    let large = torus(12, 6, 0.4).turned(rng.rotation());
    let small = lat_long_sphere(120, 240, 0.2, &mut rng).placed(0.01, [0.0; 3]);
    let geometry = Geometry {
        triangles: [large.triangles(), small.triangles()].concat(),
        ..Geometry::default()
    };
    let options = [BuildQuality::Fast, BuildQuality::Medium, BuildQuality::Best].map(|quality| {
        BuildOptions {
            quality,
            ..BuildOptions::default()
        }
    });
    let whole = 2 * geometry.len() - 1;
    let nodes = options.each_ref().map(|o| tree::build(&geometry, o).len());
    assert!(nodes[0] == whole && nodes[1] == whole && nodes[2] > whole);
    let mut rays = adversarial(&large, true, 40_000, &mut rng, near([0.0; 3], 2.0));
    let [fast, medium, best] = options.map(|o| rays.closest(&Bvh2::with_options(&geometry, &o)));
    assert!(fast == medium && medium == best);
}

#[test]
fn more_primitives_than_indices_are_an_error() {
    assert!(check_limit((1 << 31) - 1).is_ok());
    let error = check_limit(1 << 31).expect_err("one too many");
    assert_eq!(error.kind, crate::ErrorKind::Limit);
}

#[test]
fn rays_with_nan_or_infinity_miss() {
    let room = room();
    for structure in Structure::ALL {
        let accel = built(structure, &room);
        let mut rays = Rays::default();
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for axis in 0..3 {
                let (mut origin, mut direction) = ([5.0, 0.0, 0.0], [1.0, 0.0, 0.0]);
                origin[axis] = bad;
                rays.push(origin, [0.6, 0.0, 0.8], PrimitiveId::NONE);
                rays.push([bad; 3], [0.6, 0.0, 0.8], PrimitiveId::NONE);
                direction[axis] = bad;
                rays.push([5.0, 0.0, 0.0], direction, PrimitiveId::NONE);
                rays.push([5.0, 0.0, 0.0], [bad; 3], PrimitiveId::NONE);
            }
        }
        rays.push([5.0, 0.0, 0.0], [0.0; 3], PrimitiveId::NONE);
        for (i, hit) in rays.closest(&*accel).into_iter().enumerate() {
            assert_eq!(
                hit,
                (f32::INFINITY, PrimitiveId::NONE),
                "{structure:?}: {:?}",
                rays.ray(i)
            );
        }
        let n = rays.len;
        let occluded = rays.occluded(
            &*accel,
            &vec![f32::INFINITY; n],
            &vec![PrimitiveId::NONE; n],
        );
        assert!(occluded.iter().all(|o| !o), "{structure:?}");
    }
}

#[test]
fn a_ray_is_answered_the_same_alone_and_in_company() {
    let mut rng = Rng(6);
    for geometry in [&room(), &soup(300, 30, &mut rng)] {
        for structure in Structure::ALL {
            let accel = built(structure, geometry);
            let mut all = random_rays(500, &mut rng, point_in_room);
            let together = all.closest(&*accel);
            let t_max: Vec<f32> = (0..500).map(|_| 15.0 * rng.uniform()).collect();
            let none = vec![PrimitiveId::NONE; 500];
            let blocked = all.occluded(&*accel, &t_max, &none);
            for i in 0..500 {
                let mut alone = Rays::default();
                let (origin, direction) = all.ray(i);
                alone.push(origin, direction, PrimitiveId::NONE);
                let answer = alone.closest(&*accel)[0];
                assert_eq!(
                    (answer.0.to_bits(), answer.1),
                    (together[i].0.to_bits(), together[i].1)
                );
                assert_eq!(
                    alone.occluded(&*accel, &t_max[i..=i], &none[..1])[0],
                    blocked[i]
                );
            }
        }
    }
}

#[test]
fn a_segment_is_occluded_where_the_closest_hit_is_nearer_than_its_end() {
    let mut rng = Rng(7);
    for geometry in [
        &room(),
        &soup(300, 30, &mut rng),
        &soup(40, 0, &mut rng),
        &soup(0, 40, &mut rng),
    ] {
        for structure in Structure::ALL {
            let accel = built(structure, geometry);
            let n = 20_000;
            let mut rays = random_rays(n, &mut rng, |rng| rng.sphere().map(|x| 1.5 * x));
            let hits = rays.closest(&*accel);
            // Ends short of the hit, beyond it, and anywhere.
            let t_max: Vec<f32> = hits
                .iter()
                .enumerate()
                .map(|(i, hit)| match i % 3 {
                    0 => hit.0 * (1.0 - 1e-5),
                    1 => hit.0 * (1.0 + 1e-5),
                    _ => 5.0 * rng.uniform(),
                })
                .collect();
            let occluded = rays.occluded(&*accel, &t_max, &vec![PrimitiveId::NONE; n]);
            for i in 0..n {
                assert_eq!(
                    occluded[i],
                    hits[i].0 < t_max[i],
                    "{structure:?} {:?} {}",
                    hits[i],
                    t_max[i]
                );
            }
            // What is nearest does not occlude itself.
            let targets: Vec<u32> = hits.iter().map(|hit| hit.1).collect();
            let t_max: Vec<f32> = hits.iter().map(|hit| hit.0 * (1.0 + 1e-6)).collect();
            let behind = rays.occluded(&*accel, &t_max, &targets);
            let blocked = behind
                .iter()
                .zip(&hits)
                .filter(|(b, hit)| **b && hit.1 != PrimitiveId::NONE)
                .count();
            // Another hit within a millionth is as rare as silhouettes are thin.
            assert!(blocked <= n / 1_000, "{structure:?}: {blocked}");
        }
    }
}

#[test]
fn scenes_of_almost_nothing_are_answered() {
    let triangle = Triangle {
        corners: [[-1.0, -1.0, 2.0], [1.0, -1.0, 2.0], [0.0, 1.0, 2.0]],
    };
    let behind = Triangle {
        corners: triangle.corners.map(|[x, y, z]| [x, y, z + 1.0]),
    };
    let sphere = Sphere {
        center: [0.0, 0.0, 5.0],
        radius: 1.0,
    };
    let scene = |triangles: &[Triangle], spheres: &[Sphere]| Geometry {
        triangles: triangles.to_vec(),
        spheres: spheres.to_vec(),
        groups: Vec::new(),
        segment_ends: None,
    };
    let miss = (f32::INFINITY, PrimitiveId::NONE);
    for structure in Structure::ALL {
        for (geometry, expected) in [
            (scene(&[], &[]), miss),
            (scene(&[triangle], &[]), (2.0, 0)),
            (scene(&[], &[sphere]), (4.0, 0)),
            (scene(&[behind, triangle], &[]), (2.0, 1)),
            (scene(&[triangle, triangle], &[]), (2.0, 0)),
            (scene(&[behind], &[sphere]), (3.0, 0)),
            (scene(&[], &[sphere, sphere]), (4.0, 0)),
        ] {
            let accel = built(structure, &geometry);
            let mut rays = Rays::default();
            rays.push([0.0, 0.0, 0.0], [0.0, 0.0, 1.0], PrimitiveId::NONE);
            rays.push([0.0, 0.0, 0.0], [0.0, 0.0, -1.0], PrimitiveId::NONE);
            rays.push([9.0, 0.0, 0.0], [-0.0, -0.0, 1.0], PrimitiveId::NONE);
            assert_eq!(
                rays.closest(&*accel),
                [expected, miss, miss],
                "{structure:?}"
            );
            let none = [PrimitiveId::NONE; 3];
            let hit = expected != miss;
            assert_eq!(
                rays.occluded(&*accel, &[9.0; 3], &none),
                [hit, false, false]
            );
            assert_eq!(rays.occluded(&*accel, &[1.5; 3], &none), [false; 3]);
        }
    }
}

#[test]
fn of_a_hundred_thousand_identical_triangles_the_first_is_hit() {
    let triangle = Triangle {
        corners: [[-1.0, -1.0, 2.0], [1.0, -1.0, 2.0], [0.0, 1.0, 2.0]],
    };
    let geometry = Geometry {
        triangles: vec![triangle; 100_000],
        ..Geometry::default()
    };
    for structure in Structure::ALL {
        let accel = built(structure, &geometry);
        let mut rays = Rays::default();
        rays.push([0.0, 0.0, 0.0], [0.0, 0.0, 1.0], PrimitiveId::NONE);
        assert_eq!(rays.closest(&*accel), [(2.0, 0)], "{structure:?}");
    }
}

/// Bounces with a cosine distribution inside a closed mesh; returns escapes and hits on the face just left.
fn bounce(
    accel: &dyn Accel,
    mesh: &Mesh,
    start: [f32; 3],
    paths: usize,
    bounces: usize,
    rng: &mut Rng,
) -> [usize; 2] {
    let triangles = mesh.triangles();
    let mut rays = random_rays(paths, rng, |_| start);
    let [mut escapes, mut again] = [0; 2];
    for _ in 0..bounces {
        let hits = rays.closest(accel);
        let mut next = Rays::default();
        for (i, &(_, id)) in hits.iter().enumerate() {
            let (origin, direction) = rays.ray(i);
            if id == PrimitiveId::NONE {
                escapes += 1;
                next.push(start, rng.sphere(), PrimitiveId::NONE);
                continue;
            }
            again += usize::from(id == rays.skip[i]);
            let corners = triangles[id as usize].corners;
            let [a, b, c] = corners.map(|p| DVec3::from_array(p.map(f64::from)));
            let normal = (b - a).cross(c - a).normalize();
            let inward = if normal.dot(DVec3::from_array(direction.map(f64::from))) > 0.0 {
                -normal
            } else {
                normal
            };
            let sample = (DVec3::from_array(rng.sphere().map(f64::from)) + inward).normalize();
            let sample = sample.to_array().map(|x| x as f32);
            let point = triangle_point(
                Vec3s::splat(origin),
                Vec3s::splat(direction),
                corners.map(Vec3s::splat),
            );
            let normal = normal.to_array().map(|x| x as f32);
            let from = spawn_origin(&point, Vec3s::splat(normal), Vec3s::splat(sample));
            next.push(lane(from, 0), sample, id);
        }
        rays = next;
    }
    [escapes, again]
}

#[test]
fn paths_in_a_closed_cube_never_escape_and_never_hit_the_wall_they_left() {
    let mut rng = Rng(8);
    for structure in Structure::ALL {
        for size in [1e-6, 1.0, 1e7] {
            let mesh = cube().turned(rng.rotation()).placed(size, [0.0; 3]);
            for merged in [false, true] {
                let groups = if merged {
                    (0..12).map(|face| face / 2).collect()
                } else {
                    Vec::new()
                };
                let accel = built(
                    structure,
                    &Geometry {
                        groups,
                        ..geometry(&mesh)
                    },
                );
                let found = bounce(&*accel, &mesh, [0.0; 3], 1_000, 120, &mut rng);
                assert_eq!(
                    found,
                    [0, 0],
                    "{structure:?} at size {size}, merged {merged}"
                );
            }
        }
    }
}

#[test]
fn rays_that_leave_a_convex_mesh_of_coplanar_faces_hit_nothing() {
    let mut rng = Rng(5);
    for structure in Structure::ALL {
        for size in [1e-6, 1.0, 1e7] {
            // A turned cube of 4 × 4 squares per side.
            let turn = rng.rotation();
            let mut mesh = Mesh {
                positions: Vec::new(),
                faces: Vec::new(),
            };
            for side in 0..6 {
                for square in 0..16 {
                    let corner = |i: usize, j: usize| {
                        let [u, v] = [
                            (square % 4 + i) as f32 / 2.0 - 1.0,
                            (square / 4 + j) as f32 / 2.0 - 1.0,
                        ];
                        let w = if side < 3 { -1.0 } else { 1.0 };
                        [[u, v, w], [w, u, v], [v, w, u]][side % 3]
                    };
                    let base = mesh.positions.len();
                    mesh.positions
                        .extend([corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)]);
                    mesh.faces
                        .extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
                }
            }
            let mesh = mesh.turned(turn).placed(size, [0.0; 3]);
            let triangles = mesh.triangles();
            let accel = built(structure, &geometry(&mesh));
            let mut rays = Rays::default();
            for _ in 0..20_000 {
                let id = rng.below(triangles.len());
                let corners = triangles[id].corners;
                let [a, b, c] = corners.map(|p| DVec3::from_array(p.map(f64::from)));
                let normal = (b - a).cross(c - a).normalize();
                let normal = if normal.dot(a) < 0.0 { -normal } else { normal };
                let (mut s, t) = rng.barycentrics();
                if rng.below(3) == 0 {
                    s *= 1e-6;
                }
                // Reach the point from outside, then leave it, half of the time at a grazing angle.
                let target = a + f64::from(s) * (b - a) + f64::from(t) * (c - a);
                let random = DVec3::from_array(rng.sphere().map(f64::from));
                let from = target + f64::from(size) * (random + normal * 1.5);
                let direction = (target - from).normalize().to_array().map(|x| x as f32);
                let origin = from.to_array().map(|x| x as f32);
                let point = triangle_point(
                    Vec3s::splat(origin),
                    Vec3s::splat(direction),
                    corners.map(Vec3s::splat),
                );
                let flat = random - random.dot(normal) * normal;
                let lift = if rng.below(2) == 0 {
                    1e-4
                } else {
                    f64::from(rng.uniform()) + 1e-4
                };
                let away = (flat.normalize() + lift * normal)
                    .normalize()
                    .to_array()
                    .map(|x| x as f32);
                let n = normal.to_array().map(|x| x as f32);
                let spawned = spawn_origin(&point, Vec3s::splat(n), Vec3s::splat(away));
                rays.push(lane(spawned, 0), away, id as u32);
            }
            let hits = rays
                .closest(&*accel)
                .iter()
                .filter(|hit| hit.1 != PrimitiveId::NONE)
                .count();
            assert_eq!(hits, 0, "{structure:?} at size {size}");
        }
    }
}

/// From 100 away a needle is seen under angles down to 10⁻⁵ degrees. The quotient of plane distances is
/// unbounded there, barycentric interpolation is not.
#[test]
fn hits_on_needles_at_grazing_angles_lie_on_the_needle() {
    let mut rng = Rng(23);
    for structure in Structure::ALL {
        let mut hits = 0;
        for (aspect, angle) in [
            (1.0f32, 0.01f32),
            (1.0, 1e-5),
            (1e3, 0.5),
            (1e5, 0.5),
            (1e5, 0.01),
            (1.0, 1e-6),
        ] {
            for _ in 0..300 {
                let turn = rng.rotation();
                let place =
                    |p: [f32; 3]| turn.map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2]);
                let corners = [
                    place([0.0; 3]),
                    place([10.0, 0.0, 0.0]),
                    place([5.0, 10.0 / aspect, 0.0]),
                ];
                let accel = built(
                    structure,
                    &Geometry {
                        triangles: vec![Triangle { corners }],
                        ..Geometry::default()
                    },
                );
                let mut rays = Rays::default();
                for _ in 0..16 {
                    let (b, c) = rng.barycentrics();
                    let target = [0, 1, 2].map(|k| corners[1][k] * b + corners[2][k] * c);
                    let (sin, cos) = angle.to_radians().sin_cos();
                    let azimuth = rng.uniform() * std::f32::consts::TAU;
                    let d = place([azimuth.cos() * cos, azimuth.sin() * cos, sin]);
                    rays.push(
                        [0, 1, 2].map(|k| target[k] - 100.0 * d[k]),
                        d,
                        PrimitiveId::NONE,
                    );
                }
                for (t, id) in rays.closest(&*accel) {
                    if id != PrimitiveId::NONE {
                        hits += 1;
                        assert!(
                            (t - 100.0).abs() < 11.0,
                            "{structure:?}: {t} at {angle} degrees, aspect {aspect}"
                        );
                    }
                }
            }
        }
        assert!(hits > 5_000, "{structure:?}: {hits}");
    }
}

/// Products of coordinates of 10⁻²³ are below the smallest denormal, so that every edge function is zero.
#[test]
fn triangles_whose_edge_functions_underflow_are_hit_and_missed_rightly() {
    let mut rng = Rng(24);
    let size = 1e-23;
    for structure in Structure::ALL {
        let corners = [[0.0, 0.0, 0.0], [size, 0.0, 0.0], [0.0, size, 0.3 * size]];
        let accel = built(
            structure,
            &Geometry {
                triangles: vec![Triangle { corners }],
                ..Geometry::default()
            },
        );
        let mut rays = Rays::default();
        let mut expected = Vec::new();
        while expected.len() < 1_000 {
            let (b, c) = (2.0 * rng.uniform() - 0.5, 2.0 * rng.uniform() - 0.5);
            if b.min(c).min(1.0 - b - c).abs() < 1e-3 {
                continue;
            }
            let target = [b, c, 0.3 * c].map(|x| x * size);
            let origin = [rng.uniform() * size, rng.uniform() * size, 10.0 * size];
            let direction = towards(
                [0.0; 3],
                [0, 1, 2].map(|k| f64::from(target[k]) - f64::from(origin[k])),
            );
            rays.push(origin, direction, PrimitiveId::NONE);
            expected.push(b > 0.0 && c > 0.0 && b + c < 1.0);
        }
        let hits = rays.closest(&*accel);
        for (hit, expected) in hits.iter().zip(expected) {
            assert_eq!(hit.1 == 0, expected, "{structure:?}");
        }
    }
}

/// Beyond the reach of the lanes the linear scan takes triangles one at a time, as the trees do.
#[test]
fn from_far_away_the_linear_scan_gives_the_same_bits_as_a_tree() {
    let mut rng = Rng(46);
    let geometry = Geometry {
        spheres: Vec::new(),
        ..room()
    };
    let mut rays = Rays::default();
    for _ in 0..10_000 {
        let target = point_in_room(&mut rng);
        let origin = rng.sphere().map(|x| 5_000.0 * x);
        rays.push(
            origin,
            towards(origin, target.map(f64::from)),
            PrimitiveId::NONE,
        );
    }
    let linear = rays.closest(&*built(Structure::Linear, &geometry));
    assert!(linear == rays.closest(&*built(Structure::Bvh2, &geometry)));
    assert!(linear.iter().all(|hit| hit.1 != PrimitiveId::NONE));
}

#[test]
fn a_light_of_two_triangles_in_one_group_is_one_thing_to_skip_and_to_aim_at() {
    let room = room();
    let accel = built(Structure::Linear, &room);
    // The light is triangles 20 and 21; its diagonal runs from (4, −1) to (6, 1).
    let mut rays = Rays::default();
    let hit = |rays: &mut Rays| rays.closest(&*accel)[0].1;
    rays.push([5.5, -0.9, 0.0], [0.0, 0.0, 1.0], PrimitiveId::NONE);
    let light = hit(&mut rays);
    assert_eq!(light, 20);
    for member in [20, 21] {
        let mut rays = Rays::default();
        rays.push([4.5, 0.9, 0.0], [0.0, 0.0, 1.0], member);
        let ceiling = hit(&mut rays);
        assert!((4..8).contains(&ceiling), "{ceiling}");
        assert_eq!(
            rays.occluded(&*accel, &[4.995], &[PrimitiveId::NONE]),
            [false]
        );
        let mut rays = Rays::default();
        rays.push([4.5, 0.9, 0.0], [0.0, 0.0, 1.0], PrimitiveId::NONE);
        assert_eq!(rays.occluded(&*accel, &[4.995], &[member]), [false]);
        assert_eq!(rays.occluded(&*accel, &[4.995], &[3]), [true]);
    }
}

#[test]
fn work_is_counted_and_bytes_grow_with_the_scene() {
    let mut rng = Rng(9);
    let (small, large) = (soup(100, 0, &mut rng), soup(200, 50, &mut rng));
    for structure in Structure::ALL {
        let accel = built(structure, &large);
        assert!(accel.bytes() > built(structure, &small).bytes());
        assert!(accel.bytes() >= 200 * 36 + 50 * 16);
        let mut rays = random_rays(100, &mut rng, |rng| rng.sphere());
        let mut counters = AccelCounters::default();
        let size = padded(100);
        let (mut t, mut primitive) = (vec![0.0; size], vec![0; size]);
        accel.closest(
            rays.batch(),
            HitBatch {
                t: &mut t,
                primitive: &mut primitive,
            },
            &mut counters,
        );
        assert!(counters.tests >= 100);
        assert_eq!(counters.nodes > 0, structure != Structure::Linear);
    }
}

#[test]
fn small_scenes_are_scanned_and_large_ones_get_a_tree() {
    let mut rng = Rng(10);
    assert_eq!(auto(&room()), Structure::Linear);
    assert_eq!(auto(&soup(LINEAR_MOST, 0, &mut rng)), Structure::Linear);
    assert_eq!(auto(&soup(LINEAR_MOST, 1, &mut rng)), Structure::Bvh8);
}

/// Whether the segment between two points of the room is occluded, with `ends` as the geometry's, and
/// primitives tested.
fn segments_in_room(
    ends: Option<Vec<[f32; 3]>>,
    segments: &[([f32; 3], [f32; 3])],
) -> (Vec<bool>, u64) {
    let accel = LinearScan::new(&Geometry {
        segment_ends: ends,
        ..room()
    });
    let (mut rays, mut t_max) = (Rays::default(), Vec::new());
    for &(from, to) in segments {
        let end = to.map(f64::from);
        rays.push(from, towards(from, end), PrimitiveId::NONE);
        let offset = DVec3::from_array(end) - DVec3::from_array(from.map(f64::from));
        t_max.push(offset.length() as f32);
    }
    let none = vec![PrimitiveId::NONE; segments.len()];
    let (occluded, counters) = rays.occluded_counted(&accel, &t_max, &none);
    (occluded, counters.tests)
}

#[test]
fn between_points_of_a_room_its_walls_are_left_out_and_nothing_changes() {
    let mut rng = Rng(31);
    let segments: Vec<_> = (0..50_000)
        .map(|_| (point_in_room(&mut rng), point_in_room(&mut rng)))
        .collect();
    let (full, full_tests) = segments_in_room(None, &segments);
    let (lean, lean_tests) = segments_in_room(Some(Vec::new()), &segments);
    assert_eq!(full, lean);
    assert!(full.iter().any(|&o| o) && !full.iter().all(|&o| o));
    // Floor, ceiling, six walls and the tetrahedron's base on the floor are outside; the light, the rest
    // of the tetrahedron and the spheres stay.
    assert_eq!(full_tests - lean_tests, 9 * segments.len() as u64);
}

#[test]
fn a_wall_between_the_room_and_a_light_outside_occludes() {
    let light = [40.0, 0.0, 0.0];
    let mut rng = Rng(32);
    let segments: Vec<_> = (0..1000)
        .map(|_| (point_in_room(&mut rng), light))
        .collect();
    let (occluded, _) = segments_in_room(Some(vec![light]), &segments);
    assert!(occluded.iter().all(|&o| o));
}

#[test]
fn a_ray_that_rounding_starts_beyond_the_next_wall_hits_that_wall() {
    // From the floor (triangle 0 is of its polygon), at the foot of the wall y = 6, a few roundings past it.
    let accel = LinearScan::new(&room());
    let mut rays = Rays::default();
    for roundings in 0..4u32 {
        let y = f32::from_bits(6.0f32.to_bits() + roundings);
        let start = [5.0, y, f32::from_bits((-5.0f32).to_bits() - 2)];
        rays.push(start, normalized([0.3, 1.0, 0.5]), 0);
    }
    for (t, primitive) in rays.closest(&accel) {
        assert!(
            primitive != PrimitiveId::NONE && t > 0.0 && t < 1e-4,
            "{t} {primitive}"
        );
        let corners = room().triangles[primitive as usize].corners;
        assert!(corners.iter().all(|corner| corner[1] == 6.0));
    }
}
