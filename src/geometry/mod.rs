//! Triangles and spheres: tables of primitives and the tests of rays against them.

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
}

impl Geometry {
    /// Number of primitives.
    pub fn len(&self) -> usize {
        self.triangles.len() + self.spheres.len()
    }

    /// Whether there is nothing.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
