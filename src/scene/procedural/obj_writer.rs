//! Writing a mesh as a Wavefront OBJ file while it is made.

use std::io::{self, Write};

use super::sink::MeshSink;

/// Writes each vertex and face to `W` as it comes and keeps none of them. `W` should be buffered.
///
/// Coordinates are the shortest decimals that are read back as the same f32.
#[derive(Debug)]
pub struct ObjWriter<W> {
    output: W,
    vertices: u32,
}

impl<W: Write> ObjWriter<W> {
    /// Begins a file with a comment of one line.
    pub fn new(mut output: W, comment: &str) -> io::Result<Self> {
        writeln!(output, "# {comment}")?;
        Ok(Self {
            output,
            vertices: 0,
        })
    }

    /// Writes what is still in the buffer of `W`.
    pub fn finish(mut self) -> io::Result<()> {
        self.output.flush()
    }
}

impl<W: Write> MeshSink for ObjWriter<W> {
    type Error = io::Error;

    fn vertex(&mut self, [x, y, z]: [f32; 3]) -> io::Result<u32> {
        writeln!(self.output, "v {x} {y} {z}")?;
        self.vertices += 1;
        Ok(self.vertices - 1)
    }

    fn face(&mut self, vertices: [u32; 3]) -> io::Result<()> {
        // OBJ counts from 1.
        let [a, b, c] = vertices.map(|index| index + 1);
        writeln!(self.output, "f {a} {b} {c}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_the_shortest_that_read_back_equal() {
        let mut bytes = Vec::new();
        let mut writer = ObjWriter::new(&mut bytes, "a face").unwrap();
        let third = 1.0 / 3.0;
        assert_eq!(writer.vertex([0.1, -third, 16_777_216.0]).unwrap(), 0);
        assert_eq!(writer.vertex([0.0, 1.5, 1e-9]).unwrap(), 1);
        assert_eq!(writer.vertex([1.0, 2.0, 3.0]).unwrap(), 2);
        writer.face([0, 1, 2]).unwrap();
        writer.finish().unwrap();
        assert_eq!(
            String::from_utf8(bytes).unwrap(),
            "# a face\nv 0.1 -0.33333334 16777216\nv 0 1.5 0.000000001\nv 1 2 3\nf 1 2 3\n"
        );
    }
}
