//! What the attributes of a mesh and the maps of its material make of a hit: shading normal, colour of
//! the texture, opacity.

use super::surface::Surface;
use crate::compile::{CompiledScene, Features};
use crate::geometry::{facing_normal, interpolated_normal};
use crate::math::lanes::{F32s, Mask, U32s};
use crate::math::{Compare, Vec3s};
use crate::texture::TextureTable;

/// Unit shading normals on the side of `face`, the unit geometric normal on the side of the unit
/// vector `wo` back along the ray, which is above them; and where they are not `face` itself.
#[inline(always)]
pub(super) fn shading_normal(
    scene: &CompiledScene,
    primitive: U32s,
    weights: [F32s; 3],
    face: Vec3s,
    wo: Vec3s,
) -> (Vec3s, Mask) {
    let normals = &scene.surfaces.shading_normals;
    let smooth = normals.present(primitive);
    if smooth.none() {
        return (face, smooth);
    }
    let corners = [0, 1, 2].map(|corner| {
        let [x, y, z] = normals.corner(corner, primitive);
        Vec3s::new(x, y, z)
    });
    let between = interpolated_normal(corners, weights, face);
    let normal = facing_normal(between, face, wo);
    (Vec3s::select(smooth, normal, face), smooth)
}

/// What textures make of the reflectance: a factor per channel in [0, 1], 1 without a texture.
#[inline(always)]
pub(super) fn reflectance_factor(
    scene: &CompiledScene,
    primitive: U32s,
    material: U32s,
    surface: &Surface,
) -> Vec3s {
    look_up(
        scene,
        primitive,
        scene.maps.reflectance.get(material),
        surface,
    )
}

/// Share of the light that meets the surface, in [0, 1].
#[inline(always)]
pub(super) fn opacity<const F: u32>(
    scene: &CompiledScene,
    primitive: U32s,
    material: U32s,
    surface: &Surface,
) -> F32s {
    let opacity = scene.maps.opacity.get(material);
    if !scene.on::<F>(Features::TEXTURES) {
        return opacity;
    }
    let texture = scene.maps.opacity_texture.get(material);
    let colour = look_up(scene, primitive, texture, surface);
    // Three thirds of white may miss 1 by a rounding, one third of three does not.
    opacity * ((colour.x + colour.y + colour.z) / F32s::splat(3.0))
}

/// The colour of `texture` at the hits; white where there is none, or where the primitive has no
/// texture coordinates.
#[inline(always)]
fn look_up(scene: &CompiledScene, primitive: U32s, texture: U32s, surface: &Surface) -> Vec3s {
    let uvs = &scene.surfaces.uvs;
    let shows = !texture.eq(U32s::splat(TextureTable::NONE)) & uvs.present(primitive);
    if shows.none() {
        return Vec3s::splat([1.0; 3]);
    }
    let [a, b, c] = [0, 1, 2].map(|corner| uvs.corner(corner, primitive));
    let [wa, wb, wc] = surface.weights;
    let between = |k: usize| wa.mul_add(a[k], wb.mul_add(b[k], wc * c[k]));
    scene
        .textures
        .look_up(texture, [between(0), between(1)], shows)
}
