//! Polygons as triangles, by ear clipping (Meisters, "Polygons Have Ears", 1975).

use glam::{DVec2, DVec3};

/// Largest polygon that is clipped: the time grows with the square of its corners, to about a second
/// at this many.
const MAX_CORNERS: usize = 1 << 14;

/// What became of a polygon.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Outcome {
    /// It is convex, or has no finite outline: a fan about its first corner.
    Fan,
    /// Triangles of corners counted along the outline: two fewer than it has corners.
    Triangles(Vec<[u32; 3]>),
    /// Its outline crosses itself or has more than 2¹⁴ corners. A fan is as good as anything.
    NoTriangulation,
}

/// Triangulates the polygon with this outline of four corners or more, seen along the axis nearest to its
/// normal (Newell's: Sutherland, Sproull and Schumacker, 1974). The order of corners is kept, so
/// that fronts stay fronts.
pub(super) fn polygon(outline: &[DVec3]) -> Outcome {
    let flat = project(outline);
    if is_convex(&flat) || !flat.iter().all(|corner| corner.is_finite()) {
        return Outcome::Fan;
    }
    if flat.len() > MAX_CORNERS {
        return Outcome::NoTriangulation;
    }
    clip_ears(&flat).map_or(Outcome::NoTriangulation, Outcome::Triangles)
}

/// The outline about its first corner without the coordinate in which its normal is largest, turned so
/// that it runs counter-clockwise.
fn project(outline: &[DVec3]) -> Vec<DVec2> {
    let origin = outline[0];
    // The vector area: the sum over edges of p × q / 2.
    let normal: DVec3 = outline
        .windows(2)
        .map(|edge| (edge[0] - origin).cross(edge[1] - origin))
        .sum();
    let size = normal.abs();
    let axis = (0..3)
        .max_by(|&a, &b| size[a].total_cmp(&size[b]))
        .unwrap_or(2);
    let (mut u, mut v) = ((axis + 1) % 3, (axis + 2) % 3);
    if normal[axis] < 0.0 {
        std::mem::swap(&mut u, &mut v);
    }
    outline
        .iter()
        .map(|corner| *corner - origin)
        .map(|corner| DVec2::new(corner[u], corner[v]))
        .collect()
}

/// Twice the area of a triangle, positive counter-clockwise.
fn cross(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - b)
}

/// Whether a counter-clockwise outline never turns right and goes about its inside once.
fn is_convex(flat: &[DVec2]) -> bool {
    // Between two corners at one point no turn can be seen.
    let mut distinct = flat.to_vec();
    distinct.dedup();
    if distinct.len() > 1 && distinct.first() == distinct.last() {
        distinct.pop();
    }
    let corner = |k: usize| distinct[k % distinct.len()];
    let turn = |k| cross(corner(k), corner(k + 1), corner(k + 2));
    (0..distinct.len()).all(|k| turn(k) >= 0.0) && turns_once(&distinct)
}

/// Whether an outline that never turns right goes about its inside once, not like a star.
fn turns_once(outline: &[DVec2]) -> bool {
    // Each time around, the edges' directions go from left to right once.
    let count = outline.len();
    let goes_right: Vec<bool> = (0..count)
        .map(|k| outline[(k + 1) % count] - outline[k])
        .filter(|edge| *edge != DVec2::ZERO)
        .map(|edge| (edge.x, edge.y) > (0.0, 0.0))
        .collect();
    let starts = (0..goes_right.len()).filter(|&k| {
        let before = goes_right[(k + goes_right.len() - 1) % goes_right.len()];
        goes_right[k] && !before
    });
    starts.count() == 1
}

/// The triangles of a counter-clockwise outline; `None` if at some point no ear is left.
fn clip_ears(flat: &[DVec2]) -> Option<Vec<[u32; 3]>> {
    let count = flat.len();
    let mut outline = Outline {
        flat,
        next: (1..count).chain([0]).collect(),
        previous: [count - 1].into_iter().chain(0..count - 1).collect(),
        inward: Vec::new(),
    };
    outline.inward = (0..count).filter(|&k| outline.turn(k) <= 0.0).collect();
    let mut triangles = Vec::with_capacity(count - 2);
    let mut left = count;
    let mut tip = 0;
    while left > 3 {
        // Corners on a straight line are cut only where nothing else can be: they have no area.
        let ear = outline
            .find_ear(tip, left, |turn| turn > 0.0)
            .or_else(|| outline.find_ear(tip, left, |turn| turn == 0.0))?;
        let (before, after) = (outline.previous[ear], outline.next[ear]);
        triangles.push([before, ear, after].map(|k| k as u32));
        outline.remove(ear);
        left -= 1;
        // Skipping a corner gives less slender triangles than going on beside the cut.
        tip = outline.next[after];
    }
    let (before, after) = (outline.previous[tip], outline.next[tip]);
    triangles.push([before, tip, after].map(|k| k as u32));
    (outline.turn(tip) >= 0.0).then_some(triangles)
}

/// What is left of a polygon.
struct Outline<'a> {
    flat: &'a [DVec2],
    next: Vec<usize>,
    previous: Vec<usize>,
    /// Corners where it does not turn left: only these can lie in an ear, and cutting makes no new ones.
    inward: Vec<usize>,
}

impl Outline<'_> {
    fn turn(&self, k: usize) -> f64 {
        let [a, b, c] = self.corner(k);
        cross(a, b, c)
    }

    fn corner(&self, k: usize) -> [DVec2; 3] {
        [self.previous[k], k, self.next[k]].map(|k| self.flat[k])
    }

    /// The first ear from `start` on among `left` corners whose turn satisfies `turns`.
    fn find_ear(&self, start: usize, left: usize, turns: fn(f64) -> bool) -> Option<usize> {
        std::iter::successors(Some(start), |&k| Some(self.next[k]))
            .take(left)
            .find(|&k| turns(self.turn(k)) && self.is_free(k))
    }

    /// Whether no other corner lies in the triangle at corner `k` or on its border. Corners at the
    /// same point as one of its own do not count: outlines touch themselves where a hole is joined.
    fn is_free(&self, k: usize) -> bool {
        let corners = self.corner(k);
        let [a, b, c] = corners;
        self.inward.iter().map(|&k| self.flat[k]).all(|p| {
            let is_outside = cross(a, b, p) < 0.0 || cross(b, c, p) < 0.0 || cross(c, a, p) < 0.0;
            is_outside || corners.contains(&p)
        })
    }

    fn remove(&mut self, k: usize) {
        let (before, after) = (self.previous[k], self.next[k]);
        self.next[before] = after;
        self.previous[after] = before;
        let turned_left = [before, after].map(|k| self.turn(k) > 0.0);
        self.inward.retain(|&other| {
            let is_now_left =
                (other == before && turned_left[0]) || (other == after && turned_left[1]);
            other != k && !is_now_left
        });
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    fn area(triangles: &[[u32; 3]], outline: &[DVec3]) -> f64 {
        let double = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a);
        let triangles = triangles.iter().map(|t| t.map(|k| outline[k as usize]));
        triangles
            .map(|triangle| double(triangle).length() / 2.0)
            .sum()
    }

    fn vector_area(outline: &[DVec3]) -> DVec3 {
        let edges = outline.iter().zip(outline.iter().cycle().skip(1));
        edges.map(|(a, b)| a.cross(*b)).sum::<DVec3>() / 2.0
    }

    /// Asserts that a plane polygon's triangles cover it once, and that all have its front.
    #[track_caller]
    fn assert_covered(outline: &[DVec3]) {
        let normal = vector_area(outline);
        let count = outline.len() as u32;
        let triangles = match polygon(outline) {
            Outcome::Fan => (1..count - 1).map(|k| [0, k, k + 1]).collect(),
            Outcome::Triangles(triangles) => triangles,
            Outcome::NoTriangulation => panic!("no triangulation"),
        };
        assert_eq!(triangles.len(), outline.len() - 2);
        let error = (area(&triangles, outline) - normal.length()).abs();
        assert!(error <= 1e-12 * normal.length(), "{error}");
        for triangle in triangles {
            let corners = triangle.map(|k| outline[k as usize]);
            assert!(vector_area(&corners).dot(normal) >= 0.0);
        }
    }

    /// Every start, both directions, and every axis up.
    #[track_caller]
    fn assert_covered_every_way(flat: &[(f64, f64)]) {
        for start in 0..flat.len() {
            let mut turned = flat.to_vec();
            turned.rotate_left(start);
            for _ in 0..2 {
                turned.reverse();
                for place in [
                    |x, y| DVec3::new(x, y, 0.3),
                    |x, y| DVec3::new(y, -7.0, x),
                    |x, y| DVec3::new(1e3, x, y),
                    |x, y| DVec3::new(x, y, 0.2 * x - 0.7 * y),
                ] {
                    let outline: Vec<DVec3> = turned.iter().map(|&(x, y)| place(x, y)).collect();
                    assert_covered(&outline);
                }
            }
        }
    }

    #[test]
    fn an_arrow_and_letters_are_covered_once() {
        let arrow = [(0.0, 0.0), (2.0, 1.0), (0.0, 2.0), (0.5, 1.0)];
        let l = [
            (0.0, 0.0),
            (3.0, 0.0),
            (3.0, 1.0),
            (1.0, 1.0),
            (1.0, 3.0),
            (0.0, 3.0),
        ];
        let c = [
            (0.0, 0.0),
            (4.0, 0.0),
            (4.0, 1.0),
            (1.0, 1.0),
            (1.0, 3.0),
            (4.0, 3.0),
            (4.0, 4.0),
            (0.0, 4.0),
        ];
        assert_covered_every_way(&arrow);
        assert_covered_every_way(&l);
        assert_covered_every_way(&c);
    }

    #[test]
    fn corners_on_straight_lines_and_twice_the_same_are_kept() {
        let comb = [
            (0.0, 0.0),
            (1.0, 0.0),
            (2.0, 0.0),
            (3.0, 0.0),
            (3.0, 2.0),
            (2.0, 1.0),
            (2.0, 1.0),
            (1.0, 2.0),
            (0.5, 1.5),
            (0.0, 1.0),
        ];
        assert_covered_every_way(&comb);
    }

    #[test]
    fn a_hole_joined_by_a_doubled_edge_stays_open() {
        let square_with_hole = [
            (0.0, 0.0),
            (4.0, 0.0),
            (4.0, 4.0),
            (0.0, 4.0),
            (0.0, 0.0),
            (1.0, 1.0),
            (1.0, 3.0),
            (3.0, 3.0),
            (3.0, 1.0),
            (1.0, 1.0),
        ];
        assert_covered_every_way(&square_with_hole);
    }

    #[test]
    fn random_stars_and_a_spiral_are_covered_once() {
        let mut state = 1_u64;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        for count in [5, 17, 100] {
            let star: Vec<DVec3> = (0..count)
                .map(|k| {
                    let (y, x) = (TAU * f64::from(k) / f64::from(count)).sin_cos();
                    let radius = 0.1 + random();
                    DVec3::new(radius * x, 2.0, radius * y)
                })
                .collect();
            assert_covered(&star);
        }
        let arm = |k: i32, radius: f64| {
            let (y, x) = (0.3 * f64::from(k)).sin_cos();
            (radius + 0.05 * f64::from(k)) * DVec3::new(x, y, 0.0)
        };
        let outer = (0..100).map(|k| arm(k, 1.0));
        let spiral: Vec<DVec3> = outer.chain((0..100).rev().map(|k| arm(k, 0.7))).collect();
        assert_covered(&spiral);
    }

    #[test]
    fn convex_polygons_are_fans() {
        let circle: Vec<DVec3> = (0..50)
            .map(|k| DVec3::new((0.1 * f64::from(k)).cos(), 0.0, (0.1 * f64::from(k)).sin()))
            .collect();
        assert_eq!(polygon(&circle), Outcome::Fan);
        let bent = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.3), DVec3::Y];
        assert_eq!(polygon(&bent), Outcome::Fan);
    }

    #[test]
    fn what_crosses_itself_or_has_no_area_has_no_triangulation() {
        let star: Vec<DVec3> = (0..5)
            .map(|k| {
                DVec3::new(
                    (2.0 * TAU / 5.0 * f64::from(k)).cos(),
                    (2.0 * TAU / 5.0 * f64::from(k)).sin(),
                    0.0,
                )
            })
            .collect();
        assert_eq!(polygon(&star), Outcome::NoTriangulation);
        let nan = [DVec3::NAN, DVec3::X, DVec3::Y, DVec3::Z];
        assert_eq!(polygon(&nan), Outcome::Fan, "its faces are removed later");
    }
}
