//! The lane types of every kernel: thin names over `wide`, with masks in mask registers where the
//! build has AVX-512. The lane width is chosen here and nowhere else.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

use wide::f32x8;

#[cfg(target_feature = "avx512f")]
mod width {
    /// Rays per lane kernel step.
    pub const LANES: usize = 16;
    /// `LANES` × f32.
    pub type F32s = wide::f32x16;
    /// `LANES` × u32.
    pub type U32s = wide::u32x16;
}

#[cfg(not(target_feature = "avx512f"))]
mod width {
    /// Rays per lane kernel step.
    pub const LANES: usize = 8;
    /// `LANES` × f32.
    pub type F32s = wide::f32x8;
    /// `LANES` × u32.
    pub type U32s = wide::u32x8;
}

pub use width::{F32s, LANES, U32s};

/// `n` rounded up to whole lanes.
pub const fn padded(n: usize) -> usize {
    n.div_ceil(LANES) * LANES
}

/// One bit per lane, lane 0 lowest. Bits past [`LANES`] are zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(transparent)]
pub struct Mask(pub u16);

impl Mask {
    /// No lane.
    pub const NONE: Self = Self(0);
    /// Every lane.
    pub const ALL: Self = Self((u32::MAX >> (32 - LANES as u32)) as u16);

    /// The first `n` lanes (all of them if `n ≥ LANES`).
    #[inline(always)]
    pub fn first(n: usize) -> Self {
        if n >= LANES {
            Self::ALL
        } else {
            Self((1u16 << n) - 1)
        }
    }

    /// Whether some lane is set.
    #[inline(always)]
    pub fn any(self) -> bool {
        self.0 != 0
    }

    /// Whether no lane is set.
    #[inline(always)]
    pub fn none(self) -> bool {
        self.0 == 0
    }

    /// Number of lanes set.
    #[inline(always)]
    pub fn count(self) -> usize {
        self.0.count_ones() as usize
    }

    /// Whether `lane` is set.
    #[inline(always)]
    pub fn test(self, lane: usize) -> bool {
        self.0 >> lane & 1 != 0
    }

    /// Lane numbers that are set, ascending.
    #[inline(always)]
    pub fn lanes(self) -> impl Iterator<Item = usize> {
        let mut bits = self.0;
        std::iter::from_fn(move || {
            (bits != 0).then(|| {
                let lane = bits.trailing_zeros() as usize;
                bits &= bits - 1;
                lane
            })
        })
    }

    /// `yes` where set, else `no`.
    #[inline(always)]
    pub fn select(self, yes: F32s, no: F32s) -> F32s {
        imp::select_f32(self, yes, no)
    }

    /// `yes` where set, else `no`.
    #[inline(always)]
    pub fn select_u32(self, yes: U32s, no: U32s) -> U32s {
        imp::select_u32(self, yes, no)
    }
}

impl BitAnd for Mask {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, rhs: Self) -> Self {
        Self(self.0 & rhs.0)
    }
}

impl BitOr for Mask {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, rhs: Self) -> Self {
        Self(self.0 | rhs.0)
    }
}

impl Not for Mask {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(!self.0 & Self::ALL.0)
    }
}

/// Comparisons of f32 lanes that give a [`Mask`]; a NaN on either side compares false
/// (except in [`Self::ne`], where it compares true).
pub trait Compare: Copy {
    /// Lane-wise `self < rhs`.
    fn lt(self, rhs: Self) -> Mask;
    /// Lane-wise `self <= rhs`.
    fn le(self, rhs: Self) -> Mask;
    /// Lane-wise `self == rhs`.
    fn eq(self, rhs: Self) -> Mask;
    /// Lane-wise `self > rhs`.
    #[inline(always)]
    fn gt(self, rhs: Self) -> Mask {
        rhs.lt(self)
    }
    /// Lane-wise `self >= rhs`.
    #[inline(always)]
    fn ge(self, rhs: Self) -> Mask {
        rhs.le(self)
    }
    /// Lane-wise `self != rhs`.
    #[inline(always)]
    fn ne(self, rhs: Self) -> Mask {
        !self.eq(rhs)
    }
}

impl Compare for F32s {
    #[inline(always)]
    fn lt(self, rhs: Self) -> Mask {
        imp::lt_f32(self, rhs)
    }
    #[inline(always)]
    fn le(self, rhs: Self) -> Mask {
        imp::le_f32(self, rhs)
    }
    #[inline(always)]
    fn eq(self, rhs: Self) -> Mask {
        imp::eq_f32(self, rhs)
    }
}

impl Compare for U32s {
    #[inline(always)]
    fn lt(self, rhs: Self) -> Mask {
        imp::lt_u32(self, rhs)
    }
    #[inline(always)]
    fn le(self, rhs: Self) -> Mask {
        !imp::lt_u32(rhs, self)
    }
    #[inline(always)]
    fn eq(self, rhs: Self) -> Mask {
        imp::eq_u32(self, rhs)
    }
}

#[cfg(target_feature = "avx512f")]
impl Compare for f32x8 {
    #[inline(always)]
    fn lt(self, rhs: Self) -> Mask {
        Mask(self.simd_lt(rhs).to_bitmask() as u16)
    }
    #[inline(always)]
    fn le(self, rhs: Self) -> Mask {
        Mask(self.simd_le(rhs).to_bitmask() as u16)
    }
    #[inline(always)]
    fn eq(self, rhs: Self) -> Mask {
        Mask(self.simd_eq(rhs).to_bitmask() as u16)
    }
}

/// f32 lanes of a width that kernels are compiled for: [`F32s`], and eight where that is faster.
pub trait FloatLanes:
    Compare
    + bytemuck::Pod
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
{
    /// The same number in every lane.
    fn splat(value: f32) -> Self;
    /// Lane-wise size.
    fn abs(self) -> Self;
    /// `self * factor + term`, rounded once where the build has such instructions.
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// `term - self * factor`, rounded as in [`Self::mul_add`].
    fn mul_neg_add(self, factor: Self, term: Self) -> Self;
    /// `self * factor - term`, rounded as in [`Self::mul_add`].
    fn mul_sub(self, factor: Self, term: Self) -> Self;
    /// Lanes in which `self` is negative, or is positive and `other` is negative. One mask is made, not three.
    fn negative_or_with(self, other: Self) -> Mask;
    /// Lane-wise smaller number; either where one is NaN.
    fn fast_min(self, rhs: Self) -> Self;
    /// Lane-wise larger number; either where one is NaN.
    fn fast_max(self, rhs: Self) -> Self;
    /// Lane-wise smaller number; `kept` where `self` is NaN.
    fn keep_min(self, kept: Self) -> Self;
    /// Lane-wise larger number; `kept` where `self` is NaN.
    fn keep_max(self, kept: Self) -> Self;
}

macro_rules! float_lanes {
    ($($lanes:ty),*) => {
        $(impl FloatLanes for $lanes {
            #[inline(always)]
            fn splat(value: f32) -> Self {
                Self::splat(value)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                self.abs()
            }
            #[inline(always)]
            fn mul_add(self, factor: Self, term: Self) -> Self {
                self.mul_add(factor, term)
            }
            #[inline(always)]
            fn mul_neg_add(self, factor: Self, term: Self) -> Self {
                self.mul_neg_add(factor, term)
            }
            #[inline(always)]
            fn mul_sub(self, factor: Self, term: Self) -> Self {
                self.mul_sub(factor, term)
            }
            #[inline(always)]
            fn negative_or_with(self, other: Self) -> Mask {
                let zero = Self::splat(0.0);
                let lanes = self.simd_lt(zero) | (self.simd_gt(zero) & other.simd_lt(zero));
                Mask(lanes.to_bitmask() as u16)
            }
            #[inline(always)]
            fn fast_min(self, rhs: Self) -> Self {
                self.fast_min(rhs)
            }
            #[inline(always)]
            fn fast_max(self, rhs: Self) -> Self {
                self.fast_max(rhs)
            }
            // The x86 instruction gives its second operand when either is NaN; other machines take the other
            // NaN rule.
            #[inline(always)]
            fn keep_min(self, kept: Self) -> Self {
                if cfg!(any(target_arch = "x86_64", target_arch = "x86")) {
                    self.fast_min(kept)
                } else {
                    self.min(kept)
                }
            }
            #[inline(always)]
            fn keep_max(self, kept: Self) -> Self {
                if cfg!(any(target_arch = "x86_64", target_arch = "x86")) {
                    self.fast_max(kept)
                } else {
                    self.max(kept)
                }
            }
        })*
    };
}

float_lanes!(f32x8);
#[cfg(target_feature = "avx512f")]
float_lanes!(F32s);

/// The lanes at `column[at .. at + LANES]`.
///
/// # Panics
/// If the column ends before.
#[inline(always)]
pub fn load(column: &[f32], at: usize) -> F32s {
    // Read as bytes: a by-value array of lanes is taken apart on the stack in some kernels.
    bytemuck::pod_read_unaligned(bytemuck::cast_slice(&column[at..at + LANES]))
}

/// As [`load`], for u32.
#[inline(always)]
pub fn load_u32(column: &[u32], at: usize) -> U32s {
    bytemuck::pod_read_unaligned(bytemuck::cast_slice(&column[at..at + LANES]))
}

/// The lanes of `first` (the first so many) at `column[at ..]`; zero elsewhere.
///
/// # Panics
/// If `column` ends before `at + LANES`.
#[inline(always)]
pub fn load_first(column: &[f32], at: usize, first: Mask) -> F32s {
    imp::load_first(&column[at..at + LANES], first)
}

/// Writes `column[at .. at + LANES]`.
#[inline(always)]
pub fn store(column: &mut [f32], at: usize, value: F32s) {
    *chunk(column, at) = bytemuck::cast(value);
}

/// As [`store`], for u32.
#[inline(always)]
pub fn store_u32(column: &mut [u32], at: usize, value: U32s) {
    *chunk(column, at) = bytemuck::cast(value);
}

/// `column[at .. at + LANES]` as an array.
#[inline(always)]
fn chunk<T>(column: &mut [T], at: usize) -> &mut [T; LANES] {
    (&mut column[at..at + LANES])
        .try_into()
        .expect("slice has LANES items")
}

/// Writes the lanes of `mask`, in order and without gaps, from `column[at]` on. May overwrite all
/// of `column[at .. at + LANES]`.
#[inline(always)]
pub fn compress(column: &mut [f32], at: usize, mask: Mask, value: F32s) {
    imp::compress_f32(chunk(column, at), mask, value);
}

/// As [`compress`], for u32.
#[inline(always)]
pub fn compress_u32(column: &mut [u32], at: usize, mask: Mask, value: U32s) {
    imp::compress_u32(chunk(column, at), mask, value);
}

/// `column[index]` per lane; an index past the end reads the last item.
///
/// # Panics
/// If the column is empty.
#[inline(always)]
pub fn gather(column: &[f32], index: U32s) -> F32s {
    assert!(!column.is_empty());
    imp::gather_f32(column, clamp_index(index, column.len()))
}

/// As [`gather`], for u32.
#[inline(always)]
pub fn gather_u32(column: &[u32], index: U32s) -> U32s {
    assert!(!column.is_empty());
    imp::gather_u32(column, clamp_index(index, column.len()))
}

/// As [`gather`], for u64.
///
/// # Panics
/// If the column is empty.
#[inline(always)]
pub fn gather_u64(column: &[u64], index: U32s) -> [u64; LANES] {
    assert!(!column.is_empty());
    imp::gather_u64(column, clamp_index(index, column.len()))
}

/// As [`compress`], for u64.
#[inline(always)]
pub fn compress_u64(column: &mut [u64], at: usize, mask: Mask, value: [u64; LANES]) {
    imp::compress_u64(chunk(column, at), mask, value);
}

#[inline(always)]
fn clamp_index(index: U32s, len: usize) -> U32s {
    // Columns longer than 2^31 items do not exist: primitive and path indices are 31-bit at most.
    index.min(U32s::splat(u32::try_from(len - 1).unwrap_or(u32::MAX)))
}

/// 0, 1, 2, …
#[inline(always)]
pub fn iota() -> U32s {
    let mut lanes = [0u32; LANES];
    let mut i = 0;
    while i < LANES {
        lanes[i] = i as u32;
        i += 1;
    }
    U32s::from(lanes)
}

/// The bits of f32 lanes as u32 lanes.
#[inline(always)]
pub fn to_bits(value: F32s) -> U32s {
    bytemuck::cast(value)
}

/// f32 lanes from their bits.
#[inline(always)]
pub fn from_bits(value: U32s) -> F32s {
    bytemuck::cast(value)
}

/// u32 lanes below 2^24 as f32, exactly.
#[inline(always)]
pub fn to_f32(value: U32s) -> F32s {
    imp::to_f32(value)
}

/// f32 lanes in [0, 2^31) truncated to u32.
#[inline(always)]
pub fn to_u32(value: F32s) -> U32s {
    imp::to_u32(value)
}

#[cfg(target_feature = "avx512f")]
mod imp {
    //! AVX-512: masks live in mask registers.
    #![expect(
        unsafe_code,
        reason = "gathers and compressed stores have no safe form"
    )]

    use std::arch::x86_64::*;

    use super::{F32s, LANES, Mask, U32s};

    // These intrinsics touch registers only; the build enables avx512f for the whole crate.
    #[inline(always)]
    pub(super) fn lt_f32(a: F32s, b: F32s) -> Mask {
        // SAFETY: avx512f is enabled at compile time by this module's `cfg`.
        Mask(unsafe { _mm512_cmp_ps_mask::<_CMP_LT_OQ>(a.into(), b.into()) })
    }
    #[inline(always)]
    pub(super) fn le_f32(a: F32s, b: F32s) -> Mask {
        // SAFETY: as above.
        Mask(unsafe { _mm512_cmp_ps_mask::<_CMP_LE_OQ>(a.into(), b.into()) })
    }
    #[inline(always)]
    pub(super) fn eq_f32(a: F32s, b: F32s) -> Mask {
        // SAFETY: as above.
        Mask(unsafe { _mm512_cmp_ps_mask::<_CMP_EQ_OQ>(a.into(), b.into()) })
    }
    #[inline(always)]
    pub(super) fn lt_u32(a: U32s, b: U32s) -> Mask {
        // SAFETY: as above.
        Mask(unsafe { _mm512_cmplt_epu32_mask(a.into(), b.into()) })
    }
    #[inline(always)]
    pub(super) fn eq_u32(a: U32s, b: U32s) -> Mask {
        // SAFETY: as above.
        Mask(unsafe { _mm512_cmpeq_epi32_mask(a.into(), b.into()) })
    }
    #[inline(always)]
    pub(super) fn select_f32(m: Mask, yes: F32s, no: F32s) -> F32s {
        // SAFETY: as above.
        unsafe { _mm512_mask_blend_ps(m.0, no.into(), yes.into()) }.into()
    }
    #[inline(always)]
    pub(super) fn select_u32(m: Mask, yes: U32s, no: U32s) -> U32s {
        // SAFETY: as above.
        unsafe { _mm512_mask_blend_epi32(m.0, no.into(), yes.into()) }.into()
    }
    #[inline(always)]
    pub(super) fn to_f32(v: U32s) -> F32s {
        // SAFETY: as above.
        unsafe { _mm512_cvtepi32_ps(v.into()) }.into()
    }
    #[inline(always)]
    pub(super) fn to_u32(v: F32s) -> U32s {
        // SAFETY: as above.
        unsafe { _mm512_cvttps_epi32(v.into()) }.into()
    }
    #[inline(always)]
    pub(super) fn load_first(from: &[f32], m: Mask) -> F32s {
        debug_assert_eq!(from.len(), LANES);
        // SAFETY: as above; the caller's slice has all lanes.
        unsafe { _mm512_maskz_loadu_ps(m.0, from.as_ptr()) }.into()
    }
    #[inline(always)]
    pub(super) fn compress_f32(out: &mut [f32; LANES], m: Mask, v: F32s) {
        // Compress in a register and store whole: the store form of compress is slow on some CPUs.
        // SAFETY: as above.
        *out = F32s::from(unsafe { _mm512_maskz_compress_ps(m.0, v.into()) }).to_array();
    }
    #[inline(always)]
    pub(super) fn compress_u32(out: &mut [u32; LANES], m: Mask, v: U32s) {
        // SAFETY: as above.
        *out = U32s::from(unsafe { _mm512_maskz_compress_epi32(m.0, v.into()) }).to_array();
    }
    #[inline(always)]
    pub(super) fn compress_u64(out: &mut [u64; LANES], m: Mask, v: [u64; LANES]) {
        let [low, high]: [wide::u64x8; 2] = bytemuck::cast(v);
        let low_mask = m.0 as u8;
        // SAFETY: as above.
        let packed = unsafe {
            [
                _mm512_maskz_compress_epi64(low_mask, low.into()),
                _mm512_maskz_compress_epi64((m.0 >> 8) as u8, high.into()),
            ]
        };
        let [low, high] = packed.map(|half| wide::u64x8::from(half).to_array());
        let at = low_mask.count_ones() as usize;
        out[..8].copy_from_slice(&low);
        out[at..at + 8].copy_from_slice(&high);
    }
    #[inline(always)]
    pub(super) fn gather_u64(column: &[u64], index: U32s) -> [u64; LANES] {
        let halves: [wide::u32x8; 2] = bytemuck::cast(index);
        let gathered = halves.map(|half| {
            // SAFETY: the caller clamped every index below `column.len()`, and lengths fit i32.
            wide::u64x8::from(unsafe {
                _mm512_i32gather_epi64::<8>(half.into(), column.as_ptr().cast())
            })
        });
        bytemuck::cast(gathered)
    }
    #[inline(always)]
    pub(super) fn gather_f32(column: &[f32], index: U32s) -> F32s {
        // SAFETY: the caller clamped every index below `column.len()`, and lengths fit i32.
        unsafe { _mm512_i32gather_ps::<4>(index.into(), column.as_ptr()) }.into()
    }
    #[inline(always)]
    pub(super) fn gather_u32(column: &[u32], index: U32s) -> U32s {
        // SAFETY: the caller clamped every index below `column.len()`, and lengths fit i32.
        unsafe { _mm512_i32gather_epi32::<4>(index.into(), column.as_ptr().cast()) }.into()
    }
}

#[cfg(not(target_feature = "avx512f"))]
mod imp {
    //! Any machine: `wide` picks AVX, SSE, NEON or plain scalar code.

    use super::{F32s, LANES, Mask, U32s};

    #[inline(always)]
    fn mask_of(vector: F32s) -> Mask {
        Mask(vector.to_bitmask() as u16)
    }
    #[inline(always)]
    pub(super) fn lt_f32(a: F32s, b: F32s) -> Mask {
        mask_of(a.simd_lt(b))
    }
    #[inline(always)]
    pub(super) fn le_f32(a: F32s, b: F32s) -> Mask {
        mask_of(a.simd_le(b))
    }
    #[inline(always)]
    pub(super) fn eq_f32(a: F32s, b: F32s) -> Mask {
        mask_of(a.simd_eq(b))
    }
    #[inline(always)]
    pub(super) fn lt_u32(a: U32s, b: U32s) -> Mask {
        Mask(a.simd_lt(b).to_bitmask() as u16)
    }
    #[inline(always)]
    pub(super) fn eq_u32(a: U32s, b: U32s) -> Mask {
        Mask(a.simd_eq(b).to_bitmask() as u16)
    }
    /// All bits set in the lanes of the mask.
    #[inline(always)]
    fn vector_of(m: Mask) -> U32s {
        let mut bits = [0u32; LANES];
        let mut i = 0;
        while i < LANES {
            bits[i] = 1 << i;
            i += 1;
        }
        let bits = U32s::from(bits);
        (U32s::splat(u32::from(m.0)) & bits).simd_eq(bits)
    }
    #[inline(always)]
    pub(super) fn select_f32(m: Mask, yes: F32s, no: F32s) -> F32s {
        bytemuck::cast(select_u32(m, bytemuck::cast(yes), bytemuck::cast(no)))
    }
    #[inline(always)]
    pub(super) fn select_u32(m: Mask, yes: U32s, no: U32s) -> U32s {
        vector_of(m).bitselect(yes, no)
    }
    #[inline(always)]
    pub(super) fn to_f32(v: U32s) -> F32s {
        F32s::from(v.to_array().map(|x| x as f32))
    }
    #[inline(always)]
    pub(super) fn to_u32(v: F32s) -> U32s {
        U32s::from(v.to_array().map(|x| x as u32))
    }
    #[inline(always)]
    pub(super) fn load_first(from: &[f32], m: Mask) -> F32s {
        select_f32(m, super::load(from, 0), F32s::splat(0.0))
    }
    #[inline(always)]
    pub(super) fn compress_f32(out: &mut [f32; LANES], m: Mask, v: F32s) {
        let lanes = v.to_array();
        for (slot, lane) in out.iter_mut().zip(m.lanes()) {
            *slot = lanes[lane];
        }
    }
    #[inline(always)]
    pub(super) fn compress_u32(out: &mut [u32; LANES], m: Mask, v: U32s) {
        let lanes = v.to_array();
        for (slot, lane) in out.iter_mut().zip(m.lanes()) {
            *slot = lanes[lane];
        }
    }
    #[inline(always)]
    pub(super) fn compress_u64(out: &mut [u64; LANES], m: Mask, v: [u64; LANES]) {
        for (slot, lane) in out.iter_mut().zip(m.lanes()) {
            *slot = v[lane];
        }
    }
    #[inline(always)]
    pub(super) fn gather_u64(column: &[u64], index: U32s) -> [u64; LANES] {
        index.to_array().map(|i| column[i as usize])
    }
    #[inline(always)]
    pub(super) fn gather_f32(column: &[f32], index: U32s) -> F32s {
        F32s::from(index.to_array().map(|i| column[i as usize]))
    }
    #[inline(always)]
    pub(super) fn gather_u32(column: &[u32], index: U32s) -> U32s {
        U32s::from(index.to_array().map(|i| column[i as usize]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp() -> F32s {
        to_f32(iota())
    }

    #[test]
    fn comparisons_with_nan_are_false_and_masks_match_scalar_code() {
        let mut a = ramp().to_array();
        a[1] = f32::NAN;
        a[2] = f32::INFINITY;
        let b = F32s::splat(2.0);
        let va = F32s::from(a);
        for (lane, &x) in a.iter().enumerate() {
            assert_eq!(va.lt(b).test(lane), x < 2.0);
            assert_eq!(va.le(b).test(lane), x <= 2.0);
            assert_eq!(va.gt(b).test(lane), x > 2.0);
            assert_eq!(va.ge(b).test(lane), x >= 2.0);
            assert_eq!(Compare::eq(va, b).test(lane), x == 2.0);
            assert_eq!(Compare::ne(va, b).test(lane), x != 2.0);
        }
    }

    #[test]
    fn compress_keeps_order_and_gather_clamps() {
        let mask = Mask(0b1010_0110);
        let mut out = vec![-1.0; 2 * LANES];
        compress(&mut out, 3, mask, ramp());
        assert_eq!(out[3..7], [1.0, 2.0, 5.0, 7.0]);
        let wide: [u64; LANES] = std::array::from_fn(|lane| (lane as u64) << 40);
        let mut out = vec![1; 2 * LANES];
        for bits in (0..=u16::MAX >> (16 - LANES)).step_by(37) {
            compress_u64(&mut out, 2, Mask(bits), wide);
            let expected: Vec<u64> = Mask(bits).lanes().map(|lane| wide[lane]).collect();
            assert_eq!(out[2..2 + expected.len()], expected);
        }
        let got = gather_u64(&wide[..5], iota());
        assert!((0..LANES).all(|lane| got[lane] == wide[lane.min(4)]));
        let column: Vec<f32> = (0..5).map(|i| i as f32 * 10.0).collect();
        let got = gather(&column, iota()).to_array();
        for (lane, value) in got.into_iter().enumerate() {
            assert_eq!(value, 10.0 * lane.min(4) as f32);
        }
    }

    #[test]
    fn select_and_counts_follow_bits() {
        let mask = Mask(0b1001);
        assert_eq!(mask.count(), 2);
        assert_eq!(mask.lanes().collect::<Vec<_>>(), [0, 3]);
        let picked = mask.select(F32s::splat(1.0), F32s::splat(0.0)).to_array();
        assert_eq!(picked[0] + picked[3], 2.0);
        assert_eq!(picked.iter().sum::<f32>(), 2.0);
        assert_eq!((!mask).count(), LANES - 2);
        assert_eq!(Mask::first(LANES + 3), Mask::ALL);
    }

    fn kept<V: FloatLanes>() -> [bool; 4] {
        let (two, three, nan) = (V::splat(2.0), V::splat(3.0), V::splat(f32::NAN));
        [
            (nan.keep_max(two), two),
            (nan.keep_min(two), two),
            (three.keep_max(two), three),
            (three.keep_min(two), two),
        ]
        .map(|(value, expected)| Compare::eq(value, expected) == Mask::first(size_of::<V>() / 4))
    }

    #[test]
    fn minimum_and_maximum_keep_their_second_operand_where_the_first_is_nan() {
        assert_eq!(kept::<F32s>(), [true; 4]);
        assert_eq!(kept::<f32x8>(), [true; 4]);
    }
}
