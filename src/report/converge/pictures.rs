//! Images of a comparison as PNG files: the reference, renders, and where their error is.

use std::io::Write;
use std::path::Path;

use super::errors::ReferenceImage;
use super::results::{Picture, Row, SlowPixel};
use crate::error::{Error, Result};
use crate::film::{Film, difference_rgb8, display_rgb8, encode_rgb8, grey_rgb8, write_atomically};

/// How many pixels are told.
const SLOW_PIXELS: usize = 16;

/// The image of a checkpoint, kept until it is known which one is shown.
#[derive(Debug)]
pub(super) struct Snapshot {
    samples: u64,
    pub(super) cpu_seconds: f64,
    relative_error: Option<f64>,
    /// PNG files.
    image: Vec<u8>,
    error_image: Vec<u8>,
}

impl Snapshot {
    /// Of the film at the checkpoint of `row`.
    pub(super) fn of(film: &Film, reference: &ReferenceImage, exposure: f64, row: &Row) -> Self {
        let means: Vec<[f64; 3]> = (0..film.len()).map(|pixel| film.mean(pixel)).collect();
        let size = (film.width(), film.height());
        let difference = difference_rgb8(&means, &reference.mean);
        let relmse = row.errors.relmse;
        Self {
            samples: row.samples,
            cpu_seconds: row.cpu_seconds,
            relative_error: (relmse > 0.0).then(|| relmse.sqrt()),
            image: encode_rgb8(size.0, size.1, &display_rgb8(&means, exposure)),
            error_image: encode_rgb8(size.0, size.1, &difference),
        }
    }
}

/// Writes the pictures of configuration `number`: a snapshot of it and the map of its mean squared
/// relative errors per pixel.
pub(super) fn write_picture(
    folder: &Path,
    number: usize,
    snapshot: &Snapshot,
    width: u32,
    relative: &[f64],
) -> Result<Picture> {
    let roots: Vec<f64> = relative
        .iter()
        .map(|square| square.max(0.0).sqrt())
        .collect();
    let map = encode_rgb8(width, roots.len() as u32 / width, &grey_rgb8(&roots));
    let file = |kind: &str, bytes: &[u8]| {
        let name = format!("{kind}-{number}.png");
        write_bytes(&folder.join(&name), bytes).map(|()| name)
    };
    Ok(Picture {
        image: file("image", &snapshot.image)?,
        error_image: file("error", &snapshot.error_image)?,
        error_map: file("map", &map)?,
        samples: snapshot.samples,
        cpu_seconds: snapshot.cpu_seconds,
        relative_error: snapshot.relative_error,
    })
}

/// Writes the picture of reference `number` and returns its file's name.
pub(super) fn write_reference(
    folder: &Path,
    number: usize,
    reference: &ReferenceImage,
    exposure: f64,
) -> Result<String> {
    let name = format!("reference-{number}.png");
    let height = reference.mean.len() as u32 / reference.width;
    let rgb = display_rgb8(&reference.mean, exposure);
    write_bytes(
        &folder.join(&name),
        &encode_rgb8(reference.width, height, &rgb),
    )?;
    Ok(name)
}

fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    write_atomically(path, |file| {
        file.write_all(bytes)
            .map_err(|error| Error::io(path, &error))
    })
}

/// The pixels with the largest mean squared relative errors.
pub(super) fn slowest(width: u32, relative: &[f64]) -> Vec<SlowPixel> {
    let total: f64 = relative.iter().sum();
    let mut order: Vec<usize> = (0..relative.len())
        .filter(|&pixel| relative[pixel] > 0.0)
        .collect();
    order.sort_unstable_by(|&a, &b| relative[b].total_cmp(&relative[a]));
    order.truncate(SLOW_PIXELS);
    let pixel = |pixel: usize| SlowPixel {
        x: pixel as u32 % width,
        y: pixel as u32 / width,
        relative_error: relative[pixel].sqrt(),
        share: if total > 0.0 {
            (relative[pixel] / total).min(1.0)
        } else {
            0.0
        },
    };
    order.into_iter().map(pixel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slowest_pixels_come_worst_first_with_their_shares() {
        let slow = slowest(3, &[0.01, 0.0, -0.1, 0.04, 0.09, 0.16]);
        let places: Vec<(u32, u32)> = slow.iter().map(|pixel| (pixel.x, pixel.y)).collect();
        assert_eq!(places, [(2, 1), (1, 1), (0, 1), (0, 0)]);
        assert!((slow[0].relative_error - 0.4).abs() < 1e-15);
        assert!((slow[0].share - 0.8).abs() < 1e-12);
    }
}
