//! Scenes in code.

use std::path::PathBuf;

use glam::DVec3;

use crate::scene::{
    BsdfDescription, CameraDescription, EmissionDescription, FilmDescription, Fresnel,
    MaterialDescription, MaterialId, Mesh, PointLightDescription, Projection, RenderDefaults,
    SceneDescription, ShapeDescription, ShapeGeometry, TextureDescription, TextureId, procedural,
};

/// Grey Lambertian.
pub fn lambertian(reflectance: f64) -> BsdfDescription {
    BsdfDescription::Lambertian {
        reflectance: DVec3::splat(reflectance),
    }
}

/// Grey perfect mirror.
pub fn mirror(reflectance: f64) -> BsdfDescription {
    BsdfDescription::Mirror {
        reflectance: DVec3::splat(reflectance),
    }
}

/// Glass with exact Fresnel reflectance.
pub fn glass(ior: f64) -> BsdfDescription {
    BsdfDescription::Dielectric {
        ior,
        fresnel: Fresnel::Exact,
    }
}

/// A scene that grows by calls; black background, a film of one pixel, and no camera at first.
#[derive(Debug, Clone)]
pub struct SceneBuilder(SceneDescription);

impl Default for SceneBuilder {
    fn default() -> Self {
        Self::new()
    }
}

impl SceneBuilder {
    /// Nothing.
    pub fn new() -> Self {
        Self(SceneDescription {
            source: PathBuf::from("test"),
            film: FilmDescription {
                width: 1,
                height: 1,
                exposure: 0.0,
            },
            cameras: Vec::new(),
            materials: Vec::new(),
            textures: Vec::new(),
            shapes: Vec::new(),
            point_lights: Vec::new(),
            background: DVec3::ZERO,
            closed_form: None,
            render: RenderDefaults::default(),
            mesh_files: Vec::new(),
            warnings: Vec::new(),
        })
    }

    /// A material that only scatters.
    pub fn matter(&mut self, bsdf: BsdfDescription) -> MaterialId {
        self.material(bsdf, None)
    }

    /// A material that also emits grey light, on the side of the geometric normal alone.
    pub fn one_sided(&mut self, bsdf: BsdfDescription, radiance: f64) -> MaterialId {
        let radiance = DVec3::splat(radiance);
        self.material(
            bsdf,
            Some(EmissionDescription {
                radiance,
                two_sided: false,
            }),
        )
    }

    /// A material that also emits grey light, on both sides.
    pub fn two_sided(&mut self, bsdf: BsdfDescription, radiance: f64) -> MaterialId {
        let radiance = DVec3::splat(radiance);
        self.material(
            bsdf,
            Some(EmissionDescription {
                radiance,
                two_sided: true,
            }),
        )
    }

    fn material(
        &mut self,
        bsdf: BsdfDescription,
        emission: Option<EmissionDescription>,
    ) -> MaterialId {
        let id = MaterialId(self.0.materials.len() as u32);
        let name = format!("material {}", id.0);
        self.0.materials.push(MaterialDescription {
            emission,
            ..MaterialDescription::new(name, bsdf)
        });
        id
    }

    /// Lets only this share of the light meet a material's surfaces.
    pub fn thin(&mut self, material: MaterialId, opacity: f64) -> MaterialId {
        self.0.materials[material.0 as usize].opacity = opacity;
        material
    }

    /// A picture of rows from the top.
    pub fn texture(&mut self, width: u32, texels: Vec<[u8; 3]>) -> TextureId {
        let id = TextureId(self.0.textures.len() as u32);
        self.0.textures.push(TextureDescription {
            name: format!("texture {}", id.0),
            width,
            height: texels.len() as u32 / width,
            texels,
        });
        id
    }

    /// Puts a texture on a material's reflectance.
    pub fn paint(&mut self, material: MaterialId, texture: TextureId) -> MaterialId {
        self.0.materials[material.0 as usize].reflectance_texture = Some(texture);
        material
    }

    /// Puts a texture on a material's opacity.
    pub fn cut_out(&mut self, material: MaterialId, texture: TextureId) -> MaterialId {
        self.0.materials[material.0 as usize].opacity_texture = Some(texture);
        material
    }

    /// Corners in order; the normal is that of the first three.
    pub fn quad(&mut self, corners: [[f64; 3]; 4], material: MaterialId) {
        self.shape(ShapeGeometry::Quad(corners.map(DVec3::from)), material);
    }

    /// The square x, y ∈ [−half, half] at this height, facing up.
    pub fn floor(&mut self, half: f64, z: f64, material: MaterialId) {
        let corners = [
            [-half, -half, z],
            [half, -half, z],
            [half, half, z],
            [-half, half, z],
        ];
        self.quad(corners, material);
    }

    /// As [`Self::floor`], facing down.
    pub fn ceiling(&mut self, half: f64, z: f64, material: MaterialId) {
        let corners = [
            [-half, -half, z],
            [-half, half, z],
            [half, half, z],
            [half, -half, z],
        ];
        self.quad(corners, material);
    }

    /// A sphere.
    pub fn sphere(&mut self, center: [f64; 3], radius: f64, material: MaterialId) {
        self.shape(
            ShapeGeometry::Sphere {
                center: center.into(),
                radius,
            },
            material,
        );
    }

    /// Triangles by indices of their corners.
    pub fn mesh(&mut self, positions: Vec<DVec3>, faces: Vec<[u32; 3]>, material: MaterialId) {
        let mesh = Mesh {
            positions,
            faces,
            ..Mesh::default()
        };
        self.attributed_mesh(mesh, material);
    }

    /// A mesh with whatever its corners have.
    pub fn attributed_mesh(&mut self, mesh: Mesh, material: MaterialId) {
        self.shape(ShapeGeometry::Mesh(mesh), material);
    }

    /// Twelve triangles: the unit cube turned about a skew axis, scaled, then moved.
    pub fn skew_cube(&mut self, size: f64, corner: DVec3, material: MaterialId) {
        let turn = glam::DQuat::from_scaled_axis(DVec3::new(0.3, 1.1, -0.7));
        let Mesh {
            positions, faces, ..
        } = procedural::cuboid(DVec3::ONE);
        let placed = |p: DVec3| corner + turn * (p + 0.5) * size;
        let positions = positions.into_iter().map(placed).collect();
        self.mesh(positions, faces, material);
    }

    fn shape(&mut self, geometry: ShapeGeometry, material: MaterialId) {
        let name = format!("shape {}", self.0.shapes.len());
        self.0.shapes.push(ShapeDescription {
            name,
            geometry,
            material,
        });
    }

    /// A grey point light of this radiant intensity.
    pub fn point_light(&mut self, position: [f64; 3], intensity: f64) {
        let intensity = DVec3::splat(intensity);
        self.0.point_lights.push(PointLightDescription {
            position: position.into(),
            intensity,
        });
    }

    /// Grey radiance from wherever nothing is.
    pub fn background(&mut self, radiance: f64) {
        self.0.background = DVec3::splat(radiance);
    }

    /// A camera of which every sample looks at the same point.
    pub fn aim(&mut self, eye: [f64; 3], at: [f64; 3]) {
        self.window(eye, at, [0.0; 3], [0.0; 3]);
    }

    /// A camera that looks through a fixed image plane.
    pub fn window(&mut self, eye: [f64; 3], top_left: [f64; 3], right: [f64; 3], down: [f64; 3]) {
        self.camera(Projection::Plane {
            eye: eye.into(),
            top_left: top_left.into(),
            right: right.into(),
            down: down.into(),
        });
    }

    /// A camera in `eye` that looks at `target` with +y up, and sees `fov_y` degrees from bottom to top.
    pub fn look_at(&mut self, eye: DVec3, target: DVec3, fov_y: f64) {
        let projection = Projection::LookAt {
            eye,
            target,
            up: DVec3::Y,
            fov_y,
        };
        self.camera(projection);
    }

    fn camera(&mut self, projection: Projection) {
        let name = format!("camera {}", self.0.cameras.len());
        self.0.cameras.push(CameraDescription { name, projection });
    }

    /// The scene so far.
    pub fn build(&self) -> SceneDescription {
        self.0.clone()
    }
}

/// A closed room that emits 1 everywhere, a cube or a sphere, seen from within: radiance is the same
/// everywhere (a furnace). A ray that leaks finds a background of 1e9.
pub fn glowing_room(
    bsdf: BsdfDescription,
    size: f64,
    place: DVec3,
    is_sphere: bool,
) -> SceneBuilder {
    let mut scene = SceneBuilder::new();
    let wall = scene.two_sided(bsdf, 1.0);
    let turn = glam::DQuat::from_scaled_axis(DVec3::new(0.3, 1.1, -0.7));
    let eye = if is_sphere {
        scene.sphere(place.into(), size, wall);
        place + DVec3::splat(0.2) * size
    } else {
        scene.skew_cube(size, place, wall);
        place + turn * DVec3::splat(0.4) * size
    };
    let at = eye + DVec3::new(0.3, -0.5, 0.7) * size;
    scene.window(eye.into(), at.into(), [size, 0.0, 0.0], [0.0, -size, 0.0]);
    scene.background(1e9);
    scene
}
