//! What varies over the surface of a material, or thins it.

use crate::error::Result;
use crate::math::Table;
use crate::scene::{MaterialDescription, SceneDescription, TextureId};
use crate::texture::TextureTable;

/// Textures and opacity per material. A scene that needs neither has no column.
#[derive(Debug, Clone, Default)]
pub struct MaterialMaps {
    /// Texture of the reflectance, or [`TextureTable::NONE`].
    pub reflectance: Table<u32>,
    /// Share of the light that meets the surface, in [0, 1].
    pub opacity: Table<f32>,
    /// Texture of the opacity, or [`TextureTable::NONE`].
    pub opacity_texture: Table<u32>,
}

/// Whether a material has textures.
pub(super) fn is_textured(material: &MaterialDescription) -> bool {
    material.reflectance_texture.is_some() || material.opacity_texture.is_some()
}

/// Whether a material lets part of the light go straight on, somewhere.
pub(super) fn is_partial(material: &MaterialDescription) -> bool {
    material.opacity < 1.0 || material.opacity_texture.is_some()
}

/// The maps of all materials, and the textures of those for which `uses_textures`.
///
/// # Errors
/// If the textures have too many texels.
pub(super) fn maps(
    scene: &SceneDescription,
    uses_textures: impl Fn(usize) -> bool,
) -> Result<(MaterialMaps, TextureTable)> {
    let mut maps = MaterialMaps::default();
    let mut textures = TextureTable::default();
    // Pictures that nothing shows are not kept.
    let mut slots = vec![None; scene.textures.len()];
    for (i, material) in scene.materials.iter().enumerate() {
        let mut slot = |texture: Option<TextureId>| -> Result<u32> {
            let Some(TextureId(id)) = texture.filter(|_| uses_textures(i)) else {
                return Ok(TextureTable::NONE);
            };
            let id = id as usize;
            if let Some(slot) = slots[id] {
                return Ok(slot);
            }
            let picture = &scene.textures[id];
            let slot = textures.push(picture.width, picture.height, &picture.texels)?;
            slots[id] = Some(slot);
            Ok(slot)
        };
        maps.reflectance.push(slot(material.reflectance_texture)?);
        maps.opacity_texture.push(slot(material.opacity_texture)?);
        maps.opacity.push(material.opacity as f32);
    }
    Ok((maps, textures))
}
