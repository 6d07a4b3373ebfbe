//! The pinhole camera as it is traced.

use glam::DVec3;

use crate::math::Vec3s;
use crate::math::lanes::F32s;
use crate::scene::Projection;

/// Eye and image plane in re-centred f32; the plane is relative to the eye.
#[derive(Debug, Clone, Copy)]
pub struct Camera {
    /// Where camera rays start.
    pub eye: [f32; 3],
    /// From the eye to the plane's top left corner.
    corner: [f32; 3],
    /// One pixel to the right.
    right: [f32; 3],
    /// One pixel down.
    down: [f32; 3],
}

impl Camera {
    /// The camera for a film of this size, in coordinates relative to `center`.
    pub fn new(projection: &Projection, width: u32, height: u32, center: DVec3) -> Self {
        let [eye, top_left, right, down] = projection.plane(width, height);
        Self {
            eye: (eye - center).as_vec3().to_array(),
            corner: (top_left - eye).as_vec3().to_array(),
            right: (right / f64::from(width)).as_vec3().to_array(),
            down: (down / f64::from(height)).as_vec3().to_array(),
        }
    }

    /// Unit directions through the film positions (x, y), in pixels from the top left corner.
    #[inline(always)]
    pub fn directions(&self, x: F32s, y: F32s) -> Vec3s {
        Vec3s::splat(self.corner)
            .add_scaled(Vec3s::splat(self.right), x)
            .add_scaled(Vec3s::splat(self.down), y)
            .normalize()
    }
}
