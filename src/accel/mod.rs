//! Acceleration structures behind one batch trait. They know primitives, not materials.

mod blocks;
mod build_options;
mod bvh2;
mod bvh8;
mod clip;
mod collapse;
mod flight;
pub mod foreign;
mod huge_pages;
mod leaf;
mod linear;
mod morton;
mod octant;
mod octree;
mod order;
mod packet;
mod ploc;
mod polygon;
mod reinsertion;
mod sbvh;
mod shell;
mod stack;
mod stream;
#[cfg(test)]
mod tests;
mod tree;
mod walk;

pub use build_options::{BuildOptions, BuildPhase, BuildQuality};
pub use bvh2::Bvh2;
pub use bvh8::Bvh8;
pub use linear::LinearScan;
pub use octree::Octree;

use crate::error::{Error, Result};
use crate::geometry::Geometry;

/// Which structure to build.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Structure {
    /// [`LinearScan`].
    Linear,
    /// [`Octree`].
    Octree,
    /// [`Bvh2`].
    Bvh2,
    /// [`Bvh8`].
    Bvh8,
    /// [`Bvh8`] with packets of rays wherever they can.
    Packet,
}

impl Structure {
    /// Every structure.
    pub const ALL: [Self; 5] = [
        Self::Linear,
        Self::Octree,
        Self::Bvh2,
        Self::Bvh8,
        Self::Packet,
    ];

    /// Name as on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Octree => "octree",
            Self::Bvh2 => "bvh2",
            Self::Bvh8 => "bvh8",
            Self::Packet => "packet",
        }
    }
}

/// Up to this many primitives the linear scan is the faster one for all kinds of rays taken together.
/// Measured with `wavepath accels` and 16 lanes, in millions of rays per CPU second, scan against [`Bvh8`], for camera
/// rays, bounces, shuffled bounces, shadow rays: of the 32 triangles of `scenes/cornell.toml` 62, 51, 54, 63
/// against 80, 13, 10, 20; of the 156 primitives of `scenes/many-lights.toml` 6.5, 10.5, 10.1, 9.3 against 47, 9.7,
/// 9.0, 10.4. The scan's time grows with their number, the tree's hardly: a camera ray, a bounce and a shadow ray
/// together take as long at about 96.
pub const LINEAR_MOST: usize = 6 * crate::math::LANES;

/// The structure that answers fastest, by the number of primitives.
pub fn auto(geometry: &Geometry) -> Structure {
    if geometry.len() <= LINEAR_MOST {
        Structure::Linear
    } else {
        Structure::Bvh8
    }
}

/// Builds a structure over the primitives at medium quality.
///
/// # Errors
/// [`crate::ErrorKind::Limit`] for 2³¹ primitives or more.
pub fn build(structure: Structure, geometry: &Geometry) -> Result<Box<dyn Accel>> {
    build_with(structure, geometry, &BuildOptions::default())
}

/// Builds a structure over the primitives.
///
/// # Errors
/// [`crate::ErrorKind::Limit`] for 2³¹ primitives or more.
pub fn build_with(
    structure: Structure,
    geometry: &Geometry,
    options: &BuildOptions<'_>,
) -> Result<Box<dyn Accel>> {
    check_limit(geometry.len())?;
    Ok(match structure {
        Structure::Linear => Box::new(LinearScan::new(geometry)),
        Structure::Octree => Box::new(Octree::new(geometry)),
        Structure::Bvh2 => Box::new(Bvh2::with_options(geometry, options)),
        Structure::Bvh8 => Box::new(Bvh8::new(geometry, options)?),
        Structure::Packet => Box::new(Bvh8::packets(geometry, options)?),
    })
}

/// Refuses more primitives than there are indices of leaves.
///
/// # Errors
/// [`crate::ErrorKind::Limit`].
pub(crate) fn check_limit(primitives: usize) -> Result<()> {
    if primitives > tree::MOST_LEAVES {
        return Err(Error::limit(
            "a scene may have at most 2^31 - 1 triangles and spheres together",
        ));
    }
    Ok(())
}

/// A batch of rays in structure-of-arrays columns, all of the same length `len` padded with
/// readable slack to a multiple of the lane width. Directions are unit length, in f32.
#[derive(Debug, Clone, Copy)]
pub struct RayBatch<'a> {
    /// Rays in the batch; the columns are at least `len` rounded up to the lane width long, and
    /// what lies past `len` may be anything, NaN included.
    pub len: usize,
    /// Origins.
    pub origin: [&'a [f32]; 3],
    /// Directions.
    pub direction: [&'a [f32]; 3],
    /// The primitive that each ray starts on, which it cannot hit again if it is a triangle, and by
    /// the chord rule if it is a sphere ([`crate::geometry::PrimitiveId::NONE`]: none).
    pub skip: &'a [u32],
}

/// Closest hits of a batch, columns as long as the batch's.
#[derive(Debug)]
pub struct HitBatch<'a> {
    /// Distance along the ray, > 0; infinite where nothing is hit.
    pub t: &'a mut [f32],
    /// Primitive hit, or [`crate::geometry::PrimitiveId::NONE`].
    pub primitive: &'a mut [u32],
}

/// A batch of shadow rays: segments that start on `rays.skip` and end before `t_max`.
#[derive(Debug, Clone, Copy)]
pub struct ShadowBatch<'a> {
    /// The rays.
    pub rays: RayBatch<'a>,
    /// Ends of the segments: hits at t < t_max occlude.
    pub t_max: &'a [f32],
    /// The light's primitive, which cannot occlude itself (or `NONE`).
    pub target: &'a [u32],
}

/// Work done by queries, summed per worker.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct AccelCounters {
    /// Nodes (boxes, or groups of boxes) visited.
    pub nodes: u64,
    /// Ray–primitive tests.
    pub tests: u64,
}

/// A structure that answers batches of ray queries over a fixed set of primitives.
///
/// The answer for a ray depends on that ray alone, not on its neighbours in the batch.
/// Equal distances are resolved to the lower primitive id.
pub trait Accel: Send + Sync + std::fmt::Debug {
    /// Name as on the command line.
    fn name(&self) -> &'static str;

    /// Bytes held, primitives included.
    fn bytes(&self) -> usize;

    /// Closest hit with t > 0 of each ray.
    fn closest(&self, rays: RayBatch<'_>, hits: HitBatch<'_>, counters: &mut AccelCounters);

    /// Writes 1 to `occluded` where something lies on the segment, else 0.
    fn occluded(&self, rays: ShadowBatch<'_>, occluded: &mut [u32], counters: &mut AccelCounters);
}
