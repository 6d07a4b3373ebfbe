//! Which triangles a ray meets, and where, in f64 on the same f32 inputs, with a bound of what the
//! roundings of an f32 test may do to the answer.
//!
//! The ray is sheared to the z axis as in S. Woop, C. Benthin and I. Wald, "Watertight Ray/Triangle
//! Intersection" (JCGT 2(1), 2013): with o the origin, d the direction, z its largest axis, and A = p − o a
//! corner p relative to the origin, the corner's image is (X, Y, T) = (A_x − (d_x/d_z)·A_z,
//! A_y − (d_y/d_z)·A_z, A_z/d_z). Edge functions are U = X₁·Y₂ − Y₁·X₂ and likewise V and W, D their sum,
//! and the distance is t = (U·T₀ + V·T₁ + W·T₂)/D.

use wavepath::geometry::Triangle;
use wavepath::math::float;

/// γ(n) of f32, see [`float::gamma`].
fn gamma(n: u32) -> f64 {
    f64::from(float::gamma(n))
}

/// A test in f32, by the roundings that it makes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Test {
    /// Woop's, as above.
    ///
    /// The image's X is A_x, once rounded, minus a product of d_x/d_z and A_z with two roundings
    /// of its own, then rounded: it is off by at most γ(2)·|A_x| + γ(4)·|(d_x/d_z)·A_z|. T has the roundings of A_z, of 1/d_z
    /// and of their product, γ(3).
    Sheared,
    /// Edge functions in an orthonormal frame about the ray, and the distance as a quotient of distances to
    /// the plane, n·(p − o)/n·d.
    ///
    /// A coordinate in that frame has up to eight roundings of |A_x| + |A_y| + |A_z|; lengths in the
    /// sheared frame are up to √3 times those across the ray, so that it is off by at most γ(14) of
    /// that sum here. The plane and the quotient have no more than sixteen roundings of the distance to
    /// the farthest corner, over the cosine of incidence.
    Planar,
}

/// A ray as given: the direction's length is not exactly 1, and distances are in units of it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ray {
    origin: [f64; 3],
    direction: [f64; 3],
    axes: [usize; 3],
}

/// A triangle that the ray meets, or would if roundings were against it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Meeting {
    /// Distance.
    pub(crate) t: f64,
    /// How far from it the distance by f32 may be.
    pub(crate) bound: f64,
    /// It is met: without roundings.
    pub(crate) exact: bool,
    /// It is met, whatever the roundings.
    pub(crate) certain: bool,
}

impl Ray {
    pub(crate) fn new(origin: [f32; 3], direction: [f32; 3]) -> Self {
        let [origin, direction] = [origin, direction].map(|v| v.map(f64::from));
        let size = direction.map(f64::abs);
        let z = (0..3).fold(0, |z, k| if size[k] > size[z] { k } else { z });
        Self {
            origin,
            direction,
            axes: [(z + 1) % 3, (z + 2) % 3, z],
        }
    }

    /// The triangles that the ray may meet, and few others: not those with images wholly on one side of
    /// it, by the larger margins of [`Test::Planar`].
    pub(crate) fn candidates(&self, triangles: &[Triangle]) -> Vec<u32> {
        let [kx, ky, kz] = self.axes;
        let is_beside = |triangle: &Triangle, across: usize| {
            let slope = self.direction[across] / self.direction[kz];
            let (mut above, mut below) = (true, true);
            for corner in triangle.corners {
                let arm = [0, 1, 2].map(|k| f64::from(corner[k]) - self.origin[k]);
                let image = arm[across] - slope * arm[kz];
                let margin = gamma(14) * (arm[0].abs() + arm[1].abs() + arm[2].abs());
                above &= image > margin;
                below &= image < -margin;
            }
            above || below
        };
        (0u32..)
            .zip(triangles)
            .filter(|(_, triangle)| !is_beside(triangle, kx) && !is_beside(triangle, ky))
            .map(|(id, _)| id)
            .collect()
    }

    /// Nothing where no roundings can make a hit of it.
    pub(crate) fn meet(&self, test: Test, triangle: &Triangle) -> Option<Meeting> {
        let [kx, ky, kz] = self.axes;
        let [sx, sy] = [kx, ky].map(|k| self.direction[k] / self.direction[kz]);
        let arms = triangle
            .corners
            .map(|corner| [0, 1, 2].map(|k| f64::from(corner[k]) - self.origin[k]));
        let x = arms.map(|a| a[kx] - sx * a[kz]);
        let y = arms.map(|a| a[ky] - sy * a[kz]);
        let off = |a: [f64; 3], k: usize, s: f64| match test {
            Test::Sheared => gamma(2) * a[k].abs() + gamma(4) * (s * a[kz]).abs(),
            Test::Planar => gamma(14) * a.iter().map(|component| component.abs()).sum::<f64>(),
        };
        let off_x = arms.map(|a| off(a, kx, sx));
        let off_y = arms.map(|a| off(a, ky, sy));
        let t = arms.map(|a| a[kz] / self.direction[kz]);
        // Each edge function's value, and how far off it may be: corners' images as far as they are off,
        // two products and a difference.
        let edges = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| {
            let product = |a: f64, off_a: f64, b: f64, off_b: f64| {
                let most = (a.abs() + off_a) * (b.abs() + off_b) * (1.0 + gamma(2));
                (a * b, most - (a * b).abs())
            };
            let (one, off_one) = product(x[i], off_x[i], y[j], off_y[j]);
            let (two, off_two) = product(y[i], off_y[i], x[j], off_x[j]);
            (one - two, off_one + off_two)
        });
        let may_be = |sign: f64| edges.iter().all(|&(value, off)| sign * value >= -off);
        if !may_be(1.0) && !may_be(-1.0) {
            return None;
        }
        let all = |sign: f64, reach: f64| edges.iter().all(|&(u, off)| sign * u >= reach * off);
        let inside = all(1.0, 0.0) || all(-1.0, 0.0);
        let determinant: f64 = edges.iter().map(|edge| edge.0).sum();
        let (t, bound) = match test {
            Test::Sheared => sheared_distance(t, edges, determinant),
            Test::Planar => self.planar_distance(arms)?,
        };
        if t + bound <= 0.0 {
            return None;
        }
        let sure = all(1.0, 1.0) || all(-1.0, 1.0);
        Some(Meeting {
            t,
            bound,
            exact: inside && determinant != 0.0 && t > 0.0,
            certain: sure && t - bound > 0.0,
        })
    }

    /// Distance to the triangle's plane, if the ray is not within it.
    fn planar_distance(&self, arms: [[f64; 3]; 3]) -> Option<(f64, f64)> {
        let [a, b, c] = arms.map(glam::DVec3::from_array);
        let direction = glam::DVec3::from_array(self.direction);
        let normal = (b - a).cross(c - a).normalize();
        let cosine = normal.dot(direction);
        let reach = a.length().max(b.length()).max(c.length());
        (cosine != 0.0).then(|| (a.dot(normal) / cosine, gamma(16) * reach / cosine.abs()))
    }
}

/// The distance t from images' distances and edge functions, and how far off it may be.
///
/// With δ the errors of the edge functions, the calculated quotient is that of U + δ_U and so on, and
/// differs from t by Σδᵢ·(Tᵢ − t)/(D + Σδᵢ). Beyond that there are the three roundings of each Tᵢ, three
/// of 1/D (whose terms have one sign), two of the products with it, and two of the sum: γ(10)·max|Tᵢ|.
/// Whatever the edge functions are, as long as their signs are equal the distance is between the
/// corners'; that is the better bound where a triangle is seen from its edge.
fn sheared_distance(t: [f64; 3], edges: [(f64, f64); 3], determinant: f64) -> (f64, f64) {
    let rounding = gamma(10) * t.iter().fold(0.0, |most, t| t.abs().max(most));
    let low = t.iter().copied().fold(f64::INFINITY, f64::min);
    let high = t.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let off: f64 = edges.iter().map(|edge| edge.1).sum();
    let least = determinant.abs() - off;
    if least > 0.0 {
        let distance = (0..3).map(|i| edges[i].0 * t[i]).sum::<f64>() / determinant;
        let moved: f64 = (0..3)
            .map(|i| edges[i].1 * (t[i] - distance).abs())
            .sum::<f64>()
            / least;
        if moved < 0.5 * (high - low) {
            return (distance, moved + rounding);
        }
    }
    (0.5 * (low + high), 0.5 * (high - low) + rounding)
}
