//! Closed meshes, and rays from inside of them that look for gaps: aimed at random, exactly at vertices, at
//! points of edges, and along the axes.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};
use std::path::Path;

use crate::accel::{Accel, AccelCounters, HitBatch, RayBatch};
use crate::error::{Error, Result};
use crate::geometry::{Geometry, PrimitiveId, Triangle};
use crate::math::float::flush_denormals;
use crate::math::testing::split_mix_64;
use crate::scene::procedural::{ScalableKind, ScalableMesh, torus};
use crate::scene::{self, Mesh, ShapeGeometry};
use glam::DVec3;
use rayon::prelude::*;

/// Rays that are traced together, a multiple of the lane width.
pub const BLOCK: usize = 4_096;

/// How far from every triangle rays start, as a share of the mesh's size: far more than roundings of
/// coordinates, which might put a start on the other side.
const CLEARANCE: f64 = 1e-4;

/// Points tried for each one that is wanted.
const MOST_TRIES: usize = 200;

/// Numbers of [`split_mix_64`].
#[derive(Debug)]
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn next(&mut self) -> u64 {
        split_mix_64(&mut self.0)
    }

    /// In [0, 1).
    pub(super) fn uniform(&mut self) -> f64 {
        (self.next() >> 11) as f64 * (f64::EPSILON / 2.0)
    }

    /// In 0 .. n.
    pub(super) fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.next()) * n as u128) >> 64) as usize
    }

    /// One of two values.
    pub(super) fn either<T>(&mut self, one: T, other: T) -> T {
        if self.below(2) == 0 { one } else { other }
    }

    /// A uniformly distributed unit vector.
    pub(super) fn direction(&mut self) -> DVec3 {
        let z = 1.0 - 2.0 * self.uniform();
        let (sin, cos) = (TAU * self.uniform()).sin_cos();
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * cos, r * sin, z)
    }
}

/// Where rays from inside are aimed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aim {
    /// Anywhere.
    Random,
    /// At a vertex.
    Vertex,
    /// At a point of an edge.
    Edge,
    /// Along an axis, the other components ±0 or as small as denormals.
    Axis,
    /// Along an axis, exactly through a vertex.
    AxisThroughVertex,
    /// Across an axis by ±0, on a level with a vertex.
    LevelWithVertex,
}

impl Aim {
    /// Every aim.
    pub const ALL: [Self; 6] = [
        Self::Random,
        Self::Vertex,
        Self::Edge,
        Self::Axis,
        Self::AxisThroughVertex,
        Self::LevelWithVertex,
    ];
}

/// A point inside of a mesh on a line along an axis through one of its vertices, exactly.
#[derive(Debug, Clone, Copy)]
struct Aligned {
    origin: [f32; 3],
    axis: usize,
    /// 1 or −1: where along the axis the vertex is.
    sign: f32,
}

/// A closed mesh and points inside of it.
#[derive(Debug)]
pub struct ClosedMesh {
    /// What it is.
    pub name: String,
    /// Its triangles.
    pub geometry: Geometry,
    inside: Vec<[f32; 3]>,
    aligned: Vec<Aligned>,
}

impl ClosedMesh {
    /// A sphere by latitude and longitude, its vertices moved inwards at random.
    pub fn sphere(rows: u32, points: usize) -> Self {
        Self::placed_sphere(rows, 0.3, 1.0, DVec3::ZERO, points)
    }

    /// A sphere by latitude and longitude of this radius about a centre from which the scene is not
    /// re-centred; its vertices are moved inwards at random by up to this share of the radius.
    pub fn placed_sphere(
        rows: u32,
        jitter: f64,
        radius: f64,
        center: DVec3,
        points: usize,
    ) -> Self {
        let mut mesh = jittered_sphere(rows, jitter);
        for position in &mut mesh.positions {
            *position = radius * *position + center;
        }
        Self::at_place("sphere", &mesh, DVec3::ZERO, points)
    }

    /// A torus.
    pub fn torus(sides: u32, points: usize) -> Self {
        Self::new("torus", &torus(1.0, 0.3, 2 * sides, sides), points)
    }

    /// Menger's sponge of up to so many triangles, at least 1000: coplanar neighbours, axis-parallel
    /// edges, and edges of four faces.
    pub fn sponge(triangles: u32, points: usize) -> Self {
        let mesh =
            ScalableMesh::new(ScalableKind::Sponge, triangles, 0).expect("a sponge of this size");
        Self::new("sponge", &mesh.to_mesh(), points)
    }

    /// Two fans of needles with their tips at z = ±1 on a common ring of radius 1.
    pub fn double_cone(needles: u32, points: usize) -> Self {
        let mut positions = vec![DVec3::Z, -DVec3::Z];
        let mut faces = Vec::new();
        for i in 0..needles {
            let (sin, cos) = (TAU * f64::from(i) / f64::from(needles)).sin_cos();
            positions.push(DVec3::new(cos, sin, 0.0));
            let (a, b) = (2 + i, 2 + (i + 1) % needles);
            faces.extend([[0, a, b], [1, b, a]]);
        }
        let mesh = Mesh {
            positions,
            faces,
            ..Mesh::default()
        };
        Self::new("double cone", &mesh, points)
    }

    /// The mesh in a file of the folder.
    ///
    /// # Errors
    /// If the file cannot be read.
    ///
    /// # Panics
    /// If the mesh is not closed.
    pub fn read(folder: &Path, file: &str, points: usize) -> Result<Self> {
        let path = folder.join(file);
        let scene = scene::load(&path, &[])?;
        let mesh = scene.shapes.last().map(|shape| &shape.geometry);
        let Some(ShapeGeometry::Mesh(mesh)) = mesh else {
            return Err(Error::file(&path, "there is no mesh in it"));
        };
        Ok(Self::new(file, mesh, points))
    }

    /// The mesh about the middle of its box.
    fn new(name: &str, mesh: &Mesh, points: usize) -> Self {
        let (low, high) = extent(mesh);
        Self::at_place(name, mesh, 0.5 * (low + high), points)
    }

    /// The mesh less `middle`, rounded to f32; faces that rounding leaves without area are dropped.
    fn at_place(name: &str, mesh: &Mesh, middle: DVec3, points: usize) -> Self {
        let (low, high) = extent(mesh);
        let corner = |v: u32| (mesh.positions[v as usize] - middle).as_vec3().to_array();
        let has_area = |triangle: &Triangle| {
            let [a, b, c] = triangle.corners.map(position);
            (b - a).cross(c - a) != DVec3::ZERO
        };
        let triangles: Vec<Triangle> = mesh
            .faces
            .iter()
            .map(|face| Triangle {
                corners: face.map(corner),
            })
            .filter(has_area)
            .collect();
        assert_eq!(open_edges(&triangles), 0, "{name} is not closed");
        let size = (high - low).max_element();
        let mut random = Random(1);
        let inside = points_inside(&triangles, size, points, &mut random);
        let aligned = points_aligned(&triangles, size, points, &mut random);
        assert!(!inside.is_empty() && !aligned.is_empty(), "{name}");
        Self {
            name: name.to_owned(),
            geometry: Geometry {
                triangles,
                ..Geometry::default()
            },
            inside,
            aligned,
        }
    }

    /// Traces `blocks` times [`BLOCK`] rays aimed in any of these ways, on the threads of the current
    /// pool; returns how many hit nothing.
    pub fn escapes(&self, accel: &dyn Accel, aims: &[Aim], blocks: u64) -> u64 {
        (0..blocks)
            .into_par_iter()
            .map(|block| {
                flush_denormals();
                self.escapes_of_block(accel, aims, block)
            })
            .sum()
    }

    fn escapes_of_block(&self, accel: &dyn Accel, aims: &[Aim], block: u64) -> u64 {
        let mut random = Random(block);
        random.0 = random.next();
        let mut columns = [(); 6].map(|()| vec![0.0; BLOCK]);
        for number in 0..BLOCK {
            let (origin, direction) = self.ray(aims[random.below(aims.len())], &mut random);
            let components = origin.into_iter().chain(direction);
            for (column, component) in columns.iter_mut().zip(components) {
                column[number] = component;
            }
        }
        let (mut t, mut primitive) = (vec![0.0; BLOCK], vec![0; BLOCK]);
        let [ox, oy, oz, dx, dy, dz] = &columns;
        accel.closest(
            RayBatch {
                len: BLOCK,
                origin: [ox, oy, oz],
                direction: [dx, dy, dz],
                skip: &[PrimitiveId::NONE; BLOCK],
            },
            HitBatch {
                t: &mut t,
                primitive: &mut primitive,
            },
            &mut AccelCounters::default(),
        );
        let missed = primitive.iter().filter(|&&id| id == PrimitiveId::NONE);
        missed.count() as u64
    }

    /// A ray from inside.
    fn ray(&self, aim: Aim, random: &mut Random) -> ([f32; 3], [f32; 3]) {
        let zero = |random: &mut Random| random.either(0.0, -0.0);
        let inside = self.inside[random.below(self.inside.len())];
        let triangles = &self.geometry.triangles;
        let [a, b, _] = triangles[random.below(triangles.len())].corners;
        match aim {
            Aim::Random => (inside, random.direction().as_vec3().to_array()),
            Aim::Vertex => (inside, towards(inside, position(a))),
            Aim::Edge => {
                let target = position(a).lerp(position(b), random.uniform());
                (inside, towards(inside, target))
            }
            Aim::Axis => {
                // Along an axis; at times with one of the smallest numbers instead of a zero.
                let axis = random.below(3);
                let mut direction = [(); 3].map(|()| zero(random));
                direction[axis] = random.either(1.0, -1.0);
                if random.below(4) == 0 {
                    direction[(axis + 1) % 3] = 10f32.powi(-7 - random.below(38) as i32);
                }
                (inside, direction)
            }
            Aim::AxisThroughVertex => {
                // Straight through a vertex.
                let Aligned { origin, axis, sign } = self.aligned[random.below(self.aligned.len())];
                let mut direction = [(); 3].map(|()| zero(random));
                direction[axis] = sign;
                (origin, direction)
            }
            Aim::LevelWithVertex => {
                // Within a plane across an axis, on a level with a vertex.
                let Aligned { origin, axis, .. } = self.aligned[random.below(self.aligned.len())];
                let across = (axis + 1 + random.below(2)) % 3;
                let (sin, cos) = (TAU * random.uniform()).sin_cos();
                let mut direction = [0.0; 3];
                direction[(across + 1) % 3] = sin as f32;
                direction[(across + 2) % 3] = cos as f32;
                direction[across] = zero(random);
                (origin, direction)
            }
        }
    }
}

/// Corners of the box of all vertices.
fn extent(mesh: &Mesh) -> (DVec3, DVec3) {
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let grown = |(low, high): (DVec3, DVec3), &p: &DVec3| (low.min(p), high.max(p));
    mesh.positions.iter().fold(start, grown)
}

fn position(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

fn towards(from: [f32; 3], to: DVec3) -> [f32; 3] {
    (to - position(from)).normalize().as_vec3().to_array()
}

/// Poles of needles, rings of narrowing faces, and no two vertices at the same distance.
fn jittered_sphere(rows: u32, jitter: f64) -> Mesh {
    let columns = 2 * rows;
    let mut random = Random(7);
    let mut positions = vec![DVec3::Z, -DVec3::Z];
    for row in 1..rows {
        let (ring, z) = (PI * f64::from(row) / f64::from(rows)).sin_cos();
        for column in 0..columns {
            let (sin, cos) = (TAU * f64::from(column) / f64::from(columns)).sin_cos();
            let radius = 1.0 - jitter * random.uniform();
            positions.push(radius * DVec3::new(ring * cos, ring * sin, z));
        }
    }
    let at = |row: u32, column: u32| 2 + (row - 1) * columns + column % columns;
    let mut faces = Vec::new();
    for column in 0..columns {
        faces.push([0, at(1, column), at(1, column + 1)]);
        faces.push([1, at(rows - 1, column + 1), at(rows - 1, column)]);
        for row in 1..rows - 1 {
            let [a, b] = [at(row, column), at(row, column + 1)];
            let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
            faces.extend([[a, c, d], [a, d, b]]);
        }
    }
    Mesh {
        positions,
        faces,
        ..Mesh::default()
    }
}

/// Edges, by the places of their ends, with an odd number of triangles. Without any, whatever way out of a
/// point inside crosses the surface an odd number of times.
fn open_edges(triangles: &[Triangle]) -> usize {
    let mut uses: HashMap<[[u32; 3]; 2], u32> = HashMap::new();
    // Adding zero makes +0 of −0, which is the same place.
    let bits = |p: [f32; 3]| p.map(|x| (x + 0.0).to_bits());
    for triangle in triangles {
        let [a, b, c] = triangle.corners.map(bits);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            if from != to {
                *uses.entry([from.min(to), from.max(to)]).or_default() += 1;
            }
        }
    }
    uses.values().filter(|uses| *uses % 2 == 1).count()
}

/// Where a line meets the triangles, before and behind its origin, in order; in f64, by Möller and
/// Trumbore. The line is taken at random, so that it meets no edge.
fn crossings(triangles: &[Triangle], origin: DVec3, direction: DVec3) -> Vec<f64> {
    let mut crossings: Vec<f64> = triangles
        .par_iter()
        .filter_map(|triangle| {
            let [a, b, c] = triangle.corners.map(position);
            let (ab, ac, ao) = (b - a, c - a, origin - a);
            let across = direction.cross(ac);
            let determinant = ab.dot(across);
            let u = ao.dot(across) / determinant;
            let turned = ao.cross(ab);
            let v = direction.dot(turned) / determinant;
            let inside = u > 0.0 && v > 0.0 && u + v < 1.0;
            inside.then(|| ac.dot(turned) / determinant)
        })
        .collect();
    crossings.sort_by(f64::total_cmp);
    crossings
}

/// Whether the point is farther than `clearance` from every triangle; at times it says no where yes is
/// right.
fn is_clear(triangles: &[Triangle], point: DVec3, clearance: f64) -> bool {
    triangles.par_iter().all(|triangle| {
        let [a, b, c] = triangle.corners.map(position);
        let (low, high) = (a.min(b).min(c) - clearance, a.max(b).max(c) + clearance);
        let beside = point.cmplt(low).any() || point.cmpgt(high).any();
        beside || (point - a).dot((b - a).cross(c - a).normalize()).abs() > clearance
    })
}

/// Whether a line through the point in this direction crosses the surface an odd number of times ahead, and
/// so behind.
fn is_inside(triangles: &[Triangle], point: DVec3, direction: DVec3) -> bool {
    let crossings = crossings(triangles, point, direction);
    let ahead = crossings.iter().filter(|&&t| t > 0.0).count();
    crossings.len().is_multiple_of(2) && ahead % 2 == 1
}

/// Up to `count` points inside: each between an odd crossing of a random line and the next.
fn points_inside(
    triangles: &[Triangle],
    size: f64,
    count: usize,
    random: &mut Random,
) -> Vec<[f32; 3]> {
    let mut points = Vec::new();
    for _ in 0..MOST_TRIES * count {
        if points.len() == count {
            break;
        }
        let [a, b, c] = triangles[random.below(triangles.len())]
            .corners
            .map(position);
        let (origin, direction) = ((a + b + c) / 3.0, random.direction());
        let crossings = crossings(triangles, origin, direction);
        if crossings.is_empty() || crossings.len() % 2 == 1 {
            continue;
        }
        let first = 2 * random.below(crossings.len() / 2);
        let along = random.uniform();
        let t = crossings[first] + along * (crossings[first + 1] - crossings[first]);
        let point = (origin + t * direction).as_vec3().to_array();
        let rounded = position(point);
        if is_clear(triangles, rounded, CLEARANCE * size)
            && is_inside(triangles, rounded, direction)
        {
            points.push(point);
        }
    }
    points
}

/// Up to `count` points inside that have two coordinates with a vertex in common.
fn points_aligned(
    triangles: &[Triangle],
    size: f64,
    count: usize,
    random: &mut Random,
) -> Vec<Aligned> {
    let mut points = Vec::new();
    for _ in 0..MOST_TRIES * count {
        if points.len() == count {
            break;
        }
        let mut origin = triangles[random.below(triangles.len())].corners[random.below(3)];
        let (axis, sign) = (random.below(3), random.either(1.0, -1.0));
        // Near vertices of fine meshes as well as far from them.
        let distance = size * 10f64.powf(-3.0 * random.uniform());
        origin[axis] -= sign * distance as f32;
        let (point, direction) = (position(origin), random.direction());
        if is_clear(triangles, point, CLEARANCE * size) && is_inside(triangles, point, direction) {
            points.push(Aligned { origin, axis, sign });
        }
    }
    points
}
