//! A tree of eight children per node, collapsed from the binary tree by surface area (Wald, Benthin and
//! Boulos, "Getting Rid of Packets", 2008).

use wide::f32x16;

use super::octant::OCTANTS;
use super::stream::{self, Query};
use super::tree::{BinaryTree, Pending};
use super::{Accel, AccelCounters, HitBatch, RayBatch, ShadowBatch};
use crate::geometry::slab::Bounds;
use crate::geometry::{Geometry, PrimitiveId};
use crate::math::lanes::{F32s, LANES, Mask, U32s};

const WIDTH: usize = 8;

/// Most primitives of a leaf.
const LEAF_SIZE: u32 = LANES as u32;

/// Bit of a reference to a leaf. The other bits are its place in units of 16 bytes.
pub(super) const LEAF: u32 = 1 << 31;
/// The reference at the bottom of every stack.
pub(super) const DONE: u32 = u32::MAX;

/// Words of 4 bytes per unit of references.
const UNIT: usize = 4;

/// Up to eight children with their boxes.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
pub(super) struct Node {
    /// Per axis the lower planes of the children, then the upper planes. Unused slots have empty boxes.
    pub(super) planes: [f32x16; 3],
    pub(super) children: [u32; WIDTH],
    unused: [u32; 8],
}

/// Nodes and leaves, in one array.
#[derive(Debug, Default)]
pub(super) struct Blocks {
    blocks: Vec<f32x16>,
    pub(super) root: u32,
    pub(super) stack_bound: usize,
}

pub(super) struct Leaf<'a> {
    pub(super) count: usize,
    words: &'a [f32],
}

impl Leaf<'_> {
    #[inline(always)]
    pub(super) fn row(&self, axis: usize, corner: usize, valid: Mask) -> F32s {
        load_first(self.words, 1 + self.count * (1 + 3 * axis + corner), valid)
    }
    #[inline(always)]
    pub(super) fn ids(&self, valid: Mask) -> U32s {
        bytemuck::cast(load_first(self.words, 1, valid))
    }
}

#[inline(always)]
#[allow(unsafe_code, reason = "experiment")]
fn load_first(words: &[f32], at: usize, valid: Mask) -> F32s {
    #[cfg(target_feature = "avx512f")]
    unsafe {
        debug_assert!(at + valid.count() <= words.len());
        std::arch::x86_64::_mm512_maskz_loadu_ps(valid.0, words.as_ptr().add(at)).into()
    }
    #[cfg(not(target_feature = "avx512f"))]
    valid.select(crate::math::lanes::load(words, at), F32s::splat(0.0))
}

impl Blocks {
    #[inline(always)]
    #[allow(unsafe_code, reason = "experiment")]
    pub(super) fn node(&self, reference: u32) -> &Node {
        let at = reference as usize / 4;
        debug_assert!(at + 4 <= self.blocks.len());
        unsafe { &*self.blocks.as_ptr().add(at).cast::<Node>() }
    }

    #[inline(always)]
    pub(super) fn leaf(&self, reference: u32) -> Leaf<'_> {
        let words: &[f32] = bytemuck::cast_slice(&self.blocks);
        let words = &words[(reference & !LEAF) as usize * UNIT..];
        Leaf {
            count: words[0].to_bits() as usize,
            words,
        }
    }

    #[inline(always)]
    #[allow(unsafe_code, reason = "experiment")]
    pub(super) fn prefetch(&self, reference: u32) {
        use std::arch::x86_64::*;
        let p = self.blocks.as_ptr().cast::<i8>().wrapping_add((reference & !LEAF) as usize * 16);
        unsafe {
            _mm_prefetch::<_MM_HINT_T0>(p);
            _mm_prefetch::<_MM_HINT_T0>(p.wrapping_add(64));
            _mm_prefetch::<_MM_HINT_T0>(p.wrapping_add(128));
            _mm_prefetch::<_MM_HINT_T0>(p.wrapping_add(192));
        }
    }
}

/// An 8-wide tree over triangles and spheres.
#[derive(Debug)]
pub struct Bvh8 {
    tree: Blocks,
}

impl Bvh8 {
    /// Builds over the primitives.
    pub fn new(geometry: &Geometry) -> Self {
        let leaf_size = std::env::var("LEAF").map_or(LEAF_SIZE, |x| x.parse().unwrap());
        let binary = BinaryTree::new(geometry);
        let mut tree = Blocks {
            blocks: Vec::new(),
            root: DONE,
            stack_bound: WIDTH,
        };
        if binary.nodes.is_empty() {
            return Self { tree };
        }
        let mut words: Vec<u32> = Vec::new();
        let mut work = vec![Pending {
            source: 0,
            parent: None,
            depth: 1,
        }];
        while let Some(Pending {
            source,
            parent,
            depth,
        }) = work.pop()
        {
            let node = &binary.nodes[source as usize];
            let entry = if node.count <= leaf_size {
                words.resize(words.len().next_multiple_of(UNIT), 0);
                let at = words.len() / UNIT;
                let ids = &binary.order[node.first as usize..(node.first + node.count) as usize];
                words.push(ids.len() as u32);
                words.extend(ids);
                for axis in 0..3 {
                    for corner in 0..3 {
                        words.extend(ids.iter().map(|&id| {
                            geometry.triangles[id as usize].corners[corner][axis].to_bits()
                        }));
                    }
                }
                at as u32 | LEAF
            } else {
                words.resize(words.len().next_multiple_of(16), 0);
                let at = words.len() / UNIT;
                let children = widen(&binary, source, leaf_size);
                let slots = assign(&binary, source, &children);
                let mut planes = [[[f32::INFINITY; 8], [f32::NEG_INFINITY; 8]]; 3];
                for (&child, &slot) in children.iter().zip(&slots) {
                    let bounds = binary.nodes[child as usize].bounds;
                    for axis in 0..3 {
                        for side in 0..2 {
                            planes[axis][side][slot] = bounds.corners[side][axis];
                        }
                    }
                    work.push(Pending {
                        source: child,
                        parent: Some((at * UNIT + 48, slot)),
                        depth: depth + 1,
                    });
                }
                words.extend(planes.as_flattened().as_flattened().iter().map(|x| x.to_bits()));
                words.extend([DONE; 16]);
                tree.stack_bound = tree.stack_bound.max(depth * (WIDTH - 1) + 1);
                at as u32
            };
            match parent {
                Some((parent, slot)) => words[parent + slot] = entry,
                None => tree.root = entry,
            }
        }
        words.resize(words.len().next_multiple_of(16) + 160, 0);
        tree.blocks = words.chunks_exact(16).map(|c| bytemuck::pod_read_unaligned(bytemuck::cast_slice(c))).collect();
        Self { tree }
    }
}

fn assign(tree: &BinaryTree, node: u32, children: &[u32]) -> Vec<usize> {
    let middle = |b: &Bounds| [0, 1, 2].map(|k| b.corners[0][k] + b.corners[1][k]);
    let c = middle(&tree.nodes[node as usize].bounds);
    let mut slots = vec![usize::MAX; children.len()];
    let mut taken = [false; 8];
    for _ in 0..children.len() {
        let mut best = (f32::NEG_INFINITY, 0, 0);
        for (i, &child) in children.iter().enumerate() {
            if slots[i] != usize::MAX {
                continue;
            }
            let m = middle(&tree.nodes[child as usize].bounds);
            for s in 0..OCTANTS {
                if taken[s] {
                    continue;
                }
                let cost: f32 = (0..3).map(|k| (m[k] - c[k]) * if s >> k & 1 == 1 { 1.0 } else { -1.0 }).sum();
                if cost > best.0 {
                    best = (cost, i, s);
                }
            }
        }
        slots[best.1] = best.2;
        taken[best.2] = true;
    }
    slots
}

struct ClosestQuery<'a>(HitBatch<'a>);
impl Query for ClosestQuery<'_> {
    const ANY: bool = false;
    #[inline(always)]
    fn end(&self, _: usize) -> (f32, u32) {
        (f32::INFINITY, PrimitiveId::NONE)
    }
    #[inline(always)]
    fn finish(&mut self, ray: usize, t: f32, primitive: u32) {
        self.0.t[ray] = t;
        self.0.primitive[ray] = primitive;
    }
}
struct OccludedQuery<'a> {
    t_max: &'a [f32],
    target: &'a [u32],
    occluded: &'a mut [u32],
}
impl Query for OccludedQuery<'_> {
    const ANY: bool = true;
    #[inline(always)]
    fn end(&self, ray: usize) -> (f32, u32) {
        (self.t_max[ray], self.target[ray])
    }
    #[inline(always)]
    fn finish(&mut self, ray: usize, _: f32, primitive: u32) {
        self.occluded[ray] = u32::from(primitive != PrimitiveId::NONE);
    }
}

impl Accel for Bvh8 {
    fn name(&self) -> &'static str {
        "bvh8"
    }
    fn bytes(&self) -> usize {
        self.tree.blocks.len() * 64
    }
    fn closest(&self, rays: RayBatch<'_>, hits: HitBatch<'_>, counters: &mut AccelCounters) {
        stream::trace(&self.tree, &rays, &mut ClosestQuery(hits), counters);
    }
    fn occluded(&self, rays: ShadowBatch<'_>, occluded: &mut [u32], counters: &mut AccelCounters) {
        let mut query = OccludedQuery { t_max: rays.t_max, target: rays.target, occluded };
        stream::trace(&self.tree, &rays.rays, &mut query, counters);
    }
}

/// Up to eight descendants that stand for the node: the largest inner node is opened until eight are reached.
fn widen(tree: &BinaryTree, node: u32, leaf_size: u32) -> Vec<u32> {
    let mut open = vec![node];
    while open.len() < WIDTH {
        let inner = open
            .iter()
            .enumerate()
            .filter(|&(_, &child)| tree.nodes[child as usize].count > leaf_size);
        let area = |child: u32| tree.nodes[child as usize].bounds.half_area();
        let Some((at, _)) = inner.max_by(|a, b| area(*a.1).total_cmp(&area(*b.1))) else {
            break;
        };
        let Some(children) = tree.nodes[open[at] as usize].children else {
            break;
        };
        open.splice(at..=at, children);
    }
    open
}
