//! What a surface looks like at a point: normals between those of the corners, textures, opacity.

use glam::{DVec2, DVec3};

use super::bsdf::Bsdf;
use super::flatten::Surface;
use super::primitives::Hit;
use crate::scene::{TextureDescription, TextureId};

/// Least cosine to the face of a mirror image that was lifted above it.
const LIFTED_COSINE: f64 = 1e-4;

/// Squared length below which normals of the corners count as cancelled.
const CANCELLED: f64 = 1e-10;

/// What the corners of a triangle have.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Corners {
    /// Unit shading normals.
    pub(super) normals: Option<[DVec3; 3]>,
    /// Texture coordinates.
    pub(super) uvs: Option<[DVec2; 3]>,
}

/// How a surface scatters at one point of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Appearance {
    /// `None` absorbs everything.
    pub(super) bsdf: Option<Bsdf>,
    /// Share of the light that meets the surface, in [0, 1].
    pub(super) opacity: f64,
    /// Unit geometric normal, on the side from where the path came.
    pub(super) face: DVec3,
    /// Unit shading normal, on the same side.
    pub(super) normal: DVec3,
}

impl Appearance {
    /// A surface where a ray of this direction hits it.
    pub(super) fn new(
        surface: &Surface,
        textures: &[TextureDescription],
        hit: &Hit,
        direction: DVec3,
    ) -> Self {
        let [b, c] = hit.barycentrics;
        let weights = [1.0 - b - c, b, c];
        let face = -hit.normal * direction.dot(hit.normal).signum();
        let normal = surface.corners.normals.map_or(face, |normals| {
            above_horizon(interpolate(normals, weights, face), face, -direction)
        });
        let colour = |texture: Option<TextureId>| {
            let (TextureId(id), uvs) = texture.zip(surface.corners.uvs)?;
            let uv = uvs[0] * weights[0] + uvs[1] * weights[1] + uvs[2] * weights[2];
            Some(look_up(&textures[id as usize], uv))
        };
        Self {
            bsdf: surface
                .bsdf
                .map(|bsdf| match colour(surface.reflectance_texture) {
                    Some(colour) => bsdf.tinted(colour),
                    None => bsdf,
                }),
            opacity: match colour(surface.opacity_texture) {
                Some(colour) => surface.opacity * (colour.element_sum() / 3.0),
                None => surface.opacity,
            },
            face,
            normal,
        }
    }

    /// The shading normal on the side of the hit's geometric normal.
    pub(super) fn outward(&self, hit: &Hit) -> DVec3 {
        self.normal * self.face.dot(hit.normal).signum()
    }

    /// As [`same_side`], for this surface.
    pub(super) fn same_side(&self, direction: DVec3) -> bool {
        same_side(self.face, self.normal, direction)
    }
}

/// Whether a direction is on the same side of the face and of the shading normal.
pub(super) fn same_side(face: DVec3, normal: DVec3, direction: DVec3) -> bool {
    (direction.dot(face) > 0.0) == (direction.dot(normal) > 0.0)
}

/// Unit normal between those of the corners, each taken on the side of `face`.
fn interpolate(corners: [DVec3; 3], weights: [f64; 3], face: DVec3) -> DVec3 {
    let sum: DVec3 = corners
        .into_iter()
        .zip(weights)
        .map(|(normal, weight)| {
            let side = if normal.dot(face) < 0.0 { -1.0 } else { 1.0 };
            normal * (side * weight)
        })
        .sum();
    if sum.length_squared() > CANCELLED {
        sum.normalize()
    } else {
        face
    }
}

/// The shading normal turned so far towards `wo` that the mirror image of `wo` does not go below the
/// face (Keller et al. 2017, arXiv:1705.01263, A.3).
fn above_horizon(normal: DVec3, face: DVec3, wo: DVec3) -> DVec3 {
    let mirrored = normal * (2.0 * normal.dot(wo)) - wo;
    let height = mirrored.dot(face);
    let least = LIFTED_COSINE.min(0.5 * wo.dot(face));
    if height >= least {
        return normal;
    }
    let lifted = (mirrored + face * (least - height)).normalize();
    (lifted + wo).try_normalize().unwrap_or(face)
}

/// Linear RGB of a texture at these coordinates, v up: bilinear between the centres of texels, repeated.
fn look_up(texture: &TextureDescription, uv: DVec2) -> DVec3 {
    let [width, height] = [texture.width, texture.height].map(f64::from);
    let place = DVec2::new(uv.x * width, (1.0 - uv.y) * height) - 0.5;
    let corner = place.floor();
    let share = place - corner;
    let texel = |across: f64, down: f64| {
        let x = (corner.x + across).rem_euclid(width) as usize;
        let y = (corner.y + down).rem_euclid(height) as usize;
        let [r, g, b] = texture.texels[y * texture.width as usize + x];
        DVec3::new(linear(r), linear(g), linear(b))
    };
    let row = |down: f64| texel(0.0, down).lerp(texel(1.0, down), share.x);
    row(0.0).lerp(row(1.0), share.y)
}

/// Inverse of the sRGB curve.
fn linear(byte: u8) -> f64 {
    let x = f64::from(byte) / 255.0;
    if x > 0.04045 {
        ((x + 0.055) / 1.055).powf(2.4)
    } else {
        x / 12.92
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_texel_is_top_left_and_pictures_repeat() {
        let texture = TextureDescription {
            name: String::new(),
            width: 2,
            height: 2,
            texels: vec![[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]],
        };
        let at = |u: f64, v: f64| look_up(&texture, DVec2::new(u, v)).to_array();
        for shift in [-2.0, 0.0, 1.0] {
            assert_eq!(at(0.25 + shift, 0.75), [1.0, 0.0, 0.0]);
            assert_eq!(at(0.75, 0.75 + shift), [0.0, 1.0, 0.0]);
            assert_eq!(at(0.25, 0.25 - shift), [0.0, 0.0, 1.0]);
            // Halfway between the four.
            assert_eq!(at(0.5 + shift, 0.5), [0.5; 3]);
            assert_eq!(at(shift, shift), [0.5; 3]);
        }
        assert_eq!(linear(0), 0.0);
        assert_eq!(linear(255), 1.0);
        // Both pieces of the curve meet to its published digits.
        assert!(
            (linear(10) - 0.003_035_27).abs() < 1e-8 && (linear(11) - 0.003_346_5).abs() < 1e-7
        );
    }

    #[test]
    fn mirror_images_about_a_bent_normal_stay_above_the_face() {
        for tilt in [0.0f64, 30.0, 60.0, 85.0, 89.9] {
            for view in [-89.9f64, -60.0, -5.0, 0.0, 40.0, 89.0] {
                let at = |degrees: f64| {
                    let (sin, cos) = degrees.to_radians().sin_cos();
                    DVec3::new(sin, 0.0, cos)
                };
                let (normal, wo) = (at(tilt), at(view));
                let bent = above_horizon(normal, DVec3::Z, wo);
                let mirrored = bent * (2.0 * bent.dot(wo)) - wo;
                assert!(
                    mirrored.z > 0.0 && bent.dot(wo) > 0.0,
                    "{tilt}, {view}: {bent}"
                );
                let mirrored = normal * (2.0 * normal.dot(wo)) - wo;
                if mirrored.z > 1e-3 {
                    assert_eq!(bent, normal);
                }
            }
        }
    }
}
