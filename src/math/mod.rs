//! Lanes, vectors of lanes, frames, warps and floating-point error bounds.

pub mod elementary;
pub mod float;
pub mod frame;
pub mod lanes;
pub mod mis;
pub mod prefetch;
pub mod table;
pub(crate) mod testing;
pub mod vec3;
pub mod warp;

pub use frame::Frame;
pub use lanes::{Compare, F32s, LANES, Mask, U32s};
pub use prefetch::prefetch;
pub use table::Table;
pub use vec3::Vec3s;
