//! The closed convex shell that many scenes have: the walls of a room.
//!
//! A ray that starts inside of a closed convex surface leaves it through the plane, among those that it
//! runs towards, that it reaches first. So walls need no edge tests: distances to planes decide, and
//! since one of them is always the first, no ray escapes between two walls.

use std::collections::{HashMap, HashSet};

use glam::DVec3;

use super::polygon::{MOST_FACES, Polygon};
use crate::geometry::Geometry;
use crate::math::float::UNIT_ROUNDOFF;

/// How far beyond a plane a point may lie and still count as on it, as a share of the largest coordinate:
/// corners of one plane rounded to f32 deviate by a few roundings, more where the plane's own triangle is
/// small.
const COPLANAR: f64 = 32.0 * UNIT_ROUNDOFF as f64;

/// Walls of one shell must turn by more than 2.5°: where two nearly share a plane, rounding would decide
/// which of them is hit far from their common edge.
const MOST_COSINE: f64 = 0.999;

/// A polygon on the convex hull.
#[derive(Debug, Clone, Copy)]
pub(super) struct HullPolygon {
    /// Its number among the polygons.
    pub(super) index: usize,
    /// Whether its normal points inward.
    pub(super) inward: bool,
}

fn position(p: &[f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

/// The polygons that lie on the convex hull of all vertices, spheres and `others`; none of more than
/// [`MOST_FACES`], since every polygon is held against every point.
pub(super) fn on_hull(
    polygons: &[Polygon],
    vertices: &[[f32; 3]],
    geometry: &Geometry,
    others: &[[f32; 3]],
) -> Vec<HullPolygon> {
    if polygons.len() > MOST_FACES {
        return Vec::new();
    }
    let points: Vec<(DVec3, f64)> = vertices
        .iter()
        .chain(others)
        .map(|p| (position(p), 0.0))
        .chain(
            geometry
                .spheres
                .iter()
                .map(|s| (position(&s.center), f64::from(s.radius))),
        )
        .collect();
    let largest = points
        .iter()
        .map(|(p, radius)| p.abs().max_element() + radius)
        .fold(0.0, f64::max);
    let slack = COPLANAR * largest;
    polygons
        .iter()
        .enumerate()
        .filter_map(|(index, polygon)| {
            let anchor = position(&vertices[polygon.corners[0] as usize]);
            let encloses = |outward: DVec3| {
                points
                    .iter()
                    .all(|(p, radius)| outward.dot(*p - anchor) + radius <= slack)
            };
            let normal = position(&polygon.normal);
            let inward = encloses(-normal);
            (inward || encloses(normal)).then_some(HullPolygon { index, inward })
        })
        .collect()
}

/// Of polygons on the hull, those that close it, each alone in its plane; none if they leave a gap.
pub(super) fn closed(hull: &[HullPolygon], polygons: &[Polygon]) -> Vec<HullPolygon> {
    let edges = |wall: &HullPolygon| {
        let corners = &polygons[wall.index].corners;
        let next = corners.iter().cycle().skip(1);
        corners
            .iter()
            .zip(next)
            .map(|(&a, &b)| [a.min(b), a.max(b)])
            .collect::<Vec<_>>()
    };
    let mut walls = hull.to_vec();
    loop {
        let mut uses: HashMap<[u32; 2], u32> = HashMap::new();
        for edge in walls.iter().flat_map(edges) {
            *uses.entry(edge).or_default() += 1;
        }
        let before = walls.len();
        walls.retain(|wall| edges(wall).iter().all(|edge| uses[edge] == 2));
        if walls.len() == before {
            break;
        }
    }
    let outward = |wall: &HullPolygon| {
        let normal = position(&polygons[wall.index].normal);
        if wall.inward { -normal } else { normal }
    };
    let apart = |(i, a): (usize, &HullPolygon)| {
        walls[i + 1..]
            .iter()
            .all(|b| outward(a).dot(outward(b)) <= MOST_COSINE)
    };
    if walls.iter().enumerate().all(apart) {
        walls
    } else {
        Vec::new()
    }
}

/// Ids of hull polygons.
pub(super) fn ids(hull: &[HullPolygon], polygons: &[Polygon]) -> HashSet<u32> {
    hull.iter().map(|wall| polygons[wall.index].id).collect()
}
