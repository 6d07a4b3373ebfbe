//! Lanes, vectors of lanes, frames, warps and floating-point error bounds.

pub mod float;
pub mod lanes;
pub mod vec3;

pub use lanes::{Compare, F32s, LANES, Mask, U32s};
pub use vec3::Vec3s;
