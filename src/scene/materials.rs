//! `[materials.NAME]`.

use glam::DVec3;

use super::description::{BsdfDescription, EmissionDescription, Fresnel, MaterialDescription};
use super::document::{Entry, Fields, one_of};
use super::values;
use crate::error::Result;

/// Largest exponent of a Phong lobe, half a milliradian wide.
const MAX_EXPONENT: f64 = 1e6;

const TYPES: [&str; 8] = [
    "lambertian",
    "oren-nayar",
    "mirror",
    "dielectric",
    "phong",
    "glossy",
    "black",
    "emitter",
];

/// One material.
pub(super) fn read(entry: &Entry) -> Result<MaterialDescription> {
    let node = &entry.node;
    let tag = node.tag("a material", &TYPES)?;
    let own_keys: &[&str] = match tag {
        "lambertian" | "mirror" => &["reflectance"],
        "oren-nayar" => &["reflectance", "sigma"],
        "dielectric" => &["ior", "fresnel"],
        "phong" => &["reflectance", "exponent"],
        "glossy" => &["diffuse", "specular", "exponent"],
        _ => &[],
    };
    let keys = [&["type", "emission", "two_sided"], own_keys].concat();
    let what = format!("a material of type `{tag}`");
    let fields = node.fields(&what, &keys)?;

    let reflectance = || values::albedo(fields.required("reflectance")?, "reflectance");
    let bsdf = match tag {
        "lambertian" => BsdfDescription::Lambertian {
            reflectance: reflectance()?,
        },
        "oren-nayar" => BsdfDescription::OrenNayar {
            reflectance: reflectance()?,
            sigma: values::number(fields.required("sigma")?, "sigma", "≥ 0", |sigma| {
                sigma >= 0.0
            })?,
        },
        "mirror" => BsdfDescription::Mirror {
            reflectance: match fields.optional("reflectance") {
                Some(node) => values::albedo(node, "reflectance")?,
                None => DVec3::ONE,
            },
        },
        "dielectric" => read_dielectric(&fields)?,
        "phong" => BsdfDescription::Phong {
            reflectance: reflectance()?,
            exponent: read_exponent(&fields)?,
        },
        "glossy" => read_glossy(&fields)?,
        _ => BsdfDescription::Black,
    };
    if tag == "emitter" {
        fields.required("emission")?;
    }
    Ok(MaterialDescription {
        emission: read_emission(&fields)?,
        ..MaterialDescription::new(entry.key.clone(), bsdf)
    })
}

fn read_exponent(fields: &Fields<'_>) -> Result<f64> {
    let node = fields.required("exponent")?;
    values::number(node, "exponent", "in [0, 1e6]", |exponent| {
        (0.0..=MAX_EXPONENT).contains(&exponent)
    })
}

fn read_glossy(fields: &Fields<'_>) -> Result<BsdfDescription> {
    let diffuse = values::albedo(fields.required("diffuse")?, "diffuse")?;
    let node = fields.required("specular")?;
    let specular = values::albedo(node, "specular")?;
    // 0.7 + 0.3 may round to a little more than 1.
    let most = (diffuse + specular).max_element();
    if most > 1.0 + f64::EPSILON {
        return Err(node.spot.error(format!(
            "`diffuse` + `specular` must be at most 1 in each channel, got {most}"
        )));
    }
    Ok(BsdfDescription::Glossy {
        diffuse,
        specular,
        exponent: read_exponent(fields)?,
    })
}

fn read_dielectric(fields: &Fields<'_>) -> Result<BsdfDescription> {
    let fresnel = match fields.optional("fresnel") {
        Some(node) if one_of(node, "fresnel", &["schlick", "exact"])? == "schlick" => {
            Fresnel::Schlick
        }
        _ => Fresnel::Exact,
    };
    Ok(BsdfDescription::Dielectric {
        // Squares of both and of their inverses are far from f32's limits within these bounds.
        ior: values::number(
            fields.required("ior")?,
            "ior",
            "> 0 (0.001 to 1000)",
            |ior| (1e-3..=1e3).contains(&ior),
        )?,
        fresnel,
    })
}

fn read_emission(fields: &Fields<'_>) -> Result<Option<EmissionDescription>> {
    let two_sided = fields.optional("two_sided");
    let Some(emission) = fields.optional("emission") else {
        return match two_sided {
            Some(node) => Err(node
                .spot
                .error("`two_sided` is about `emission`, which is missing")),
            None => Ok(None),
        };
    };
    Ok(Some(EmissionDescription {
        radiance: values::radiance(emission, "emission")?,
        two_sided: match two_sided {
            Some(node) => node.boolean()?,
            None => false,
        },
    }))
}
