//! `wavepath mesh`: a mesh of any size into an OBJ file.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use indicatif::ProgressBar;

use crate::error::{Error, Result};
use crate::film::write_atomically;
use crate::scene::procedural::{MeshSink, ObjWriter, ScalableMesh};

use super::args::MeshArgs;
use super::progress::triangle_bar;
use super::{Status, interrupt, note, print};

/// Faces between two looks at the clock and at requests to stop.
const INTERVAL: u64 = 1 << 14;

/// Bytes written at once.
const BUFFER: usize = 1 << 20;

pub(super) fn run(args: &MeshArgs) -> Result<Status> {
    let path = &args.output;
    check_extension(path)?;
    let mesh = ScalableMesh::new(args.kind, args.triangles, args.seed)?;
    interrupt::listen()?;
    let bar = triangle_bar(mesh.faces(), args.quiet);
    let summary = format!("{}, {} triangles", args.kind.name(), mesh.faces());
    let written = write_atomically(path, |file| {
        let comment = format!("{summary}, seed {}", args.seed);
        write(&mesh, &comment, file, &bar).map_err(|error| Error::io(path, &error))
    });
    bar.finish_and_clear();
    if written.is_err() && interrupt::requested() {
        note("interrupted; no file was written");
        return Ok(Status::Interrupted);
    }
    written?;
    if args.quiet {
        return Ok(Status::Done);
    }
    let place = std::path::absolute(path).unwrap_or(path.clone());
    print(&format!("{summary}\nwrote {}\n", place.display()))
}

fn check_extension(path: &Path) -> Result<()> {
    let is_obj = path
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("obj"));
    if is_obj {
        Ok(())
    } else {
        Err(Error::usage(format!(
            "{}: the name of a mesh must end in .obj",
            path.display()
        )))
    }
}

fn write(
    mesh: &ScalableMesh,
    comment: &str,
    output: impl Write,
    bar: &ProgressBar,
) -> io::Result<()> {
    let mut sink = Watched {
        writer: ObjWriter::new(BufWriter::with_capacity(BUFFER, output), comment)?,
        bar,
        faces: 0,
    };
    mesh.make(&mut sink)?;
    sink.writer.finish()
}

/// Writes, shows how far it is, and stops when that is requested.
#[derive(Debug)]
struct Watched<'a, W> {
    writer: ObjWriter<W>,
    bar: &'a ProgressBar,
    faces: u64,
}

impl<W: Write> MeshSink for Watched<'_, W> {
    type Error = io::Error;

    fn vertex(&mut self, position: [f32; 3]) -> io::Result<u32> {
        self.writer.vertex(position)
    }

    fn face(&mut self, vertices: [u32; 3]) -> io::Result<()> {
        self.faces += 1;
        if self.faces.is_multiple_of(INTERVAL) {
            self.bar.set_position(self.faces);
            if interrupt::requested() {
                return Err(io::ErrorKind::Interrupted.into());
            }
        }
        self.writer.face(vertices)
    }
}
