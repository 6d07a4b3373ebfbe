//! Wavefront OBJ files: positions and faces, in f64. Normals, texture coordinates and materials
//! are read over.

use std::path::Path;

use glam::DVec3;

use super::description::Mesh;
use super::document::Spot;
use super::files::read_at_most;
use crate::error::{Error, Result};

/// Bytes of an OBJ file: some hundred million faces. A triangle of a fan takes two bytes at least,
/// so that 32 bits count all of them.
const MAX_OBJ_BYTES: u64 = 1 << 32;

/// The mesh in `path`, and a warning if corners of faces were missing. Polygons become fans of
/// triangles. A failure to read it is an error at `spot`, where the file is named; a mistake in it,
/// one that names the file and, where it can be found, the line.
pub(super) fn read(path: &Path, spot: &Spot) -> Result<(Mesh, Option<String>)> {
    let bytes = read_at_most(path, MAX_OBJ_BYTES).map_err(|error| spot.io_error(path, &error))?;
    parse(bytes, path)
}

/// The mesh in `bytes`; `path` names it in errors.
fn parse(bytes: Vec<u8>, path: &Path) -> Result<(Mesh, Option<String>)> {
    // Names and comments need not be UTF-8; numbers are.
    let text = match String::from_utf8(bytes) {
        Ok(text) => text,
        Err(error) => String::from_utf8_lossy(error.as_bytes()).into_owned(),
    };
    let ignored = check_elements(&text, path)?;
    let mut bytes = text.into_bytes();
    for &start in ignored.lines.iter() {
        bytes[start] = b'#';
    }
    let mesh = load(&bytes, path)?;
    if mesh.faces.is_empty() {
        return Err(Error::file(path, "the file has no faces"));
    }
    let warning = (ignored.incomplete_faces > 0).then(|| {
        Error::file(
            path,
            format!(
                "{} faces with fewer than three corners removed",
                ignored.incomplete_faces
            ),
        )
        .to_string()
    });
    Ok((mesh, warning))
}

/// Lines that are no faces, to be hidden from the parser, which would fill curves like polygons
/// and refuses a face without corners.
#[derive(Debug, Default)]
struct Ignored {
    /// Offsets of their first letters.
    lines: Vec<usize>,
    /// How many of them are faces with fewer than three corners.
    incomplete_faces: usize,
}

/// Vertices, texture coordinates and normals, in the order of a face corner `v/vt/vn`.
const KEYWORDS: [&str; 3] = ["v", "vt", "vn"];
const NOUNS: [&str; 3] = ["vertex", "texture coordinate", "normal"];

/// Checks every index of every face: the parser gives no line for those out of range, and
/// overflows on absurd ones.
fn check_elements(text: &str, path: &Path) -> Result<Ignored> {
    let mut totals = [0_usize; 3];
    for line in text.lines() {
        count_element(line, &mut totals);
    }
    let mut ignored = Ignored::default();
    let mut before = [0_usize; 3];
    let mut line_start = 0;
    for (line, number) in text.split_inclusive('\n').zip(1_u32..) {
        count_element(line, &mut before);
        let mut words = line.split_whitespace();
        let keyword = words.next().unwrap_or("");
        let offset_in_line = |word: &str| word.as_ptr() as usize - line.as_ptr() as usize;
        if keyword == "l" {
            ignored.lines.push(line_start + offset_in_line(keyword));
        } else if keyword == "f" {
            let mut corners = 0;
            for corner in words {
                corners += 1;
                check_corner(corner, before, totals).map_err(|message| {
                    let column = 1 + line[..offset_in_line(corner)].chars().count();
                    let column = u32::try_from(column).unwrap_or(u32::MAX);
                    Error::file(path, message).at(number, column)
                })?;
            }
            if corners < 3 {
                ignored.lines.push(line_start + offset_in_line(keyword));
                ignored.incomplete_faces += 1;
            }
        }
        line_start += line.len();
    }
    Ok(ignored)
}

fn count_element(line: &str, counts: &mut [usize; 3]) {
    let keyword = line.split_whitespace().next();
    if let Some(kind) = KEYWORDS.iter().position(|&known| Some(known) == keyword) {
        counts[kind] += 1;
    }
}

/// Checks a corner `v`, `v/vt`, `v//vn` or `v/vt/vn`; `before` and `totals` count the elements
/// above it (for indices that count back) and in the file.
fn check_corner(
    corner: &str,
    before: [usize; 3],
    totals: [usize; 3],
) -> std::result::Result<(), String> {
    for (kind, digits) in corner.split('/').enumerate() {
        if kind > 0 && kind < 3 && digits.is_empty() {
            continue;
        }
        let index = digits.parse::<i64>().ok().filter(|_| kind < 3);
        let index = index.ok_or_else(|| format!("`{corner}` is no corner of a face"))?;
        let is_in_range = match usize::try_from(index.unsigned_abs()) {
            // Many exporters write 0, or any index, for an attribute that the file does not have.
            Ok(0) => kind > 0,
            Ok(back) if index < 0 => back <= before[kind],
            Ok(index) => index <= totals[kind] || (kind > 0 && totals[kind] == 0),
            Err(_) => false,
        };
        if !is_in_range {
            return Err(format!(
                "{} {index} does not exist; the file has {}",
                NOUNS[kind], totals[kind]
            ));
        }
    }
    Ok(())
}

fn load(bytes: &[u8], path: &Path) -> Result<Mesh> {
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..tobj::LoadOptions::default()
    };
    let mut unread = bytes;
    let loaded = tobj::load_obj_buf(&mut unread, &options, |_| Ok(Default::default()));
    let (models, _) = loaded.map_err(|error| {
        let read = &bytes[..bytes.len() - unread.len()];
        load_error(error, read, path)
    })?;

    let mut mesh = Mesh::default();
    for model in &models {
        let too_many = || Error::limit(format!("{}: more than 2^32 vertices", path.display()));
        let base = u32::try_from(mesh.positions.len()).map_err(|_| too_many())?;
        let positions = model.mesh.positions.chunks_exact(3);
        mesh.positions.extend(positions.map(DVec3::from_slice));
        for face in model.mesh.indices.chunks_exact(3) {
            let corner = |k: usize| face[k].checked_add(base).ok_or_else(too_many);
            mesh.faces.push([corner(0)?, corner(1)?, corner(2)?]);
        }
    }
    Ok(mesh)
}

/// The parser's error with the line at which it stopped reading, unless it concerns a whole group
/// of faces.
fn load_error(error: tobj::LoadError, read: &[u8], path: &Path) -> Error {
    use tobj::LoadError as E;
    let message = match error {
        E::PositionParseError => "a vertex needs three numbers",
        E::ScalingByZeroError => "a vertex has weight 0",
        E::ColorParseError => "a vertex needs 3, 4 or 6 numbers",
        E::NormalParseError => "a normal needs three numbers",
        E::TexcoordParseError => "a texture coordinate needs two numbers",
        E::MaterialParseError => "`usemtl` needs a name",
        E::FaceColorOutOfBounds => {
            return Error::file(path, "some vertices have colours, others none");
        }
        other => return Error::file(path, other.to_string()),
    };
    let line = read.split_inclusive(|&byte| byte == b'\n').count();
    let mut error = Error::file(path, message);
    if let Some(place) = &mut error.place {
        place.line = u32::try_from(line).ok();
    }
    error
}
