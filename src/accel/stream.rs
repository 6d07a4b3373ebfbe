//! Traversal of the 8-wide tree by a queue of rays. A few dozen rays are in flight at once, each advanced by one node
//! or one leaf at a time, so that the latencies of one ray pass while others are computed. No store in these loops has
//! an address that depends on the outcome of an earlier step: the processor would hold back every later load until it
//! knew it.

use std::cell::RefCell;
use std::ops::Range;

use wide::f32x8;

use super::blocks::{Blocks, DONE, LEAF, LEAF_SIZE, Words};
use super::collapse::WIDTH;
use super::flight::{Flight, Halves, Row};
use super::octant::{OCTANTS, ORDER, permute};
use super::order::{ALIKE_MOST, Order, Starts};
use super::packet::{self, GROUP, Group, Rays, descend, lanes_of, rays_of};
use super::{AccelCounters, RayBatch};
use crate::geometry::PrimitiveId;
use crate::geometry::slab::FAR_PADDING;
use crate::geometry::sphere::sphere_distance;
use crate::geometry::triangle::shear_lanes;
use crate::math::lanes::{
    Compare, F32s, FloatLanes, LANES, Mask, U32s, compress, compress_u32, gather, gather_u32, iota,
    load, load_u32, store_u32,
};
use crate::math::vec3::Vec3s;

/// Rays that take turns. Measured on the bunny's bounces: 16 are 15 % slower, 32 are 6 %, 128 the same.
const IN_FLIGHT: usize = 64;

/// In place of a reference: the flight stays at its leaf. No leaf begins at the last unit of all.
const MAY_HIT: u32 = u32::MAX;

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

    /// Per lane where the ray ends.
    fn ends(&self, ray: U32s) -> F32s;

    /// Per lane the primitive that does not count.
    fn targets(&self, ray: U32s) -> U32s;

    /// The primitive that does not count for a ray.
    fn target(&self, ray: usize) -> u32;

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
        scratch.reserve(tree);
        let alike = Q::ANY && tree.primitives <= ALIKE_MOST;
        let octants = scratch.order.arrange(rays, packets, alike);
        if tree.has_spheres {
            Traversal::<true, Q>::new(tree, packets, rays, query, counters, scratch).run(octants);
        } else {
            Traversal::<false, Q>::new(tree, packets, rays, query, counters, scratch).run(octants);
        }
    });
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

/// Bytes from a flight to the next. A flight's place is told in bytes from the first on.
const FLIGHT: u32 = size_of::<Flight>() as u32;

/// Number of the flight at a place.
#[inline(always)]
fn slot_of(place: u32) -> usize {
    (place / FLIGHT) as usize % IN_FLIGHT
}

/// Memory of a worker.
#[derive(Debug)]
struct Scratch {
    flights: [Flight; IN_FLIGHT],
    /// Per flight, one after the other: entry distances, with signs turned over, and references put aside. The first
    /// stay [`DONE`].
    stack_t: Vec<f32>,
    stack: Vec<u32>,
    /// Entries of a flight's part of the stacks.
    stride: usize,
    order: Order,
    packet: packet::Scratch,
    group: Group,
    /// Rays of the group as flights at no place yet.
    ready: [Flight; GROUP],
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            flights: [bytemuck::Zeroable::zeroed(); IN_FLIGHT],
            stack_t: Vec::new(),
            stack: Vec::new(),
            stride: 0,
            order: Order::default(),
            packet: packet::Scratch::default(),
            group: Group::default(),
            ready: [bytemuck::Zeroable::zeroed(); GROUP],
        }
    }
}

impl Scratch {
    /// Makes room for flights through a tree.
    fn reserve(&mut self, tree: &Blocks) {
        let stride = tree.stack_bound + packet::MOST_PENDING + LANES;
        if self.stride < stride {
            self.stride = stride;
            self.stack_t = vec![f32::INFINITY; stride * IN_FLIGHT];
            self.stack = vec![DONE; stride * IN_FLIGHT];
        }
        self.packet.reserve(tree.stack_bound);
    }

    #[inline(always)]
    fn flights(&mut self) -> Flights<'_> {
        Flights {
            flights: &mut self.flights,
            stack_t: &mut self.stack_t,
            stack: &mut self.stack,
            stride: self.stride,
        }
    }
}

/// The first of these rays, if they follow one another. They are in order.
#[inline(always)]
fn row(ray: U32s) -> Option<usize> {
    let [first, last] = [0, LANES - 1].map(|lane| ray.as_array()[lane] as usize);
    (last == first + LANES - 1).then_some(first)
}

/// Flights that do the same next, with room for one more vector of lanes.
#[derive(Clone, Copy)]
struct List {
    /// Places of the flights.
    flights: [u32; IN_FLIGHT + LANES],
    /// Nodes or leaves at which they are.
    current: [u32; IN_FLIGHT + LANES],
    len: usize,
}

impl List {
    const EMPTY: Self = Self {
        flights: [0; IN_FLIGHT + LANES],
        current: [0; IN_FLIGHT + LANES],
        len: 0,
    };

    #[inline(always)]
    fn push(&mut self, flight: u32, current: u32) {
        self.flights[self.len] = flight;
        self.current[self.len] = current;
        self.len += 1;
    }

    #[inline(always)]
    fn append(&mut self, mask: Mask, flights: U32s, current: U32s) {
        compress_u32(&mut self.flights, self.len, mask, flights);
        compress_u32(&mut self.current, self.len, mask, current);
        self.len += mask.count();
    }

    /// Flights and where they are, with room for where each goes.
    #[inline(always)]
    fn each<'a>(&'a self, next: &'a mut Next) -> impl Iterator<Item = (u32, u32, &'a mut u32)> {
        let flights = &self.flights[..self.len.min(IN_FLIGHT)];
        let current = flights.iter().zip(&self.current);
        let each = current.zip(next);
        each.map(|((&flight, &current), next)| (flight, current, next))
    }
}

/// Where the flights of a list go.
type Next = [u32; IN_FLIGHT + LANES];

/// Flights by what they do next.
struct Lists([List; 4]);

const NODES: usize = 0;
const LEAVES: usize = 1;
/// Flights at leaves in which they may hit something.
const HITS: usize = 2;
/// Flights whose rays have their answers.
const ENDED: usize = 3;

/// The list of flights at a node or leaf.
#[inline(always)]
fn list_of(reference: u32) -> usize {
    if reference & LEAF == 0 { NODES } else { LEAVES }
}

impl Lists {
    /// Moves the flights of a list to where they go.
    #[inline(always)]
    fn distribute<const FROM: usize>(&mut self, next: &Next) {
        let count = std::mem::take(&mut self.0[FROM].len);
        for at in (0..count).step_by(LANES) {
            let valid = Mask::first(count - at);
            let flights = load_u32(&self.0[FROM].flights, at);
            let current = load_u32(&self.0[FROM].current, at);
            let next = load_u32(next, at);
            let node = (next & U32s::splat(LEAF)).eq(U32s::splat(0)) & valid;
            let ended = next.eq(U32s::splat(DONE)) & valid;
            let mut leaf = valid & !(node | ended);
            // What is written of this list itself has been read.
            if FROM == LEAVES {
                let hit = next.eq(U32s::splat(MAY_HIT)) & valid;
                self.0[HITS].append(hit, flights, current);
                leaf = leaf & !hit;
            }
            self.0[NODES].append(node, flights, next);
            self.0[LEAVES].append(leaf, flights, next);
            self.0[ENDED].append(ended, flights, next);
        }
    }
}

/// Traversal by a batch of rays.
struct Traversal<'a, 'b, const SPHERES: bool, Q> {
    tree: &'a Blocks,
    packets: Packets,
    rays: &'a RayBatch<'b>,
    query: &'a mut Q,
    counters: &'a mut AccelCounters,
    scratch: &'a mut Scratch,
    lists: Lists,
    /// Places of flights without a ray, and room for a vector more.
    free: [u32; IN_FLIGHT + LANES],
    free_len: usize,
    /// Octant of the rays of the group at hand.
    octant: usize,
    /// Rays of the group at hand that have yet to take off.
    alone: Rays,
    /// Rays of the group at hand that have descended together.
    descended: Rays,
    /// Vectors of the group that are [`Scratch::ready`], or that nothing is left of.
    ready: usize,
}

impl<'a, 'b, const SPHERES: bool, Q: Query> Traversal<'a, 'b, SPHERES, Q> {
    fn new(
        tree: &'a Blocks,
        packets: Packets,
        rays: &'a RayBatch<'b>,
        query: &'a mut Q,
        counters: &'a mut AccelCounters,
        scratch: &'a mut Scratch,
    ) -> Self {
        Self {
            tree,
            packets,
            rays,
            query,
            counters,
            scratch,
            lists: Lists([List::EMPTY; 4]),
            free: std::array::from_fn(|slot| slot as u32 % IN_FLIGHT as u32 * FLIGHT),
            free_len: IN_FLIGHT,
            octant: 0,
            alone: 0,
            descended: 0,
            ready: 0,
        }
    }

    /// Traces the rays of the order.
    fn run(mut self, octants: Starts) {
        let mut next = [DONE; IN_FLIGHT + LANES];
        let mut waiting = 0;
        loop {
            self.take_up(&octants, &mut waiting);
            if self.octant == OCTANTS {
                while waiting < self.rays.len && self.free_len >= LANES {
                    if octants[OCTANTS] == 0 {
                        self.take_off_at(waiting);
                    } else {
                        self.take_off_ordered(waiting);
                    }
                    waiting += LANES;
                }
            }
            if self.free_len == IN_FLIGHT {
                break;
            }
            self.advance(&mut next);
        }
    }

    /// Takes up rays of the order from `waiting` on while there is room in flight.
    #[inline(always)]
    fn take_up(&mut self, octants: &Starts, waiting: &mut usize) {
        loop {
            if self.alone == 0 {
                while self.octant < OCTANTS && *waiting >= octants[self.octant + 1] {
                    self.octant += 1;
                }
                if self.octant == OCTANTS {
                    break;
                }
                let group = *waiting..octants[self.octant + 1].min(*waiting + GROUP);
                *waiting = group.end;
                self.begin(group);
            } else if self.free_len >= LANES.min(self.alone.count_ones() as usize) {
                self.take_off();
            } else {
                break;
            }
        }
    }

    /// Lets each flight do its next steps.
    #[inline(always)]
    fn advance(&mut self, next: &mut Next) {
        let (tree, rays) = (self.tree, self.rays);
        let words = tree.words();
        let mut all = self.scratch.flights();
        let list = &self.lists.0[NODES];
        self.counters.nodes += list.len as u64;
        for (flight, current, next) in list.each(next) {
            *next = all.visit_node::<Q>(words, flight, current);
            words.prefetch(*next);
        }
        self.lists.distribute::<NODES>(next);
        let mut tests = 0;
        for (flight, current, next) in self.lists.0[LEAVES].each(next) {
            *next = all.pass_leaf::<SPHERES>(words, flight, current, &mut tests);
        }
        self.counters.tests += tests;
        self.lists.distribute::<LEAVES>(next);
        for (flight, current, next) in self.lists.0[HITS].each(next) {
            *next = all.visit_leaf::<SPHERES, Q>(tree, rays, self.query, flight, current);
            words.prefetch(*next);
        }
        self.lists.distribute::<HITS>(next);
        let ended = &mut self.lists.0[ENDED];
        let places = &ended.flights[..ended.len.min(IN_FLIGHT)];
        for at in (0..places.len()).step_by(LANES) {
            let row = load_u32(&ended.flights, at);
            store_u32(&mut self.free, self.free_len + at, row);
        }
        self.free_len += places.len();
        for &place in places {
            let flight = &all.flights[slot_of(place)];
            self.query
                .finish(flight.ray as usize, flight.t, flight.primitive);
        }
        ended.len = 0;
    }

    /// Puts a vector of rays, those from a place of the order on, in flight at the root.
    #[inline(never)]
    fn take_off_ordered(&mut self, at: usize) {
        let valid = Mask::first(self.rays.len - at);
        let (ray, rays) = self.fetch(at, valid);
        let octant = gather_u32(&self.scratch.order.octant, ray);
        self.take_off_row(ray, rays, octant, valid);
    }

    /// As [`Self::take_off_ordered`], where the order is that of the batch.
    #[inline(always)]
    fn take_off_at(&mut self, at: usize) {
        let valid = Mask::first(self.rays.len - at);
        let rays = [self.rays.origin, self.rays.direction]
            .map(|columns| columns.map(|column| load(column, at)));
        let octant = load_u32(&self.scratch.order.octant, at);
        self.take_off_row(iota() + U32s::splat(at as u32), rays, octant, valid);
    }

    /// Puts rays in flight at the root.
    #[inline(always)]
    fn take_off_row(
        &mut self,
        ray: U32s,
        [origin, direction]: [[F32s; 3]; 2],
        octant: U32s,
        valid: Mask,
    ) {
        let [x, y, z] = direction;
        let reciprocal = direction.map(|d| F32s::splat(1.0) / d);
        let (largest, [u, v, _]) = shear_lanes(Vec3s { x, y, z }, reciprocal);
        self.free_len -= LANES;
        let places = load_u32(&self.free, self.free_len);
        let slots = places >> FLIGHT.trailing_zeros();
        let row = Row {
            largest,
            origin,
            reciprocal,
            shear: [u, v],
            t: self.query.ends(ray),
            primitive: U32s::splat(PrimitiveId::NONE),
            ray,
            octant,
            top: slots * U32s::splat(self.scratch.stride as u32) + U32s::splat(1),
        };
        let flights: &mut [Halves; IN_FLIGHT] = bytemuck::cast_mut(&mut self.scratch.flights);
        let slots = slots.to_array();
        row.flights(Q::ANY, self.tree.farthest, |k, flight| {
            flights[slots[k] as usize % IN_FLIGHT] = flight
        });
        let sound = octant.lt(U32s::splat(OCTANTS as u32)) & valid;
        let root = U32s::splat(self.tree.root);
        self.lists.0[list_of(self.tree.root)].append(sound, places, root);
        // Those that hit nothing have their answers.
        self.lists.0[ENDED].append(valid & !sound, places, root);
        compress_u32(&mut self.free, self.free_len, !valid, places);
        self.free_len += (!valid).count();
    }

    /// Takes up the rays at these places of the order, at most [`GROUP`]: those that can descend together
    /// do; what remains is to take off.
    #[inline(always)]
    fn begin(&mut self, places: Range<usize>) {
        let all = Rays::MAX >> (GROUP - places.len());
        for (vector, at) in places.clone().step_by(LANES).enumerate() {
            let (ray, rays) = self.fetch(at, Mask::first(places.end - at));
            let ends = self.query.ends(ray);
            self.scratch.group.set(vector, ray, rays, ends);
        }
        self.alone = all;
        self.descended = 0;
        self.ready = 0;
        if !self.descend(all) {
            for vector in 0..GROUP / LANES {
                self.descend(all & rays_of(vector));
            }
        }
        let Scratch { group, packet, .. } = &*self.scratch;
        self.alone &= !(self.descended & packet.without_pending());
        for vector in 0..GROUP / LANES {
            let lanes = lanes_of(all & !self.alone, vector);
            if lanes.none() {
                continue;
            }
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

    /// Rays from a place of the order on, with their origins and directions; anything in other lanes than these.
    #[inline(always)]
    fn fetch(&self, at: usize, lanes: Mask) -> (U32s, [[F32s; 3]; 2]) {
        let ray = load_u32(&self.scratch.order.rays, at);
        let len = self.rays.len;
        let row = row(ray).filter(|_| lanes == Mask::ALL);
        let fetch3 = |columns: [&[f32]; 3]| match row {
            Some(first) => columns.map(|column| load(column, first)),
            None => columns.map(|column| gather(&column[..len], ray)),
        };
        (ray, [self.rays.origin, self.rays.direction].map(fetch3))
    }

    /// Lets these rays descend together if they can; whether they did.
    #[inline(never)]
    fn descend(&mut self, rays: Rays) -> bool {
        let group = &mut self.scratch.group;
        let Some(axis) = group.common_axis(rays) else {
            return false;
        };
        let extent = group.extent(rays);
        let together = extent.is_coherent(self.tree.size)
            || self.packets == Packets::Always && rays.count_ones() as usize <= LANES;
        if together {
            for vector in 0..GROUP / LANES {
                if lanes_of(rays, vector).any() {
                    let ray = group.ray[vector];
                    group.skip[vector] = gather_u32(&self.rays.skip[..self.rays.len], ray);
                    group.target[vector] = self.query.targets(ray);
                }
            }
            let (tree, octant, counters) = (self.tree, self.octant, &mut *self.counters);
            let packet = &mut self.scratch.packet;
            match axis {
                0 => descend::<SPHERES, Q, 0>(tree, group, octant, &extent, packet, counters),
                1 => descend::<SPHERES, Q, 1>(tree, group, octant, &extent, packet, counters),
                _ => descend::<SPHERES, Q, 2>(tree, group, octant, &extent, packet, counters),
            }
            self.descended |= rays;
        }
        together
    }

    /// Puts rays of the group in flight while there is room, at the root or at what the group has left to
    /// each.
    #[inline(never)]
    fn take_off(&mut self) {
        let scratch = &mut *self.scratch;
        let (mut alone, mut free) = (self.alone, self.free_len);
        while alone != 0 && free > 0 {
            let place = alone.trailing_zeros() as usize % GROUP;
            alone &= alone - 1;
            let vector = place / LANES;
            if self.ready <= vector {
                let row = scratch.group.row(vector, self.octant);
                let ready: &mut [Halves; GROUP] = bytemuck::cast_mut(&mut scratch.ready);
                let ready = &mut ready[vector * LANES..][..LANES];
                row.flights(Q::ANY, self.tree.farthest, |k, flight| ready[k] = flight);
                self.ready = vector + 1;
            }
            let flight = &scratch.ready[place];
            let at = self.free[free - 1];
            let slot = slot_of(at);
            let mut top = slot * scratch.stride + 1;
            let mut current = self.tree.root;
            if self.descended >> place & 1 != 0 {
                // The last that the group came to is the first to be put aside.
                let pending = &scratch.packet.pending[place];
                for k in (0..usize::from(scratch.packet.counts[place])).rev() {
                    scratch.stack_t[top] = -pending.t[k];
                    scratch.stack[top] = pending.reference[k];
                    top += usize::from(pending.t[k] <= flight.t * FAR_PADDING);
                }
                top -= 1;
                current = scratch.stack[top];
                if current == DONE {
                    self.query
                        .finish(flight.ray as usize, flight.t, flight.primitive);
                    continue;
                }
                self.tree.words().prefetch(current);
            }
            let flights: &mut [Halves; IN_FLIGHT] = bytemuck::cast_mut(&mut scratch.flights);
            flights[slot] = bytemuck::cast(*flight);
            scratch.flights[slot].top = top as u32;
            free -= 1;
            self.lists.0[list_of(current)].push(at, current);
        }
        (self.alone, self.free_len) = (alone, free);
    }
}

/// All that nodes and leaves change.
struct Flights<'a> {
    flights: &'a mut [Flight; IN_FLIGHT],
    stack_t: &'a mut [f32],
    stack: &'a mut [u32],
    stride: usize,
}

impl Flights<'_> {
    /// The flight at a place, with the stacks.
    ///
    /// # Safety
    /// There is one: a list or the free ones name the place.
    #[expect(unsafe_code, reason = "checks of every visit cost a twentieth")]
    #[inline(always)]
    unsafe fn at(&mut self, place: u32) -> (&mut Flight, &mut [f32], &mut [u32]) {
        debug_assert!(place.is_multiple_of(FLIGHT) && (place / FLIGHT) < IN_FLIGHT as u32);
        // SAFETY: by this function's condition.
        let flight = unsafe { &mut *self.flights.as_mut_ptr().byte_add(place as usize) };
        (flight, self.stack_t, self.stack)
    }

    /// Visits the node at which a flight is, and gives where it goes.
    #[expect(unsafe_code, reason = "checks of every visit cost a twentieth")]
    #[inline(always)]
    fn visit_node<Q: Query>(&mut self, words: Words<'_>, place: u32, current: u32) -> u32 {
        // SAFETY: a list names the flight.
        let (flight, stack_t, stack) = unsafe { self.at(place) };
        // SAFETY: a flight in the list of nodes is at a node.
        let node = unsafe { words.node(current) };
        // Signs of near distances are turned over, so that of these too the least counts. NaN (0·∞) drops out. The
        // roundings are those of `geometry::slab::SlabRay`.
        let (mut first, mut last) = (f32x8::splat(0.0), f32x8::splat(flight.t));
        let [x, y] = flight.reciprocal;
        for (k, reciprocal) in [x, y, flight.framed.back].into_iter().enumerate() {
            // SAFETY: these are near planes of some octant.
            let [near, far] = unsafe { node.planes_at(u32::from(flight.frame.near[k])) };
            let origin = f32x8::splat(flight.framed.origin[k]);
            let reciprocal = f32x8::splat(reciprocal);
            first = ((near - origin) * reciprocal).keep_min(first);
            last = ((origin - far) * reciprocal).keep_min(last);
        }
        let within = last.mul_add(f32x8::splat(FAR_PADDING), first);
        // By their signs, NaN's among them: it comes of a box at infinity.
        let missed = within.to_bitmask() & 0xff;
        let order = usize::from(flight.frame.orders) + missed as usize;
        // SAFETY: there are as many orders for each octant as a mask has values.
        let order = unsafe { ORDER.as_flattened().get_unchecked(order) };
        let children = permute(bytemuck::cast(node.children), order);
        let top = flight.top as usize;
        // SAFETY: a stack has room for what the tree needs and a vector more.
        unsafe {
            // Any hit ends a ray: no distance is looked at again.
            if !Q::ANY {
                store8(stack_t, top, permute(first, order));
            }
            store8(bytemuck::cast_slice_mut(stack), top, children);
        }
        // The nearest child, or what was put aside last, is taken at once.
        let top = top + WIDTH - missed.count_ones() as usize - 1;
        flight.top = top as u32;
        // SAFETY: a stack never is empty.
        unsafe { *stack.get_unchecked(top) }
    }

    /// Looks whether a flight may hit something in the leaf at which it is: gives [`MAY_HIT`], or where it goes.
    #[expect(unsafe_code, reason = "checks of every visit cost a twentieth")]
    #[inline(always)]
    fn pass_leaf<const SPHERES: bool>(
        &mut self,
        words: Words<'_>,
        place: u32,
        current: u32,
        tests: &mut u64,
    ) -> u32 {
        // SAFETY: a list names the flight.
        let (flight, _, stack) = unsafe { self.at(place) };
        // SAFETY: a flight in the list of leaves is at a leaf.
        let leaf = unsafe { words.leaf(current) };
        let spheres = if SPHERES { leaf.spheres } else { 0 };
        *tests += (leaf.triangles + spheres) as u64;
        let row = |k: usize, corner: usize| flight.frame.row(&leaf, k, corner);
        let may_hit = flight.framed.may_hit(row, leaf.valid(), flight.end);
        // All ones where the flight stays.
        let stays = u32::from(may_hit.any() | (spheres > 0)).wrapping_neg();
        let top = flight.top;
        // SAFETY: a stack never is empty.
        let below = unsafe { *stack.get_unchecked(top as usize - 1) };
        // Also where a hit may be found: most go there.
        words.prefetch(below);
        flight.top = top.wrapping_add(!stays);
        below | stays
    }

    /// Tests the leaf at which a flight is, and gives where it goes.
    #[inline(always)]
    fn visit_leaf<const SPHERES: bool, Q: Query>(
        &mut self,
        tree: &Blocks,
        rays: &RayBatch<'_>,
        query: &Q,
        place: u32,
        current: u32,
    ) -> u32 {
        let slot = slot_of(place);
        let flight = &mut self.flights[slot];
        let ray = flight.ray as usize;
        let leaf = tree.leaf(current);
        let mut closer = false;
        if !SPHERES || leaf.triangles > 0 {
            let frame = flight.frame;
            let row = move |k: usize, corner: usize| frame.row(&leaf, k, corner);
            let (hits, t) = flight.framed.intersect(row, leaf.valid());
            let t = bytemuck::cast_slice(std::slice::from_ref(&t));
            closer |= flight.take(query, hits, t, rays.skip[ray], || leaf.ids());
        }
        if SPHERES && leaf.spheres > 0 {
            let ([x, y, z, radius], ids, valid) = leaf.spheres();
            let leaving = ids.eq(U32s::splat(rays.skip[ray]));
            let [origin, direction] =
                [rays.origin, rays.direction].map(|columns| Vec3s::splat(columns.map(|c| c[ray])));
            let t = sphere_distance(Vec3s::new(x, y, z), radius, origin, direction, leaving);
            let hits = t.lt(F32s::splat(f32::INFINITY)) & valid;
            closer |= flight.take(query, hits, &t.to_array(), PrimitiveId::NONE, || {
                std::array::from_fn(|i| ids.as_array()[i])
            });
        }
        let mut top = flight.top as usize;
        if closer {
            if Q::ANY {
                return DONE;
            }
            let base = slot * self.stride;
            let part = base..base + self.stride;
            let limit = flight.end_at_t();
            let t = &mut self.stack_t[part.clone()];
            top = base + keep_near(t, &mut self.stack[part], top - base, limit);
        }
        flight.top = top as u32 - 1;
        self.stack[top - 1]
    }
}

/// Writes the eight words from `at` on.
///
/// # Safety
/// The column has them.
#[expect(unsafe_code, reason = "checks of every visit cost a twentieth")]
#[inline(always)]
unsafe fn store8(column: &mut [f32], at: usize, value: f32x8) {
    debug_assert!(at + WIDTH <= column.len());
    // SAFETY: by this function's condition.
    unsafe {
        column
            .as_mut_ptr()
            .add(at)
            .cast::<f32x8>()
            .write_unaligned(value);
    }
}

impl Flight {
    /// Takes hits of other primitives than `skip` where they count; whether one did.
    #[inline(always)]
    fn take<Q: Query>(
        &mut self,
        query: &Q,
        hits: Mask,
        t: &[f32],
        skip: u32,
        ids: impl Fn() -> [u32; LEAF_SIZE],
    ) -> bool {
        if hits.none() {
            return false;
        }
        let ids = ids();
        let mut taken = false;
        for lane in hits.lanes() {
            let (t, id) = (t[lane], ids[lane]);
            let counts = if Q::ANY {
                t < self.t && id != query.target(self.ray as usize)
            } else {
                t < self.t || (t == self.t && id < self.primitive)
            };
            if counts && id != skip {
                if !Q::ANY {
                    self.t = t;
                }
                self.primitive = id;
                taken = true;
            }
        }
        taken
    }
}

/// Keeps the entries of a stack that are no farther than `limit`, in order; their number. `t` are the distances with signs
/// turned over.
#[inline(always)]
fn keep_near(t: &mut [f32], references: &mut [u32], len: usize, limit: f32) -> usize {
    let mut kept = 0;
    for at in (0..len).step_by(LANES) {
        let (near, reference) = (load(t, at), load_u32(references, at));
        let keep = near.ge(F32s::splat(-limit)) & Mask::first(len - at);
        compress(t, kept, keep, near);
        compress_u32(references, kept, keep, reference);
        kept += keep.count();
    }
    kept
}
