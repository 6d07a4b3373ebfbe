//! Leaves of the octree: primitives in packs that one ray meets lanes at a time.

use crate::geometry::sphere::{SpherePack, sphere_distance};
use crate::geometry::triangle::{ShearRay, TrianglePack};
use crate::geometry::{Geometry, PrimitiveId};
use crate::math::Vec3s;
use crate::math::lanes::{Compare, F32s, LANES, Mask, U32s};

/// One ray, prepared for primitives.
#[derive(Debug)]
pub(super) struct PrimitiveRay {
    shear: ShearRay,
    origin: [f32; 3],
    direction: [f32; 3],
    skip: u32,
}

impl PrimitiveRay {
    #[inline(always)]
    pub(super) fn new(origin: [f32; 3], direction: [f32; 3], skip: u32) -> Self {
        Self {
            shear: ShearRay::new(origin, direction),
            origin,
            direction,
            skip,
        }
    }

    /// Lanes that the ray hits, and their distances.
    #[inline(always)]
    fn triangle_hits(&self, pack: &TrianglePack) -> (Mask, F32s) {
        let (hits, t) = self.shear.intersect_pack(pack);
        (hits & !Compare::eq(pack.ids, U32s::splat(self.skip)), t)
    }

    /// Lanes that the ray hits, and their distances.
    #[inline(always)]
    fn sphere_hits(&self, pack: &SpherePack) -> (Mask, F32s) {
        let leaving = Compare::eq(pack.ids, U32s::splat(self.skip));
        let t = sphere_distance(
            pack.center,
            pack.radius,
            Vec3s::splat(self.origin),
            Vec3s::splat(self.direction),
            leaving,
        );
        (t.lt(F32s::splat(f32::INFINITY)), t)
    }
}

/// Nearest hit so far.
#[derive(Debug, Clone, Copy)]
pub(super) struct Nearest {
    pub(super) t: f32,
    pub(super) primitive: u32,
}

impl Nearest {
    /// Nothing hit.
    pub(super) const MISS: Self = Self {
        t: f32::INFINITY,
        primitive: PrimitiveId::NONE,
    };

    /// Takes the nearest of the hit lanes, the lower id of equals.
    #[inline(always)]
    fn take(&mut self, (hits, t): (Mask, F32s), ids: &U32s) {
        let hits = hits & t.le(F32s::splat(self.t));
        if hits.any() {
            let (t, ids) = (t.as_array(), ids.as_array());
            for lane in hits.lanes() {
                if t[lane] < self.t || (t[lane] == self.t && ids[lane] < self.primitive) {
                    *self = Self {
                        t: t[lane],
                        primitive: ids[lane],
                    };
                }
            }
        }
    }
}

/// Places in the tables of packs.
#[derive(Debug, Clone, Copy, Default)]
struct Packs {
    triangles: u32,
    spheres: u32,
}

/// All leaves of an octree.
#[derive(Debug)]
pub(super) struct Leaves {
    /// Where the packs of each leaf begin, and where those of the last end.
    begin: Vec<Packs>,
    triangles: Vec<TrianglePack>,
    spheres: Vec<SpherePack>,
}

impl Leaves {
    /// No leaf.
    pub(super) fn new() -> Self {
        Self {
            begin: vec![Packs::default()],
            triangles: Vec::new(),
            spheres: Vec::new(),
        }
    }

    /// Adds a leaf of these primitives, however many, and gives its index. Ids are in ascending order.
    pub(super) fn push(&mut self, geometry: &Geometry, ids: &[u32]) -> usize {
        let triangle_count = geometry.triangles.len();
        let (triangles, spheres) =
            ids.split_at(ids.partition_point(|&id| (id as usize) < triangle_count));
        self.triangles.extend(triangles.chunks(LANES).map(|ids| {
            TrianglePack::new(ids.iter().map(|&id| (id, geometry.triangles[id as usize])))
        }));
        self.spheres.extend(spheres.chunks(LANES).map(|ids| {
            let sphere = |id: u32| geometry.spheres[id as usize - triangle_count];
            SpherePack::new(ids.iter().map(|&id| (id, sphere(id))))
        }));
        self.begin.push(Packs {
            triangles: self.triangles.len() as u32,
            spheres: self.spheres.len() as u32,
        });
        self.begin.len() - 2
    }

    /// Number of leaves.
    pub(super) fn len(&self) -> usize {
        self.begin.len() - 1
    }

    /// Adds the leaves of another table after the own ones.
    pub(super) fn append(&mut self, other: Self) {
        let (triangles, spheres) = (self.triangles.len() as u32, self.spheres.len() as u32);
        self.triangles.extend(other.triangles);
        self.spheres.extend(other.spheres);
        self.begin
            .extend(other.begin[1..].iter().map(|packs| Packs {
                triangles: packs.triangles + triangles,
                spheres: packs.spheres + spheres,
            }));
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        std::mem::size_of_val(&*self.begin)
            + std::mem::size_of_val(&*self.triangles)
            + std::mem::size_of_val(&*self.spheres)
    }

    /// The packs of a leaf.
    #[inline(always)]
    fn packs(&self, leaf: usize) -> (&[TrianglePack], &[SpherePack]) {
        let (begin, end) = (self.begin[leaf], self.begin[leaf + 1]);
        (
            &self.triangles[begin.triangles as usize..end.triangles as usize],
            &self.spheres[begin.spheres as usize..end.spheres as usize],
        )
    }

    /// Improves `nearest` by what is in the leaf; returns how many tests that took.
    #[inline(always)]
    pub(super) fn closest(&self, leaf: usize, ray: &PrimitiveRay, nearest: &mut Nearest) -> u64 {
        let (triangles, spheres) = self.packs(leaf);
        for pack in triangles {
            nearest.take(ray.triangle_hits(pack), &pack.ids);
        }
        for pack in spheres {
            nearest.take(ray.sphere_hits(pack), &pack.ids);
        }
        ((triangles.len() + spheres.len()) * LANES) as u64
    }

    /// Whether something in the leaf other than `target` is hit before `t_max`.
    #[inline(always)]
    pub(super) fn occluded(
        &self,
        leaf: usize,
        ray: &PrimitiveRay,
        t_max: f32,
        target: u32,
        tests: &mut u64,
    ) -> bool {
        let mut blocks = |(hits, t): (Mask, F32s), ids: U32s| {
            *tests += LANES as u64;
            (hits & t.lt(F32s::splat(t_max)) & !Compare::eq(ids, U32s::splat(target))).any()
        };
        let (triangles, spheres) = self.packs(leaf);
        triangles
            .iter()
            .any(|pack| blocks(ray.triangle_hits(pack), pack.ids))
            || spheres
                .iter()
                .any(|pack| blocks(ray.sphere_hits(pack), pack.ids))
    }
}

#[cfg(test)]
impl Leaves {
    /// Ids of the primitives of each leaf.
    pub(super) fn ids(&self) -> Vec<Vec<u32>> {
        let leaf = |leaf| {
            let (triangles, spheres) = self.packs(leaf);
            let triangles = triangles.iter().flat_map(|pack| pack.ids.to_array());
            let spheres = spheres.iter().flat_map(|pack| pack.ids.to_array());
            triangles
                .chain(spheres)
                .filter(|&id| id != PrimitiveId::NONE)
                .collect()
        };
        (0..self.len()).map(leaf).collect()
    }
}
