//! Measures of an image against a reference.

use super::bias::{SignedErrors, Test, test};
use super::results::Errors;
use crate::film::{Film, RELATIVE_EPSILON};
use crate::report::median;

/// Pixels across and down a block of the bias test and of the search for outliers.
pub(super) const BLOCK: u32 = 16;

/// Share of the pixels that the trimmed error leaves out.
const TRIMMED: f64 = 0.001;

/// Standard deviations from which a pixel is an outlier.
const OUTLIER: f64 = 20.0;

/// Root-mean-square error of an exact image by rounding to f32, over the image's mean: the tolerance of
/// the closed forms in the tests.
pub(super) const ROUNDING: f64 = 1e-5;

/// What images are held against.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ReferenceImage {
    /// Pixels across.
    pub(super) width: u32,
    /// Mean radiance, linear RGB, row by row from the top.
    pub(super) mean: Vec<[f64; 3]>,
    /// An estimate of the squared error of each value of `mean`, right on average: 0 if exact. Of two
    /// halves it is the square of half their difference, and (x − r)² less it is (x − r₁)(x − r₂).
    pub(super) noise: Vec<[f64; 3]>,
    /// Samples per pixel of both halves; 0 if exact or unknown.
    pub(super) samples: u64,
}

impl ReferenceImage {
    /// The mean of two independent halves that have so many samples per pixel together.
    pub(super) fn from_halves(width: u32, samples: u64, halves: [&[[f64; 3]]; 2]) -> Self {
        let both = || halves[0].iter().zip(halves[1]);
        let channels = |function: fn(f64, f64) -> f64| {
            both()
                .map(|(a, b)| std::array::from_fn(|k| function(a[k], b[k])))
                .collect()
        };
        Self {
            width,
            mean: channels(|a, b| 0.5 * (a + b)),
            noise: channels(|a, b| (0.5 * (a - b)).powi(2)),
            samples,
        }
    }

    /// An image without error.
    pub(super) fn exact(width: u32, mean: Vec<[f64; 3]>) -> Self {
        let noise = vec![[0.0; 3]; mean.len()];
        Self {
            width,
            mean,
            noise,
            samples: 0,
        }
    }

    /// Mean over pixels and channels.
    pub(super) fn image_mean(&self) -> f64 {
        mean_of(&self.mean)
    }

    /// Mean of `noise`: the variance of the reference.
    pub(super) fn variance(&self) -> f64 {
        mean_of(&self.noise)
    }

    /// The reference's own root-mean-square relative error.
    pub(super) fn relative_error(&self) -> f64 {
        let epsilon = self.epsilon();
        let sum: f64 = (0..self.mean.len())
            .map(|pixel| sum3(|k| relative(self.noise[pixel][k], self.mean[pixel][k], epsilon)))
            .sum();
        (sum / (3 * self.mean.len()) as f64).sqrt()
    }

    /// The MSE within which the reference's own error, or rounding, decides: that of an error of three
    /// times the reference's.
    pub(super) fn floor(&self) -> f64 {
        let rounding = (ROUNDING * self.image_mean()).powi(2);
        9.0 * self.variance().max(rounding)
    }

    /// What keeps a dark pixel from deciding a relative error.
    pub(super) fn epsilon(&self) -> f64 {
        RELATIVE_EPSILON * self.image_mean()
    }

    /// Mean over the channels of the squared relative error of a pixel of value `x`, the reference's own
    /// taken out.
    pub(super) fn relative_square(&self, pixel: usize, x: [f64; 3]) -> f64 {
        let epsilon = self.epsilon();
        self.relative_square_with(pixel, x, epsilon)
    }

    fn relative_square_with(&self, pixel: usize, x: [f64; 3], epsilon: f64) -> f64 {
        let (r, noise) = (self.mean[pixel], self.noise[pixel]);
        sum3(|k| relative((x[k] - r[k]).powi(2) - noise[k], r[k], epsilon)) / 3.0
    }
}

fn mean_of(values: &[[f64; 3]]) -> f64 {
    values.iter().flatten().sum::<f64>() / (3 * values.len()) as f64
}

fn sum3(value: impl Fn(usize) -> f64) -> f64 {
    (0..3).map(value).sum()
}

/// square / (reference² + ε²); 0 where nothing differs from an all-black reference.
fn relative(square: f64, reference: f64, epsilon: f64) -> f64 {
    if square == 0.0 {
        0.0
    } else {
        square / (reference * reference + epsilon * epsilon)
    }
}

/// Measures of the film's image, which has the reference's size.
pub(super) fn errors(film: &Film, reference: &ReferenceImage) -> Errors {
    let count = film.len() as f64;
    let epsilon = reference.epsilon();
    let mut squares = Vec::with_capacity(film.len());
    let mut relative = Vec::with_capacity(film.len());
    let mut smape = 0.0;
    for pixel in 0..film.len() {
        let (x, r) = (film.mean(pixel), reference.mean[pixel]);
        let noise = reference.noise[pixel];
        squares.push(sum3(|k| (x[k] - r[k]).powi(2) - noise[k]) / 3.0);
        relative.push(reference.relative_square_with(pixel, x, epsilon));
        smape += sum3(|k| {
            let size = x[k].abs() + r[k].abs() + epsilon;
            if size > 0.0 {
                2.0 * (x[k] - r[k]).abs() / size
            } else {
                0.0
            }
        });
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let mse = mean(&squares);
    let spread: f64 = squares.iter().map(|square| (square - mse).powi(2)).sum();
    let relmse = mean(&relative);
    relative.sort_unstable_by(f64::total_cmp);
    let kept = film.len() - (TRIMMED * count).ceil() as usize;

    let variances: Option<Vec<[f64; 3]>> =
        (0..film.len()).map(|pixel| film.variance(pixel)).collect();
    let outliers = variances
        .as_deref()
        .map(|variances| outliers(&squares, variances, reference));
    let bias: Option<Test> = SignedErrors::of(film, reference).as_ref().map(test);
    Errors {
        mse,
        mse_error: spread.sqrt() / count,
        relmse,
        relmse_trimmed: mean(&relative[..kept.max(1)]),
        smape: smape / (3.0 * count),
        estimated_variance: variances.as_deref().map(mean_of),
        estimated_error: film.relative_error(),
        bias_z: bias.as_ref().map(|bias| bias.z),
        block_p: bias.as_ref().map(|bias| bias.block_p),
        outliers: outliers.map(|(count, _)| count),
        outlier_share: outliers.map(|(_, share)| share),
    }
}

/// Pixels whose squared error is beyond that many times the median variance of their block, and the share
/// of the squared error that they carry.
fn outliers(squares: &[f64], variances: &[[f64; 3]], reference: &ReferenceImage) -> (u64, f64) {
    let rounding = (ROUNDING * reference.image_mean()).powi(2);
    let (mut count, mut carried) = (0, 0.0);
    for block in blocks(reference.width, squares.len()) {
        let mut inside: Vec<f64> = block
            .iter()
            .map(|&pixel| variances[pixel].iter().sum::<f64>() / 3.0)
            .collect();
        let limit = OUTLIER * OUTLIER * (median(&mut inside) + rounding);
        for &pixel in &block {
            if squares[pixel] > limit {
                count += 1;
                carried += squares[pixel];
            }
        }
    }
    let total: f64 = squares.iter().sum();
    let share = if total > 0.0 { carried / total } else { 0.0 };
    (count, share.min(1.0))
}

/// The pixels of each block of an image, block by block, row by row.
pub(super) fn blocks(width: u32, pixels: usize) -> Vec<Vec<usize>> {
    let (width, side) = (width as usize, BLOCK as usize);
    let height = pixels / width;
    let mut blocks = Vec::new();
    for top in (0..height).step_by(side) {
        for left in (0..width).step_by(side) {
            let rows = top..(top + side).min(height);
            let columns = left..(left + side).min(width);
            blocks.push(
                rows.flat_map(|y| columns.clone().map(move |x| y * width + x))
                    .collect(),
            );
        }
    }
    blocks
}
