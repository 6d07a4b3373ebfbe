//! Spatial splits before the build: triangles that fill their boxes badly get several smaller boxes, after
//! Karras and Aila, "Fast Parallel Construction of High-Quality Bounding Volume Hierarchies", 2013, section
//! 4.3: planes of a dyadic grid over the scene, the coarsest first, so that neighbours are split alike.

use rayon::prelude::*;

use crate::geometry::slab::Bounds;
use crate::geometry::{Geometry, Triangle};

/// Boxes added, as a share of the triangles.
const SHARE: f64 = 0.5;

/// Boxes of one triangle at most.
const MOST_PARTS: u32 = 64;

/// A box is split if it has more than this many times the mean area: splits of what is small cost nodes and gain
/// nothing. Surface-area costs with packs of 4, relative to no splits, for 4 / 10 / 30: a star destroyer of 4.1
/// million bricks' triangles 0.905 / 0.899 / 0.894, Sponza 1.031 / 1.044 / 1.024, a dragon 1.003 / - / -.
const LARGE: f64 = 30.0;

/// A triangle is split if this share of its box's area is waste. The walls of buildings, right triangles along
/// the axes, have 0.5: splits take the two of a quad from one leaf, and leave three quarters of their boxes.
const WASTEFUL: f64 = 0.55;

/// Levels of the dyadic grid.
const LEVELS: i32 = 20;

/// A box around a part of a triangle, and the triangle's id. All boxes of a triangle cover it.
pub(super) type Part = (Bounds, u32);

/// The boxes of all triangles, at most `limit` of them if there are no more triangles than that.
pub(super) fn triangle_parts(geometry: &Geometry, limit: usize) -> Vec<Part> {
    let triangles = &geometry.triangles;
    let grid = Grid::new(triangles);
    let budget = (SHARE * triangles.len() as f64).min(limit.saturating_sub(triangles.len()) as f64);
    // In the order of the triangles, so that the sum does not depend on the number of threads.
    let priorities: Vec<f64> = triangles.par_iter().map(|t| grid.priority(t)).collect();
    let sum: f64 = priorities.iter().sum();
    let scale = if sum > 0.0 { budget / sum } else { 0.0 };
    (triangles.par_iter().zip(&priorities).enumerate())
        .flat_map_iter(|(id, (triangle, priority))| {
            let splits = ((priority * scale) as u32).min(MOST_PARTS - 1);
            let parts = grid.split(triangle, splits);
            parts.into_iter().map(move |bounds| (bounds, id as u32))
        })
        .collect()
}

/// Planes at which boxes are split: the scene's box, halved again and again.
struct Grid {
    low: [f64; 3],
    /// Cells of the finest level per unit, the same along all axes.
    scale: f64,
    /// Mean of the triangles' [`box_area`].
    mean_area: f64,
}

impl Grid {
    fn new(triangles: &[Triangle]) -> Self {
        let all = triangles
            .par_iter()
            .map(|triangle| Bounds::of(&triangle.corners))
            .reduce(|| Bounds::EMPTY, |a, b| a.union(&b));
        let [low, high] = all.corners.map(|corner| corner.map(f64::from));
        let extent = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
        // In their order, so that the sum does not depend on the number of threads.
        let sum: f64 = triangles.iter().map(box_area).sum();
        Self {
            low,
            mean_area: sum / triangles.len().max(1) as f64,
            scale: f64::from(1 << LEVELS) / if extent > 0.0 { extent } else { 1.0 },
        }
    }

    /// How much a triangle asks for splits: the cube root of its waste of area, halved for each level of
    /// the grid down to the first plane that its box crosses.
    fn priority(&self, triangle: &Triangle) -> f64 {
        let bounds = Bounds::of(&triangle.corners);
        let area = box_area(triangle);
        let waste = area - projected_area(triangle);
        if area <= LARGE * self.mean_area || waste <= WASTEFUL * area {
            return 0.0;
        }
        let Some((level, ..)) = self.plane(&bounds) else {
            return 0.0;
        };
        (waste * 0.5f64.powi(level)).cbrt()
    }

    /// The level, axis and place of the coarsest plane that crosses the inside of a box; of several, along its
    /// longest axis.
    fn plane(&self, bounds: &Bounds) -> Option<(i32, usize, f32)> {
        let mut best: Option<(i32, usize, f32)> = None;
        for axis in 0..3 {
            let [low, high] = bounds.corners.map(|corner| corner[axis]);
            let cell = |x: f32| ((f64::from(x) - self.low[axis]) * self.scale) as u32;
            let differing = cell(low) ^ cell(high);
            if differing == 0 {
                continue;
            }
            // The highest bit in which both cells differ: the plane is where it becomes 1.
            let bit = differing.ilog2();
            let place = f64::from(cell(high) >> bit << bit) / self.scale + self.low[axis];
            let (level, place) = (LEVELS - bit as i32, place as f32);
            let before = best.map_or(f64::NEG_INFINITY, |(_, axis, _)| extent(bounds, axis));
            let coarser = best.is_none_or(|(other, ..)| level < other);
            let longer =
                best.is_some_and(|(other, ..)| level == other) && extent(bounds, axis) > before;
            if low < place && place < high && (coarser || longer) {
                best = Some((level, axis, place));
            }
        }
        best
    }

    /// Boxes that cover the triangle, after up to so many splits.
    fn split(&self, triangle: &Triangle, splits: u32) -> Vec<Bounds> {
        let mut parts = Vec::with_capacity(splits as usize + 1);
        let mut work = vec![(Bounds::of(&triangle.corners), splits)];
        while let Some((bounds, splits)) = work.pop() {
            let is_large = f64::from(bounds.half_area()) > LARGE * self.mean_area;
            let plane = if splits > 0 && is_large {
                self.plane(&bounds)
            } else {
                None
            };
            let Some((_, axis, place)) = plane else {
                parts.push(bounds);
                continue;
            };
            let halves = [0, 1].map(|side| {
                let mut half = bounds;
                half.corners[1 - side][axis] = place;
                intersection(&half, &slab_bounds(triangle, axis, &half))
            });
            let size = halves.map(|half| half.map_or(0.0, |half| longest(&half)));
            let share = size[0] / (size[0] + size[1]);
            let left = (f64::from(splits - 1) * share + 0.5) as u32;
            for (half, splits) in halves.into_iter().zip([left, splits - 1 - left]) {
                // A half without a box has no part of the triangle.
                work.extend(half.map(|half| (half, splits)));
            }
        }
        parts
    }
}

/// Extent of a box along an axis.
fn extent(bounds: &Bounds, axis: usize) -> f64 {
    f64::from(bounds.corners[1][axis]) - f64::from(bounds.corners[0][axis])
}

/// Largest extent of a box.
fn longest(bounds: &Bounds) -> f64 {
    (0..3).map(|axis| extent(bounds, axis)).fold(0.0, f64::max)
}

/// Half of the surface area of a triangle's box.
fn box_area(triangle: &Triangle) -> f64 {
    let bounds = Bounds::of(&triangle.corners);
    let [x, y, z] = [0, 1, 2].map(|axis| extent(&bounds, axis));
    x * y + y * z + z * x
}

/// Sum of the areas of the triangle's projections along the three axes: half of the surface area of ever
/// smaller boxes around it.
fn projected_area(triangle: &Triangle) -> f64 {
    let [a, b, c] = triangle
        .corners
        .map(|corner| glam::Vec3::from_array(corner).as_dvec3());
    0.5 * (b - a).cross(c - a).abs().element_sum()
}

/// What two boxes share, if anything.
fn intersection(a: &Bounds, b: &Bounds) -> Option<Bounds> {
    let low = [0, 1, 2].map(|k| a.corners[0][k].max(b.corners[0][k]));
    let high = [0, 1, 2].map(|k| a.corners[1][k].min(b.corners[1][k]));
    (0..3).all(|k| low[k] <= high[k]).then_some(Bounds {
        corners: [low, high],
    })
}

/// Relative to the largest coordinate, the error of a point where an edge crosses a plane: with u = 2⁻⁵³, t
/// has three roundings, t (b − a) two more on at most twice the coordinate, the sum one: at most 12 u.
const CROSSING_ERROR: f64 = 16.0 * (0.5 * f64::EPSILON);

/// A box around that part of a triangle which lies between the planes of a box along one axis. It is never too
/// small: corners are exact, crossings are found in f64 from the corners and rounded outward.
fn slab_bounds(triangle: &Triangle, axis: usize, slab: &Bounds) -> Bounds {
    let [low, high] = slab.corners.map(|corner| corner[axis]);
    let mut bounds = Bounds::EMPTY;
    for (at, start) in triangle.corners.iter().enumerate() {
        let end = &triangle.corners[(at + 1) % 3];
        if (low..=high).contains(&start[axis]) {
            bounds = bounds.union(&Bounds::of(&[*start]));
        }
        for plane in [low, high] {
            let (from, to) = (start[axis].min(end[axis]), start[axis].max(end[axis]));
            if from < plane && plane < to {
                bounds = bounds.union(&crossing(start, end, axis, plane));
            }
        }
    }
    bounds
}

/// A box around the point where an edge crosses a plane.
fn crossing(start: &[f32; 3], end: &[f32; 3], axis: usize, plane: f32) -> Bounds {
    let [a, b] = [start, end].map(|corner| corner.map(f64::from));
    let t = (f64::from(plane) - a[axis]) / (b[axis] - a[axis]);
    let around = |side: f64| {
        [0, 1, 2].map(|k| {
            let error = CROSSING_ERROR * a[k].abs().max(b[k].abs());
            (a[k] + t * (b[k] - a[k]) + side * error) as f32
        })
    };
    Bounds {
        corners: [
            around(-1.0).map(f32::next_down),
            around(1.0).map(f32::next_up),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::testing::{Rng, cube};

    /// This many long thin triangles in all directions, before 399 times as many small ones.
    fn needles(count: usize, scale: f32, offset: f32) -> Vec<Triangle> {
        let mut rng = Rng(9);
        (0..400 * count)
            .map(|k| {
                let scale = if k < count { scale } else { 1e-3 * scale };
                let [from, along, aside] = [0, 1, 2].map(|_| rng.sphere());
                let corner = |a: f32, b: f32| {
                    [0, 1, 2].map(|k| (from[k] + a * along[k] + b * aside[k]) * scale + offset)
                };
                Triangle {
                    corners: [corner(0.0, 0.0), corner(3.0, 0.01), corner(3.1, 0.0)],
                }
            })
            .collect()
    }

    #[test]
    fn every_point_of_a_triangle_is_in_one_of_its_boxes() {
        let mut rng = Rng(10);
        for (scale, offset) in [(1.0, 0.0), (1e-6, 0.0), (1e7, 0.0), (1.0, 1e6)] {
            let geometry = Geometry {
                triangles: needles(20, scale, offset),
                ..Geometry::default()
            };
            let parts = triangle_parts(&geometry, usize::MAX);
            assert!(parts.len() > 8100, "boxes were split: {}", parts.len());
            assert!(parts.len() <= 12_000, "within the budget: {}", parts.len());
            for (id, triangle) in geometry.triangles.iter().enumerate().take(40) {
                let own: Vec<Bounds> = (parts.iter())
                    .filter(|part| part.1 == id as u32)
                    .map(|part| part.0)
                    .collect();
                for trial in 0..200 {
                    let (mut u, mut v) = rng.barycentrics();
                    // On edges and corners too.
                    match trial % 4 {
                        1 => v = 0.0,
                        2 => u = 0.0,
                        3 => (u, v) = ([0.0, 1.0, 0.0][trial % 3], [0.0, 0.0, 1.0][trial % 3]),
                        _ => {}
                    }
                    let (u, v) = (f64::from(u), f64::from(v));
                    let [a, b, c] = triangle.corners.map(|p| p.map(f64::from));
                    let point = [0, 1, 2].map(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]));
                    // What rounding of the tested point itself may do.
                    let error = [0, 1, 2].map(|k| {
                        4.0 * f64::EPSILON
                            * [a, b, c]
                                .map(|p| p[k].abs())
                                .iter()
                                .fold(0.0, |x, y| y.max(x))
                    });
                    let inside = |bounds: &Bounds| {
                        let [low, high] = bounds.corners.map(|p| p.map(f64::from));
                        (0..3).all(|k| {
                            low[k] - error[k] <= point[k] && point[k] <= high[k] + error[k]
                        })
                    };
                    assert!(
                        own.iter().any(inside),
                        "{point:?} of {triangle:?} in {own:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn splitting_saves_most_of_the_area_of_needles_and_leaves_walls_alone() {
        let area = |parts: &[Part]| -> f64 {
            parts.iter().map(|part| f64::from(part.0.half_area())).sum()
        };
        let geometry = Geometry {
            triangles: needles(20, 1.0, 0.0),
            ..Geometry::default()
        };
        let whole = geometry.triangles.iter().enumerate();
        let whole: Vec<Part> = whole
            .map(|(id, triangle)| (Bounds::of(&triangle.corners), id as u32))
            .collect();
        assert_eq!(triangle_parts(&geometry, 8000), whole, "no room for more");
        let ratio = area(&triangle_parts(&geometry, usize::MAX)) / area(&whole);
        assert!(ratio < 0.3, "{ratio}");
        let wall = Geometry {
            triangles: cube().triangles(),
            ..Geometry::default()
        };
        assert_eq!(triangle_parts(&wall, usize::MAX).len(), 12);
    }
}
