//! Sample points: every number is a function of (seed, pixel, sample, dimension).
//!
//! Dimensions are laid out by purpose, so that a kernel that needs fewer of them leaves the others
//! unchanged: [`CAMERA_DIMENSIONS`] for the camera, then [`BOUNCE_DIMENSIONS`] for each hit.

mod hash;
pub mod pcg;
pub mod sobol;
pub mod stratified;

pub use pcg::Pcg32s;
pub use sobol::Sobol;
pub use stratified::Strata;

/// Dimensions 0 and 1: position in the pixel.
pub const CAMERA_DIMENSIONS: u32 = 2;

/// Dimensions of each hit, in the order of [`Dimension`].
pub const BOUNCE_DIMENSIONS: u32 = 7;

/// Purposes of the numbers of one hit, as offsets from the hit's first dimension. What some scenes and
/// materials do not need comes last of its kind, so that leaving it out leaves out a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Dimension {
    /// Where on the light (and the next dimension).
    LightPoint = 0,
    /// Which light.
    LightChoice = 2,
    /// Which direction (and the next dimension).
    Direction = 3,
    /// Which lobe of the material.
    Lobe = 5,
    /// Russian roulette.
    Roulette = 6,
}
