//! Traversal of the 8-wide tree by a queue of rays. The rays of an octant of directions share one loop,
//! compiled for their signs. A few dozen of them are in flight at once, each advanced by one node or one
//! leaf at a time, so that the latencies of one ray pass while others are computed. No store in these
//! loops has an address that depends on the outcome of an earlier step: the processor would hold back
//! every later load until it knew it.

use std::cell::RefCell;
use std::ops::Range;

use wide::{f32x8, f32x16};

use super::blocks::{Blocks, DONE, LEAF};
use super::collapse::WIDTH;
use super::octant::{NEAREST, OCTANTS, ORDER, permute};
use super::packet::{self, GROUP, Group, Rays, each, lanes_of, rays_of};
use super::{AccelCounters, RayBatch};
use crate::geometry::PrimitiveId;
use crate::geometry::slab::{FAR_PADDING, keep_max16};
use crate::geometry::sphere::sphere_distance;
use crate::geometry::triangle::ShearRay;
use crate::math::lanes::{
    Compare, F32s, LANES, Mask, U32s, compress, compress_u32, gather, gather_u32, iota, load,
    load_u32, padded, store_u32, to_bits,
};
use crate::math::vec3::Vec3s;

/// Rays that take turns. Measured on the bunny's bounces: 16 are 15 % slower, 32 are 6 %, 128 the same.
const IN_FLIGHT: usize = 64;

/// When groups of rays descend together before they go on alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Packets {
    /// Where their directions are close.
    Coherent,
    /// Wherever they can.
    Always,
}

/// What is asked of rays.
pub(super) trait Query {
    /// Any hit ends a ray.
    const ANY: bool;

    /// Per lane where the ray ends, and the primitive that does not count.
    fn ends(&self, ray: U32s) -> (F32s, U32s);

    /// Takes a ray's answer: the closest hit, or any primitive where [`Self::ANY`].
    fn finish(&mut self, ray: usize, t: f32, primitive: u32);

    /// As [`Self::finish`], for [`LANES`] rays from `first` on.
    fn finish_row(&mut self, first: usize, t: F32s, primitive: U32s);
}

/// Answers `query` for each ray of the batch.
pub(super) fn trace<Q: Query>(
    tree: &Blocks,
    packets: Packets,
    rays: &RayBatch<'_>,
    query: &mut Q,
    counters: &mut AccelCounters,
) {
    if tree.root == DONE {
        (0..rays.len).for_each(|ray| query.finish(ray, f32::INFINITY, PrimitiveId::NONE));
        return;
    }
    SCRATCH.with_borrow_mut(|scratch| {
        let octants = scratch.prepare(tree, rays, query);
        macro_rules! trace_octants {
            ($spheres:literal: $($octant:literal)*) => {
                $(Traversal::<$octant, $spheres, Q> { tree, packets, rays, query, counters, scratch,
                    lists: Lists { nodes: List::EMPTY, leaves: List::EMPTY, done: List::EMPTY },
                    free: std::array::from_fn(|slot| slot as u32), free_len: IN_FLIGHT,
                    alone: 0, descended: 0 }
                    .run(octants[$octant]..octants[$octant + 1]);)*
            };
        }
        if tree.has_spheres {
            trace_octants!(true: 0 1 2 3 4 5 6 7);
        } else {
            trace_octants!(false: 0 1 2 3 4 5 6 7);
        }
    });
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

/// A ray in flight.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
struct Flight {
    /// |1/d| for lower planes and −|1/d| for upper ones, per axis.
    reciprocal: [f32x16; 3],
    shear: ShearRay,
    /// Closest hit so far, or the end of the ray.
    t: f32,
    primitive: u32,
    skip: u32,
    target: u32,
    ray: u32,
    /// Node or leaf to visit next.
    current: u32,
    /// Place in the stacks after the last entry.
    top: u32,
}

/// Memory of a worker.
#[derive(Debug, Default)]
struct Scratch {
    flights: Vec<Flight>,
    /// Per flight, one after the other: entry distances and references put aside, [`DONE`] first.
    stack_t: Vec<f32>,
    stack: Vec<u32>,
    /// Entries of a flight's part of the stacks.
    stride: usize,
    /// Octants of the rays, [`OCTANTS`] for those that hit nothing.
    octant: Vec<u32>,
    /// Rays by octant.
    order: Vec<u32>,
    packet: packet::Scratch,
    group: Group,
}

impl Scratch {
    /// Makes room, sorts the rays by octant and finishes those that hit nothing; where each octant begins.
    fn prepare<Q: Query>(
        &mut self,
        tree: &Blocks,
        rays: &RayBatch<'_>,
        query: &mut Q,
    ) -> [usize; OCTANTS + 1] {
        let stride = tree.stack_bound + packet::MOST_PENDING + LANES;
        if self.stride < stride {
            self.stride = stride;
            self.stack_t.resize(stride * IN_FLIGHT, 0.0);
            self.stack.resize(stride * IN_FLIGHT, DONE);
        }
        self.flights.resize(IN_FLIGHT, Flight::NONE);
        self.packet.reserve(tree.stack_bound);
        let room = padded(rays.len) + LANES;
        if self.order.len() < room {
            self.order.resize(room, 0);
            self.octant.resize(room, 0);
        }
        let mut present = 0;
        for at in (0..rays.len).step_by(LANES) {
            let octant = octant_of(rays, at);
            store_u32(&mut self.octant, at, octant);
            // The rays of a chunk mostly share an octant.
            let first = octant.as_array()[0];
            let valid = Mask::first(rays.len - at);
            present |= if (valid & !octant.eq(U32s::splat(first))).none() {
                1 << first
            } else {
                u32::MAX
            };
        }
        let mut starts = [0; OCTANTS + 1];
        let mut count = 0;
        for (octant, start) in starts.iter_mut().enumerate() {
            *start = count;
            if present >> octant & 1 == 0 {
                continue;
            }
            for at in (0..rays.len).step_by(LANES) {
                let here = load_u32(&self.octant, at).eq(U32s::splat(octant as u32))
                    & Mask::first(rays.len - at);
                let ray = iota() + U32s::splat(at as u32);
                compress_u32(&mut self.order, count, here, ray);
                count += here.count();
            }
        }
        for &ray in &self.order[starts[OCTANTS]..count] {
            query.finish(ray as usize, f32::INFINITY, PrimitiveId::NONE);
        }
        starts
    }
}

/// The first of these rays, if they follow one another. They are in order.
#[inline(always)]
fn row(ray: U32s) -> Option<usize> {
    let [first, last] = [0, LANES - 1].map(|lane| ray.as_array()[lane] as usize);
    (last == first + LANES - 1).then_some(first)
}

/// The octant of each direction, or [`OCTANTS`] for rays with NaN or infinity, or without direction.
#[inline(always)]
fn octant_of(rays: &RayBatch<'_>, at: usize) -> U32s {
    let direction = rays.direction.map(|column| load(column, at));
    let origin = rays.origin.map(|column| load(column, at));
    let most = F32s::splat(f32::MAX);
    let finite = |v: [F32s; 3]| v[0].abs().le(most) & v[1].abs().le(most) & v[2].abs().le(most);
    let zero = F32s::splat(0.0);
    let moves = direction[0].ne(zero) | direction[1].ne(zero) | direction[2].ne(zero);
    let sound = finite(origin) & finite(direction) & moves;
    let sign = |k: usize| (to_bits(direction[k]) >> 31) << k as u32;
    sound.select_u32(sign(0) | sign(1) | sign(2), U32s::splat(OCTANTS as u32))
}

impl Flight {
    const NONE: Self = Self {
        reciprocal: [f32x16::ZERO; 3],
        shear: ShearRay::NONE,
        t: 0.0,
        primitive: PrimitiveId::NONE,
        skip: PrimitiveId::NONE,
        target: PrimitiveId::NONE,
        ray: 0,
        current: DONE,
        top: 0,
    };

    /// The flight of a ray of the group, at no place yet.
    #[inline(always)]
    fn new(group: &Group, ray: usize) -> Self {
        let at =
            |columns: &[packet::Column; 3]| columns.each_ref().map(|column| group.at(column, ray));
        let largest = group.at_u32(&group.largest, ray) as usize;
        Self {
            reciprocal: at(&group.reciprocal)
                .map(|r| bytemuck::cast([f32x8::splat(r), f32x8::splat(-r)])),
            shear: ShearRay::from_parts(at(&group.origin), largest, at(&group.shear)),
            t: group.at(&group.t, ray),
            primitive: group.at_u32(&group.primitive, ray),
            skip: group.at_u32(&group.skip, ray),
            target: group.at_u32(&group.target, ray),
            ray: group.at_u32(&group.ray, ray),
            ..Self::NONE
        }
    }
}

/// Flights by what they do next.
struct Lists {
    nodes: List,
    leaves: List,
    /// Flights whose rays have their answers.
    done: List,
}

/// Numbers of flights, with room for one more vector of lanes.
struct List {
    flights: [u32; IN_FLIGHT + LANES],
    len: usize,
}

impl List {
    const EMPTY: Self = Self {
        flights: [0; IN_FLIGHT + LANES],
        len: 0,
    };

    #[inline(always)]
    fn append(&mut self, mask: Mask, flights: U32s) {
        compress_u32(&mut self.flights, self.len, mask, flights);
        self.len += mask.count();
    }

    /// Takes all that is in it.
    #[inline(always)]
    fn take(&mut self) -> ([u32; IN_FLIGHT + LANES], usize) {
        (self.flights, std::mem::take(&mut self.len))
    }
}

impl Lists {
    /// Appends the first `count` of `flights` by the references that they go to `next`.
    #[inline(always)]
    fn distribute(&mut self, flights: &[u32], next: &[u32], count: usize) {
        for at in (0..count).step_by(LANES) {
            let valid = Mask::first(count - at);
            let (flights, next) = (load_u32(flights, at), load_u32(next, at));
            let node = next.lt(U32s::splat(LEAF)) & valid;
            let done = next.eq(U32s::splat(DONE)) & valid;
            self.nodes.append(node, flights);
            self.done.append(done, flights);
            self.leaves.append(valid & !node & !done, flights);
        }
    }
}

/// Traversal by the rays of one octant.
struct Traversal<'a, 'b, const OCTANT: usize, const SPHERES: bool, Q> {
    tree: &'a Blocks,
    packets: Packets,
    rays: &'a RayBatch<'b>,
    query: &'a mut Q,
    counters: &'a mut AccelCounters,
    scratch: &'a mut Scratch,
    lists: Lists,
    /// Flights without a ray.
    free: [u32; IN_FLIGHT],
    free_len: usize,
    /// Rays of the group at hand that have yet to take off.
    alone: Rays,
    /// Rays of the group at hand that have descended together.
    descended: Rays,
}

impl<const OCTANT: usize, const SPHERES: bool, Q: Query> Traversal<'_, '_, OCTANT, SPHERES, Q> {
    /// Traces the rays at these places of the order.
    fn run(mut self, mut waiting: Range<usize>) {
        // Where the flights of the list at hand go.
        let mut next = [DONE; IN_FLIGHT + LANES];
        loop {
            loop {
                if self.alone == 0 {
                    if waiting.is_empty() {
                        break;
                    }
                    let group = waiting.start..waiting.end.min(waiting.start + GROUP);
                    waiting.start = group.end;
                    self.begin(group);
                } else if self.free_len >= LANES.min(self.alone.count_ones() as usize) {
                    self.take_off();
                } else {
                    break;
                }
            }
            if self.free_len == IN_FLIGHT {
                break;
            }
            let (nodes, count) = self.lists.nodes.take();
            self.counters.nodes += count as u64;
            for (&slot, next) in nodes[..count].iter().zip(&mut next) {
                *next = self.visit_node(slot as usize);
                self.tree.prefetch(*next);
            }
            self.lists.distribute(&nodes, &next, count);
            let (leaves, count) = self.lists.leaves.take();
            for (&slot, next) in leaves[..count].iter().zip(&mut next) {
                *next = self.visit_leaf(slot as usize);
                self.tree.prefetch(*next);
            }
            self.lists.distribute(&leaves, &next, count);
            let (done, count) = self.lists.done.take();
            for &slot in &done[..count] {
                let flight = &self.scratch.flights[slot as usize];
                self.query
                    .finish(flight.ray as usize, flight.t, flight.primitive);
                self.free[self.free_len] = slot;
                self.free_len += 1;
            }
        }
    }

    /// Takes up the rays at these places of the order, at most [`GROUP`]: those that can descend together
    /// do; what remains is to take off.
    #[inline(always)]
    fn begin(&mut self, places: Range<usize>) {
        let all = Rays::MAX >> (GROUP - places.len());
        for (vector, at) in places.clone().step_by(LANES).enumerate() {
            self.load(vector, at, places.end - at);
        }
        self.alone = all;
        self.descended = 0;
        if !self.descend(all) {
            for vector in 0..GROUP / LANES {
                self.descend(all & rays_of(vector));
            }
        }
        let Scratch { group, packet, .. } = &*self.scratch;
        for ray in each(self.descended) {
            if packet.pending[ray].len == 0 {
                self.alone &= !(1 << ray);
            }
        }
        for vector in 0..GROUP / LANES {
            let lanes = lanes_of(all & !self.alone, vector);
            let (ray, t, primitive) = (group.ray[vector], group.t[vector], group.primitive[vector]);
            match row(ray) {
                Some(first) if lanes == Mask::ALL => self.query.finish_row(first, t, primitive),
                _ => {
                    let (ray, t, primitive) = (ray.to_array(), t.to_array(), primitive.to_array());
                    for lane in lanes.lanes() {
                        self.query
                            .finish(ray[lane] as usize, t[lane], primitive[lane]);
                    }
                }
            }
        }
    }

    /// Loads `count` rays from a place of the order on into a vector of the group.
    #[inline(always)]
    fn load(&mut self, vector: usize, at: usize, count: usize) {
        let ray = load_u32(&self.scratch.order, at);
        let len = self.rays.len;
        let row = row(ray).filter(|_| count >= LANES);
        let gather3 = |columns: [&[f32]; 3]| match row {
            Some(first) => columns.map(|column| load(column, first)),
            None => columns.map(|column| gather(&column[..len], ray)),
        };
        let rays = [gather3(self.rays.origin), gather3(self.rays.direction)];
        let skip = gather_u32(&self.rays.skip[..len], ray);
        self.scratch
            .group
            .set(vector, ray, rays, skip, self.query.ends(ray));
    }

    /// Lets these rays descend together if they can; whether they did.
    #[inline(never)]
    fn descend(&mut self, rays: Rays) -> bool {
        let group = &mut self.scratch.group;
        let Some(axis) = group.common_axis(rays) else {
            return false;
        };
        let together = group.is_coherent(rays)
            || self.packets == Packets::Always && rays.count_ones() as usize <= LANES;
        if together {
            packet::descend::<OCTANT, SPHERES, Q>(
                self.tree,
                group,
                axis,
                rays,
                &mut self.scratch.packet,
                self.counters,
            );
            self.descended |= rays;
        }
        together
    }

    /// Puts rays of the group in flight while there is room, at the root or at what the group has left to
    /// each.
    #[inline(never)]
    fn take_off(&mut self) {
        for place in each(self.alone) {
            if self.free_len == 0 {
                break;
            }
            self.alone &= !(1 << place);
            let scratch = &mut *self.scratch;
            let flight = Flight::new(&scratch.group, place);
            let slot = self.free[self.free_len - 1] as usize;
            let base = slot * scratch.stride;
            scratch.stack[base] = DONE;
            scratch.stack_t[base] = f32::NEG_INFINITY;
            let mut top = base + 1;
            let current = if self.descended >> place & 1 != 0 {
                // The last that the group came to is the first to be put aside.
                let pending = &scratch.packet.pending[place];
                for at in (0..pending.len).rev() {
                    scratch.stack_t[top] = pending.t[at];
                    scratch.stack[top] = pending.reference[at];
                    top += usize::from(pending.t[at] <= flight.t * FAR_PADDING);
                }
                top -= 1;
                scratch.stack[top]
            } else {
                self.tree.root
            };
            if current == DONE {
                self.query
                    .finish(flight.ray as usize, flight.t, flight.primitive);
                continue;
            }
            scratch.flights[slot] = Flight {
                current,
                top: top as u32,
                ..flight
            };
            self.tree.prefetch(current);
            self.free_len -= 1;
            let list = if current & LEAF == 0 {
                &mut self.lists.nodes
            } else {
                &mut self.lists.leaves
            };
            list.flights[list.len] = slot as u32;
            list.len += 1;
        }
    }

    /// Visits the node at which a flight is, and gives where it goes.
    #[inline(always)]
    fn visit_node(&mut self, slot: usize) -> u32 {
        let flight = &mut self.scratch.flights[slot];
        let node = self.tree.node(flight.current);
        let limits = bytemuck::cast([f32x8::splat(0.0), f32x8::splat(-flight.t)]);
        let origin = flight.shear.origin();
        let (mask, near) = entered::<OCTANT>(limits, |axis| {
            (node.planes[axis] - f32x16::splat(origin[axis])) * flight.reciprocal[axis]
        });
        let order = &ORDER[OCTANT][mask as usize];
        let near = permute(near, order);
        let children = permute(bytemuck::cast(node.children), order);
        let children: [u32; WIDTH] = bytemuck::cast(children);
        let top = flight.top as usize;
        let below = self.scratch.stack[top - 1];
        let put = |stack: &mut [u32], values: [u32; WIDTH]| {
            stack[top..top + WIDTH].copy_from_slice(&values);
        };
        put(
            bytemuck::cast_slice_mut(&mut self.scratch.stack_t),
            bytemuck::cast(near),
        );
        put(&mut self.scratch.stack, children);
        // The nearest child, or what was put aside last, is taken at once.
        flight.top = (top + mask.count_ones() as usize - 1) as u32;
        let next = if mask == 0 { below } else { children[NEAREST] };
        flight.current = next;
        next
    }

    /// Visits the leaf at which a flight is, and gives where it goes.
    #[inline(always)]
    fn visit_leaf(&mut self, slot: usize) -> u32 {
        let flight = &mut self.scratch.flights[slot];
        let leaf = self.tree.leaf(flight.current);
        self.counters.tests += (leaf.triangles + leaf.spheres) as u64;
        let mut closer = false;
        if !SPHERES || leaf.triangles > 0 {
            let valid = Mask::first(leaf.triangles);
            let (hits, t) = flight
                .shear
                .intersect_rows(|axis, corner| leaf.row(axis, corner, valid), valid);
            if hits.any() {
                let ids = leaf.ids(valid);
                let hits = hits & !ids.eq(U32s::splat(flight.skip));
                closer |= flight.take::<Q>(hits, t, ids);
            }
        }
        if SPHERES && leaf.spheres > 0 {
            let ([x, y, z, radius], ids, valid) = leaf.spheres();
            let leaving = ids.eq(U32s::splat(flight.skip));
            let origin = Vec3s::splat(flight.shear.origin());
            let direction = Vec3s::splat(self.rays.direction.map(|d| d[flight.ray as usize]));
            let t = sphere_distance(Vec3s::new(x, y, z), radius, origin, direction, leaving);
            let hits = t.lt(F32s::splat(f32::INFINITY)) & valid;
            closer |= flight.take::<Q>(hits, t, ids);
        }
        let mut top = flight.top as usize;
        if closer {
            if Q::ANY {
                flight.current = DONE;
                return DONE;
            }
            let base = slot * self.scratch.stride;
            let part = base..base + self.scratch.stride;
            let limit = flight.t * FAR_PADDING;
            let t = &mut self.scratch.stack_t[part.clone()];
            top = base + keep_near(t, &mut self.scratch.stack[part], top - base, limit);
        }
        flight.top = top as u32 - 1;
        flight.current = self.scratch.stack[top - 1];
        flight.current
    }
}

impl Flight {
    /// Takes hits where they count; whether one did.
    #[inline(always)]
    fn take<Q: Query>(&mut self, hits: Mask, t: F32s, ids: U32s) -> bool {
        let end = F32s::splat(self.t);
        if Q::ANY {
            let hits = hits & t.lt(end) & !ids.eq(U32s::splat(self.target));
            if let Some(lane) = hits.lanes().next() {
                self.primitive = ids.as_array()[lane];
            }
            return hits.any();
        }
        let hits = hits & t.le(end);
        let (t, ids) = (t.as_array(), ids.as_array());
        for lane in hits.lanes() {
            if t[lane] < self.t || (t[lane] == self.t && ids[lane] < self.primitive) {
                (self.t, self.primitive) = (t[lane], ids[lane]);
            }
        }
        hits.any()
    }
}

/// Which of eight children are entered, and where. `t(axis)` are distances of the lower planes, then
/// those of the upper planes, the ones of far planes negated; `limits` the least of the near ones, then
/// minus the most of the far ones. The roundings are those of [`crate::geometry::slab::SlabRay`].
#[inline(always)]
pub(super) fn entered<const OCTANT: usize>(
    limits: f32x16,
    t: impl Fn(usize) -> f32x16,
) -> (u32, f32x8) {
    // Along axes that the ray descends, near planes are the upper ones. NaN (0·∞) drops out.
    let mut up = limits;
    let mut down = f32x16::splat(f32::NEG_INFINITY);
    for axis in 0..3 {
        if OCTANT >> axis & 1 == 0 {
            up = keep_max16(t(axis), up);
        } else {
            down = keep_max16(t(axis), down);
        }
    }
    if OCTANT != 0 {
        let [low, high]: [f32x8; 2] = bytemuck::cast(down);
        up = up.fast_max(bytemuck::cast([high, low]));
    }
    let [near, minus_far]: [f32x8; 2] = bytemuck::cast(up);
    let gap = minus_far.mul_add(f32x8::splat(FAR_PADDING), near);
    (gap.simd_le(f32x8::splat(0.0)).to_bitmask() & 0xff, near)
}

/// Keeps the entries of a stack that are no farther than `limit`, in order; their number.
#[inline(always)]
fn keep_near(t: &mut [f32], references: &mut [u32], len: usize, limit: f32) -> usize {
    let mut kept = 0;
    for at in (0..len).step_by(LANES) {
        let (near, reference) = (load(t, at), load_u32(references, at));
        let keep = near.le(F32s::splat(limit)) & Mask::first(len - at);
        compress(t, kept, keep, near);
        compress_u32(references, kept, keep, reference);
        kept += keep.count();
    }
    kept
}
