//! Rectangles seen from a point, sampled uniformly by solid angle, after Ureña, Fajardo and King, "An
//! Area-Preserving Parametrization for Spherical Rectangles", Computer Graphics Forum 32(4), 2013.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

/// Largest cosine between the edges of a quad that counts as a rectangle.
const MOST_SKEW: f64 = 1e-5;

/// Whether a quad with these edges at its first corner, known to be a parallelogram, is a rectangle.
pub(super) fn is_rectangle([x, y]: [DVec3; 2]) -> bool {
    x.dot(y).abs() <= MOST_SKEW * x.length() * y.length()
}

/// A rectangle in coordinates along its edges about the point that it is seen from.
#[derive(Debug)]
pub(super) struct SphericalRectangle {
    /// First and opposite corner.
    low: DVec2,
    high: DVec2,
    /// Height of the plane, ≤ 0.
    z: f64,
    /// z-components of the normals of the planes through the point and the lower and the upper edge.
    b0: f64,
    b1: f64,
    /// 2π less the last two inner angles.
    k: f64,
    /// In sr, by Girard's theorem: its absolute error is some units of 2⁻⁵².
    pub(super) solid_angle: f64,
}

impl SphericalRectangle {
    /// The rectangle with this first corner and the edges from it, seen from `from`.
    pub(super) fn new(corner: DVec3, [ex, ey]: [DVec3; 2], from: DVec3) -> Self {
        let (x, y) = (ex.normalize(), ey.normalize());
        let to_corner = corner - from;
        let z = -to_corner.dot(x.cross(y)).abs();
        let low = DVec2::new(to_corner.dot(x), to_corner.dot(y));
        let high = low + DVec2::new(ex.length(), ey.length());
        // The planes' normals point inward; each has one component along an edge and this one.
        let normal_z = |coordinate: f64| coordinate / coordinate.hypot(z);
        let (n0, n1) = (-normal_z(low.y), normal_z(high.x));
        let (n2, n3) = (normal_z(high.y), -normal_z(low.x));
        let angle = |a: f64, b: f64| (-a * b).clamp(-1.0, 1.0).acos();
        let k = 2.0 * PI - angle(n2, n3) - angle(n3, n0);
        Self {
            low,
            high,
            z,
            b0: n0,
            b1: n2,
            k,
            solid_angle: angle(n0, n1) + angle(n1, n2) - k,
        }
    }

    /// The point for a point of the unit square, as shares of both edges.
    pub(super) fn sample(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let Self {
            low, high, z, b0, ..
        } = *self;
        let angle = u * self.solid_angle + self.k;
        let f = (angle.cos() * b0 - self.b1) / angle.sin();
        let c = (f.signum() / f.hypot(b0)).clamp(-1.0, 1.0);
        let x = (-c * z / (1.0 - c * c).sqrt()).max(low.x).min(high.x);
        let d = x.hypot(z);
        let sine = |y: f64| y / d.hypot(y);
        let h = sine(low.y) + v * (sine(high.y) - sine(low.y));
        let y = (h * d / (1.0 - h * h).sqrt()).max(low.y).min(high.y);
        ((DVec2::new(x, y) - low) / (high - low)).to_array()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::random::Random;

    #[test]
    fn solid_angles_are_those_of_the_closed_form() {
        for (a, b, h) in [(1.0, 1.0, 1.0), (2.0, 0.3, 0.7), (1.0, 1.0, 1e-3)] {
            let corner = DVec3::new(0.0, 0.0, h);
            let view = SphericalRectangle::new(corner, [DVec3::X * a, DVec3::Y * b], DVec3::ZERO);
            let r: f64 = (a * a + b * b + h * h).sqrt();
            let expected = (a * b).atan2(h * r);
            assert!((view.solid_angle - expected).abs() < 1e-13);
        }
    }

    #[test]
    fn shares_of_the_solid_angle_are_those_of_the_square() {
        let corner = DVec3::new(-0.4, 0.2, 0.7);
        let edges = [DVec3::X * 2.0, DVec3::Y * 0.5];
        let whole = SphericalRectangle::new(corner, edges, DVec3::ZERO);
        let mut random = Random::new(5, 0, 0, 0);
        for _ in 0..1000 {
            let u = random.next_2d();
            let [a, b] = whole.sample(u);
            // The strip up to the point's line holds u, and of a thin strip there v is below the point.
            let solid = |from: f64, to: f64, share: f64| {
                let corner = corner + edges[0] * from;
                let edges = [edges[0] * (to - from), edges[1] * share];
                SphericalRectangle::new(corner, edges, DVec3::ZERO).solid_angle
            };
            let strip = solid(0.0, a, 1.0) / whole.solid_angle;
            assert!((strip - u[0]).abs() < 1e-12, "{strip}, not {}", u[0]);
            let (from, to) = (a - 1e-5, a + 1e-5);
            let below = solid(from, to, b) / solid(from, to, 1.0);
            assert!((below - u[1]).abs() < 1e-8, "{below}, not {}", u[1]);
        }
    }
}
