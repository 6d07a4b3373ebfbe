//! Scenes and renders for the tests of this suite.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use wavepath::compile::compile;
use wavepath::film::Film;
use wavepath::integrator::{Outcome, render};
use wavepath::scene::{self, RenderSettings, SceneDescription};

use crate::ztest::ImageEstimate;

/// The folder of the repository's scenes.
pub(crate) fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

/// Every scene file of the repository, sorted by name.
pub(crate) fn scene_files() -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(scenes())
        .expect("the scenes folder is there")
        .map(|entry| entry.expect("readable").path())
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .collect();
    files.sort();
    assert!(files.len() >= 10);
    files
}

/// A scene of the repository.
pub(crate) fn load(name: &str) -> SceneDescription {
    scene::load(&scenes().join(name), &[]).unwrap_or_else(|error| panic!("{error}"))
}

/// A scene from text.
pub(crate) fn parse(text: &str) -> SceneDescription {
    scene::parse(text, Path::new("test.toml"), &[]).unwrap_or_else(|error| panic!("{error}"))
}

/// Renders through camera `camera` at `width` × `height`.
pub(crate) fn picture(
    scene: &SceneDescription,
    camera: usize,
    [width, height]: [u32; 2],
    settings: &RenderSettings,
) -> Outcome {
    let compiled =
        compile(scene, camera, width, height, settings).unwrap_or_else(|error| panic!("{error}"));
    let outcome = render(scene, &compiled, settings, &|_| ControlFlow::Continue(()))
        .unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(outcome.stats.rejected, 0, "unsound contributions");
    outcome
}

/// Every pixel's mean and the variance of that mean; the film must hold several blocks.
pub(crate) fn estimate(film: &Film) -> ImageEstimate {
    ImageEstimate {
        width: film.width() as usize,
        height: film.height() as usize,
        mean: (0..film.len()).map(|p| film.mean(p)).collect(),
        variance_of_mean: (0..film.len())
            .map(|p| film.variance(p).expect("several blocks"))
            .collect(),
    }
}

/// Mean radiance of the whole image and its standard error, per channel, from the spread of the
/// pixels' estimates.
pub(crate) fn image_mean(outcome: &Outcome) -> [(f64, f64); 3] {
    let film = &outcome.film;
    let n = film.len() as f64;
    std::array::from_fn(|c| {
        let mean = (0..film.len()).map(|p| film.mean(p)[c]).sum::<f64>() / n;
        let variance: f64 = (0..film.len())
            .map(|p| film.variance(p).map_or(0.0, |v| v[c]))
            .sum();
        (mean, variance.sqrt() / n)
    })
}
