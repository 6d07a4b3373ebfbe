//! What a material of an MTL file becomes.
//!
//! MTL has no physical model, and programs write it differently; this table decides. The first row
//! that fits counts.
//!
//! | in the file | here |
//! | --- | --- |
//! | `illum` 4, 6, 7 or 9, `Ni` > 1, and transparent: `d` < 1, `Tf` > 0, or `Kd` = 0 | dielectric with `Ni`, exact Fresnel equations |
//! | `illum` 3 or 5, `Kd` = 0, and `Ns` absent or ≥ 10⁴ | mirror with `Ks` |
//! | `illum` 0 or 1, or `Ks` = 0 | Lambertian with `Kd` |
//! | everything else | glossy: `Kd`, `Ks` and the Phong exponent `Ns` |
//!
//! - `illum` is 2 where absent. `Kd` is 1 where only `map_Kd` is given, 0 where `Ks`, `Ke` or `Tf` is
//!   given without it, and else 0.5. `Ns` is 10 where a glossy material lacks it.
//! - `map_Kd` multiplies `Kd`. Unless the row is dielectric, `d` (else 1 − `Tr`) is the opacity, times
//!   `map_d`: that picture's alpha if it has one, else the mean of its channels, both linear. Without
//!   `map_d` it is the alpha of `map_Kd`, as exporters of foliage mean it.
//! - `Ke` is emitted on both sides: as radiance in W·sr⁻¹·m⁻².
//! - Values that are not finite or out of range are moved into it; where `Kd` + `Ks` exceeds 1 in a
//!   channel, both are scaled down together. Each is told once with the materials' names.
//! - `Ka`, textures of other values, bump maps and options of map lines are not used.

use glam::DVec3;

use super::mtl::MtlMaterial;
use super::texture::{Pictures, Use};
use crate::scene::description::{
    BsdfDescription, EmissionDescription, Fresnel, MaterialDescription,
};

/// Albedo of a material that the file does not describe.
const GREY: f64 = 0.5;

/// Phong exponent from which a lobe without a diffuse part counts as a mirror: it is 1.6 degrees wide.
const MIRROR_EXPONENT: f64 = 1e4;

/// Phong exponent of a highlight without one.
const DEFAULT_EXPONENT: f64 = 10.0;

/// Largest Phong exponent, as in scene files.
const MAX_EXPONENT: f64 = 1e6;

/// Indices of refraction, as in scene files.
const IOR_RANGE: [f64; 2] = [1e-3, 1e3];

/// Largest radiance, as in scene files.
const MAX_RADIANCE: f64 = 1e30;

/// Names of the materials whose values had to be changed.
#[derive(Debug, Default)]
pub(super) struct Changes {
    /// Values out of range or not finite.
    pub(super) clamped: Vec<String>,
    /// Diffuse and specular reflectance above 1 together.
    pub(super) scaled: Vec<String>,
}

/// A grey Lambertian, for faces without a material.
pub(super) fn grey(name: String) -> MaterialDescription {
    let reflectance = DVec3::splat(GREY);
    MaterialDescription::new(name, BsdfDescription::Lambertian { reflectance })
}

/// The material that `mtl` describes.
pub(super) fn describe(
    name: String,
    mtl: &MtlMaterial,
    pictures: &mut Pictures<'_>,
    changes: &mut Changes,
) -> MaterialDescription {
    let mut clamp = Clamp::default();
    let bsdf = scattering(mtl, &mut clamp);
    let opacity = clamp.number(mtl.opacity.unwrap_or(1.0), 0.0, 1.0);
    let radiance = clamp.colour(mtl.emission.unwrap_or_default(), MAX_RADIANCE);
    let (bsdf, is_scaled) = conserve_energy(bsdf);
    if clamp.was_needed {
        changes.clamped.push(name.clone());
    }
    if is_scaled {
        changes.scaled.push(name.clone());
    }

    let diffuse_file = mtl
        .diffuse_map
        .as_ref()
        .and_then(|map| pictures.locate(map));
    let is_glass = matches!(bsdf, BsdfDescription::Dielectric { .. });
    let opacity_texture = match (&mtl.opacity_map, &diffuse_file) {
        _ if is_glass => None,
        (Some(map), _) => {
            let file = pictures.locate(map);
            file.and_then(|file| pictures.texture(&file, Use::Opacity))
        }
        (None, Some(file)) => pictures.texture(file, Use::Alpha),
        (None, None) => None,
    };
    MaterialDescription {
        reflectance_texture: diffuse_file.and_then(|file| pictures.texture(&file, Use::Colour)),
        opacity: if is_glass { 1.0 } else { opacity },
        opacity_texture,
        emission: (radiance != DVec3::ZERO).then_some(EmissionDescription {
            radiance,
            two_sided: true,
        }),
        ..MaterialDescription::new(name, bsdf)
    }
}

fn scattering(mtl: &MtlMaterial, clamp: &mut Clamp) -> BsdfDescription {
    let diffuse = mtl.diffuse.unwrap_or_else(|| {
        let others = [mtl.specular, mtl.emission, mtl.filter];
        DVec3::splat(if mtl.diffuse_map.is_some() {
            1.0
        } else if others.iter().any(Option::is_some) {
            0.0
        } else {
            GREY
        })
    });
    let diffuse = clamp.colour(diffuse, 1.0);
    let specular = clamp.colour(mtl.specular.unwrap_or_default(), 1.0);
    let exponent = mtl.exponent.map(|ns| clamp.number(ns, 0.0, MAX_EXPONENT));
    let ior = clamp.number(mtl.ior.unwrap_or(1.0), IOR_RANGE[0], IOR_RANGE[1]);
    let illum = mtl.illum.unwrap_or(2);

    let lets_light_through = mtl.opacity.is_some_and(|d| d < 1.0)
        || mtl.filter.is_some_and(|tf| tf.max_element() > 0.0)
        || diffuse == DVec3::ZERO;
    let is_sharp = exponent.is_none_or(|ns| ns >= MIRROR_EXPONENT);
    if matches!(illum, 4 | 6 | 7 | 9) && ior > 1.0 && lets_light_through {
        BsdfDescription::Dielectric {
            ior,
            fresnel: Fresnel::Exact,
        }
    } else if matches!(illum, 3 | 5) && diffuse == DVec3::ZERO && is_sharp {
        BsdfDescription::Mirror {
            reflectance: specular,
        }
    } else if illum <= 1 || specular == DVec3::ZERO {
        BsdfDescription::Lambertian {
            reflectance: diffuse,
        }
    } else {
        BsdfDescription::Glossy {
            diffuse,
            specular,
            exponent: exponent.unwrap_or(DEFAULT_EXPONENT),
        }
    }
}

/// The same scattering, scaled down if it reflects more than it receives, and whether it was.
fn conserve_energy(bsdf: BsdfDescription) -> (BsdfDescription, bool) {
    match bsdf {
        BsdfDescription::Glossy {
            diffuse,
            specular,
            exponent,
        } if (diffuse + specular).max_element() > 1.0 => {
            let scale = 1.0 / (diffuse + specular).max_element();
            let specular = scale * specular;
            let scaled = BsdfDescription::Glossy {
                // So that the sum exceeds 1 in no channel by a rounding either.
                diffuse: (scale * diffuse).min(DVec3::ONE - specular),
                specular,
                exponent,
            };
            (scaled, true)
        }
        sound => (sound, false),
    }
}

/// Moves values into their range and remembers whether any was outside.
#[derive(Debug, Default)]
struct Clamp {
    was_needed: bool,
}

impl Clamp {
    /// Not a number counts as the least.
    fn number(&mut self, value: f64, least: f64, most: f64) -> f64 {
        let inside = value.max(least).min(most);
        self.was_needed |= inside != value;
        inside
    }

    fn colour(&mut self, value: DVec3, most: f64) -> DVec3 {
        DVec3::from_array(value.to_array().map(|value| self.number(value, 0.0, most)))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn described(mtl: &MtlMaterial) -> (MaterialDescription, Changes) {
        let mut changes = Changes::default();
        let mut textures = Vec::new();
        let mut pictures = Pictures::new(Path::new("nowhere"), &mut textures);
        let material = describe("m".to_owned(), mtl, &mut pictures, &mut changes);
        (material, changes)
    }

    fn bsdf(mtl: &MtlMaterial) -> BsdfDescription {
        described(mtl).0.bsdf
    }

    fn lambertian(reflectance: f64) -> BsdfDescription {
        BsdfDescription::Lambertian {
            reflectance: DVec3::splat(reflectance),
        }
    }

    /// Kd, Ks, Ns and illum.
    fn mtl(kd: f64, ks: f64, ns: f64, illum: u8) -> MtlMaterial {
        MtlMaterial {
            diffuse: Some(DVec3::splat(kd)),
            specular: Some(DVec3::splat(ks)),
            exponent: Some(ns),
            illum: Some(illum),
            ..MtlMaterial::default()
        }
    }

    #[test]
    fn each_row_of_the_table_is_its_material() {
        assert_eq!(bsdf(&mtl(0.6, 0.0, 10.0, 2)), lambertian(0.6));
        assert_eq!(bsdf(&mtl(0.6, 0.3, 10.0, 1)), lambertian(0.6));
        let glossy = BsdfDescription::Glossy {
            diffuse: DVec3::splat(0.25),
            specular: DVec3::splat(0.5),
            exponent: 40.0,
        };
        assert_eq!(bsdf(&mtl(0.25, 0.5, 40.0, 2)), glossy);
        assert_eq!(bsdf(&mtl(0.25, 0.5, 40.0, 3)), glossy);
        let mirror = BsdfDescription::Mirror {
            reflectance: DVec3::splat(0.9),
        };
        assert_eq!(bsdf(&mtl(0.0, 0.9, 2e4, 3)), mirror);
        let without_exponent = MtlMaterial {
            exponent: None,
            ..mtl(0.0, 0.9, 0.0, 5)
        };
        assert_eq!(bsdf(&without_exponent), mirror);
        let rough = bsdf(&mtl(0.0, 0.9, 198.0, 3));
        assert!(matches!(
            rough,
            BsdfDescription::Glossy {
                exponent: 198.0,
                ..
            }
        ));
        let glass = MtlMaterial {
            ior: Some(1.5),
            opacity: Some(0.0),
            ..mtl(0.0, 1.0, 1e5, 7)
        };
        let (material, _) = described(&glass);
        let expected = BsdfDescription::Dielectric {
            ior: 1.5,
            fresnel: Fresnel::Exact,
        };
        assert_eq!((material.bsdf, material.opacity), (expected, 1.0));
        let opaque = MtlMaterial {
            ior: Some(1.5),
            ..mtl(0.5, 0.25, 100.0, 7)
        };
        assert!(matches!(bsdf(&opaque), BsdfDescription::Glossy { .. }));
    }

    #[test]
    fn what_is_absent_has_its_default() {
        assert_eq!(bsdf(&MtlMaterial::default()), lambertian(0.5));
        let textured = MtlMaterial {
            diffuse_map: Some("none.png".to_owned()),
            ..MtlMaterial::default()
        };
        assert_eq!(bsdf(&textured), lambertian(1.0));
        let lamp = MtlMaterial {
            emission: Some(DVec3::new(17.0, 12.0, 4.0)),
            opacity: Some(0.25),
            ..MtlMaterial::default()
        };
        let (material, changes) = described(&lamp);
        assert_eq!(material.bsdf, lambertian(0.0));
        let emission = material.emission.unwrap();
        assert!(emission.two_sided && emission.radiance == DVec3::new(17.0, 12.0, 4.0));
        assert_eq!(material.opacity, 0.25);
        assert!(changes.clamped.is_empty() && changes.scaled.is_empty());
        let dark = MtlMaterial {
            emission: Some(DVec3::ZERO),
            ..MtlMaterial::default()
        };
        assert_eq!(described(&dark).0.emission, None);
    }

    #[test]
    fn values_out_of_range_are_clamped_and_told() {
        let wild = MtlMaterial {
            diffuse: Some(DVec3::new(f64::NAN, 1.5, -1.0)),
            emission: Some(DVec3::new(f64::INFINITY, f64::NAN, -1.0)),
            opacity: Some(7.0),
            ..mtl(0.0, 0.0, f64::NAN, 2)
        };
        let (material, changes) = described(&wild);
        let expected = BsdfDescription::Lambertian {
            reflectance: DVec3::new(0.0, 1.0, 0.0),
        };
        assert_eq!((material.bsdf, material.opacity), (expected, 1.0));
        let radiance = material.emission.unwrap().radiance;
        assert_eq!(radiance, DVec3::new(MAX_RADIANCE, 0.0, 0.0));
        assert_eq!(changes.clamped, ["m"]);
    }

    #[test]
    fn nothing_reflects_more_than_it_receives() {
        for (kd, ks) in [(1.0, 0.04), (0.7, 0.7), (1.0, 1.0), (0.8, 0.2001)] {
            let (material, changes) = described(&mtl(kd, ks, 10.0, 2));
            let BsdfDescription::Glossy {
                diffuse, specular, ..
            } = material.bsdf
            else {
                panic!("{:?}", material.bsdf);
            };
            let sum = (diffuse + specular).max_element();
            assert!(sum <= 1.0 && sum > 1.0 - 1e-15, "{sum}");
            assert!((diffuse.x / specular.x - kd / ks).abs() < 1e-12 * kd / ks);
            assert_eq!(changes.scaled, ["m"]);
        }
        assert!(described(&mtl(0.5, 0.5, 10.0, 2)).1.scaled.is_empty());
    }
}
