//! Test scenes in code.

use std::path::PathBuf;

use glam::DVec3;
use wavepath::scene::{
    BsdfDescription, CameraDescription, EmissionDescription, FilmDescription, Fresnel,
    MaterialDescription, MaterialId, Mesh, PointLightDescription, Projection, RenderDefaults,
    SceneDescription, ShapeDescription, ShapeGeometry, TextureDescription, TextureId, procedural,
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
            closed_form: None,
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

    /// Lets only this share of the light meet a material's surfaces.
    pub(crate) fn thin(&mut self, material: MaterialId, opacity: f64) -> MaterialId {
        self.0.materials[material.0 as usize].opacity = opacity;
        material
    }

    /// A picture of rows from the top.
    pub(crate) fn texture(&mut self, width: u32, texels: Vec<[u8; 3]>) -> TextureId {
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
    pub(crate) fn paint(&mut self, material: MaterialId, texture: TextureId) -> MaterialId {
        self.0.materials[material.0 as usize].reflectance_texture = Some(texture);
        material
    }

    /// Puts a texture on a material's opacity.
    pub(crate) fn cut_out(&mut self, material: MaterialId, texture: TextureId) -> MaterialId {
        self.0.materials[material.0 as usize].opacity_texture = Some(texture);
        material
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
        self.attributed_mesh(mesh, material);
    }

    /// A mesh with whatever its corners have.
    pub(crate) fn attributed_mesh(&mut self, mesh: Mesh, material: MaterialId) {
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

/// The square x, y ∈ [−half, half] at this height, facing up, with texture coordinates that run from
/// [0, 0] to [1, 1] and the normal (unless zero) `normal` at every corner.
pub(crate) fn sheet(half: f64, z: f64, normal: [f32; 3]) -> Mesh {
    let corner = |x: f64, y: f64| DVec3::new(x * half, y * half, z);
    let faces = vec![[0, 1, 2], [0, 2, 3]];
    let has_normals = normal != [0.0; 3];
    Mesh {
        positions: vec![
            corner(-1.0, -1.0),
            corner(1.0, -1.0),
            corner(1.0, 1.0),
            corner(-1.0, 1.0),
        ],
        face_normals: if has_normals {
            vec![[0; 3]; 2]
        } else {
            Vec::new()
        },
        normals: if has_normals {
            vec![normal]
        } else {
            Vec::new()
        },
        uvs: vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
        face_uvs: faces.clone(),
        faces,
        ..Mesh::default()
    }
}

/// A coarse sphere with the normals of a true one, changed by `bend`, and texture coordinates.
pub(crate) fn ball(center: DVec3, radius: f64, bend: impl Fn(usize, DVec3) -> DVec3) -> Mesh {
    let mesh = procedural::icosphere(radius, 1);
    let unit = || mesh.positions.iter().map(|p| p.normalize());
    Mesh {
        normals: unit()
            .enumerate()
            .map(|(i, n)| bend(i, n).as_vec3().to_array())
            .collect(),
        face_normals: mesh.faces.clone(),
        uvs: unit()
            .map(|n| [2.0 * n.x as f32, 3.0 * n.z as f32])
            .collect(),
        face_uvs: mesh.faces.clone(),
        positions: mesh.positions.iter().map(|p| *p + center).collect(),
        ..mesh
    }
}

/// A room of smooth balls, textures and surfaces that are partly not there, of every material, with
/// flat, round and point lights and a sky.
pub(crate) fn adorned_room() -> SceneBuilder {
    let mut scene = SceneBuilder::new();
    let tinted = DVec3::new(0.8, 0.6, 0.3);
    let tiles = scene.texture(
        3,
        vec![
            [255, 40, 10],
            [90, 200, 160],
            [250, 250, 255],
            [0, 0, 0],
            [128, 128, 128],
            [10, 80, 240],
        ],
    );
    let holes = scene.texture(2, vec![[255; 3], [0; 3], [120, 200, 40], [255; 3]]);
    let gloss = |exponent: f64| BsdfDescription::Glossy {
        diffuse: DVec3::new(0.5, 0.3, 0.1),
        specular: DVec3::splat(0.4),
        exponent,
    };
    let rough = BsdfDescription::OrenNayar {
        reflectance: tinted,
        sigma: 0.5,
    };
    let phong = BsdfDescription::Phong {
        reflectance: tinted,
        exponent: 8.0,
    };
    let id = |_: usize, normal: DVec3| normal;

    let floor = scene.matter(lambertian(0.8));
    scene.paint(floor, tiles);
    scene.attributed_mesh(sheet(2.0, 0.0, [0.1, 0.0, 0.9]), floor);
    let plain = scene.matter(lambertian(0.6));
    scene.ceiling(2.0, 3.0, plain);
    // Balls in two rows, none of which hides the others.
    for (i, bsdf) in [gloss(20.0), rough, phong, mirror(0.9), glass(1.5)]
        .into_iter()
        .enumerate()
    {
        let material = scene.matter(bsdf);
        if i % 2 == 0 {
            scene.paint(material, tiles);
        }
        let center = DVec3::new(
            0.7 * (i % 2) as f64,
            0.7 * i as f64 - 1.4,
            0.5 + 0.3 * i as f64,
        );
        scene.attributed_mesh(ball(center, 0.4, id), material);
    }
    // A veil in front of half of them, a net above, and half a ball of glass.
    let veil = scene.matter(lambertian(0.7));
    scene.thin(veil, 0.4);
    scene.quad(
        [
            [-0.6, -1.0, 0.0],
            [-0.6, 0.4, 0.0],
            [-0.6, 0.4, 2.0],
            [-0.6, -1.0, 2.0],
        ],
        veil,
    );
    let net = scene.matter(gloss(5.0));
    scene.cut_out(net, holes);
    scene.paint(net, tiles);
    scene.attributed_mesh(sheet(1.2, 2.3, [0.0; 3]), net);
    let lamp = scene.one_sided(lambertian(0.2), 4.0);
    scene.ceiling(0.7, 2.9, lamp);
    // Primitives after the last triangle must not take its attributes for theirs.
    let tile = scene.matter(lambertian(0.5));
    scene.paint(tile, tiles);
    scene.attributed_mesh(sheet(0.3, 2.6, [0.3, 0.2, -1.0]), tile);
    let bubble = scene.matter(glass(1.3));
    scene.thin(bubble, 0.5);
    scene.sphere([-0.8, 1.2, 0.6], 0.4, bubble);
    let soot = scene.matter(BsdfDescription::Black);
    scene.thin(soot, 0.7);
    scene.sphere([-0.5, -1.5, 0.5], 0.3, soot);

    let bulb = scene.two_sided(BsdfDescription::Black, 3.0);
    scene.thin(bulb, 0.5);
    scene.sphere([0.3, 1.7, 2.0], 0.2, bulb);
    scene.point_light([-1.0, 0.3, 1.2], 1.0);
    scene.background(0.3);
    scene.window(
        [-3.5, 0.0, 1.3],
        [-2.5, 0.9, 2.1],
        [0.0, -1.8, 0.0],
        [0.0, 0.0, -1.6],
    );
    scene
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
