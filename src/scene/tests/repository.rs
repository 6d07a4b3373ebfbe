//! The scenes that come with the program are what they claim to be.

use std::path::PathBuf;

use glam::DVec3;

use super::*;

fn scenes_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

fn repository_scene(name: &str) -> SceneDescription {
    load(&scenes_folder().join(name), &[]).unwrap()
}

#[test]
fn every_scene_of_the_repository_loads_without_warnings() {
    let mut count = 0;
    for entry in fs::read_dir(scenes_folder()).unwrap() {
        let path = entry.unwrap().path();
        if path
            .extension()
            .is_some_and(|extension| extension == "toml")
        {
            let scene = load(&path, &[]).unwrap_or_else(|error| panic!("{error}"));
            assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
            assert!(
                fs::read_to_string(&path).unwrap().starts_with("# "),
                "says what it shows"
            );
            count += 1;
        }
    }
    assert_eq!(count, 19);
}

/// Corners of all triangles of a shape, quads split from their first corner.
fn triangles(shape: &ShapeDescription) -> Vec<[DVec3; 3]> {
    match &shape.geometry {
        ShapeGeometry::Mesh(mesh) => mesh
            .faces
            .iter()
            .map(|face| face.map(|index| mesh.positions[index as usize]))
            .collect(),
        &ShapeGeometry::Quad([a, b, c, d]) => vec![[a, b, c], [a, c, d]],
        ShapeGeometry::Sphere { .. } => Vec::new(),
    }
}

fn shape<'a>(scene: &'a SceneDescription, name: &str) -> &'a ShapeDescription {
    scene
        .shapes
        .iter()
        .find(|shape| shape.name == name)
        .unwrap()
}

fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

#[test]
fn the_hexagonal_room_has_its_specified_geometry() {
    let scene = repository_scene("hexroom.toml");
    let is_room = |shape: &&ShapeDescription| {
        shape.name == "floor" || shape.name == "ceiling" || shape.name.starts_with("wall-")
    };
    let room: Vec<_> = scene
        .shapes
        .iter()
        .filter(is_room)
        .flat_map(triangles)
        .collect();
    assert_eq!(room.len(), 20);
    // The prism over the hexagon (a rectangle and two triangles), seen from inside.
    let volume: f64 = room.iter().map(|&[a, b, c]| -a.dot(b.cross(c)) / 6.0).sum();
    let hexagon = 0.5 * 12.0 * 3.0 + 10.0 * 12.0 + 0.5 * 12.0 * 3.0;
    assert!((volume - 10.0 * hexagon).abs() < 1e-9, "{volume}");
    let center = DVec3::new(5.0, 0.0, 0.0);
    assert!(
        room.iter()
            .all(|&face| normal(face).dot(center - face[0]) > 0.0)
    );

    let light = shape(&scene, "light");
    for face in triangles(light) {
        assert!(normal(face).z < 0.0 && normal(face).x == 0.0 && normal(face).y == 0.0);
        assert!(face.iter().all(|corner| corner.z == 4.99));
    }
    let area: f64 = triangles(light)
        .into_iter()
        .map(|face| normal(face).length() / 2.0)
        .sum();
    assert!((area - 4.0).abs() < 1e-14);
    let light_material = &scene.materials[light.material.0 as usize];
    assert_eq!(light_material.bsdf, BsdfDescription::Black);
    assert_eq!(
        light_material.emission,
        Some(EmissionDescription {
            radiance: DVec3::splat(40.0),
            two_sided: false
        })
    );

    let tetrahedron = triangles(shape(&scene, "tetrahedron"));
    assert_eq!(tetrahedron.len(), 4);
    let inside = DVec3::new(6.6, 2.3, -4.0);
    assert!(
        tetrahedron
            .iter()
            .all(|&face| normal(face).dot(face[0] - inside) > 0.0)
    );
    assert_eq!(
        tetrahedron
            .iter()
            .filter(|face| face.iter().all(|p| p.z == -5.0))
            .count(),
        1
    );

    let spheres = scene
        .shapes
        .iter()
        .filter(|shape| matches!(shape.geometry, ShapeGeometry::Sphere { .. }));
    assert_eq!(spheres.count(), 3);
    assert_eq!(scene.shapes.len(), 8 + 1 + 3 + 1);

    let eyes: Vec<_> = scene
        .cameras
        .iter()
        .map(|camera| (camera.name.as_str(), camera.projection.plane(800, 800)))
        .collect();
    let plane = |x: f64| {
        [
            DVec3::new(x, 0.0, 0.0),
            DVec3::new(0.0, 1.0, 1.0),
            DVec3::new(0.0, -2.0, 0.0),
            DVec3::new(0.0, 0.0, -2.0),
        ]
    };
    assert_eq!(eyes, [("1", plane(-1.0)), ("2", plane(-3.0))]);
    assert_eq!(
        (scene.film.width, scene.film.height, scene.render.spp),
        (800, 800, Some(160))
    );
}

#[test]
fn variants_of_the_hexagonal_room_differ_where_they_say() {
    let base = repository_scene("hexroom.toml");
    let material = |scene: &SceneDescription, name: &str| {
        let found = scene
            .materials
            .iter()
            .find(|material| material.name == name);
        found.unwrap().bsdf
    };
    let blue = DVec3::new(0.30, 0.60, 0.85);
    let glass = |ior, fresnel| BsdfDescription::Dielectric { ior, fresnel };
    let rough = |sigma| BsdfDescription::OrenNayar {
        reflectance: blue,
        sigma,
    };
    assert_eq!(material(&base, "glass"), glass(1.5, Fresnel::Schlick));
    assert_eq!(material(&base, "tetrahedron"), rough(0.5));
    let exact = repository_scene("hexroom-exact.toml");
    assert_eq!(material(&exact, "glass"), glass(1.5, Fresnel::Exact));
    assert_eq!(
        material(&exact, "tetrahedron"),
        BsdfDescription::Lambertian { reflectance: blue }
    );
    for ior in [1.5, 1.75] {
        let scene = repository_scene(&format!("hexroom-ior-{ior}.toml"));
        assert_eq!(material(&scene, "glass"), glass(ior, Fresnel::Schlick));
    }
    for sigma in [0.0, 0.3, 0.7, f64::INFINITY] {
        let scene = repository_scene(&format!("hexroom-oren-nayar-{sigma}.toml"));
        assert_eq!(material(&scene, "tetrahedron"), rough(sigma));
    }
    for spp in [1, 100, 400] {
        assert_eq!(
            repository_scene(&format!("hexroom-{spp}spp.toml"))
                .render
                .spp,
            Some(spp)
        );
    }
    let shadows = repository_scene("hexroom-transparent-shadows.toml").render;
    assert_eq!(
        (shadows.transparent_shadows, shadows.spp),
        (Some(true), Some(160))
    );
    let whitted = repository_scene("hexroom-whitted.toml").render;
    assert_eq!(whitted.integrator, Some(IntegratorKind::Whitted));
    assert_eq!(whitted.spp, Some(1));
}

#[test]
fn the_blocks_of_the_cornell_box_have_their_volume() {
    let scene = repository_scene("cornell.toml");
    // Base area of the published corners (x, z), in square metres, times the height. The open
    // bottom lies in y = 0 and adds nothing to the sum over faces.
    let area = |corners: [[f64; 2]; 4]| {
        let [[ax, az], [bx, bz], [cx, cz], [dx, dz]] = corners;
        0.5e-6 * ((cx - ax) * (dz - bz) - (cz - az) * (dx - bx)).abs()
    };
    let short = [[130.0, 65.0], [82.0, 225.0], [240.0, 272.0], [290.0, 114.0]];
    let tall = [
        [423.0, 247.0],
        [265.0, 296.0],
        [314.0, 456.0],
        [472.0, 406.0],
    ];
    for (name, base, height) in [("short-block", short, 0.165), ("tall-block", tall, 0.330)] {
        let volume: f64 = triangles(shape(&scene, name))
            .into_iter()
            .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
            .sum();
        assert!(
            (volume / (area(base) * height) - 1.0).abs() < 1e-12,
            "{name}: {volume}"
        );
    }
    let light = triangles(shape(&scene, "light"));
    assert!(light.into_iter().all(|face| normal(face).y < 0.0));
}
