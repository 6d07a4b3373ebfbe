//! Rectangles, sampled uniformly in the solid angle under which they are seen.
//!
//! The plan is that of Ureña, Fajardo and King ("An Area-Preserving Parametrization for Spherical
//! Rectangles", Computer Graphics Forum 32(4), 2013): one number chooses the strip between the first
//! edge and a line parallel to it by its solid angle, the other a point on that line by its share of
//! the arc. The formulas are others. Theirs take the solid angle from a sum of four angles less 2π,
//! and in f32 lose it below 10⁻³ sr; these have no difference of rounded numbers that are nearly equal
//! in them, so that small, far and grazing rectangles need no other method below some threshold.
//!
//! Coordinates are along the edges, with the foot of the perpendicular from the reference point as
//! the origin; z > 0 is the distance of the plane. The strip from the line through the foot to the
//! line x has the solid angle
//!
//! G(x) = atan2(x·z·Y(x), z² + x²·h₀·h₁), hᵢ = yᵢ/√(x² + yᵢ² + z²), Y = h₁ − h₀.
//!
//! The axes are called x and y so that the foot is farther outside of the rectangle along y. If it is
//! within the rectangle along x, the solid angle is G(x₁) − G(x₀), a sum of two positive numbers. If
//! it is outside along both, the rectangle lies in one quadrant, all angles between its corners are
//! below 90°, and the formula of Van Oosterom and Strackee ("The Solid Angle of a Plane Triangle", IEEE
//! TBME 30(2), 1983), for both triangles, has no cancellation.
//!
//! The line that ends a strip of solid angle δ beginning at the line x_r is x = s·t/√(1 − t²), where
//! s = √(y₀² + z²), t = d/n, with P = (z² + x_r²·h₀·h₁)/(z·Y) and r = √(x_r² + s²),
//!
//! d = x_r·cos δ + P·sin δ,  n = r + (y₀/z)·(x_r·sin δ + P·(1 − cos δ)).
//!
//! It follows from G(x) = G(x_r) + δ: with c = x/√(x² + z²), the two edges' angles with the line have the
//! cosines −c·y₀/√(y₀² + z²) and c·y₁/√(y₁² + z²), and the rest is addition theorems.

use crate::math::elementary::sin_cos_turns;
use crate::math::{Compare, F32s, Mask};

/// A side's extent along its axis, and the length of that side.
#[derive(Debug, Clone, Copy)]
pub(super) struct Side {
    /// Coordinate of the first corner from the foot of the perpendicular.
    pub(super) from: F32s,
    /// Length, > 0. Kept apart: small sides far away are lost in the coordinates.
    pub(super) length: F32s,
}

impl Side {
    #[inline(always)]
    fn to(self) -> F32s {
        self.from + self.length
    }

    /// How far outside of the side's extent the foot is; ≤ 0 within.
    #[inline(always)]
    fn outside(self) -> F32s {
        self.from.fast_max(-self.to())
    }

    #[inline(always)]
    fn select(mask: Mask, yes: Self, no: Self) -> Self {
        Self {
            from: mask.select(yes.from, no.from),
            length: mask.select(yes.length, no.length),
        }
    }
}

/// A rectangle as it is seen from a point at distance `z` from its plane.
#[derive(Debug, Clone, Copy)]
pub(super) struct SphericalRectangle {
    /// Along the axis on which the foot is less far outside.
    x: Side,
    y: Side,
    z: F32s,
    /// Where x is the second axis of the caller.
    swapped: Mask,
    /// Where the foot is within the extent along x.
    within: Mask,
    /// Solid angle on the near side of the foot: −G(x₀) where `within`, else 0.
    before: F32s,
    solid_angle: F32s,
}

/// hᵢ of both ends of y on a line of constant x, and their difference.
struct Line {
    low: F32s,
    high: F32s,
    span: F32s,
}

impl Line {
    /// On the line whose squared distance from the reference point is `near2`.
    #[inline(always)]
    fn new(near2: F32s, y: Side) -> Self {
        let (y0, y1) = (y.from, y.to());
        let r0 = y0.mul_add(y0, near2).sqrt();
        let r1 = y1.mul_add(y1, near2).sqrt();
        let (low, high) = (y0 / r0, y1 / r1);
        // Of one sign they may be nearly equal; multiplied out, h₁² − h₀² has no difference in it.
        let beside = (y0 * y1).gt(F32s::splat(0.0));
        let span = (y.length / r0) * ((y0 + y1) / y1.mul_add(r0, y0 * r1)) * (near2 / r1);
        Self {
            low,
            high,
            span: beside.select(span, high - low),
        }
    }
}

impl SphericalRectangle {
    /// The rectangle with these sides, in the plane at distance `z` > 0. With z = 0 or NaN its solid
    /// angle is 0 or NaN, and nothing may be sampled.
    #[inline(always)]
    pub(super) fn new(first: Side, second: Side, z: F32s) -> Self {
        let zero = F32s::splat(0.0);
        let swapped = first.outside().gt(second.outside());
        let x = Side::select(swapped, second, first);
        let y = Side::select(swapped, first, second);
        let within = x.outside().lt(zero);
        let mut view = Self {
            x,
            y,
            z,
            swapped,
            within,
            before: zero,
            solid_angle: zero,
        };
        if within.any() {
            let before = view.beyond_foot(-x.from);
            view.before = within.select(before, zero);
            view.solid_angle = before + view.beyond_foot(x.to());
        }
        if within != Mask::ALL {
            view.solid_angle = within.select(view.solid_angle, view.solid_angle_beside());
        }
        view
    }

    /// In sr, relative error below 10⁻⁶.
    #[inline(always)]
    pub(super) fn solid_angle(&self) -> F32s {
        self.solid_angle
    }

    /// G(x): the solid angle between the line through the foot and the line `x` > 0.
    #[inline(always)]
    fn beyond_foot(&self, x: F32s) -> F32s {
        let z2 = self.z * self.z;
        let line = Line::new(x.mul_add(x, z2), self.y);
        let sine = x * self.z * line.span;
        sine.atan2((x * x).mul_add(line.low * line.high, z2))
    }

    /// The solid angle of both triangles, where the foot is outside along both axes.
    #[inline(always)]
    fn solid_angle_beside(&self) -> F32s {
        let one = F32s::splat(1.0);
        let (x0, y0, x1, y1) = (self.x.from, self.y.from, self.x.to(), self.y.to());
        let corner = |x: F32s, y: F32s| {
            let length = x.mul_add(x, y.mul_add(y, self.z * self.z)).sqrt();
            ([x, y, self.z].map(|c| c / length), length)
        };
        let [a, b, c, d] = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)].map(|(x, y)| corner(x, y));
        let cos = |p: [F32s; 3], q: [F32s; 3]| p[0].mul_add(q[0], p[1].mul_add(q[1], p[2] * q[2]));
        let diagonal = one + cos(a.0, c.0);
        // The triple product of two edges and a corner is z·w·h.
        let shared = (self.z / a.1) * (self.y.length / c.1);
        let half = |third: ([F32s; 3], F32s)| {
            let triple = shared * (self.x.length / third.1);
            triple.atan2(diagonal + cos(a.0, third.0) + cos(third.0, c.0))
        };
        F32s::splat(2.0) * (half(b) + half(d))
    }

    /// Where on the rectangle, as shares in [0, 1] of the caller's first and second side, the uniform
    /// numbers `u` and `v` fall.
    #[inline(always)]
    pub(super) fn sample(&self, u: F32s, v: F32s) -> (F32s, F32s) {
        let (zero, one) = (F32s::splat(0.0), F32s::splat(1.0));
        let (x, y, z) = (self.x, self.y, self.z);
        let z2 = z * z;

        // The strip's other line. δ is counted from the foot, or from the first edge.
        let start = self.within.select(zero, x.from);
        let half = (u * self.solid_angle - self.before) * F32s::splat(0.5);
        let (sin_half, cos_half) =
            sin_cos_turns(half * F32s::splat(0.5 * std::f32::consts::FRAC_1_PI));
        let sin = F32s::splat(2.0) * sin_half * cos_half;
        let one_minus_cos = F32s::splat(2.0) * sin_half * sin_half;
        let start2 = start.mul_add(start, z2);
        let line = Line::new(start2, y);
        let p = (start * start).mul_add(line.low * line.high, z2) / (z * line.span);
        let d = start.mul_add(one - one_minus_cos, p * sin);
        let edge2 = y.from.mul_add(y.from, start2);
        let n = (y.from / z).mul_add(start.mul_add(sin, p * one_minus_cos), edge2.sqrt());
        let t = d / n;
        let s = y.from.mul_add(y.from, z2).sqrt();
        let root = ((one - t) * (one + t)).fast_max(zero).sqrt();
        // At the ends rounding may leave the rectangle, or give 0/0.
        let at_x = (s * t / root).fast_max(x.from).fast_min(x.to());

        // On that line 1 − h and 1 + h are interpolated each: they keep their precision towards ±1.
        let near2 = at_x.mul_add(at_x, z2);
        let complements = |y: F32s| {
            let r = y.mul_add(y, near2).sqrt();
            let far = r + y.abs();
            let (small, large) = (near2 / (r * far), far / r);
            let above = y.gt(zero);
            (above.select(small, large), above.select(large, small))
        };
        let (minus0, plus0) = complements(y.from);
        let (minus1, plus1) = complements(y.to());
        let minus = v.mul_add(minus1 - minus0, minus0);
        let plus = v.mul_add(plus1 - plus0, plus0);
        let slope = (plus - minus) * F32s::splat(0.5) / (minus * plus).sqrt();
        let at_y = (near2.sqrt() * slope).fast_max(y.from).fast_min(y.to());

        let share = |at: F32s, side: Side| {
            ((at - side.from) / side.length)
                .fast_max(zero)
                .fast_min(one)
        };
        let (a, b) = (share(at_x, x), share(at_y, y));
        (self.swapped.select(b, a), self.swapped.select(a, b))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::LANES;
    use crate::math::testing::Uniform;

    /// x₀, y₀, z, width and height.
    type Rectangle = [f32; 5];

    /// f64: by the arcs of the corners, or where that has too few digits, by both triangles.
    fn exact([x0, y0, z, w, h]: [f64; 5]) -> f64 {
        let (x1, y1) = (x0 + w, y0 + h);
        let corner = |x: f64, y: f64| (x * y / (z * (x * x + y * y + z * z).sqrt())).atan();
        let sum = corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0);
        if sum > 1e-5 {
            return sum;
        }
        let [a, b, c, d] = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)].map(|(x, y)| [x, y, z]);
        let dot = |p: [f64; 3], q: [f64; 3]| (0..3).map(|k| p[k] * q[k]).sum::<f64>();
        let half = |b: [f64; 3]| {
            let [la, lb, lc] = [a, b, c].map(|p| dot(p, p).sqrt());
            (z * w * h).atan2(la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb)
        };
        2.0 * (half(b) + half(d))
    }

    fn view([x0, y0, z, w, h]: Rectangle) -> SphericalRectangle {
        let side = |from: f32, length: f32| Side {
            from: F32s::splat(from),
            length: F32s::splat(length),
        };
        SphericalRectangle::new(side(x0, w), side(y0, h), F32s::splat(z))
    }

    /// Rectangles of about the size `size` whose plane is about `z` away, and whose foot is up to about
    /// `aside` beside their middle.
    fn rectangles(count: usize, size: f64, z: f64, aside: f64) -> impl Iterator<Item = Rectangle> {
        let mut random = Uniform::new(49);
        (0..count).map(move |_| {
            let mut within = |low: f64, high: f64| low + (high - low) * random.next();
            let (w, h) = (size * within(0.3, 2.0), size * within(0.3, 2.0));
            let x0 = aside * within(-2.0, 2.0) - w * within(0.0, 1.0);
            let y0 = aside * within(-2.0, 2.0) - h * within(0.0, 1.0);
            [x0, y0, z * within(0.1, 1.0), w, h].map(|x| x as f32)
        })
    }

    #[test]
    fn solid_angles_keep_their_precision_at_any_size_distance_and_angle() {
        for (size, z, aside) in [
            (1.0, 1.0, 1.0),
            (1.0, 1e-3, 0.0),
            (1.0, 1e-6, 0.3),
            (1.0, 1e-12, 0.3),
            (1e-3, 1.0, 1.0),
            (1e-6, 1.0, 1.0),
            (1.0, 1e-4, 3.0),
            (1.0, 1e-3, 100.0),
            (1e-6, 1e-6, 1e-6),
            (1e7, 1e7, 1e7),
        ] {
            for rectangle in rectangles(2000, size, z, aside) {
                let got = f64::from(view(rectangle).solid_angle().to_array()[0]);
                let exact = exact(rectangle.map(f64::from));
                assert!(
                    (got / exact - 1.0).abs() < 1e-6,
                    "{rectangle:?}: {got}, not {exact}"
                );
            }
        }
        // A tube, from above and from beside it.
        for y0 in [-0.5f32, 3.0] {
            for z in [1e-3, 0.5, 30.0] {
                let tube = [-400.0, y0, z, 1000.0, 1.0];
                let got = f64::from(view(tube).solid_angle().to_array()[0]);
                assert!(
                    (got / exact(tube.map(f64::from)) - 1.0).abs() < 1e-6,
                    "{tube:?}"
                );
            }
        }
    }

    #[test]
    fn strips_up_to_a_sample_hold_its_share_of_the_solid_angle() {
        let mut random = Uniform::new(50);
        for (size, z, aside, tolerance) in [
            (1.0, 1.0, 1.0, 1e-5),
            // The share of a side is rounded by 6·10⁻⁸, which is 6·10⁻⁵ of the least distance here.
            (1.0, 1e-2, 0.0, 1e-4),
            (1.0, 1e-2, 0.5, 1e-4),
            (1.0, 1e-2, 3.0, 1e-4),
            // Coordinates have 6·10⁻⁸ of 1 m, which is 6·10⁻⁵ of these.
            (1e-3, 1.0, 1.0, 5e-3),
        ] {
            for rectangle in rectangles(500, size, z, aside) {
                let (u, v) = (random.lanes(), random.lanes());
                let (a, b) = view(rectangle).sample(u, v);
                let [x0, y0, z, w, h] = rectangle.map(f64::from);
                // The two axes change their roles where the foot is farther outside along the first.
                let swapped = x0.max(-x0 - w) > y0.max(-y0 - h);
                for lane in 0..LANES {
                    let at = |n: F32s| f64::from(n.to_array()[lane]);
                    let strip = if swapped {
                        exact([x0, y0, z, w, at(b) * h])
                    } else {
                        exact([x0, y0, z, at(a) * w, h])
                    };
                    let share = strip / exact([x0, y0, z, w, h]);
                    assert!(
                        (share - at(u)).abs() < tolerance,
                        "{rectangle:?}: {share}, {}",
                        at(u)
                    );
                    // Along the line, the share of y/√(d² + y²).
                    let (line, from, length, share) = if swapped {
                        (y0 + at(b) * h, x0, w, at(a))
                    } else {
                        (x0 + at(a) * w, y0, h, at(b))
                    };
                    let sine = |y: f64| y / (line * line + z * z + y * y).sqrt();
                    let arc = (sine(from + share * length) - sine(from))
                        / (sine(from + length) - sine(from));
                    assert!(
                        (arc - at(v)).abs() < tolerance,
                        "{rectangle:?}: {arc}, {}",
                        at(v)
                    );
                }
            }
        }
    }

    #[test]
    fn samples_stay_within_the_rectangle_from_its_plane_and_its_edges() {
        let ends = [0.0, 1.0 / 16_777_216.0, 0.5, 1.0 - 1.0 / 16_777_216.0];
        for z in [0.0, 1e-38, 1e-20, 1e-7, 1.0, 1e10] {
            for x0 in [-1.0, -0.5, 0.0, 1e-7, 2.0, 1e10] {
                for y0 in [-1.0, -0.5, 0.0, 2.0] {
                    let view = view([x0, y0, z, 1.0, 1.0]);
                    let solid_angle = view.solid_angle().to_array()[0];
                    assert!(solid_angle.is_nan() || (0.0..6.3).contains(&solid_angle));
                    for (u, v) in ends.into_iter().flat_map(|u| ends.map(|v| (u, v))) {
                        let (a, b) = view.sample(F32s::splat(u), F32s::splat(v));
                        let (a, b) = (a.to_array()[0], b.to_array()[0]);
                        assert!(
                            (0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b),
                            "{a} {b}"
                        );
                    }
                }
            }
        }
    }
}
