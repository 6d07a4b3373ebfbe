//! Scene files as a whole: every mistake and its place, overrides, `extends`, the scenes that come
//! with the program, and hostile input.

use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;
use proptest::prelude::*;

use super::*;
use crate::error::{Error, ErrorKind};

/// A scene with one of each thing; mistakes are made by replacing parts of it.
const VALID: &str = r#"camera = "front"

[film]
width = 8
height = 6

[cameras.front]
eye = [0, -4, 1]
look_at = [0, 0, 1]
up = [0, 0, 1]
fov = 40

[cameras.plane]
eye = [-1, 0, 0]
top_left = [0, 1, 1]
right = [0, -2, 0]
down = [0, 0, -2]

[materials.grey]
type = "lambertian"
reflectance = 0.5

[materials.rough]
type = "oren-nayar"
reflectance = [0.1, 0.2, 0.3]
sigma = 0.5

[materials.glass]
type = "dielectric"
ior = 1.5

[materials.shiny]
type = "phong"
reflectance = 0.5
exponent = 10

[materials.lamp]
type = "emitter"
emission = [1, 2, 3]

[[shapes]]
name = "ball"
type = "sphere"
material = "glass"
center = [0, 0, 1]
radius = 1

[[shapes]]
name = "panel"
type = "quad"
material = "lamp"
corners = [[-1, -1, 3], [-1, 1, 3], [1, 1, 3], [1, -1, 3]]

[[shapes]]
name = "pair"
type = "triangles"
material = "grey"
positions = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
faces = [[0, 1, 2], [0, 2, 3]]

[[shapes]]
name = "ring"
type = "mesh"
mesh = "torus"
material = "shiny"
segments = 8
sides = 4

[[lights]]
name = "bulb"
type = "point"
position = [0, 0, 2]
intensity = 5

[render]
spp = 4
"#;

fn parse_valid(overrides: &[&str]) -> Result<SceneDescription> {
    let overrides: Vec<String> = overrides.iter().map(|&option| option.to_owned()).collect();
    parse(VALID, Path::new("valid.toml"), &overrides)
}

/// Parses `text` without its mark `@` and asserts one error that contains `message`, at the mark.
#[track_caller]
fn assert_error_at_mark(text: &str, message: &str) {
    let before = text.split('@').next().expect("split yields at least one part");
    let line = before.split('\n').count() as u32;
    let column = 1 + before.rsplit('\n').next().unwrap_or("").chars().count() as u32;
    let error = parse(text.replace('@', ""), Path::new("bad.toml"), &[])
        .expect_err("the scene has a mistake");
    assert!(error.message.contains(message), "{error}");
    let place = error.place.clone().expect("the error has a place");
    assert_eq!(place.file, Path::new("bad.toml"));
    assert_eq!((place.line, place.column), (Some(line), Some(column)), "{error}");
}

/// As above, for [`VALID`] with `right` replaced by `wrong`, which holds the mark.
#[track_caller]
fn assert_mistake(right: &str, wrong: &str, message: &str) {
    assert_eq!(VALID.matches(right).count(), 1, "`{right}` must occur once");
    assert_error_at_mark(&VALID.replace(right, wrong), message);
}

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
    assert_eq!(names, ["grey", "rough", "glass", "shiny", "lamp"], "in the order of the file");
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
    assert!(matches!(&scene.shapes[3].geometry, ShapeGeometry::Mesh(mesh) if mesh.faces.len() == 64));
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
fn lines_and_columns_count_from_one_in_characters() {
    let error = parse("film = { größe = 1 }\n", Path::new("a.toml"), &[]).unwrap_err();
    assert_eq!(error.to_string().split(": ").next(), Some("a.toml:1:1"), "{error}");
    let text = VALID.replace("name = \"ball\"", "name = \"größe\", x");
    let error = parse(text, Path::new("a.toml"), &[]).unwrap_err();
    assert!(error.to_string().starts_with("a.toml:42:15: "), "{error}");
    let error = parse(VALID.replace("radius = 1", "radius = -1"), Path::new("d/a.toml"), &[]);
    assert_eq!(
        error.unwrap_err().to_string(),
        "d/a.toml:46:10: `radius` must be > 0 (at least 1.2e-38) and at most 1.8e18, got -1"
    );
}

#[test]
fn unknown_keys_are_errors_everywhere() {
    assert_mistake("[film]", "@typo = 1\n[film]", "unknown key `typo`");
    assert_mistake("width = 8", "@widht = 8", "unknown key `widht`");
    assert_mistake("fov = 40", "@fow = 40", "unknown key `fow`");
    assert_mistake("top_left = [0, 1, 1]", "top_left = [0, 1, 1]\n@fov = 40", "unknown key `fov`");
    assert_mistake("sigma = 0.5", "@ior = 0.5", "unknown key `ior`");
    assert_mistake("ior = 1.5", "ior = 1.5\n@reflectance = 1", "unknown key `reflectance`");
    assert_mistake("radius = 1", "radius = 1\n@corners = []", "unknown key `corners`");
    assert_mistake("sides = 4", "@cells = 4", "unknown key `cells`");
    assert_mistake("intensity = 5", "@power = 5", "unknown key `power`");
    assert_mistake("[render]", "[background]\n@color = 1\n[render]", "unknown key `color`");
    assert_mistake("spp = 4", "@ssp = 4", "unknown field `ssp`");
}

#[test]
fn missing_keys_are_reported_at_their_table() {
    assert_mistake("width = 8\n", "", "needs `width`");
    assert_mistake("reflectance = 0.5\n\n[materials.rough]", "\n[materials.rough]", "needs `reflectance`");
    assert_mistake("type = \"sphere\"\n", "", "needs `type`");
}

#[test]
fn unknown_names_are_errors() {
    assert_mistake("material = \"glass\"", "material = @\"brass\"", "no material `brass`");
    assert_mistake("camera = \"front\"", "camera = @\"rear\"", "no camera `rear`");
    assert_mistake("type = \"lambertian\"", "type = @\"lambert\"", "unknown type `lambert`");
    assert_mistake("type = \"sphere\"", "type = @\"ball\"", "unknown type `ball`");
    assert_mistake("type = \"point\"", "type = @\"spot\"", "unknown type `spot`");
    assert_mistake("mesh = \"torus\"", "mesh = @\"donut\"", "unknown mesh `donut`");
    assert_mistake("ior = 1.5", "ior = 1.5\nfresnel = @\"none\"", "unknown fresnel `none`");
    assert_mistake("spp = 4", "@integrator = \"magic\"", "unknown variant `magic`");
}

#[test]
fn duplicates_are_errors() {
    assert_mistake("[cameras.plane]", "[cameras.@front]", "duplicate key");
    assert_mistake("[materials.rough]", "[materials.@grey]", "duplicate key");
    assert_mistake("height = 6", "@width = 6", "duplicate key");
    assert_mistake("[[shapes]]\nname = \"panel\"", "@[[shapes]]\nname = \"ball\"", "another shape has the name `ball`");
}

#[test]
fn numbers_outside_their_range_are_errors() {
    for radius in ["-1", "0", "nan", "inf", "1e-40", "1e19"] {
        assert_mistake("radius = 1", &format!("radius = @{radius}"), "`radius` must be > 0");
    }
    for sigma in ["-0.1", "-inf", "nan"] {
        assert_mistake("sigma = 0.5", &format!("sigma = @{sigma}"), "`sigma` must be ≥ 0");
    }
    for ior in ["0", "-1.5", "nan", "inf"] {
        assert_mistake("ior = 1.5", &format!("ior = @{ior}"), "`ior` must be > 0");
    }
    for exponent in ["-1", "1.1e6", "nan", "inf"] {
        let wrong = format!("exponent = @{exponent}");
        assert_mistake("exponent = 10", &wrong, "`exponent` must be in [0, 1e6]");
    }
    for albedo in ["[@-0.1, 0, 0]", "[0, @1.01, 0]", "[0, 0, @nan]", "@1.5"] {
        let wrong = format!("reflectance = {albedo}");
        assert_mistake("reflectance = [0.1, 0.2, 0.3]", &wrong, "`reflectance` must be in [0, 1]");
    }
    for emission in ["[@-1, 2, 3]", "[1, @inf, 3]", "@nan", "@1e31"] {
        let wrong = format!("emission = {emission}");
        assert_mistake("emission = [1, 2, 3]", &wrong, "`emission` must be ≥ 0");
    }
    assert_mistake("intensity = 5", "intensity = @-5", "`intensity` must be ≥ 0");
    for fov in ["0", "180", "-40", "nan", "inf"] {
        let wrong = format!("fov = @{fov}");
        assert_mistake("fov = 40", &wrong, "`fov` must be between 0 and 180");
    }
    for width in ["0", "65536", "-8", "99999999999"] {
        let wrong = format!("width = @{width}");
        assert_mistake("width = 8", &wrong, "`width` must be between 1 and 65535");
    }
    assert_mistake("height = 6", "height = 6\nexposure = @inf", "`exposure` must be between");
    for x in ["1.81e18", "-1.81e18", "nan", "inf"] {
        let message = "finite and at most 1.8e18 in absolute value";
        assert_mistake("center = [0, 0, 1]", &format!("center = [0, @{x}, 1]"), message);
        assert_mistake("eye = [0, -4, 1]", &format!("eye = [@{x}, -4, 1]"), message);
        assert_mistake("position = [0, 0, 2]", &format!("position = [0, 0, @{x}]"), message);
        let wrong = format!("positions = [[0, 0, @{x}], ");
        assert_mistake("positions = [[0, 0, 0], ", &wrong, message);
        let wrong = format!("corners = [[@{x}, -1, 3], ");
        assert_mistake("corners = [[-1, -1, 3], ", &wrong, message);
    }
    for scale in ["@0", "[1, @0, 1]", "@nan"] {
        let wrong = format!("sides = 4\nscale = {scale}");
        assert_mistake("sides = 4", &wrong, "`scale` must be finite, not 0");
    }
    assert_mistake("sides = 4", "sides = @2", "`sides` must be between 3 and 2048");
    assert_mistake("spp = 4", "spp = @0", "`spp` must be > 0");
    assert_mistake("spp = 4", "max-depth = @0", "`max-depth` must be > 0");
    assert_mistake("spp = 4", "@spp = -1", "invalid value");
    assert_mistake("ior = 1.5", "ior = @1e999", "number too large");
    assert_mistake("width = 8", "width = @99999999999999999999", "integer too large");
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
fn values_of_the_wrong_type_are_errors() {
    assert_mistake("width = 8", "width = @8.5", "expected a whole number, found 8.5");
    assert_mistake("radius = 1", "radius = @\"1\"", "expected a number, found the string \"1\"");
    assert_mistake("name = \"ball\"", "name = @1", "expected a string, found 1");
    assert_mistake("center = [0, 0, 1]", "center = @[0, 1]", "must have three numbers, has 2");
    assert_mistake("center = [0, 0, 1]", "center = @1", "expected an array");
    assert_mistake("emission = [1, 2, 3]", "emission = 1\ntwo_sided = @1", "expected true or false");
    assert_error_at_mark("film = @1", "expected a table");
    assert_mistake("[[lights]]\nname", "[@lights]\nname", "expected an array");
    assert_mistake("spp = 4", "spp = @[4]", "expected a single value");
}

#[test]
fn degenerate_cameras_are_errors() {
    let parallel = "`up` must not be zero or parallel to the view";
    assert_mistake("up = [0, 0, 1]", "up = @[0, 2, 0]", parallel);
    assert_mistake("up = [0, 0, 1]", "up = @[0, -1e-300, 0]", parallel);
    assert_mistake("up = [0, 0, 1]", "up = @[0, 0, 0]", parallel);
    let message = "`eye` and `look_at` are the same point";
    assert_mistake("[cameras.front]\neye = [0, -4, 1]", "@[cameras.front]\neye = [0, 0, 1]", message);
    let degenerate = "the image plane is degenerate";
    let plane = |right: &str, down: &str, top_left: &str| {
        let wrong = format!(
            "@[cameras.plane]\neye = [-1, 0, 0]\ntop_left = {top_left}\nright = {right}\ndown = {down}\n"
        );
        let (start, rest) = VALID.split_once("[cameras.plane]").unwrap();
        let rest = rest.split_once("\n\n").unwrap().1;
        assert_error_at_mark(&format!("{start}{wrong}\n{rest}"), degenerate);
    };
    plane("[0, 0, 0]", "[0, 0, -2]", "[0, 1, 1]");
    plane("[0, 0, 3]", "[0, 0, -2]", "[0, 1, 1]");
    plane("[0, -2, 0]", "[0, 0, -2]", "[-1, 1, 1]");
}

#[test]
fn a_scene_needs_a_camera_and_a_film() {
    assert_error_at_mark("@", "the scene is empty");
    assert_error_at_mark("@# nothing\n", "the scene is empty");
    assert_error_at_mark("@[film]\nwidth = 1\nheight = 1\n", "no camera");
    assert_error_at_mark("cameras = @{}\n[film]\nwidth = 1\nheight = 1\n", "no camera");
    assert_error_at_mark("@[cameras.a]\neye = [0, 0, 0]\n", "needs `film`");
}

#[test]
fn hand_written_faces_must_be_sound() {
    let faces = "faces = [[0, 1, 2], [0, 2, 3]]";
    assert_mistake(faces, "faces = [[0, 1, 2], [0, 2, @4]]", "vertex 4 does not exist; there are 4");
    assert_mistake(faces, "faces = [[0, 1, 2], [0, @-1, 3]]", "vertex -1 does not exist");
    assert_mistake(faces, "faces = [[0, 1, 2], @[0, 2]]", "a face has three vertex indices, this one 2");
    assert_mistake(faces, "faces = [[0, 1, 2], @[0, 2, 2]]", "the face has no area");
    assert_mistake(faces, "faces = @[]", "there are no faces");

    let corners = "corners = [[-1, -1, 3], [-1, 1, 3], [1, 1, 3], [1, -1, 3]]";
    let quad = |wrong: &str, message: &str| {
        assert_mistake(corners, &format!("corners = @{wrong}"), message);
    };
    quad("[[-1, -1, 3], [-1, 1, 3], [1, 1, 3]]", "a quad has four corners, this one 3");
    quad("[[-1, -1, 3], [-1, 1, 3], [1, 1, 3], [1, -1, 3.001]]", "not planar");
    quad("[[-1, -1, 3], [-1, 1, 3], [1, 1, 3], [-0.9, 0.9, 3]]", "not convex");
    quad("[[-1, -1, 3], [1, 1, 3], [-1, 1, 3], [1, -1, 3]]", "not convex");
    quad("[[-1, -1, 3], [-1, 1, 3], [1, 1, 3], [0, 0, 3]]", "on a line");
    quad("[[-1, -1, 3], [-1, -1, 3], [1, 1, 3], [1, -1, 3]]", "on a line");
    let nearly_planar = "corners = [[-1, -1, 3], [-1, 1, 3], [1, 1, 3], [1, -1, 3.000001]]";
    assert!(parse(VALID.replace(corners, nearly_planar), Path::new("a.toml"), &[]).is_ok());
}

#[test]
fn a_face_written_twice_is_removed_with_a_warning() {
    let text = VALID.replace("faces = [[0, 1, 2], ", "faces = [[0, 1, 2], [1, 2, 0], [2, 0, 1], ");
    let scene = parse(text, Path::new("a.toml"), &[]).unwrap();
    assert_eq!(scene.warnings, ["a.toml:54:1: 2 faces equal to another removed"]);
    assert!(matches!(&scene.shapes[2].geometry, ShapeGeometry::Mesh(mesh) if mesh.faces.len() == 2));
}

#[test]
fn emission_and_its_sides_go_together() {
    assert_mistake("ior = 1.5", "ior = 1.5\ntwo_sided = @true", "`emission`, which is missing");
    assert_mistake("[materials.lamp]\ntype = \"emitter\"\nemission = [1, 2, 3]", "@[materials.lamp]\ntype = \"emitter\"", "needs `emission`");
    let scene = parse_valid(&["materials.glass.emission=2", "materials.glass.two_sided=true"]);
    assert_eq!(
        scene.unwrap().materials[2].emission,
        Some(EmissionDescription {
            radiance: DVec3::splat(2.0),
            two_sided: true
        })
    );
}

#[test]
fn broken_syntax_is_an_error_at_its_place() {
    assert_mistake("width = 8", "width = @", "");
    assert_mistake("[film]", "[film@\n", "");
    let error = parse(&VALID[..VALID.find("corners").unwrap() + 20], Path::new("a.toml"), &[]);
    let place = error.unwrap_err().place.unwrap();
    assert_eq!(place.line, Some(52), "a truncated file");
    let nested = format!("x = {}", "[".repeat(100_000));
    assert!(parse(nested, Path::new("a.toml"), &[]).is_err());
}

#[test]
fn overrides_replace_and_add_values() {
    let scene = parse_valid(&[
        "film.width=64",
        " film.exposure = 1.5 ",
        "render.max-depth=7",
        "background.radiance=[1, 2, 3]",
        "materials.glass.ior=1.75",
        "materials.glass.fresnel=schlick",
        "materials.grey={ type = \"mirror\" }",
        "shapes.ball.radius=0.5",
        "shapes.0.center.2=9",
        "shapes.\"panel\".material=grey",
        "lights.bulb.intensity=7",
        "camera=plane",
        "film.width=65",
    ])
    .unwrap();
    assert_eq!((scene.film.width, scene.film.exposure), (65, 1.5));
    assert_eq!(scene.render.max_depth, Some(7));
    assert_eq!(scene.background, DVec3::new(1.0, 2.0, 3.0));
    assert_eq!(
        scene.materials[2].bsdf,
        BsdfDescription::Dielectric {
            ior: 1.75,
            fresnel: Fresnel::Schlick
        }
    );
    assert_eq!(
        scene.materials[0].bsdf,
        BsdfDescription::Mirror {
            reflectance: DVec3::ONE
        }
    );
    assert!(matches!(
        scene.shapes[0].geometry,
        ShapeGeometry::Sphere { center, radius: 0.5 } if center.z == 9.0
    ));
    assert_eq!(scene.shapes[1].material, MaterialId(0));
    assert_eq!(scene.point_lights[0].intensity, DVec3::splat(7.0));
    assert_eq!(scene.cameras[0].name, "plane");
}

#[test]
fn a_wrong_override_is_one_error_that_quotes_it() {
    for (option, message) in [
        ("film.width", "must be written path.to.key=value"),
        ("film.width=", "must be written path.to.key=value"),
        ("=3", "must be written path.to.key=value"),
        ("film..width=3", "must be written path.to.key=value"),
        ("", "must be written path.to.key=value"),
        ("film.widht=3", "unknown key `widht`"),
        ("flim.width=3", "there is no `flim` here"),
        ("materials.brass.ior=2", "there is no `brass` here, only `grey`, `rough`"),
        ("shapes.cube.radius=1", "`cube` is neither the name nor the index of one of 4 elements"),
        ("shapes.4.radius=1", "`4` is neither the name nor the index of one of 4 elements"),
        ("film.width.x=1", "a single value has no `x`"),
        ("film.width.x.y=1", "a single value has no `x`"),
        ("film.width=wide", "expected a whole number, found the string \"wide\""),
        ("film.width=0", "`width` must be between 1 and 65535, got 0"),
        ("shapes.ball.radius=-1", "`radius` must be > 0"),
        ("shapes.ball.material=brass", "there is no material `brass`"),
        ("shapes.ball={}", "a shape needs `type`"),
        ("camera=rear", "there is no camera `rear`"),
        ("render.spp=0", "`spp` must be > 0"),
        ("render.ssp=1", "unknown field `ssp`"),
        ("extends=hexroom.toml", "unknown key `extends`"),
        ("cameras.front.up=[0, 1, 0]", "parallel to the view"),
    ] {
        let error = parse_valid(&[option]).expect_err(option);
        assert_eq!(error.kind, ErrorKind::Usage, "{option}: {error}");
        assert_eq!(error.place, None);
        let text = error.to_string();
        assert!(text.starts_with(&format!("--set {option}: ")), "{text}");
        assert!(text.contains(message), "{text}");
        assert!(!text.contains('\n'), "{text}");
    }
}

/// A new folder with these files in it.
fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    folder
}

/// Line and column of an error, which must be in the file `name`.
fn place_in(error: &Error, name: &str) -> (u32, u32) {
    let place = error.place.as_ref().expect("the error has a place");
    assert!(place.file.ends_with(name), "{error}");
    (place.line.unwrap(), place.column.unwrap())
}

#[test]
fn a_derived_file_changes_what_it_says_and_keeps_the_rest() {
    let derived = "extends = \"base/valid.toml\"\ncamera = \"plane\"\n\
        [film]\nheight = 9\n\
        [cameras.new]\neye = [1, 0, 0]\nlook_at = [0, 0, 1]\nup = [0, 0, 1]\nfov = 40\n\
        [materials.rough]\ntype = \"mirror\"\n\
        [materials.glass]\nior = 2\n\
        [[shapes]]\ntype = \"sphere\"\nmaterial = \"rough\"\ncenter = [9, 9, 9]\nradius = 2\n\
        [render]\nseed = 3\n";
    let folder = folder(&[("base/valid.toml", VALID), ("derived.toml", derived)]);
    let scene = load(&folder.path().join("derived.toml"), &[]).unwrap();
    assert_eq!((scene.film.width, scene.film.height), (8, 9));
    let cameras: Vec<_> = scene.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(cameras, ["plane", "front", "new"]);
    assert_eq!(scene.materials.len(), 5);
    assert!(matches!(scene.materials[1].bsdf, BsdfDescription::Mirror { .. }));
    assert!(matches!(scene.materials[2].bsdf, BsdfDescription::Dielectric { ior: 2.0, .. }));
    assert_eq!(scene.shapes.len(), 5);
    assert_eq!(scene.shapes[4].material, MaterialId(1));
    assert_eq!((scene.render.spp, scene.render.seed), (Some(4), Some(3)));
}

#[test]
fn errors_in_a_chain_of_files_point_to_the_right_one() {
    let middle = "extends = \"base.toml\"\n[materials.glass]\nior = -1\n";
    let files = [
        ("base.toml", VALID),
        ("middle.toml", middle),
        ("top.toml", "extends = \"middle.toml\"\n"),
        ("healed.toml", "extends = \"middle.toml\"\n[materials.glass]\nior = 1.3\n"),
        ("broken.toml", "a = = 1\n"),
        ("on-broken.toml", "extends = \"broken.toml\"\n"),
        ("on-nothing.toml", "# nothing\nextends = \"nothing.toml\"\n"),
        ("number.toml", "extends = 1\n"),
        ("conflict.toml", "extends = \"base.toml\"\n[materials.glass]\nsigma = 1\n"),
    ];
    let folder = folder(&files);
    let fail = |name: &str| load(&folder.path().join(name), &[]).expect_err(name);
    assert_eq!(place_in(&fail("top.toml"), "middle.toml"), (3, 7));
    assert!(load(&folder.path().join("healed.toml"), &[]).is_ok());
    assert_eq!(place_in(&fail("on-broken.toml"), "broken.toml"), (1, 5));
    assert_eq!(place_in(&fail("on-nothing.toml"), "on-nothing.toml"), (2, 11));
    assert_eq!(fail("on-nothing.toml").kind, ErrorKind::Io);
    assert_eq!(place_in(&fail("number.toml"), "number.toml"), (1, 11));
    assert_eq!(place_in(&fail("conflict.toml"), "conflict.toml"), (3, 1));
}

#[test]
fn circular_and_endless_chains_are_errors() {
    let mut files = vec![
        ("self.toml".to_owned(), "extends = \"self.toml\"\n".to_owned()),
        ("a.toml".to_owned(), "extends = \"b.toml\"\n".to_owned()),
        ("b.toml".to_owned(), "extends = \"./a.toml\"\n".to_owned()),
        ("0.toml".to_owned(), VALID.to_owned()),
    ];
    for i in 1..=16 {
        files.push((format!("{i}.toml"), format!("extends = \"{}.toml\"\n", i - 1)));
    }
    let files: Vec<_> = files.iter().map(|(a, b)| (a.as_str(), b.as_str())).collect();
    let folder = folder(&files);
    let load = |name: &str| load(&folder.path().join(name), &[]);
    let error = load("self.toml").unwrap_err();
    assert!(error.message.contains("extends itself"), "{error}");
    let error = load("a.toml").unwrap_err();
    assert!(error.message.contains("extends itself"), "{error}");
    assert_eq!(place_in(&error, "b.toml"), (1, 11));
    assert!(load("15.toml").is_ok());
    let error = load("16.toml").unwrap_err();
    assert!(error.message.contains("more than 16 files"), "{error}");
}

#[test]
fn unreadable_files_are_errors() {
    let folder = folder(&[("valid.toml", VALID)]);
    let error = load(&folder.path().join("missing.toml"), &[]).unwrap_err();
    assert_eq!(error.kind, ErrorKind::Io);
    assert!(error.place.unwrap().file.ends_with("missing.toml"));
    assert_eq!(load(folder.path(), &[]).unwrap_err().kind, ErrorKind::Io);

    let path = folder.path().join("latin1.toml");
    fs::write(&path, b"# fine: \xc3\xa9\n# not: \xe9\n").unwrap();
    let error = load(&path, &[]).unwrap_err();
    assert_eq!(error.message, "not UTF-8 text");
    assert_eq!(place_in(&error, "latin1.toml"), (2, 8));
}

const TETRAHEDRON: &str = "# four faces\no t\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n\
    f 1 3 2\nf 1 2 4\nf 2 3 4\nf -2 -4 -1\n";

/// Loads a scene whose one shape is the OBJ file with this content.
fn load_obj(content: &[u8], keys: &str) -> Result<SceneDescription> {
    let text = "[film]\nwidth = 8\nheight = 8\n\
        [cameras.a]\neye = [0, -4, 1]\nlook_at = [0, 0, 1]\nup = [0, 0, 1]\nfov = 40\n\
        [materials.grey]\ntype = \"lambertian\"\nreflectance = 0.5\n\
        [[shapes]]\ntype = \"obj\"\nmaterial = \"grey\"\nfile = \"mesh.obj\"\n";
    let folder = folder(&[("scene.toml", &format!("{text}{keys}\n"))]);
    fs::write(folder.path().join("mesh.obj"), content).unwrap();
    load(&folder.path().join("scene.toml"), &[])
}

fn mesh_of(scene: &SceneDescription) -> &Mesh {
    match &scene.shapes[0].geometry {
        ShapeGeometry::Mesh(mesh) => mesh,
        other => panic!("not a mesh: {other:?}"),
    }
}

#[test]
fn an_obj_file_is_read_scaled_and_moved() {
    let scene = load_obj(TETRAHEDRON.as_bytes(), "").unwrap();
    let mesh = mesh_of(&scene);
    assert_eq!((mesh.positions.len(), mesh.faces.len()), (4, 4));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let scene = load_obj(TETRAHEDRON.as_bytes(), "scale = [2, 2, -4]\ntranslate = [0, 0, 1]");
    let scene = scene.unwrap();
    let mesh = mesh_of(&scene);
    let sum: DVec3 = mesh.positions.iter().sum();
    assert_eq!(sum, DVec3::new(2.0, 2.0, 0.0));
    let volume = mesh.faces.iter().map(|face| {
        let [a, b, c] = face.map(|index| mesh.positions[index as usize] - DVec3::Z);
        a.dot(b.cross(c)) / 6.0
    });
    assert!((volume.sum::<f64>() - 16.0 / 6.0).abs() < 1e-14, "normals stay outward");
}

#[test]
fn obj_files_keep_double_precision_and_weld_nothing_away() {
    let text = "v 148376.123456789 0 0\nv 148376.123456790 0 0\nv 148376.1234567895 1e-9 0\nf 1 2 3\n";
    let scene = load_obj(text.as_bytes(), "").unwrap();
    assert_eq!(mesh_of(&scene).positions[1].x, 148376.123456790);
}

#[test]
fn polygons_groups_and_attributes_are_read_and_curves_are_not() {
    let text = "mtllib none.mtl\nvt 0 0\nvn 0 0 1\nv 0 0 0\nv 1 0 0 1.0\nv 1 1 0\nv 0 1 0\n\
        usemtl a\ng one\nf 1/1/1 2/1/1 3/1/1 4/1/1\ng two\nusemtl b\nv 2 2 2\nf 1//1 2//1 5//1\n\
        l 1 2 3 4\np 1\ns off\nf 1/0/0 3 5\n";
    let scene = load_obj(text.as_bytes(), "").unwrap();
    assert_eq!(mesh_of(&scene).faces.len(), 4);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn faces_of_an_obj_file_that_cannot_be_traced_are_removed_and_counted() {
    let text = format!("{TETRAHEDRON}v nan 0 0\nv 1e19 0 0\nf 1 2 5\nf 1 2 6\nf 1 1 2\nf 2 1 3\nf 1 2\nf\n");
    let scene = load_obj(text.as_bytes(), "").unwrap();
    assert_eq!(mesh_of(&scene).faces.len(), 4);
    let expected = [
        "mesh.obj: 2 faces with fewer than three corners removed",
        "scene.toml:15:8: 2 faces with a coordinate that is not finite or beyond 1.8e18 removed",
        "scene.toml:15:8: 1 face of zero area removed",
        "scene.toml:15:8: 1 face equal to another removed",
    ];
    assert_eq!(scene.warnings.len(), expected.len(), "{:?}", scene.warnings);
    for (warning, expected) in scene.warnings.iter().zip(expected) {
        assert!(warning.ends_with(expected), "{warning}");
    }
}

#[test]
fn mistakes_in_an_obj_file_name_its_line() {
    for (bad_line, column, message) in [
        ("f 1 2 5", Some(7), "vertex 5 does not exist; the file has 4"),
        ("f 1 2 0", Some(7), "vertex 0 does not exist"),
        ("f 1 -5 2", Some(5), "vertex -5 does not exist"),
        ("f 1/1 2/x 3", Some(7), "`2/x` is no corner of a face"),
        ("f 1 2 3.5", Some(7), "`3.5` is no corner of a face"),
        ("f 1/2/3/4 2 3", Some(3), "`1/2/3/4` is no corner of a face"),
        ("f /1 2 3", Some(3), "`/1` is no corner of a face"),
        ("f 1/-1 2 3", Some(3), "texture coordinate -1 does not exist"),
        ("f 1//-9223372036854775808 2 3", Some(3), "normal -9223372036854775808 does not exist"),
        ("f 9223372036854775807 2 3", Some(3), "vertex 9223372036854775807 does not exist"),
        ("f 99999999999999999999 2 3", Some(3), "is no corner of a face"),
        ("v 1 2", None, "a vertex needs three numbers"),
        ("v 1 2 x", None, "a vertex needs three numbers"),
        ("v 1 2 3 0", None, "a vertex has weight 0"),
        ("v 1 2 3 4 5", None, "a vertex needs 3, 4 or 6 numbers"),
        ("vn 1 2", None, "a normal needs three numbers"),
        ("vt 1", None, "a texture coordinate needs two numbers"),
        ("usemtl", None, "`usemtl` needs a name"),
    ] {
        let text = TETRAHEDRON.replace("o t\n", &format!("{bad_line}\n"));
        let error = load_obj(text.as_bytes(), "").expect_err(bad_line);
        assert!(error.message.contains(message), "{bad_line}: {error}");
        let place = error.place.unwrap();
        assert!(place.file.ends_with("mesh.obj"));
        assert_eq!((place.line, place.column), (Some(2), column), "{bad_line}");
    }
}

#[test]
fn an_obj_file_without_usable_faces_is_an_error() {
    for text in ["", "# nothing\n", "v 0 0 0\nv 1 0 0\nl 1 2\n"] {
        let error = load_obj(text.as_bytes(), "").unwrap_err();
        assert!(error.to_string().ends_with("mesh.obj: the file has no faces"), "{error}");
    }
    let error = load_obj(b"v 0 0 0\nv 1 0 0\nf 1 2 2\n", "").unwrap_err();
    assert!(error.message.contains("no face of the mesh can be traced"), "{error}");
    assert_eq!(place_in(&error, "scene.toml"), (15, 8));
}

#[test]
fn an_obj_file_may_have_names_in_any_encoding() {
    let mut bytes = b"# caf\xe9\n".to_vec();
    bytes.extend(TETRAHEDRON.bytes());
    assert_eq!(mesh_of(&load_obj(&bytes, "").unwrap()).faces.len(), 4);
}

#[test]
fn a_missing_obj_file_is_an_error_where_it_is_named() {
    let shape = "[[shapes]]\ntype = \"obj\"\nmaterial = \"grey\"\nfile = @\"none.obj\"\n[render]";
    assert_mistake("[render]", shape, "cannot read `none.obj`");
}

fn scenes_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

fn hexroom(name: &str) -> SceneDescription {
    load(&scenes_folder().join(name), &[]).unwrap()
}

#[test]
fn every_scene_of_the_repository_loads_without_warnings() {
    let mut count = 0;
    for entry in fs::read_dir(scenes_folder()).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            let scene = load(&path, &[]).unwrap_or_else(|error| panic!("{error}"));
            assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
            assert!(fs::read_to_string(&path).unwrap().starts_with("# "), "says what it shows");
            count += 1;
        }
    }
    assert_eq!(count, 18);
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
    scene.shapes.iter().find(|shape| shape.name == name).unwrap()
}

fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

#[test]
fn the_hexagonal_room_has_its_specified_geometry() {
    let scene = hexroom("hexroom.toml");
    let is_room = |shape: &&ShapeDescription| {
        shape.name == "floor" || shape.name == "ceiling" || shape.name.starts_with("wall-")
    };
    let room: Vec<_> = scene.shapes.iter().filter(is_room).flat_map(triangles).collect();
    assert_eq!(room.len(), 20);
    // The prism over a hexagon of area 6·10 + ... = 138 m² between z = -5 and 5, seen from inside.
    let volume: f64 = room.iter().map(|&[a, b, c]| -a.dot(b.cross(c)) / 6.0).sum();
    let hexagon = 0.5 * 12.0 * 3.0 + 10.0 * 12.0 + 0.5 * 12.0 * 3.0;
    assert!((volume - 10.0 * hexagon).abs() < 1e-9, "{volume}");
    let center = DVec3::new(5.0, 0.0, 0.0);
    assert!(room.iter().all(|&face| normal(face).dot(center - face[0]) > 0.0));

    let light = shape(&scene, "light");
    for face in triangles(light) {
        assert!(normal(face).z < 0.0 && normal(face).x == 0.0 && normal(face).y == 0.0);
        assert!(face.iter().all(|corner| corner.z == 4.99));
    }
    let area: f64 = triangles(light).into_iter().map(|face| normal(face).length() / 2.0).sum();
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
    assert!(tetrahedron.iter().all(|&face| normal(face).dot(face[0] - inside) > 0.0));
    assert_eq!(tetrahedron.iter().filter(|face| face.iter().all(|p| p.z == -5.0)).count(), 1);

    let spheres = scene.shapes.iter().filter(|shape| matches!(shape.geometry, ShapeGeometry::Sphere { .. }));
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
    assert_eq!((scene.film.width, scene.film.height, scene.render.spp), (800, 800, Some(64)));
}

#[test]
fn variants_of_the_hexagonal_room_differ_where_they_say() {
    let base = hexroom("hexroom.toml");
    let material = |scene: &SceneDescription, name: &str| {
        let found = scene.materials.iter().find(|material| material.name == name);
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
    let exact = hexroom("hexroom-exact.toml");
    assert_eq!(material(&exact, "glass"), glass(1.5, Fresnel::Exact));
    assert_eq!(
        material(&exact, "tetrahedron"),
        BsdfDescription::Lambertian { reflectance: blue }
    );
    for ior in [1.5, 1.75] {
        let scene = hexroom(&format!("hexroom-ior-{ior}.toml"));
        assert_eq!(material(&scene, "glass"), glass(ior, Fresnel::Schlick));
    }
    for sigma in [0.0, 0.3, 0.7, f64::INFINITY] {
        let scene = hexroom(&format!("hexroom-oren-nayar-{sigma}.toml"));
        assert_eq!(material(&scene, "tetrahedron"), rough(sigma));
    }
    for spp in [1, 100, 400] {
        assert_eq!(hexroom(&format!("hexroom-{spp}spp.toml")).render.spp, Some(spp));
    }
    let shadows = hexroom("hexroom-transparent-shadows.toml").render;
    assert_eq!((shadows.transparent_shadows, shadows.spp), (Some(true), Some(64)));
    let whitted = hexroom("hexroom-whitted.toml").render;
    assert_eq!(whitted.integrator, Some(IntegratorKind::Whitted));
    assert_eq!(whitted.spp, Some(1));
}

#[test]
fn the_blocks_of_the_cornell_box_have_their_volume() {
    let scene = hexroom("cornell.toml");
    // Base parallelogram spanned by two measured edges, times the height. The open bottom lies in
    // y = 0 and adds nothing to the sum over faces.
    let base = |[x, z]: [f64; 2], [u, w]: [f64; 2]| (x * w - z * u).abs();
    let short = 0.165 * base([0.160, 0.049], [-0.048, 0.160]);
    let tall = 0.330 * base([0.158, -0.049], [-0.109 + 0.158, 0.160]);
    for (name, expected) in [("short-block", short), ("tall-block", tall)] {
        let volume: f64 = triangles(shape(&scene, name))
            .into_iter()
            .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
            .sum();
        assert!((volume / expected - 1.0).abs() < 0.01, "{name}: {volume} {expected}");
    }
    let light = triangles(shape(&scene, "light"));
    assert!(light.into_iter().all(|face| normal(face).y < 0.0));
}

#[test]
fn the_scene_of_the_format_description_loads() {
    let documentation = include_str!("mod.rs");
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
    assert!(triangles(&scene.shapes[1]).into_iter().all(|face| normal(face).z < 0.0));
}

/// Flips, replaces and cuts bytes.
fn mutate(text: &str, changes: &[(usize, u8)], length: usize) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    for &(position, byte) in changes {
        let position = position % bytes.len();
        bytes[position] = byte;
    }
    bytes.truncate(length % (bytes.len() + 1));
    bytes
}

fn mutations() -> impl Strategy<Value = (Vec<(usize, u8)>, usize)> {
    let byte = prop_oneof![any::<u8>(), proptest::sample::select(&b"0123456789-./= \n[]\"ef"[..])];
    // One in four is cut.
    let length = prop_oneof![3 => Just(usize::MAX - 1), 1 => any::<usize>()];
    (prop::collection::vec((any::<usize>(), byte), 0..6), length)
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 512,
        rng_seed: proptest::test_runner::RngSeed::Fixed(1),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn a_damaged_scene_never_panics((changes, length) in mutations()) {
        let text = include_str!("../../scenes/hexroom.toml");
        let bytes = mutate(text, &changes, length);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("damaged.toml");
        fs::write(&path, bytes).unwrap();
        if let Err(error) = load(&path, &[]) {
            let place = error.place.expect("an error in a file has a place");
            prop_assert!(place.line.is_some() && place.column.is_some());
        }
    }

    #[test]
    fn a_damaged_obj_file_never_panics((changes, length) in mutations()) {
        let bytes = mutate(TETRAHEDRON, &changes, length);
        if let Err(error) = load_obj(&bytes, "") {
            prop_assert!(error.place.is_some());
        }
    }
}

/// Every uncompressed OBJ file below the folder `WAVEPATH_MESHES`, if that is set.
#[test]
fn meshes_of_the_world_never_panic() {
    let Some(root) = std::env::var_os("WAVEPATH_MESHES") else {
        eprintln_skipped();
        return;
    };
    let mut folders = vec![PathBuf::from(root)];
    let mut loaded = 0;
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "obj") {
                match load_obj(&fs::read(&path).unwrap(), "") {
                    Ok(scene) => {
                        assert!(!mesh_of(&scene).faces.is_empty());
                        loaded += 1;
                    }
                    Err(error) => assert!(error.place.is_some(), "{error}"),
                }
            }
        }
    }
    assert!(loaded > 0, "no mesh could be loaded");
}

#[allow(clippy::print_stderr, reason = "tells the developer that a test did nothing")]
fn eprintln_skipped() {
    eprintln!("skipped: set WAVEPATH_MESHES to a folder of OBJ files");
}
