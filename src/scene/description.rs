//! The scene as the user wrote it: plain, checked data in f64, meshes loaded.

use std::path::PathBuf;

use glam::DVec3;

use super::settings::RenderDefaults;

/// Index into [`SceneDescription::materials`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct MaterialId(pub u32);

/// Index into [`SceneDescription::textures`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TextureId(pub u32);

/// A whole scene after reading and checking; every invariant named here holds.
#[derive(Debug, Clone)]
pub struct SceneDescription {
    /// The file it came from.
    pub source: PathBuf,
    /// Size of the image and its display.
    pub film: FilmDescription,
    /// At least one; the first is the default.
    pub cameras: Vec<CameraDescription>,
    /// Materials, unique names.
    pub materials: Vec<MaterialDescription>,
    /// Pictures that materials refer to.
    pub textures: Vec<TextureDescription>,
    /// Everything with a surface.
    pub shapes: Vec<ShapeDescription>,
    /// Lights without a surface.
    pub point_lights: Vec<PointLightDescription>,
    /// Radiance of every escaped ray, W·sr⁻¹·m⁻², linear RGB, finite, ≥ 0.
    pub background: DVec3,
    /// The exact image, if the file states it.
    pub closed_form: Option<ClosedForm>,
    /// What the file asks for where the command line is silent.
    pub render: RenderDefaults,
    /// OBJ files that were read, in the order of the shapes.
    pub mesh_files: Vec<MeshFile>,
    /// Findings that did not stop the load, one line each, with their place.
    pub warnings: Vec<String>,
}

/// What the exact image of a scene is known to be. Errors are measured against it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ClosedForm {
    /// This radiance at every pixel, linear RGB.
    Constant(DVec3),
    /// What Lambertian surfaces reflect of the light that comes straight from one-sided polygons: nothing
    /// is in the way, and no surface that reflects sees another.
    Direct,
}

/// Image size and display transform.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilmDescription {
    /// Pixels across, 1 ..= 65 535.
    pub width: u32,
    /// Pixels down, 1 ..= 65 535.
    pub height: u32,
    /// Stops: PNG values are multiplied by 2^exposure before the sRGB curve.
    pub exposure: f64,
}

/// A named pinhole camera.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraDescription {
    /// Name, unique in the scene.
    pub name: String,
    /// How it looks.
    pub projection: Projection,
}

/// The two ways to write a pinhole camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// Eye and a fixed image plane: a sample at (s, t) ∈ [0, 1]², s to the right and t down,
    /// looks from `eye` through `top_left + s·right + t·down`. The image's aspect does not change it.
    Plane {
        /// Where rays start.
        eye: DVec3,
        /// The plane's top left corner as seen from the eye.
        top_left: DVec3,
        /// From the top left to the top right corner.
        right: DVec3,
        /// From the top left to the bottom left corner.
        down: DVec3,
    },
    /// Eye, target, up and field of view; the plane's aspect follows the film.
    LookAt {
        /// Where rays start.
        eye: DVec3,
        /// A point in the middle of the image.
        target: DVec3,
        /// Any vector not parallel to the view.
        up: DVec3,
        /// Vertical field of view in degrees, in (0, 180).
        fov_y: f64,
    },
}

impl Projection {
    /// Eye, top left corner, right and down edge of the image plane for a film of this shape.
    pub fn plane(&self, width: u32, height: u32) -> [DVec3; 4] {
        match *self {
            Self::Plane {
                eye,
                top_left,
                right,
                down,
            } => [eye, top_left, right, down],
            Self::LookAt {
                eye,
                target,
                up,
                fov_y,
            } => {
                let forward = (target - eye).normalize();
                let right = forward.cross(up).normalize();
                let down = forward.cross(right);
                let half_height = (fov_y.to_radians() * 0.5).tan();
                let half_width = half_height * f64::from(width) / f64::from(height);
                let top_left = eye + forward - right * half_width - down * half_height;
                [
                    eye,
                    top_left,
                    right * (2.0 * half_width),
                    down * (2.0 * half_height),
                ]
            }
        }
    }
}

/// A picture on a surface.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TextureDescription {
    /// Where it came from, for messages.
    pub name: String,
    /// Texels across, > 0.
    pub width: u32,
    /// Texels down, > 0.
    pub height: u32,
    /// Rows from the top, RGB with the sRGB curve; `width`·`height` of them.
    pub texels: Vec<[u8; 3]>,
}

/// A named material: how it scatters and what it emits.
#[derive(Debug, Clone, PartialEq)]
pub struct MaterialDescription {
    /// Name, unique in the scene.
    pub name: String,
    /// Scattering.
    pub bsdf: BsdfDescription,
    /// Multiplies the (diffuse) reflectance where a face has texture coordinates: looked up in linear
    /// RGB, bilinear between texel centres, repeating.
    pub reflectance_texture: Option<TextureId>,
    /// Share of the light that meets the surface, in [0, 1]; the rest goes straight on.
    pub opacity: f64,
    /// Multiplies the opacity: the linear mean of the channels.
    pub opacity_texture: Option<TextureId>,
    /// Emission, if any.
    pub emission: Option<EmissionDescription>,
}

impl MaterialDescription {
    /// Opaque, without textures or emission.
    pub fn new(name: impl Into<String>, bsdf: BsdfDescription) -> Self {
        Self {
            name: name.into(),
            bsdf,
            reflectance_texture: None,
            opacity: 1.0,
            opacity_texture: None,
            emission: None,
        }
    }
}

/// How a surface scatters. All surfaces scatter on both sides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BsdfDescription {
    /// Absorbs everything: a pure emitter, or a black body.
    Black,
    /// Lambert's law.
    Lambertian {
        /// Albedo per channel, in [0, 1].
        reflectance: DVec3,
    },
    /// Oren–Nayar's A/B model.
    OrenNayar {
        /// Lambertian albedo of the facets per channel, in [0, 1].
        reflectance: DVec3,
        /// Standard deviation of the facet slope angle in radians, in [0, ∞].
        sigma: f64,
    },
    /// Perfect specular reflection.
    Mirror {
        /// Reflectance per channel, in [0, 1].
        reflectance: DVec3,
    },
    /// Smooth boundary of glass; the geometric normal points out of the glass.
    Dielectric {
        /// Index of refraction inside over outside, > 0.
        ior: f64,
        /// Which reflectance formula.
        fresnel: Fresnel,
    },
    /// Normalised Phong lobe about the mirror direction, (n + 2)/(2π)·cosⁿ.
    Phong {
        /// Lobe weight per channel, in [0, 1].
        reflectance: DVec3,
        /// n, in [0, 1e6].
        exponent: f64,
    },
    /// Lambert's law and a normalised Phong lobe together (Lafortune and Willems, "Using the Modified
    /// Phong Reflectance Model for Physically Based Rendering", 1994).
    Glossy {
        /// Albedo of the diffuse part per channel, ≥ 0; `diffuse` + `specular` ≤ 1.
        diffuse: DVec3,
        /// Lobe weight per channel, ≥ 0.
        specular: DVec3,
        /// n, in [0, 1e6].
        exponent: f64,
    },
}

/// Reflectance formula of a dielectric.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fresnel {
    /// Schlick's approximation with the cosine on the thin side.
    Schlick,
    /// The exact unpolarised equations.
    Exact,
}

/// Emission of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EmissionDescription {
    /// Radiance, W·sr⁻¹·m⁻², linear RGB, finite, ≥ 0, the same in every direction.
    pub radiance: DVec3,
    /// Whether the back emits too. One-sided emitters emit on the side of the geometric normal.
    pub two_sided: bool,
}

/// A surface with one material per face.
#[derive(Debug, Clone)]
pub struct ShapeDescription {
    /// Name for messages; may be empty.
    pub name: String,
    /// Geometry.
    pub geometry: ShapeGeometry,
    /// Material of the whole shape.
    pub material: MaterialId,
}

/// Geometry in scene units (metres). The geometric normal of a triangle (a, b, c) is along (b − a) × (c − a).
#[derive(Debug, Clone)]
pub enum ShapeGeometry {
    /// An indexed triangle list; indices in range, coordinates finite, no zero-area face.
    Mesh(Mesh),
    /// A planar convex quad, corners in order; the normal as for the triangle of its first three.
    Quad([DVec3; 4]),
    /// A sphere; the normal points outward.
    Sphere {
        /// Centre.
        center: DVec3,
        /// Radius, > 0.
        radius: f64,
    },
}

/// An indexed triangle list.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Vertices.
    pub positions: Vec<DVec3>,
    /// Three vertex indices per face.
    pub faces: Vec<[u32; 3]>,
    /// Material per face where it differs from the shape's; empty otherwise.
    pub face_materials: Vec<MaterialId>,
    /// Shading normals, of any length.
    pub normals: Vec<[f32; 3]>,
    /// Three indices into `normals` per face, [`Mesh::ABSENT`] at corners without; empty if none has.
    pub face_normals: Vec<[u32; 3]>,
    /// Texture coordinates: u to the right, v up.
    pub uvs: Vec<[f32; 2]>,
    /// Three indices into `uvs` per face, [`Mesh::ABSENT`] at corners without; empty if none has.
    pub face_uvs: Vec<[u32; 3]>,
}

impl Mesh {
    /// The index of what a corner has not.
    pub const ABSENT: u32 = u32::MAX;
}

/// An OBJ file that was read: how large it is and how long that took.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshFile {
    /// The file.
    pub path: PathBuf,
    /// Bytes of its text, uncompressed.
    pub bytes: u64,
    /// Wall seconds from opening it to its triangles: reading, decompressing, parsing and triangulating, without
    /// materials, textures and the removal of faces that cannot be traced.
    pub seconds: f64,
    /// Vertices in the file.
    pub vertices: u64,
    /// Triangles in the file: two fewer per polygon than it has corners.
    pub triangles: u64,
}

/// An isotropic point light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointLightDescription {
    /// Where.
    pub position: DVec3,
    /// Radiant intensity, W·sr⁻¹, linear RGB, finite, ≥ 0.
    pub intensity: DVec3,
}
