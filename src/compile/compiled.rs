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
        return Err(Error::usage(format!(
            "the scene has no camera number {camera}"
        )));
    };
    let bounds = Bounds::of(scene);
    let mut tables = Tables::new(scene, bounds.center);
    // Spheres come after all triangles, in primitive numbers too.
    for shape in &scene.shapes {
        tables.add_faces(&shape.geometry, shape.material);
    }
    tables.surfaces.first_sphere = tables.geometry.triangles.len() as u32;
    for shape in &scene.shapes {
        if let ShapeGeometry::Sphere { center, radius } = shape.geometry {
            tables.add_sphere(center, radius, shape.material);
        }
    }
    if tables.geometry.len() >= 1 << 31 {
        return Err(Error::limit("a scene may have at most 2^31 primitives"));
    }
    for light in &scene.point_lights {
        tables.add_point_light(light.position, light.intensity);
    }
    tables.add_background(scene.background, bounds.radius);

    let features = features(scene, &tables, settings);
    let structure = match settings.accel {
        AccelKind::Auto => accel::auto(&tables.geometry),
        AccelKind::Linear => Structure::Linear,
        AccelKind::Bvh2 => Structure::Bvh2,
        AccelKind::Bvh8 => Structure::Bvh8,
    };
    Ok(CompiledScene {
        features,
        width,
        height,
        camera: Camera::new(&view.projection, width, height, bounds.center),
        camera_index: camera,
        accel: accel::build(structure, &tables.geometry)?,
        albedo: scene.materials.iter().map(|m| albedo(&m.bsdf)).collect(),
        surfaces: tables.surfaces,
        materials: tables.materials,
        lights: tables.lights.build(),
        background: scene.background.as_vec3().to_array(),
        center: bounds.center,
        light_point_error: bounds.light_point_error(),
        dropped: tables.dropped,
        strategy: settings.strategy,
        max_depth: settings.max_depth,
        roulette_depth: settings.roulette_depth,
        seed: settings.seed,
    })
}

/// Where the scene is and how large.
struct Bounds {
    /// Middle of the bounding box; the eye of the first camera if there is nothing.
    center: DVec3,
    /// Half the diagonal of the bounding box, at least the eye's distance from the centre.
    radius: f64,
    /// Largest coordinate relative to the centre.
    extent: f64,
}

impl Bounds {
    fn of(scene: &SceneDescription) -> Self {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let mut include = |p: DVec3| {
            low = low.min(p);
            high = high.max(p);
        };
        for shape in &scene.shapes {
            match &shape.geometry {
                ShapeGeometry::Mesh(mesh) => {
                    // Vertices that no face uses do not count.
                    mesh.faces
                        .iter()
                        .flatten()
                        .for_each(|&v| include(mesh.positions[v as usize]));
                }
                ShapeGeometry::Quad(corners) => corners.iter().copied().for_each(&mut include),
                ShapeGeometry::Sphere { center, radius } => {
                    include(*center - DVec3::splat(*radius));
                    include(*center + DVec3::splat(*radius));
                }
            }
        }
        let eye = scene.cameras[0].projection.plane(1, 1)[0];
        if low.x > high.x {
            (low, high) = (eye, eye);
        }
        let center = 0.5 * (low + high);
        Self {
            center,
            radius: (0.5 * (high - low).length()).max((eye - center).length()),
            extent: (0.5 * (high - low)).max_element(),
        }
    }

    /// A light point is v + a·e1 + b·e2 (or c + r·n): four roundings of terms that are each at most
    /// twice the extent, per axis; over three axes the length of the error is at most √3 < 2 times
    /// that.
    fn light_point_error(&self) -> f32 {
        2.0 * gamma(4) * 6.0 * self.extent as f32
    }
}

/// The tables while they are filled.
struct Tables<'a> {
    scene: &'a SceneDescription,
    center: DVec3,
    geometry: Geometry,
    surfaces: SurfaceTable,
    materials: MaterialTable,
    lights: LightTableBuilder,
    kinds: Features,
    dropped: usize,
}

impl<'a> Tables<'a> {
    fn new(scene: &'a SceneDescription, center: DVec3) -> Self {
        let mut materials = MaterialTable::default();
        for material in &scene.materials {
            materials.push(material_spec(&material.bsdf));
        }
        Self {
            scene,
            center,
            geometry: Geometry::default(),
            surfaces: SurfaceTable::default(),
            materials,
            lights: LightTableBuilder::default(),
            kinds: Features::default(),
            dropped: 0,
        }
    }

    /// Re-centred and rounded.
    fn point(&self, p: DVec3) -> [f32; 3] {
        (p - self.center).as_vec3().to_array()
    }
}
