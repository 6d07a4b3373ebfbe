//! Groups of rays with like directions descend the 8-wide tree together until few of them remain in a
//! subtree: those go on alone from there. Bounds of all rays of a group are tested against the eight
//! children of a node at once, in interval arithmetic, and rays are looked at one by one, a lane each, only
//! where these bounds leave open whether all of them enter (Wald et al., "Ray Tracing Animated Scenes
//! using Coherent Grid Traversal", 2006, cull with frusta for the same reason). Triangles of a leaf
//! that no ray of the group can meet are left out in the same way.

use wide::{f32x4, f32x8, i8x16};

use super::AccelCounters;
use super::blocks::{Blocks, LEAF, Leaf, Node};
use super::flight::Row;
use super::octant::{ORDER, Sides};
use super::stream::Query;
use crate::geometry::PrimitiveId;
use crate::geometry::slab::FAR_PADDING;
use crate::geometry::sphere::sphere_distance;
use crate::geometry::triangle::{FramedRay, ShearRays, frame_axes, shear_lanes};
use crate::math::lanes::{Compare, F32s, FloatLanes, LANES, Mask, U32s};
use crate::math::vec3::Vec3s;

/// Most rays of a group.
pub(super) const GROUP: usize = 64;
/// Vectors of lanes in a group.
const VECTORS: usize = GROUP / LANES;

/// Rays leave a group of [`GROUP`] where no more than this many enter a subtree, smaller groups in proportion. Camera
/// rays per CPU second over those with 2, 8 and 16: dragon, whose triangles are smaller than pixels, 1.05, 1.04, 0.99;
/// hairball 1.02, 0.99, 1.03; Sponza 0.99, 1.00, 1.03; bunny 0.95, 0.95, 1.05.
const FEW: u32 = 12;
/// Rays that make a group.
const LEAST: u32 = 3;

/// Most subtrees that a ray can have left to it.
pub(super) const MOST_PENDING: usize = 32;

/// Rays whose directions differ by more than this in some component do not descend in one group.
pub(super) const GROUP_SPREAD: f32 = 0.2;
/// Neither do those whose origins lie further apart than this share of the tree's longest side.
const ORIGIN_SPREAD: f32 = 0.2;
/// As [`GROUP_SPREAD`], for rays of one vector of lanes.
const VECTOR_SPREAD: f32 = 0.25;

/// One bit per ray of a group.
pub(super) type Rays = u64;

/// Bits of the rays of a vector of lanes.
pub(super) const fn rays_of(vector: usize) -> Rays {
    (Mask::ALL.0 as Rays) << (vector * LANES)
}

/// The rays among these that are in a vector of lanes.
#[inline(always)]
pub(super) fn lanes_of(rays: Rays, vector: usize) -> Mask {
    Mask((rays >> (vector * LANES)) as u16 & Mask::ALL.0)
}

/// Positions of the bits that are set.
#[inline(always)]
fn each(mut rays: Rays) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let ray = rays.trailing_zeros() as usize;
        rays &= rays.wrapping_sub(1);
        (ray < GROUP).then_some(ray)
    })
}

/// A number of each ray of a group.
pub(super) type Column = [F32s; VECTORS];
/// As [`Column`].
pub(super) type ColumnU32 = [U32s; VECTORS];

/// Up to [`GROUP`] rays of one octant, and their answers.
#[derive(Debug, Default)]
pub(super) struct Group {
    pub(super) origin: [Column; 3],
    /// Of rays that descend.
    sheared: [ShearRays; VECTORS],
    direction: [Column; 3],
    /// 1/d.
    pub(super) reciprocal: [Column; 3],
    /// Axis along which the direction is largest.
    pub(super) largest: ColumnU32,
    /// As from [`shear_lanes`].
    pub(super) shear: [Column; 3],
    /// Primitives that do not count, of rays that descend.
    pub(super) skip: ColumnU32,
    pub(super) target: ColumnU32,
    /// Closest hits so far, or ends of the rays; negative where any hit was enough.
    pub(super) t: Column,
    /// Primitives hit.
    pub(super) primitive: ColumnU32,
    /// Numbers of the rays in their batch.
    pub(super) ray: ColumnU32,
}

impl Group {
    /// Sets the rays of a vector of lanes, of which no primitive is hit yet.
    #[inline(always)]
    pub(super) fn set(
        &mut self,
        vector: usize,
        ray: U32s,
        [origin, direction]: [[F32s; 3]; 2],
        t: F32s,
    ) {
        let one = F32s::splat(1.0);
        let [x, y, z] = direction;
        let reciprocal = direction.map(|d| one / d);
        let ([_, is_y, is_z], shear) = shear_lanes(Vec3s { x, y, z }, reciprocal);
        for axis in 0..3 {
            self.origin[axis][vector] = origin[axis];
            self.direction[axis][vector] = direction[axis];
            self.reciprocal[axis][vector] = reciprocal[axis];
            self.shear[axis][vector] = shear[axis];
        }
        let place = is_z.select_u32(U32s::splat(2), U32s::splat(0));
        self.largest[vector] = is_y.select_u32(U32s::splat(1), place);
        self.t[vector] = t;
        self.primitive[vector] = U32s::splat(PrimitiveId::NONE);
        self.ray[vector] = ray;
    }

    /// A ray's number in one of the columns.
    #[inline(always)]
    pub(super) fn at(&self, column: &Column, ray: usize) -> f32 {
        bytemuck::cast_slice::<F32s, f32>(column)[ray]
    }

    /// A vector of these rays, whose directions are of `octant`, about to take off; at no place in stacks yet.
    #[inline(always)]
    pub(super) fn row(&self, vector: usize, octant: usize) -> Row {
        let at = |columns: &[Column; 3]| columns.each_ref().map(|column| column[vector]);
        let [u, v, _] = at(&self.shear);
        Row {
            largest: [0, 1, 2].map(|axis| self.largest[vector].eq(U32s::splat(axis))),
            origin: at(&self.origin),
            reciprocal: at(&self.reciprocal),
            shear: [u, v],
            t: self.t[vector],
            primitive: self.primitive[vector],
            ray: self.ray[vector],
            octant: U32s::splat(octant as u32),
            top: U32s::splat(0),
        }
    }

    /// Prepares all rays for triangle tests along these axes.
    #[inline(always)]
    fn shear(&mut self, axes: [usize; 3]) {
        for (vector, sheared) in self.sheared.iter_mut().enumerate() {
            for (k, axis) in axes.into_iter().enumerate() {
                sheared.origin[k] = self.origin[axis][vector];
                sheared.shear[k] = self.shear[k][vector];
            }
        }
    }

    /// The axis along which the directions of all of these rays are largest, if there is one and they can
    /// descend together.
    #[inline(always)]
    pub(super) fn common_axis(&self, rays: Rays) -> Option<usize> {
        if rays.count_ones() < LEAST {
            return None;
        }
        let most = F32s::splat(f32::MAX);
        let axis = bytemuck::cast_slice::<U32s, u32>(&self.largest)[rays.trailing_zeros() as usize];
        let like = (0..VECTORS).all(|vector| {
            if lanes_of(rays, vector).none() {
                return true;
            }
            let others = !self.largest[vector].eq(U32s::splat(axis));
            let [x, y, z] = self
                .reciprocal
                .each_ref()
                .map(|column| column[vector].abs());
            let finite = x.le(most) & y.le(most) & z.le(most);
            (lanes_of(rays, vector) & (others | !finite)).none()
        });
        like.then_some(axis as usize)
    }

    /// The extent of these rays.
    #[inline(always)]
    pub(super) fn extent(&self, rays: Rays) -> Extent {
        let [dx, dy, dz] = &self.direction;
        let [ox, oy, oz] = &self.origin;
        let [[dx, dy], [dz, ox], [oy, oz]] =
            [[dx, dy], [dz, ox], [oy, oz]].map(|columns| ranges(columns, rays));
        Extent {
            rays,
            direction: [dx, dy, dz],
            origin: [ox, oy, oz],
        }
    }

    /// Those of these rays that end beyond `near`.
    #[inline(always)]
    fn beyond(&self, rays: Rays, near: f32) -> Rays {
        let near = F32s::splat(near);
        let mut beyond = 0;
        for (vector, &t) in self.t.iter().enumerate() {
            let lanes = near.lt(t * F32s::splat(FAR_PADDING));
            beyond |= Rays::from(lanes.0) << (vector * LANES);
        }
        beyond & rays
    }

    /// Those of these rays that enter the child in `slot`. The test of each is that of
    /// [`crate::geometry::slab::SlabRay`].
    #[inline(always)]
    fn enter_child(&self, node: &Node, sides: Sides, slot: usize, rays: Rays) -> Rays {
        let planes = [0, 1, 2].map(|axis| {
            let [near, far] = sides.planes(node, axis);
            [near.as_array()[slot], far.as_array()[slot]]
        });
        let mut all = 0;
        for vector in 0..VECTORS {
            let lanes = lanes_of(rays, vector);
            if lanes.none() {
                continue;
            }
            let (mut first, mut last) = (F32s::splat(0.0), self.t[vector]);
            for (axis, planes) in planes.into_iter().enumerate() {
                let origin = self.origin[axis][vector];
                let reciprocal = self.reciprocal[axis][vector];
                let [near, far] = planes.map(|plane| (F32s::splat(plane) - origin) * reciprocal);
                first = near.fast_max(first);
                last = (far * F32s::splat(FAR_PADDING)).fast_min(last);
            }
            all |= Rays::from((first.le(last) & lanes).0) << (vector * LANES);
        }
        all
    }

    /// Tests these rays against primitives of the leaf; whether one was hit.
    #[inline(always)]
    fn meet_leaf<const SPHERES: bool, Q: Query, const Z: usize>(
        &mut self,
        leaf: &Leaf<'_>,
        bundle: &Bundle<Z>,
        rays: Rays,
    ) -> bool {
        let mut met = Mask::NONE;
        let row = |k: usize, corner: usize| leaf.row(Bundle::<Z>::AXES[k], corner);
        let meets = bundle.cone.meets(row) & Mask::first(leaf.triangles);
        let vectors = (0..VECTORS)
            .filter(|&vector| lanes_of(rays, vector).any())
            .count();
        // All triangles against a ray take about as long as a triangle against a vector of rays.
        if (rays.count_ones() as usize) < meets.count() * vectors {
            for ray in each(rays) {
                met = met | self.meet_alone::<Q, Z>(leaf, ray, meets);
            }
        } else {
            for index in meets.lanes() {
                let corners = Bundle::<Z>::AXES.map(|axis| leaf.corners(axis, index));
                let id = U32s::splat(leaf.id(index));
                for vector in 0..VECTORS {
                    let lanes = lanes_of(rays, vector);
                    if lanes.none() {
                        continue;
                    }
                    let (hits, t) = self.sheared[vector].intersect(&corners, lanes);
                    if hits.any() {
                        let hits = hits & !self.skip[vector].eq(id);
                        met = met | self.take::<Q>(vector, hits, t, id);
                    }
                }
            }
        }
        if SPHERES && leaf.spheres > 0 {
            for vector in 0..VECTORS {
                let [origin, direction] = [&self.origin, &self.direction]
                    .map(|[x, y, z]| Vec3s::new(x[vector], y[vector], z[vector]));
                for index in 0..leaf.spheres {
                    let (id, center, radius) = leaf.sphere(index);
                    let (center, radius) = (Vec3s::splat(center), F32s::splat(radius));
                    let id = U32s::splat(id);
                    let leaving = self.skip[vector].eq(id);
                    let t = sphere_distance(center, radius, origin, direction, leaving);
                    let hits = lanes_of(rays, vector) & t.lt(F32s::splat(f32::INFINITY));
                    met = met | self.take::<Q>(vector, hits, t, id);
                }
            }
        }
        met.any()
    }

    /// Tests one ray against these triangles of the leaf; the ray's lane where it hit one.
    #[inline(always)]
    fn meet_alone<Q: Query, const Z: usize>(
        &mut self,
        leaf: &Leaf<'_>,
        ray: usize,
        triangles: Mask,
    ) -> Mask {
        let (leaf, axes) = (*leaf, Bundle::<Z>::AXES);
        let [u, v, _] = &self.shear;
        let framed = FramedRay {
            origin: axes.map(|axis| self.at(&self.origin[axis], ray)),
            shear: [self.at(u, ray), self.at(v, ray)],
            back: -self.at(&self.reciprocal[Z], ray),
        };
        let (hits, t) = framed.intersect(move |k, corner| leaf.row(axes[k], corner), triangles);
        if hits.none() {
            return Mask::NONE;
        }
        let t = t.to_array();
        let (vector, lane) = (ray / LANES, Mask(1 << (ray % LANES)));
        let mut met = Mask::NONE;
        for index in hits.lanes() {
            let id = U32s::splat(leaf.id(index));
            let hits = lane & !self.skip[vector].eq(id);
            met = met | self.take::<Q>(vector, hits, F32s::splat(t[index]), id);
        }
        met
    }

    /// Takes hits of the primitive `id` where they count; the lanes where one did.
    #[inline(always)]
    fn take<Q: Query>(&mut self, vector: usize, hits: Mask, t: F32s, id: U32s) -> Mask {
        let (end, primitive) = (self.t[vector], self.primitive[vector]);
        let taken = if Q::ANY {
            hits & t.lt(end) & !self.target[vector].eq(id)
        } else {
            hits & (t.lt(end) | (Compare::eq(t, end) & id.lt(primitive)))
        };
        let t = if Q::ANY { F32s::splat(-1.0) } else { t };
        self.t[vector] = taken.select(t, end);
        self.primitive[vector] = taken.select_u32(id, primitive);
        taken
    }
}

/// The least and the most of the origins and directions of some rays of a group.
#[derive(Debug, Clone, Copy)]
pub(super) struct Extent {
    rays: Rays,
    direction: [[f32; 2]; 3],
    origin: [[f32; 2]; 3],
}

impl Extent {
    /// Whether the directions are close enough for a group, and the origins in a tree of that size.
    #[inline(always)]
    pub(super) fn is_coherent(&self, size: f32) -> bool {
        let most = if self.rays.count_ones() as usize > LANES {
            GROUP_SPREAD
        } else {
            VECTOR_SPREAD
        };
        let within =
            |ranges: &[[f32; 2]; 3], most: f32| ranges.iter().all(|[low, high]| high - low <= most);
        within(&self.direction, most) && within(&self.origin, ORIGIN_SPREAD * size)
    }
}

/// Smallest and largest number of these rays, of which there must be one, in each column.
#[inline(always)]
fn ranges(columns: [&Column; 2], rays: Rays) -> [[f32; 2]; 2] {
    let ends = |column: &Column| {
        let mut low = F32s::splat(f32::INFINITY);
        let mut high = F32s::splat(f32::NEG_INFINITY);
        for (vector, &values) in column.iter().enumerate() {
            let lanes = lanes_of(rays, vector);
            low = low.fast_min(lanes.select(values, low));
            high = high.fast_max(lanes.select(values, high));
        }
        [low, -high].map(|values| {
            let quarters = bytemuck::cast::<F32s, [f32x4; LANES / 4]>(values);
            quarters.into_iter().fold(quarters[0], f32x4::fast_min)
        })
    };
    let ([a, b], [c, d]) = (ends(columns[0]), ends(columns[1]));
    // A lane for each of the four.
    let [a, b, c, d] = f32x4::transpose([a, b, c, d]);
    let [a, b, c, d] = a.fast_min(b).fast_min(c.fast_min(d)).to_array();
    [[a, -b], [c, -d]]
}

/// Subtrees left to a ray, in the order in which the group came to them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pending {
    pub(super) t: [f32; MOST_PENDING],
    pub(super) reference: [u32; MOST_PENDING],
}

impl Pending {
    const NONE: Self = Self {
        t: [0.0; MOST_PENDING],
        reference: [0; MOST_PENDING],
    };
}

/// A subtree put aside.
#[derive(Debug, Clone, Copy)]
struct Aside {
    rays: Rays,
    /// No ray enters it before this distance.
    near: f32,
    reference: u32,
}

/// Memory of a worker.
#[derive(Debug)]
pub(super) struct Scratch {
    aside: Vec<Aside>,
    /// Per ray.
    pub(super) pending: [Pending; GROUP],
    /// How many each has: one cache line for all.
    pub(super) counts: [u8; GROUP],
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            aside: Vec::new(),
            pending: [Pending::NONE; GROUP],
            counts: [0; GROUP],
        }
    }
}

impl Scratch {
    /// Rays to which no subtree is left.
    #[inline(always)]
    pub(super) fn without_pending(&self) -> Rays {
        let counts: [i8x16; GROUP / 16] = bytemuck::cast(self.counts);
        let mut without = 0;
        for (part, counts) in counts.into_iter().enumerate() {
            let none = counts.simd_eq(i8x16::splat(0)).to_bitmask();
            without |= Rays::from(none) << (16 * part);
        }
        without
    }

    /// Makes room for trees that need `bound` entries.
    pub(super) fn reserve(&mut self, bound: usize) {
        let none = Aside {
            rays: 0,
            near: 0.0,
            reference: 0,
        };
        if self.aside.len() < bound {
            self.aside.resize(bound, none);
        }
    }
}

/// Bounds of the rays of a group. Every rounding is that of a single ray's test and monotone, so that
/// bounds stay bounds. All directions are largest along axis `Z`.
struct Bundle<const Z: usize> {
    /// Which planes are near.
    sides: Sides,
    /// Per axis the origins of the least distances of near planes, and of far ones.
    origin: [[f32; 2]; 3],
    /// Per axis the least and the most of 1/d.
    reciprocal: [[f32; 2]; 3],
    /// Largest of the rays' ends.
    end: f32,
    cone: Cone,
}

impl<const Z: usize> Bundle<Z> {
    /// The axes of [`ShearRays`].
    const AXES: [usize; 3] = frame_axes(Z);

    #[inline(always)]
    fn new(group: &Group, sides: Sides, extent: &Extent) -> Self {
        let Extent { rays, origin, .. } = *extent;
        let [u, v, _] = &group.shear;
        let shear = ranges([u, v], rays);
        let mut bundle = Self {
            sides,
            origin: [0, 1, 2].map(|axis| {
                let [least, most] = origin[axis];
                if sides.0[axis] == 0 {
                    [most, least]
                } else {
                    [least, most]
                }
            }),
            // Directions have one sign, so that the rounded quotients fall as they rise.
            reciprocal: extent.direction.map(|[low, high]| [1.0 / high, 1.0 / low]),
            end: 0.0,
            cone: Cone::new(Self::AXES.map(|axis| origin[axis]), shear),
        };
        bundle.limit(group, rays);
        bundle
    }

    /// Takes the rays' ends into account.
    #[inline(always)]
    fn limit(&mut self, group: &Group, rays: Rays) {
        [[_, self.end], _] = ranges([&group.t; 2], rays);
    }

    /// Children that some ray may enter, with a distance before which none does, and children that all
    /// enter unless they end before.
    #[inline(always)]
    fn enters(&self, node: &Node) -> (u32, f32x8, u32) {
        let zero = f32x8::splat(0.0);
        let (mut least_near, mut most_far) = (zero, f32x8::splat(self.end));
        let (mut most_near, mut least_far) = (zero, f32x8::splat(f32::INFINITY));
        for axis in 0..3 {
            let [near, far] = self.sides.planes(node, axis).map(|planes| *planes);
            let reciprocal = self.reciprocal[axis].map(f32x8::splat);
            let [first, last] = self.origin[axis].map(f32x8::splat);
            let bounds = |planes: f32x8, origin: f32x8| {
                let [a, b] = reciprocal.map(|reciprocal| (planes - origin) * reciprocal);
                [a.fast_min(b), a.fast_max(b)]
            };
            least_near = bounds(near, first)[0].keep_max(least_near);
            most_near = bounds(near, last)[1].keep_max(most_near);
            most_far = bounds(far, last)[1].keep_min(most_far);
            least_far = bounds(far, first)[0].keep_min(least_far);
        }
        let padding = f32x8::splat(FAR_PADDING);
        let some = least_near.simd_le(most_far * padding).to_bitmask();
        let all = most_near.simd_le(least_far * padding).to_bitmask();
        (some & 0xff, least_near, all & 0xff)
    }
}

/// Bounds of rays across the axis z along which all their directions are largest: at a
/// distance z from the middle of their origins they lie within `least + slope·|z|` of the middle ray.
#[derive(Debug, Clone, Copy)]
struct Cone {
    origin: [f32; 3],
    shear: [f32; 2],
    least: [f32; 2],
    slope: [f32; 2],
}

impl Cone {
    /// Relative to what bounds are, more than all roundings in [`ShearRays`], in the bounds and in
    /// [`Self::meets`] together.
    const SLACK: f32 = 32.0 * f32::EPSILON;

    /// From ranges of the origins and of the shear along the axes.
    #[inline(always)]
    fn new(origin: [[f32; 2]; 3], shear: [[f32; 2]; 2]) -> Self {
        let middle = |[low, high]: [f32; 2]| {
            let middle = 0.5 * low + 0.5 * high;
            (middle, (high - middle).max(middle - low))
        };
        let [x, y, z] = origin.map(middle);
        let [u, v] = shear.map(middle);
        let across = [(x, u), (y, v)];
        let steepest = across.map(|(_, (shear, radius))| shear.abs() + radius);
        Self {
            origin: [x.0, y.0, z.0],
            shear: [u.0, v.0],
            least: [0, 1].map(|k| (across[k].0.1 + steepest[k] * z.1) * (1.0 + Self::SLACK)),
            slope: [0, 1].map(|k| across[k].1.1 + steepest[k] * Self::SLACK),
        }
    }

    /// Triangles that some of the rays may meet: those of which the corners do not all lie on one side of all
    /// rays. `row(k, corner)` is a coordinate of them along axis k of the rays.
    #[inline(always)]
    fn meets(&self, row: impl Fn(usize, usize) -> f32x8) -> Mask {
        let mut above = [f32x8::splat(f32::NEG_INFINITY); 2];
        let mut below = [f32x8::splat(f32::INFINITY); 2];
        for corner in 0..3 {
            let offset = |k: usize| row(k, corner) - f32x8::splat(self.origin[k]);
            let z = offset(2);
            for k in 0..2 {
                let across = offset(k) - f32x8::splat(self.shear[k]) * z;
                let radius = z
                    .abs()
                    .mul_add(f32x8::splat(self.slope[k]), f32x8::splat(self.least[k]));
                above[k] = above[k].fast_max(across + radius);
                below[k] = below[k].fast_min(across - radius);
            }
        }
        let zero = f32x8::splat(0.0);
        let [x, y] = [0, 1].map(|k| Compare::ge(above[k], zero) & Compare::le(below[k], zero));
        x & y
    }
}

/// Traces the rays of `extent`, whose directions are of `octant` and largest along `Z`, through the tree; what
/// is left to each alone is in `scratch.pending`.
#[inline(always)]
pub(super) fn descend<const SPHERES: bool, Q: Query, const Z: usize>(
    tree: &Blocks,
    group: &mut Group,
    octant: usize,
    extent: &Extent,
    scratch: &mut Scratch,
    counters: &mut AccelCounters,
) {
    group.shear(Bundle::<Z>::AXES);
    let sides = Sides::of(octant);
    let rays = extent.rays;
    let mut bundle = Bundle::<Z>::new(group, sides, extent);
    for (vector, counts) in scratch.counts.chunks_exact_mut(LANES).enumerate() {
        if lanes_of(rays, vector).any() {
            counts.fill(0);
        }
    }
    let mut most_pending = 0;
    let few = rays.count_ones() * FEW / GROUP as u32;
    let mut at = Aside {
        rays,
        near: 0.0,
        reference: tree.root,
    };
    let mut size = 0;
    loop {
        let active = group.beyond(at.rays, at.near);
        let count = active.count_ones();
        // Leaving costs more than staying at a leaf.
        let few = if at.reference & LEAF == 0 { few } else { 0 };
        if count <= few && most_pending < MOST_PENDING {
            for ray in each(active) {
                let pending = &mut scratch.pending[ray];
                let count = usize::from(scratch.counts[ray]);
                pending.t[count] = at.near;
                pending.reference[count] = at.reference;
                scratch.counts[ray] = count as u8 + 1;
                most_pending = most_pending.max(count + 1);
            }
        } else if at.reference & LEAF == 0 {
            counters.nodes += u64::from(count);
            let node = tree.node(at.reference);
            let (some, near, all) = bundle.enters(node);
            let near = near.as_array();
            let order = ORDER[octant][(some ^ 0xff) as usize].to_le_bytes();
            let count = some.count_ones() as usize;
            let base = size;
            for slot in order.into_iter().take(count).map(usize::from) {
                let rays = if all >> slot & 1 == 0 {
                    group.enter_child(node, sides, slot, active)
                } else {
                    active
                };
                if rays != 0 {
                    let near = near[slot];
                    let mut place = size;
                    while place > base && scratch.aside[place - 1].near < near {
                        scratch.aside[place] = scratch.aside[place - 1];
                        place -= 1;
                    }
                    scratch.aside[place] = Aside {
                        rays,
                        near,
                        reference: node.children[slot],
                    };
                    tree.words().prefetch(node.children[slot]);
                    size += 1;
                }
            }
        } else {
            let leaf = tree.leaf(at.reference);
            counters.tests += (leaf.triangles + leaf.spheres) as u64 * u64::from(count);
            if group.meet_leaf::<SPHERES, Q, Z>(&leaf, &bundle, active) {
                bundle.limit(group, rays);
            }
        }
        if size == 0 {
            return;
        }
        size -= 1;
        at = scratch.aside[size];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::blocks::LEAF_SIZE;
    use crate::geometry::testing::Rng;
    use crate::math::lanes::iota;

    /// Rays from about one point in about one direction, in all lanes of the first vector.
    fn group(rng: &mut Rng, spread: f32) -> Group {
        let mut around = |middle: [f32; 3], spread: f32| {
            let lane = |_| middle.map(|x| x + spread * (rng.uniform() - 0.5));
            let lanes: [[f32; 3]; LANES] = std::array::from_fn(lane);
            [0, 1, 2].map(|k| F32s::from(lanes.map(|lane| lane[k])))
        };
        let middle = around([0.0; 3], 10.0).map(|x| x.as_array()[0]);
        let forward = around([0.0, 0.0, 1.0], 1.0).map(|x| x.as_array()[0]);
        let rays = [around(middle, spread), around(forward, spread)];
        let mut group = Group::default();
        group.set(0, iota(), rays, F32s::splat(f32::INFINITY));
        group.shear([0, 1, 2]);
        group
    }

    #[test]
    fn a_triangle_that_some_ray_meets_is_never_left_out_and_most_others_are() {
        let mut rng = Rng(7);
        let (mut met, mut left_out) = (0, 0);
        for round in 0..20_000 {
            let spread = [0.0, 1e-6, 1e-3, 0.1][round % 4];
            let group = group(&mut rng, spread);
            let bundle = Bundle::<2>::new(&group, Sides::of(0), &group.extent(rays_of(0)));
            let ray = round % LANES;
            let [origin, direction] = [&group.origin, &group.direction]
                .map(|columns| columns.each_ref().map(|column| group.at(column, ray)));
            // About a point of a ray, which lies on an edge or a corner at times.
            let triangles: [[[f32; 3]; 3]; LEAF_SIZE] = std::array::from_fn(|_| {
                let t = 20.0 * rng.uniform();
                let size = [1e-4, 1e-2, 1.0][round % 3];
                let mut corner = || {
                    [0, 1, 2]
                        .map(|k| origin[k] + t * direction[k] + size * 3.0 * (rng.uniform() - 0.5))
                };
                let [a, b, c] = [corner(), corner(), corner()];
                let on_ray = [0, 1, 2].map(|k| origin[k] + t * direction[k]);
                match round % 5 {
                    0 => [on_ray, b, c],
                    1 => [b, [0, 1, 2].map(|k| 2.0 * on_ray[k] - b[k]), c],
                    _ => [a, b, c],
                }
            });
            let rows = [0, 1, 2].map(|k| [0, 1, 2].map(|i| triangles.map(|t| t[i][k])));
            let kept = bundle.cone.meets(|k, corner| f32x8::from(rows[k][corner]));
            for index in 0..LEAF_SIZE {
                let corners = rows.map(|rows| rows.map(|row| row[index]));
                let (hits, _) = group.sheared[0].intersect(&corners, Mask::ALL);
                assert!(kept.test(index) || hits.none(), "round {round}");
                met += usize::from(hits.any());
                left_out += usize::from(!kept.test(index));
            }
        }
        assert!(met > 25_000, "{met} are too few");
        assert!(left_out > 20_000, "{left_out} are too few");
    }
}
