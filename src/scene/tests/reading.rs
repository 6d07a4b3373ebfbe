//! Sound scenes are read as written.

use glam::DVec3;

use super::*;

#[test]
fn a_valid_scene_is_read_as_written() {
    let scene = parse_valid(&[]).unwrap();
    assert_eq!(scene.source, Path::new("valid.toml"));
    assert_eq!(
        scene.film,
        FilmDescription {
            width: 8,
            height: 6,
            exposure: 0.0
        }
    );
    assert_eq!(scene.cameras.len(), 2);
    assert_eq!(
        scene.cameras[0].projection,
        Projection::LookAt {
            eye: DVec3::new(0.0, -4.0, 1.0),
            target: DVec3::Z,
            up: DVec3::Z,
            fov_y: 40.0
        }
    );
    let names: Vec<_> = scene.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(
        names,
        ["grey", "rough", "glass", "shiny", "lamp"],
        "in the order of the file"
    );
    assert_eq!(
        scene.materials[2].bsdf,
        BsdfDescription::Dielectric {
            ior: 1.5,
            fresnel: Fresnel::Exact
        }
    );
    assert_eq!(
        scene.materials[4].emission,
        Some(EmissionDescription {
            radiance: DVec3::new(1.0, 2.0, 3.0),
            two_sided: false
        })
    );
    assert_eq!(scene.shapes[0].material, MaterialId(2));
    assert!(
        matches!(&scene.shapes[3].geometry, ShapeGeometry::Mesh(mesh) if mesh.faces.len() == 64)
    );
    assert_eq!(scene.point_lights[0].intensity, DVec3::splat(5.0));
    assert_eq!(scene.background, DVec3::ZERO);
    assert_eq!(scene.render.spp, Some(4));
    assert!(scene.warnings.is_empty());
}

#[test]
fn the_default_camera_comes_first_and_the_others_keep_their_order() {
    let names = |scene: SceneDescription| {
        scene
            .cameras
            .into_iter()
            .map(|camera| camera.name)
            .collect::<Vec<_>>()
    };
    let three = VALID.replace(
        "[materials.grey]",
        "[cameras.alpha]\neye = [0, 0, 0]\nlook_at = [1, 0, 0]\nup = [0, 0, 1]\nfov = 40\n[materials.grey]",
    );
    let choose = |name: &str| {
        let text = three.replace("camera = \"front\"", &format!("camera = \"{name}\""));
        names(parse(text, Path::new("x.toml"), &[]).unwrap())
    };
    assert_eq!(choose("front"), ["front", "plane", "alpha"]);
    assert_eq!(choose("alpha"), ["alpha", "front", "plane"]);
    let unsaid = three.replace("camera = \"front\"", "");
    assert_eq!(
        names(parse(unsaid, Path::new("x.toml"), &[]).unwrap()),
        ["front", "plane", "alpha"]
    );
}

#[test]
fn infinite_sigma_is_allowed() {
    let scene = parse_valid(&["materials.rough.sigma=inf"]).unwrap();
    assert!(matches!(
        scene.materials[1].bsdf,
        BsdfDescription::OrenNayar { sigma, .. } if sigma == f64::INFINITY
    ));
}

#[test]
fn any_material_may_emit_on_both_sides() {
    let scene = parse_valid(&[
        "materials.glass.emission=2",
        "materials.glass.two_sided=true",
    ]);
    assert_eq!(
        scene.unwrap().materials[2].emission,
        Some(EmissionDescription {
            radiance: DVec3::splat(2.0),
            two_sided: true
        })
    );
}

#[test]
fn a_face_written_twice_is_removed_with_a_warning() {
    let text = VALID.replace(
        "faces = [[0, 1, 2], ",
        "faces = [[0, 1, 2], [1, 2, 0], [2, 0, 1], ",
    );
    let scene = parse(text, Path::new("a.toml"), &[]).unwrap();
    assert_eq!(
        scene.warnings,
        ["a.toml:54:1: 2 faces equal to another removed"]
    );
    assert!(
        matches!(&scene.shapes[2].geometry, ShapeGeometry::Mesh(mesh) if mesh.faces.len() == 2)
    );
}

#[test]
fn the_scene_of_the_format_description_loads() {
    let documentation = include_str!("../mod.rs");
    let example = documentation
        .split("//! ```toml\n")
        .nth(1)
        .and_then(|rest| rest.split("//! ```\n").next())
        .unwrap();
    let text: String = example
        .lines()
        .map(|line| line.trim_start_matches("//!").trim_start().to_owned() + "\n")
        .collect();
    let scene = parse(text, Path::new("example.toml"), &[]).unwrap();
    assert_eq!(scene.shapes.len(), 2);
    assert!(matches!(
        scene.shapes[1].geometry,
        ShapeGeometry::Quad([a, b, c, _]) if (b - a).cross(c - a).z < 0.0
    ));
}

#[test]
fn the_scene_of_the_readme_loads() {
    let readme = include_str!("../../../README.md");
    let example = readme
        .split("```toml\n")
        .nth(1)
        .and_then(|rest| rest.split("```\n").next())
        .unwrap();
    let scene = parse(example, Path::new("example.toml"), &[]).unwrap();
    assert_eq!(scene.shapes.len(), 2);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn meshes_of_any_size_are_made_by_their_names() {
    for (mesh, faces) in [
        ("mesh = \"hairball\"\ntriangles = 1000", 1_000),
        ("mesh = \"terrain\"\ntriangles = 1800\nseed = 3", 1_800),
        ("mesh = \"sponge\"\ntriangles = 2500", 2_112),
        ("mesh = \"soup\"", 100_000),
    ] {
        let text = VALID.replace(
            "mesh = \"torus\"\nmaterial = \"shiny\"\nsegments = 8\nsides = 4",
            &format!("{mesh}\nmaterial = \"shiny\""),
        );
        let scene = parse(text, Path::new("a.toml"), &[]).unwrap();
        let ShapeGeometry::Mesh(made) = &scene.shapes[3].geometry else {
            panic!("{mesh} is no mesh");
        };
        assert_eq!(made.faces.len(), faces, "{mesh}");
        assert_eq!(scene.warnings, Vec::<String>::new(), "{mesh}");
    }
}
