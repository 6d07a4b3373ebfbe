//! The integration tests, as one binary.

mod agreement;
mod appearance;
mod auxiliary;
mod browser;
mod builder;
mod checkpoint;
mod cli;
mod closed_forms;
mod converge;
mod converge_page;
mod determinism;
mod extremes;
mod features;
mod furnace;
mod hits;
mod hostile;
#[path = "../../benches/support/mesh_scenes.rs"]
mod mesh_scenes;
mod meshes;
mod random_scenes;
mod reference;
mod renderer;
mod robustness;
mod sampling;
mod support;
mod triangle_oracle;
mod watertight;
mod ztest;
