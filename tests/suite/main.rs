//! The integration tests, as one binary.

mod agreement;
mod appearance;
mod auxiliary;
mod browser;
mod builder;
mod cli;
mod closed_forms;
#[path = "../../benches/support/closed_meshes.rs"]
mod closed_meshes;
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
mod oracles;
mod random_scenes;
mod reference;
mod renderer;
mod robustness;
mod sampling;
mod support;
mod triangle_oracle;
mod watertight;
mod ztest;
