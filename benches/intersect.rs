//! Closest hits of incoherent rays: every structure, and the plain loop over all triangles, in a small
//! room and over a mesh. Throughput is in rays.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use wavepath::accel::{Accel, AccelCounters, HitBatch, RayBatch, Structure, build};
use wavepath::geometry::triangle::ShearRay;
use wavepath::geometry::{Geometry, PrimitiveId, Sphere, Triangle};

const RAYS: usize = 1024;

/// SplitMix64.
struct Rng(u64);

impl Rng {
    /// In [0, 1).
    fn uniform(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ z >> 31) >> 40) as f32 / (1 << 24) as f32
    }

    fn direction(&mut self) -> [f32; 3] {
        let z = 1.0 - 2.0 * self.uniform();
        let (sin, cos) = (self.uniform() * std::f32::consts::TAU).sin_cos();
        let r = (1.0 - z * z).max(0.0).sqrt();
        [r * cos, r * sin, z]
    }
}

/// A hexagonal room of 26 triangles and three spheres: floor, ceiling, walls, a light, a tetrahedron.
fn room() -> Geometry {
    let plan = [
        [-3.0, 0.0],
        [0.0, 6.0],
        [10.0, 6.0],
        [13.0, 0.0],
        [10.0, -6.0],
        [0.0, -6.0],
    ];
    let mut geometry = Geometry::default();
    let mut add = |group: u32, corners: [[f32; 3]; 3]| {
        geometry.triangles.push(Triangle { corners });
        geometry.groups.push(group);
    };
    for (group, z) in [-5.0, 5.0].into_iter().enumerate() {
        for face in [[0, 1, 5], [1, 2, 4], [1, 4, 5], [2, 3, 4]] {
            add(
                group as u32,
                face.map(|v: usize| [plan[v][0], plan[v][1], z]),
            );
        }
    }
    for i in 0..6 {
        let ([ax, ay], [bx, by]) = (plan[i], plan[(i + 1) % 6]);
        add(
            2 + i as u32,
            [[ax, ay, -5.0], [bx, by, -5.0], [bx, by, 5.0]],
        );
        add(2 + i as u32, [[ax, ay, -5.0], [bx, by, 5.0], [ax, ay, 5.0]]);
    }
    let light = [
        [4.0, -1.0, 4.99],
        [4.0, 1.0, 4.99],
        [6.0, 1.0, 4.99],
        [6.0, -1.0, 4.99],
    ];
    add(8, [light[0], light[1], light[2]]);
    add(8, [light[0], light[2], light[3]]);
    let tetrahedron = [
        [5.2, 1.4, -5.0],
        [8.2, 1.6, -5.0],
        [6.4, 4.4, -5.0],
        [6.6, 2.5, -2.2],
    ];
    for face in [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]] {
        add(9, face.map(|v: usize| tetrahedron[v]));
    }
    let spheres = [
        ([8.5, -2.8, -3.4], 1.6),
        ([5.5, -0.4, -1.6], 1.2),
        ([9.0, 2.6, 0.4], 1.5),
    ];
    geometry.spheres = spheres
        .map(|(center, radius)| Sphere { center, radius })
        .to_vec();
    geometry
}

/// The icosahedron with each face split `levels` times: 20·4^levels triangles about the origin, radius 4.
fn icosphere(levels: u32) -> Geometry {
    let g = 0.5 + 0.5 * 5f32.sqrt();
    let on_sphere = |p: [f32; 3]| {
        let scale = 4.0 / p.iter().map(|x| x * x).sum::<f32>().sqrt();
        p.map(|x| x * scale)
    };
    let mut vertices = Vec::new();
    for (a, b) in [(-1.0, g), (1.0, g), (-1.0, -g), (1.0, -g)] {
        vertices.push([a, b, 0.0]);
    }
    for (a, b) in [(-1.0, g), (1.0, g), (-1.0, -g), (1.0, -g)] {
        vertices.push([0.0, a, b]);
    }
    for (a, b) in [(g, -1.0), (g, 1.0), (-g, -1.0), (-g, 1.0)] {
        vertices.push([a, 0.0, b]);
    }
    let faces: [[usize; 3]; 20] = [
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    let mut triangles: Vec<[[f32; 3]; 3]> = faces
        .map(|face| face.map(|v| on_sphere(vertices[v])))
        .to_vec();
    for _ in 0..levels {
        triangles = triangles
            .into_iter()
            .flat_map(|[a, b, c]| {
                let middle = |p: [f32; 3], q: [f32; 3]| on_sphere([0, 1, 2].map(|k| p[k] + q[k]));
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    Geometry {
        triangles: triangles
            .into_iter()
            .map(|corners| Triangle { corners })
            .collect(),
        ..Geometry::default()
    }
}

struct Rays {
    origin: [Vec<f32>; 3],
    direction: [Vec<f32>; 3],
    skip: Vec<u32>,
    t: Vec<f32>,
    primitive: Vec<u32>,
}

impl Rays {
    /// Uniform directions from points in a box.
    fn incoherent(low: [f32; 3], high: [f32; 3]) -> Self {
        let mut rng = Rng(1);
        let mut rays = Self {
            origin: Default::default(),
            direction: Default::default(),
            skip: vec![PrimitiveId::NONE; RAYS],
            t: vec![0.0; RAYS],
            primitive: vec![0; RAYS],
        };
        for _ in 0..RAYS {
            let d = rng.direction();
            for k in 0..3 {
                rays.origin[k].push(low[k] + (high[k] - low[k]) * rng.uniform());
                rays.direction[k].push(d[k]);
            }
        }
        rays
    }

    fn trace(&mut self, accel: &dyn Accel) {
        let [ox, oy, oz] = &self.origin;
        let [dx, dy, dz] = &self.direction;
        let batch = RayBatch {
            len: RAYS,
            origin: [ox, oy, oz],
            direction: [dx, dy, dz],
            skip: &self.skip,
        };
        let hits = HitBatch {
            t: &mut self.t,
            primitive: &mut self.primitive,
        };
        accel.closest(batch, hits, &mut AccelCounters::default());
    }

    /// The plain loop over triangles.
    fn trace_plainly(&mut self, triangles: &[Triangle]) {
        for i in 0..RAYS {
            let ray = ShearRay::new(
                [0, 1, 2].map(|k| self.origin[k][i]),
                [0, 1, 2].map(|k| self.direction[k][i]),
            );
            let mut nearest = (f32::INFINITY, PrimitiveId::NONE);
            for (id, triangle) in (0u32..).zip(triangles) {
                if let Some(t) = ray.intersect(triangle)
                    && t < nearest.0
                {
                    nearest = (t, id);
                }
            }
            (self.t[i], self.primitive[i]) = nearest;
        }
    }
}

fn intersect(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("intersect");
    group.throughput(Throughput::Elements(RAYS as u64));
    let room = room();
    let unmerged = Geometry {
        groups: Vec::new(),
        ..room.clone()
    };
    let mesh = icosphere(5);
    let in_room = ([0.0, -5.0, -4.9], [10.0, 5.0, 4.9]);
    let in_mesh = ([-2.0; 3], [2.0; 3]);
    let linear = (Structure::Linear, "linear");
    let octree = (Structure::Octree, "octree");
    let (bvh2, bvh8) = ((Structure::Bvh2, "bvh2"), (Structure::Bvh8, "bvh8"));
    for (scene, geometry, (low, high), structures) in [
        ("room", &room, in_room, &[linear, octree, bvh2, bvh8][..]),
        ("room-unmerged", &unmerged, in_room, &[linear][..]),
        ("icosphere", &mesh, in_mesh, &[octree, bvh2, bvh8][..]),
    ] {
        let mut rays = Rays::incoherent(low, high);
        for &(structure, name) in structures {
            let accel = build(structure, geometry).expect("few primitives");
            rays.trace(&*accel);
            assert!(
                rays.t.iter().all(|t| t.is_finite()),
                "every ray is inside of something closed"
            );
            group.bench_function(BenchmarkId::new(name, scene), |bencher| {
                bencher.iter(|| rays.trace(&*accel))
            });
        }
    }
    let mut rays = Rays::incoherent(in_room.0, in_room.1);
    rays.trace_plainly(&room.triangles);
    assert!(
        rays.t.iter().all(|t| t.is_finite()),
        "every ray is inside of something closed"
    );
    group.bench_function(BenchmarkId::new("scalar", "room"), |bencher| {
        bencher.iter(|| rays.trace_plainly(&room.triangles));
    });
    group.finish();
}

criterion_group!(benches, intersect);
criterion_main!(benches);
