//! Meshes made by formula. Closed ones have their normals outward.

mod hairball;
mod obj_writer;
mod random;
mod scalable;
mod sink;
mod solids;
mod soup;
mod sponge;
mod terrain;
#[cfg(test)]
mod testing;

pub use obj_writer::ObjWriter;
pub use scalable::{ScalableKind, ScalableMesh};
pub use sink::MeshSink;
pub use solids::{cuboid, grid, icosphere, torus};
