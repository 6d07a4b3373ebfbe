//! The elements of one chunk of an OBJ file. Chunks are parsed side by side, so that nothing here
//! knows what stands above.

use glam::DVec3;

use super::chunks::is_continued;
use super::lines::LineMap;
use super::number::{decimal, integer};
use crate::scene::diagnostics::Finding;

/// Vertices, texture coordinates and normals, in the order of a face corner `v/vt/vn`.
pub(super) const KINDS: usize = 3;

/// Names of the kinds, for messages.
pub(super) const NOUNS: [&str; KINDS] = ["vertex", "texture coordinate", "normal"];

/// What a chunk says, in its order. Lines count from 1 at its first.
#[derive(Debug, Default)]
pub(super) struct Elements {
    pub(super) positions: Vec<DVec3>,
    pub(super) uvs: Vec<[f32; 2]>,
    /// Of unit length, or not finite where the file's has no direction.
    pub(super) normals: Vec<[f32; 3]>,
    pub(super) position_lines: LineMap,
    pub(super) faces: Vec<Face>,
    /// Indices from 1 of each kind at each corner, 0 for none; empty if no corner has that kind.
    pub(super) corners: [Vec<i64>; KINDS],
    /// Which corners count back from where they stand: their indices begin at this chunk's first
    /// element.
    pub(super) relative: [Vec<u32>; KINDS],
    pub(super) statements: Vec<Statement>,
    /// Vertices with a coordinate that is not finite.
    pub(super) non_finite: Finding,
    /// Faces with fewer than three corners, left out.
    pub(super) incomplete: Finding,
    /// Lines, all kinds together.
    pub(super) line_count: u32,
}

/// A face with three corners or more.
#[derive(Debug, Clone, Copy)]
pub(super) struct Face {
    /// Behind its last corner in the lists of corners.
    pub(super) end: u32,
    pub(super) line: u32,
    /// Where its line begins in the chunk, in bytes.
    pub(super) offset: u32,
}

/// A line about the faces below it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Statement {
    pub(super) kind: StatementKind,
    /// The rest of the line: a name, or names.
    pub(super) text: String,
    pub(super) line: u32,
    /// Faces of the chunk above it.
    pub(super) faces_before: u32,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum StatementKind {
    /// `usemtl`
    Material,
    /// `mtllib`
    Library,
}

/// A mistake in a chunk.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Mistake {
    pub(super) line: u32,
    /// In characters, from 1; 0 if the line as a whole is wrong.
    pub(super) column: u32,
    pub(super) message: String,
}

/// Parses whole lines. Errors with the first mistake.
pub(super) fn parse(chunk: &[u8]) -> Result<Elements, Mistake> {
    let mut elements = Elements::default();
    let mut offset = 0;
    while offset < chunk.len() {
        elements.line_count += 1;
        let line = elements.line_count;
        let (length, line_breaks) = line_extent(&chunk[offset..]);
        let text = &chunk[offset..offset + length];
        let mistake = |(word, message): (Option<&[u8]>, String)| Mistake {
            line,
            column: word.map_or(0, |word| column(text, word)),
            message,
        };
        if line_breaks > 0 {
            elements.line_count += line_breaks;
            let joined = join(text);
            let mistake = |(_, message)| Mistake {
                line,
                column: 0,
                message,
            };
            elements
                .add(&joined, line, offset as u32)
                .map_err(mistake)?;
        } else {
            elements.add(text, line, offset as u32).map_err(mistake)?;
        }
        offset += length;
    }
    Ok(elements)
}

/// What is wrong, and with which word unless with the whole line.
type LineError<'a> = (Option<&'a [u8]>, String);

impl Elements {
    /// Adds what a line says.
    fn add<'a>(&mut self, text: &'a [u8], line: u32, offset: u32) -> Result<(), LineError<'a>> {
        let whole = |message: &str| (None, message.to_owned());
        let mut words = Words(text);
        match words.next() {
            Some(b"v") => {
                let position = position(words).map_err(whole)?;
                if !position.is_finite() {
                    self.non_finite.add(line);
                }
                let index = self.positions.len() as u32;
                self.position_lines.push(index, 1, line);
                self.positions.push(position);
            }
            Some(b"vn") => self.normals.push(normal(words).map_err(whole)?),
            Some(b"vt") => self.uvs.push(uv(words).map_err(whole)?),
            Some(b"f") => self.add_face(words, line, offset)?,
            Some(b"usemtl") => {
                self.add_statement(StatementKind::Material, words.rest(), line);
                if words.next().is_none() {
                    return Err(whole("`usemtl` needs a name"));
                }
            }
            Some(b"mtllib") => self.add_statement(StatementKind::Library, words.rest(), line),
            _ => {}
        }
        Ok(())
    }

    fn add_statement(&mut self, kind: StatementKind, text: &[u8], line: u32) {
        self.statements.push(Statement {
            kind,
            // Names need not be UTF-8; numbers are.
            text: String::from_utf8_lossy(text.trim_ascii()).into_owned(),
            line,
            faces_before: self.faces.len() as u32,
        });
    }

    fn add_face<'a>(
        &mut self,
        words: Words<'a>,
        line: u32,
        offset: u32,
    ) -> Result<(), LineError<'a>> {
        let start = self.corners[0].len();
        for word in words {
            self.add_corner(word)
                .map_err(|message| (Some(word), message))?;
        }
        let end = self.corners[0].len();
        if end - start < 3 {
            self.incomplete.add(line);
            for (corners, relative) in self.corners.iter_mut().zip(&mut self.relative) {
                corners.truncate(start);
                relative.truncate(relative.partition_point(|&corner| (corner as usize) < start));
            }
        } else {
            let end = end as u32;
            self.faces.push(Face { end, line, offset });
        }
        Ok(())
    }

    /// Adds a corner `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn add_corner(&mut self, word: &[u8]) -> Result<(), String> {
        let shown = || format!("`{}` is no corner of a face", String::from_utf8_lossy(word));
        let corner = self.corners[0].len();
        let above = [self.positions.len(), self.uvs.len(), self.normals.len()];
        for (kind, digits) in word.split(|&byte| byte == b'/').enumerate() {
            if kind > 0 && kind < KINDS && digits.is_empty() {
                continue;
            }
            let index = integer(digits).filter(|_| kind < KINDS).ok_or_else(shown)?;
            if index == 0 {
                if kind == 0 {
                    return Err("vertex 0 does not exist; they count from 1".to_owned());
                }
                // Many exporters write 0 for what a corner does not have.
                continue;
            }
            let corners = &mut self.corners[kind];
            corners.resize(corner, 0);
            if index > 0 {
                corners.push(index);
            } else {
                corners.push(above[kind] as i64 + 1 + index);
                self.relative[kind].push(corner as u32);
            }
        }
        for corners in &mut self.corners[1..] {
            if !corners.is_empty() {
                corners.resize(corner + 1, 0);
            }
        }
        Ok(())
    }
}

/// Words between white space, up to a comment.
#[derive(Debug, Clone, Copy)]
struct Words<'a>(&'a [u8]);

impl<'a> Words<'a> {
    /// What was not read yet.
    fn rest(&self) -> &'a [u8] {
        self.0
    }
}

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        let text = self.0.trim_ascii_start();
        let end = text
            .iter()
            .position(u8::is_ascii_whitespace)
            .unwrap_or(text.len());
        let (word, rest) = text.split_at(end);
        self.0 = rest;
        let is_word = !matches!(word, [] | [b'#', ..]);
        is_word.then_some(word)
    }
}

/// `x y z`, with a weight to divide by or with a colour, which is left out.
fn position(mut words: Words<'_>) -> Result<DVec3, &'static str> {
    let position = vector(&mut words).ok_or("a vertex needs three numbers")?;
    let mut more = [0.0; 4];
    let mut count = 0;
    for word in words {
        let value = decimal(word).filter(|_| count < more.len());
        more[count.min(3)] = value.ok_or("a vertex needs 3, 4 or 6 numbers")?;
        count += 1;
    }
    match (count, more[0]) {
        (0 | 3, _) => Ok(position),
        (1, 0.0) => Err("a vertex has weight 0"),
        (1, weight) => Ok(position / weight),
        _ => Err("a vertex needs 3, 4 or 6 numbers"),
    }
}

/// Normals differ in length from file to file; f32 may not hold that length's square.
fn normal(mut words: Words<'_>) -> Result<[f32; 3], &'static str> {
    let normal = vector(&mut words).ok_or("a normal needs three numbers")?;
    // The largest coordinate first: its square may be beyond f64, too.
    let normal = normal / normal.abs().max_element();
    Ok(normal.normalize().as_vec3().to_array())
}

fn uv(mut words: Words<'_>) -> Result<[f32; 2], &'static str> {
    let mut next = || words.next().and_then(decimal);
    match (next(), next()) {
        (Some(u), Some(v)) => Ok([u as f32, v as f32]),
        _ => Err("a texture coordinate needs two numbers"),
    }
}

fn vector(words: &mut Words<'_>) -> Option<DVec3> {
    let mut next = || words.next().and_then(decimal);
    Some(DVec3::new(next()?, next()?, next()?))
}

/// Bytes of the first line of `text` with its newline and with the lines that backslashes join to it,
/// and how many those are.
fn line_extent(text: &[u8]) -> (usize, u32) {
    let mut end = newline(text);
    let mut joined = 0;
    while end < text.len() && is_continued(&text[..end - 1]) {
        end += newline(&text[end..]);
        joined += 1;
    }
    (end, joined)
}

/// Bytes up to the first newline and with it.
fn newline(mut text: &[u8]) -> usize {
    let length = text.len();
    // The standard library's search for a byte, many at a time.
    std::io::BufRead::skip_until(&mut text, b'\n').unwrap_or(length)
}

/// The line with its backslashes and newlines blanked.
fn join(line: &[u8]) -> Vec<u8> {
    let mut joined = line.to_vec();
    let mut start = 0;
    while start < line.len() {
        let end = start + newline(&line[start..]);
        let content = line[start..end].trim_ascii_end();
        if content.ends_with(b"\\") && end < line.len() {
            joined[start + content.len() - 1..end].fill(b' ');
        }
        start = end;
    }
    joined
}

/// The column of `word`, a part of `line`, in characters from 1.
fn column(line: &[u8], word: &[u8]) -> u32 {
    let before = word.as_ptr() as usize - line.as_ptr() as usize;
    1 + String::from_utf8_lossy(&line[..before]).chars().count() as u32
}

/// Column and text of a face's corner, counted from 0, if `line` is not joined from several.
pub(super) fn corner_in_line(line: &[u8], corner: usize) -> Option<(u32, &[u8])> {
    let (length, joined) = line_extent(line);
    let line = &line[..length];
    let word = Words(line).nth(1 + corner).filter(|_| joined == 0)?;
    Some((column(line, word), word))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_may_be_followed_by_weights_colours_and_comments() {
        let text = b"v 1 2 3\r\n  v 2 4 6 2.0\n\tv 1 2 3 .1 .2 .3\nv 1 2 3 # 4 5\nv 1 2 3 1 #";
        let elements = parse(text).unwrap();
        assert_eq!(elements.positions, [DVec3::new(1.0, 2.0, 3.0); 5]);
        assert_eq!(elements.line_count, 5);
        assert_eq!(elements.position_lines.line_of(4), 5);
    }

    #[test]
    fn corners_have_what_they_say_and_zero_for_the_rest() {
        let text = b"v 0 0 0\nvt 0 0\nf 1 2 3\nf 4/5 6//7 8/9/10\nf 1/0/0 -1/-1 2\n";
        let elements = parse(text).unwrap();
        assert_eq!(elements.corners[0], [1, 2, 3, 4, 6, 8, 1, 1, 2]);
        assert_eq!(elements.corners[1], [0, 0, 0, 5, 0, 9, 0, 1, 0]);
        assert_eq!(elements.corners[2], [0, 0, 0, 0, 7, 10, 0, 0, 0]);
        assert_eq!(elements.relative, [vec![7], vec![7], vec![]]);
        let plain = parse(b"f 1 2 3\nf 3 4 5\n").unwrap();
        assert!(plain.corners[1].is_empty() && plain.corners[2].is_empty());
    }

    #[test]
    fn faces_without_three_corners_leave_no_trace() {
        let elements = parse(b"f\nf 1\nf -1/-1 -2\nf 1 2 3\n").unwrap();
        assert_eq!(elements.incomplete, Finding::new(3, [1, 2, 3]));
        assert_eq!(elements.corners[0], [1, 2, 3]);
        assert!(elements.relative.iter().all(Vec::is_empty));
        assert_eq!((elements.faces[0].end, elements.faces[0].line), (3, 4));
    }

    #[test]
    fn backslashes_join_lines() {
        let text = b"v 1 \\\n2 \\\r\n 3\nv 4 5 6\nf 1 \\\nx\n";
        let mistake = parse(text).unwrap_err();
        assert_eq!((mistake.line, mistake.column), (5, 0));
        let elements = parse(&text[..text.len() - 8]).unwrap();
        assert_eq!(elements.positions[0], DVec3::new(1.0, 2.0, 3.0));
        assert_eq!(elements.line_count, 4);
        assert_eq!(elements.position_lines.line_of(1), 4);
        assert_eq!(parse(b"v 1 2 3\nf \\").unwrap_err().line, 2);
    }

    #[test]
    fn names_keep_their_spaces_and_need_not_be_utf_8() {
        let elements =
            parse(b"usemtl  red car \nf 1 2 3\nmtllib a b.mtl\r\nusemtl caf\xe9\n").unwrap();
        let told: Vec<_> = elements
            .statements
            .iter()
            .map(|statement| (statement.text.as_str(), statement.faces_before))
            .collect();
        assert_eq!(told, [("red car", 0), ("a b.mtl", 1), ("caf\u{fffd}", 1)]);
        assert_eq!(elements.statements[1].kind, StatementKind::Library);
    }

    #[test]
    fn normals_have_unit_length_whatever_the_file_has() {
        let elements =
            parse(b"vn 0 0 5\nvn 3e-300 4e-300 0\nvn 3e300 0 4e300\nvn 0 0 0\n").unwrap();
        assert_eq!(elements.normals[0], [0.0, 0.0, 1.0]);
        assert_eq!(elements.normals[1], [0.6, 0.8, 0.0]);
        assert_eq!(elements.normals[2], [0.6, 0.0, 0.8]);
        assert!(elements.normals[3][0].is_nan());
    }

    #[test]
    fn a_corner_is_found_in_its_line_in_characters() {
        let line = "f\t1 größe  3\nf 4 5 6\n".as_bytes();
        let (column, word) = corner_in_line(line, 1).unwrap();
        assert_eq!((column, word), (5, "größe".as_bytes()));
        assert_eq!(corner_in_line(line, 2).unwrap().0, 12);
        assert_eq!(corner_in_line(b"f 1 \\\n2 3\n", 0), None);
    }
}
