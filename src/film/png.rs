//! PNG: 8-bit sRGB of a film, for looking at.

use std::io::BufWriter;
use std::path::Path;

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageError};

use crate::error::{Error, Result};

use super::Film;
use super::output::write_atomically;

/// Writes mean radiance × 2^`exposure` through the sRGB curve, values above 1 clipped to white.
pub(super) fn write(path: &Path, film: &Film, exposure: f64) -> Result<()> {
    let means: Vec<[f64; 3]> = (0..film.len()).map(|pixel| film.mean(pixel)).collect();
    let bytes = display_rgb8(&means, exposure);
    write_rgb8(path, film.width(), film.height(), &bytes)
}

/// Radiance × 2^`exposure` through the sRGB curve, values above 1 clipped to white.
pub(crate) fn display_rgb8(radiance: &[[f64; 3]], exposure: f64) -> Vec<u8> {
    let gain = exposure.exp2();
    let values = radiance.as_flattened().iter();
    values.map(|value| srgb_byte(value * gain)).collect()
}

/// Grey of these values through the sRGB curve, white at 1 and above.
pub(crate) fn grey_rgb8(values: &[f64]) -> Vec<u8> {
    values
        .iter()
        .flat_map(|&value| [srgb_byte(value); 3])
        .collect()
}

/// Writes 8-bit RGB rows, top row first.
pub(super) fn write_rgb8(path: &Path, width: u32, height: u32, bytes: &[u8]) -> Result<()> {
    write_atomically(path, |file| {
        encode(BufWriter::new(file), width, height, bytes).map_err(|error| match error {
            ImageError::IoError(error) => Error::io(path, &error),
            other => Error::io(path, &std::io::Error::other(other)),
        })
    })
}

/// The PNG file of 8-bit RGB rows, top row first: `width` × `height` × 3 bytes.
pub(crate) fn encode_rgb8(width: u32, height: u32, bytes: &[u8]) -> Vec<u8> {
    let mut file = Vec::new();
    encode(&mut file, width, height, bytes).expect("writing to memory does not fail");
    file
}

fn encode(
    file: impl std::io::Write,
    width: u32,
    height: u32,
    bytes: &[u8],
) -> std::result::Result<(), ImageError> {
    PngEncoder::new(file).write_image(bytes, width, height, ExtendedColorType::Rgb8)
}

/// The sRGB transfer curve (IEC 61966-2-1) of a linear value, clipped to [0, 1], as a byte. NaN,
/// which only 0 × ∞ could make here, is black.
pub(super) fn srgb_byte(linear: f64) -> u8 {
    let clipped = if linear.is_nan() {
        0.0
    } else {
        linear.clamp(0.0, 1.0)
    };
    let encoded = if clipped <= 0.003_130_8 {
        12.92 * clipped
    } else {
        1.055 * clipped.powf(1.0 / 2.4) - 0.055
    };
    (encoded * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curve_has_its_published_values_and_is_monotonic() {
        // 0.5 linear is 187.5160 of 255; mid-grey 18 % is 117.6.
        for (linear, byte) in [
            (0.0, 0),
            (1.0, 255),
            (0.5, 188),
            (0.18, 118),
            (0.0031308, 10),
            (0.001, 3),
        ] {
            assert_eq!(srgb_byte(linear), byte, "{linear}");
        }
        let bytes: Vec<u8> = (0..=10_000)
            .map(|i| srgb_byte(f64::from(i) / 10_000.0))
            .collect();
        assert!(bytes.is_sorted());
    }

    #[test]
    fn values_outside_the_range_are_clipped_and_nan_is_black() {
        for (linear, byte) in [
            (-1.0, 0),
            (7.0, 255),
            (f64::INFINITY, 255),
            (f64::NEG_INFINITY, 0),
            (f64::NAN, 0),
        ] {
            assert_eq!(srgb_byte(linear), byte, "{linear}");
        }
    }

    #[test]
    fn file_holds_the_exposed_pixels_in_row_order() {
        let mut film = Film::new(3, 2, false);
        for pixel in 0..film.len() {
            film.add_block(pixel, 2, [0.02 * pixel as f64, 0.5, 4.0]);
        }
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("image.png");
        write(&path, &film, 1.0).unwrap();
        let decoded = image::open(&path).unwrap().into_rgb8();
        assert_eq!(decoded.dimensions(), (3, 2));
        for pixel in 0..film.len() {
            let expected = [srgb_byte(0.02 * pixel as f64), srgb_byte(0.5), 255];
            assert_eq!(
                decoded.get_pixel(pixel as u32 % 3, pixel as u32 / 3).0,
                expected
            );
        }
    }
}
