//! Padded pairs of Sobol's sequence with Owen's scrambling, computed by hashing.
//!
//! Every dimension pair of a pixel is the first two dimensions of Sobol's sequence, a (0, 2)-sequence in
//! base 2: of the points with numbers i·2^m … (i + 1)·2^m − 1, one falls into each elementary interval of
//! area 2^-m. Each pair has its points in an order of its own and each dimension its own digits, by nested
//! uniform scrambling with a key of (seed, pixel, dimension): order and digits keep all intervals, so a
//! path may have any number of dimensions and no two of them, nor two pixels, share anything. A single
//! number is the first half of a pair.
//!
//! Sources: Sobol' 1967; Owen, "Randomly permuted (t,m,s)-nets and (t,s)-sequences", 1995; Burley,
//! "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020, for shuffling and padding; the hash for
//! scrambling is that of Vegdahl, "Building a Better LK Hash", 2021.
//!
//! # What block means say about the error
//!
//! The sequence goes on from block to block of a pixel, which is where the convergence beyond that of
//! independent blocks comes from. Each single point is uniform, so every block mean is unbiased. But blocks
//! are not independent: they avoid each other's intervals. Let V(n) be the variance of a pixel's mean over
//! n samples. The spread of B block means of n/B samples each then estimates, in expectation,
//! (V(n/B) − V(n))/(B − 1), which is at least V(n) exactly if V(n) ≤ V(n/B)/B: if taking more points
//! gains at least what averaging would. So the estimate is conservative, for smooth radiance by a large
//! factor. Exceptions take an integrand that lives in just the intervals between a block's and the whole
//! sequence's; for a function of one number there is none, for one of a pair Owen's bound on the
//! gain coefficients keeps V(n) ≤ 2·V(n/B)/B ("Monte Carlo variance of scrambled net quadrature", 1997).
//!
//! So a render deals its samples out to two sequences of a pixel with keys of their own. Their means are
//! independent, and a quarter of the square of their difference is an unbiased estimate of the
//! variance of the mean of both, V(n/2)/2 (random replication; Owen, "Monte Carlo Theory, Methods and
//! Examples", section 17.5), which is between V(n) and, where V falls as n^-2, 2·V(n).

use super::hash::{mix, of_dimension};
use crate::math::lanes::{F32s, U32s, to_f32};

/// LANES samples of a pixel's sequences.
#[derive(Debug, Clone, Copy)]
pub struct Sobol {
    /// The sample's number, its bits reversed.
    reversed: U32s,
    /// Hash of (seed, pixel).
    key: U32s,
}

/// The bits in reverse order.
#[inline(always)]
fn reverse(x: U32s) -> U32s {
    let swap = |x: U32s, by: u32, low: u32| {
        let low = U32s::splat(low);
        ((x >> by) & low) | ((x & low) << by)
    };
    let x = swap(x, 1, 0x5555_5555);
    let x = swap(x, 2, 0x3333_3333);
    let x = swap(x, 4, 0x0f0f_0f0f);
    let x = swap(x, 8, 0x00ff_00ff);
    (x >> 16) | (x << 16)
}

/// Nested uniform scrambling of numbers whose first binary digit is the lowest bit: whether a digit is
/// turned depends on the key and the digits before it. Vegdahl's hash, of which every step lets bits act on
/// higher bits alone.
#[inline(always)]
fn scramble(x: U32s, key: U32s) -> U32s {
    let x = x ^ (x * U32s::splat(0x3d20_adea));
    let x = x + key;
    let x = x * ((key >> 16) | U32s::splat(1));
    let x = x ^ (x * U32s::splat(0x0552_6c56));
    x ^ (x * U32s::splat(0x53a2_2864))
}

/// The second dimension of Sobol's sequence, first digit in the lowest bit: its matrix is Pascal's triangle
/// modulo 2, where binom(k, j) is odd exactly if j's bits are among those of k. So digit j is the sum of the
/// index's bits k ⊇ j, taken one bit of the positions at a time.
#[inline(always)]
fn second_dimension(index: U32s) -> U32s {
    let fold = |x: U32s, by: u32, low: u32| x ^ ((x >> by) & U32s::splat(low));
    let x = fold(index, 16, 0x0000_ffff);
    let x = fold(x, 8, 0x00ff_00ff);
    let x = fold(x, 4, 0x0f0f_0f0f);
    let x = fold(x, 2, 0x3333_3333);
    fold(x, 1, 0x5555_5555)
}

/// In [0, 1) from digits, the first in the lowest bit; 24 of them, so never rounded up to 1.
#[inline(always)]
fn to_unit(digits: U32s) -> F32s {
    to_f32(reverse(digits) >> 8) * F32s::splat(1.0 / 16_777_216.0)
}

impl Sobol {
    /// The samples with the numbers `first_sample + sample` of the pixels. After 2^32 samples of a pixel
    /// another, independent sequence begins.
    #[inline(always)]
    pub fn new(seed: u64, pixel: U32s, first_sample: u64, sample: U32s) -> Self {
        let fold = |x: u64| U32s::splat((x ^ (x >> 32)) as u32);
        let seed = fold(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let sequence = fold((first_sample >> 32).wrapping_mul(0xd1b5_4a32_d192_ed03));
        Self {
            reversed: reverse(U32s::splat(first_sample as u32) + sample),
            key: mix(mix(mix(pixel) ^ seed) ^ sequence),
        }
    }

    /// Sample `i` of `count` that each sample takes, as samples of one sequence `count` times as long:
    /// together they are as evenly spread as so many samples can be. `count` ≥ 1, `i` below it.
    #[inline(always)]
    #[must_use]
    pub fn refined(&self, count: u32, i: u32) -> Self {
        let sample = reverse(self.reversed) * U32s::splat(count) + U32s::splat(i);
        Self {
            reversed: reverse(sample),
            ..*self
        }
    }

    /// The samples' numbers in the order of the pair at `dimension`, from its key.
    #[inline(always)]
    fn shuffled(&self, key: U32s) -> U32s {
        reverse(scramble(
            self.reversed,
            key * U32s::splat(0x2c1b_3c6d) + U32s::splat(0x297a_2d39),
        ))
    }

    /// One number in [0, 1).
    #[inline(always)]
    pub fn one(&self, dimension: U32s) -> F32s {
        let key = of_dimension(self.key, dimension);
        to_unit(scramble(self.shuffled(key), key))
    }

    /// A pair of numbers in [0, 1), of `dimension` and the one after it.
    #[inline(always)]
    pub fn pair(&self, dimension: U32s) -> [F32s; 2] {
        let key = of_dimension(self.key, dimension);
        let index = self.shuffled(key);
        let other = of_dimension(self.key, dimension + U32s::splat(1));
        [
            to_unit(scramble(index, key)),
            to_unit(scramble(second_dimension(index), other)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::LANES;
    use crate::math::lanes::iota;

    /// Points `first ..` of one pair of a pixel, in 24 bits.
    fn points(pixel: u32, dimension: u32, first: u64, count: usize) -> Vec<[f32; 2]> {
        (0..count.div_ceil(LANES))
            .flat_map(|i| {
                let sample = U32s::splat((i * LANES) as u32) + iota();
                let sobol = Sobol::new(3, U32s::splat(pixel), first, sample);
                let [u, v] = sobol.pair(U32s::splat(dimension)).map(F32s::to_array);
                (0..LANES).map(move |lane| [u[lane], v[lane]])
            })
            .take(count)
            .collect()
    }

    /// Asserts that each interval of area 2^-m holds one of these 2^m points.
    #[track_caller]
    fn assert_net(points: &[[f32; 2]], label: &str) {
        let m = points.len().ilog2();
        for across in 0..=m {
            let (columns, rows) = (1usize << across, 1usize << (m - across));
            let mut seen = vec![0; points.len()];
            for [u, v] in points {
                let (column, row) = (u * columns as f32, v * rows as f32);
                seen[row as usize * columns + column as usize] += 1;
            }
            assert!(seen.iter().all(|&n| n == 1), "{label}: {columns} × {rows}");
        }
    }

    #[test]
    fn aligned_powers_of_two_of_points_are_nets() {
        for pixel in 0..20 {
            for dimension in [0, 2, 5, 100_000] {
                for (first, count) in [(0, 1), (0, 2), (6, 2), (0, 4), (16, 16), (48, 16), (0, 256)]
                {
                    let label = format!("pixel {pixel}, dimension {dimension}, {first} + {count}");
                    assert_net(&points(pixel, dimension, first, count), &label);
                }
                // Beyond 32 bits a sequence of its own begins.
                assert_net(&points(pixel, dimension, (5 << 32) + 64, 64), "high");
            }
        }
    }

    #[test]
    fn single_numbers_are_nets_of_one_dimension() {
        for first in [0, 64, 1 << 20] {
            let sobol = |i: u32| {
                let sample = U32s::splat(i * LANES as u32) + iota();
                Sobol::new(1, U32s::splat(7), first, sample).one(U32s::splat(9))
            };
            let mut seen = [0; 64];
            for u in (0..64 / LANES as u32).flat_map(|i| sobol(i).to_array()) {
                seen[(u * 64.0) as usize] += 1;
            }
            assert_eq!(seen, [1; 64]);
        }
    }

    #[test]
    fn without_scrambling_the_pair_is_sobols() {
        // The second dimension by its direction numbers: v_1 = 1/2, and x + 1 as primitive polynomial gives
        // v_k = v_(k−1) ⊕ v_(k−1)/2.
        let mut direction = [1u32 << 31; 32];
        for k in 1..32 {
            direction[k] = direction[k - 1] ^ (direction[k - 1] >> 1);
        }
        for start in [0u32, 1 << 16, u32::MAX - 1000] {
            let index = U32s::splat(start) + iota();
            let got = reverse(second_dimension(index)).to_array();
            for (lane, i) in index.to_array().into_iter().enumerate() {
                let expected = (0..32)
                    .filter(|&k| i >> k & 1 == 1)
                    .fold(0, |sum, k| sum ^ direction[k as usize]);
                assert_eq!(got[lane], expected, "point {i}");
            }
        }
    }

    #[test]
    fn scrambling_is_nested() {
        // Two numbers whose first k digits agree do so after it, and differ in the next if they did.
        for key in [0, 1, 0x1234_5678, u32::MAX] {
            let key = mix(U32s::splat(key));
            for k in 0..31 {
                let a = mix(iota() + U32s::splat(k));
                let b = a ^ (U32s::splat(1) << k) ^ (mix(a) << (k + 1));
                let difference = (scramble(a, key) ^ scramble(b, key)).to_array();
                assert!(difference.iter().all(|d| d.trailing_zeros() == k), "{k}");
            }
        }
    }

    #[test]
    fn each_point_of_a_sequence_is_uniform() {
        // Chi-squared of points over pixels; 255 degrees of freedom: mean 255, standard deviation 22.6.
        for index in [0, 1, 5, 1000] {
            let pixels = 64_000;
            let mut counts = [0.0f64; 256];
            for pixel in 0..pixels / LANES as u32 {
                let pixel = U32s::splat(pixel * LANES as u32) + iota();
                let sobol = Sobol::new(0, pixel, index, U32s::splat(0));
                let [u, v] = sobol.pair(U32s::splat(3)).map(F32s::to_array);
                for lane in 0..LANES {
                    counts[(v[lane] * 16.0) as usize * 16 + (u[lane] * 16.0) as usize] += 1.0;
                }
            }
            let expected = f64::from(pixels) / 256.0;
            let chi2: f64 = counts
                .iter()
                .map(|c| (c - expected).powi(2) / expected)
                .sum();
            assert!((chi2 - 255.0).abs() < 4.5 * 22.6, "point {index}: {chi2}");
        }
    }

    #[test]
    fn pixels_seeds_pairs_and_sequences_are_independent() {
        // Sums over many sequences of products of centred numbers that have one thing different. The
        // standard error of each sum is √n/12.
        let n = 1 << 16;
        let base =
            |pixel, dimension| Sobol::new(1, pixel, 0, U32s::splat(3)).pair(U32s::splat(dimension));
        let one = U32s::splat(1);
        type Other<'a> = (&'a str, Box<dyn Fn(U32s) -> F32s + 'a>);
        let others: [Other<'_>; 6] = [
            ("pixel", Box::new(|p| base(p + one, 2)[0])),
            ("other half", Box::new(|p| base(p, 2)[1])),
            ("pair", Box::new(|p| base(p, 4)[0])),
            (
                "single",
                Box::new(|p| Sobol::new(1, p, 0, U32s::splat(3)).one(U32s::splat(9))),
            ),
            (
                "seed",
                Box::new(|p| Sobol::new(2, p, 0, U32s::splat(3)).one(U32s::splat(2))),
            ),
            (
                "half",
                Box::new(|p| Sobol::new(1, p, 1 << 63, U32s::splat(3)).one(U32s::splat(2))),
            ),
        ];
        for (name, other) in others {
            let mut sum = 0.0;
            for pixel in 0..n / LANES as u32 {
                let pixel = U32s::splat(2 * pixel * LANES as u32) + iota() * U32s::splat(2);
                let [a, b] = [base(pixel, 2)[0], other(pixel)].map(F32s::to_array);
                let centred = |u: f32| f64::from(u) - 0.5;
                sum += (0..LANES)
                    .map(|i| centred(a[i]) * centred(b[i]))
                    .sum::<f64>();
            }
            let z = sum * 12.0 / f64::from(n).sqrt();
            assert!(z.abs() < 4.5, "{name}: z = {z}");
        }
    }

    #[test]
    fn within_a_block_pairs_are_joined_at_random() {
        // 16 points of two pairs: the strata of one say nothing about those of the other. Chi-squared
        // over pixels of the joint stratum of sample 5; 15 × 15 degrees of freedom.
        let pixels = 40_000;
        let mut counts = vec![0.0f64; 256];
        for pixel in 0..pixels {
            let stratum = |dimension| {
                let [u, v] = points(pixel, dimension, 0, LANES)[5];
                (v * 4.0) as usize * 4 + (u * 4.0) as usize
            };
            counts[stratum(2) * 16 + stratum(5)] += 1.0;
        }
        let expected = f64::from(pixels) / 256.0;
        let chi2: f64 = counts
            .iter()
            .map(|c| (c - expected).powi(2) / expected)
            .sum();
        assert!((chi2 - 255.0).abs() < 4.5 * 22.6, "chi² = {chi2}");
    }

    #[test]
    fn refined_samples_are_one_longer_sequence() {
        let mut all: Vec<[f32; 2]> = Vec::new();
        for i in 0..4 {
            for chunk in 0..16 / LANES.min(16) as u32 {
                let sample = U32s::splat(chunk * LANES as u32) + iota();
                let sobol = Sobol::new(0, U32s::splat(11), 0, sample).refined(4, i);
                let [u, v] = sobol.pair(U32s::splat(2)).map(F32s::to_array);
                all.extend((0..LANES).map(|lane| [u[lane], v[lane]]));
            }
        }
        assert_eq!(all.len(), 64);
        assert_net(&all, "4 each of 16 samples");
    }

    /// A test integrand over the unit square (or two of them) with its mean.
    type Integrand = (&'static str, fn([f32; 2], [f32; 2]) -> f64, f64);

    /// The first is smooth, the second has an edge, the third needs two pairs.
    const INTEGRANDS: [Integrand; 4] = [
        (
            "smooth",
            |[u, v], _| f64::from(u * u) * f64::from(v).sin(),
            0.153_232_564_710_619_75,
        ),
        (
            "edge",
            |[u, v], _| f64::from(u8::from(u * u + v * v < 1.0)),
            std::f64::consts::FRAC_PI_4,
        ),
        (
            "two pairs",
            |[u, v], [a, b]| f64::from(u * v) * f64::from((a - b).abs()),
            1.0 / 12.0,
        ),
        (
            "single numbers",
            |[u, _], [a, _]| f64::from(u).exp() + f64::from(a).sqrt(),
            std::f64::consts::E - 1.0 + 2.0 / 3.0,
        ),
    ];

    /// Mean of each of `pixels` sequences over `count` samples, and the estimate of its variance from
    /// means over blocks of 16.
    fn means(f: fn([f32; 2], [f32; 2]) -> f64, count: usize, pixels: u32) -> Vec<[f64; 2]> {
        (0..pixels)
            .map(|pixel| {
                let values: Vec<f64> = points(pixel, 2, 0, count)
                    .into_iter()
                    .zip(points(pixel, 5, 0, count))
                    .map(|(a, b)| f(a, b))
                    .collect();
                let mean = values.iter().sum::<f64>() / count as f64;
                let blocks = (count / 16) as f64;
                let spread: f64 = values
                    .chunks(16)
                    .map(|block| (block.iter().sum::<f64>() / 16.0 - mean).powi(2))
                    .sum();
                [mean, spread / (blocks * (blocks - 1.0))]
            })
            .collect()
    }

    #[test]
    fn means_are_unbiased_and_the_estimate_from_blocks_is_conservative() {
        for (name, f, exact) in INTEGRANDS {
            // Also a count that is no power of two.
            for count in [32, 64, 112, 256] {
                let pixels = 2000;
                let means = means(f, count, pixels);
                let n = f64::from(pixels);
                let errors = || means.iter().map(|[mean, _]| mean - exact);
                let variance = errors().map(|e| e * e).sum::<f64>() / n;
                let z = errors().sum::<f64>() / (n * variance).sqrt();
                assert!(z.abs() < 4.5, "{name}, {count}: z = {z}");
                let estimate = means.iter().map(|[_, estimate]| estimate).sum::<f64>() / n;
                // The standard error of the measured variance is about √(2/2000) of it.
                assert!(
                    estimate > (1.0 - 4.5 * (2.0 / n).sqrt()) * variance,
                    "{name}, {count}: {estimate:e} for {variance:e}"
                );
            }
        }
    }

    #[test]
    fn smooth_integrands_converge_faster_than_independent_samples() {
        // The variance of a scrambled net falls as n^-3·log n for a smooth function of a pair: by more than
        // 8^-2.5 from 32 points to 256, where that of independent samples falls by 8^-1.
        let (_, f, exact) = INTEGRANDS[0];
        let [few, many] = [32, 256].map(|count| {
            let means = means(f, count, 1000);
            means
                .iter()
                .map(|[mean, _]| (mean - exact).powi(2))
                .sum::<f64>()
        });
        assert!(many < few * 8f64.powf(-2.5), "{few:e}, then {many:e}");
    }
}
