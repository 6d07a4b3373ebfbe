//! A tree of eight children per node, collapsed from the binary tree by surface area (Wald, Benthin and
//! Boulos, "Getting Rid of Packets", 2008), for whole queues of rays.

use super::blocks::{Blocks, LEAF_SIZE};
use super::build_options::BuildOptions;
use super::collapse::{CollapseCosts, WideTree};
use super::stream::{self, Packets, Query};
use super::{Accel, AccelCounters, HitBatch, RayBatch, ShadowBatch};
use crate::error::Result;
use crate::geometry::{Geometry, PrimitiveId};
use crate::math::lanes::{Compare, F32s, U32s, gather, gather_u32, store, store_u32};

/// What traversal costs: a visit of a node takes 7 ns, one of a leaf 7 to 11 ns (samples of a profile over visits, bounces
/// of Suzanne and Sponza). Leaves that cost 0.6 to 2 nodes make the bunny's rays neither faster nor slower; of Sponza
/// at best quality the cheaper ones take 15 % fewer nodes.
const COSTS: CollapseCosts = CollapseCosts {
    node: 1.0,
    pack: 0.8,
    pack_size: LEAF_SIZE as u32,
    largest_leaf: LEAF_SIZE as u32,
};

/// An 8-wide tree over triangles and spheres.
#[derive(Debug)]
pub struct Bvh8 {
    tree: Blocks,
    packets: Packets,
}

impl Bvh8 {
    /// Builds over the primitives; groups of rays descend together where their directions are close.
    ///
    /// # Errors
    /// [`crate::ErrorKind::Limit`] if the tree takes 32 GiB or more.
    pub fn new(geometry: &Geometry, options: &BuildOptions<'_>) -> Result<Self> {
        Self::with_packets(geometry, options, Packets::Coherent)
    }

    /// As [`Self::new`], but groups of rays descend together wherever they can.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn packets(geometry: &Geometry, options: &BuildOptions<'_>) -> Result<Self> {
        Self::with_packets(geometry, options, Packets::Always)
    }

    fn with_packets(
        geometry: &Geometry,
        options: &BuildOptions<'_>,
        packets: Packets,
    ) -> Result<Self> {
        let tree = WideTree::build(geometry, options, &COSTS);
        Ok(Self {
            tree: Blocks::new(geometry, &tree)?,
            packets,
        })
    }
}

impl Accel for Bvh8 {
    fn name(&self) -> &'static str {
        match self.packets {
            Packets::Coherent => "bvh8",
            Packets::Always => "packet",
        }
    }

    fn bytes(&self) -> usize {
        self.tree.bytes()
    }

    fn closest(&self, rays: RayBatch<'_>, hits: HitBatch<'_>, counters: &mut AccelCounters) {
        stream::trace(
            &self.tree,
            self.packets,
            &rays,
            &mut Closest(hits),
            counters,
        );
    }

    fn occluded(&self, rays: ShadowBatch<'_>, occluded: &mut [u32], counters: &mut AccelCounters) {
        let len = rays.rays.len;
        let mut query = Occluded {
            t_max: &rays.t_max[..len],
            target: &rays.target[..len],
            occluded,
        };
        stream::trace(&self.tree, self.packets, &rays.rays, &mut query, counters);
    }
}

/// Closest hits.
struct Closest<'a>(HitBatch<'a>);

impl Query for Closest<'_> {
    const ANY: bool = false;

    #[inline(always)]
    fn ends(&self, _: U32s) -> F32s {
        F32s::splat(f32::INFINITY)
    }

    #[inline(always)]
    fn targets(&self, _: U32s) -> U32s {
        U32s::splat(PrimitiveId::NONE)
    }

    #[inline(always)]
    fn target(&self, _: usize) -> u32 {
        PrimitiveId::NONE
    }

    #[inline(always)]
    fn finish(&mut self, ray: usize, t: f32, primitive: u32) {
        self.0.t[ray] = t;
        self.0.primitive[ray] = primitive;
    }

    #[inline(always)]
    fn finish_row(&mut self, first: usize, t: F32s, primitive: U32s) {
        store(self.0.t, first, t);
        store_u32(self.0.primitive, first, primitive);
    }
}

/// Whether anything is hit.
struct Occluded<'a> {
    t_max: &'a [f32],
    target: &'a [u32],
    occluded: &'a mut [u32],
}

impl Query for Occluded<'_> {
    const ANY: bool = true;

    #[inline(always)]
    fn ends(&self, ray: U32s) -> F32s {
        gather(self.t_max, ray)
    }

    #[inline(always)]
    fn targets(&self, ray: U32s) -> U32s {
        gather_u32(self.target, ray)
    }

    #[inline(always)]
    fn target(&self, ray: usize) -> u32 {
        self.target[ray]
    }

    #[inline(always)]
    fn finish(&mut self, ray: usize, _: f32, primitive: u32) {
        self.occluded[ray] = u32::from(primitive != PrimitiveId::NONE);
    }

    #[inline(always)]
    fn finish_row(&mut self, first: usize, _: F32s, primitive: U32s) {
        let free = primitive.eq(U32s::splat(PrimitiveId::NONE));
        let occluded = free.select_u32(U32s::splat(0), U32s::splat(1));
        store_u32(self.occluded, first, occluded);
    }
}
