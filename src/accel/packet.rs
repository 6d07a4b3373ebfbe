//! Groups of rays with like directions descend the 8-wide tree together, a ray per lane, until few of them
//! remain in a subtree: those go on alone from there. Before the rays are tested against a child one by
//! one in their lanes, bounds of them all are tested against the eight children of a node at once, in
//! interval arithmetic (Wald et al., "Ray Tracing Animated Scenes using Coherent Grid Traversal", 2006, cull
//! with frusta for the same reason).

use wide::{f32x4, f32x8, f32x16};

use super::AccelCounters;
use super::blocks::{Blocks, LEAF, Leaf, Node};
use super::octant::{NEAREST, ORDER};
use super::stream::{Query, entered};
use crate::geometry::PrimitiveId;
use crate::geometry::slab::FAR_PADDING;
use crate::geometry::sphere::sphere_distance;
use crate::geometry::triangle::{ShearRays, shear_lanes};
use crate::math::lanes::{Compare, F32s, LANES, Mask, U32s};
use crate::math::vec3::Vec3s;

/// Up to this many rays of a group leave it where no more than they enter a subtree. Camera rays of the
/// bunny with 1, 2, 3, 6: 27.0, 26.4, 25.5, 23.0 million per CPU second.
pub(super) const FEW: usize = 2;

/// Most subtrees that a ray can have left to it.
pub(super) const MOST_PENDING: usize = 32;

/// A group of which the directions differ by more than this in some component is not coherent. Between 0.1
/// and 1 all kinds of rays cost the same within the noise: what is less coherent has no common axis.
const COHERENT_SPREAD: f32 = 0.25;

/// Up to [`LANES`] rays of one octant, and their answers.
#[derive(Debug, Clone, Copy)]
pub(super) struct PacketRays {
    pub(super) origin: Vec3s,
    pub(super) direction: Vec3s,
    /// |1/d|.
    pub(super) reciprocal: Vec3s,
    /// Lanes whose direction is largest along each axis.
    pub(super) largest: [Mask; 3],
    /// As from [`shear_lanes`].
    pub(super) shear: [F32s; 3],
    pub(super) skip: U32s,
    pub(super) target: U32s,
    /// Closest hits so far, or ends of the rays; negative where any hit was enough.
    pub(super) t: F32s,
    /// Primitives hit.
    pub(super) primitive: U32s,
}

impl PacketRays {
    #[inline(always)]
    pub(super) fn new(origin: Vec3s, direction: Vec3s, skip: U32s, t: F32s, target: U32s) -> Self {
        let one = F32s::splat(1.0);
        let Vec3s { x, y, z } = direction;
        let (largest, shear) = shear_lanes(direction);
        Self {
            origin,
            direction,
            reciprocal: Vec3s::new((one / x).abs(), (one / y).abs(), (one / z).abs()),
            largest,
            shear,
            skip,
            target,
            t,
            primitive: U32s::splat(PrimitiveId::NONE),
        }
    }

    /// The axis along which all directions are largest, if there is one and the rays of `valid` can
    /// descend together.
    #[inline(always)]
    pub(super) fn common_axis(&self, valid: Mask) -> Option<usize> {
        let axis = (0..3).find(|&axis| (valid & !self.largest[axis]).none())?;
        let Vec3s { x, y, z } = self.reciprocal;
        let most = F32s::splat(f32::MAX);
        let finite = x.le(most) & y.le(most) & z.le(most);
        (valid.count() > FEW && (valid & !finite).none()).then_some(axis)
    }

    /// Whether the directions of `valid` are close.
    #[inline(always)]
    pub(super) fn is_coherent(&self, valid: Mask) -> bool {
        let Vec3s { x, y, z } = self.direction;
        [x, y, z].into_iter().all(|component| {
            let [low, high] = range(component, valid);
            high - low <= COHERENT_SPREAD
        })
    }
}

/// Smallest and largest of the lanes of `valid`, of which there must be one.
#[inline(always)]
fn range(values: F32s, valid: Mask) -> [f32; 2] {
    let quarters = |v: F32s| bytemuck::cast::<F32s, [f32x4; LANES / 4]>(v);
    let low = quarters(valid.select(values, F32s::splat(f32::INFINITY)));
    let high = quarters(valid.select(values, F32s::splat(f32::NEG_INFINITY)));
    let low = low.into_iter().fold(low[0], f32x4::fast_min).to_array();
    let high = high.into_iter().fold(high[0], f32x4::fast_max).to_array();
    let less = |a: f32, b: f32| if a < b { a } else { b };
    let more = |a: f32, b: f32| if a > b { a } else { b };
    [
        less(less(low[0], low[1]), less(low[2], low[3])),
        more(more(high[0], high[1]), more(high[2], high[3])),
    ]
}

/// Subtrees left to a ray, in the order in which the group came to them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pending {
    pub(super) t: [f32; MOST_PENDING],
    pub(super) reference: [u32; MOST_PENDING],
    pub(super) len: usize,
}

/// Memory of a worker.
#[derive(Debug)]
pub(super) struct Scratch {
    /// Subtrees put aside: where each lane enters, infinite where it does not.
    near: Vec<F32s>,
    reference: Vec<u32>,
    /// Per lane.
    pub(super) pending: [Pending; LANES],
}

impl Default for Scratch {
    fn default() -> Self {
        let none = Pending {
            t: [0.0; MOST_PENDING],
            reference: [0; MOST_PENDING],
            len: 0,
        };
        Self {
            near: Vec::new(),
            reference: Vec::new(),
            pending: [none; LANES],
        }
    }
}

impl Scratch {
    /// Makes room for trees that need `bound` entries.
    pub(super) fn reserve(&mut self, bound: usize) {
        if self.near.len() < bound {
            self.near.resize(bound, F32s::splat(0.0));
            self.reference.resize(bound, 0);
        }
    }
}

/// Bounds of all rays of a group, in the form in which one ray is tested against eight boxes.
struct Bundle {
    /// Largest origin for lower planes, smallest for upper ones.
    origin: [f32x16; 3],
    /// Smallest and largest |1/d| for lower planes, negated for upper ones.
    reciprocal: [[f32x16; 2]; 3],
    /// 0 for near planes, minus the largest of the rays' ends for far ones.
    limits: f32x16,
}

impl Bundle {
    #[inline(always)]
    fn new(rays: &PacketRays, valid: Mask) -> Self {
        let columns = |v: Vec3s| [v.x, v.y, v.z];
        let halves = |low: f32, high: f32| {
            bytemuck::cast::<_, f32x16>([f32x8::splat(low), f32x8::splat(high)])
        };
        let origin = columns(rays.origin).map(|column| {
            let [low, high] = range(column, valid);
            halves(high, low)
        });
        let reciprocal = columns(rays.reciprocal)
            .map(|column| range(column, valid).map(|bound| halves(bound, -bound)));
        let mut bundle = Self {
            origin,
            reciprocal,
            limits: f32x16::ZERO,
        };
        bundle.limit(rays.t, valid);
        bundle
    }

    /// Takes the rays' ends into account.
    #[inline(always)]
    fn limit(&mut self, t: F32s, valid: Mask) {
        let [_, most] = range(t, valid);
        self.limits = bytemuck::cast([f32x8::splat(0.0), f32x8::splat(-most)]);
    }

    /// Children that some ray may enter. Every rounding is that of a single ray's test and monotone, so
    /// that bounds stay bounds.
    #[inline(always)]
    fn enters<const OCTANT: usize>(&self, node: &Node) -> u32 {
        entered::<OCTANT>(self.limits, |axis| {
            let offset = node.planes[axis] - self.origin[axis];
            let [least, most] = self.reciprocal[axis].map(|reciprocal| offset * reciprocal);
            least.fast_min(most)
        })
        .0
    }
}

/// Traces the rays of `valid`, whose directions are of this octant and largest along `axis`, through the
/// tree; what is left to each alone is in `scratch.pending`.
#[inline(always)]
pub(super) fn descend<const OCTANT: usize, const SPHERES: bool, Q: Query>(
    tree: &Blocks,
    rays: &mut PacketRays,
    axis: usize,
    valid: Mask,
    scratch: &mut Scratch,
    counters: &mut AccelCounters,
) {
    let infinity = F32s::splat(f32::INFINITY);
    let shear = ShearRays::new(rays.origin, axis, rays.shear);
    let mut bundle = Bundle::new(rays, valid);
    for pending in &mut scratch.pending {
        pending.len = 0;
    }
    let mut most_pending = 0;
    let mut near = valid.select(F32s::splat(0.0), infinity);
    let mut reference = tree.root;
    let mut size = 0;
    loop {
        let active = near.lt(rays.t * F32s::splat(FAR_PADDING));
        if active.count() <= FEW && most_pending < MOST_PENDING {
            let near = near.to_array();
            for lane in active.lanes() {
                let pending = &mut scratch.pending[lane];
                pending.t[pending.len] = near[lane];
                pending.reference[pending.len] = reference;
                pending.len += 1;
                most_pending = most_pending.max(pending.len);
            }
        } else if reference & LEAF == 0 {
            counters.nodes += active.count() as u64;
            let node = tree.node(reference);
            let mask = bundle.enters::<OCTANT>(node);
            let order = &ORDER[OCTANT][mask as usize];
            let count = mask.count_ones() as usize;
            for place in 0..count {
                let lane = if place + 1 == count { NEAREST } else { place };
                let slot = usize::from(order[lane]);
                let (entered, near) = enter_child::<OCTANT>(node, slot, rays, active);
                if entered.any() {
                    scratch.near[size] = entered.select(near, infinity);
                    scratch.reference[size] = node.children[slot];
                    tree.prefetch(node.children[slot]);
                    size += 1;
                }
            }
        } else {
            let leaf = tree.leaf(reference);
            counters.tests += ((leaf.triangles + leaf.spheres) * active.count()) as u64;
            if meet_leaf::<SPHERES, Q>(&leaf, rays, &shear, active) {
                bundle.limit(rays.t, valid);
            }
        }
        if size == 0 {
            return;
        }
        size -= 1;
        near = scratch.near[size];
        reference = scratch.reference[size];
    }
}

/// Lanes of `active` that enter the child in `slot`, and where. The test of each lane is that of
/// [`crate::geometry::slab::SlabRay`].
#[inline(always)]
fn enter_child<const OCTANT: usize>(
    node: &Node,
    slot: usize,
    rays: &PacketRays,
    active: Mask,
) -> (Mask, F32s) {
    let (origin, reciprocal) = (&rays.origin, &rays.reciprocal);
    let origin = [origin.x, origin.y, origin.z];
    let reciprocal = [reciprocal.x, reciprocal.y, reciprocal.z];
    let (mut first, mut last) = (F32s::splat(0.0), rays.t);
    for axis in 0..3 {
        let planes = node.planes[axis].as_array();
        let (lower, upper) = (F32s::splat(planes[slot]), F32s::splat(planes[8 + slot]));
        let (near, far) = if OCTANT >> axis & 1 == 0 {
            (lower - origin[axis], upper - origin[axis])
        } else {
            (origin[axis] - upper, origin[axis] - lower)
        };
        first = (near * reciprocal[axis]).fast_max(first);
        last = (far * reciprocal[axis] * F32s::splat(FAR_PADDING)).fast_min(last);
    }
    (first.le(last) & active, first)
}

/// Tests the rays of `active` against each primitive of the leaf; whether one was hit.
#[inline(always)]
fn meet_leaf<const SPHERES: bool, Q: Query>(
    leaf: &Leaf<'_>,
    rays: &mut PacketRays,
    shear: &ShearRays,
    active: Mask,
) -> bool {
    let mut met = false;
    for index in 0..leaf.triangles {
        let coordinate = |axis, corner| leaf.coordinate(index, axis, corner);
        let (hits, t) = shear.intersect(coordinate, active);
        if hits.any() {
            let id = leaf.id(index);
            let hits = hits & !rays.skip.eq(U32s::splat(id));
            met |= rays.take::<Q>(hits, t, id);
        }
    }
    if SPHERES {
        for index in 0..leaf.spheres {
            let (id, center, radius) = leaf.sphere(index);
            let (center, radius) = (Vec3s::splat(center), F32s::splat(radius));
            let leaving = rays.skip.eq(U32s::splat(id));
            let t = sphere_distance(center, radius, rays.origin, rays.direction, leaving);
            let hits = active & t.lt(F32s::splat(f32::INFINITY));
            met |= rays.take::<Q>(hits, t, id);
        }
    }
    met
}

impl PacketRays {
    /// Takes hits of the primitive `id` where they count; whether one did.
    #[inline(always)]
    fn take<Q: Query>(&mut self, hits: Mask, t: F32s, id: u32) -> bool {
        let id = U32s::splat(id);
        let taken = if Q::ANY {
            hits & t.lt(self.t) & !self.target.eq(id)
        } else {
            hits & (t.lt(self.t) | (Compare::eq(t, self.t) & id.lt(self.primitive)))
        };
        let t = if Q::ANY { F32s::splat(-1.0) } else { t };
        self.t = taken.select(t, self.t);
        self.primitive = taken.select_u32(id, self.primitive);
        taken.any()
    }
}
