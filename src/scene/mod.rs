//! Scenes as written: reading, checking, meshes. Nothing here knows how they are traced.

pub mod description;
pub mod settings;

pub use description::*;
pub use settings::*;
