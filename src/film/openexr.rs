//! OpenEXR: linear f32 with the film's layers, written and read back.
//!
//! Channels of a file written here, all in one part and of the data window's size:
//!
//! | channels | type | meaning | present |
//! | --- | --- | --- | --- |
//! | `R` `G` `B` | f32 | mean radiance, linear RGB, W·sr⁻¹·m⁻² | always |
//! | `samples.Y` | u32 | samples of the pixel | always |
//! | `variance.R` `.G` `.B` | f32 | variance of the mean | if every pixel has two blocks |
//! | `albedo.R` `.G` `.B` | f32 | albedo of the first hit | with aux |
//! | `normal.X` `.Y` `.Z` | f32 | normal of the first hit, world space | with aux |
//! | `depth.Z` | f32 | distance of the first hit | with aux |

use std::fs::File;
use std::io::{BufReader, BufWriter};
use std::path::Path;

use exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer};
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, Text};
use exr::meta::header::{Header, LayerAttributes};
use exr::prelude::{ReadChannels, ReadLayers, WritableImage, read};

use crate::error::{Error, Result};

use super::memory::available_bytes;
use super::output::write_atomically;
use super::{AuxMeans, Film, Provenance};

/// What a comparison needs from an EXR file.
#[derive(Debug, Clone, PartialEq)]
pub struct ExrImage {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Linear RGB, row by row from the top. May hold values that are not finite.
    pub mean: Vec<[f32; 3]>,
    /// Variance of the mean, from the layer `variance`.
    pub variance: Option<Vec<[f32; 3]>>,
    /// Samples per pixel, from the layer `samples`.
    pub samples: Option<Vec<u32>>,
}

/// Bytes of the channels that are held while a film is written.
pub(super) fn write_bytes(width: u32, height: u32, aux: bool) -> u64 {
    let channels = if aux { 14 } else { 7 };
    u64::from(width) * u64::from(height) * channels * size_of::<f32>() as u64
}

/// Writes every layer that the film has.
pub(super) fn write(path: &Path, film: &Film, provenance: &Provenance) -> Result<()> {
    let mut channels = Vec::with_capacity(14);
    rgb(&mut channels, "", film.len(), |pixel| film.mean(pixel));
    let samples = (0..film.len())
        .map(|pixel| u32::try_from(film.samples(pixel)).unwrap_or(u32::MAX))
        .collect();
    channels.push(AnyChannel::new("samples.Y", FlatSamples::U32(samples)));
    let variance: Option<Vec<_>> = (0..film.len()).map(|pixel| film.variance(pixel)).collect();
    if let Some(variance) = variance {
        rgb(&mut channels, "variance.", film.len(), |pixel| {
            variance[pixel]
        });
    }
    if film.has_aux() {
        let aux = |pixel| -> AuxMeans { film.aux(pixel).unwrap_or_default() };
        rgb(&mut channels, "albedo.", film.len(), |pixel| {
            aux(pixel).albedo
        });
        for (axis, name) in ["normal.X", "normal.Y", "normal.Z"].into_iter().enumerate() {
            channels.push(channel(name, film.len(), |pixel| aux(pixel).normal[axis]));
        }
        channels.push(channel("depth.Z", film.len(), |pixel| aux(pixel).depth));
    }
    let layer = Layer::new(
        (film.width() as usize, film.height() as usize),
        attributes(film, provenance),
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(channels.into()),
    );
    write_atomically(path, |file| {
        Image::from_layer(layer)
            .write()
            .to_buffered(BufWriter::new(file))
            .map_err(|error| failure(path, error))
    })
}

/// Adds the channels `{layer}R`, `{layer}G`, `{layer}B`.
fn rgb(
    channels: &mut Vec<AnyChannel<FlatSamples>>,
    layer: &str,
    len: usize,
    value: impl Fn(usize) -> [f64; 3],
) {
    for (index, name) in ["R", "G", "B"].into_iter().enumerate() {
        channels.push(channel(&format!("{layer}{name}"), len, |pixel| {
            value(pixel)[index]
        }));
    }
}

/// One f32 channel. Values past the largest f32 become it, so that finite values stay finite.
fn channel(name: &str, len: usize, value: impl Fn(usize) -> f64) -> AnyChannel<FlatSamples> {
    let limit = f64::from(f32::MAX);
    let values = (0..len)
        .map(|pixel| value(pixel).clamp(-limit, limit) as f32)
        .collect();
    AnyChannel::new(name, FlatSamples::F32(values))
}

fn attributes(film: &Film, provenance: &Provenance) -> LayerAttributes {
    let samples = match (film.min_samples(), film.max_samples()) {
        (min, max) if min == max => min.to_string(),
        (min, max) => format!("{min}-{max}"),
    };
    let mut attributes = LayerAttributes {
        software_name: Some(latin1(&provenance.software)),
        ..LayerAttributes::default()
    };
    for (name, value) in [
        ("scene", provenance.scene.as_str()),
        ("seed", &provenance.seed.to_string()),
        ("samplesPerPixel", &samples),
        ("bias", &provenance.bias.join("; ")),
    ]
    .into_iter()
    .filter(|(_, value)| !value.is_empty())
    {
        attributes
            .other
            .insert(latin1(name), AttributeValue::Text(latin1(value)));
    }
    attributes
}

/// Attribute text, which the format limits to one byte per character; others become `?`.
fn latin1(text: &str) -> Text {
    let bytes: Vec<u8> = text
        .chars()
        .map(|c| {
            u8::try_from(c)
                .ok()
                .filter(|_| !c.is_control())
                .unwrap_or(b'?')
        })
        .collect();
    Text::from_slice_unchecked(&bytes)
}

/// Reads the first layer that has `R`, `G` and `B`, with the layers `variance` and `samples` where
/// they exist. Half, float and integer channels of any renderer are accepted. Errors on a file that
/// is no EXR, is damaged, lacks the channels, or would not fit into memory.
pub fn read_exr(path: &Path) -> Result<ExrImage> {
    let open = || {
        File::open(path)
            .map(BufReader::new)
            .map_err(|error| Error::io(path, &error))
    };
    let metadata = MetaData::read_from_buffered(open()?, false).map_err(|e| failure(path, e))?;
    check_size(path, &metadata.headers)?;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(open()?)
        .map_err(|error| failure(path, error))?;

    let layer = image.layer_data.iter().find_map(|layer| {
        let mean = find_rgb(&layer.channel_data, "")?;
        Some((layer, mean))
    });
    let Some((layer, mean)) = layer else {
        return Err(Error::file(path, "no layer has the channels R, G and B"));
    };
    let too_large = |_| Error::file(path, "the image is too large");
    let result = ExrImage {
        width: u32::try_from(layer.size.width()).map_err(too_large)?,
        height: u32::try_from(layer.size.height()).map_err(too_large)?,
        mean,
        variance: find_rgb(&layer.channel_data, "variance."),
        samples: find(&layer.channel_data, "samples.Y").map(|samples| match samples {
            FlatSamples::U32(values) => values.clone(),
            other => other.values_as_f32().map(|value| value as u32).collect(),
        }),
    };
    let pixels = layer.size.area();
    let lengths = [
        Some(result.mean.len()),
        result.variance.as_ref().map(Vec::len),
        result.samples.as_ref().map(Vec::len),
    ];
    if lengths.into_iter().flatten().any(|len| len != pixels) {
        return Err(Error::file(path, "a channel has not one value per pixel"));
    }
    Ok(result)
}

/// Errors if the decoded channels, and the copies made of them, exceed the available memory.
fn check_size(path: &Path, headers: &[Header]) -> Result<()> {
    let needed = headers.iter().fold(0u64, |total, header| {
        let pixels = header.layer_size.area() as u64;
        let channels = header.channels.list.len() as u64;
        // At most 4 bytes per value, twice: as decoded and as returned.
        total.saturating_add(pixels.saturating_mul(channels).saturating_mul(8))
    });
    match available_bytes() {
        Some(available) if needed > available => Err(Error::file(
            path,
            format!("the image needs {needed} bytes of memory, and {available} are available"),
        )),
        _ => Ok(()),
    }
}

fn find<'a>(channels: &'a AnyChannels<FlatSamples>, name: &str) -> Option<&'a FlatSamples> {
    channels
        .list
        .iter()
        .find(|channel| channel.name == *name)
        .map(|channel| &channel.sample_data)
}

/// The channels `{layer}R`, `{layer}G`, `{layer}B` as one list, if all are there.
fn find_rgb(channels: &AnyChannels<FlatSamples>, layer: &str) -> Option<Vec<[f32; 3]>> {
    let channel = |name: &str| find(channels, &format!("{layer}{name}"));
    let (red, green, blue) = (channel("R")?, channel("G")?, channel("B")?);
    let pixels = red
        .values_as_f32()
        .zip(green.values_as_f32())
        .zip(blue.values_as_f32());
    Some(pixels.map(|((r, g), b)| [r, g, b]).collect())
}

/// The library's error as ours, with the file.
fn failure(path: &Path, error: exr::error::Error) -> Error {
    match error {
        exr::error::Error::Io(error) => Error::io(path, &error),
        other => Error::file(path, format!("not a readable EXR image: {other}")),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn provenance() -> Provenance {
        Provenance {
            scene: "größe → 1".into(),
            software: "test".into(),
            seed: u64::MAX,
            bias: vec!["clamp 1: 2 samples".into(), "none".into()],
        }
    }

    /// 5 × 3 pixels with two blocks each, and attributes.
    fn film() -> Film {
        let mut film = Film::new(5, 3, true);
        for pixel in 0..film.len() {
            let x = pixel as f64;
            film.add_block(pixel, 2, [x, 0.5 * x, 1e-3]);
            film.add_block(pixel, 2, [x + 1.0, 0.5 * x, 3e-3]);
            film.add_aux(pixel, 4, [2.0, 1.0, 0.0], [0.0, 4.0, 0.0], 4.0 * x);
        }
        film
    }

    fn written(film: &Film) -> (tempfile::TempDir, std::path::PathBuf) {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("image.exr");
        write(&path, film, &provenance()).unwrap();
        (directory, path)
    }

    #[test]
    fn film_survives_the_round_trip_in_f32() {
        let film = film();
        let (_directory, path) = written(&film);
        let image = read_exr(&path).unwrap();
        assert_eq!((image.width, image.height), (5, 3));
        let variance = image.variance.unwrap();
        for (pixel, (mean, variance)) in image.mean.iter().zip(&variance).enumerate() {
            assert_eq!(*mean, film.mean(pixel).map(|v| v as f32));
            assert_eq!(*variance, film.variance(pixel).unwrap().map(|v| v as f32));
        }
        assert_eq!(image.samples.unwrap(), vec![4; film.len()]);
    }

    #[test]
    fn file_has_exactly_the_documented_channels_and_attributes() {
        let names = |film: &Film| {
            let (_directory, path) = written(film);
            let header = MetaData::read_from_file(&path, true)
                .unwrap()
                .headers
                .remove(0);
            let mut names: Vec<String> = header
                .channels
                .list
                .iter()
                .map(|channel| channel.name.to_string())
                .collect();
            names.sort();
            (names, header.own_attributes)
        };
        let (all, attributes) = names(&film());
        let expected = "B G R albedo.B albedo.G albedo.R depth.Z normal.X normal.Y normal.Z \
                        samples.Y variance.B variance.G variance.R";
        assert_eq!(all.join(" "), expected);
        assert_eq!(all.len() as u64 * 4 * 15, write_bytes(5, 3, true));
        let text = |name: &str| match &attributes.other[&Text::from(name)] {
            AttributeValue::Text(text) => text.to_string(),
            other => panic!("{name} is {other:?}"),
        };
        assert_eq!(text("seed"), u64::MAX.to_string());
        assert_eq!(text("samplesPerPixel"), "4");
        assert_eq!(text("scene"), "größe ? 1");

        let mut single = Film::new(5, 3, false);
        single.add_block(0, 1, [1.0; 3]);
        assert_eq!(names(&single).0.join(" "), "B G R samples.Y");
    }

    #[test]
    fn huge_radiance_stays_finite() {
        let mut film = Film::new(1, 1, false);
        film.add_block(0, 1, [1e60, 1.0, 0.0]);
        let (_directory, path) = written(&film);
        assert_eq!(read_exr(&path).unwrap().mean[0], [f32::MAX, 1.0, 0.0]);
    }

    #[test]
    fn truncated_file_is_an_error_at_every_length() {
        let (_directory, path) = written(&film());
        let bytes = fs::read(&path).unwrap();
        for length in 0..bytes.len() {
            fs::write(&path, &bytes[..length]).unwrap();
            let message = read_exr(&path).unwrap_err().to_string();
            assert!(message.contains("image.exr"), "{length}: {message}");
        }
    }

    #[test]
    fn damaged_file_never_panics() {
        let (_directory, path) = written(&film());
        let bytes = fs::read(&path).unwrap();
        for position in 0..bytes.len() {
            for value in [0, 1, 0x7f, 0x80, 0xff] {
                let mut damaged = bytes.clone();
                damaged[position] = value;
                fs::write(&path, &damaged).unwrap();
                if let Ok(image) = read_exr(&path) {
                    assert_eq!(
                        image.mean.len(),
                        image.width as usize * image.height as usize
                    );
                }
            }
        }
    }

    #[test]
    fn missing_colour_channels_are_named() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("depth.exr");
        let channels = AnyChannels::sort(vec![channel("Z", 4, |_| 1.0)].into());
        let layer = Layer::new(
            (2, 2),
            LayerAttributes::default(),
            Encoding::default(),
            channels,
        );
        Image::from_layer(layer).write().to_file(&path).unwrap();
        let message = read_exr(&path).unwrap_err().to_string();
        assert!(
            message.ends_with("no layer has the channels R, G and B"),
            "{message}"
        );
    }

    #[test]
    fn file_that_is_missing_or_no_exr_is_an_error_with_its_name() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("other.exr");
        assert!(
            read_exr(&path)
                .unwrap_err()
                .to_string()
                .contains("other.exr: No such file")
        );
        fs::write(&path, "P6 1 1 255 rgb").unwrap();
        assert!(
            read_exr(&path)
                .unwrap_err()
                .to_string()
                .contains("not a readable EXR")
        );
    }
}
