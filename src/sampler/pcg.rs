//! PCG32 (XSH-RR 64/32, O'Neill 2014) in lanes: every lane's stream equals `rand_pcg::Pcg32`'s bit
//! for bit, and any number of steps is skipped with one multiply-add (Brown 1994).

use wide::{ShuffleExt, u64x8};

use crate::math::F32s;
use crate::math::lanes::{LANES, U32s, to_f32};

/// The LCG's multiplier, as PCG32 has it.
const MULTIPLIER: u64 = 6_364_136_223_846_793_005;
/// The stream that all paths use; their states are hashed far apart in its period of 2^64.
pub const STREAM: u64 = 0x0a02_bdbf_7bb3_c0a7;
/// The LCG's increment of that stream.
const INCREMENT: u64 = (STREAM << 1) | 1;

/// `LANES` × u64 as registers of eight.
const REGISTERS: usize = LANES / 8;

/// Constants (a, c) with which `state·a + c` advances a state by `steps`.
const fn jump(steps: u32) -> (u64, u64) {
    let (mut a, mut c) = (1u64, 0u64);
    let mut i = 0;
    while i < steps {
        a = a.wrapping_mul(MULTIPLIER);
        c = c.wrapping_mul(MULTIPLIER).wrapping_add(INCREMENT);
        i += 1;
    }
    (a, c)
}

/// One generator per lane, standing at some dimension of its path.
#[derive(Debug, Clone, Copy)]
pub struct Pcg32s {
    state: [u64x8; REGISTERS],
}

/// A 64-bit finaliser with full avalanche (Stafford's variant 13 of the MurmurHash3 mixer).
#[inline(always)]
fn mix(x: u64x8) -> u64x8 {
    let x = (x ^ (x >> 30)) * u64x8::splat(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)) * u64x8::splat(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// The scalar form of [`mix`].
fn mix_scalar(x: u64) -> u64 {
    mix(u64x8::splat(x)).to_array()[0]
}

/// The state that `Pcg32::new` is given for a sample of a pixel.
pub fn path_key(seed: u64, pixel: u32, sample: u64) -> u64 {
    mix_scalar(seed_key(seed) ^ (u64::from(pixel) << 32) ^ mix_scalar(sample ^ (sample >> 32)))
}

/// A seed spread over 64 bits.
fn seed_key(seed: u64) -> u64 {
    mix_scalar(seed.wrapping_add(0x9e37_79b9_7f4a_7c15))
}

/// The 32-bit halves of 64-bit lanes, low before high.
#[inline(always)]
fn halves(lanes: [u64x8; REGISTERS]) -> [U32s; 2] {
    bytemuck::cast(lanes)
}

impl Pcg32s {
    /// The generators of (seed, pixel, sample), at dimension 0. `sample` is the lane's offset from
    /// `first_sample`.
    #[inline(always)]
    pub fn for_paths(seed: u64, pixel: U32s, first_sample: u64, sample: U32s) -> Self {
        let key = u64x8::splat(seed_key(seed));
        let widen = |lanes: U32s| -> [u64x8; REGISTERS] {
            bytemuck::cast::<U32s, [[u32; 8]; REGISTERS]>(lanes).map(|r| r.map(u64::from).into())
        };
        let mut state = widen(sample);
        for (state, pixel) in state.iter_mut().zip(widen(pixel)) {
            let sample = *state + u64x8::splat(first_sample);
            let start = mix(key ^ (pixel << 32) ^ mix(sample ^ (sample >> 32)));
            // As `Pcg32::new` does: add the increment, then one step.
            *state = (start + u64x8::splat(INCREMENT)) * u64x8::splat(MULTIPLIER)
                + u64x8::splat(INCREMENT);
        }
        Self { state }
    }

    /// Continues from stored states.
    #[inline(always)]
    pub fn from_states(states: [u64; LANES]) -> Self {
        Self {
            state: bytemuck::cast(states),
        }
    }

    /// The states, to store.
    #[inline(always)]
    pub fn states(self) -> [u64; LANES] {
        bytemuck::cast(self.state)
    }

    /// The generators `STEPS` dimensions further on.
    #[inline(always)]
    #[must_use]
    pub fn skip<const STEPS: u32>(self) -> Self {
        let (a, c) = const { jump(STEPS) };
        Self {
            state: self.state.map(|s| s * u64x8::splat(a) + u64x8::splat(c)),
        }
    }

    /// The next 32 bits.
    #[inline(always)]
    pub fn next_u32(&mut self) -> U32s {
        let mixed: [u64x8; REGISTERS] = self.state.map(|s| ((s >> 18) ^ s) >> 27);
        let low = std::array::from_fn::<u32, LANES, _>(|lane| 2 * lane as u32);
        let high = low.map(|index| index + 1);
        let x = halves(mixed).shuffle(U32s::from(low));
        let turn = halves(self.state).shuffle(U32s::from(high)) >> 27;
        *self = self.skip::<1>();
        (x >> turn) | (x << ((U32s::splat(32) - turn) & U32s::splat(31)))
    }

    /// The next number, uniform in [0, 1): 24 random bits, so never rounded up to 1.
    #[inline(always)]
    pub fn next_f32(&mut self) -> F32s {
        to_f32(self.next_u32() >> 8) * F32s::splat(1.0 / 16_777_216.0)
    }

    /// Generators unrelated to these, for the second branch of a split path.
    #[inline(always)]
    #[must_use]
    pub fn branch(self) -> Self {
        self.salted(0xd1b5_4a32_d192_ed03)
    }

    /// Generators unrelated to these and to those of any other `i` ≥ 1, for another use of the same
    /// dimensions.
    #[inline(always)]
    #[must_use]
    pub fn fork(self, i: u32) -> Self {
        self.salted(u64::from(i).wrapping_mul(0x9e37_79b9_7f4a_7c15))
    }

    /// Generators at a hash of these states and `salt`.
    #[inline(always)]
    fn salted(self, salt: u64) -> Self {
        Self {
            state: self.state.map(|s| mix(s ^ u64x8::splat(salt))),
        }
    }
}

#[cfg(test)]
mod tests {
    use rand_core::Rng;
    use rand_pcg::Pcg32;

    use super::*;
    use crate::math::lanes::iota;

    #[test]
    fn lanes_equal_rand_pcg_bit_for_bit() {
        for (seed, pixel, first) in [
            (0, 0, 0),
            (1, 639_999, 48),
            (u64::MAX, u32::MAX - 20, 1 << 40),
        ] {
            let pixels = U32s::splat(pixel) + iota();
            let mut lanes = Pcg32s::for_paths(seed, pixels, first, iota() * U32s::splat(3));
            let mut scalar: Vec<Pcg32> = (0..LANES as u32)
                .map(|i| Pcg32::new(path_key(seed, pixel + i, first + 3 * u64::from(i)), STREAM))
                .collect();
            for _ in 0..100 {
                let got = lanes.next_u32().to_array();
                for (lane, generator) in scalar.iter_mut().enumerate() {
                    assert_eq!(got[lane], generator.next_u32());
                }
            }
        }
    }

    #[test]
    fn skipping_equals_drawing_and_states_survive_storage() {
        let mut drawn = Pcg32s::for_paths(7, iota(), 0, U32s::splat(5));
        let mut skipped = Pcg32s::from_states(drawn.skip::<13>().states());
        for _ in 0..13 {
            drawn.next_u32();
        }
        assert_eq!(drawn.next_u32().to_array(), skipped.next_u32().to_array());
    }

    #[test]
    fn neighbouring_pixels_samples_and_dimensions_are_uncorrelated() {
        // Means of products of centred uniforms; the standard error of each is 1/(12·√n).
        let n = 1 << 18;
        let lanes = (0..n / LANES as u32).map(|i| U32s::splat(i * LANES as u32) + iota());
        let mut sums = [0.0f64; 5];
        for pixel in lanes {
            let mut a = Pcg32s::for_paths(0, pixel, 0, U32s::splat(0));
            let mut b = Pcg32s::for_paths(0, pixel + U32s::splat(1), 0, U32s::splat(0));
            let mut c = Pcg32s::for_paths(0, pixel, 1, U32s::splat(0));
            let [d0, e0] = [1, 2].map(|i| a.fork(i).next_f32().to_array());
            let (a0, a1) = (a.next_f32().to_array(), a.next_f32().to_array());
            let (b0, c0) = (b.next_f32().to_array(), c.next_f32().to_array());
            for i in 0..LANES {
                let centred = |u: f32| f64::from(u) - 0.5;
                sums[0] += centred(a1[i]) * centred(b0[i]);
                sums[1] += centred(a0[i]) * centred(c0[i]);
                sums[2] += centred(a0[i]) * centred(a1[i]);
                sums[3] += centred(a0[i]) * centred(d0[i]);
                sums[4] += centred(d0[i]) * centred(e0[i]);
            }
        }
        let standard_error = (f64::from(n)).sqrt() / 12.0;
        for sum in sums {
            assert!(
                (sum / standard_error).abs() < 4.5,
                "z = {}",
                sum / standard_error
            );
        }
    }
}
