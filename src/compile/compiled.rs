//! The scene as it is traced: flat tables in re-centred f32, read-only, shared by all workers.

use glam::{DVec3, Vec3};

use super::attributes::{CornerAttributes, sound_uv, unit};
use super::maps::{MaterialMaps, is_partial, is_textured, maps};
use super::structure::{build_quality, structure};
use super::{Branching, Camera, Features};
use crate::accel::{self, Accel, BuildOptions, BuildPhase};
use crate::error::{Error, Result};
use crate::geometry::{Geometry, Sphere, Triangle};
use crate::light::{BackgroundLight, FlatLight, Light, LightTable, PointLight, SphereLight, kinds};
use crate::material::{FresnelFormula, MaterialKind, MaterialSpec, MaterialTable};
use crate::math::Table;
use crate::math::float::gamma;
use crate::scene::{
    BsdfDescription, EmissionDescription, Fresnel, IntegratorKind, MaterialDescription, MaterialId,
    Mesh, RenderSettings, SamplerKind, SceneDescription, ShapeGeometry, Strategy,
};
use crate::texture::TextureTable;

/// What the sort stage has to know of a primitive, in one word.
#[derive(Debug, Clone, Copy)]
pub struct PrimitiveClass;

impl PrimitiveClass {
    /// Bits of the material's [`MaterialKind`].
    pub const KIND: u32 = 7;
    /// The primitive emits.
    pub const EMITS: u32 = 8;
    /// The material lets part of the light go straight on.
    pub const PARTIAL: u32 = 16;
}

/// Per-primitive columns of what shading needs. Triangle `i` is primitive `i`, sphere `j` is
/// primitive `first_sphere + j`.
#[derive(Debug, Clone, Default)]
pub struct SurfaceTable {
    /// Number of triangles.
    pub first_sphere: u32,
    /// Corners of the triangles: corner, axis.
    pub corners: [[Table<f32>; 3]; 3],
    /// Unit normals of the triangles, along (b − a) × (c − a).
    pub normal: [Table<f32>; 3],
    /// Unit shading normals at the corners of triangles, on either side.
    pub shading_normals: CornerAttributes<3>,
    /// Texture coordinates at the corners of triangles whose material has textures.
    pub uvs: CornerAttributes<2>,
    /// Centres of the spheres.
    pub center: [Table<f32>; 3],
    /// Radii of the spheres.
    pub radius: Table<f32>,
    /// Material per primitive.
    pub material: Table<u32>,
    /// Light per primitive; 0 where it does not emit.
    pub light: Table<u32>,
    /// [`PrimitiveClass`] per primitive.
    pub class: Table<u32>,
}

/// A scene ready to trace.
#[derive(Debug)]
pub struct CompiledScene {
    /// What is needed.
    pub features: Features,
    /// How many rays leave a hit.
    pub branching: Branching,
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
    /// Textures and opacity of the materials.
    pub maps: MaterialMaps,
    /// Textures.
    pub textures: TextureTable,
    /// Albedo per material for auxiliary images.
    pub albedo: Vec<Albedo>,
    /// Lights.
    pub lights: LightTable,
    /// Radiance of escaped rays, linear RGB.
    pub background: [f32; 3],
    /// What was subtracted from all positions, scene units.
    pub center: DVec3,
    /// Bound on the error of a sampled light point, scene units: shadow rays end this much earlier.
    pub light_point_error: f32,
    /// Fixed distance of secondary rays from their surface, scene units; without effect unless the features
    /// have it.
    pub shadow_bias: f32,
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

/// What a material reflects in all directions together, for auxiliary images: linear RGB.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Albedo {
    /// What a texture multiplies.
    pub tinted: [f32; 3],
    /// The rest: the lobe of a glossy surface, 1 for glass.
    pub plain: [f32; 3],
}

impl Albedo {
    /// All of it under a texture of this colour.
    pub fn under(&self, texture: [f32; 3]) -> [f32; 3] {
        std::array::from_fn(|k| self.tinted[k] * texture[k] + self.plain[k])
    }
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
    compile_with_progress(scene, camera, width, height, settings, &|_, _| {})
}

/// As [`compile`]; `progress` is told of the build as [`BuildOptions::progress`] is.
///
/// # Errors
/// As [`compile`].
pub fn compile_with_progress(
    scene: &SceneDescription,
    camera: usize,
    width: u32,
    height: u32,
    settings: &RenderSettings,
    progress: &dyn Fn(BuildPhase, f64),
) -> Result<CompiledScene> {
    let Some(view) = scene.cameras.get(camera) else {
        return Err(Error::usage(format!(
            "the scene has no camera number {camera}"
        )));
    };
    let bounds = Bounds::of(scene);
    let mut tables = Tables::new(scene, bounds.center);
    tables.keeps_normals = has_attribute(scene, |mesh, _| !mesh.face_normals.is_empty());
    tables.keeps_uvs = has_attribute(scene, |mesh, is_textured| {
        is_textured && !mesh.face_uvs.is_empty()
    });
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
    let surfaces = &tables.surfaces;
    if surfaces.shading_normals.len().max(surfaces.uvs.len()) >= 1 << 31 {
        return Err(Error::limit(
            "a scene may have at most 2^31 normals and as many texture coordinates",
        ));
    }
    for light in &scene.point_lights {
        let position = tables.point(light.position);
        let intensity = light.intensity.as_vec3().to_array();
        tables.lights.push(Light::Point(PointLight {
            position,
            intensity,
        }));
    }
    let background = scene.background.as_vec3().to_array();
    if scene.background.max_element() > 0.0 {
        let scene_radius = bounds.radius as f32;
        tables.lights.push(Light::Background(BackgroundLight {
            radiance: background,
            scene_radius,
        }));
    }
    // With MIS the variance next to a light is finite either way.
    let alone =
        settings.strategy == Strategy::Nee || settings.integrator == IntegratorKind::Whitted;
    let lights = if alone {
        tables.keep_lights_apart();
        LightTable::new(&tables.lights)?
    } else {
        LightTable::by_area(&tables.lights)?
    };
    tables.surfaces.light = tables.light.iter().copied().collect();
    tables.surfaces.class = tables.class.iter().copied().collect();
    let features = features(&tables, &lights, settings);
    let (maps, textures) = if features.intersects(Features::TEXTURES | Features::OPACITY) {
        maps(scene, |material| tables.shows_textures[material])?
    } else {
        Default::default()
    };
    // Shadow rays to the background leave the scene; all others end on a primitive or a point light.
    tables.geometry.segment_ends = (scene.background.max_element() <= 0.0).then(|| {
        let points = scene.point_lights.iter();
        points.map(|light| tables.point(light.position)).collect()
    });
    let structure = structure(settings.accel, &tables.geometry);
    let options = BuildOptions {
        quality: build_quality(settings.accel_quality),
        progress: Some(progress),
    };
    Ok(CompiledScene {
        features,
        branching: Branching::new(features, settings),
        width,
        height,
        camera: Camera::new(&view.projection, width, height, bounds.center),
        camera_index: camera,
        accel: accel::build_with(structure, &tables.geometry, &options)?,
        albedo: scene.materials.iter().map(|m| albedo(&m.bsdf)).collect(),
        maps,
        textures,
        surfaces: tables.surfaces,
        materials: tables.materials,
        lights,
        background,
        center: bounds.center,
        light_point_error: bounds.light_point_error(),
        shadow_bias: settings.shadow_bias.unwrap_or(0.0) as f32,
        dropped: tables.dropped,
        strategy: settings.strategy,
        max_depth: settings.max_depth,
        roulette_depth: settings.roulette_depth,
        seed: settings.seed,
    })
}

/// Whether some mesh has an attribute, which is told the mesh and whether any of its materials has
/// textures.
fn has_attribute(scene: &SceneDescription, has: impl Fn(&Mesh, bool) -> bool) -> bool {
    let textured = |id: &MaterialId| is_textured(&scene.materials[id.0 as usize]);
    scene.shapes.iter().any(|shape| {
        let ShapeGeometry::Mesh(mesh) = &shape.geometry else {
            return false;
        };
        has(
            mesh,
            textured(&shape.material) || mesh.face_materials.iter().any(textured),
        )
    })
}

/// Where the scene is and how large.
struct Bounds {
    /// Middle of the bounding box; the eye of the first camera if there is nothing.
    center: DVec3,
    /// Half the diagonal of the bounding box, at least the eye's distance from the centre; 1 where
    /// that is nothing, so that the background of an empty scene has power.
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
        let radius = (0.5 * (high - low).length()).max((eye - center).length());
        Self {
            center,
            radius: if radius > 0.0 { radius } else { 1.0 },
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
    lights: Vec<Light>,
    /// Light per primitive.
    light: Vec<u32>,
    /// [`PrimitiveClass`] per primitive.
    class: Vec<u32>,
    /// Kinds of the materials that some primitive has.
    used: [bool; MaterialKind::COUNT],
    /// Whether meshes have shading normals.
    keeps_normals: bool,
    /// Whether meshes with textures have texture coordinates.
    keeps_uvs: bool,
    /// Whether some primitive lets light go straight on.
    has_partial: bool,
    /// Materials whose textures some face shows.
    shows_textures: Vec<bool>,
    dropped: usize,
}

/// Where the entries of one mesh begin among the shared vertex attributes.
#[derive(Clone, Copy)]
struct MeshEntries<'m> {
    mesh: &'m Mesh,
    first_normal: u32,
    first_uv: u32,
}

impl<'a> Tables<'a> {
    fn new(scene: &'a SceneDescription, center: DVec3) -> Self {
        let mut materials = MaterialTable::default();
        for material in &scene.materials {
            materials.push(material_spec(material));
        }
        Self {
            scene,
            center,
            geometry: Geometry::default(),
            surfaces: SurfaceTable::default(),
            materials,
            lights: Vec::new(),
            light: Vec::new(),
            class: Vec::new(),
            used: [false; MaterialKind::COUNT],
            keeps_normals: false,
            keeps_uvs: false,
            has_partial: false,
            shows_textures: vec![false; scene.materials.len()],
            dropped: 0,
        }
    }

    /// Re-centred and rounded.
    fn point(&self, p: DVec3) -> [f32; 3] {
        (p - self.center).as_vec3().to_array()
    }

    /// Triangles of a mesh or a quad.
    fn add_faces(&mut self, shape: &ShapeGeometry, material: MaterialId) {
        match shape {
            ShapeGeometry::Mesh(mesh) => {
                let entries = self.add_attribute_values(mesh, material);
                for (i, face) in mesh.faces.iter().enumerate() {
                    let material = mesh.face_materials.get(i).copied().unwrap_or(material);
                    let corners = face.map(|v| self.point(mesh.positions[v as usize]));
                    if let Some(primitive) = self.add_triangle(corners, material) {
                        self.add_attributes(primitive, material, Some((&entries, i)));
                        let [a, b, c] = corners;
                        self.add_flat_light(
                            material,
                            a,
                            [sub(b, a), sub(c, a)],
                            true,
                            [primitive; 2],
                        );
                    }
                }
            }
            ShapeGeometry::Quad(corners) => {
                let [a, b, c, d] = corners.map(|p| self.point(p));
                let halves = [[a, b, c], [a, c, d]];
                let primitives = halves.map(|half| {
                    let primitive = self.add_triangle(half, material)?;
                    self.add_attributes(primitive, material, None);
                    Some(primitive)
                });
                let size = (corners[2] - corners[0]).length();
                let skew = (corners[0] - corners[1] + corners[2] - corners[3]).length();
                if let ([Some(first), Some(second)], true) = (primitives, skew <= 1e-6 * size) {
                    self.add_flat_light(
                        material,
                        a,
                        [sub(b, a), sub(d, a)],
                        false,
                        [first, second],
                    );
                } else {
                    for ([a, b, c], primitive) in halves.into_iter().zip(primitives) {
                        if let Some(primitive) = primitive {
                            self.add_flat_light(
                                material,
                                a,
                                [sub(b, a), sub(c, a)],
                                true,
                                [primitive; 2],
                            );
                        }
                    }
                }
            }
            ShapeGeometry::Sphere { .. } => {}
        }
    }

    /// The new primitive, or `None` if the corners have no area in f32.
    fn add_triangle(&mut self, corners: [[f32; 3]; 3], material: MaterialId) -> Option<u32> {
        let [a, b, c] = corners.map(|p| Vec3::from_array(p).as_dvec3());
        let normal = (b - a).cross(c - a).try_normalize();
        let Some(normal) = normal else {
            self.dropped += 1;
            return None;
        };
        for (columns, corner) in self.surfaces.corners.iter_mut().zip(corners) {
            extend(columns, corner);
        }
        extend(&mut self.surfaces.normal, normal.as_vec3().to_array());
        let primitive = self.geometry.triangles.len() as u32;
        self.geometry.triangles.push(Triangle { corners });
        // Neighbours in one plane are one polygon where their material is the same.
        self.geometry.groups.push(material.0);
        self.add_primitive(material);
        Some(primitive)
    }

    /// Adds the shading normals and texture coordinates of a mesh, as far as they are kept.
    fn add_attribute_values<'m>(
        &mut self,
        mesh: &'m Mesh,
        material: MaterialId,
    ) -> MeshEntries<'m> {
        let SurfaceTable {
            shading_normals,
            uvs,
            ..
        } = &mut self.surfaces;
        let entries = MeshEntries {
            mesh,
            first_normal: shading_normals.len() as u32,
            first_uv: uvs.len() as u32,
        };
        if self.keeps_normals && !mesh.face_normals.is_empty() {
            for &normal in &mesh.normals {
                // Faces do not refer to what has no direction.
                shading_normals.push_value(unit(normal).unwrap_or_default());
            }
        }
        let textured = |id: &MaterialId| is_textured(&self.scene.materials[id.0 as usize]);
        if self.keeps_uvs
            && !mesh.face_uvs.is_empty()
            && (textured(&material) || mesh.face_materials.iter().any(textured))
        {
            for &uv in &mesh.uvs {
                uvs.push_value(sound_uv(uv));
            }
        }
        entries
    }

    /// Adds what the corners of the newest primitive have: `face` is its mesh and its number there,
    /// where it is the face of a mesh.
    fn add_attributes(
        &mut self,
        primitive: u32,
        material: MaterialId,
        face: Option<(&MeshEntries<'_>, usize)>,
    ) {
        let normals = face.and_then(|(entries, i)| self.normal_entries(primitive, entries, i));
        let uvs = face.and_then(|(entries, i)| {
            let uvs = entries.mesh.face_uvs.get(i)?;
            let complete = uvs.iter().all(|&uv| (uv as usize) < entries.mesh.uvs.len());
            (complete && is_textured(&self.scene.materials[material.0 as usize]))
                .then(|| uvs.map(|uv| entries.first_uv + uv))
        });
        if self.keeps_normals {
            self.surfaces.shading_normals.push_primitive(normals);
        }
        if self.keeps_uvs {
            self.surfaces.uvs.push_primitive(uvs);
            self.shows_textures[material.0 as usize] |= uvs.is_some();
        }
        if normals.or(uvs).is_some() {
            // Not to be merged with its neighbours: only its own corners tell what is between them.
            self.geometry.groups[primitive as usize] =
                self.scene.materials.len() as u32 + primitive;
        }
    }

    /// Entries of the shading normals of face `i`, or `None` if no corner has one. Corners without, and
    /// those whose normal has no direction, get the normal of the face.
    fn normal_entries(
        &mut self,
        primitive: u32,
        entries: &MeshEntries<'_>,
        i: usize,
    ) -> Option<[u32; 3]> {
        let mesh = entries.mesh;
        let corners = mesh.face_normals.get(i)?.map(|normal| {
            let value = mesh.normals.get(normal as usize)?;
            unit(*value).map(|_| entries.first_normal + normal)
        });
        if corners == [None; 3] {
            return None;
        }
        let face = self.surfaces.normal.each_ref();
        let face = face.map(|column| column[primitive as usize]);
        Some(
            corners.map(|entry| {
                entry.unwrap_or_else(|| self.surfaces.shading_normals.push_value(face))
            }),
        )
    }

    fn add_sphere(&mut self, center: DVec3, radius: f64, material: MaterialId) {
        let sphere = Sphere {
            center: self.point(center),
            radius: radius as f32,
        };
        let primitive = self.geometry.len() as u32;
        self.add_attributes(primitive, material, None);
        extend(&mut self.surfaces.center, sphere.center);
        self.surfaces.radius.push(sphere.radius);
        self.geometry.spheres.push(sphere);
        self.add_primitive(material);
        if let Some(emission) = self.emission(material) {
            self.add_light(
                primitive,
                Light::Sphere(SphereLight {
                    center: sphere.center,
                    radius: sphere.radius,
                    radiance: emission.radiance.as_vec3().to_array(),
                    two_sided: emission.two_sided,
                    primitive,
                }),
            );
        }
    }

    /// Columns that every primitive has.
    fn add_primitive(&mut self, material: MaterialId) {
        let kind = self.materials.kinds()[material.0 as usize];
        self.used[kind as usize] = true;
        self.surfaces.material.push(material.0);
        self.light.push(0);
        let mut class = kind as u32;
        if is_partial(&self.scene.materials[material.0 as usize]) {
            class |= PrimitiveClass::PARTIAL;
            self.has_partial = true;
        }
        self.class.push(class);
    }

    /// The emission of a material, if it has any power.
    fn emission(&self, material: MaterialId) -> Option<EmissionDescription> {
        let emission = self.scene.materials[material.0 as usize].emission;
        emission.filter(|emission| emission.radiance.max_element() > 0.0)
    }

    fn add_flat_light(
        &mut self,
        material: MaterialId,
        corner: [f32; 3],
        edges: [[f32; 3]; 2],
        is_triangle: bool,
        primitives: [u32; 2],
    ) {
        let Some(emission) = self.emission(material) else {
            return;
        };
        let light = Light::Flat(FlatLight {
            corner,
            edges,
            is_triangle,
            radiance: emission.radiance.as_vec3().to_array(),
            two_sided: emission.two_sided,
            primitives,
        });
        self.add_light(primitives[0], light);
        if primitives[1] != primitives[0] {
            let index = self.light[primitives[0] as usize];
            self.mark_emitter(primitives[1], index);
        }
    }

    /// Makes a polygon of its own of each flat light: one that is sampled by solid angle must not light what lies on
    /// itself, which only its own number on a hit tells from a neighbour's.
    fn keep_lights_apart(&mut self) {
        let materials = self.scene.materials.len() as u32;
        for light in &self.lights {
            if let Light::Flat(FlatLight { primitives, .. }) = light {
                for &primitive in primitives {
                    self.geometry.groups[primitive as usize] = materials + primitives[0];
                }
            }
        }
    }

    fn add_light(&mut self, primitive: u32, light: Light) {
        self.mark_emitter(primitive, self.lights.len() as u32);
        self.lights.push(light);
    }

    fn mark_emitter(&mut self, primitive: u32, light: u32) {
        self.light[primitive as usize] = light;
        self.class[primitive as usize] |= PrimitiveClass::EMITS;
    }
}

fn sub(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

fn extend(columns: &mut [Table<f32>; 3], values: [f32; 3]) {
    for (column, value) in columns.iter_mut().zip(values) {
        column.push(value);
    }
}

fn material_spec(material: &MaterialDescription) -> MaterialSpec {
    let rgb = |c: DVec3| c.as_vec3().to_array();
    match material.bsdf {
        // Black hits are in no queue, but a path may go on through a surface that is black in part.
        BsdfDescription::Black if is_partial(material) => MaterialSpec::Lambertian {
            reflectance: [0.0; 3],
        },
        BsdfDescription::Black => MaterialSpec::Black,
        BsdfDescription::Lambertian { reflectance } => MaterialSpec::Lambertian {
            reflectance: rgb(reflectance),
        },
        BsdfDescription::OrenNayar { reflectance, sigma } => MaterialSpec::OrenNayar {
            reflectance: rgb(reflectance),
            sigma,
        },
        BsdfDescription::Mirror { reflectance } => MaterialSpec::Mirror {
            reflectance: rgb(reflectance),
        },
        BsdfDescription::Dielectric { ior, fresnel } => MaterialSpec::Dielectric {
            ior: ior as f32,
            fresnel: match fresnel {
                Fresnel::Schlick => FresnelFormula::Schlick,
                Fresnel::Exact => FresnelFormula::Exact,
            },
        },
        BsdfDescription::Phong {
            reflectance,
            exponent,
        } => MaterialSpec::Phong {
            reflectance: rgb(reflectance),
            exponent: exponent as f32,
        },
        BsdfDescription::Glossy {
            diffuse,
            specular,
            exponent,
        } => MaterialSpec::Glossy {
            diffuse: rgb(diffuse),
            specular: rgb(specular),
            exponent: exponent as f32,
        },
    }
}

fn albedo(bsdf: &BsdfDescription) -> Albedo {
    let (tinted, plain) = match *bsdf {
        BsdfDescription::Black => (DVec3::ZERO, DVec3::ZERO),
        BsdfDescription::Lambertian { reflectance }
        | BsdfDescription::OrenNayar { reflectance, .. }
        | BsdfDescription::Mirror { reflectance }
        | BsdfDescription::Phong { reflectance, .. } => (reflectance, DVec3::ZERO),
        BsdfDescription::Glossy {
            diffuse, specular, ..
        } => (diffuse, specular),
        BsdfDescription::Dielectric { .. } => (DVec3::ZERO, DVec3::ONE),
    };
    Albedo {
        tinted: tinted.as_vec3().to_array(),
        plain: plain.as_vec3().to_array(),
    }
}

/// What the scene and the settings need.
fn features(tables: &Tables<'_>, lights: &LightTable, settings: &RenderSettings) -> Features {
    let whitted = settings.integrator == IntegratorKind::Whitted;
    let used = |kind: MaterialKind| tables.used[kind as usize];
    let scatters = MaterialKind::ALL
        .into_iter()
        .any(|kind| used(kind) && !kind.is_specular());
    // With direction sampling alone, only lights that no ray can hit are sampled.
    let sampled = if settings.strategy == Strategy::Bsdf && !whitted {
        lights.kinds() & kinds::POINT
    } else {
        lights.kinds()
    };
    let deep = settings.max_depth != Some(1);
    let shadow_rays = sampled != 0 && scatters && deep;
    let mut features = Features(lights.kinds());
    let mut add = |when: bool, feature: Features| {
        if when {
            features |= feature;
        }
    };
    add(!tables.geometry.triangles.is_empty(), Features::TRIANGLES);
    add(!tables.geometry.spheres.is_empty(), Features::SPHERES);
    for (kind, feature) in [
        (MaterialKind::Lambertian, Features::LAMBERTIAN),
        (MaterialKind::OrenNayar, Features::OREN_NAYAR),
        (MaterialKind::Mirror, Features::MIRROR),
        (MaterialKind::Dielectric, Features::DIELECTRIC),
        (MaterialKind::Phong, Features::PHONG),
        (MaterialKind::Glossy, Features::GLOSSY),
    ] {
        add(used(kind) && deep, feature);
    }
    let shown = deep || settings.aux;
    let smooth = !tables.surfaces.shading_normals.is_empty();
    add(smooth && shown, Features::MESH_NORMALS);
    let textured = tables.shows_textures.contains(&true);
    add(textured && shown, Features::TEXTURES);
    add(tables.has_partial && deep, Features::OPACITY);
    add(shadow_rays, Features::SHADOW_RAYS);
    let hittable = lights.kinds() & (kinds::FLAT | kinds::SPHERE | kinds::BACKGROUND) != 0;
    add(
        shadow_rays && hittable && !whitted && settings.strategy == Strategy::Mis,
        Features::MIS,
    );
    add(
        settings.sampler == SamplerKind::Stratified,
        Features::STRATIFIED,
    );
    add(settings.sampler == SamplerKind::Sobol, Features::SOBOL);
    add(
        shadow_rays && settings.light_samples > 1,
        Features::LIGHT_SAMPLES,
    );
    add(
        settings.glass_splits > 0 && !whitted && used(MaterialKind::Dielectric) && deep,
        Features::GLASS_SPLITS,
    );
    add(whitted, Features::WHITTED);
    add(!settings.supersamples(), Features::PIXEL_CENTRES);
    add(
        shadow_rays && settings.transparent_shadows && used(MaterialKind::Dielectric),
        Features::TRANSPARENT_SHADOWS,
    );
    add(settings.aux, Features::AUX);
    add(
        settings.shadow_bias.is_some() && deep,
        Features::SHADOW_BIAS,
    );
    if settings.force_features {
        features |= Features::SCENE;
    }
    features
}
