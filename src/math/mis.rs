//! Weights of multiple importance sampling.

use super::lanes::{Compare, F32s};

/// The power heuristic (exponent 2) for a sample taken with density `pdf` where the other technique
/// has `other`: pdf² / (pdf² + other²). Both in the same measure, ≥ 0. 0 if both are 0.
///
/// In ratio form, so that no square overflows or underflows; infinite densities count as the
/// largest finite one. Source: Veach, "Robust Monte Carlo Methods for Light Transport Simulation",
/// 1997, section 9.2.3.
#[inline(always)]
pub fn power_heuristic(pdf: F32s, other: F32s) -> F32s {
    let largest = F32s::splat(f32::MAX);
    let (pdf, other) = (pdf.fast_min(largest), other.fast_min(largest));
    let high = pdf.fast_max(other);
    let ratio = pdf.fast_min(other) / high;
    let one = F32s::splat(1.0);
    let weight_of_high = one / ratio.mul_add(ratio, one);
    let weight = pdf
        .ge(other)
        .select(weight_of_high, ratio * ratio * weight_of_high);
    // Also the guard of (0, 0), where the ratio is NaN.
    pdf.gt(F32s::splat(0.0)).select(weight, F32s::splat(0.0))
}

/// [`power_heuristic`] divided by `pdf`: what a sample taken with density `pdf` > 0 is multiplied by,
/// where the other technique has `other` ≥ 0. Two divisions instead of three.
#[inline(always)]
pub fn power_heuristic_over_pdf(pdf: F32s, other: F32s) -> F32s {
    let one = F32s::splat(1.0);
    // w / p = 1 / (p·(1 + (q / p)²)); where the square overflows, the quotient is 0 to f32's accuracy.
    let ratio = other / pdf;
    one / (pdf * ratio.mul_add(ratio, one))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weight(pdf: f32, other: f32) -> f64 {
        f64::from(power_heuristic(F32s::splat(pdf), F32s::splat(other)).to_array()[0])
    }

    #[test]
    fn weights_of_a_pair_sum_to_one_at_any_magnitude() {
        let pairs = [
            (1.0, 1.0),
            (1e20, 1e20),
            (1e30, 1.0),
            (f32::INFINITY, 1.0),
            (f32::INFINITY, f32::INFINITY),
            (1e-30, 1e-30),
            (3.0, 0.0),
            (0.4, 0.3),
        ];
        for (a, b) in pairs {
            assert!(
                (weight(a, b) + weight(b, a) - 1.0).abs() < 1e-6,
                "({a}, {b})"
            );
            assert!(weight(a, b) >= weight(b, a), "({a}, {b})");
        }
        assert_eq!(weight(0.0, 0.0), 0.0);
    }

    #[test]
    fn weights_are_those_of_the_squares() {
        for (a, b) in [(0.3f32, 0.4f32), (2.0, 7.0), (5.0, 0.1), (1.0, 1.0)] {
            let (x, y) = (f64::from(a), f64::from(b));
            assert!(
                (weight(a, b) - x * x / (x * x + y * y)).abs() < 2e-7,
                "({a}, {b})"
            );
        }
    }

    #[test]
    fn the_weight_over_the_density_is_their_quotient() {
        for (pdf, other) in [
            (1.0, 1.0),
            (0.4, 0.3),
            (3.0, 0.0),
            (1e-6, 1e6),
            (1e10, 1e-10),
            (1e20, 1e20),
        ] {
            let got = power_heuristic_over_pdf(F32s::splat(pdf), F32s::splat(other)).to_array()[0];
            let (p, q) = (f64::from(pdf), f64::from(other));
            let expected = p / (p * p + q * q);
            assert!(
                (f64::from(got) - expected).abs() <= 1e-6 * expected + 1e-37,
                "{pdf}, {other}: {got}"
            );
        }
    }
}
