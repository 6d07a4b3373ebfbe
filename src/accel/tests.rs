//! What every structure must answer, whatever it is inside.

use glam::DVec3;

use super::*;
use crate::geometry::testing::{Mesh, Rng, cube, hexagonal_room, lat_long_sphere, torus};
use crate::geometry::triangle::ShearRay;
use crate::geometry::{PrimitiveId, Sphere, Triangle};
use crate::math::lanes::padded;

const ALL: [Structure; 3] = [Structure::Linear, Structure::Bvh2, Structure::Bvh8];

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
        occluded.into_iter().take(len).map(|o| o != 0).collect()
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
/// and along the axes with either sign of zero.
fn adversarial(
    mesh: &Mesh,
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
                if rng.below(2) == 0 {
                    // On the level of a vertex, as far as that stays inside.
                    let other = (axis + 1) % 3;
                    let level = mesh.positions[face[0]][other];
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
                    if (f64::from(level) - middle).abs() < 0.3 * reach {
                        origin[other] = level;
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

#[test]
fn no_ray_from_inside_a_closed_mesh_escapes() {
    let embree = [148_376.0, 1_234.0, -223_423.0];
    let mut rng = Rng(1);
    for structure in ALL {
        // The linear scan is tried with shared edges (few triangles) and without.
        let (rows, columns, n) = if structure == Structure::Linear {
            (12, 24, 25_000)
        } else {
            (50, 100, 100_000)
        };
        for (scale, center) in [
            (2.0, [0.0; 3]),
            (2.0, embree),
            (2.0, [1e6; 3]),
            (2e-6, [0.0; 3]),
            (2e7, [0.0; 3]),
        ] {
            for (rows, jitter) in [(rows, 0.0), (rows, 0.3), (6, 0.3)] {
                let mesh = lat_long_sphere(rows, columns, jitter, &mut rng).placed(scale, center);
                let accel = built(structure, &geometry(&mesh));
                let mut rays = adversarial(&mesh, n, &mut rng, near(center, scale));
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
