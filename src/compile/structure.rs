//! What settings of a scene mean to [`crate::accel`].

use crate::accel::{self, BuildQuality, Structure};
use crate::geometry::Geometry;
use crate::scene::{AccelKind, AccelQuality};

/// The structure of this kind; [`AccelKind::Auto`] chooses by the primitives.
pub fn structure(kind: AccelKind, geometry: &Geometry) -> Structure {
    match kind {
        AccelKind::Auto => accel::auto(geometry),
        AccelKind::Linear => Structure::Linear,
        AccelKind::Octree => Structure::Octree,
        AccelKind::Bvh2 => Structure::Bvh2,
        AccelKind::Bvh8 => Structure::Bvh8,
        AccelKind::Packet => Structure::Packet,
    }
}

/// The quality of its build.
pub fn build_quality(quality: AccelQuality) -> BuildQuality {
    match quality {
        AccelQuality::Fast => BuildQuality::Fast,
        AccelQuality::Medium => BuildQuality::Medium,
        AccelQuality::Best => BuildQuality::Best,
    }
}
