//! The answer for a ray is its own: the same bits alone, in company of any number and kind, in any order,
//! and from every tree.

use super::*;
use crate::math::LANES;
use crate::scene::procedural::{ScalableKind, ScalableMesh};

/// Rays with what is asked about them.
struct Queries {
    rays: Rays,
    t_max: Vec<f32>,
    target: Vec<u32>,
}

/// Closest hits, distances as bits, and whether the segments are occluded.
type Answers = (Vec<(u32, u32)>, Vec<bool>);

impl Queries {
    /// The queries of these numbers, in this order.
    fn pick(&self, numbers: &[usize]) -> Self {
        let mut rays = Rays::default();
        for &i in numbers {
            let (origin, direction) = self.rays.ray(i);
            rays.push(origin, direction, self.rays.skip[i]);
        }
        Self {
            rays,
            t_max: numbers.iter().map(|&i| self.t_max[i]).collect(),
            target: numbers.iter().map(|&i| self.target[i]).collect(),
        }
    }

    /// Answers to all in the order given by `order`, `size` at a time; returned in order of the queries.
    fn answer(&self, accel: &dyn Accel, size: usize, order: &[usize]) -> Answers {
        let n = self.rays.len;
        let (mut hits, mut occluded) = (vec![(0, 0); n], vec![false; n]);
        for numbers in order.chunks(size) {
            let mut batch = self.pick(numbers);
            let found = batch.rays.closest(accel);
            let blocked = batch.rays.occluded(accel, &batch.t_max, &batch.target);
            for (k, &i) in numbers.iter().enumerate() {
                hits[i] = (found[k].0.to_bits(), found[k].1);
                occluded[i] = blocked[k];
            }
        }
        (hits, occluded)
    }

    fn assert_same(&self, found: &Answers, expected: &Answers, what: &str) {
        for i in 0..self.rays.len {
            let of = |answers: &Answers| (answers.0[i], answers.1[i]);
            assert_eq!(
                of(found),
                of(expected),
                "{what}: ray {i} {:?}, skip {}, to {}, target {}",
                self.rays.ray(i),
                self.rays.skip[i],
                self.t_max[i],
                self.target[i]
            );
        }
    }

    /// What the scalar test says of every triangle, one after the other.
    fn plainly(&self, triangles: &[Triangle]) -> Answers {
        let n = self.rays.len;
        let (mut hits, mut occluded) = (vec![(0, 0); n], vec![false; n]);
        for i in 0..n {
            let (origin, direction) = self.rays.ray(i);
            let ray = ShearRay::new(origin, direction);
            let mut nearest = (f32::INFINITY, PrimitiveId::NONE);
            for (id, triangle) in (0u32..).zip(triangles) {
                match ray.intersect(triangle) {
                    Some(t) if id != self.rays.skip[i] => {
                        if t < nearest.0 {
                            nearest = (t, id);
                        }
                        occluded[i] |= id != self.target[i] && t < self.t_max[i];
                    }
                    _ => {}
                }
            }
            hits[i] = (nearest.0.to_bits(), nearest.1);
        }
        (hits, occluded)
    }
}

/// Bundles of coherent rays, random ones, axis-parallel ones with zeros of either sign and the smallest
/// numbers, and unsound ones, in turn in groups of random length; a third of them skip a primitive, and
/// a third of the segments aim at one.
fn queries(n: usize, geometry: &Geometry, size: f32, rng: &mut Rng) -> Queries {
    let mut queries = Queries {
        rays: Rays::default(),
        t_max: Vec::new(),
        target: Vec::new(),
    };
    let some = |rng: &mut Rng| match rng.below(3) {
        0 => rng.below(geometry.len()) as u32,
        _ => PrimitiveId::NONE,
    };
    while queries.rays.len < n {
        let kind = rng.below(8);
        let (eye, ahead) = (rng.sphere().map(|x| 1.5 * size * x), rng.sphere());
        for _ in 0..1 + rng.below(3 * LANES) {
            let random = rng.sphere();
            let mut origin = random.map(|x| 1.2 * size * x);
            let mut direction = rng.sphere();
            match kind {
                0..3 => {
                    origin = eye;
                    direction = normalized(
                        [0, 1, 2].map(|k| f64::from(ahead[k]) + 0.1 * f64::from(random[k])),
                    );
                }
                3 => {
                    let axis = rng.below(3);
                    direction = [(); 3].map(|()| if rng.below(2) == 0 { 0.0 } else { -0.0 });
                    direction[axis] = if rng.below(2) == 0 { 1.0 } else { -1.0 };
                    if rng.below(3) == 0 {
                        direction[(axis + 1) % 3] = 10f32.powi(-7 - rng.below(38) as i32);
                    }
                }
                4 if rng.below(4) == 0 => {
                    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][rng.below(3)];
                    match rng.below(3) {
                        0 => origin[rng.below(3)] = bad,
                        1 => direction[rng.below(3)] = bad,
                        _ => direction = [0.0, -0.0, 0.0],
                    }
                }
                _ => {}
            }
            let skip = some(rng);
            if let Some(sphere) = (skip as usize)
                .checked_sub(geometry.triangles.len())
                .and_then(|index| geometry.spheres.get(index))
            {
                // What a ray that starts on a sphere hits of it is a chord of it.
                origin = [0, 1, 2].map(|k| sphere.center[k] + sphere.radius * random[k]);
            }
            queries.rays.push(origin, direction, skip);
            queries.t_max.push(match rng.below(8) {
                0 => f32::INFINITY,
                1 => 0.0,
                _ => 3.0 * size * rng.uniform(),
            });
            queries.target.push(some(rng));
        }
    }
    queries
}

/// Scenes of triangles, of spheres, and of both, and about how large they are.
fn scenes(rng: &mut Rng) -> Vec<(&'static str, Geometry, f32)> {
    let made = |kind, triangles| {
        let mesh = ScalableMesh::new(kind, triangles, 1).expect("not too large");
        let mesh = mesh.to_mesh();
        Geometry {
            triangles: mesh
                .faces
                .iter()
                .map(|face| Triangle {
                    corners: face.map(|v| mesh.positions[v as usize].as_vec3().to_array()),
                })
                .collect(),
            ..Geometry::default()
        }
    };
    let mut crowded = made(ScalableKind::Hairball, 2_000);
    crowded.spheres = soup(0, 60, rng).spheres;
    vec![
        ("room", room(), 9.0),
        ("triangles and spheres", soup(300, 100, rng), 1.0),
        ("spheres", soup(0, 300, rng), 1.0),
        ("soup", soup(700, 0, rng), 1.0),
        ("sponge", made(ScalableKind::Sponge, 2_112), 1.0),
        ("terrain", made(ScalableKind::Terrain, 2_000), 1.0),
        ("hairball and spheres", crowded, 1.0),
    ]
}

#[test]
fn every_ray_is_answered_the_same_in_every_company_and_by_every_tree() {
    let mut rng = Rng(61);
    for (name, geometry, size) in scenes(&mut rng) {
        let queries = queries(4_096, &geometry, size, &mut rng);
        let in_order: Vec<usize> = (0..queries.rays.len).collect();
        let mut shuffled = in_order.clone();
        for last in (1..shuffled.len()).rev() {
            shuffled.swap(last, rng.below(last + 1));
        }
        let mut of_trees = geometry
            .spheres
            .is_empty()
            .then(|| queries.plainly(&geometry.triangles));
        // The scan goes by a room's shell where all rays of a group start inside of it. It then needs rays
        // that start on what they skip, and may name another triangle of a merged polygon.
        let structures = if name == "room" {
            &TREES[..]
        } else {
            &Structure::ALL[..]
        };
        for &structure in structures {
            let accel = built(structure, &geometry);
            let alone = queries.answer(&*accel, 1, &in_order);
            for (size, order) in [
                (LANES - 1, &in_order),
                (LANES, &in_order),
                (LANES + 1, &in_order),
                (4_096, &in_order),
                (4_096, &shuffled),
            ] {
                let together = queries.answer(&*accel, size, order);
                queries.assert_same(
                    &together,
                    &alone,
                    &format!("{structure:?} in {name}, {size} rays"),
                );
            }
            if structure != Structure::Linear {
                let expected = of_trees.get_or_insert_with(|| alone.clone());
                queries.assert_same(&alone, expected, &format!("{structure:?} in {name}"));
            }
            let hits = alone.0.iter().filter(|hit| hit.1 != PrimitiveId::NONE);
            assert!(hits.count() > 500, "{structure:?} in {name}");
        }
    }
}
