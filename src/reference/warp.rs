//! Unit squares to directions and points.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

/// A right-handed orthonormal frame whose third axis is the given unit vector.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    x: DVec3,
    y: DVec3,
    z: DVec3,
}

impl Frame {
    /// The frame about the unit vector `z`.
    pub(super) fn about(z: DVec3) -> Self {
        // Any axis far from z will do; the one with z's smallest component is at least 54° away.
        let axis = z.abs();
        let far = if axis.x <= axis.y && axis.x <= axis.z {
            DVec3::X
        } else if axis.y <= axis.z {
            DVec3::Y
        } else {
            DVec3::Z
        };
        let x = far.cross(z).normalize();
        Self {
            x,
            y: z.cross(x),
            z,
        }
    }

    /// The unit vector at polar angle θ from the third axis, given by its cosine and sine, and
    /// azimuth `phi` in radians.
    pub(super) fn direction(&self, cos_theta: f64, sin_theta: f64, phi: f64) -> DVec3 {
        let (sin_phi, cos_phi) = phi.sin_cos();
        self.x * (sin_theta * cos_phi) + self.y * (sin_theta * sin_phi) + self.z * cos_theta
    }
}

/// A direction of the hemisphere about `normal` with pdf cos θ/π per solid angle.
pub(super) fn cosine_hemisphere(normal: DVec3, u: [f64; 2]) -> DVec3 {
    Frame::about(normal).direction((1.0 - u[0]).sqrt(), u[0].sqrt(), TAU * u[1])
}

/// Density per solid angle of [`cosine_hemisphere`] at this cosine; zero below the horizon.
pub(super) fn cosine_hemisphere_pdf(cos_theta: f64) -> f64 {
    cos_theta.max(0.0) / PI
}

/// A point of the unit sphere, uniform by area.
pub(super) fn uniform_sphere(u: [f64; 2]) -> DVec3 {
    let z = 1.0 - 2.0 * u[0];
    let (sin_phi, cos_phi) = (TAU * u[1]).sin_cos();
    let radius = (1.0 - z * z).max(0.0).sqrt();
    DVec3::new(radius * cos_phi, radius * sin_phi, z)
}

/// Barycentric coordinates of the second and third corner of a point uniform by area in a triangle.
pub(super) fn uniform_triangle(u: [f64; 2]) -> [f64; 2] {
    let root = u[0].sqrt();
    [root * (1.0 - u[1]), root * u[1]]
}
