//! Differences between two images: errors, their significance, and a picture of them.

use std::path::Path;

use crate::error::{Error, Result};

use super::openexr::ExrImage;
use super::png::{srgb_byte, write_rgb8};
use super::{RELATIVE_EPSILON, relative_square};

/// Differences of an image A from a reference B. Means run over pixels and the three channels; a
/// pixel with a value that is not finite in either image is left out and counted.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// Mean of (a − b)².
    pub mse: f64,
    /// Square root of the MSE.
    pub rmse: f64,
    /// Mean of (a − b)² / (b² + ε²), ε = [`RELATIVE_EPSILON`] × the mean of B.
    pub relmse: f64,
    /// The MSE that the noise of both images alone explains: the mean of their variances. An MSE
    /// close to it shows no difference beside noise. `None` unless both have variance layers.
    pub noise: Option<f64>,
    /// Mean of A per channel.
    pub mean_a: [f64; 3],
    /// Mean of B per channel.
    pub mean_b: [f64; 3],
    /// Mean of a − b per channel.
    pub mean_difference: [f64; 3],
    /// Standard error of the mean difference, pixels taken as independent. `None` unless both
    /// images have variance layers.
    pub standard_error: Option<[f64; 3]>,
    /// Largest |a − b|.
    pub max_difference: f64,
    /// Where it is: pixel column and row, from the top left.
    pub max_at: (u32, u32),
    /// Pixels left out because a value is not finite.
    pub non_finite: u64,
}

impl Comparison {
    /// Mean difference in units of its standard error, per channel: |z| > 4 is hardly chance. Infinite
    /// where noiseless images differ.
    pub fn z(&self) -> Option<[f64; 3]> {
        let error = self.standard_error?;
        Some(std::array::from_fn(|channel| {
            let difference = self.mean_difference[channel];
            if difference == 0.0 {
                0.0
            } else {
                difference / error[channel]
            }
        }))
    }
}

/// Compares A with the reference B. Errors if their sizes differ or no pixel is finite in both.
pub fn compare(a: &ExrImage, b: &ExrImage) -> Result<Comparison> {
    check_sizes(a, b)?;
    let pixels: Vec<usize> = (0..a.mean.len())
        .filter(|&pixel| finite(a, pixel) && finite(b, pixel))
        .collect();
    if pixels.is_empty() {
        return Err(Error::usage("no pixel is finite in both images"));
    }
    let count = pixels.len() as f64;
    let mean = |image: &ExrImage| -> [f64; 3] {
        let mut sum = [0.0; 3];
        for &pixel in &pixels {
            for (sum, value) in sum.iter_mut().zip(image.mean[pixel]) {
                *sum += f64::from(value);
            }
        }
        sum.map(|sum| sum / count)
    };
    let (mean_a, mean_b) = (mean(a), mean(b));
    let epsilon = RELATIVE_EPSILON * mean_b.iter().sum::<f64>() / 3.0;

    let mut squares = 0.0;
    let mut relative = 0.0;
    let mut difference = [0.0; 3];
    let mut max_difference = 0.0;
    let mut max_pixel = pixels[0];
    for &pixel in &pixels {
        for (channel, (&value, &reference)) in a.mean[pixel].iter().zip(&b.mean[pixel]).enumerate()
        {
            let reference = f64::from(reference);
            let delta = f64::from(value) - reference;
            difference[channel] += delta;
            squares += delta * delta;
            relative += relative_square(delta * delta, reference, epsilon);
            if delta.abs() > max_difference {
                (max_difference, max_pixel) = (delta.abs(), pixel);
            }
        }
    }
    let variance = variance_sums(a, b, &pixels);
    let mse = squares / (3.0 * count);
    Ok(Comparison {
        mse,
        rmse: mse.sqrt(),
        relmse: relative / (3.0 * count),
        noise: variance.map(|sums| sums.iter().sum::<f64>() / (3.0 * count)),
        mean_a,
        mean_b,
        mean_difference: difference.map(|sum| sum / count),
        standard_error: variance.map(|sums| sums.map(|sum| sum.sqrt() / count)),
        max_difference,
        max_at: (
            (max_pixel % a.width as usize) as u32,
            (max_pixel / a.width as usize) as u32,
        ),
        non_finite: (a.mean.len() - pixels.len()) as u64,
    })
}

/// Writes a PNG of the relative difference of luminance, (Y_a − Y_b) / (Y_b + ε) with ε as for
/// relMSE: red where A is brighter, blue where it is darker, black where they agree, full colour at
/// a difference of 100 %, green where a value is not finite. The sRGB curve lifts small differences:
/// 1 % has a tenth of the full byte value.
pub fn write_difference(path: &Path, a: &ExrImage, b: &ExrImage) -> Result<()> {
    check_sizes(a, b)?;
    let luminances: Vec<Option<[f64; 2]>> = (0..a.mean.len())
        .map(|pixel| {
            let both_finite = finite(a, pixel) && finite(b, pixel);
            both_finite.then(|| [luminance(a.mean[pixel]), luminance(b.mean[pixel])])
        })
        .collect();
    let count = luminances.iter().flatten().count().max(1) as f64;
    let mean = luminances.iter().flatten().map(|[_, y]| y).sum::<f64>() / count;
    let epsilon = RELATIVE_EPSILON * mean;
    let bytes: Vec<u8> = luminances
        .iter()
        .flat_map(|pair| false_colour(*pair, epsilon))
        .collect();
    write_rgb8(path, a.width, a.height, &bytes)
}

/// The bytes of such a picture of two images that are finite everywhere and of one size.
pub(crate) fn difference_rgb8(a: &[[f64; 3]], b: &[[f64; 3]]) -> Vec<u8> {
    let mean = b.iter().copied().map(luminance).sum::<f64>() / b.len().max(1) as f64;
    let epsilon = RELATIVE_EPSILON * mean;
    let colour = |(&a, &b)| false_colour(Some([luminance(a), luminance(b)]), epsilon);
    a.iter().zip(b).flat_map(colour).collect()
}

fn false_colour(luminances: Option<[f64; 2]>, epsilon: f64) -> [u8; 3] {
    let Some([a, b]) = luminances else {
        return [0, 255, 0];
    };
    let difference = a - b;
    let byte = srgb_byte(difference.abs() / (b.abs() + epsilon));
    if difference > 0.0 {
        [byte, 0, 0]
    } else {
        [0, 0, byte]
    }
}

/// Relative luminance of linear sRGB (Rec. 709 weights).
fn luminance(rgb: [impl Into<f64>; 3]) -> f64 {
    let [red, green, blue] = rgb.map(Into::into);
    0.2126 * red + 0.7152 * green + 0.0722 * blue
}

fn check_sizes(a: &ExrImage, b: &ExrImage) -> Result<()> {
    if (a.width, a.height) == (b.width, b.height) {
        return Ok(());
    }
    Err(Error::usage(format!(
        "the images differ in size: {} × {} and {} × {}",
        a.width, a.height, b.width, b.height
    )))
}

fn finite(image: &ExrImage, pixel: usize) -> bool {
    let variance = image
        .variance
        .as_ref()
        .map_or([0.0; 3], |variance| variance[pixel]);
    image.mean[pixel]
        .iter()
        .chain(&variance)
        .all(|value| value.is_finite())
}

/// Sum over pixels of both images' variances, per channel.
fn variance_sums(a: &ExrImage, b: &ExrImage, pixels: &[usize]) -> Option<[f64; 3]> {
    let (a, b) = (a.variance.as_ref()?, b.variance.as_ref()?);
    let mut sums = [0.0; 3];
    for &pixel in pixels {
        for (sum, (&a, &b)) in sums.iter_mut().zip(a[pixel].iter().zip(&b[pixel])) {
            *sum += f64::from(a) + f64::from(b);
        }
    }
    Some(sums)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(mean: Vec<[f32; 3]>, variance: Option<f32>) -> ExrImage {
        let len = mean.len();
        ExrImage {
            width: 2,
            height: len as u32 / 2,
            mean,
            variance: variance.map(|variance| vec![[variance; 3]; len]),
            samples: None,
        }
    }

    #[test]
    fn errors_of_a_known_difference_are_their_closed_forms() {
        let b = image(vec![[1.0; 3]; 4], None);
        let mut a = b.clone();
        a.mean[2] = [1.0, 1.5, 1.0];
        let result = compare(&a, &b).unwrap();
        let epsilon = 0.01f64;
        assert_eq!(result.mse, 0.25 / 12.0);
        assert_eq!(result.rmse, (0.25f64 / 12.0).sqrt());
        assert!((result.relmse - 0.25 / 12.0 / (1.0 + epsilon * epsilon)).abs() < 1e-15);
        assert_eq!(result.mean_difference, [0.0, 0.125, 0.0]);
        assert_eq!(
            (result.mean_a, result.mean_b),
            ([1.0, 1.125, 1.0], [1.0; 3])
        );
        assert_eq!((result.max_difference, result.max_at), (0.5, (0, 1)));
        assert_eq!(
            (result.standard_error, result.z(), result.noise),
            (None, None, None)
        );
    }

    #[test]
    fn relmse_does_not_depend_on_exposure() {
        let pixels = |scale: f32| -> Vec<[f32; 3]> {
            (0..8)
                .map(|i| [scale * i as f32, scale, scale * 0.25])
                .collect()
        };
        let relmse = |scale: f32| {
            let mut a = image(pixels(scale), None);
            a.mean[3][1] *= 1.5;
            a.mean[0][0] += 0.125 * scale;
            compare(&a, &image(pixels(scale), None)).unwrap().relmse
        };
        assert!((relmse(1024.0) / relmse(1.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn standard_error_is_that_of_the_image_mean() {
        // 4 pixels, variances 0.03 and 0.01 each: se = sqrt(4 · 0.04) / 4 = 0.1.
        let a = image(vec![[1.3; 3]; 4], Some(0.03));
        let b = image(vec![[1.0; 3]; 4], Some(0.01));
        let result = compare(&a, &b).unwrap();
        assert!((result.standard_error.unwrap()[0] - 0.1).abs() < 1e-8);
        assert!((result.z().unwrap()[2] - 3.0).abs() < 1e-5);
        assert!((result.noise.unwrap() - 0.04).abs() < 1e-8);
    }

    #[test]
    fn noiseless_images_differ_infinitely_or_not_at_all() {
        let b = image(vec![[1.0; 3]; 4], Some(0.0));
        let mut a = b.clone();
        assert_eq!(compare(&a, &b).unwrap().z(), Some([0.0; 3]));
        a.mean[0][1] = 0.5;
        assert_eq!(
            compare(&a, &b).unwrap().z(),
            Some([0.0, f64::NEG_INFINITY, 0.0])
        );
    }

    #[test]
    fn pixels_that_are_not_finite_are_counted_and_left_out() {
        let b = image(vec![[1.0; 3]; 4], None);
        let mut a = image(vec![[2.0; 3]; 4], None);
        a.mean[1][0] = f32::NAN;
        a.mean[2][2] = f32::INFINITY;
        let result = compare(&a, &b).unwrap();
        assert_eq!((result.non_finite, result.mse), (2, 1.0));
        let none = image(vec![[f32::NAN; 3]; 4], None);
        assert!(
            compare(&none, &b)
                .unwrap_err()
                .message
                .contains("no pixel is finite")
        );
    }

    #[test]
    fn black_reference_is_met_exactly_or_infinitely_missed() {
        let black = image(vec![[0.0; 3]; 4], None);
        assert_eq!(compare(&black, &black).unwrap().relmse, 0.0);
        let grey = image(vec![[0.5; 3]; 4], None);
        assert_eq!(compare(&grey, &black).unwrap().relmse, f64::INFINITY);
    }

    #[test]
    fn images_of_different_size_are_refused_with_both_sizes() {
        let message = compare(
            &image(vec![[0.0; 3]; 4], None),
            &image(vec![[0.0; 3]; 6], None),
        )
        .unwrap_err()
        .message;
        assert!(message.contains("2 × 2 and 2 × 3"), "{message}");
    }

    #[test]
    fn difference_image_shows_sign_agreement_and_faults_by_colour() {
        let b = image(vec![[1.0; 3]; 4], None);
        let mut a = b.clone();
        a.mean[0] = [9.0; 3];
        a.mean[1] = [0.0; 3];
        a.mean[3] = [f32::NAN; 3];
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("difference.png");
        write_difference(&path, &a, &b).unwrap();
        let shown: Vec<[u8; 3]> = image::open(&path)
            .unwrap()
            .into_rgb8()
            .pixels()
            .map(|pixel| pixel.0)
            .collect();
        assert_eq!(shown[0], [255, 0, 0]);
        assert_eq!((shown[1][0], shown[1][1]), (0, 0));
        assert!(shown[1][2] > 250);
        assert_eq!(shown[2], [0, 0, 0]);
        assert_eq!(shown[3], [0, 255, 0]);
    }
}
