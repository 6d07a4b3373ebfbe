//! Meagher's octree ("Geometric Modeling Using Octree Encoding", *Computer Graphics and Image Processing*
//! 19(2), 1982) over triangles and spheres, in a loose form: each primitive lies in the cell that its
//! centroid is in, and a ray meets the exact box of what lies in a cell, not the cell. Children are taken
//! front to back by the signs of the ray's direction (Revelles, Ureña and Lastra, "An Efficient Parametric
//! Algorithm for Octree Traversal", WSCG 2000).
//!
//! The other form is the clipped one: a primitive is in every cell that it overlaps, by an exact
//! triangle–box test, and a ray meets the part of a box that is in the cell. CPU time per incoherent ray
//! from within the mesh in ns, and bytes per triangle, with 16 lanes, best of nine interleaved rounds; for
//! the clipped octree with the best of the tried sizes of leaves (16, 32 and 48 triangles) and limits on the
//! growth of references (1.5, 1.8 and 4 per primitive and split):
//!
//! | mesh, triangles | loose | clipped |
//! | --- | --- | --- |
//! | icosphere, 20 480 | 298, 59 B | 324, 89 B |
//! | icosphere, 81 920 | 440, 59 B | 502, 89 B |
//! | terrain, 20 000 | 220, 69 B | 243, 114 B |
//! | terrain, 199 712 | 393, 62 B | 414, 98 B |
//! | soup, 20 000 | 590, 54 B | 563, 104 B |
//! | soup, 200 000 | 1604, 77 B | 1662, 105 B |
//! | hairball, 199 996 | 1329, 59 B | 1735, 111 B |
//! | sponge, 36 096 | 326, 68 B | 352, 142 B |
//!
//! The clipped form also takes five times as long to build; the loose one takes 0.2 s for a million
//! triangles, on one thread. Two things did not pay in the loose form: to sort the children that a ray enters
//! by distance (the same within 5 %, either way), and to leave primitives larger than a child's cell with
//! the parent (with leaves of one pack, from 5 % faster to 12 % slower).

mod build;
mod leaves;

use super::{Accel, AccelCounters, HitBatch, RayBatch, ShadowBatch};
use crate::geometry::Geometry;
use crate::geometry::slab::{Bounds8, SlabRay};
use crate::math::float::gamma;

use leaves::{Leaves, Nearest, PrimitiveRay};

/// Most levels: cells are not halved further, whatever is in them. Nothing nearer to one another than
/// 10⁻¹⁹ of the whole is told apart.
const MAX_DEPTH: usize = 64;

/// Entries that a walk may have to remember: each level leaves at most seven children behind.
const STACK: usize = 7 * MAX_DEPTH + 1;

/// A node or a leaf: an index, with the top bit set for a leaf.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Child(u32);

impl Child {
    const LEAF: u32 = 1 << 31;

    fn node(index: usize) -> Self {
        Self(index as u32)
    }

    fn leaf(index: usize) -> Self {
        Self(index as u32 | Self::LEAF)
    }

    #[inline(always)]
    fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    #[inline(always)]
    fn index(self) -> usize {
        (self.0 & !Self::LEAF) as usize
    }
}

/// A cell that is divided. Bit k of a child's place is set for the upper half along axis k; places without
/// primitives have empty boxes, which no ray enters.
#[derive(Debug, Clone, Copy)]
struct Node {
    bounds: Bounds8,
    children: [Child; 8],
}

/// An octree over triangles and spheres.
#[derive(Debug)]
pub struct Octree {
    nodes: Vec<Node>,
    leaves: Leaves,
    /// `None` without primitives.
    root: Option<Child>,
}

/// A child that waits for its turn, and the distance at which the ray enters its box.
#[derive(Debug, Clone, Copy, Default)]
struct Entry {
    t: f32,
    child: Child,
}

/// One ray, prepared for boxes and primitives.
#[derive(Debug)]
struct Ray {
    slab: SlabRay,
    primitives: PrimitiveRay,
    /// Place of the child that the ray comes through first.
    first: u32,
}

impl Ray {
    /// The ray of a batch; `None` if it has NaN or infinity, or no direction, and so meets nothing.
    #[inline]
    fn new(rays: &RayBatch<'_>, at: usize) -> Option<Self> {
        let origin = rays.origin.map(|column| column[at]);
        let direction = rays.direction.map(|column| column[at]);
        let finite = origin.iter().chain(&direction).all(|x| x.is_finite());
        (finite && direction != [0.0; 3]).then(|| Self {
            slab: SlabRay::new(origin, direction),
            primitives: PrimitiveRay::new(origin, direction, rays.skip[at]),
            first: [0, 1, 2]
                .map(|axis| u32::from(direction[axis].is_sign_negative()) << axis)
                .iter()
                .sum(),
        })
    }
}

/// Where bits are places of children, the same set with bit k for the child that a ray comes through as the
/// k-th, if it comes through `first` as the first: bit k of the result is bit k ⊕ `first` of `places`.
#[inline(always)]
fn front_to_back(mut places: u32, first: u32) -> u32 {
    if first & 1 != 0 {
        places = (places & 0x55) << 1 | places >> 1 & 0x55;
    }
    if first & 2 != 0 {
        places = (places & 0x33) << 2 | places >> 2 & 0x33;
    }
    if first & 4 != 0 {
        places = (places & 0x0f) << 4 | places >> 4;
    }
    places
}

/// A box entered beyond this holds nothing nearer than `t`. Wider by the rounding of a box distance, so that
/// equal hits are compared whatever the shape of the tree.
#[inline(always)]
fn limit(t: f32) -> f32 {
    t * (1.0 + 2.0 * gamma(3))
}

impl Octree {
    /// Builds over the primitives.
    pub fn new(geometry: &Geometry) -> Self {
        build::build(geometry)
    }

    /// Visits leaves that the ray enters no later than at `limit`, nearer children first. `visit` may lower
    /// the limit, and ends the walk by returning true.
    #[inline(always)]
    fn walk(
        &self,
        ray: &Ray,
        stack: &mut [Entry; STACK],
        mut limit: f32,
        nodes: &mut u64,
        mut visit: impl FnMut(usize, &mut f32) -> bool,
    ) {
        let Some(child) = self.root else { return };
        stack[0] = Entry { t: 0.0, child };
        let mut size = 1;
        while size > 0 {
            size -= 1;
            let Entry { t, child } = stack[size];
            // The limit may have come down since the entry was put aside.
            if t > limit {
                continue;
            }
            if child.is_leaf() {
                if visit(child.index(), &mut limit) {
                    return;
                }
                continue;
            }
            *nodes += 1;
            let node = &self.nodes[child.index()];
            let (entered, t) = ray.slab.enters8(&node.bounds, limit);
            let t = t.as_array();
            // The farthest first, so that the nearest comes to lie on top.
            let mut order = front_to_back(entered, ray.first);
            while order != 0 {
                let last = order.ilog2();
                order ^= 1 << last;
                let place = (last ^ ray.first) as usize;
                stack[size] = Entry {
                    t: t[place],
                    child: node.children[place],
                };
                size += 1;
            }
        }
    }
}

impl Accel for Octree {
    fn name(&self) -> &'static str {
        "octree"
    }

    fn bytes(&self) -> usize {
        std::mem::size_of_val(&*self.nodes) + self.leaves.bytes()
    }

    fn closest(&self, rays: RayBatch<'_>, hits: HitBatch<'_>, counters: &mut AccelCounters) {
        let mut stack = [Entry::default(); STACK];
        let AccelCounters { nodes, tests } = counters;
        for at in 0..rays.len {
            let mut nearest = Nearest::MISS;
            if let Some(ray) = Ray::new(&rays, at) {
                self.walk(&ray, &mut stack, f32::INFINITY, nodes, |leaf, reach| {
                    *tests += self.leaves.closest(leaf, &ray.primitives, &mut nearest);
                    *reach = limit(nearest.t);
                    false
                });
            }
            hits.t[at] = nearest.t;
            hits.primitive[at] = nearest.primitive;
        }
    }

    fn occluded(&self, rays: ShadowBatch<'_>, occluded: &mut [u32], counters: &mut AccelCounters) {
        let mut stack = [Entry::default(); STACK];
        let AccelCounters { nodes, tests } = counters;
        for (at, answer) in occluded.iter_mut().enumerate().take(rays.rays.len) {
            let (t_max, target) = (rays.t_max[at], rays.target[at]);
            let mut blocked = false;
            if let Some(ray) = Ray::new(&rays.rays, at) {
                self.walk(&ray, &mut stack, limit(t_max), nodes, |leaf, _| {
                    blocked = self
                        .leaves
                        .occluded(leaf, &ray.primitives, t_max, target, tests);
                    blocked
                });
            }
            *answer = u32::from(blocked);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn children_are_ordered_from_the_first_to_the_opposite_one() {
        for first in 0..8 {
            for places in 0..256 {
                let ordered = front_to_back(places, first);
                for rank in 0..8 {
                    assert_eq!(ordered >> rank & 1, places >> (rank ^ first) & 1);
                }
                assert_eq!(ordered >> 8, 0);
            }
        }
    }
}
