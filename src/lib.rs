//! wavepath
pub mod accel;
pub mod error;
pub mod geometry;
pub mod math;
pub mod reference;
pub mod scene;

pub use error::{Error, ErrorKind, Result};
