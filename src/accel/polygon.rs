//! Convex polygons for the linear scan: welded vertices, shared edges, and coplanar neighbours merged
//! where the geometry's groups allow it.

use std::collections::HashMap;

use glam::DVec3;

use crate::geometry::{Geometry, Triangle};
use crate::math::float::UNIT_ROUNDOFF;

/// A convex polygon of three or more corners.
#[derive(Debug, Clone)]
pub(super) struct Polygon {
    /// Vertex indices in order.
    pub(super) corners: Vec<u32>,
    /// Unit normal.
    pub(super) normal: [f32; 3],
    /// The lowest of the ids of its triangles.
    pub(super) id: u32,
}

/// All triangles as polygons over welded vertices.
#[derive(Debug)]
pub(super) struct Polygons {
    /// Distinct positions.
    pub(super) vertices: Vec<[f32; 3]>,
    /// In the order of their ids.
    pub(super) polygons: Vec<Polygon>,
    /// Per triangle, the id of the polygon that it is part of.
    pub(super) owner: Vec<u32>,
}

/// Most corners of a merged polygon; more edges cost as much as the triangles.
pub(super) const MAX_CORNERS: usize = 8;

/// A merged polygon must keep each corner this far from the line through any edge that does not end
/// there, as a share of its diameter. With rays that start within [`super::linear::REACH`] scene radii,
/// polygons of at least [`MIN_SHARE`] of the scene, and grazing rays treated apart, its image stays
/// convex under the rounding of the projection.
const MIN_MARGIN: f64 = 1.0 / 64.0;

/// Least diameter of a merged polygon as a share of the scene's radius.
const MIN_SHARE: f64 = 1.0 / 64.0;

/// Most distance of a corner from the plane, in roundings of the largest coordinate. Corners of a plane
/// quad rounded to f32 lie within √3 of one each.
const FLATNESS: f64 = 8.0 * UNIT_ROUNDOFF as f64;

/// Most triangles that are merged, and most polygons among which a shell is sought. Both take quadratic time
/// (38 s to merge 86 thousand triangles of one group), and scenes that a scan suits have far fewer.
pub(super) const MOST_FACES: usize = 4096;

/// Welds, merges and measures.
pub(super) fn polygons(geometry: &Geometry) -> Polygons {
    let (vertices, faces) = weld(&geometry.triangles);
    let positions: Vec<DVec3> = vertices
        .iter()
        .map(|&p| DVec3::from_array(p.map(f64::from)))
        .collect();
    let radius = scene_radius(&positions);

    let mut owner: Vec<u32> = (0..faces.len() as u32).collect();
    let mut polygons: Vec<Polygon> = Vec::new();
    let mut neighbours: HashMap<u32, Vec<u32>> = HashMap::new();
    let merged = if faces.len() <= MOST_FACES {
        geometry.groups.as_slice()
    } else {
        &[]
    };
    for (face, &group) in merged.iter().enumerate().take(faces.len()) {
        neighbours.entry(group).or_default().push(face as u32);
    }
    for (id, face) in (0u32..).zip(&faces) {
        if owner[id as usize] != id {
            continue;
        }
        let mut corners = face.to_vec();
        let candidates = merged
            .get(id as usize)
            .and_then(|group| neighbours.get(group));
        for _ in 3..MAX_CORNERS {
            let grown = candidates.into_iter().flatten().find_map(|&other| {
                (other > id && owner[other as usize] == other)
                    .then(|| grow(&corners, faces[other as usize], &positions, radius))
                    .flatten()
                    .map(|grown| (other, grown))
            });
            let Some((other, grown)) = grown else { break };
            owner[other as usize] = id;
            corners = grown;
        }
        polygons.push(Polygon {
            normal: unit_normal(&corners, &positions),
            corners,
            id,
        });
    }
    Polygons {
        vertices,
        polygons,
        owner,
    }
}

/// Distinct positions, and faces that index them.
fn weld(triangles: &[Triangle]) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let mut index = HashMap::new();
    let mut vertices = Vec::new();
    let faces = triangles
        .iter()
        .map(|triangle| {
            triangle.corners.map(|p| {
                // −0 and +0 are one position.
                let p = p.map(|x| x + 0.0);
                *index.entry(p.map(f32::to_bits)).or_insert_with(|| {
                    vertices.push(p);
                    vertices.len() as u32 - 1
                })
            })
        })
        .collect();
    (vertices, faces)
}

fn scene_radius(positions: &[DVec3]) -> f64 {
    let (low, high) = positions
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &p| {
            (low.min(p), high.max(p))
        });
    if positions.is_empty() {
        0.0
    } else {
        (high - low).length() * 0.5
    }
}

/// Twice the vector area.
fn area_vector(corners: &[u32], positions: &[DVec3]) -> DVec3 {
    let first = positions[corners[0] as usize];
    corners
        .windows(2)
        .map(|w| (positions[w[0] as usize] - first).cross(positions[w[1] as usize] - first))
        .sum()
}

fn unit_normal(corners: &[u32], positions: &[DVec3]) -> [f32; 3] {
    area_vector(corners, positions)
        .normalize()
        .to_array()
        .map(|x| x as f32)
}

/// `corners` with the triangle's third vertex put into the edge that they share, if the outcome is flat,
/// strictly convex and large.
fn grow(corners: &[u32], face: [u32; 3], positions: &[DVec3], radius: f64) -> Option<Vec<u32>> {
    let n = corners.len();
    let (at, apex) = (0..n).find_map(|i| {
        let edge = [corners[i], corners[(i + 1) % n]];
        // The neighbour runs through the shared edge the other way round when both face the same way.
        (0..3).find_map(|k| {
            ([face[(k + 1) % 3], face[k]] == edge).then_some((i + 1, face[(k + 2) % 3]))
        })
    })?;
    if corners.contains(&apex) {
        return None;
    }
    let mut grown = corners.to_vec();
    grown.insert(at, apex);
    is_flat_and_convex(&grown, positions, radius).then_some(grown)
}

fn is_flat_and_convex(corners: &[u32], positions: &[DVec3], radius: f64) -> bool {
    let points: Vec<DVec3> = corners.iter().map(|&c| positions[c as usize]).collect();
    let n = points.len();
    let normal = area_vector(corners, positions).normalize();
    let diameter = points
        .iter()
        .flat_map(|p| points.iter().map(|q| p.distance(*q)))
        .fold(0.0, f64::max);
    let largest = points
        .iter()
        .map(|p| p.abs().max_element())
        .fold(0.0, f64::max);
    let flat = points
        .iter()
        .all(|&p| (p - points[0]).dot(normal).abs() <= FLATNESS * largest);
    let convex = (0..n).all(|i| {
        let (start, end) = (points[i], points[(i + 1) % n]);
        let inward = normal.cross(end - start).normalize();
        (2..n).all(|k| (points[(i + k) % n] - start).dot(inward) >= MIN_MARGIN * diameter)
    });
    flat && convex
        && diameter >= MIN_SHARE * radius
        && FLATNESS * largest <= MIN_MARGIN * MIN_MARGIN * diameter
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::testing::hexagonal_room;

    fn room(groups: bool) -> Polygons {
        let (mesh, values) = hexagonal_room();
        polygons(&Geometry {
            triangles: mesh.triangles(),
            groups: if groups { values } else { Vec::new() },
            ..Geometry::default()
        })
    }

    #[test]
    fn a_room_becomes_two_hexagons_six_walls_a_light_and_four_faces() {
        let room = room(true);
        let mut sizes: Vec<usize> = room.polygons.iter().map(|p| p.corners.len()).collect();
        sizes.sort_unstable();
        assert_eq!(sizes, [3, 3, 3, 3, 4, 4, 4, 4, 4, 4, 4, 6, 6]);
        assert_eq!(room.vertices.len(), 20);
        for (triangle, &owner) in room.owner.iter().enumerate() {
            assert!(owner as usize <= triangle);
            assert!(room.polygons.iter().any(|p| p.id == owner));
        }
    }

    #[test]
    fn without_groups_nothing_is_merged() {
        let room = room(false);
        assert_eq!(room.polygons.len(), 26);
        assert!(room.owner.iter().zip(0..).all(|(&owner, id)| owner == id));
    }

    #[test]
    fn bent_collinear_or_reflex_neighbours_are_not_merged() {
        let merged = |apex: [f32; 3]| {
            let [a, b, c] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
            let triangles = vec![
                Triangle { corners: [a, b, c] },
                Triangle {
                    corners: [c, b, apex],
                },
            ];
            let geometry = Geometry {
                triangles,
                groups: vec![5, 5],
                ..Geometry::default()
            };
            polygons(&geometry).polygons.len() == 1
        };
        assert!(merged([1.0, 1.0, 0.0]));
        assert!(!merged([1.0, 1.0, 0.01]), "bent");
        assert!(!merged([2.0, 0.0, 0.0]), "collinear");
        assert!(!merged([2.0, -0.5, 0.0]), "reflex");
    }
}
