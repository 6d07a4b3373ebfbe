//! Random numbers and closed meshes for tests.

use super::Triangle;
use crate::math::lanes::{F32s, LANES};
use crate::math::testing::split_mix_64;
use crate::math::vec3::Vec3s;

/// Numbers of [`split_mix_64`].
pub(crate) struct Rng(pub(crate) u64);

impl Rng {
    pub(crate) fn next(&mut self) -> u64 {
        split_mix_64(&mut self.0)
    }

    /// In [0, 1).
    pub(crate) fn uniform(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1 << 24) as f32
    }

    /// In 0 .. n.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (((self.next() >> 32) * n as u64) >> 32) as usize
    }

    /// A uniformly distributed unit vector.
    pub(crate) fn sphere(&mut self) -> [f32; 3] {
        let z = 1.0 - 2.0 * f64::from(self.uniform());
        let (sin, cos) = (f64::from(self.uniform()) * std::f64::consts::TAU).sin_cos();
        let r = (1.0 - z * z).max(0.0).sqrt();
        [(r * cos) as f32, (r * sin) as f32, z as f32]
    }

    /// Uniform b1, b2 ≥ 0 with b1 + b2 ≤ 1.
    pub(crate) fn barycentrics(&mut self) -> (f32, f32) {
        let (a, b) = (self.uniform(), self.uniform());
        if a + b > 1.0 {
            (1.0 - a, 1.0 - b)
        } else {
            (a, b)
        }
    }

    /// A rotation by rows, from two random vectors.
    pub(crate) fn rotation(&mut self) -> [[f32; 3]; 3] {
        let a = self.sphere();
        let b = self.sphere();
        let along: f32 = (0..3).map(|k| a[k] * b[k]).sum();
        let c = [0, 1, 2].map(|k| b[k] - along * a[k]);
        let length = c.iter().map(|x| x * x).sum::<f32>().sqrt();
        let c = c.map(|x| x / length);
        [
            a,
            c,
            [
                a[1] * c[2] - a[2] * c[1],
                a[2] * c[0] - a[0] * c[2],
                a[0] * c[1] - a[1] * c[0],
            ],
        ]
    }
}

/// Vectors as lanes.
pub(crate) fn column(vectors: &[[f32; 3]; LANES]) -> Vec3s {
    let [x, y, z] = [0, 1, 2].map(|k| F32s::from(vectors.map(|v| v[k])));
    Vec3s::new(x, y, z)
}

/// One lane of a vector.
pub(crate) fn lane(v: Vec3s, i: usize) -> [f32; 3] {
    [v.x.to_array()[i], v.y.to_array()[i], v.z.to_array()[i]]
}

/// An indexed mesh.
pub(crate) struct Mesh {
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) faces: Vec<[usize; 3]>,
}

impl Mesh {
    pub(crate) fn triangles(&self) -> Vec<Triangle> {
        self.faces
            .iter()
            .map(|face| Triangle {
                corners: face.map(|v| self.positions[v]),
            })
            .collect()
    }

    /// Scaled, then moved, each coordinate rounded once more.
    pub(crate) fn placed(mut self, scale: f32, offset: [f32; 3]) -> Self {
        for p in &mut self.positions {
            *p = [0, 1, 2].map(|k| p[k] * scale + offset[k]);
        }
        self
    }

    /// Turned by rows of a rotation.
    pub(crate) fn turned(mut self, rows: [[f32; 3]; 3]) -> Self {
        for p in &mut self.positions {
            *p = rows.map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2]);
        }
        self
    }
}

/// A closed sphere of radius 1 by latitude and longitude, its vertices jittered radially by up to `jitter`.
pub(crate) fn lat_long_sphere(rows: usize, columns: usize, jitter: f32, rng: &mut Rng) -> Mesh {
    let mut positions = vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    for row in 1..rows {
        let (ring, z) = (std::f64::consts::PI * row as f64 / rows as f64).sin_cos();
        for column in 0..columns {
            let (sin, cos) = (std::f64::consts::TAU * column as f64 / columns as f64).sin_cos();
            let r = f64::from(1.0 - jitter * rng.uniform());
            positions.push([
                (r * ring * cos) as f32,
                (r * ring * sin) as f32,
                (r * z) as f32,
            ]);
        }
    }
    let at = |row: usize, column: usize| 2 + (row - 1) * columns + column % columns;
    let mut faces = Vec::new();
    for column in 0..columns {
        faces.push([0, at(1, column), at(1, column + 1)]);
        faces.push([1, at(rows - 1, column + 1), at(rows - 1, column)]);
        for row in 1..rows - 1 {
            faces.push([
                at(row, column),
                at(row + 1, column),
                at(row + 1, column + 1),
            ]);
            faces.push([
                at(row, column),
                at(row + 1, column + 1),
                at(row, column + 1),
            ]);
        }
    }
    Mesh { positions, faces }
}

/// A closed torus about z with radii 1 and `tube`.
pub(crate) fn torus(rings: usize, sides: usize, tube: f64) -> Mesh {
    let mut mesh = Mesh {
        positions: Vec::new(),
        faces: Vec::new(),
    };
    for ring in 0..rings {
        let (sin_r, cos_r) = (std::f64::consts::TAU * ring as f64 / rings as f64).sin_cos();
        for side in 0..sides {
            let (sin_s, cos_s) = (std::f64::consts::TAU * side as f64 / sides as f64).sin_cos();
            let r = 1.0 + tube * cos_s;
            mesh.positions.push([
                (r * cos_r) as f32,
                (r * sin_r) as f32,
                (tube * sin_s) as f32,
            ]);
            let at = |r: usize, s: usize| r % rings * sides + s % sides;
            mesh.faces
                .push([at(ring, side), at(ring + 1, side), at(ring + 1, side + 1)]);
            mesh.faces
                .push([at(ring, side), at(ring + 1, side + 1), at(ring, side + 1)]);
        }
    }
    mesh
}

/// The cube [−1, 1]³ of 12 triangles.
pub(crate) fn cube() -> Mesh {
    let positions = (0..8)
        .map(|i| [0, 1, 2].map(|k| if i >> k & 1 == 0 { -1.0 } else { 1.0 }))
        .collect();
    let quads = [
        [0, 2, 6, 4],
        [1, 5, 7, 3],
        [0, 4, 5, 1],
        [2, 3, 7, 6],
        [0, 1, 3, 2],
        [4, 6, 7, 5],
    ];
    let faces = quads
        .iter()
        .flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]])
        .collect();
    Mesh { positions, faces }
}

/// A room like a stretched hexagonal prism: floor and ceiling of four triangles each, six walls of two,
/// with a light of two triangles under the ceiling and a tetrahedron on the floor. 26 triangles.
pub(crate) fn hexagonal_room() -> (Mesh, Vec<u32>) {
    let plan = [
        [-3.0, 0.0],
        [0.0, 6.0],
        [10.0, 6.0],
        [13.0, 0.0],
        [10.0, -6.0],
        [0.0, -6.0],
    ];
    let mut positions: Vec<[f32; 3]> = Vec::new();
    for z in [-5.0, 5.0] {
        positions.extend(plan.map(|[x, y]| [x, y, z]));
    }
    let mut faces = Vec::new();
    let mut groups = Vec::new();
    for level in [0, 6] {
        for face in [[0, 1, 5], [1, 2, 4], [1, 4, 5], [2, 3, 4]] {
            faces.push(face.map(|v: usize| v + level));
            groups.push(level as u32);
        }
    }
    for i in 0..6 {
        let j = (i + 1) % 6;
        faces.extend([[i, j, j + 6], [i, j + 6, i + 6]]);
        groups.extend([10 + i as u32; 2]);
    }
    positions.extend([
        [4.0, -1.0, 4.99],
        [4.0, 1.0, 4.99],
        [6.0, 1.0, 4.99],
        [6.0, -1.0, 4.99],
    ]);
    faces.extend([[12, 13, 14], [12, 14, 15]]);
    groups.extend([20; 2]);
    positions.extend([
        [5.2, 1.4, -5.0],
        [8.2, 1.6, -5.0],
        [6.4, 4.4, -5.0],
        [6.6, 2.5, -2.2],
    ]);
    faces.extend([[16, 18, 17], [16, 17, 19], [17, 18, 19], [18, 16, 19]]);
    groups.extend([30; 4]);
    (Mesh { positions, faces }, groups)
}
