//! Properties of meshes that tests check.

use std::collections::HashMap;

use glam::DVec3;

use crate::scene::Mesh;

/// Corners of each face.
pub(super) fn corners(mesh: &Mesh) -> impl Iterator<Item = [DVec3; 3]> {
    mesh.faces
        .iter()
        .map(|face| face.map(|index| mesh.positions[index as usize]))
}

/// By the divergence theorem; positive if normals are outward.
pub(super) fn volume(mesh: &Mesh) -> f64 {
    corners(mesh).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

/// Whether each edge is walked once in each direction: closed, and oriented one way.
pub(super) fn is_closed(mesh: &Mesh) -> bool {
    let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
    for &[a, b, c] in &mesh.faces {
        for edge in [(a, b), (b, c), (c, a)] {
            *edges.entry(edge).or_default() += 1;
        }
    }
    edges
        .iter()
        .all(|(&(a, b), &count)| count == 1 && edges.get(&(b, a)) == Some(&1))
}
