//! Triangles and spheres: tables of primitives, the tests of rays against them, and points on them.

pub mod hit;
pub mod normal;
pub mod slab;
pub mod sphere;
#[cfg(test)]
pub(crate) mod testing;
pub mod triangle;

use slab::Bounds;

pub use hit::{
    SurfacePoint, biased_origin, spawn_origin, sphere_point, triangle_hit, triangle_point,
};
pub use normal::{facing_normal, interpolated_normal};

/// Index of a primitive: triangles first, then spheres.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PrimitiveId(pub u32);

impl PrimitiveId {
    /// No primitive: a miss, or nothing to skip.
    pub const NONE: u32 = u32::MAX;
}

/// A triangle in traced coordinates (re-centred, f32). Its geometric normal is along (b − a) × (c − a).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangle {
    /// Corners a, b, c.
    pub corners: [[f32; 3]; 3],
}

/// A sphere in traced coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sphere {
    /// Centre.
    pub center: [f32; 3],
    /// Radius, > 0.
    pub radius: f32,
}

/// All primitives of a scene: triangle `i` has [`PrimitiveId`] `i`, sphere `j` has `triangles.len() + j`.
#[derive(Debug, Clone, Default)]
pub struct Geometry {
    /// Triangles: finite, not of zero area.
    pub triangles: Vec<Triangle>,
    /// Spheres: finite.
    pub spheres: Vec<Sphere>,
    /// Per triangle: coplanar neighbours of equal value may be traced as one polygon, whose hits are
    /// reported under one of its triangles. Empty: none may. Values are otherwise without meaning.
    pub groups: Vec<u32>,
    /// If given, every shadow ray joins two points on primitives, or a primitive and one of these points;
    /// then what lies on the convex hull of them all can occlude nothing. `None`: shadow rays may end
    /// anywhere.
    pub segment_ends: Option<Vec<[f32; 3]>>,
}

impl Geometry {
    /// Number of primitives.
    pub fn len(&self) -> usize {
        self.triangles.len() + self.spheres.len()
    }

    /// Boxes of all primitives, in the order of their ids: exact for triangles, and for spheres rounded
    /// outward, so that no point of one is outside.
    pub fn bounds(&self) -> impl Iterator<Item = Bounds> {
        let triangles = self.triangles.iter();
        let triangles = triangles.map(|triangle| Bounds::of(&triangle.corners));
        let spheres = self.spheres.iter().map(|sphere| Bounds {
            corners: [
                sphere.center.map(|c| (c - sphere.radius).next_down()),
                sphere.center.map(|c| (c + sphere.radius).next_up()),
            ],
        });
        triangles.chain(spheres)
    }

    /// Whether there is nothing.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
