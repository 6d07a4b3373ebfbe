//! Other projects' structures give the answers of the linear one, but for few rays at edges.

use super::{ObvhsBvh2, ObvhsCwBvh};
use crate::accel::{Accel, AccelCounters, HitBatch, LinearScan, RayBatch, ShadowBatch};
use crate::geometry::testing::{Rng, lat_long_sphere};
use crate::geometry::{Geometry, PrimitiveId};
use crate::math::lanes::padded;

const RAYS: usize = 10_007;

/// Rays through the middle of a sphere from outside and inside, in columns.
struct Rays {
    columns: [Vec<f32>; 6],
    t_max: Vec<f32>,
    none: Vec<u32>,
}

impl Rays {
    fn new(rng: &mut Rng) -> Self {
        let mut rays = Self {
            columns: std::array::from_fn(|_| vec![0.0; padded(RAYS)]),
            t_max: vec![0.0; padded(RAYS)],
            none: vec![PrimitiveId::NONE; padded(RAYS)],
        };
        for i in 0..RAYS {
            let far = if i % 2 == 0 { 6.0 } else { 0.5 };
            let (origin, target) = (rng.sphere().map(|x| far * x), rng.sphere());
            let way = [0, 1, 2].map(|k| 3.0 * target[k] - origin[k]);
            let length = way.iter().map(|x| x * x).sum::<f32>().sqrt();
            for axis in 0..3 {
                rays.columns[axis][i] = origin[axis];
                rays.columns[3 + axis][i] = way[axis] / length;
            }
            rays.t_max[i] = length * rng.uniform();
        }
        rays
    }

    fn batch(&self) -> RayBatch<'_> {
        let [x, y, z, dx, dy, dz] = &self.columns;
        RayBatch {
            len: RAYS,
            origin: [x, y, z],
            direction: [dx, dy, dz],
            skip: &self.none,
        }
    }

    /// Distances, primitives, and whether the segments are occluded.
    fn ask(&self, accel: &dyn Accel) -> (Vec<f32>, Vec<u32>, Vec<u32>) {
        let mut counters = AccelCounters::default();
        let (mut t, mut primitive) = (vec![0.0; padded(RAYS)], self.none.clone());
        let hits = HitBatch {
            t: &mut t,
            primitive: &mut primitive,
        };
        accel.closest(self.batch(), hits, &mut counters);
        let mut occluded = vec![2; padded(RAYS)];
        let shadows = ShadowBatch {
            rays: self.batch(),
            t_max: &self.t_max,
            target: &self.none,
        };
        accel.occluded(shadows, &mut occluded, &mut counters);
        t.truncate(RAYS);
        primitive.truncate(RAYS);
        occluded.truncate(RAYS);
        (t, primitive, occluded)
    }
}

fn mesh(rng: &mut Rng) -> Geometry {
    Geometry {
        triangles: lat_long_sphere(20, 40, 0.2, rng).triangles(),
        ..Geometry::default()
    }
}

/// Holds a structure's answers against the linear one's.
pub(super) fn check(build: impl FnOnce(&Geometry) -> Box<dyn Accel>) {
    let mut rng = Rng(77);
    let geometry = mesh(&mut rng);
    let rays = Rays::new(&mut rng);
    let accel = build(&geometry);
    let (expected, found) = (rays.ask(&LinearScan::new(&geometry)), rays.ask(&*accel));
    let hits = expected.1.iter().filter(|&&id| id != PrimitiveId::NONE);
    assert!(hits.count() > RAYS / 2);
    let mut differing = 0;
    for i in 0..RAYS {
        if found.1[i] == expected.1[i] {
            let (a, b) = (found.0[i], expected.0[i]);
            assert!(a == b || (a - b).abs() < 1e-4 * b, "{a} instead of {b}");
        } else {
            differing += 1;
        }
        differing += usize::from(found.2[i] != expected.2[i]);
    }
    assert!(differing <= 5, "{differing} differ");
    assert!(accel.bytes() > 36 * geometry.triangles.len());
}

#[test]
fn obvhs_answers_as_the_linear_structure() {
    check(|geometry| Box::new(ObvhsBvh2::new(geometry).unwrap()));
    check(|geometry| Box::new(ObvhsCwBvh::new(geometry).unwrap()));
}

#[test]
fn obvhs_takes_an_empty_scene_and_rays_that_are_not_finite() {
    let mut rng = Rng(78);
    let mut rays = Rays::new(&mut rng);
    let empty = Geometry::default();
    let full = mesh(&mut rng);
    let build = |geometry: &Geometry| -> [Box<dyn Accel>; 2] {
        [
            Box::new(ObvhsBvh2::new(geometry).unwrap()),
            Box::new(ObvhsCwBvh::new(geometry).unwrap()),
        ]
    };
    for accel in build(&empty) {
        let (t, primitive, occluded) = rays.ask(&*accel);
        assert!(t.iter().all(|&t| t == f32::INFINITY));
        assert!(primitive.iter().all(|&id| id == PrimitiveId::NONE));
        assert!(occluded.iter().all(|&blocked| blocked == 0));
    }
    rays.columns[0][0] = f32::NAN;
    rays.columns[4][1] = f32::INFINITY;
    for accel in build(&full) {
        let (_, primitive, occluded) = rays.ask(&*accel);
        assert_eq!(primitive[..2], [PrimitiveId::NONE; 2]);
        assert_eq!(occluded[..2], [0; 2]);
    }
}

#[cfg(feature = "embree")]
#[test]
#[expect(clippy::print_stderr, reason = "a skipped test says so")]
fn embree_answers_as_the_linear_structure() {
    use std::sync::Arc;

    use super::embree::{Embree, EmbreeMesh, EmbreeScene};
    use super::{EMBREE, EmbreeBuild};

    let mut rng = Rng(79);
    let triangles = mesh(&mut rng).triangles;
    let small = EmbreeMesh::new(&triangles);
    if let Err(error) = EmbreeScene::new(&small, EmbreeBuild::Medium, 1) {
        eprintln!("skipped, since Embree is not there: {error}");
        return;
    }
    for (build, calls) in EMBREE {
        check(|geometry| {
            let mesh = EmbreeMesh::new(&geometry.triangles);
            let scene = EmbreeScene::new(&mesh, build, 2).unwrap();
            assert_eq!(scene.version()[0], 4);
            assert!(scene.peak_bytes() > 36 * geometry.triangles.len());
            let wide = cfg!(target_feature = "avx512f");
            assert!(!wide || scene.packet_width() == 16);
            let accel = Embree::new(&Arc::new(scene), calls);
            assert_eq!(accel.name(), super::embree_name(build, calls));
            Box::new(accel)
        });
    }
}
