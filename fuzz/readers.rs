//! What each fuzz target does with its input: it is read as a user's file would be. Nothing is expected of
//! the answer but that there is one, an error with a place or a sound value. The test suite replays
//! `corpus/` through the same functions.
#![allow(dead_code, reason = "each target uses one of them")]

use std::cell::OnceCell;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tempfile::TempDir;
use wavepath::compile::compile;
use wavepath::film::read_exr;
use wavepath::integrator::checkpoint::{Identity, Resume};
use wavepath::integrator::render_resumable;
use wavepath::scene::{self, Budget, RenderSettings, SamplerKind, SceneDescription};

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

/// The scene whose renders are resumed: two tiles, of 32 pixels and of one.
const ROOM: &str = r#"
    film = { width = 33, height = 1 }
    cameras.c = { eye = [0.1, 0.2, 0.3], look_at = [1, 0, 0], up = [0, 0, 1], fov = 90 }
    materials.wall = { type = "lambertian", reflectance = 0.5, emission = 1, two_sided = true }
    shapes = [{ type = "mesh", mesh = "box", material = "wall", size = [2, 2, 2] }]
"#;

/// A checkpoint, as it is and mended: with the identity and the checksums that are right, so that the reader goes
/// on to what is behind them. What is sound is rendered for a moment longer.
pub(crate) fn checkpoint(bytes: &[u8]) {
    let scene = scene::parse(ROOM, Path::new("room.toml"), &[]).expect("a sound scene");
    go_on(bytes, &scene, &RenderSettings::default());
    if let Some((bytes, settings)) = mend(bytes, &scene) {
        go_on(&bytes, &scene, &settings);
    }
}

fn identity(scene: &SceneDescription, settings: &RenderSettings) -> Identity {
    Identity::new(scene, 0, settings, &serde_json::json!({}))
}

/// The checkpoint with what the reader wants to find, if it has a header, and settings that it may be of.
fn mend(bytes: &[u8], scene: &SceneDescription) -> Option<(Vec<u8>, RenderSettings)> {
    let (preamble, rest) = bytes.split_at_checked(16)?;
    let mut headers = serde_json::Deserializer::from_slice(rest).into_iter::<Value>();
    let mut header = headers.next()?.ok()?;
    let body = rest.get(headers.byte_offset() + 4..)?;
    let body = &body[..body.len().checked_sub(4)?];

    let blocks = header.pointer("/record/position/blocks")?;
    let total = blocks["total"].as_u64().filter(|total| *total > 0);
    let mean = header
        .pointer("/record/position/mean")
        .and_then(Value::as_f64);
    let samples = total.or(mean.map(|mean| (2.0 * mean) as u64));
    let in_halves = header["halves"] == 2;
    let is_adaptive = in_halves && header["words"] != 0;
    let is_replicated = in_halves && !is_adaptive;
    let settings = RenderSettings {
        sampler: match is_replicated {
            true => SamplerKind::Sobol,
            false => SamplerKind::Independent,
        },
        budget: samples.map_or(Budget::Error(1e-9), |samples| {
            Budget::Samples(samples.saturating_mul(1 + u64::from(is_replicated)))
        }),
        block: blocks["full"].as_u64()?.clamp(1, 64) as u32,
        adaptive: is_adaptive,
        aux: header["aux"] == true,
        threads: 1,
        ..RenderSettings::default()
    };
    let identity = serde_json::to_value(identity(scene, &settings)).expect("plain data");
    *header.pointer_mut("/record/identity")? = identity;

    let json = header.to_string();
    let mut mended = preamble[..12].to_vec();
    mended.extend((json.len() as u32).to_le_bytes());
    mended.extend(json.as_bytes());
    mended.extend(crc32fast::hash(&mended).to_le_bytes());
    mended.extend(body);
    mended.extend(crc32fast::hash(body).to_le_bytes());
    Some((mended, settings))
}

/// Resumes a render and interrupts it at once.
fn go_on(bytes: &[u8], scene: &SceneDescription, settings: &RenderSettings) {
    let path = write("checkpoint", bytes);
    let resume = match Resume::read(&path, scene, settings, &identity(scene, settings)) {
        Ok(resume) => resume,
        // That an adaptive render has too few samples is said of the settings.
        Err(error) => return assert!(error.place.is_some() || settings.adaptive, "{error}"),
    };
    let (width, height) = (scene.film.width, scene.film.height);
    let compiled = compile(scene, 0, width, height, settings).expect("a sound scene");
    let stop = |_: &_| ControlFlow::Break(());
    let outcome = render_resumable(scene, &compiled, settings, &stop, Some(resume), None)
        .expect("the machine can hold this film");
    // An image without samples has no error.
    let _ = outcome.film.error_estimate();
    assert!(outcome.film.total_samples() >= outcome.stats.paths);
}
