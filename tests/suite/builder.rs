//! Test scenes in code.

use glam::DVec3;
pub(crate) use wavepath::report::stability::scenes::{
    SceneBuilder, glass, glowing_room, lambertian, mirror,
};
use wavepath::scene::{BsdfDescription, MaterialId, Mesh, procedural};

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
