//! Where a generator puts its mesh: into memory, or piece by piece into a file.

use std::convert::Infallible;

use glam::DVec3;

use crate::scene::Mesh;

/// Receives a mesh piece by piece. A face comes after its vertices.
pub trait MeshSink {
    /// Why a piece could not be taken.
    type Error;

    /// Takes a vertex and gives its index: vertices are counted from 0 in the order in which they come.
    fn vertex(&mut self, position: [f32; 3]) -> Result<u32, Self::Error>;

    /// Takes a face with these vertices, counter-clockwise from its front.
    fn face(&mut self, vertices: [u32; 3]) -> Result<(), Self::Error>;

    /// Takes a quad as two faces, split from its first corner.
    fn quad(&mut self, [a, b, c, d]: [u32; 4]) -> Result<(), Self::Error> {
        self.face([a, b, c])?;
        self.face([a, c, d])
    }
}

impl MeshSink for Mesh {
    type Error = Infallible;

    fn vertex(&mut self, position: [f32; 3]) -> Result<u32, Infallible> {
        self.positions
            .push(DVec3::from_array(position.map(f64::from)));
        Ok(self.positions.len() as u32 - 1)
    }

    fn face(&mut self, vertices: [u32; 3]) -> Result<(), Infallible> {
        self.faces.push(vertices);
        Ok(())
    }
}
