//! Small copies of pictures, for pages that show many.

use std::io::{BufWriter, Write};
use std::path::Path;

use image::DynamicImage;
use image::codecs::jpeg::JpegEncoder;
use image::imageops::FilterType;

use crate::error::{Error, Result};
use crate::film::write_atomically;

/// Pixels across and down.
const SIDE: u32 = 200;

/// JPEG quality of 100: edges and noise still look as they are.
const QUALITY: u8 = 88;

/// Writes a square copy of a PNG image as JPEG. Pictures with fewer pixels keep them as squares.
pub(super) fn write(path: &Path, png: &[u8]) -> Result<()> {
    let failed = |error: image::ImageError| Error::io(path, &std::io::Error::other(error));
    let picture = image::load_from_memory(png).map_err(failed)?;
    let filter = if picture.width() < SIDE {
        FilterType::Nearest
    } else {
        FilterType::Triangle
    };
    let small = DynamicImage::from(picture.resize_exact(SIDE, SIDE, filter).into_rgb8());
    write_atomically(path, |file| {
        let mut output = BufWriter::new(file);
        small
            .write_with_encoder(JpegEncoder::new_with_quality(&mut output, QUALITY))
            .map_err(failed)?;
        output.flush().map_err(|error| Error::io(path, &error))
    })
}
