//! Scenes around single meshes: what tests and benches trace.
#![allow(dead_code, reason = "each test and bench uses some of it")]

use std::path::{Path, PathBuf};

use wavepath::compile::{CompiledScene, compile};
use wavepath::geometry::Geometry;
use wavepath::report::accels::{RayKind, RaySet, ray_sets};
use wavepath::scene::{self, RenderSettings, SceneDescription};

/// The folder of real meshes, if the environment names one.
pub(crate) fn folder() -> Option<PathBuf> {
    std::env::var_os("WAVEPATH_MESHES").map(PathBuf::from)
}

/// Whether a bench is only to be shown to run.
pub(crate) fn is_test() -> bool {
    std::env::args().any(|argument| argument == "--test")
}

/// A mesh made by formula, of up to `triangles` triangles, in [−1.3, 1.3]³ under a sky and a square lamp.
/// `kind` is one of [`scene::procedural::ScalableKind`]'s names, `icosphere` or `torus`.
pub(crate) fn made(kind: &str, triangles: u32) -> SceneDescription {
    let size = match kind {
        // 20·4ⁿ.
        "icosphere" => format!("subdivisions = {}", (triangles / 20).max(1).ilog(4)),
        // Twice as many segments as sides, two triangles each.
        "torus" => {
            let sides = (triangles / 4).isqrt();
            format!("segments = {}, sides = {sides}", 2 * sides)
        }
        _ => format!("triangles = {triangles}"),
    };
    let text = format!(
        "film = {{ width = 64, height = 48 }}\n\
         background = {{ radiance = 0.5 }}\n\
         cameras.a = {{ eye = [2, -2.5, 1.5], look_at = [0, 0, 0], up = [0, 0, 1], fov = 45 }}\n\
         materials.grey = {{ type = \"lambertian\", reflectance = 0.5 }}\n\
         materials.lamp = {{ type = \"emitter\", emission = 4 }}\n\
         shapes = [\n\
         {{ type = \"mesh\", material = \"grey\", mesh = \"{kind}\", {size} }},\n\
         {{ type = \"quad\", material = \"lamp\", corners = [[-1, -1, 3], [-1, 1, 3], [1, 1, 3], [1, -1, 3]] }},\n\
         ]\n"
    );
    scene::parse(text, Path::new("mesh.toml"), &[]).expect("the scene is sound")
}

/// The mesh in a file of the folder, with a camera, a sky and a sun.
pub(crate) fn read(folder: &Path, file: &str) -> SceneDescription {
    scene::load(&folder.join(file), &[]).unwrap_or_else(|error| panic!("{error}"))
}

/// A scene as structures see it, and the means to make rays.
pub(crate) struct MeshScene {
    compiled: CompiledScene,
    /// As the renderer gives it to its structure: coplanar triangles of a material may be merged.
    pub(crate) geometry: Geometry,
}

impl MeshScene {
    pub(crate) fn new(scene: &SceneDescription, [width, height]: [u32; 2]) -> Self {
        let compiled = compile(scene, 0, width, height, &RenderSettings::default())
            .unwrap_or_else(|error| panic!("{error}"));
        let geometry = compiled.geometry(scene);
        Self { compiled, geometry }
    }

    /// Each triangle for itself, and shadow rays from and to anywhere.
    pub(crate) fn unmerged(&self) -> Geometry {
        Geometry {
            groups: Vec::new(),
            segment_ends: None,
            ..self.geometry.clone()
        }
    }

    /// Up to `count` rays of every kind.
    pub(crate) fn rays(&self, count: usize) -> Vec<RaySet> {
        ray_sets(&self.compiled, &RayKind::ALL, count, 1)
    }
}
