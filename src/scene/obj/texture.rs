//! Pictures of materials: map lines, decoding, and one copy of each.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use image::{DynamicImage, ImageReader};

use super::locate;
use crate::scene::description::{TextureDescription, TextureId};

/// What a picture is used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Use {
    /// Its colours.
    Colour,
    /// How opaque it says a surface is: its alpha if it has one, else the mean of its channels. Those
    /// are shares and not colours: they have no sRGB curve.
    Opacity,
    /// Its alpha, if that is below 1 anywhere.
    Alpha,
}

/// The pictures of one OBJ file's materials.
#[derive(Debug)]
pub(super) struct Pictures<'a> {
    folder: &'a Path,
    textures: &'a mut Vec<TextureDescription>,
    /// Decoded files, or why they could not be.
    images: HashMap<PathBuf, Result<DynamicImage, String>>,
    known: HashMap<(PathBuf, Use), Option<TextureId>>,
    /// One line per file that is missing or cannot be decoded.
    pub(super) failures: Vec<String>,
    /// Map lines with options, which are left out.
    pub(super) options: usize,
}

impl<'a> Pictures<'a> {
    /// None yet; files are named relative to `folder`, and textures go to `textures`.
    pub(super) fn new(folder: &'a Path, textures: &'a mut Vec<TextureDescription>) -> Self {
        Self {
            folder,
            textures,
            images: HashMap::new(),
            known: HashMap::new(),
            failures: Vec::new(),
            options: 0,
        }
    }

    /// The file that a map line names.
    pub(super) fn locate(&mut self, map: &str) -> Option<PathBuf> {
        let (name, has_options) = without_options(map);
        self.options += usize::from(has_options);
        let found = locate::file(self.folder, name);
        if found.is_none() {
            self.fail(format!("there is no texture `{name}`"));
        }
        found
    }

    /// The texture of a file for this use; `None` if there is none or it cannot be decoded.
    pub(super) fn texture(&mut self, file: &Path, usage: Use) -> Option<TextureId> {
        let key = (file.to_owned(), usage);
        if let Some(&known) = self.known.get(&key) {
            return known;
        }
        let image = self
            .images
            .entry(file.to_owned())
            .or_insert_with(|| decode(file));
        let texture = match image {
            Ok(image) => describe(image, usage),
            Err(message) => {
                let failure = format!("the texture `{}` is broken: {message}", file.display());
                self.fail(failure);
                None
            }
        };
        let id = texture.map(|texels| {
            self.textures.push(TextureDescription {
                name: file.display().to_string(),
                ..texels
            });
            TextureId(self.textures.len() as u32 - 1)
        });
        self.known.insert(key, id);
        id
    }

    fn fail(&mut self, message: String) {
        if !self.failures.contains(&message) {
            self.failures.push(message);
        }
    }
}

fn decode(file: &Path) -> Result<DynamicImage, String> {
    let reader = ImageReader::open(file).and_then(ImageReader::with_guessed_format);
    let image = reader.map_err(|error| error.to_string())?.decode();
    image.map_err(|error| error.to_string())
}

/// The texels of `image` for this use.
fn describe(image: &DynamicImage, usage: Use) -> Option<TextureDescription> {
    let has_alpha = image.color().has_alpha();
    let texels = match usage {
        Use::Colour => {
            let texels = image.to_rgb8();
            texels.pixels().map(|pixel| pixel.0).collect()
        }
        Use::Opacity if !has_alpha => {
            let mean = |[r, g, b]: [u8; 3]| (f64::from(r) + f64::from(g) + f64::from(b)) / 3.0;
            let texels = image.to_rgb8();
            texels.pixels().map(|pixel| grey(mean(pixel.0))).collect()
        }
        Use::Opacity | Use::Alpha => {
            let texels = image.to_rgba8();
            if usage == Use::Alpha && texels.pixels().all(|pixel| pixel.0[3] == u8::MAX) {
                return None;
            }
            texels
                .pixels()
                .map(|pixel| grey(f64::from(pixel.0[3])))
                .collect()
        }
    };
    Some(TextureDescription {
        name: String::new(),
        width: image.width(),
        height: image.height(),
        texels,
    })
}

/// The grey that decodes to the share `value`/255 through the sRGB curve (IEC 61966-2-1).
fn grey(value: f64) -> [u8; 3] {
    let linear = value / 255.0;
    let encoded = if linear <= 0.003_130_8 {
        12.92 * linear
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    };
    [(255.0 * encoded).round() as u8; 3]
}

/// Options of a map line, with the words after each that are not numbers.
const OPTIONS: [(&str, usize); 14] = [
    ("-blendu", 1),
    ("-blendv", 1),
    ("-bm", 0),
    ("-boost", 0),
    ("-cc", 1),
    ("-clamp", 1),
    ("-colorspace", 1),
    ("-imfchan", 1),
    ("-mm", 0),
    ("-o", 0),
    ("-s", 0),
    ("-t", 0),
    ("-texres", 0),
    ("-type", 1),
];

/// The file name on a map line, which may have spaces, and whether there were options before or behind
/// it.
fn without_options(map: &str) -> (&str, bool) {
    let mut rest = map.trim();
    let mut has_options = false;
    while let Some((_, words)) = option_at(rest) {
        has_options = true;
        let after_name = split_word(rest).1;
        rest = (0..words).fold(after_name, |text, _| split_word(text).1);
        if words == 0 {
            // One to three numbers; a file may be named like one, but something must be left.
            for _ in 0..3 {
                let (word, after) = split_word(rest);
                if word.parse::<f64>().is_err() || after.is_empty() {
                    break;
                }
                rest = after;
            }
        }
    }
    let behind = rest
        .match_indices(" -")
        .find(|&(index, _)| option_at(&rest[index + 1..]).is_some());
    match behind {
        Some((end, _)) => (rest[..end].trim_end(), true),
        None => (rest, has_options),
    }
}

fn option_at(text: &str) -> Option<(&str, usize)> {
    let word = split_word(text).0;
    OPTIONS.into_iter().find(|&(name, _)| name == word)
}

/// The first word and what follows it.
fn split_word(text: &str) -> (&str, &str) {
    match text.split_once(char::is_whitespace) {
        Some((word, rest)) => (word, rest.trim_start()),
        None => (text, ""),
    }
}

#[cfg(test)]
mod tests {
    use image::{ImageFormat, Rgb, RgbImage, Rgba, RgbaImage};

    use super::*;

    #[test]
    fn options_are_skipped_and_names_keep_their_spaces() {
        for (map, name, has_options) in [
            ("wood.jpg", "wood.jpg", false),
            (" texture 01.png ", "texture 01.png", false),
            ("-s 1 2 3 -o 0.1 wood 5.jpg", "wood 5.jpg", true),
            ("-clamp on -bm 3 -mm 0.1 0.3 a.png", "a.png", true),
            ("-texres 512 input.jpg", "input.jpg", true),
            ("-colorspace sRGB -type sphere d.jpg", "d.jpg", true),
            ("-imfchan r bump2.jpg -bm 1.5", "bump2.jpg", true),
            ("-s 1 1 1 7", "7", true),
            ("a -dash.png", "a -dash.png", false),
            ("-s", "", true),
        ] {
            assert_eq!(without_options(map), (name, has_options), "{map}");
        }
    }

    #[test]
    fn pictures_are_decoded_once_for_each_use() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let colours = RgbImage::from_fn(2, 1, |x, _| Rgb([200, 100, 60 * x as u8]));
        colours
            .save_with_format(path("a.png"), ImageFormat::Png)
            .unwrap();
        RgbImage::from_pixel(8, 8, Rgb([200, 100, 50]))
            .save_with_format(path("b.jpg"), ImageFormat::Jpeg)
            .unwrap();
        RgbaImage::from_fn(1, 2, |_, y| Rgba([9, 9, 9, 128 * y as u8]))
            .save_with_format(path("c.png"), ImageFormat::Png)
            .unwrap();
        let mut textures = Vec::new();
        let mut pictures = Pictures::new(folder.path(), &mut textures);
        for (map, usage, id) in [
            ("a.png", Use::Colour, Some(0)),
            ("-s 2 2 2 A.PNG", Use::Colour, Some(0)),
            ("b.jpg", Use::Colour, Some(1)),
            ("c.png", Use::Colour, Some(2)),
            ("c.png", Use::Alpha, Some(3)),
            ("a.png", Use::Opacity, Some(4)),
            ("b.jpg", Use::Alpha, None),
        ] {
            let file = pictures.locate(map).unwrap();
            assert_eq!(pictures.texture(&file, usage), id.map(TextureId), "{map}");
        }
        assert_eq!((pictures.failures.len(), pictures.options), (0, 1));
        assert_eq!(textures[0].texels, [[200, 100, 0], [200, 100, 60]]);
        assert_eq!((textures[0].width, textures[0].height), (2, 1));
        for (got, sent) in textures[1].texels[0].into_iter().zip([200_i32, 100, 50]) {
            assert!(
                (i32::from(got) - sent).abs() <= 3,
                "JPEG is lossy, a little"
            );
        }
        // Half opaque is sRGB 188.
        assert_eq!(textures[3].texels, [[0; 3], [188; 3]]);
    }

    #[test]
    fn missing_and_broken_pictures_are_told_once() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("broken.png"), "no picture").unwrap();
        let mut textures = Vec::new();
        let mut pictures = Pictures::new(folder.path(), &mut textures);
        for _ in 0..2 {
            assert_eq!(pictures.locate("none.png"), None);
            let file = pictures.locate("broken.png").unwrap();
            assert_eq!(pictures.texture(&file, Use::Colour), None);
            assert_eq!(pictures.texture(&file, Use::Opacity), None);
        }
        assert_eq!(pictures.failures.len(), 2, "{:?}", pictures.failures);
        assert!(textures.is_empty());
    }
}
