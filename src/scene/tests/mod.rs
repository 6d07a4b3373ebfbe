//! Tests of scene files as a whole, and what they share.

mod damage;
mod extends;
mod mistakes;
mod obj_files;
mod overrides;
mod reading;
mod repository;

use std::fs;
use std::path::Path;

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
