//! The scene as it is traced: flat tables in re-centred f32, read-only, shared by all workers.

use std::collections::HashMap;

use glam::DVec3;

use super::{Camera, Features};
use crate::accel::{self, Accel, Structure};
use crate::error::{Error, Result};
use crate::geometry::{Geometry, PrimitiveId, Sphere, Triangle};
use crate::light::{FlatLight, LightSpec, LightTable};
use crate::material::{FresnelFormula, MaterialKind, MaterialSpec, MaterialTable};
use crate::math::float::gamma;
use crate::scene::{
    AccelKind, BsdfDescription, Fresnel, IntegratorKind, MaterialId, RenderSettings, SamplerKind,
    SceneDescription, ShapeGeometry, Strategy,
};

/// What the sort stage has to know of a primitive, in one word.
#[derive(Debug, Clone, Copy)]
pub struct PrimitiveClass;

impl PrimitiveClass {
    /// Bits of the material's [`MaterialKind`].
    pub const KIND: u32 = 7;
    /// The primitive emits.
    pub const EMITS: u32 = 8;
}

/// Per-primitive columns of what shading needs. Triangle `i` is primitive `i`, sphere `j` is
/// primitive `first_sphere + j`.
#[derive(Debug, Clone, Default)]
pub struct SurfaceTable {
    /// Number of triangles.
    pub first_sphere: u32,
    /// Corners of the triangles: corner, axis.
    pub corners: [[Vec<f32>; 3]; 3],
    /// Unit normals of the triangles, along (b − a) × (c − a).
    pub normal: [Vec<f32>; 3],
    /// Centres of the spheres.
    pub center: [Vec<f32>; 3],
    /// Radii of the spheres.
    pub radius: Vec<f32>,
    /// Material per primitive.
    pub material: Vec<u32>,
    /// Light per primitive; 0 where it does not emit.
    pub light: Vec<u32>,
    /// [`PrimitiveClass`] per primitive.
    pub class: Vec<u32>,
}

/// A scene ready to trace.
#[derive(Debug)]
pub struct CompiledScene {
    /// What is needed.
    pub features: Features,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// The camera.
    pub camera: Camera,
    /// Its index in the description.
    pub camera_index: usize,
    /// What answers ray queries.
    pub accel: Box<dyn Accel>,
    /// Primitives for shading.
    pub surfaces: SurfaceTable,
    /// Material parameters.
    pub materials: MaterialTable,
    /// Albedo per material for auxiliary images: reflectance, 1 for glass, 0 for black.
    pub albedo: Vec<[f32; 3]>,
    /// Lights.
    pub lights: LightTable,
    /// Radiance of escaped rays, linear RGB.
    pub background: [f32; 3],
    /// What was subtracted from all positions, scene units.
    pub center: DVec3,
    /// Bound on the error of a sampled light point, scene units: shadow rays end this much earlier.
    pub light_point_error: f32,
    /// Faces left out because they have no area in f32.
    pub dropped: usize,
    /// Strategy.
    pub strategy: Strategy,
    /// Most path segments.
    pub max_depth: Option<u32>,
    /// First depth at which roulette may end a path.
    pub roulette_depth: u32,
    /// Seed.
    pub seed: u64,
}

impl CompiledScene {
    /// Whether a kernel compiled for the features `F` has to do what `feature` needs.
    #[inline(always)]
    pub fn on<const F: u32>(&self, feature: Features) -> bool {
        F & feature.0 != 0 && self.features.intersects(feature)
    }
}

/// Compiles a scene seen by its camera number `camera` at this size.
///
/// # Errors
/// If the scene exceeds 2^31 primitives or there is no such camera.
pub fn compile(
    scene: &SceneDescription,
    camera: usize,
    width: u32,
    height: u32,
    settings: &RenderSettings,
) -> Result<CompiledScene> {
    let Some(view) = scene.cameras.get(camera) else {
        return Err(Error::usage(format!("the scene has no camera number {camera}")));
    };
    let (center, extent) = bounds(scene);
    let mut tables = Tables::new(scene, center);
    for shape in &scene.shapes {
        tables.add_shape(&shape.geometry, shape.material);
    }
    for light in &scene.point_lights {
        tables.lights.push(LightSpec::Point {
            position: (light.position - center).as_vec3().to_array(),
            intensity: light.intensity.as_vec3().to_array(),
        });
    }
    let background = scene.background.as_vec3().to_array();
    if scene.background.max_element() > 0.0 {
        tables.lights.push(LightSpec::Background { radiance: background, scene_radius: extent as f32 });
    }
    tables.finish(scene, settings, camera, view, [width, height], center, extent, background)
}
