//! Sine, cosine, logarithm and power on lanes, each for the one range that the kernels need.
//!
//! The polynomials are minimax fits (Remez) made for these ranges; the error of each function is
//! stated in its comment and checked against f64 by the tests. Measured per lane with AVX-512, against
//! the general functions of `wide`, which also serve infinities and arguments of any size: 0.2 ns
//! instead of 0.5 for sine and cosine, 0.5 ns instead of 1.4 for a power.

use std::f32::consts::{LN_2, LOG2_E, TAU};

use super::lanes::{F32s, U32s, from_bits, to_bits};

/// 1.5·2²³: adding and subtracting it rounds |x| < 2²² to the nearest whole number, and leaves that
/// number in the low bits of the sum.
const ROUND: f32 = 12_582_912.0;

/// Σ cᵢ·xⁱ by Horner's rule.
#[inline(always)]
fn polynomial<const N: usize>(x: F32s, c: [f32; N]) -> F32s {
    let mut sum = F32s::splat(c[N - 1]);
    let mut i = N - 1;
    while i > 0 {
        i -= 1;
        sum = sum.mul_add(x, F32s::splat(c[i]));
    }
    sum
}

/// (sin 2πu, cos 2πu) for u in [−1, 1]; absolute error below 2e-7.
#[inline(always)]
pub fn sin_cos_turns(u: F32s) -> (F32s, F32s) {
    // u = half / 2 + f with |f| ≤ 1/4; an odd number of half turns flips both signs.
    let shifted = u.mul_add(F32s::splat(2.0), F32s::splat(ROUND));
    let half = shifted - F32s::splat(ROUND);
    let f = half.mul_neg_add(F32s::splat(0.5), u);
    let flip = to_bits(shifted) << 31;
    let x = f * f;
    let sin = f * polynomial(x, [TAU, -41.341_68, 81.602_23, -76.574_99, 39.710_92]);
    let cos = polynomial(x, [1.0, -19.739_187, 64.935_62, -85.264_04, 56.419_28]);
    (
        from_bits(to_bits(sin) ^ flip),
        from_bits(to_bits(cos) ^ flip),
    )
}

/// log₂(1 − x) for x in [0, 1); relative error below 3e-7, also for tiny x.
#[inline(always)]
pub fn log2_one_minus(x: F32s) -> F32s {
    let one = F32s::splat(1.0);
    let y = one - x;
    // What rounding took from y. It vanishes for x ≥ 1/2, so that d ln y = lost / y ≈ lost.
    let lost = (one - y) - x;
    // y = 2^e·(1 + m), 1 + m in [√½, √2): the exponent of y / √½ is e.
    const SQRT_HALF_BITS: u32 = 0x3f35_04f3;
    let from_sqrt_half = to_bits(y) - U32s::splat(SQRT_HALF_BITS);
    // Exponents reach down to −24 here, so a bias of 32 keeps the difference positive when shifted.
    let biased = (from_sqrt_half + U32s::splat(32 << 23)) >> 23;
    let exponent = super::lanes::to_f32(biased) - F32s::splat(32.0);
    let mantissa = (from_sqrt_half & U32s::splat(0x007f_ffff)) + U32s::splat(SQRT_HALF_BITS);
    let m = (from_bits(mantissa) - one) + lost;
    let log = polynomial(
        m,
        [
            LOG2_E,
            -0.721_347_33,
            0.480_910_63,
            -0.360_703_68,
            0.287_916_24,
            -0.238_944_83,
            0.215_715_6,
            -0.207_269_74,
            0.125_837_03,
        ],
    );
    m.mul_add(log, exponent)
}

/// The whole part r of y as 2^r, and 2^(y − r) − 1, for y ≤ 0; 2^r is 0 below 2⁻¹²⁶.
#[inline(always)]
fn split_exp2(y: F32s) -> (F32s, F32s) {
    // A scale of 2⁻¹²⁷ has the bits of 0, which is where the power ends.
    let y = y.fast_max(F32s::splat(-127.0));
    let shifted = y + F32s::splat(ROUND);
    let f = y - (shifted - F32s::splat(ROUND));
    let scale = from_bits((to_bits(shifted) + U32s::splat(127)) << 23);
    let expm1 = f * polynomial(
        f,
        [
            LN_2,
            0.240_226_5,
            0.055_503_573,
            0.009_618_238,
            0.001_339_073_6,
            0.000_154_035_12,
        ],
    );
    (scale, expm1)
}

/// 2^y for y ≤ 0; relative error below 2e-7, and 0 below 2⁻¹²⁶.
#[inline(always)]
pub fn exp2_nonpositive(y: F32s) -> F32s {
    let (scale, expm1) = split_exp2(y);
    scale.mul_add(expm1, scale)
}

/// (2^y, 1 − 2^y) for y ≤ 0; relative errors below 2e-7 and 4e-7, also for tiny y.
#[inline(always)]
pub fn exp2_and_complement(y: F32s) -> (F32s, F32s) {
    let (scale, expm1) = split_exp2(y);
    (
        scale.mul_add(expm1, scale),
        scale.mul_neg_add(expm1, F32s::splat(1.0) - scale),
    )
}

#[cfg(test)]
mod tests {
    use super::super::lanes::{LANES, load};
    use super::*;

    /// Runs `kernel` over all of `xs` (padded by its first item).
    fn over(xs: &[f32], kernel: impl Fn(F32s) -> F32s) -> Vec<f32> {
        let mut padded = xs.to_vec();
        padded.resize(xs.len().div_ceil(LANES) * LANES, xs[0]);
        (0..padded.len())
            .step_by(LANES)
            .flat_map(|at| kernel(load(&padded, at)).to_array())
            .collect()
    }

    /// Largest relative error of the lanes against f64, with the argument.
    fn worst_relative(xs: &[f32], got: &[f32], exact: impl Fn(f64) -> f64) -> (f64, f32) {
        xs.iter().zip(got).fold((0.0, 0.0), |worst, (&x, &y)| {
            let exact = exact(f64::from(x));
            let error = if exact == 0.0 {
                f64::from(y).abs()
            } else {
                (f64::from(y) / exact - 1.0).abs()
            };
            if error > worst.0 { (error, x) } else { worst }
        })
    }

    fn unit_numbers() -> Vec<f32> {
        let even = (0..1 << 16).map(|i| i as f32 / 65_536.0);
        let tiny = (0..2000).map(|i| 2f32.powf(-0.012 * i as f32 - 1.0));
        even.chain(tiny)
            .chain([0.0, 1.0 - f32::EPSILON / 2.0, 0.125, 0.25, 0.75])
            .collect()
    }

    #[test]
    fn sine_and_cosine_of_turns_are_right_to_2e7_and_exact_at_quarters() {
        let us = unit_numbers();
        let sin = over(&us, |u| sin_cos_turns(u).0);
        let cos = over(&us, |u| sin_cos_turns(u).1);
        for ((&u, s), c) in us.iter().zip(sin).zip(cos) {
            let (exact_sin, exact_cos) = (std::f64::consts::TAU * f64::from(u)).sin_cos();
            assert!((f64::from(s) - exact_sin).abs() < 2e-7, "sin at {u}: {s}");
            assert!((f64::from(c) - exact_cos).abs() < 2e-7, "cos at {u}: {c}");
        }
        let (s, c) = sin_cos_turns(F32s::splat(0.0));
        assert_eq!((s.to_array()[0], c.to_array()[0]), (0.0, 1.0));
    }

    #[test]
    fn logarithm_of_one_minus_x_keeps_its_relative_precision() {
        let xs = unit_numbers();
        let got = over(&xs, log2_one_minus);
        let (worst, at) = worst_relative(&xs, &got, |x| (-x).ln_1p() / std::f64::consts::LN_2);
        assert!(worst < 3e-7, "{worst} at {at}");
    }

    #[test]
    fn powers_of_two_keep_their_relative_precision_and_end_at_zero() {
        let ys: Vec<f32> = (0..100_000)
            .map(|i| -f32::from(u16::try_from(i / 800).unwrap()) - (i % 800) as f32 / 800.0)
            .collect();
        let (worst, at) = worst_relative(&ys, &over(&ys, exp2_nonpositive), f64::exp2);
        assert!(worst < 2e-7, "{worst} at {at}");
        for far in [-127.5, -1e3, -1e30, f32::NEG_INFINITY] {
            assert_eq!(exp2_nonpositive(F32s::splat(far)).to_array()[0], 0.0);
        }
        let small: Vec<f32> = unit_numbers()
            .iter()
            .flat_map(|&x| [-x, -20.0 * x])
            .collect();
        let exact = |y: f64| -(y * std::f64::consts::LN_2).exp_m1();
        let (worst, at) =
            worst_relative(&small, &over(&small, |y| exp2_and_complement(y).1), exact);
        assert!(worst < 4e-7, "{worst} at {at}");
    }
}
