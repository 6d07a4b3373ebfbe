//! Hashes that key sequences of sample points.

use crate::math::lanes::U32s;

/// A 32-bit finaliser with good avalanche (Wellons' lowbias32).
#[inline(always)]
pub(super) fn mix(x: U32s) -> U32s {
    let x = (x ^ (x >> 16)) * U32s::splat(0x7feb_352d);
    let x = (x ^ (x >> 15)) * U32s::splat(0x846c_a68b);
    x ^ (x >> 16)
}

/// Key of a dimension of the sequences with this key.
#[inline(always)]
pub(super) fn of_dimension(key: U32s, dimension: U32s) -> U32s {
    mix(key ^ (dimension * U32s::splat(0x9e37_79b1)))
}
