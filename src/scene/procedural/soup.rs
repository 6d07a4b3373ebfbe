//! Triangles without order: random places, sizes and orientations, no shared vertices.

use std::f64::consts::PI;

use glam::DVec3;

use super::random::Random;
use super::sink::MeshSink;
use crate::scene::mesh::is_degenerate;

/// Expected area of all triangles together, whatever their number: a ray that crosses the cube of edge 2
/// meets two of them on average (a convex body of volume V that holds the area A is crossed over a length
/// 2V/A per hit).
const TOTAL_AREA: f64 = 16.0;

/// Largest circumscribed sphere over smallest.
const SIZE_RATIO: f64 = 32.0;

/// Expected area of a triangle with independent corners on the unit sphere.
const MEAN_AREA: f64 = PI / 5.0;

/// Makes `triangles` faces in [−1, 1]³.
pub(super) fn make<S: MeshSink>(triangles: u32, seed: u64, sink: &mut S) -> Result<(), S::Error> {
    // Radii are uniform in their logarithm; this is the mean of their squares over the largest one's.
    let mean_square = (1.0 - SIZE_RATIO.powi(-2)) / (2.0 * SIZE_RATIO.ln());
    let largest = (TOTAL_AREA / (f64::from(triangles) * MEAN_AREA * mean_square)).sqrt();
    let mut random = Random::new(seed);
    for _ in 0..triangles {
        let corners = loop {
            let corners = random_corners(largest, &mut random);
            if !is_degenerate(corners.map(|corner| corner.as_dvec3())) {
                break corners;
            }
        };
        let mut face = [0; 3];
        for (index, corner) in face.iter_mut().zip(corners) {
            *index = sink.vertex(corner.to_array())?;
        }
        sink.face(face)?;
    }
    Ok(())
}

/// Three points on a random sphere of up to the radius `largest` in the cube.
fn random_corners(largest: f64, random: &mut Random) -> [glam::Vec3; 3] {
    let radius = largest * SIZE_RATIO.powf(-random.uniform());
    let mut coordinate = || random.between(radius - 1.0, 1.0 - radius);
    let center = DVec3::new(coordinate(), coordinate(), coordinate());
    [(); 3].map(|()| (center + radius * random.direction()).as_vec3())
}

#[cfg(test)]
mod tests {
    use super::super::testing::corners;
    use super::*;
    use crate::scene::Mesh;

    #[test]
    fn soups_of_all_sizes_have_the_same_area() {
        for triangles in [1_000, 64_000] {
            let mut mesh = Mesh::default();
            let Ok(()) = make(triangles, 7, &mut mesh);
            let areas: Vec<f64> = corners(&mesh)
                .map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0)
                .collect();
            let sum: f64 = areas.iter().sum();
            // The standard error of a sum of n equals the root of the sum of squares, at most.
            let error = areas.iter().map(|area| area * area).sum::<f64>().sqrt();
            assert!((sum - TOTAL_AREA).abs() < 4.0 * error, "{sum} ± {error}");
        }
    }
}
