//! Octants of directions, and the order in which a ray of each octant meets the children of a node.

use wide::f32x8;

use super::collapse::WIDTH;

/// Number of octants: bit k is set where component k of the direction has its sign bit set.
pub(super) const OCTANTS: usize = 8;

/// Which lane of a permutation by [`ORDER`] has the nearest child.
pub(super) const NEAREST: usize = WIDTH - 1;

/// `ORDER[octant][mask]`: slots of the children in `mask` for a ray of that octant: all but the nearest
/// from lane 0 on, farthest first, and the nearest in lane [`NEAREST`]. Bit k of a slot says on which side
/// of the node a child lies along axis k, so that slot ^ octant sorts children along the ray.
pub(super) static ORDER: [[[u8; WIDTH]; 1 << WIDTH]; OCTANTS] = order();

const fn order() -> [[[u8; WIDTH]; 1 << WIDTH]; OCTANTS] {
    let mut table = [[[0; WIDTH]; 1 << WIDTH]; OCTANTS];
    let mut octant = 0;
    while octant < OCTANTS {
        let mut mask: usize = 0;
        while mask < 1 << WIDTH {
            let mut lane = 0;
            let mut left = mask.count_ones();
            let mut rank = WIDTH;
            while rank > 0 {
                rank -= 1;
                let slot = rank ^ octant;
                if mask >> slot & 1 != 0 {
                    left -= 1;
                    table[octant][mask][if left == 0 { NEAREST } else { lane }] = slot as u8;
                    lane += 1;
                }
            }
            mask += 1;
        }
        octant += 1;
    }
    table
}

/// The lanes of `values` that `order` names.
#[inline(always)]
pub(super) fn permute(values: f32x8, order: &[u8; WIDTH]) -> f32x8 {
    imp::permute(values, order)
}

#[cfg(target_feature = "avx2")]
mod imp {
    #![expect(unsafe_code, reason = "permutations by variables have no safe form")]

    use std::arch::x86_64::*;

    use super::{WIDTH, f32x8};

    #[inline(always)]
    pub(super) fn permute(values: f32x8, order: &[u8; WIDTH]) -> f32x8 {
        let order = i64::from_le_bytes(*order);
        // SAFETY: these instructions touch registers only; avx2 is enabled by this module's `cfg`.
        unsafe {
            let lanes = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(order));
            _mm256_permutevar8x32_ps(values.into(), lanes).into()
        }
    }
}

#[cfg(not(target_feature = "avx2"))]
mod imp {
    use super::{WIDTH, f32x8};

    #[inline(always)]
    pub(super) fn permute(values: f32x8, order: &[u8; WIDTH]) -> f32x8 {
        let values = values.to_array();
        f32x8::from(order.map(|lane| values[usize::from(lane) % WIDTH]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn children_come_farthest_first_and_the_nearest_is_apart() {
        for (octant, table) in ORDER.iter().enumerate() {
            for (mask, order) in table.iter().enumerate().skip(1) {
                let mut slots = (0..WIDTH)
                    .filter(|slot| mask >> slot & 1 != 0)
                    .collect::<Vec<_>>();
                slots.sort_by_key(|slot| std::cmp::Reverse(slot ^ octant));
                let nearest = slots.pop();
                assert_eq!(nearest, Some(usize::from(order[NEAREST])));
                for (lane, slot) in slots.into_iter().enumerate() {
                    assert_eq!(usize::from(order[lane]), slot);
                }
            }
        }
    }

    #[test]
    fn permutations_pick_the_named_lanes() {
        let values = f32x8::from([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
        let order = [7, 7, 0, 3, 2, 1, 6, 4];
        let expected = order.map(f32::from);
        assert_eq!(permute(values, &order).to_array(), expected);
    }
}
