//! A stream of text as chunks of whole lines.

use std::io::{self, Read};

/// Bytes per chunk: large against the work of handing one over, small against a mesh.
const CHUNK_BYTES: usize = 1 << 22;

/// Chunks of whole lines from `source`, in order; the last one may lack its newline.
#[derive(Debug)]
pub(super) struct Chunks<R> {
    source: R,
    /// Beginning of a line that has not ended yet.
    carry: Vec<u8>,
    chunk_bytes: usize,
    /// Bytes that may still come.
    allowance: u64,
    limit: u64,
    is_done: bool,
}

impl<R: Read> Chunks<R> {
    /// Chunks of `source`; more than `limit` bytes are an error.
    pub(super) fn new(source: R, limit: u64) -> Self {
        Self {
            source,
            carry: Vec::new(),
            chunk_bytes: CHUNK_BYTES,
            allowance: limit,
            limit,
            is_done: false,
        }
    }

    fn read(&mut self) -> io::Result<Vec<u8>> {
        let mut chunk = std::mem::take(&mut self.carry);
        loop {
            let wanted = self.chunk_bytes as u64;
            let read = (&mut self.source).take(wanted).read_to_end(&mut chunk)? as u64;
            self.allowance = self.allowance.checked_sub(read).ok_or_else(|| {
                io::Error::new(
                    io::ErrorKind::FileTooLarge,
                    format!("larger than the limit of {} bytes", self.limit),
                )
            })?;
            if read < wanted {
                self.is_done = true;
                return Ok(chunk);
            }
            if let Some(end) = last_line_end(&chunk) {
                self.carry = chunk.split_off(end);
                return Ok(chunk);
            }
        }
    }
}

impl<R: Read> Iterator for Chunks<R> {
    type Item = io::Result<Vec<u8>>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.is_done {
            return None;
        }
        let chunk = self.read();
        self.is_done |= chunk.is_err();
        Some(chunk)
    }
}

/// Behind the last newline that a backslash does not join to the next line.
fn last_line_end(text: &[u8]) -> Option<usize> {
    let mut end = text.len();
    while let Some(newline) = text[..end].iter().rposition(|&byte| byte == b'\n') {
        if !is_continued(&text[..newline]) {
            return Some(newline + 1);
        }
        end = newline;
    }
    None
}

/// Whether a line, without its newline, ends in a backslash: the next one belongs to it.
pub(super) fn is_continued(line: &[u8]) -> bool {
    line.strip_suffix(b"\r").unwrap_or(line).ends_with(b"\\")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_are_whole_lines_and_together_the_text() {
        let text =
            "one\ntwo \\\nand more\r\n\nthree \\\r\nand more\na line longer than a chunk\nend";
        for chunk_bytes in 1..text.len() + 2 {
            let chunks = Chunks {
                chunk_bytes,
                ..Chunks::new(text.as_bytes(), 1 << 10)
            };
            let chunks: Vec<Vec<u8>> = chunks.map(Result::unwrap).collect();
            assert_eq!(chunks.concat(), text.as_bytes());
            let (_, inner) = chunks.split_last().unwrap();
            for chunk in inner.iter().filter(|chunk| !chunk.is_empty()) {
                assert_eq!(last_line_end(chunk), Some(chunk.len()));
            }
        }
    }

    #[test]
    fn a_stream_that_never_ends_is_an_error() {
        let mut chunks = Chunks::new(io::repeat(b' '), 3 * CHUNK_BYTES as u64);
        let error = chunks.find_map(Result::err).unwrap();
        assert_eq!(error.kind(), io::ErrorKind::FileTooLarge);
        assert!(chunks.next().is_none());
    }
}
