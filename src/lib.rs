//! wavepath
pub mod accel;
pub mod cli;
pub mod compile;
pub mod error;
pub mod film;
pub mod geometry;
pub mod integrator;
pub mod light;
pub mod material;
pub mod math;
pub mod reference;
pub mod report;
pub mod sampler;
pub mod scene;
pub mod stage;
pub mod wave;

pub use error::{Error, ErrorKind, Result};
