//! Images that need no samples: the closed form that a scene states.

use glam::DVec3;

use super::appearance::Appearance;
use super::bsdf::Bsdf;
use super::{RayCounts, Reference};
use crate::error::{Error, Result};
use crate::scene::{
    BsdfDescription, ClosedForm, MaterialDescription, MaterialId, RenderSettings, SceneDescription,
    ShapeGeometry,
};

/// Nodes and weights of Gauss and Legendre's rule of five points on [0, 1], exact to the ninth degree: the
/// mean over a pixel without edges is as good as exact.
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668_0, 0.118_463_442_528_094_5),
    (0.230_765_344_947_158_4, 0.239_314_335_249_683_2),
    (0.5, 0.284_444_444_444_444_4),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_2),
    (0.953_089_922_969_332, 0.118_463_442_528_094_5),
];

/// The exact image of a scene as seen by `scene.cameras[camera]` on a film of this size: mean radiance per
/// pixel, linear RGB, row by row from the top. `None` if the scene states no closed form.
///
/// # Errors
/// If the scene is not what its closed form holds for, as far as that is easy to tell, or there is no such
/// camera.
pub fn closed_form_image(
    scene: &SceneDescription,
    camera: usize,
    width: u32,
    height: u32,
) -> Result<Option<Vec<[f64; 3]>>> {
    let pixels = width as usize * height as usize;
    match scene.closed_form {
        None => Ok(None),
        Some(ClosedForm::Constant(radiance)) => Ok(Some(vec![radiance.to_array(); pixels])),
        Some(ClosedForm::Direct) => {
            let settings = RenderSettings::default();
            let reference = Reference::new(scene, camera, width, height, &settings)?;
            let panels = panels(scene)?;
            let pixel = |index| {
                let corner = [
                    (index % width as usize) as f64,
                    (index / width as usize) as f64,
                ];
                reference.direct_mean(corner, &panels).to_array()
            };
            Ok(Some((0..pixels).map(pixel).collect()))
        }
    }
}

/// A polygon that emits on its front.
struct Panel {
    corners: Vec<DVec3>,
    radiance: DVec3,
}

/// The emitters of a scene. Errors if one of its parts does not belong under [`ClosedForm::Direct`].
fn panels(scene: &SceneDescription) -> Result<Vec<Panel>> {
    let refusal = |what: &str| {
        let message = format!("the closed form `direct` does not hold for {what}");
        Error::file(&scene.source, message)
    };
    if scene.background != DVec3::ZERO || !scene.point_lights.is_empty() {
        return Err(refusal("a background or point lights"));
    }
    let mut panels = Vec::new();
    for shape in &scene.shapes {
        let mut add = |corners: &[DVec3], id: MaterialId| {
            let material = &scene.materials[id.0 as usize];
            match emission(material) {
                Ok(None) => Ok(()),
                Ok(Some(radiance)) => {
                    let corners = corners.to_vec();
                    panels.push(Panel { corners, radiance });
                    Ok(())
                }
                Err(()) => Err(refusal(&format!("the material `{}`", material.name))),
            }
        };
        match &shape.geometry {
            ShapeGeometry::Quad(corners) => add(corners, shape.material)?,
            ShapeGeometry::Mesh(mesh) => {
                for (i, face) in mesh.faces.iter().enumerate() {
                    let corners = face.map(|index| mesh.positions[index as usize]);
                    let material = mesh.face_materials.get(i).copied();
                    add(&corners, material.unwrap_or(shape.material))?;
                }
            }
            ShapeGeometry::Sphere { .. } => return Err(refusal("spheres")),
        }
    }
    Ok(panels)
}

/// What a material emits, if it is an emitter; an error unless it is one or is Lambertian.
fn emission(material: &MaterialDescription) -> std::result::Result<Option<DVec3>, ()> {
    let plain = material.reflectance_texture.is_none()
        && material.opacity_texture.is_none()
        && material.opacity == 1.0;
    match (&material.bsdf, &material.emission) {
        (BsdfDescription::Lambertian { .. }, None) if plain => Ok(None),
        (BsdfDescription::Black, Some(emission)) if plain && !emission.two_sided => {
            Ok(Some(emission.radiance))
        }
        _ => Err(()),
    }
}

impl Reference {
    /// Mean radiance over the pixel with this top left corner.
    fn direct_mean(&self, corner: [f64; 2], panels: &[Panel]) -> DVec3 {
        let mut mean = DVec3::ZERO;
        for (x, weight_x) in GAUSS {
            for (y, weight_y) in GAUSS {
                let radiance = self.direct_radiance([corner[0] + x, corner[1] + y], panels);
                mean += weight_x * weight_y * radiance;
            }
        }
        mean
    }

    /// Radiance through a point of the image in pixels.
    fn direct_radiance(&self, pixel: [f64; 2], panels: &[Panel]) -> DVec3 {
        let ray = self.camera_ray(pixel);
        let Some(hit) = self.trace(&ray, 1, &mut RayCounts::default()) else {
            return DVec3::ZERO;
        };
        let surface = &self.surfaces[hit.primitive];
        if let Some(emission) = surface.emission {
            let front = ray.direction.dot(hit.normal) < 0.0;
            return if front {
                emission.radiance
            } else {
                DVec3::ZERO
            };
        }
        let Appearance { bsdf, face, .. } = self.appearance(&hit, ray.direction);
        let Some(Bsdf::Lobe(lambertian)) = bsdf else {
            return DVec3::ZERO;
        };
        let irradiance: DVec3 = panels
            .iter()
            .map(|panel| panel.radiance * irradiance(hit.position, face, &panel.corners))
            .sum();
        lambertian.eval(face, face, face) * irradiance
    }
}

/// Irradiance at a point with this unit normal from a polygon of radiance 1 that emits on its front:
/// Lambert's formula over the part above the horizon (J. H. Lambert, "Photometria", 1760).
fn irradiance(point: DVec3, normal: DVec3, corners: &[DVec3]) -> f64 {
    let front = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    if front.dot(point - corners[0]) <= 0.0 {
        return 0.0;
    }
    let mut above: Vec<DVec3> = Vec::with_capacity(corners.len() + 1);
    for (i, &corner) in corners.iter().enumerate() {
        let (a, b) = (corner - point, corners[(i + 1) % corners.len()] - point);
        let (height_a, height_b) = (a.dot(normal), b.dot(normal));
        if height_a >= 0.0 {
            above.push(a);
        }
        if (height_a < 0.0) != (height_b < 0.0) {
            above.push(a + (b - a) * (height_a / (height_a - height_b)));
        }
    }
    let mut sum = 0.0;
    for (i, corner) in above.iter().enumerate() {
        let (a, b) = (corner.normalize(), above[(i + 1) % above.len()].normalize());
        let axis = a.cross(b);
        let sine = axis.length();
        if sine > 0.0 {
            sum += sine.atan2(a.dot(b)) * axis.dot(normal) / sine;
        }
    }
    0.5 * sum.abs()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::scene;

    #[test]
    fn irradiance_of_rectangles_is_as_tabled() {
        let square = |half: f64, height: f64| {
            [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]]
                .map(|[x, y]| DVec3::new(half * x, half * y, height))
        };
        for (corners, expected) in [
            (square(0.5, 1.0), 0.752_274_688_454),
            (square(0.5, 0.01), 3.140_564_683_433),
        ] {
            let value = irradiance(DVec3::ZERO, DVec3::Z, &corners);
            assert!((value - expected).abs() < 1e-11, "{value}");
            assert_eq!(irradiance(DVec3::Z * 2.0, DVec3::NEG_Z, &corners), 0.0);
        }
        // A wall of 1 × 1 at distance 1 from the foot of its edge, and one that goes on below the horizon.
        for low in [0.0, -1.0] {
            let wall = [[0.0, low], [0.0, 1.0], [1.0, 1.0], [1.0, low]]
                .map(|[y, z]| DVec3::new(1.0, y, z));
            let value = irradiance(DVec3::ZERO, DVec3::Z, &wall);
            assert!((value - 0.175_094_143_857).abs() < 1e-11, "{value}");
        }
    }

    #[test]
    fn image_of_a_panel_over_a_floor_is_what_the_reference_renders() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/panel.toml");
        let scene = scene::load(&path, &[]).unwrap();
        let exact = closed_form_image(&scene, 0, 4, 4).unwrap().unwrap();
        let settings = RenderSettings::default();
        let reference = Reference::new(&scene, 0, 4, 4, &settings).unwrap();
        let (mut counts, samples) = (RayCounts::default(), 2000u32);
        for (pixel, exact) in exact.into_iter().enumerate() {
            let (x, y) = (pixel as u32 % 4, pixel as u32 / 4);
            let values: Vec<f64> = (0..samples)
                .map(|sample| reference.sample(x, y, u64::from(sample), &mut counts).x)
                .collect();
            let n = f64::from(samples);
            let mean = values.iter().sum::<f64>() / n;
            let square: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
            let z = (mean - exact[0]) / (square.sqrt() / n);
            assert!(exact[0] > 0.0 && z.abs() < 4.5, "pixel {pixel}: z = {z}");
        }
    }

    #[test]
    fn scenes_of_which_the_closed_form_is_not_true_are_refused() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/panel.toml");
        for (change, part) in [
            ("background={radiance=1}", "background"),
            ("materials.floor={type=\"mirror\"}", "`floor`"),
            ("materials.panel.two_sided=true", "`panel`"),
        ] {
            let scene = scene::load(&path, &[change.to_owned()]).unwrap();
            let error = closed_form_image(&scene, 0, 4, 4).unwrap_err().to_string();
            assert!(
                error.contains(part) && error.contains("panel.toml"),
                "{error}"
            );
        }
    }
}
