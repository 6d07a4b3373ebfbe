//! Triangle meshes: placing them, and removing what cannot be traced.

use glam::DVec3;

use super::description::Mesh;
use super::values::MAX_COORDINATE;

/// Faces that [`clean`] removed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Removed {
    /// With a coordinate that is not finite, or beyond [`MAX_COORDINATE`].
    pub(super) unbounded: usize,
    /// Of zero area.
    pub(super) degenerate: usize,
    /// Equal to an earlier face, corner for corner.
    pub(super) duplicate: usize,
}

impl Removed {
    /// One sentence per kind of face that was removed.
    pub(super) fn sentences(&self) -> impl Iterator<Item = String> {
        [
            (
                self.unbounded,
                "with a coordinate that is not finite or beyond 1.8e18 removed",
            ),
            (self.degenerate, "of zero area removed"),
            (self.duplicate, "equal to another removed"),
        ]
        .into_iter()
        .filter(|&(count, _)| count > 0)
        .map(|(count, what)| {
            format!(
                "{count} {} {what}",
                if count == 1 { "face" } else { "faces" }
            )
        })
    }
}

/// Scales about the origin, then moves. An odd number of negative factors mirrors the mesh; its
/// faces are turned then, so that the same side stays in front.
pub(super) fn place(mesh: &mut Mesh, scale: DVec3, translate: DVec3) {
    for position in &mut mesh.positions {
        *position = *position * scale + translate;
    }
    if scale.x * scale.y * scale.z < 0.0 {
        for face in &mut mesh.faces {
            face.swap(1, 2);
        }
    }
}

/// Whether a triangle with finite corners has no area, or none that their rounding leaves certain.
///
/// A corner written in decimal is off by up to ε/2·m per coordinate, with m its largest absolute
/// coordinate and ε = 2^-52; so the cross product of two edges of length ≤ e carries an error up to
/// about 4·ε·m·e, and no smaller one can be told from zero.
pub(super) fn is_degenerate([a, b, c]: [DVec3; 3]) -> bool {
    let (ab, ac) = (b - a, c - a);
    let largest = a.abs().max(b.abs()).max(c.abs()).max_element();
    let longest = ab.length().max(ac.length()).max((c - b).length());
    ab.cross(ac).length() <= 4.0 * f64::EPSILON * largest * longest
}

/// Removes faces that cannot be traced or are there twice, then vertices that no face uses. Faces
/// that differ in orientation are not the same: their front sides are different.
///
/// Every index must be in range, and `face_materials` empty.
pub(super) fn clean(mesh: &mut Mesh) -> Removed {
    let mut removed = Removed::default();
    let positions = &mesh.positions;
    mesh.faces.retain(|face| {
        let corners = face.map(|index| positions[index as usize]);
        let is_unbounded = !corners.into_iter().all(is_bounded);
        let is_degenerate = !is_unbounded && is_degenerate(corners);
        removed.unbounded += usize::from(is_unbounded);
        removed.degenerate += usize::from(is_degenerate);
        !is_unbounded && !is_degenerate
    });
    removed.duplicate = drop_duplicates(mesh);
    drop_unused_vertices(mesh);
    removed
}

fn is_bounded(corner: DVec3) -> bool {
    corner.abs().cmple(DVec3::splat(MAX_COORDINATE)).all()
}

/// Removes all but the first of faces with equal corners in equal order, whichever comes first in
/// it; returns how many.
fn drop_duplicates(mesh: &mut Mesh) -> usize {
    let welded = weld(&mesh.positions);
    let corners = |face: &[u32; 3]| {
        let mut corners = face.map(|index| welded[index as usize]);
        let lowest = (0..3).min_by_key(|&k| corners[k]).unwrap_or(0);
        corners.rotate_left(lowest);
        corners
    };
    let first = first_equal(mesh.faces.iter().map(corners));
    let before = mesh.faces.len();
    let mut index = 0..;
    mesh.faces.retain(|_| {
        index
            .next()
            .is_some_and(|index| first[index] as usize == index)
    });
    before - mesh.faces.len()
}

/// For each position, the index of the first one equal to it.
fn weld(positions: &[DVec3]) -> Vec<u32> {
    // Adding zero turns −0 into +0, which compares equal but has other bits.
    let bits = |position: &DVec3| (*position + DVec3::ZERO).to_array().map(f64::to_bits);
    first_equal(positions.iter().map(bits))
}

/// For each key, the index of the first one equal to it. Keys are sorted rather than hashed: an
/// OBJ file of 5.8 million faces loads in 4.8 s so, and took 11.3 s with hash tables.
fn first_equal<K: Ord>(keys: impl Iterator<Item = K>) -> Vec<u32> {
    let mut order: Vec<(K, u32)> = keys.zip(0..).collect();
    order.sort_unstable();
    let mut first = vec![0; order.len()];
    for equal in order.chunk_by(|a, b| a.0 == b.0) {
        for &(_, index) in equal {
            first[index as usize] = equal[0].1;
        }
    }
    first
}

fn drop_unused_vertices(mesh: &mut Mesh) {
    const UNUSED: u32 = u32::MAX;
    let mut renumbered = vec![UNUSED; mesh.positions.len()];
    let mut kept = Vec::new();
    for index in mesh.faces.iter_mut().flatten() {
        let old = *index as usize;
        if renumbered[old] == UNUSED {
            renumbered[old] = kept.len() as u32;
            kept.push(mesh.positions[old]);
        }
        *index = renumbered[old];
    }
    mesh.positions = kept;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> Mesh {
        Mesh {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y],
            faces: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        }
    }

    #[test]
    fn a_sound_mesh_is_left_alone() {
        let mut mesh = square();
        assert_eq!(clean(&mut mesh), Removed::default());
        assert_eq!(mesh.faces, square().faces);
        assert_eq!(mesh.positions, square().positions);
    }

    #[test]
    fn each_kind_of_bad_face_is_counted_once() {
        let mut mesh = square();
        mesh.positions.extend([
            DVec3::new(f64::NAN, 0.0, 0.0),
            DVec3::new(0.0, 1.9e18, 0.0),
            DVec3::new(0.5, 0.5, 0.0),
            DVec3::new(-0.0, 0.0, 0.0),
        ]);
        mesh.faces.extend([
            [0, 1, 4], // NaN
            [0, 1, 5], // too far
            [0, 6, 2], // on a line
            [1, 1, 2], // two corners in one
            [2, 0, 1], // the first face, turned
            [7, 1, 2], // the first face with −0 for 0
            [0, 2, 1], // the first face from behind: another face
        ]);
        let removed = clean(&mut mesh);
        assert_eq!(
            removed,
            Removed {
                unbounded: 2,
                degenerate: 2,
                duplicate: 2
            }
        );
        assert_eq!(removed.sentences().count(), 3);
        assert_eq!(mesh.faces, [[0, 1, 2], [0, 2, 3], [0, 2, 1]]);
        assert_eq!(mesh.positions.len(), 4);
        assert!(mesh.positions.iter().all(|position| position.is_finite()));
    }

    #[test]
    fn zero_area_is_recognised_where_decimals_round() {
        let on_a_line = [0.1, 0.2, 0.3].map(|t| DVec3::new(t, 3.0 * t, 7.0 * t));
        assert!(is_degenerate(on_a_line));
        let far = on_a_line.map(|corner| corner + DVec3::splat(1e6));
        assert!(is_degenerate(far));
        let needle = [DVec3::ZERO, DVec3::X, DVec3::new(0.5, 1e-12, 0.0)];
        assert!(!is_degenerate(needle));
        let tiny = [DVec3::ZERO, DVec3::X, DVec3::Y].map(|corner| corner * 1e-30);
        assert!(!is_degenerate(tiny));
    }

    #[test]
    fn mirroring_keeps_the_front_in_front() {
        let mut mesh = square();
        place(&mut mesh, DVec3::new(-2.0, 1.0, 1.0), DVec3::Z);
        for face in &mesh.faces {
            let [a, b, c] = face.map(|index| mesh.positions[index as usize]);
            assert!((b - a).cross(c - a).z > 0.0);
            assert_eq!(a.z, 1.0);
        }
    }
}
