//! Octants of directions, and the order in which a ray of each octant meets the children of a node.

use wide::f32x8;

use super::blocks::Node;
use super::collapse::WIDTH;

/// Number of octants: bit k is set where component k of the direction has its sign bit set.
pub(super) const OCTANTS: usize = 8;

/// Per axis which of a box's planes a ray of some octant meets first: 0 the lower, 1 the upper one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sides(pub(super) [usize; 3]);

impl Sides {
    #[inline(always)]
    pub(super) fn of(octant: usize) -> Self {
        Self([0, 1, 2].map(|axis| octant >> axis & 1))
    }

    /// The near and the far planes of a node's children.
    #[inline(always)]
    pub(super) fn planes(self, node: &Node, axis: usize) -> [&f32x8; 2] {
        let near = self.0[axis] & 1;
        [&node.planes[axis][near], &node.planes[axis][near + 1]]
    }
}

/// `ORDER[octant][missed]`: slots of the children not in `missed` for a ray of that octant, farthest first. Bit k of a
/// slot says on which side of the node a child lies along axis k, so that slot ^ octant sorts children along the ray.
pub(super) static ORDER: [[u64; 1 << WIDTH]; OCTANTS] = order();

const fn order() -> [[u64; 1 << WIDTH]; OCTANTS] {
    let mut table = [[0; 1 << WIDTH]; OCTANTS];
    let mut octant = 0;
    while octant < OCTANTS {
        let mut missed: usize = 0;
        while missed < 1 << WIDTH {
            let mut lane = 0;
            let mut rank = WIDTH;
            while rank > 0 {
                rank -= 1;
                let slot = rank ^ octant;
                if missed >> slot & 1 == 0 {
                    table[octant][missed] |= (slot as u64) << (8 * lane);
                    lane += 1;
                }
            }
            missed += 1;
        }
        octant += 1;
    }
    table
}

impl Node {
    /// What far planes are away from near ones, in bytes.
    pub(super) const SIDE: u32 = size_of::<f32x8>() as u32;

    /// Per octant and axis where the near planes are, in bytes.
    pub(super) const NEAR: [[u32; 3]; OCTANTS] = {
        let mut near = [[0; 3]; OCTANTS];
        let mut octant = 0;
        while octant < OCTANTS {
            let mut axis = 0;
            while axis < 3 {
                let side = (octant >> axis & 1) as u32;
                near[octant][axis] = (3 * axis as u32 + side) * Self::SIDE;
                axis += 1;
            }
            octant += 1;
        }
        near
    };

    /// The near planes at a place in bytes, and the far ones.
    ///
    /// # Safety
    /// `place` is one of [`Self::NEAR`].
    #[expect(unsafe_code, reason = "checks of every visit cost a twentieth")]
    #[inline(always)]
    pub(super) unsafe fn planes_at(&self, place: u32) -> [f32x8; 2] {
        debug_assert!(place < 8 * Self::SIDE && place.is_multiple_of(Self::SIDE));
        // SAFETY: there are nine vectors of planes, one after the other.
        unsafe {
            std::ptr::from_ref(self)
                .byte_add(place as usize)
                .cast::<[f32x8; 2]>()
                .read()
        }
    }
}

/// The lanes of `values` that `order` names.
#[inline(always)]
pub(super) fn permute(values: f32x8, order: &u64) -> f32x8 {
    imp::permute(values, order)
}

#[cfg(target_feature = "avx2")]
mod imp {
    #![expect(unsafe_code, reason = "permutations by variables have no safe form")]

    use std::arch::x86_64::*;

    use super::f32x8;

    #[inline(always)]
    pub(super) fn permute(values: f32x8, order: &u64) -> f32x8 {
        // SAFETY: eight bytes are read, those of `order`; avx2 is enabled by this module's `cfg`.
        unsafe {
            let lanes = _mm256_cvtepu8_epi32(_mm_loadl_epi64(std::ptr::from_ref(order).cast()));
            _mm256_permutevar8x32_ps(values.into(), lanes).into()
        }
    }
}

#[cfg(not(target_feature = "avx2"))]
mod imp {
    use super::{WIDTH, f32x8};

    #[inline(always)]
    pub(super) fn permute(values: f32x8, order: &u64) -> f32x8 {
        let values = values.to_array();
        f32x8::from(
            order
                .to_le_bytes()
                .map(|lane| values[usize::from(lane) % WIDTH]),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn children_come_farthest_first() {
        for (octant, table) in ORDER.iter().enumerate() {
            for (missed, &order) in table.iter().enumerate() {
                let mut slots = (0..WIDTH)
                    .filter(|slot| missed >> slot & 1 == 0)
                    .collect::<Vec<_>>();
                slots.sort_by_key(|slot| std::cmp::Reverse(slot ^ octant));
                let order = order.to_le_bytes().map(usize::from);
                assert_eq!(slots, order[..slots.len()]);
            }
        }
    }

    #[test]
    fn permutations_pick_the_named_lanes() {
        let values = f32x8::from([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
        let order = [7, 7, 0, 3, 2, 1, 6, 4];
        let expected = order.map(f32::from);
        assert_eq!(
            permute(values, &u64::from_le_bytes(order)).to_array(),
            expected
        );
    }
}
