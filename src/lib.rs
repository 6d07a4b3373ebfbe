//! wavepath
pub mod accel;
pub mod error;
pub mod geometry;
pub mod light;
pub mod material;
pub mod math;
pub mod scene;

pub use error::{Error, ErrorKind, Result};
