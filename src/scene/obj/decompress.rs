//! OBJ files as they are, or compressed by gzip or Zstandard.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;
use ruzstd::decoding::StreamingDecoder;

/// First bytes of a gzip member (RFC 1952, section 2.3.1).
const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];

/// First bytes of a Zstandard frame (RFC 8878, section 3.1.1).
const ZSTD_MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// Bytes read from the file at a time.
const BUFFER_BYTES: usize = 1 << 18;

/// The text in `path`, decompressed while it is read. Its first bytes tell how, whatever its name: no
/// text begins like that.
pub(super) fn open(path: &Path) -> io::Result<Box<dyn Read + Send>> {
    let mut file = BufReader::with_capacity(BUFFER_BYTES, File::open(path)?);
    let start = file.fill_buf()?;
    Ok(if start.starts_with(&GZIP_MAGIC) {
        Box::new(MultiGzDecoder::new(file))
    } else if start.starts_with(&ZSTD_MAGIC) {
        Box::new(ZstdFrames::new(file)?)
    } else {
        Box::new(file)
    })
}

/// All frames of a Zstandard file, one after the other.
struct ZstdFrames {
    /// The frame being read; `None` after the last one.
    frame: Option<ZstdFrame>,
}

type ZstdFrame = StreamingDecoder<BufReader<File>, ruzstd::decoding::FrameDecoder>;

impl ZstdFrames {
    fn new(file: BufReader<File>) -> io::Result<Self> {
        let frame = StreamingDecoder::new(file).map_err(io::Error::other)?;
        Ok(Self { frame: Some(frame) })
    }
}

impl Read for ZstdFrames {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while let Some(frame) = &mut self.frame {
            let count = frame.read(buffer)?;
            if count > 0 || buffer.is_empty() {
                return Ok(count);
            }
            let written = frame.decoder.get_checksum_from_data();
            if written.is_some() && written != frame.decoder.get_calculated_checksum() {
                return Err(io::Error::other("the checksum does not match the content"));
            }
            if let Some(frame) = self.frame.take() {
                let mut file = frame.into_inner();
                if !file.fill_buf()?.is_empty() {
                    *self = Self::new(file)?;
                }
            }
        }
        Ok(0)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::GzEncoder;
    use ruzstd::encoding::{CompressionLevel, compress_to_vec};

    use super::*;

    const TEXT: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

    fn gzip(text: &[u8]) -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(text).unwrap();
        encoder.finish().unwrap()
    }

    fn zstd(text: &[u8]) -> Vec<u8> {
        compress_to_vec(text, CompressionLevel::Fastest)
    }

    /// Reads back what `content` is as a file.
    fn read(content: &[u8]) -> io::Result<Vec<u8>> {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(content).unwrap();
        let mut text = Vec::new();
        open(file.path())?.read_to_end(&mut text)?;
        Ok(text)
    }

    #[test]
    fn text_is_the_same_plain_and_compressed_in_one_part_or_two() {
        let (start, end) = TEXT.split_at(11);
        for content in [
            TEXT.to_vec(),
            gzip(TEXT),
            zstd(TEXT),
            [gzip(start), gzip(end)].concat(),
            [zstd(start), zstd(end)].concat(),
        ] {
            assert_eq!(read(&content).unwrap(), TEXT);
        }
        assert_eq!(read(b"").unwrap(), b"");
    }

    #[test]
    fn damaged_files_are_errors() {
        for content in [gzip(TEXT), zstd(TEXT)] {
            assert!(read(&content[..content.len() / 2]).is_err());
            assert!(read(&[&content[..], b"garbage"].concat()).is_err());
        }
    }
}
