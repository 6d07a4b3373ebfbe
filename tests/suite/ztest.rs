//! Whether two pictures that were made with independent random numbers show the same radiance.
//!
//! The pictures are compared tile by tile and as a whole, per channel, by Welch's test on the
//! difference of the means. The tests of one comparison share a stated chance of a false alarm by
//! Šidák's correction. Tiles hold enough samples that the variance counts as known and the means
//! as normal, unless rare bright samples carry the picture.

use std::fmt;

/// Mean over samples per pixel and channel, and the estimated variance of that mean.
#[derive(Debug, Clone)]
pub(crate) struct ImageEstimate {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Row by row from the top left.
    pub(crate) mean: Vec<[f64; 3]>,
    pub(crate) variance_of_mean: Vec<[f64; 3]>,
}

/// Side of a tile in pixels.
const TILE: usize = 8;

/// Relative difference of two means that is put down to rounding in f32 and not to the method.
const ROUNDING: f64 = 1e-5;

/// Result of [`compare`].
#[derive(Debug, Clone)]
pub(crate) struct Comparison {
    /// The most significant difference.
    pub(crate) worst: Difference,
    /// Tests made.
    pub(crate) tests: usize,
    /// Largest |z| that still passes.
    pub(crate) threshold: f64,
}

/// The means of one channel over one region.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Difference {
    /// First column and row, and width and height, in pixels.
    pub(crate) region: [usize; 4],
    pub(crate) channel: usize,
    pub(crate) means: [f64; 2],
    /// Difference over its standard error, past the allowance for rounding; positive where the
    /// first picture is brighter. Infinite where a mean is not finite.
    pub(crate) z: f64,
}

impl ImageEstimate {
    /// The estimate by this many samples per pixel, at least 2, of `sample(x, y, number)`.
    pub(crate) fn from_samples(
        [width, height]: [usize; 2],
        samples: u64,
        mut sample: impl FnMut(usize, usize, u64) -> [f64; 3],
    ) -> Self {
        let n = samples as f64;
        let mut image = Self {
            width,
            height,
            mean: Vec::new(),
            variance_of_mean: Vec::new(),
        };
        for y in 0..height {
            for x in 0..width {
                // Welford's update: the sum of squares would cancel.
                let mut mean = [0.0; 3];
                let mut squares = [0.0; 3];
                for i in 0..samples {
                    for (channel, value) in sample(x, y, i).into_iter().enumerate() {
                        let before = value - mean[channel];
                        mean[channel] += before / (i + 1) as f64;
                        squares[channel] += before * (value - mean[channel]);
                    }
                }
                image.mean.push(mean);
                image
                    .variance_of_mean
                    .push(squares.map(|sum| sum / (n - 1.0) / n));
            }
        }
        image
    }

    /// Mean of a channel over a region, and the variance of that mean.
    fn region(&self, [x0, y0, width, height]: [usize; 4], channel: usize) -> (f64, f64) {
        let mut mean = 0.0;
        let mut variance = 0.0;
        for y in y0..y0 + height {
            for pixel in y * self.width + x0..y * self.width + x0 + width {
                mean += self.mean[pixel][channel];
                variance += self.variance_of_mean[pixel][channel];
            }
        }
        let n = (width * height) as f64;
        (mean / n, variance / (n * n))
    }
}

impl Difference {
    fn new(a: &ImageEstimate, b: &ImageEstimate, region: [usize; 4], channel: usize) -> Self {
        let (mean_a, variance_a) = a.region(region, channel);
        let (mean_b, variance_b) = b.region(region, channel);
        let difference = mean_a - mean_b;
        let excess = (difference.abs() - ROUNDING * mean_a.abs().max(mean_b.abs())).max(0.0);
        let z = if !(difference.is_finite() && (variance_a + variance_b).is_finite()) {
            f64::INFINITY
        } else if excess == 0.0 {
            0.0
        } else {
            (excess / (variance_a + variance_b).sqrt()).copysign(difference)
        };
        Self {
            region,
            channel,
            means: [mean_a, mean_b],
            z,
        }
    }
}

/// Compares two pictures of the same size. Where they show the same radiance, the chance that
/// [`Comparison::passes`] says no is `false_alarm_rate`.
pub(crate) fn compare(a: &ImageEstimate, b: &ImageEstimate, false_alarm_rate: f64) -> Comparison {
    assert_eq!(
        [a.width, a.height],
        [b.width, b.height],
        "pictures of different size"
    );
    let mut regions = vec![[0, 0, a.width, a.height]];
    for y in (0..a.height).step_by(TILE) {
        for x in (0..a.width).step_by(TILE) {
            regions.push([x, y, TILE.min(a.width - x), TILE.min(a.height - y)]);
        }
    }
    let worst = regions
        .iter()
        .flat_map(|&region| (0..3).map(move |channel| Difference::new(a, b, region, channel)))
        .max_by(|a, b| a.z.abs().total_cmp(&b.z.abs()))
        .expect("there is always the whole picture");
    let tests = 3 * regions.len();
    let rate_per_test = -((-false_alarm_rate).ln_1p() / tests as f64).exp_m1();
    Comparison {
        worst,
        tests,
        threshold: quantile(rate_per_test),
    }
}

/// As [`compare`] with a false alarm in 10 000 runs, and panics with the worst region.
pub(crate) fn assert_same(a: &ImageEstimate, b: &ImageEstimate) {
    let comparison = compare(a, b, 1e-4);
    assert!(comparison.passes(), "{comparison}");
}

impl Comparison {
    /// Whether no difference is significant.
    pub(crate) fn passes(&self) -> bool {
        self.worst.z.abs() <= self.threshold
    }
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Difference {
            region: [x, y, width, height],
            channel,
            means: [a, b],
            z,
        } = self.worst;
        write!(
            f,
            "worst of {} tests: pixels ({x}, {y}) + {width} × {height}, channel {channel}: \
             {a} and {b}, z = {z:.2} (threshold {:.2})",
            self.tests, self.threshold
        )
    }
}

/// The z that a standard normal variable exceeds, either way, with this probability below 0.3.
fn quantile(probability: f64) -> f64 {
    let (mut low, mut high) = (1.0, 40.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if two_sided_tail(middle) > probability {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Probability that the absolute value of a standard normal variable exceeds z ≥ 1, by the
/// continued fraction of Mills' ratio (Laplace).
fn two_sided_tail(z: f64) -> f64 {
    let fraction = (1..=200).rev().fold(z, |tail, k| z + f64::from(k) / tail);
    2.0 * (-0.5 * z * z).exp() / (std::f64::consts::TAU.sqrt() * fraction)
}

mod tests {
    use rand_core::Rng;
    use rand_pcg::Pcg32;

    use super::*;

    /// Exponential noise about a gradient: skewed, as radiance is.
    fn noise(seed: u64, size: [usize; 2], samples: u64) -> ImageEstimate {
        let mut random = Pcg32::new(seed, 99);
        ImageEstimate::from_samples(size, samples, |x, y, _| {
            let level = 1.0 + 0.1 * x as f64 + 0.05 * y as f64;
            [1.0, 0.5, 0.1].map(|tint| {
                let u = (f64::from(random.next_u32()) + 0.5) / 4_294_967_296.0;
                -tint * level * u.ln()
            })
        })
    }

    fn scaled(mut image: ImageEstimate, factor: impl Fn(usize) -> f64) -> ImageEstimate {
        for (i, mean) in image.mean.iter_mut().enumerate() {
            *mean = mean.map(|value| value * factor(i));
        }
        image
    }

    #[test]
    fn normal_tails_match_tables() {
        for (z, tail) in [
            (1.0, 0.317310508),
            (1.959964, 0.05),
            (3.0, 0.002699796),
            (5.0, 5.733031e-7),
        ] {
            assert!((two_sided_tail(z) / tail - 1.0).abs() < 1e-6);
            assert!((quantile(tail) - z).abs() < 1e-6);
        }
    }

    #[test]
    fn the_same_distribution_passes_but_for_the_stated_false_alarms() {
        let runs = 200;
        let alarms = (0..runs)
            .filter(|&run| {
                let [a, b] = [0, 1].map(|k| noise(2 * run + k, [24, 20], 16));
                !compare(&a, &b, 0.05).passes()
            })
            .count();
        // 10 expected, standard deviation 3.1; the tests overlap a little (tiles and the whole).
        assert!((1..=22).contains(&alarms), "{alarms} of {runs}");
    }

    #[test]
    fn a_picture_darkened_by_3_percent_fails() {
        let [a, b] = [5, 6].map(|seed| noise(seed, [64, 64], 64));
        assert_same(&a, &b);
        let comparison = compare(&a, &scaled(b, |_| 0.97), 1e-4);
        assert!(
            !comparison.passes() && comparison.worst.z > 0.0,
            "{comparison}"
        );
    }

    #[test]
    fn one_wrong_tile_is_found_and_named() {
        let [a, b] = [7, 8].map(|seed| noise(seed, [60, 60], 64));
        let b = scaled(b, |i| {
            if (i % 60) / 8 == 7 && i / 60 / 8 == 2 {
                1.3
            } else {
                1.0
            }
        });
        let comparison = compare(&a, &b, 1e-4);
        assert!(!comparison.passes());
        assert_eq!(comparison.worst.region, [56, 16, 4, 8]);
        assert!(comparison.to_string().contains("pixels (56, 16) + 4 × 8"));
    }

    #[test]
    fn pictures_without_noise_may_differ_by_rounding_alone() {
        let exact = |value: f64| ImageEstimate::from_samples([8, 8], 4, |_, _, _| [value; 3]);
        assert_same(&exact(0.5), &exact(0.5 * (1.0 + 5e-6)));
        assert!(!compare(&exact(0.5), &exact(0.5001), 1e-4).passes());
        assert_same(&exact(0.0), &exact(0.0));
    }

    #[test]
    fn a_pixel_that_is_not_a_number_fails() {
        let good = noise(1, [16, 16], 16);
        for bad in [f64::NAN, f64::INFINITY] {
            let mut image = noise(2, [16, 16], 16);
            image.mean[37][1] = bad;
            let comparison = compare(&good, &image, 1e-4);
            assert!(!comparison.passes());
            let [x, y, width, height] = comparison.worst.region;
            assert!((x..x + width).contains(&5) && (y..y + height).contains(&2));
        }
    }
}
