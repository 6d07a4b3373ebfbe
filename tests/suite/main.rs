//! The integration tests, as one binary.

mod agreement;
mod auxiliary;
mod builder;
mod cli;
mod closed_forms;
mod determinism;
mod extremes;
mod features;
mod furnace;
mod meshes;
mod oracles;
mod reference;
mod renderer;
mod support;
mod ztest;
