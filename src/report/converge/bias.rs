//! Whether images are wrong on average: signed errors over their standard errors. An image that has too few samples to
//! have seen a rare bright path is dark and says that it is certain. So its standard error is no smaller than as many samples
//! would have that are like those of a rendered reference, which has far more of them. An exact one has none, and nothing is
//! said of few samples.

use super::errors::{BLOCK, ROUNDING, ReferenceImage, blocks};
use super::results::{BiasTest, BiasVerdict};
use super::statistics::two_sided_p;
use crate::film::Film;

/// Standard errors from which the mean of an image is biased: 1 in 16 000 unbiased ones in a channel.
const BIASED_Z: f64 = 4.0;

/// Probability, over all blocks, below which the worst block of pixels is biased.
const BIASED_P: f64 = 0.001;

/// Samples per pixel, over all images, below which nothing is said where the reference has none.
const LEAST_SAMPLES: f64 = 16.0;

/// Signed errors per pixel and channel, of one image or of the mean over several, with what is known about
/// their variance.
#[derive(Debug, Clone)]
pub(super) struct SignedErrors {
    width: u32,
    /// Images averaged so far.
    images: f64,
    /// Sum over the images of value less reference.
    sum: Vec<[f64; 3]>,
    /// Sum over the images of the variance of each.
    variance: Vec<[f64; 3]>,
    /// Sum over the images of that variance squared over its degrees of freedom.
    variance_square: Vec<[f64; 3]>,
    /// Sum over the images of 1 over their samples.
    samples_inverse: Vec<f64>,
    /// Squared error of the reference, the same for all images.
    noise: Vec<[f64; 3]>,
    /// Samples of the reference.
    reference_samples: f64,
    /// Signed error that rounding to f32 explains.
    rounding: f64,
}

impl SignedErrors {
    /// Of one image. `None` unless every pixel has two blocks.
    pub(super) fn of(film: &Film, reference: &ReferenceImage) -> Option<Self> {
        let mut errors = Self {
            width: reference.width,
            images: 1.0,
            sum: Vec::with_capacity(film.len()),
            variance: Vec::with_capacity(film.len()),
            variance_square: Vec::with_capacity(film.len()),
            samples_inverse: Vec::with_capacity(film.len()),
            noise: reference.noise.clone(),
            reference_samples: reference.samples as f64,
            rounding: ROUNDING * reference.image_mean(),
        };
        for pixel in 0..film.len() {
            let (x, r) = (film.mean(pixel), reference.mean[pixel]);
            let variance = film.variance(pixel)?;
            let freedom = film.degrees_of_freedom(pixel) as f64;
            errors.sum.push(std::array::from_fn(|k| x[k] - r[k]));
            errors.variance.push(variance);
            errors
                .variance_square
                .push(variance.map(|variance| variance * variance / freedom));
            errors
                .samples_inverse
                .push(1.0 / film.samples(pixel) as f64);
        }
        Some(errors)
    }

    /// Adds an independent image held against the same reference.
    pub(super) fn add(&mut self, other: &Self) {
        self.images += other.images;
        let columns = [
            (&mut self.sum, &other.sum),
            (&mut self.variance, &other.variance),
            (&mut self.variance_square, &other.variance_square),
        ];
        for (ours, theirs) in columns {
            for (ours, theirs) in ours.iter_mut().flatten().zip(theirs.iter().flatten()) {
                *ours += theirs;
            }
        }
        for (ours, theirs) in self.samples_inverse.iter_mut().zip(&other.samples_inverse) {
            *ours += theirs;
        }
    }

    /// Whether they are of enough samples, or the reference says how noisy pixels are that have seen nothing.
    fn suffice(&self) -> bool {
        let most = self.samples_inverse.iter().copied().fold(0.0, f64::max);
        self.reference_samples > 0.0 || self.images * self.images >= LEAST_SAMPLES * most
    }

    /// Of the mean over these pixels in a channel: the signed error, its variance, and the degrees of
    /// freedom of that variance (Welch and Satterthwaite). The variance is the images' own estimate, or that from the
    /// reference's if this is larger.
    fn over(&self, pixels: &[usize], channel: usize) -> (f64, f64, f64) {
        let (images, n) = (self.images, pixels.len() as f64);
        let (mut sum, mut own, mut expected) = (0.0, Variance::default(), Variance::default());
        for &pixel in pixels {
            let noise = self.noise[pixel][channel];
            sum += self.sum[pixel][channel] / images;
            // The reference's noise is the square of a single difference: one degree of freedom.
            own.sum += self.variance[pixel][channel] / (images * images) + noise;
            own.square += self.variance_square[pixel][channel] / images.powi(4) + noise * noise;
            let times = self.reference_samples * self.samples_inverse[pixel] / (images * images);
            let both = noise * (times + 1.0);
            expected.sum += both;
            expected.square += both * both;
        }
        let variance = if expected.sum > own.sum {
            expected
        } else {
            own
        };
        (sum / n, variance.sum / (n * n), variance.freedom())
    }
}

/// A sum of variances.
#[derive(Debug, Clone, Copy, Default)]
struct Variance {
    sum: f64,
    /// Sum of their squares over their degrees of freedom.
    square: f64,
}

impl Variance {
    fn freedom(self) -> f64 {
        if self.square > 0.0 {
            self.sum * self.sum / self.square
        } else {
            f64::INFINITY
        }
    }
}

/// What a test of one set of signed errors says.
#[derive(Debug, Clone)]
pub(super) struct Test {
    /// Mean over pixels and channels.
    pub(super) mean_error: f64,
    /// Mean over the image over its standard error, in the channel where it is largest.
    pub(super) z: f64,
    /// Smallest p of a block in a channel, times the number of both; at most 1.
    pub(super) block_p: f64,
    /// Number of that block.
    pub(super) worst: usize,
    /// Per block as `z`.
    pub(super) blocks: Vec<f64>,
}

/// Tests the image as a whole and each block of pixels.
pub(super) fn test(errors: &SignedErrors) -> Test {
    let all: Vec<usize> = (0..errors.sum.len()).collect();
    let blocks: Vec<(f64, f64)> = blocks(errors.width, all.len())
        .iter()
        .map(|pixels| largest(errors, pixels))
        .collect();
    let worst = (0..blocks.len())
        .min_by(|&a, &b| blocks[a].1.total_cmp(&blocks[b].1))
        .unwrap_or(0);
    let count = (3 * blocks.len()) as f64;
    let mean_error = (0..3).map(|k| errors.over(&all, k).0).sum::<f64>() / 3.0;
    Test {
        mean_error,
        z: largest(errors, &all).0,
        block_p: (count * blocks[worst].1).min(1.0),
        worst,
        blocks: blocks.into_iter().map(|(z, _)| z).collect(),
    }
}

/// Mean error over standard error in the channel where it is largest in absolute value, and its p alone.
fn largest(errors: &SignedErrors, pixels: &[usize]) -> (f64, f64) {
    let of_channel = |channel| {
        let (mean, variance, freedom) = errors.over(pixels, channel);
        let beyond = (mean.abs() - errors.rounding).max(0.0).copysign(mean);
        if beyond == 0.0 {
            return (0.0, 1.0);
        }
        if variance == 0.0 {
            // An image without noise that differs; finite, for JSON has no infinity.
            return (1e9f64.copysign(beyond), 0.0);
        }
        let z = beyond / variance.sqrt();
        (z, two_sided_p(z, freedom.min(1e9)))
    };
    (0..3)
        .map(of_channel)
        .max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()))
        .expect("there are three channels")
}

/// The verdict over all repeats of a configuration; `errors` is `None` below two blocks of one of them.
pub(super) fn verdict(errors: Option<&SignedErrors>, by_design: Vec<String>) -> BiasTest {
    let Some(errors) = errors.filter(|errors| errors.suffice()) else {
        return BiasTest {
            verdict: BiasVerdict::Untested,
            mean_error: 0.0,
            z: None,
            block_p: None,
            worst_block: None,
            block: BLOCK,
            blocks: Vec::new(),
            by_design,
        };
    };
    let test = test(errors);
    let biased = test.z.abs() > BIASED_Z || test.block_p < BIASED_P;
    let across = errors.width.div_ceil(BLOCK) as usize;
    BiasTest {
        verdict: if biased {
            BiasVerdict::Biased
        } else {
            BiasVerdict::NotShown
        },
        mean_error: test.mean_error,
        z: Some(test.z),
        block_p: Some(test.block_p),
        worst_block: Some((
            (test.worst % across) as u32 * BLOCK,
            (test.worst / across) as u32 * BLOCK,
        )),
        block: BLOCK,
        blocks: test.blocks,
        by_design,
    }
}
