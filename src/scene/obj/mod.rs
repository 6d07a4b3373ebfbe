//! Wavefront OBJ files with their MTL files and textures.
//!
//! The text is decompressed while it is read, in one thread, and parsed in chunks by all others; tobj
//! reads the MTL files. tobj's own reader took 4.4 to 6.2 s for a terrain of 5.8 million triangles
//! (209 MB) where this one took 1.4 to 2.3 s (three interleaved rounds on two busy cores); it names no
//! lines, and refuses whole files for a vertex that is not finite. Tests compare the two.

mod assemble;
mod chunks;
mod decompress;
mod lines;
mod locate;
mod material;
mod materials;
mod mtl;
mod number;
mod parse;
mod texture;
mod triangulate;

use std::io;
use std::path::Path;
use std::sync::mpsc;
use std::time::Instant;

use rayon::prelude::*;

use self::assemble::Assembly;
use self::chunks::Chunks;
use self::lines::LineMap;
use self::parse::{Elements, Mistake, Statement};
use super::description::{MaterialId, Mesh, MeshFile};
use super::diagnostics::Finding;
use super::library::Library;
use super::mesh;
use crate::error::{Error, Result};

/// Bytes of an OBJ file, uncompressed: about a hundred million faces. An element takes two bytes at
/// least, so that 32 bits count all of them.
const MAX_OBJ_BYTES: u64 = 1 << 32;

/// What an OBJ file holds.
#[derive(Debug)]
pub(super) struct ObjFile {
    /// All its faces, without materials.
    pub(super) mesh: Mesh,
    file: MeshFile,
    statements: Vec<Statement>,
    face_lines: LineMap,
    position_lines: LineMap,
    findings: Vec<String>,
}

/// Reads the file `path`: text, or text compressed by gzip or Zstandard. A failure to read it becomes an
/// error by `unreadable`; a mistake in it, one that names the file and, where it can be found, line and
/// column.
pub(super) fn read(path: &Path, unreadable: impl Fn(&io::Error) -> Error) -> Result<ObjFile> {
    let start = Instant::now();
    let text = decompress::open(path).map_err(|error| unreadable(&error))?;
    let mut bytes = 0;
    let mut assembly = Assembly::default();
    for_each_chunk(text, |chunk| {
        let (text, elements) = chunk.map_err(|error| unreadable(&error))?;
        bytes += text.len() as u64;
        let line_count = assembly.line_count;
        elements
            .map_err(|mistake| Mistake {
                line: mistake.line + line_count,
                ..mistake
            })
            .and_then(|elements| assembly.add(elements, &text))
            .map_err(|mistake| error_at(path, mistake))
    })?;
    let (mesh, repairs) = assembly
        .finish()
        .map_err(|mistake| error_at(path, mistake))?;
    if mesh.faces.is_empty() {
        return Err(Error::file(path, "the file has no faces"));
    }
    let bad_attributes = Finding::new(repairs.bad_attributes, []);
    let findings = [
        assembly
            .non_finite
            .sentence("vertex", "with a coordinate that is not finite"),
        assembly
            .incomplete
            .sentence("face", "with fewer than three corners removed"),
        repairs.fans.sentence(
            "polygon",
            "crossing itself or of too many corners, split about its first corner",
        ),
        bad_attributes.sentence(
            "normal or texture coordinate",
            "that is not finite left out",
        ),
    ];
    Ok(ObjFile {
        file: MeshFile {
            path: path.to_owned(),
            bytes,
            seconds: start.elapsed().as_secs_f64(),
            vertices: mesh.positions.len() as u64,
            triangles: mesh.faces.len() as u64,
        },
        mesh,
        statements: assembly.statements,
        face_lines: assembly.face_lines,
        position_lines: assembly.position_lines,
        findings: findings.into_iter().flatten().collect(),
    })
}

/// A chunk's text and what it says, or the failure to read it.
type ParsedChunk = io::Result<(Vec<u8>, std::result::Result<Elements, Mistake>)>;

/// Calls `consume` for each chunk of `text` in order, and ends at its first error. One thread reads
/// while all threads of the pool parse.
fn for_each_chunk(
    text: Box<dyn io::Read + Send>,
    mut consume: impl FnMut(ParsedChunk) -> Result<()>,
) -> Result<()> {
    let at_a_time = rayon::current_num_threads();
    std::thread::scope(|scope| {
        let (sender, receiver) = mpsc::sync_channel(at_a_time);
        scope.spawn(move || {
            // A receiver that is gone has met an error.
            let _ = Chunks::new(text, MAX_OBJ_BYTES).try_for_each(|chunk| sender.send(chunk));
        });
        while let Ok(first) = receiver.recv() {
            let waiting = receiver.try_iter().take(at_a_time - 1);
            let chunks: Vec<io::Result<Vec<u8>>> = std::iter::once(first).chain(waiting).collect();
            let parse = |chunk: io::Result<Vec<u8>>| {
                chunk.map(|text| {
                    let elements = parse::parse(&text);
                    (text, elements)
                })
            };
            let parsed: Vec<ParsedChunk> = chunks.into_par_iter().map(parse).collect();
            parsed.into_iter().try_for_each(&mut consume)?;
        }
        Ok(())
    })
}

fn error_at(path: &Path, mistake: Mistake) -> Error {
    let mut error = Error::file(path, mistake.message);
    if let Some(place) = &mut error.place {
        place.line = Some(mistake.line);
        place.column = (mistake.column > 0).then_some(mistake.column);
    }
    error
}

impl ObjFile {
    /// Gives the faces the materials of the MTL files, added to `library` as `file/name`; returns the
    /// material of those that have no other. What is missing is told in `library`, and grey.
    pub(super) fn use_own_materials(&mut self, library: &mut Library) -> MaterialId {
        materials::assign(&mut self.mesh, &self.statements, &self.file.path, library)
    }

    /// The mesh without faces that cannot be traced. Tells `library` what was found, and that the file
    /// was read. Errors with `nothing_left` if no face is left.
    pub(super) fn finish(
        mut self,
        library: &mut Library,
        nothing_left: impl Fn() -> Error,
    ) -> Result<Mesh> {
        let removed = mesh::clean(&mut self.mesh);
        let line_of_face = |face| Some(self.face_lines.line_of(face));
        let line_of_vertex = |vertex| Some(self.position_lines.line_of(vertex));
        let removals = removed.sentences(line_of_face, line_of_vertex);
        for finding in self.findings.into_iter().chain(removals) {
            let warning = Error::file(&self.file.path, finding).to_string();
            library.warnings.push(warning);
        }
        library.mesh_files.push(self.file);
        if self.mesh.faces.is_empty() {
            return Err(nothing_left());
        }
        Ok(self.mesh)
    }
}

/// The name of an OBJ file without folder and endings; `None` unless it ends in `.obj`, `.obj.gz` or
/// `.obj.zst`.
pub(super) fn stem(path: &Path) -> Option<&str> {
    let name = path.file_name()?.to_str()?;
    let ends_in = |name: &str, ending: &str| {
        let tail = name.len().checked_sub(ending.len());
        tail.is_some_and(|at| name.is_char_boundary(at) && name[at..].eq_ignore_ascii_case(ending))
    };
    [".obj", ".obj.gz", ".obj.zst"]
        .into_iter()
        .find(|ending| ends_in(name, ending))
        .map(|ending| &name[..name.len() - ending.len()])
}

#[cfg(test)]
mod tests;
