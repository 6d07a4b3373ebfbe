#![allow(unsafe_code, reason = "x")]
//! Traversal of the 8-wide tree by a queue of rays. The rays of an octant share one loop, compiled for the
//! signs of their directions; a few dozen of them are in flight at once, each advanced by one node or one
//! leaf at a time, so that the latencies of one ray pass while others are computed.

use wide::f32x8;

use super::bvh8::{Blocks, DONE, LEAF};
use super::octant::{OCTANTS, ORDER};
use super::{AccelCounters, RayBatch};
use crate::geometry::slab::FAR_PADDING;
use crate::geometry::triangle::ShearRay;
use crate::geometry::PrimitiveId;
use crate::math::lanes::{Compare, F32s, LANES, Mask, U32s};
use wide::f32x16;

/// Rays that take turns.
const IN_FLIGHT: usize = 64;

/// A ray in flight.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
struct Flight {
    /// |1/d|, negated for the upper planes.
    reciprocal: [f32x16; 3],
    /// [0, −limit] in the order of the planes of an axis that the ray climbs.
    shear: ShearRay,
    origin: [f32; 3],
    t: f32,
    primitive: u32,
    skip: u32,
    target: u32,
    ray: u32,
    /// Node or leaf to visit next.
    current: u32,
    /// Entries put aside, in this ray's part of the stack.
    top: u32,
}

/// What is asked of the rays.
pub(super) trait Query {
    /// Any hit ends a ray.
    const ANY: bool;
    /// Where a ray ends, and the primitive that it cannot hit.
    fn end(&self, ray: usize) -> (f32, u32);
    /// Takes a ray's answer.
    fn finish(&mut self, ray: usize, t: f32, primitive: u32);
}

/// Answers `query` for each ray of the batch.
pub(super) fn trace<Q: Query>(
    tree: &Blocks,
    rays: &RayBatch<'_>,
    query: &mut Q,
    counters: &mut AccelCounters,
) {
    let mut lists: [Vec<u32>; OCTANTS] = std::array::from_fn(|_| Vec::with_capacity(rays.len));
    for at in 0..rays.len {
        let d = rays.direction.map(|column| column[at]);
        let o = rays.origin.map(|column| column[at]);
        let finite = o.iter().chain(&d).all(|x| x.is_finite());
        if finite && d != [0.0; 3] {
            let octant = (0..3).fold(0, |octant, k| octant | usize::from(d[k].is_sign_negative()) << k);
            lists[octant].push(at as u32);
        } else {
            query.finish(at, f32::INFINITY, PrimitiveId::NONE);
        }
    }
    let mut scratch = Scratch::new(tree.stack_bound);
    macro_rules! octants {
        ($($octant:literal)*) => {
            $(Pass::<$octant, Q> { tree, rays, query, counters, scratch: &mut scratch }.run(&lists[$octant]);)*
        };
    }
    octants!(0 1 2 3 4 5 6 7);
}

struct Scratch {
    flights: Vec<Flight>,
    stride: usize,
    stack_t: Vec<f32>,
    stack: Vec<u32>,
}

impl Scratch {
    fn new(bound: usize) -> Self {
        let stride = bound + 17;
        Self {
            flights: vec![bytemuck_zero(); IN_FLIGHT],
            stride,
            stack_t: vec![f32::NEG_INFINITY; stride * IN_FLIGHT + 32],
            stack: vec![DONE; stride * IN_FLIGHT + 32],
        }
    }
}

fn bytemuck_zero() -> Flight {
    Flight {
        reciprocal: [f32x16::splat(0.0); 3],
        shear: ShearRay::new([0.0; 3], [1.0; 3]),
        origin: [0.0; 3],
        t: 0.0,
        primitive: 0,
        skip: 0,
        target: 0,
        ray: 0,
        current: 0,
        top: 0,
    }
}

struct Lists {
    nodes: [u32; IN_FLIGHT + 16],
    leaves: [u32; IN_FLIGHT + 16],
    done: [u32; IN_FLIGHT + 16],
    node_count: usize,
    leaf_count: usize,
    done_count: usize,
}

impl Lists {
    #[inline(always)]
    fn distribute(&mut self, ids: &[u32], next: &[u32], count: usize) {
        use crate::math::lanes::{load_u32, compress_u32};
        for at in (0..count).step_by(LANES) {
            let valid = Mask::first(count - at);
            let (ids, next) = (load_u32(ids, at), load_u32(next, at));
            let done = next.eq(U32s::splat(DONE)) & valid;
            let nodes = next.lt(U32s::splat(LEAF)) & valid;
            let leaves = valid & !nodes & !done;
            compress_u32(&mut self.nodes, self.node_count, nodes, ids);
            self.node_count += nodes.count();
            compress_u32(&mut self.leaves, self.leaf_count, leaves, ids);
            self.leaf_count += leaves.count();
            compress_u32(&mut self.done, self.done_count, done, ids);
            self.done_count += done.count();
        }
    }
}

struct Pass<'a, 'b, const OCTANT: usize, Q> {
    tree: &'a Blocks,
    rays: &'a RayBatch<'b>,
    query: &'a mut Q,
    counters: &'a mut AccelCounters,
    scratch: &'a mut Scratch,
}

impl<const OCTANT: usize, Q: Query> Pass<'_, '_, OCTANT, Q> {
    fn run(mut self, order: &[u32]) {
        let mut lists = Lists { nodes: [0; IN_FLIGHT + 16], leaves: [0; IN_FLIGHT + 16], done: [0; IN_FLIGHT + 16], node_count: 0, leaf_count: 0, done_count: 0 };
        let mut waiting = order.iter();
        for slot in 0..IN_FLIGHT {
            lists.done[slot] = slot as u32;
        }
        lists.done_count = IN_FLIGHT.min(order.len());
        for slot in 0..lists.done_count {
            self.scratch.flights[slot].ray = u32::MAX;
        }
        let mut next = [DONE; IN_FLIGHT + 16];
        loop {
            let done = lists.done_count;
            lists.done_count = 0;
            let mut begun = 0;
            for i in 0..done {
                let slot = lists.done[i] as usize;
                let flight = &mut self.scratch.flights[slot];
                if flight.ray != u32::MAX {
                    self.query.finish(flight.ray as usize, flight.t, flight.primitive);
                    flight.ray = u32::MAX;
                }
                if let Some(&ray) = waiting.next() {
                    self.begin(slot, ray as usize);
                    self.scratch.flights[slot].current = self.tree.root;
                    next[begun] = self.tree.root;
                    lists.done[begun] = slot as u32;
                    begun += 1;
                }
            }
            let ids = lists.done;
            lists.distribute(&ids, &next, begun);
            let (nodes, leaves) = (lists.node_count, lists.leaf_count);
            if nodes + leaves + lists.done_count == 0 {
                break;
            }
            lists.node_count = 0;
            self.counters.nodes += nodes as u64;
            for i in 0..nodes {
                let slot = unsafe { *lists.nodes.get_unchecked(i) } as usize;
                let reference = self.visit_node(slot);
                self.tree.prefetch(reference);
                unsafe { self.scratch.flights.get_unchecked_mut(slot).current = reference; *next.get_unchecked_mut(i) = reference };
            }
            let ids = lists.nodes;
            lists.distribute(&ids, &next, nodes);
            let leaves = lists.leaf_count;
            lists.leaf_count = 0;
            for i in 0..leaves {
                let slot = unsafe { *lists.leaves.get_unchecked(i) } as usize;
                let reference = self.visit_leaf(slot);
                self.tree.prefetch(reference);
                unsafe { self.scratch.flights.get_unchecked_mut(slot).current = reference; *next.get_unchecked_mut(i) = reference };
            }
            let ids = lists.leaves;
            lists.distribute(&ids, &next, leaves);
        }
    }

    #[inline(always)]
    fn begin(&mut self, slot: usize, ray: usize) {
        let origin = self.rays.origin.map(|column| column[ray]);
        let direction = self.rays.direction.map(|column| column[ray]);
        let (t, target) = self.query.end(ray);
        let reciprocal = direction.map(|d| {
            let r = (1.0 / d).abs();
            let halves = [f32x8::splat(r), f32x8::splat(-r)];
            bytemuck::cast::<_, f32x16>(halves)
        });
        self.scratch.flights[slot] = Flight {
            reciprocal,
            shear: ShearRay::new(origin, direction),
            origin,
            t,
            primitive: PrimitiveId::NONE,
            skip: self.rays.skip[ray],
            target,
            ray: ray as u32,
            current: 0,
            top: (slot * self.scratch.stride + 1) as u32,
        };
    }

    #[inline(always)]
    fn visit_node(&mut self, slot: usize) -> u32 {
        let flight = unsafe { self.scratch.flights.get_unchecked_mut(slot) };
        let node = self.tree.node(flight.current);
        let minus_infinity = f32x16::splat(f32::NEG_INFINITY);
        let base: f32x16 = bytemuck::cast([f32x8::splat(0.0), f32x8::splat(-flight.t)]);
        let (mut up, mut down) = (base, minus_infinity);
        for axis in 0..3 {
            let t = (node.planes[axis] - f32x16::splat(flight.origin[axis])) * flight.reciprocal[axis];
            if OCTANT >> axis & 1 == 0 {
                up = t.fast_max(up);
            } else {
                down = t.fast_max(down);
            }
        }
        let both = if OCTANT == 0 {
            up
        } else {
            let [low, high]: [f32x8; 2] = bytemuck::cast(down);
            up.fast_max(bytemuck::cast([high, low]))
        };
        let [near, minus_far]: [f32x8; 2] = bytemuck::cast(both);
        let inside = minus_far.mul_add(f32x8::splat(FAR_PADDING), near);
        let mask = inside.simd_le(f32x8::splat(0.0)).to_bitmask();
        let order = &ORDER[OCTANT][(mask & 255) as usize];
        let near = permute(near, order);
        let children: f32x8 = permute(bytemuck::cast(node.children), order);
        let top = flight.top as usize;
        unsafe {
            let below = *self.scratch.stack.get_unchecked(top - 1);
            *self.scratch.stack_t.as_mut_ptr().add(top).cast::<[f32; 8]>() = near.to_array();
            *self.scratch.stack.as_mut_ptr().add(top).cast::<[f32; 8]>() = children.to_array();
            flight.top = (top + mask.count_ones() as usize - 1) as u32;
            let nearest = bytemuck::cast::<_, [u32; 8]>(children)[7];
            if mask == 0 { below } else { nearest }
        }
    }

    #[inline(always)]
    fn visit_leaf(&mut self, slot: usize) -> u32 {
        let flight = unsafe { self.scratch.flights.get_unchecked_mut(slot) };
        let leaf = self.tree.leaf(flight.current);
        let valid = Mask::first(leaf.count);
        self.counters.tests += leaf.count as u64;
        let (hits, t) = flight.shear.intersect_rows(|axis, corner| leaf.row(axis, corner, valid), valid);
        if hits.any() {
            let ids = leaf.ids(valid);
            let hits = hits & !Compare::eq(ids, U32s::splat(flight.skip));
            if Q::ANY {
                let hits = hits & t.lt(F32s::splat(flight.t)) & !Compare::eq(ids, U32s::splat(flight.target));
                if hits.any() {
                    flight.primitive = 0;
                    return DONE;
                }
            } else {
                let hits = hits & t.le(F32s::splat(flight.t));
                if hits.any() {
                    let (t, ids) = (t.to_array(), ids.to_array());
                    for lane in hits.lanes() {
                        if t[lane] < flight.t || (t[lane] == flight.t && ids[lane] < flight.primitive) {
                            flight.t = t[lane];
                            flight.primitive = ids[lane];
                        }
                    }
                    let base = slot * self.scratch.stride;
                    flight.top = (base + filter(
                        &mut self.scratch.stack_t[base..],
                        &mut self.scratch.stack[base..],
                        flight.top as usize - base,
                        flight.t * FAR_PADDING,
                    )) as u32;
                }
            }
        }
        flight.top -= 1;
        unsafe { *self.scratch.stack.get_unchecked(flight.top as usize) }
    }
}

/// Keeps the entries that are no farther than `limit`; their number.
#[inline(always)]
fn filter(t: &mut [f32], refs: &mut [u32], size: usize, limit: f32) -> usize {
    use crate::math::lanes::{compress, compress_u32, load, load_u32};
    let mut kept = 0;
    for at in (0..size).step_by(LANES) {
        let (ts, rs) = (load(t, at), load_u32(refs, at));
        let keep = ts.le(F32s::splat(limit)) & Mask::first(size - at);
        compress(t, kept, keep, ts);
        compress_u32(refs, kept, keep, rs);
        kept += keep.count();
    }
    kept
}

#[inline(always)]
fn permute(v: f32x8, order: &[u8; 8]) -> f32x8 {
    #[cfg(target_feature = "avx2")]
    #[allow(unsafe_code, reason = "no safe form")]
    // SAFETY: registers only; the build has AVX2.
    unsafe {
        use std::arch::x86_64::*;
        let index = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(i64::from_le_bytes(*order)));
        return _mm256_permutevar8x32_ps(v.into(), index).into();
    }
    #[allow(unreachable_code, reason = "other machines")]
    {
        let v = v.to_array();
        f32x8::from(order.map(|slot| v[slot as usize & 7]))
    }
}
