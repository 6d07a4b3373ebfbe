//! Jittered strata within each block of samples of a pixel: the sub-pixel supersampling of the
//! classical ray tracer, extended to light points and directions.
//!
//! A block of n samples has 2^k ≥ n strata per dimension, or a 2^⌈k/2⌉ × 2^⌊k/2⌋ grid for a pair.
//! Each dimension of each block of a pixel orders them by its own permutation, whose last step is
//! an exclusive-or with uniform bits, so each single sample stays uniform (the estimate unbiased),
//! and blocks stay independent (the error estimate from block means stays valid).

use super::hash::{mix, of_dimension};
use crate::math::lanes::{F32s, U32s, to_f32};

/// Strata of LANES samples.
#[derive(Debug, Clone, Copy)]
pub struct Strata {
    /// Samples of the block.
    samples: u32,
    /// The sample's number within its block.
    sample: U32s,
    /// Hash of (seed, pixel, block).
    key: U32s,
}

impl Strata {
    /// Strata of the samples with number `sample` in a block of `samples`.
    #[inline(always)]
    pub fn new(seed: u64, pixel: U32s, block: u64, samples: u32, sample: U32s) -> Self {
        let fold = |x: u64| (x ^ (x >> 32)) as u32;
        let seed = U32s::splat(fold(seed).wrapping_mul(0x9e37_79b9));
        let block = U32s::splat(fold(block).wrapping_mul(0x85eb_ca6b));
        Self {
            samples,
            sample,
            key: mix(mix(pixel ^ seed) ^ block),
        }
    }

    /// k: the block has 2^k strata.
    #[inline(always)]
    fn log2(&self) -> u32 {
        self.samples.next_power_of_two().trailing_zeros()
    }

    /// Strata of sample `i` of `count` that each sample takes, as one of a block `count` times as large;
    /// at most 2^12 samples in all.
    #[inline(always)]
    #[must_use]
    pub fn refined(&self, count: u32, i: u32) -> Self {
        Self {
            samples: self.samples * count,
            sample: self.sample * U32s::splat(count) + U32s::splat(i),
            ..*self
        }
    }

    /// The sample's stratum in `dimension`, in 0 .. 2^k.
    #[inline(always)]
    fn stratum(&self, dimension: U32s) -> U32s {
        let mask = U32s::splat((1 << self.log2()) - 1);
        let keys = of_dimension(self.key, dimension);
        let half = self.log2().div_ceil(2);
        // Bijections of k bits: add, multiply by an odd number, fold down; at last the exclusive-or.
        let x = (self.sample + keys) & mask;
        let x = (x * ((keys >> 6) | U32s::splat(1))) & mask;
        let x = x ^ (x >> half);
        let x = (x * ((keys >> 12) | U32s::splat(1))) & mask;
        let x = x ^ (x >> half);
        (x ^ (keys >> 20)) & mask
    }

    /// One number from a uniform jitter `u`.
    #[inline(always)]
    pub fn one(&self, dimension: U32s, u: F32s) -> F32s {
        let scale = F32s::splat(1.0 / (1 << self.log2()) as f32);
        below_one((to_f32(self.stratum(dimension)) + u) * scale)
    }

    /// A pair from uniform jitters `u`, `v`.
    #[inline(always)]
    pub fn pair(&self, dimension: U32s, [u, v]: [F32s; 2]) -> [F32s; 2] {
        let columns = self.log2().div_ceil(2);
        let rows = self.log2() - columns;
        let stratum = self.stratum(dimension);
        let (column, row) = (
            stratum & U32s::splat((1 << columns) - 1),
            stratum >> columns,
        );
        [
            below_one((to_f32(column) + u) * F32s::splat(1.0 / (1 << columns) as f32)),
            below_one((to_f32(row) + v) * F32s::splat(1.0 / (1 << rows) as f32)),
        ]
    }
}

/// Rounding of `stratum + u` can reach the next stratum; the last must stay below 1.
#[inline(always)]
fn below_one(u: F32s) -> F32s {
    u.fast_min(F32s::splat(1.0 - f32::EPSILON / 2.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::LANES;
    use crate::math::lanes::iota;

    /// The pairs of a whole block of one pixel.
    fn block(pixel: u32, samples: u32, dimension: u32) -> Vec<[f32; 2]> {
        (0..samples.div_ceil(LANES as u32))
            .flat_map(|i| {
                let sample = iota() + U32s::splat(i * LANES as u32);
                let strata = Strata::new(3, U32s::splat(pixel), 9, samples, sample);
                let half = F32s::splat(0.5);
                let [u, v] = strata.pair(U32s::splat(dimension), [half, half]);
                (0..LANES).map(move |lane| [u.to_array()[lane], v.to_array()[lane]])
            })
            .take(samples as usize)
            .collect()
    }

    #[test]
    fn a_full_block_fills_each_stratum_once() {
        for (samples, columns, rows) in [
            (1, 1, 1),
            (2, 2, 1),
            (4, 2, 2),
            (16, 4, 4),
            (32, 8, 4),
            (64, 8, 8),
        ] {
            for pixel in 0..50 {
                let mut seen = vec![0; samples as usize];
                for [u, v] in block(pixel, samples, pixel % 7) {
                    seen[(v * rows as f32) as usize * columns + (u * columns as f32) as usize] += 1;
                }
                assert!(seen.iter().all(|&n| n == 1), "{samples} samples: {seen:?}");
            }
        }
    }

    #[test]
    fn several_numbers_per_sample_fill_the_strata_of_all_together() {
        for count in [2, 4, 16] {
            let mut seen = vec![0; 16 * count as usize];
            for i in 0..count {
                for chunk in 0..16u32.div_ceil(LANES as u32) {
                    let sample = iota() + U32s::splat(chunk * LANES as u32);
                    let strata = Strata::new(3, U32s::splat(5), 9, 16, sample).refined(count, i);
                    let u = strata.one(U32s::splat(2), F32s::splat(0.5)).to_array();
                    for lane in 0..LANES.min(16) {
                        seen[(u[lane] * (16 * count) as f32) as usize] += 1;
                    }
                }
            }
            assert!(seen.iter().all(|&n| n == 1), "{count}: {seen:?}");
        }
    }

    #[test]
    fn each_sample_is_uniform_over_the_strata() {
        // Chi-squared of sample 5's stratum over pixels; 15 degrees of freedom, 99.99 % quantile 44.3.
        let pixels = 16_000;
        let mut counts = [0.0f64; 16];
        for pixel in 0..pixels {
            let [u, v] = block(pixel, 16, 2)[5];
            counts[(v * 4.0) as usize * 4 + (u * 4.0) as usize] += 1.0;
        }
        let expected = f64::from(pixels) / 16.0;
        let chi2: f64 = counts
            .iter()
            .map(|c| (c - expected).powi(2) / expected)
            .sum();
        assert!(chi2 < 44.3, "chi² = {chi2}");
    }

    #[test]
    fn dimensions_are_permuted_independently() {
        // Over pixels, sample 0's strata of two dimensions: correlation within 4.5 standard errors of 0.
        let pixels = 4_000;
        let sum: f64 = (0..pixels)
            .map(|pixel| {
                let (a, b) = (block(pixel, 16, 0)[0][0], block(pixel, 16, 1)[0][0]);
                f64::from((a - 0.5) * (b - 0.5))
            })
            .sum();
        let variance = (1.0 - 1.0 / 16.0) / 12.0;
        assert!((sum / (variance * f64::from(pixels).sqrt())).abs() < 4.5);
    }

    #[test]
    fn numbers_stay_below_one() {
        let strata = Strata::new(0, U32s::splat(0), 0, 64, iota());
        let u = F32s::splat(1.0 - f32::EPSILON / 2.0);
        for d in 0..100 {
            assert!(
                strata
                    .one(U32s::splat(d), u)
                    .to_array()
                    .iter()
                    .all(|&x| x < 1.0)
            );
            let [a, b] = strata.pair(U32s::splat(d), [u, u]);
            assert!(a.to_array().iter().chain(&b.to_array()).all(|&x| x < 1.0));
        }
    }
}
