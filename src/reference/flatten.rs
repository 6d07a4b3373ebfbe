//! From the scene as written to flat tables.

use glam::{DVec2, DVec3, Vec2, Vec3};

use super::appearance::Corners;
use super::bsdf::Bsdf;
use super::light::{AreaLight, Light, Lights};
use super::primitives::{PatchId, Primitives};
use super::rectangle::is_rectangle;
use crate::error::{Error, Result};
use crate::scene::{
    EmissionDescription, MaterialDescription, MaterialId, Mesh, SceneDescription, ShapeDescription,
    ShapeGeometry, TextureId,
};

/// Everything that a renderer looks up.
pub(super) struct Tables {
    pub(super) primitives: Primitives,
    /// One per primitive.
    pub(super) surfaces: Vec<Surface>,
    pub(super) lights: Lights,
    /// The light that is the background, if shadow rays look for it.
    pub(super) background_light: Option<usize>,
}

/// What a primitive is made of.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surface {
    /// `None` absorbs everything.
    pub(super) bsdf: Option<Bsdf>,
    /// What its corners have.
    pub(super) corners: Corners,
    /// Multiplies the reflectance.
    pub(super) reflectance_texture: Option<TextureId>,
    /// Share of the light that meets the surface, in [0, 1]; the rest goes straight on.
    pub(super) opacity: f64,
    /// Multiplies the opacity.
    pub(super) opacity_texture: Option<TextureId>,
    /// `None` is black.
    pub(super) emission: Option<EmissionDescription>,
    /// The light that it is, if shadow rays look for it.
    pub(super) light: Option<usize>,
    /// Bound of the distance between a computed point and the surface, in scene units.
    pub(super) position_error: f64,
}

impl Surface {
    /// Whether nothing goes straight on anywhere on it.
    pub(super) fn is_opaque(&self) -> bool {
        self.opacity >= 1.0 && self.opacity_texture.is_none()
    }
}

/// Flattens a scene. Shadow rays look for point lights and, if `samples_surfaces`, for emissive
/// surfaces and the background.
///
/// # Errors
/// If an index is out of range or there are 2³² primitives.
pub(super) fn flatten(scene: &SceneDescription, samples_surfaces: bool) -> Result<Tables> {
    let mut flattener = Flattener {
        materials: &scene.materials,
        samples_surfaces,
        primitives: Primitives::default(),
        surfaces: Vec::new(),
        lights: Vec::new(),
    };
    // All triangles come before all spheres.
    for shape in &scene.shapes {
        match &shape.geometry {
            ShapeGeometry::Mesh(mesh) => flattener.add_mesh(shape, mesh)?,
            ShapeGeometry::Quad(corners) => flattener.add_quad(shape, *corners)?,
            ShapeGeometry::Sphere { .. } => {}
        }
    }
    for shape in &scene.shapes {
        if let ShapeGeometry::Sphere { center, radius } = shape.geometry {
            flattener.add_sphere(shape, center, radius)?;
        }
    }
    let Flattener {
        primitives,
        surfaces,
        mut lights,
        ..
    } = flattener;
    if u32::try_from(surfaces.len()).is_err() {
        return Err(Error::limit(
            "the reference renders fewer than 2^32 primitives",
        ));
    }

    for light in &scene.point_lights {
        if light.intensity != DVec3::ZERO {
            lights.push(Light::Point(light.position, light.intensity));
        }
    }
    let background_light =
        (samples_surfaces && scene.background != DVec3::ZERO).then_some(lights.len());
    if background_light.is_some() {
        lights.push(Light::Background(scene.background, radius(&primitives)));
    }
    Ok(Tables {
        primitives,
        surfaces,
        lights: Lights::new(lights),
        background_light,
    })
}

/// Whether a quad's corners are those of a parallelogram but for rounding.
fn is_parallelogram([a, b, c, d]: [DVec3; 4]) -> bool {
    (a - b + c - d).length() <= 1e-6 * (c - a).length()
}

/// Radius of a sphere around everything; 1 around nothing.
fn radius(primitives: &Primitives) -> f64 {
    primitives
        .bounds()
        .map_or(1.0, |[low, high]| 0.5 * low.distance(high))
}

/// The tables while they grow.
struct Flattener<'a> {
    materials: &'a [MaterialDescription],
    samples_surfaces: bool,
    primitives: Primitives,
    surfaces: Vec<Surface>,
    lights: Vec<Light>,
}

impl Flattener<'_> {
    fn add_mesh(&mut self, shape: &ShapeDescription, mesh: &Mesh) -> Result<()> {
        for (i, face) in mesh.faces.iter().enumerate() {
            let corner = |index: u32| {
                mesh.positions.get(index as usize).copied().ok_or_else(|| {
                    Error::usage(format!(
                        "face {i} of shape {:?} has no vertex {index}",
                        shape.name
                    ))
                })
            };
            let corners = [corner(face[0])?, corner(face[1])?, corner(face[2])?];
            let material = mesh
                .face_materials
                .get(i)
                .copied()
                .unwrap_or(shape.material);
            self.primitives.add_triangle(corners);
            let attributes = self.corners(mesh, i);
            self.add_triangle_surface(shape, material, corners, attributes)?;
        }
        Ok(())
    }

    fn add_quad(&mut self, shape: &ShapeDescription, [a, b, c, d]: [DVec3; 4]) -> Result<()> {
        self.primitives.add_quad([a, b, c, d]);
        let edges = [b - a, d - a];
        let surface = self.surface(shape, shape.material, Corners::default())?;
        if let Some(emission) = surface.emission
            && self.samples_surfaces
            && is_parallelogram([a, b, c, d])
            && is_rectangle(edges)
        {
            self.add_rectangle(surface, |patch| {
                AreaLight::rectangle(a, edges, emission, patch, surface.position_error)
            });
            return Ok(());
        }
        for corners in [[a, b, c], [a, c, d]] {
            self.add_triangle_surface(shape, shape.material, corners, Corners::default())?;
        }
        Ok(())
    }

    /// Adds both halves of the last quad, with this surface, as one light.
    fn add_rectangle(&mut self, surface: Surface, light: impl FnOnce(PatchId) -> AreaLight) {
        let patch = self.primitives.patch(self.surfaces.len());
        let index = Some(self.lights.len());
        self.lights.push(Light::Area(light(patch)));
        let half = Surface {
            light: index,
            ..surface
        };
        self.surfaces.extend([half, half]);
    }

    /// What the corners of the last triangle, face `i` of `mesh`, have. A corner without a normal that
    /// has a direction has that of the face; texture coordinates are there at all corners or at none.
    fn corners(&self, mesh: &Mesh, i: usize) -> Corners {
        let primitive = self.primitives.triangle_count() - 1;
        let face = self.primitives.normal(primitive, DVec3::ZERO);
        let normals = mesh.face_normals.get(i).and_then(|corners| {
            let normals = corners.map(|normal| {
                let normal = mesh.normals.get(normal as usize)?;
                Vec3::from_array(*normal).as_dvec3().try_normalize()
            });
            let is_smooth = normals.iter().any(Option::is_some);
            is_smooth.then(|| normals.map(|normal| normal.unwrap_or(face)))
        });
        let uvs = mesh.face_uvs.get(i).and_then(|corners| {
            let [a, b, c] = corners.map(|uv| {
                let uv = Vec2::from_array(*mesh.uvs.get(uv as usize)?).as_dvec2();
                // Beyond 2^24 f32 has no fractions: such coordinates mean nothing.
                let sound = |x: f64| if x.abs() <= 16_777_216.0 { x } else { 0.0 };
                Some(DVec2::new(sound(uv.x), sound(uv.y)))
            });
            Some([a?, b?, c?])
        });
        Corners { normals, uvs }
    }

    fn add_sphere(&mut self, shape: &ShapeDescription, center: DVec3, radius: f64) -> Result<()> {
        self.primitives.add_sphere(center, radius);
        let surface = self.surface(shape, shape.material, Corners::default())?;
        let patch = self.primitives.patch(self.surfaces.len());
        self.add_surface(surface, |emission| {
            AreaLight::sphere(center, radius, emission, patch, surface.position_error)
        });
        Ok(())
    }

    fn add_triangle_surface(
        &mut self,
        shape: &ShapeDescription,
        material: MaterialId,
        corners: [DVec3; 3],
        attributes: Corners,
    ) -> Result<()> {
        let surface = self.surface(shape, material, attributes)?;
        let patch = self.primitives.patch(self.surfaces.len());
        self.add_surface(surface, |emission| {
            AreaLight::triangle(corners, emission, patch, surface.position_error)
        });
        Ok(())
    }

    /// The surface of the next primitive, which is in `primitives` already.
    fn surface(
        &self,
        shape: &ShapeDescription,
        material: MaterialId,
        corners: Corners,
    ) -> Result<Surface> {
        let Some(material) = self.materials.get(material.0 as usize) else {
            let message = format!(
                "shape {:?} has no material number {}",
                shape.name, material.0
            );
            return Err(Error::usage(message));
        };
        Ok(Surface {
            bsdf: Bsdf::new(&material.bsdf),
            corners,
            reflectance_texture: material.reflectance_texture,
            opacity: material.opacity,
            opacity_texture: material.opacity_texture,
            emission: material
                .emission
                .filter(|emission| emission.radiance != DVec3::ZERO),
            light: None,
            position_error: self.primitives.position_error(self.surfaces.len()),
        })
    }

    fn add_surface(
        &mut self,
        surface: Surface,
        area_light: impl FnOnce(EmissionDescription) -> AreaLight,
    ) {
        let emission = surface.emission.filter(|_| self.samples_surfaces);
        let light = emission.map(|emission| {
            self.lights.push(Light::Area(area_light(emission)));
            self.lights.len() - 1
        });
        self.surfaces.push(Surface { light, ..surface });
    }
}
