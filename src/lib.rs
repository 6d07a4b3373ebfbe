//! wavepath
pub mod accel;
pub mod error;
pub mod film;
pub mod geometry;
pub mod integrator;
pub mod math;
pub mod report;
pub mod scene;

pub use error::{Error, ErrorKind, Result};
