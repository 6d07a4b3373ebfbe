//! The random numbers of one camera sample.

use rand_core::Rng;
use rand_pcg::Pcg32;

/// Sets these numbers apart from those of every other renderer with the same seed: two pictures
/// are compared statistically and must be independent. The first 64 fractional bits of √7 − 2.
const SALT: u64 = 0xa54f_f53a_5f1d_36f1;

/// The generator of one camera sample.
#[derive(Debug)]
pub(super) struct Random(Pcg32);

impl Random {
    /// Depends on its arguments and nothing else; neighbours are unrelated.
    pub(super) fn new(seed: u64, pixel_x: u32, pixel_y: u32, sample: u64) -> Self {
        let pixel = u64::from(pixel_y) << 32 | u64::from(pixel_x);
        let state = mix(mix(mix(seed ^ SALT) ^ pixel) ^ sample);
        Self(Pcg32::new(state, mix(state ^ SALT)))
    }

    /// Uniform in [0, 1), 53 bits.
    pub(super) fn next(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (f64::EPSILON / 2.0)
    }

    /// Two independent uniform numbers.
    pub(super) fn next_2d(&mut self) -> [f64; 2] {
        [self.next(), self.next()]
    }
}

/// MurmurHash3's 64-bit finaliser (Appleby 2011): a bijection in which every bit of the input
/// changes half of the bits of the output.
fn mix(mut bits: u64) -> u64 {
    bits = (bits ^ bits >> 33).wrapping_mul(0xff51_afd7_ed55_8ccd);
    bits = (bits ^ bits >> 33).wrapping_mul(0xc4ce_b9fe_1a85_ec53);
    bits ^ bits >> 33
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbouring_samples_pixels_and_seeds_are_uncorrelated() {
        type Along = fn(u32) -> Random;
        let along: [(&str, Along); 4] = [
            ("x", |i| Random::new(1, i, 3, 5)),
            ("y", |i| Random::new(1, 3, i, 5)),
            ("sample", |i| Random::new(1, 3, 7, i.into())),
            ("seed", |i| Random::new(i.into(), 3, 7, 5)),
        ];
        let n = 100_000;
        for (name, random) in along {
            let first = |i| random(i).next() - 0.5;
            let sum: f64 = (0..n).map(|i| first(2 * i) * first(2 * i + 1)).sum();
            // The product of two independent centred uniforms has standard deviation 1/12.
            let z = sum * 12.0 / f64::from(n).sqrt();
            assert!(z.abs() < 4.0, "{name}: z = {z}");
        }
    }

    #[test]
    fn numbers_are_uniform_and_below_one() {
        let mut bins = [0u32; 64];
        let n = 640_000;
        let mut random = Random::new(0, 0, 0, 0);
        for _ in 0..n {
            let u = random.next();
            assert!((0.0..1.0).contains(&u));
            bins[(u * 64.0) as usize] += 1;
        }
        let expected = f64::from(n) / 64.0;
        let chi2: f64 = bins
            .iter()
            .map(|&count| (f64::from(count) - expected).powi(2) / expected)
            .sum();
        // 63 degrees of freedom: mean 63, standard deviation 11.2.
        assert!((chi2 - 63.0).abs() < 4.0 * 11.2, "chi² = {chi2}");
    }
}
