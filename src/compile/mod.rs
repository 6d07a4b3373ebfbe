//! From the scene as written to the scene as traced: what is needed is decided, flattened, built.

mod attributes;
pub mod branching;
mod camera;
pub mod compiled;
pub mod features;
mod geometry;
mod maps;
mod structure;
mod work_item;

pub use attributes::CornerAttributes;
pub use branching::Branching;
pub use camera::Camera;
pub use compiled::{
    Albedo, CompiledScene, PrimitiveClass, SurfaceTable, compile, compile_with_progress,
};
pub use features::Features;
pub use maps::MaterialMaps;
pub use structure::{build_quality, structure};
pub use work_item::{TILE, WorkItem};
