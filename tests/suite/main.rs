//! The integration tests, as one binary.

mod agreement;
mod appearance;
mod auxiliary;
mod builder;
mod cli;
mod closed_forms;
mod determinism;
mod extremes;
mod features;
mod furnace;
mod hits;
mod hostile;
#[path = "../../benches/support/mesh_scenes.rs"]
mod mesh_scenes;
mod meshes;
mod reference;
mod renderer;
mod support;
mod triangle_oracle;
mod watertight;
mod ztest;
