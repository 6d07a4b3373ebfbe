//! Bounds of floating-point rounding, neighbouring floats, and the processor's treatment of denormals.

use super::lanes::{Compare, F32s, Mask, U32s, from_bits, to_bits};

/// Unit roundoff of f32: half the distance from 1 to the next float.
pub const UNIT_ROUNDOFF: f32 = f32::EPSILON / 2.0;

/// Higham's γ(n) = n·u/(1 − n·u), an upper bound of the relative error of `n` f32 roundings in a row
/// (Higham, *Accuracy and Stability of Numerical Algorithms*, section 3.1), itself rounded up.
pub const fn gamma(n: u32) -> f32 {
    let nu = n as f64 * UNIT_ROUNDOFF as f64;
    let exact = nu / (1.0 - nu);
    let rounded = exact as f32;
    if (rounded as f64) < exact {
        rounded.next_up()
    } else {
        rounded
    }
}

/// The next normal float towards +∞ per lane. Above −0 and +0 comes the smallest normal number, because
/// workers flush denormals; infinities and NaN stay.
#[inline(always)]
pub fn next_up(value: F32s) -> F32s {
    let bits = to_bits(value);
    let one = U32s::splat(1);
    let negative = value.lt(F32s::splat(0.0));
    let stepped = from_bits(negative.select_u32(bits - one, bits + one));
    let zero = value.abs().lt(F32s::splat(f32::MIN_POSITIVE));
    let finite = value.abs().lt(F32s::splat(f32::INFINITY));
    let stepped = zero.select(F32s::splat(f32::MIN_POSITIVE), stepped);
    finite.select(stepped, value)
}

/// The next normal float towards −∞ per lane; see [`next_up`].
#[inline(always)]
pub fn next_down(value: F32s) -> F32s {
    -next_up(-value)
}

/// `value` moved by one float in the direction of `towards` per lane: up where that is positive, down
/// where it is negative, unchanged where it is zero or NaN.
#[inline(always)]
pub fn next_outward(value: F32s, towards: F32s) -> F32s {
    let zero = F32s::splat(0.0);
    let up: Mask = towards.gt(zero);
    let down: Mask = towards.lt(zero);
    up.select(next_up(value), down.select(next_down(value), value))
}

/// Makes this thread treat denormal numbers as zero, in operands and results, from now on. Arithmetic on
/// denormals is about a hundred times slower than other arithmetic on x86; elsewhere this does nothing.
pub fn flush_denormals() {
    #[cfg(any(target_arch = "x86_64", target_arch = "x86"))]
    {
        #![expect(unsafe_code, reason = "the control register has no safe access")]
        /// MXCSR bits: flush results to zero (15), denormal operands are zero (6).
        const FLUSH: u32 = 1 << 15 | 1 << 6;
        let mut control = 0u32;
        // SAFETY: both instructions touch only MXCSR and the named local. Rust's own code does not
        // depend on the two bits beyond the values of denormals, which the kernels do not rely on.
        unsafe {
            std::arch::asm!("stmxcsr [{}]", in(reg) &mut control, options(nostack));
            control |= FLUSH;
            std::arch::asm!("ldmxcsr [{}]", in(reg) &control, options(nostack, readonly));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::LANES;

    fn splat_up(x: f32) -> f32 {
        next_up(F32s::splat(x)).to_array()[LANES - 1]
    }

    #[test]
    fn gamma_is_an_upper_bound_and_tight() {
        for n in 1..100 {
            let nu = f64::from(n) * 2f64.powi(-24);
            let exact = nu / (1.0 - nu);
            assert!(f64::from(gamma(n)) >= exact);
            assert!(f64::from(gamma(n)) <= exact * (1.0 + 2f64.powi(-22)));
        }
    }

    #[test]
    fn next_floats_agree_with_the_standard_library_on_normal_numbers() {
        for x in [
            1.0f32,
            -1.0,
            1.999_999_9,
            -2.0,
            3.4e38,
            f32::MAX,
            -f32::MAX,
            1e-30,
            -1e-30,
            2e7,
        ] {
            assert_eq!(splat_up(x), x.next_up());
            assert_eq!(next_down(F32s::splat(x)).to_array()[0], x.next_down());
        }
        assert_eq!(splat_up(0.0), f32::MIN_POSITIVE);
        assert_eq!(splat_up(-0.0), f32::MIN_POSITIVE);
        assert_eq!(splat_up(f32::INFINITY), f32::INFINITY);
        assert!(splat_up(f32::NAN).is_nan());
    }

    #[test]
    fn next_outward_follows_the_sign_of_the_offset() {
        let at = |value: f32, towards: f32| {
            next_outward(F32s::splat(value), F32s::splat(towards)).to_array()[0]
        };
        assert_eq!(at(5.0, 1e-20), 5f32.next_up());
        assert_eq!(at(-5.0, 1e-20), (-5f32).next_up());
        assert_eq!(at(5.0, -1e-20), 5f32.next_down());
        assert_eq!(at(5.0, 0.0), 5.0);
        assert_eq!(at(5.0, -0.0), 5.0);
        assert_eq!(at(5.0, f32::NAN), 5.0);
    }

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn denormals_are_flushed_in_the_thread_that_asks() {
        let half_of_smallest =
            || std::hint::black_box(f32::MIN_POSITIVE) * std::hint::black_box(0.5);
        let flushed = std::thread::spawn(move || {
            flush_denormals();
            half_of_smallest()
        });
        assert_eq!(flushed.join().expect("no panic"), 0.0);
        assert!(half_of_smallest() > 0.0);
    }
}
