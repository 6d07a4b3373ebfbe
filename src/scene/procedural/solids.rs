//! Simple solids and the flat grid, of some thousand faces.

use std::collections::HashMap;
use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use crate::scene::Mesh;

/// A box of these edge lengths about the origin: 8 vertices, 12 faces.
pub fn cuboid(size: DVec3) -> Mesh {
    let corner = |index: u32| {
        let side = |bit: u32| if index >> bit & 1 == 1 { 0.5 } else { -0.5 };
        DVec3::new(side(0), side(1), side(2)) * size
    };
    // Bit k of a vertex index is its side along axis k; each quad is counter-clockwise from outside.
    let quads: [[u32; 4]; 6] = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    Mesh {
        positions: (0..8).map(corner).collect(),
        faces: quads
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect(),
        ..Mesh::default()
    }
}

/// A sphere about the origin as an icosahedron whose faces are split into four `subdivisions`
/// times: 20·4^subdivisions faces with all vertices at `radius`.
pub fn icosphere(radius: f64, subdivisions: u32) -> Mesh {
    let mut mesh = icosahedron();
    for _ in 0..subdivisions {
        split_faces(&mut mesh);
    }
    for position in &mut mesh.positions {
        *position *= radius;
    }
    mesh
}

/// An icosahedron with unit circumradius: three golden rectangles.
fn icosahedron() -> Mesh {
    let golden = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut positions = Vec::new();
    for sign in [
        (-1.0, -golden),
        (1.0, -golden),
        (-1.0, golden),
        (1.0, golden),
    ] {
        positions.push(DVec3::new(0.0, sign.0, sign.1).normalize());
        positions.push(DVec3::new(sign.0, sign.1, 0.0).normalize());
        positions.push(DVec3::new(sign.1, 0.0, sign.0).normalize());
    }
    // Faces are the triples of vertices at edge length from one another, turned outward.
    let edge = 2.0 / (1.0 + golden * golden).sqrt();
    let are_adjacent = |a: u32, b: u32| {
        let distance = positions[a as usize].distance(positions[b as usize]);
        (distance - edge).abs() < 0.1 * edge
    };
    let mut faces = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if are_adjacent(a, b) && are_adjacent(b, c) && are_adjacent(c, a) {
                    let [p, q, r] = [a, b, c].map(|index| positions[index as usize]);
                    let is_outward = (q - p).cross(r - p).dot(p) > 0.0;
                    faces.push(if is_outward { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    Mesh {
        positions,
        faces,
        ..Mesh::default()
    }
}

/// Splits each face at the middles of its edges, which are moved out to the unit sphere.
fn split_faces(mesh: &mut Mesh) {
    let positions = &mut mesh.positions;
    let mut middles = HashMap::new();
    let mut middle = |a: u32, b: u32| {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            positions.push((positions[a as usize] + positions[b as usize]).normalize());
            positions.len() as u32 - 1
        })
    };
    let mut faces = Vec::with_capacity(4 * mesh.faces.len());
    for &[a, b, c] in &mesh.faces {
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        faces.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    mesh.faces = faces;
}

/// A torus about the z axis: a tube of radius `tube_radius` around a circle of `radius`, with
/// `segments` around the axis and `sides` around the tube: 2·segments·sides faces.
pub fn torus(radius: f64, tube_radius: f64, segments: u32, sides: u32) -> Mesh {
    let angle = |step: u32, steps: u32| TAU * f64::from(step) / f64::from(steps);
    let vertex = |segment: u32, side: u32| {
        let around = DVec2::from_angle(angle(segment, segments));
        let along = DVec2::from_angle(angle(side, sides)) * tube_radius;
        (around * (radius + along.x)).extend(along.y)
    };
    let index = |segment: u32, side: u32| (segment % segments) * sides + side % sides;
    let mut mesh = Mesh::default();
    for segment in 0..segments {
        for side in 0..sides {
            mesh.positions.push(vertex(segment, side));
            let [a, b] = [index(segment, side), index(segment + 1, side)];
            let [c, d] = [index(segment + 1, side + 1), index(segment, side + 1)];
            mesh.faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

/// A unit square in the plane z = 0 about the origin, facing +z, of `cells[0]` by `cells[1]`
/// cells: 2 faces each.
pub fn grid(cells: [u32; 2]) -> Mesh {
    let [columns, rows] = cells;
    let mut mesh = Mesh::default();
    for row in 0..=rows {
        for column in 0..=columns {
            let x = f64::from(column) / f64::from(columns) - 0.5;
            let y = f64::from(row) / f64::from(rows) - 0.5;
            mesh.positions.push(DVec3::new(x, y, 0.0));
        }
    }
    let index = |column: u32, row: u32| row * (columns + 1) + column;
    for row in 0..rows {
        for column in 0..columns {
            let [a, b] = [index(column, row), index(column + 1, row)];
            let [c, d] = [index(column + 1, row + 1), index(column, row + 1)];
            mesh.faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::super::testing::{corners, is_closed, volume};
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn a_cuboid_is_closed_and_has_its_volume() {
        let mesh = cuboid(DVec3::new(1.0, 2.0, 3.0));
        assert_eq!((mesh.positions.len(), mesh.faces.len()), (8, 12));
        assert!(is_closed(&mesh));
        assert!((volume(&mesh) - 6.0).abs() < 1e-14);
    }

    #[test]
    fn icospheres_are_closed_and_approach_the_sphere() {
        for (subdivisions, tolerance) in [(0, 0.4), (1, 0.15), (4, 0.003)] {
            let mesh = icosphere(2.0, subdivisions);
            assert_eq!(mesh.faces.len(), 20 << (2 * subdivisions));
            assert!(is_closed(&mesh));
            assert!(
                mesh.positions
                    .iter()
                    .all(|p| (p.length() - 2.0).abs() < 1e-14)
            );
            let exact = 4.0 / 3.0 * PI * 8.0;
            let missing = 1.0 - volume(&mesh) / exact;
            assert!(missing > 0.0 && missing < tolerance, "{missing}");
        }
    }

    #[test]
    fn a_torus_is_closed_and_approaches_its_volume() {
        let mesh = torus(2.0, 0.5, 200, 100);
        assert_eq!(mesh.faces.len(), 40_000);
        assert!(is_closed(&mesh));
        let exact = 2.0 * PI * PI * 2.0 * 0.25;
        assert!((volume(&mesh) / exact - 1.0).abs() < 2e-3);
    }

    #[test]
    fn a_grid_covers_the_unit_square_facing_up() {
        let mesh = grid([3, 5]);
        assert_eq!((mesh.positions.len(), mesh.faces.len()), (24, 30));
        let areas = corners(&mesh).map(|[a, b, c]| (b - a).cross(c - a).z / 2.0);
        let (smallest, sum) = areas.fold((f64::MAX, 0.0), |(m, s), area| (m.min(area), s + area));
        assert!(smallest > 0.0);
        assert!((sum - 1.0).abs() < 1e-14);
    }
}
