//! Triangles seen from a point, sampled uniformly by solid angle, after Arvo, "Stratified Sampling of
//! Spherical Triangles", SIGGRAPH 1995.

use std::f64::consts::PI;

use glam::DVec3;

/// A triangle as it is seen from a point: three directions and the angles between the arcs that join them.
#[derive(Debug)]
pub(super) struct SphericalTriangle {
    /// Unit vectors to the corners.
    a: DVec3,
    b: DVec3,
    c: DVec3,
    /// Inner angle at a.
    alpha: f64,
    /// In sr, by Girard's theorem: its absolute error is some units of 2⁻⁵².
    pub(super) solid_angle: f64,
}

/// The part of `v` at right angles to the unit vector `axis`, of unit length.
fn across(v: DVec3, axis: DVec3) -> DVec3 {
    (v - axis * v.dot(axis)).normalize()
}

impl SphericalTriangle {
    /// The triangle with this first corner and the edges from it, seen from `from`.
    pub(super) fn new(corner: DVec3, [ab, ac]: [DVec3; 2], from: DVec3) -> Self {
        let to_corner = corner - from;
        let [a, b, c] = [to_corner, to_corner + ab, to_corner + ac].map(DVec3::normalize);
        let angle = |at: DVec3, p: DVec3, q: DVec3| {
            let (p, q) = (p.cross(at), q.cross(at));
            p.cross(q).length().atan2(p.dot(q))
        };
        let alpha = angle(a, b, c);
        Self {
            a,
            b,
            c,
            alpha,
            solid_angle: alpha + angle(b, c, a) + angle(c, a, b) - PI,
        }
    }

    /// The direction for a point of the unit square, a unit vector.
    pub(super) fn sample(&self, [u, v]: [f64; 2]) -> DVec3 {
        let Self { a, b, c, alpha, .. } = *self;
        // The corner that replaces c where the triangle has the share u of the solid angle.
        let (sin, cos) = (u * self.solid_angle - alpha).sin_cos();
        let (sin_alpha, cos_alpha) = alpha.sin_cos();
        let (x, y) = (cos - cos_alpha, sin + sin_alpha * a.dot(b));
        let numerator = (y * cos - x * sin) * cos_alpha - y;
        let q = (numerator / ((y * sin + x * cos) * sin_alpha)).clamp(-1.0, 1.0);
        let cut = a * q + across(c, a) * (1.0 - q * q).sqrt();
        let z = 1.0 - v * (1.0 - cut.dot(b));
        b * z + across(cut, b) * (1.0 - z * z).max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::random::Random;

    #[test]
    fn solid_angles_are_those_of_the_closed_form() {
        for (a, b, h) in [(1.0, 1.0, 1.0), (2.0, 0.3, 0.7), (1.0, 1.0, 1e-3)] {
            // From under a corner of a rectangle, the sum of its halves.
            let corner = DVec3::new(0.0, 0.0, h);
            let [x, y, xy] = [DVec3::X * a, DVec3::Y * b, DVec3::new(a, b, 0.0)];
            let half = |edges| SphericalTriangle::new(corner, edges, DVec3::ZERO).solid_angle;
            let r: f64 = (a * a + b * b + h * h).sqrt();
            let expected = (a * b).atan2(h * r);
            assert!((half([x, xy]) + half([xy, y]) - expected).abs() < 1e-13);
        }
        // An octant.
        let octant = SphericalTriangle::new(
            DVec3::X,
            [DVec3::Y - DVec3::X, DVec3::Z - DVec3::X],
            DVec3::ZERO,
        );
        assert!((octant.solid_angle - PI / 2.0).abs() < 1e-15);
    }

    #[test]
    fn shares_of_the_solid_angle_are_those_of_the_square() {
        let corner = DVec3::new(-0.4, 0.2, 0.7);
        let edges = [DVec3::new(2.0, 0.1, 0.3), DVec3::new(0.2, 0.5, -0.4)];
        let whole = SphericalTriangle::new(corner, edges, DVec3::ZERO);
        let [ab, ac] = edges;
        let mut random = Random::new(5, 0, 0, 0);
        for _ in 0..1000 {
            let u = random.next_2d();
            let direction = whole.sample(u);
            assert!((direction.length() - 1.0).abs() < 1e-12);
            // Where the plane of b and the direction meets the edge from a to c, as a share of that edge.
            let plane = direction.cross(corner + ab);
            let share = -plane.dot(corner) / plane.dot(ac);
            let part = SphericalTriangle::new(corner, [ab, ac * share], DVec3::ZERO);
            let got = part.solid_angle / whole.solid_angle;
            assert!((got - u[0]).abs() < 1e-11, "{got}, not {}", u[0]);
            let (b, cut) = (whole.b, (corner + ac * share).normalize());
            let got = (1.0 - direction.dot(b)) / (1.0 - cut.dot(b));
            assert!((got - u[1]).abs() < 1e-11, "{got}, not {}", u[1]);
        }
    }
}
