//! The file of a checkpoint: a film's sums, bit for bit, and what the render needs beside them to go on.
//!
//! | bytes | content |
//! | --- | --- |
//! | 8 | `wavepath` |
//! | 4 | [`FORMAT`] |
//! | 4 | h, at most 2²⁰ |
//! | h | header, JSON: size of the film, number of words, the render's record |
//! | 4 | CRC-32 of everything before |
//! | 64 per pixel | Σ S_b (3 × f64), Σ S_b²/n_b (3 × f64), samples, blocks |
//! | 64 per pixel, with aux | sums of albedo (3 × f64), normal (3 × f64) and depth, samples |
//! | the same again | of a film in two halves |
//! | 8 per word | words of the render |
//! | 4 | CRC-32 of everything after the first |
//!
//! Numbers are little-endian, whole ones without a sign. CRC-32 is that of IEEE 802.3, as in PNG and gzip.
//! The film does not know what record and words mean.

use std::fs::{self, File};
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::Path;

use crc32fast::Hasher;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

use super::memory::{available_bytes, check_memory};
use super::output::write_atomically;
use super::{AuxSums, Film, PixelSums};

/// Version of the format; it changes whenever a file of the last version would be misread.
pub const FORMAT: u32 = 1;

const MAGIC: &[u8; 8] = b"wavepath";

/// Bytes before the header.
const PREAMBLE: usize = 16;

/// Most bytes of a header.
const MOST_HEADER: u32 = 1 << 20;

/// Bytes of a checksum.
const CHECKSUM: u64 = 4;

/// Bytes of the sums of a pixel, and of those of its auxiliary values.
const SUMS: usize = 64;

/// Most pixels across or down, as for scene files.
const MOST_SIDE: u32 = 65_535;

/// What a checkpoint holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint<R> {
    /// The image so far.
    pub film: Film,
    /// The render's record.
    pub record: R,
    /// The render's words.
    pub words: Vec<u64>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header<R> {
    width: u32,
    height: u32,
    aux: bool,
    halves: u64,
    words: u64,
    record: R,
}

impl<R> Header<R> {
    /// Bytes after the header and its checksum; `None` if there is no such film.
    fn body(&self) -> Option<u64> {
        let sides = 1..=MOST_SIDE;
        let is_film = sides.contains(&self.width) && sides.contains(&self.height);
        let pixels = u64::from(self.width) * u64::from(self.height);
        let per_pixel = SUMS as u64 * (1 + u64::from(self.aux));
        let words = self.words.checked_mul(8)?;
        (is_film && (1..=2).contains(&self.halves))
            .then(|| self.halves * pixels * per_pixel + CHECKSUM)?
            .checked_add(words)
    }
}

/// Writes a checkpoint to `path`: it is there complete, and on the disk, or what was there before is.
///
/// # Errors
/// If it cannot be written.
pub fn write_checkpoint<R: Serialize>(
    path: &Path,
    film: &Film,
    record: &R,
    words: &[u64],
) -> Result<()> {
    write_atomically(path, |file| {
        let header = Header {
            width: film.width,
            height: film.height,
            aux: film.has_aux(),
            halves: film.parts().count() as u64,
            words: words.len() as u64,
            record,
        };
        let mut output = BufWriter::new(&mut *file);
        let written = write(&mut output, &header, film, words).and_then(|()| output.flush());
        drop(output);
        written
            .and_then(|()| file.sync_all())
            .map_err(|error| Error::io(path, &error))
    })
}

fn write<R: Serialize>(
    output: &mut impl Write,
    header: &Header<R>,
    film: &Film,
    words: &[u64],
) -> io::Result<()> {
    let json = serde_json::to_vec(header)?;
    let length = u32::try_from(json.len())
        .ok()
        .filter(|length| *length <= MOST_HEADER)
        .ok_or_else(|| io::Error::other("the header of the checkpoint is too long"))?;
    let mut part = Summed::new(&mut *output);
    part.write_all(MAGIC)?;
    part.write_all(&FORMAT.to_le_bytes())?;
    part.write_all(&length.to_le_bytes())?;
    part.write_all(&json)?;
    part.finish()?;

    let mut part = Summed::new(output);
    for half in [Some(film), film.second.as_deref()].into_iter().flatten() {
        for sums in &half.pixels {
            part.write_all(&pixel_bytes(sums))?;
        }
        for sums in &half.aux {
            part.write_all(&aux_bytes(sums))?;
        }
    }
    for word in words {
        part.write_all(&word.to_le_bytes())?;
    }
    part.finish()
}

/// Reads a checkpoint. The size of the file is held against its header, and that against the memory of the
/// machine, before anything is allocated.
///
/// # Errors
/// If there is no such file, or it is not a sound checkpoint of this format. The record's own soundness is
/// for the caller to see to.
pub fn read_checkpoint<R: DeserializeOwned>(path: &Path) -> Result<Checkpoint<R>> {
    let metadata = fs::metadata(path).map_err(|error| Error::io(path, &error))?;
    if !metadata.is_file() {
        return Err(Error::file(path, "is not a regular file"));
    }
    let file = File::open(path).map_err(|error| Error::io(path, &error))?;
    let mut input = BufReader::with_capacity(1 << 16, file);
    read(&mut input, metadata.len()).map_err(|problem| match problem {
        Problem::Io(error) if error.kind() == io::ErrorKind::UnexpectedEof => {
            Error::file(path, "the checkpoint is cut off")
        }
        Problem::Io(error) => Error::io(path, &error),
        Problem::Limit(error) => Error::file(path, error.message),
        Problem::Content(message) => Error::file(path, message),
    })
}

/// Why a checkpoint was not read.
enum Problem {
    Io(io::Error),
    Limit(Error),
    Content(String),
}

impl From<io::Error> for Problem {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

fn content<T>(message: impl Into<String>) -> std::result::Result<T, Problem> {
    Err(Problem::Content(message.into()))
}

/// Reads the checkpoint that is the whole of an input of `length` bytes.
fn read<R: DeserializeOwned>(
    input: &mut impl Read,
    length: u64,
) -> std::result::Result<Checkpoint<R>, Problem> {
    let mut part = Summed::new(&mut *input);
    let mut magic = Vec::new();
    (&mut part)
        .take(MAGIC.len() as u64)
        .read_to_end(&mut magic)?;
    if magic.is_empty() || !MAGIC.starts_with(&magic) {
        return content("is not a checkpoint of wavepath");
    }
    let format = u32::from_le_bytes(part.array()?);
    if format != FORMAT {
        return content(format!(
            "the checkpoint is of format {format}, and this program reads format {FORMAT}"
        ));
    }
    let header_length = u32::from_le_bytes(part.array()?);
    if header_length > MOST_HEADER {
        return content("the checkpoint is damaged: its header is too long");
    }
    let mut json = vec![0; header_length as usize];
    part.read_exact(&mut json)?;
    if !part.checks()? {
        return content("the checkpoint is damaged: the checksum of its header differs");
    }
    let header: Header<R> = match serde_json::from_slice(&json) {
        Ok(header) => header,
        Err(error) => {
            return content(format!(
                "the checkpoint's header is not understood: {error}"
            ));
        }
    };
    let Some(body) = header.body() else {
        return content("the checkpoint is damaged: its header states an impossible size");
    };
    let expected = (PREAMBLE as u64 + u64::from(header_length) + CHECKSUM).saturating_add(body);
    if length < expected {
        return content(format!(
            "the checkpoint is cut off: it has {length} of {expected} bytes"
        ));
    }
    if length > expected {
        return content(format!(
            "the checkpoint is damaged: it has {length} bytes, and its header says {expected}"
        ));
    }
    check_memory(header.width, header.height, header.aux, header.halves).map_err(Problem::Limit)?;
    if let Some(available) = available_bytes().filter(|available| *available < body) {
        return content(format!(
            "the checkpoint needs {body} bytes of memory, and {available} are available"
        ));
    }

    let mut part = Summed::new(input);
    let mut total = 0;
    let mut film = read_half(&mut part, &header, &mut total)?;
    if header.halves == 2 {
        film.second = Some(Box::new(read_half(&mut part, &header, &mut total)?));
    }
    // No more than the file has.
    let mut words = Vec::with_capacity(header.words as usize);
    for _ in 0..header.words {
        words.push(u64::from_le_bytes(part.array()?));
    }
    if !part.checks()? {
        return content("the checkpoint is damaged: its checksum differs");
    }
    Ok(Checkpoint {
        film,
        record: header.record,
        words,
    })
}

/// The next half of a film; its samples are added to `total`.
fn read_half<R>(
    part: &mut Summed<impl Read>,
    header: &Header<R>,
    total: &mut u64,
) -> std::result::Result<Film, Problem> {
    let mut film = Film::new(header.width, header.height, header.aux);
    for sums in &mut film.pixels {
        *sums = pixel_sums(&part.array()?);
        let values = sums.sum.iter().chain(&sums.squares);
        let counts = (sums.blocks == 0) == (sums.samples == 0) && sums.blocks <= sums.samples;
        let sum = total.checked_add(sums.samples);
        match sum.filter(|_| counts && values.copied().all(f64::is_finite)) {
            Some(sum) => *total = sum,
            None => {
                return content("the checkpoint is damaged: the sums of a pixel are impossible");
            }
        }
    }
    for sums in &mut film.aux {
        *sums = aux_sums(&part.array()?);
        let values = sums.albedo.iter().chain(&sums.normal).chain([&sums.depth]);
        if !values.copied().all(f64::is_finite) {
            return content("the checkpoint is damaged: the sums of a pixel are impossible");
        }
    }
    Ok(film)
}

fn pixel_bytes(sums: &PixelSums) -> [u8; SUMS] {
    let [r, g, b] = sums.sum.map(f64::to_bits);
    let [rr, gg, bb] = sums.squares.map(f64::to_bits);
    bytes([r, g, b, rr, gg, bb, sums.samples, sums.blocks])
}

fn pixel_sums(from: &[u8; SUMS]) -> PixelSums {
    let [r, g, b, rr, gg, bb, samples, blocks] = numbers(from);
    PixelSums {
        sum: [r, g, b].map(f64::from_bits),
        squares: [rr, gg, bb].map(f64::from_bits),
        samples,
        blocks,
    }
}

fn aux_bytes(sums: &AuxSums) -> [u8; SUMS] {
    let [r, g, b] = sums.albedo.map(f64::to_bits);
    let [x, y, z] = sums.normal.map(f64::to_bits);
    bytes([r, g, b, x, y, z, sums.depth.to_bits(), sums.samples])
}

fn aux_sums(from: &[u8; SUMS]) -> AuxSums {
    let [r, g, b, x, y, z, depth, samples] = numbers(from);
    AuxSums {
        albedo: [r, g, b].map(f64::from_bits),
        normal: [x, y, z].map(f64::from_bits),
        depth: f64::from_bits(depth),
        samples,
    }
}

fn bytes(numbers: [u64; SUMS / 8]) -> [u8; SUMS] {
    let mut bytes = [0; SUMS];
    for (place, number) in bytes.chunks_exact_mut(8).zip(numbers) {
        place.copy_from_slice(&number.to_le_bytes());
    }
    bytes
}

fn numbers(bytes: &[u8; SUMS]) -> [u64; SUMS / 8] {
    let (numbers, _) = bytes.as_chunks();
    std::array::from_fn(|i| u64::from_le_bytes(numbers[i]))
}

/// A part of a file that ends with the checksum of what was written or read of it.
struct Summed<T> {
    inner: T,
    sum: Hasher,
}

impl<T> Summed<T> {
    fn new(inner: T) -> Self {
        Self {
            inner,
            sum: Hasher::new(),
        }
    }
}

impl<T: Write> Summed<T> {
    fn finish(mut self) -> io::Result<()> {
        self.inner.write_all(&self.sum.finalize().to_le_bytes())
    }
}

impl<T: Read> Summed<T> {
    fn array<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        let mut bytes = [0; N];
        self.read_exact(&mut bytes)?;
        Ok(bytes)
    }

    /// Whether the checksum that follows is that of what was read.
    fn checks(mut self) -> io::Result<bool> {
        let mut stored = [0; CHECKSUM as usize];
        self.inner.read_exact(&mut stored)?;
        Ok(self.sum.finalize().to_le_bytes() == stored)
    }
}

impl<T: Write> Write for Summed<T> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.inner.write(bytes)?;
        self.sum.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

impl<T: Read> Read for Summed<T> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let read = self.inner.read(bytes)?;
        self.sum.update(&bytes[..read]);
        Ok(read)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Parts;
    use super::*;

    /// The record of these tests.
    type Note = Vec<f64>;

    /// A film with something different in every number.
    fn film(halves: usize, aux: bool) -> Film {
        let parts = [Parts::Whole, Parts::Halves][halves - 1];
        let mut film = Film::in_parts(3, 2, aux, parts);
        for pixel in 0..film.len() {
            for half in 0..halves {
                let half_film = film.half_mut(half);
                let value = 1.0 / (3 + 7 * pixel + half) as f64;
                for samples in [1, 4] {
                    let sum = [value, 1e-300 * value, 1e150 * value];
                    half_film.add_block(pixel, samples, sum);
                    if aux {
                        half_film.add_aux(pixel, samples, sum, [-value; 3], 5.0 * value);
                    }
                }
            }
        }
        film
    }

    /// The bytes of a checkpoint.
    fn written(film: &Film, words: &[u64]) -> Vec<u8> {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a");
        write_checkpoint(&path, film, &vec![0.1, 1e300], words).unwrap();
        fs::read(path).unwrap()
    }

    fn read_bytes(bytes: &[u8]) -> std::result::Result<Checkpoint<Note>, String> {
        let mut input = bytes;
        read(&mut input, bytes.len() as u64).map_err(|problem| match problem {
            Problem::Io(error) => format!("{}", error.kind()),
            Problem::Limit(error) => error.message,
            Problem::Content(message) => message,
        })
    }

    /// The bytes of a checkpoint with this header, and this after it.
    fn forged(header: &str, body: &[u8]) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(FORMAT.to_le_bytes());
        bytes.extend((header.len() as u32).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
        bytes.extend(body);
        bytes.extend(crc32fast::hash(body).to_le_bytes());
        bytes
    }

    #[test]
    fn film_record_and_words_are_read_as_they_were_written() {
        for halves in [1, 2] {
            for aux in [false, true] {
                let film = film(halves, aux);
                let words = [u64::MAX, 0, 7];
                let checkpoint = read_bytes(&written(&film, &words)).unwrap();
                assert_eq!(checkpoint.film, film);
                assert_eq!(checkpoint.record, [0.1, 1e300]);
                assert_eq!(checkpoint.words, words);
            }
        }
    }

    #[test]
    fn every_truncation_and_every_flipped_bit_is_found() {
        let mut bytes = written(&film(2, true), &[3, 5]);
        for length in 0..bytes.len() {
            assert!(read_bytes(&bytes[..length]).is_err(), "{length} bytes");
        }
        for bit in 0..8 * bytes.len() {
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert!(read_bytes(&bytes).is_err(), "bit {bit}");
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        bytes.push(0);
        let message = read_bytes(&bytes).unwrap_err();
        assert!(message.contains("its header says"), "{message}");
        assert!(read_bytes(&bytes[..bytes.len() - 1]).is_ok());
    }

    #[test]
    fn impossible_sizes_are_refused_before_anything_is_allocated() {
        let header = |width: u64, height: u64, halves: u64, words: u64| {
            format!(
                r#"{{"width":{width},"height":{height},"aux":true,"halves":{halves},"words":{words},"record":[]}}"#
            )
        };
        for (header, part) in [
            (header(65_535, 65_535, 2, 0), "cut off"),
            (header(1, 1, 1, u64::MAX), "impossible size"),
            (header(1, 1, 1, u64::MAX / 16), "cut off"),
            (header(65_536, 1, 1, 0), "impossible size"),
            (header(0, 1, 1, 0), "impossible size"),
            (header(1, 1, 0, 0), "impossible size"),
            (header(1, 1, u64::MAX, 0), "impossible size"),
            (header(u64::MAX, 1, 1, 0), "not understood"),
            ("{}".to_owned(), "not understood"),
            (String::new(), "not understood"),
        ] {
            let message = read_bytes(&forged(&header, &[])).unwrap_err();
            assert!(message.contains(part), "{header}: {message}");
        }
    }

    #[test]
    fn a_file_larger_than_the_memory_is_refused_before_it_is_read() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a");
        let header =
            r#"{"width":65535,"height":65535,"aux":true,"halves":2,"words":0,"record":[]}"#;
        let bytes = forged(header, &[]);
        fs::write(&path, &bytes).unwrap();
        // Without a byte on the disk for its end.
        let length = bytes.len() as u64 + 2 * 2 * 64 * 65_535 * 65_535;
        let file = File::options().write(true).open(&path).unwrap();
        if file.set_len(length).is_err() {
            return;
        }
        let error = read_checkpoint::<Note>(&path).unwrap_err();
        assert!(error.message.contains("of memory"), "{error}");
    }

    #[test]
    fn impossible_sums_are_refused_though_the_checksum_is_theirs() {
        let header = r#"{"width":1,"height":1,"aux":true,"halves":1,"words":0,"record":[]}"#;
        let sound = [0.0f64.to_bits(); 6].into_iter().chain([8, 2]);
        let sound: Vec<u64> = sound.chain([0; 7]).chain([8]).collect();
        let bytes =
            |numbers: &[u64]| -> Vec<u8> { numbers.iter().flat_map(|n| n.to_le_bytes()).collect() };
        assert!(read_bytes(&forged(header, &bytes(&sound))).is_ok());
        for (place, value) in [
            (0, f64::NAN.to_bits()),
            (5, f64::INFINITY.to_bits()),
            (6, 0),
            (6, 1),
            (7, 0),
            (7, 9),
            (8, f64::NAN.to_bits()),
            (14, f64::NEG_INFINITY.to_bits()),
        ] {
            let mut numbers = sound.clone();
            numbers[place] = value;
            let message = read_bytes(&forged(header, &bytes(&numbers))).unwrap_err();
            assert!(message.contains("impossible"), "{place}: {message}");
        }
    }

    #[test]
    fn what_is_no_checkpoint_is_called_so() {
        for bytes in [&b""[..], b"\x89PNG\r\n", b"wavepatH\x01\0\0\0"] {
            let message = read_bytes(bytes).unwrap_err();
            assert!(message.contains("not a checkpoint"), "{message}");
        }
        let mut bytes = written(&film(1, false), &[]);
        bytes[8] = 9;
        let message = read_bytes(&bytes).unwrap_err();
        assert!(message.contains("format 9"), "{message}");
        let folder = tempfile::tempdir().unwrap();
        assert!(read_checkpoint::<Note>(folder.path()).is_err());
        let missing = folder.path().join("missing");
        let error = read_checkpoint::<Note>(&missing).unwrap_err();
        assert_eq!(error.kind, crate::ErrorKind::Io);
    }
}
