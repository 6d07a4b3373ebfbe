//! Test scenes in code.

use std::path::PathBuf;

use glam::DVec3;
use wavepath::scene::{
    BsdfDescription, CameraDescription, EmissionDescription, FilmDescription, Fresnel,
    MaterialDescription, MaterialId, Mesh, PointLightDescription, Projection, RenderDefaults,
    SceneDescription, ShapeDescription, ShapeGeometry,
};

/// Grey Lambertian.
pub(crate) fn lambertian(reflectance: f64) -> BsdfDescription {
    BsdfDescription::Lambertian {
        reflectance: DVec3::splat(reflectance),
    }
}

/// Grey perfect mirror.
pub(crate) fn mirror(reflectance: f64) -> BsdfDescription {
    BsdfDescription::Mirror {
        reflectance: DVec3::splat(reflectance),
    }
}

/// Glass with exact Fresnel reflectance.
pub(crate) fn glass(ior: f64) -> BsdfDescription {
    BsdfDescription::Dielectric {
        ior,
        fresnel: Fresnel::Exact,
    }
}

/// A scene that grows by calls; black background, a film of one pixel, and no camera at first.
#[derive(Debug, Clone)]
pub(crate) struct SceneBuilder(SceneDescription);

impl SceneBuilder {
    pub(crate) fn new() -> Self {
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
            render: RenderDefaults::default(),
            mesh_files: Vec::new(),
            warnings: Vec::new(),
        })
    }

    /// A material that only scatters.
    pub(crate) fn matter(&mut self, bsdf: BsdfDescription) -> MaterialId {
        self.material(bsdf, None)
    }

    /// A material that also emits grey light, on the side of the geometric normal alone.
    pub(crate) fn one_sided(&mut self, bsdf: BsdfDescription, radiance: f64) -> MaterialId {
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
    pub(crate) fn two_sided(&mut self, bsdf: BsdfDescription, radiance: f64) -> MaterialId {
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

    /// Corners in order; the normal is that of the first three.
    pub(crate) fn quad(&mut self, corners: [[f64; 3]; 4], material: MaterialId) {
        self.shape(ShapeGeometry::Quad(corners.map(DVec3::from)), material);
    }

    /// The square x, y ∈ [−half, half] at this height, facing up.
    pub(crate) fn floor(&mut self, half: f64, z: f64, material: MaterialId) {
        let corners = [
            [-half, -half, z],
            [half, -half, z],
            [half, half, z],
            [-half, half, z],
        ];
        self.quad(corners, material);
    }

    /// As [`Self::floor`], facing down.
    pub(crate) fn ceiling(&mut self, half: f64, z: f64, material: MaterialId) {
        let corners = [
            [-half, -half, z],
            [-half, half, z],
            [half, half, z],
            [half, -half, z],
        ];
        self.quad(corners, material);
    }

    pub(crate) fn sphere(&mut self, center: [f64; 3], radius: f64, material: MaterialId) {
        self.shape(
            ShapeGeometry::Sphere {
                center: center.into(),
                radius,
            },
            material,
        );
    }

    pub(crate) fn mesh(
        &mut self,
        positions: Vec<DVec3>,
        faces: Vec<[u32; 3]>,
        material: MaterialId,
    ) {
        let mesh = Mesh {
            positions,
            faces,
            ..Mesh::default()
        };
        self.shape(ShapeGeometry::Mesh(mesh), material);
    }

    /// Twelve triangles: the unit cube turned about a skew axis, scaled, then moved.
    pub(crate) fn skew_cube(&mut self, size: f64, corner: DVec3, material: MaterialId) {
        let turn = glam::DQuat::from_scaled_axis(DVec3::new(0.3, 1.1, -0.7));
        let bit = |i: u32, k: u32| f64::from(i >> k & 1);
        let positions = (0..8)
            .map(|i| corner + turn * DVec3::new(bit(i, 0), bit(i, 1), bit(i, 2)) * size)
            .collect();
        let quads = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let faces = quads
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect();
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

    pub(crate) fn point_light(&mut self, position: [f64; 3], intensity: f64) {
        let intensity = DVec3::splat(intensity);
        self.0.point_lights.push(PointLightDescription {
            position: position.into(),
            intensity,
        });
    }

    pub(crate) fn background(&mut self, radiance: f64) {
        self.0.background = DVec3::splat(radiance);
    }

    /// A camera of which every sample looks at the same point.
    pub(crate) fn aim(&mut self, eye: [f64; 3], at: [f64; 3]) {
        self.window(eye, at, [0.0; 3], [0.0; 3]);
    }

    /// A camera that looks through a fixed image plane.
    pub(crate) fn window(
        &mut self,
        eye: [f64; 3],
        top_left: [f64; 3],
        right: [f64; 3],
        down: [f64; 3],
    ) {
        let name = format!("camera {}", self.0.cameras.len());
        let projection = Projection::Plane {
            eye: eye.into(),
            top_left: top_left.into(),
            right: right.into(),
            down: down.into(),
        };
        self.0.cameras.push(CameraDescription { name, projection });
    }

    pub(crate) fn build(&self) -> SceneDescription {
        self.0.clone()
    }
}

/// A closed room that emits 1 everywhere, a cube or a sphere, seen from within: radiance is the same
/// everywhere (a furnace). A ray that leaks finds a background of 1e9.
pub(crate) fn glowing_room(
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

/// A box of many materials with every kind of light, seen from within.
pub(crate) fn busy_room() -> SceneBuilder {
    let mut scene = SceneBuilder::new();
    let reflectance = DVec3::new(0.8, 0.6, 0.3);
    let white = scene.matter(lambertian(0.7));
    let rough = scene.matter(BsdfDescription::OrenNayar {
        reflectance,
        sigma: 0.5,
    });
    let glossy = scene.matter(BsdfDescription::Phong {
        reflectance,
        exponent: 8.0,
    });
    let silver = scene.matter(mirror(0.9));
    let clear = scene.matter(glass(1.5));
    let lamp = scene.one_sided(lambertian(0.2), 4.0);
    let bulb = scene.one_sided(BsdfDescription::Black, 6.0);
    scene.floor(2.0, 0.0, white);
    scene.ceiling(2.0, 3.0, rough);
    scene.ceiling(1.0, 2.9, lamp);
    let wall = |scene: &mut SceneBuilder, a: [f64; 2], b: [f64; 2], material: MaterialId| {
        let corners = [(a, 0.0), (b, 0.0), (b, 3.0), (a, 3.0)].map(|([x, y], z)| [x, y, z]);
        scene.quad(corners, material);
    };
    wall(&mut scene, [-2.0, -2.0], [2.0, -2.0], glossy);
    wall(&mut scene, [2.0, -2.0], [2.0, 2.0], white);
    wall(&mut scene, [2.0, 2.0], [-2.0, 2.0], rough);
    // The fourth wall is open to the sky.
    scene.background(0.3);
    scene.sphere([0.8, 0.9, 0.8], 0.5, clear);
    scene.sphere([0.5, -0.8, 0.7], 0.6, silver);
    scene.sphere([1.2, 0.2, 2.2], 0.3, bulb);
    scene.point_light([-0.5, 1.0, 1.5], 2.0);
    scene.window(
        [-2.5, 0.0, 1.5],
        [-1.5, 1.0, 2.5],
        [0.0, -2.0, 0.0],
        [0.0, 0.0, -2.0],
    );
    scene
}
