//! What each fuzz target does with its input: it is read as a user's file would be. Nothing is expected of
//! the answer but that there is one, an error with a place or a sound value. The test suite replays
//! `corpus/` through the same functions.
#![allow(dead_code, reason = "each target uses one of them")]

use std::cell::OnceCell;
use std::path::{Path, PathBuf};

use tempfile::TempDir;
use wavepath::compile::compile;
use wavepath::film::read_exr;
use wavepath::scene::{self, RenderSettings, SceneDescription};

/// Largest whole number in a scene file with a procedural mesh that is still read: larger ones ask for
/// meshes of millions of faces, which is legal and slow.
const LARGEST_COUNT: u64 = 2000;

/// The path of an empty folder's file of this name, which holds `bytes`. One folder per thread.
fn write(name: &str, bytes: &[u8]) -> PathBuf {
    thread_local! {
        static FOLDER: OnceCell<TempDir> = const { OnceCell::new() };
    }
    let path = FOLDER.with(|folder| {
        let folder = folder.get_or_init(|| tempfile::tempdir().expect("a temporary folder"));
        folder.path().join(name)
    });
    std::fs::write(&path, bytes).expect("the temporary folder is writable");
    path
}

/// Compiles what was read, for every structure that it may be traced with.
fn trace_nothing(scene: &SceneDescription) {
    let settings = RenderSettings {
        threads: 1,
        ..RenderSettings::from_defaults(&scene.render)
    };
    // An error is an answer, too.
    let _ = compile(scene, 0, 4, 4, &settings);
}

/// A scene file.
pub(crate) fn scene(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    if text.contains("mesh") && asks_for_much(&text) {
        return;
    }
    let path = write("scene.toml", bytes);
    match scene::load(&path, &[]) {
        Ok(scene) => trace_nothing(&scene),
        Err(error) => assert!(error.place.is_some(), "{error}"),
    }
}

/// Whether some number in the text is above [`LARGEST_COUNT`], or the splits of a sphere are above 5.
fn asks_for_much(text: &str) -> bool {
    let mut numbers = text.split(|c: char| !c.is_ascii_digit() && c != '_');
    let large = |digits: &str| {
        let digits = digits.replace('_', "");
        !digits.is_empty() && digits.parse().map_or(true, |n: u64| n > LARGEST_COUNT)
    };
    numbers.any(large) || text.contains("subdivisions") && text.contains(['6', '7', '8', '9'])
}

/// An OBJ file in the place of a scene.
pub(crate) fn obj(bytes: &[u8]) {
    let path = write("mesh.obj", bytes);
    match scene::load(&path, &[]) {
        Ok(scene) => trace_nothing(&scene),
        Err(error) => assert!(error.place.is_some(), "{error}"),
    }
}

/// An MTL file, read for a mesh whose faces use materials named `a`, `b` and none.
pub(crate) fn mtl(bytes: &[u8]) {
    write("library.mtl", bytes);
    let mesh = b"mtllib library.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\n\
        f 1/1 2/2 3/3\nusemtl a\nf 1/1 3/3 4/2\nusemtl b\nf 2/1 3/2 4/3\n";
    let path = write("mesh.obj", mesh);
    let scene = scene::load(&path, &[]).expect("a bad library makes materials grey, with warnings");
    trace_nothing(&scene);
}

/// An EXR image.
pub(crate) fn exr(bytes: &[u8]) {
    let path = write("image.exr", bytes);
    match read_exr(&path) {
        Ok(image) => {
            let pixels = image.width as usize * image.height as usize;
            assert_eq!(image.mean.len(), pixels);
        }
        Err(error) => assert!(error.place.is_some(), "{error}"),
    }
}
