//! A triangle's box cut in two by a plane: never too small on either side.

use glam::Vec3A;
use obvhs::aabb::Aabb;

use crate::geometry::Triangle;

/// Relative to the largest coordinate, the error of a point where an edge crosses a plane: with u = 2⁻⁵³, t
/// has three roundings, t (b − a) two more on at most twice the coordinate, the sum one: at most 12 u.
const CROSSING_ERROR: f64 = 16.0 * (0.5 * f64::EPSILON);

/// Boxes around those parts of a triangle in a box that lie below and above `place` along an axis; `None` for
/// a side without any part. Corners are exact, crossings are found in f64 from the corners and rounded outward.
pub(super) fn halves(
    triangle: &Triangle,
    bounds: &Aabb,
    axis: usize,
    place: f32,
) -> [Option<Aabb>; 2] {
    let mut sides = [Aabb::empty(); 2];
    for (at, start) in triangle.corners.iter().enumerate() {
        let end = &triangle.corners[(at + 1) % 3];
        let corner = Vec3A::from_array(*start);
        if start[axis] <= place {
            extend(&mut sides[0], corner, corner);
        }
        if start[axis] >= place {
            extend(&mut sides[1], corner, corner);
        }
        if start[axis].min(end[axis]) < place && place < start[axis].max(end[axis]) {
            let [low, high] = crossing(start, end, axis, place);
            sides.iter_mut().for_each(|side| extend(side, low, high));
        }
    }
    sides[0].max[axis] = sides[0].max[axis].min(place);
    sides[1].min[axis] = sides[1].min[axis].max(place);
    sides.map(|side| {
        let shared = Aabb::new(side.min.max(bounds.min), side.max.min(bounds.max));
        shared.min.cmple(shared.max).all().then_some(shared)
    })
}

#[inline]
fn extend(bounds: &mut Aabb, low: Vec3A, high: Vec3A) {
    bounds.min = bounds.min.min(low);
    bounds.max = bounds.max.max(high);
}

/// Corners of a box around the point where an edge crosses a plane.
#[inline]
fn crossing(start: &[f32; 3], end: &[f32; 3], axis: usize, place: f32) -> [Vec3A; 2] {
    let [a, b] = [start, end].map(|corner| corner.map(f64::from));
    let t = (f64::from(place) - a[axis]) / (b[axis] - a[axis]);
    let around = |side: f64| {
        [0, 1, 2].map(|k| {
            let error = CROSSING_ERROR * a[k].abs().max(b[k].abs());
            (a[k] + t * (b[k] - a[k]) + side * error) as f32
        })
    };
    [
        Vec3A::from_array(around(-1.0).map(f32::next_down)),
        Vec3A::from_array(around(1.0).map(f32::next_up)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::testing::Rng;

    /// Whether a point is in a box, but for the rounding of the point itself.
    fn holds(bounds: &Aabb, point: [f64; 3], error: f64) -> bool {
        let [low, high] = [bounds.min, bounds.max].map(|corner| corner.to_array().map(f64::from));
        (0..3).all(|k| low[k] - error <= point[k] && point[k] <= high[k] + error)
    }

    #[test]
    fn every_point_of_a_triangle_is_in_one_of_its_parts_on_its_side() {
        let mut rng = Rng(10);
        for (scale, offset) in [(1.0, 0.0), (1e-6, 0.0), (1e7, 0.0), (1.0, 1e6)] {
            for _ in 0..200 {
                let [from, along, aside] = [0, 1, 2].map(|_| rng.sphere());
                let corner = |a: f32, b: f32| {
                    [0, 1, 2].map(|k| (from[k] + a * along[k] + b * aside[k]) * scale + offset)
                };
                let triangle = Triangle {
                    corners: [corner(0.0, 0.0), corner(3.0, 0.01), corner(3.1, 0.0)],
                };
                let whole = Aabb::from_points(&triangle.corners.map(Vec3A::from));
                // Cut again and again, each time the part with most of the triangle along some axis.
                let mut parts = vec![whole];
                for cut in 0..6 {
                    let bounds = parts.swap_remove(0);
                    let axis = cut % 3;
                    let share = rng.uniform();
                    let place = bounds.min[axis] + share * (bounds.max[axis] - bounds.min[axis]);
                    let halves = halves(&triangle, &bounds, axis, place);
                    let [below, above] = halves;
                    assert!(below.is_none_or(|half| half.max[axis] <= place));
                    assert!(above.is_none_or(|half| half.min[axis] >= place));
                    parts.extend(halves.into_iter().flatten());
                }
                let [a, b, c] = triangle.corners.map(|p| p.map(f64::from));
                let largest = [a, b, c]
                    .concat()
                    .iter()
                    .fold(0.0f64, |x, y| x.max(y.abs()));
                for trial in 0..50 {
                    let (mut u, mut v) = rng.barycentrics();
                    // On edges and corners too.
                    match trial % 4 {
                        1 => v = 0.0,
                        2 => u = 0.0,
                        3 => (u, v) = ([0.0, 1.0, 0.0][trial % 3], [0.0, 0.0, 1.0][trial % 3]),
                        _ => {}
                    }
                    let (u, v) = (f64::from(u), f64::from(v));
                    let point = [0, 1, 2].map(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]));
                    let error = 4.0 * f64::EPSILON * largest;
                    assert!(
                        parts.iter().any(|part| holds(part, point, error)),
                        "{point:?} of {triangle:?} in {parts:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_side_without_any_part_is_none() {
        let triangle = Triangle {
            corners: [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        };
        // The triangle's box, but none of the triangle, is in this corner.
        let corner = Aabb::new(Vec3A::new(0.75, 0.75, 0.0), Vec3A::new(1.0, 1.0, 0.0));
        assert_eq!(halves(&triangle, &corner, 0, 0.9)[1], None);
        let whole = Aabb::from_points(&triangle.corners.map(Vec3A::from));
        let [below, above] = halves(&triangle, &whole, 1, 0.75);
        let [below, above] = [below, above].map(|half| half.expect("has a part").max.x);
        assert_eq!(below, 1.0);
        assert!((0.25..0.250_001).contains(&above), "{above}");
    }
}
