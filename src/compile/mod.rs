//! From the scene as written to the scene as traced: what is needed is decided, flattened, built.

mod camera;
pub mod compiled;
pub mod features;
mod geometry;
mod work_item;

pub use camera::Camera;
pub use compiled::{CompiledScene, PrimitiveClass, SurfaceTable, compile};
pub use features::Features;
pub use work_item::{TILE, WorkItem};
