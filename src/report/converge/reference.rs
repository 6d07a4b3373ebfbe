//! What images are held against: a closed form, a file, or two halves rendered here and stored.

use std::fs;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::errors::ReferenceImage;
use super::key::reference_key;
use super::results::{ReferenceKind, ReferenceReport};
use super::{Event, Interrupted, seed};
use crate::compile::compile;
use crate::error::{Error, Result};
use crate::film::{Film, Provenance, read_exr, write_atomically, write_image};
use crate::integrator::Session;
use crate::reference::closed_form_image;
use crate::report::{Build, Span, Stopwatch};
use crate::scene::{
    AccelKind, Budget, IntegratorKind, RenderSettings, SamplerKind, SceneDescription, Strategy,
    fingerprint,
};

/// Samples per pixel and half in a round: as in an ordinary render.
const BLOCK: u32 = 16;

/// First depth of roulette in a reference.
const ROULETTE_DEPTH: u32 = 8;

/// Where a reference comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ReferenceChoice {
    /// The scene's closed form if it states one, else rendered.
    Auto,
    /// Rendered, whatever the scene states.
    Rendered,
    /// An EXR image.
    File(PathBuf),
}

/// How a reference is made.
#[derive(Debug, Clone, PartialEq)]
pub struct ReferenceOptions {
    /// Where it comes from.
    pub choice: ReferenceChoice,
    /// Relative error at which a rendered one is good enough, as a fraction.
    pub error: f64,
    /// CPU seconds of rendering after which it has to be good enough.
    pub seconds: f64,
    /// Folder where rendered ones are stored; it need not exist. `None` stores nothing.
    pub cache: Option<PathBuf>,
}

/// A view of a scene: what a picture shows, and its key.
#[derive(Debug, Clone, Copy)]
pub(super) struct View<'a> {
    pub(super) scene: &'a SceneDescription,
    pub(super) camera: usize,
    pub(super) key: &'a str,
}

impl<'a> View<'a> {
    pub(super) fn key_of(scene: &SceneDescription, camera: usize) -> String {
        fingerprint(scene, camera)
    }

    fn size(&self) -> (u32, u32) {
        (self.scene.film.width, self.scene.film.height)
    }
}

/// Makes or finds the reference of a view. `None` if it was interrupted.
pub(super) fn obtain(
    view: View<'_>,
    options: &ReferenceOptions,
    threads: usize,
    interrupted: &Interrupted<'_>,
    tell: &mut dyn FnMut(Event<'_>),
) -> Result<Option<(ReferenceImage, ReferenceReport)>> {
    match &options.choice {
        ReferenceChoice::File(path) => from_file(path, view.size()).map(Some),
        ReferenceChoice::Auto if view.scene.closed_form.is_some() => exact(view).map(Some),
        ReferenceChoice::Auto | ReferenceChoice::Rendered => {
            rendered(view, options, threads, interrupted, tell)
        }
    }
}

fn report(kind: ReferenceKind, image: &ReferenceImage) -> ReferenceReport {
    ReferenceReport {
        kind,
        mean: image.image_mean(),
        samples: None,
        seeds: Vec::new(),
        variance: Some(image.variance()),
        relative_error: Some(image.relative_error()),
        image: None,
        time: Span::default(),
    }
}

fn exact(view: View<'_>) -> Result<(ReferenceImage, ReferenceReport)> {
    let watch = Stopwatch::start();
    let (width, height) = view.size();
    let mean = closed_form_image(view.scene, view.camera, width, height)?
        .expect("asked only of scenes that state one");
    let image = ReferenceImage::exact(width, mean);
    let report = ReferenceReport {
        samples: Some(0),
        time: watch.span(),
        ..report(ReferenceKind::ClosedForm, &image)
    };
    Ok((image, report))
}

fn from_file(path: &Path, size: (u32, u32)) -> Result<(ReferenceImage, ReferenceReport)> {
    let watch = Stopwatch::start();
    let exr = read_exr(path)?;
    if (exr.width, exr.height) != size {
        let message = format!(
            "the reference has {} × {} pixels, the render {} × {}",
            exr.width, exr.height, size.0, size.1
        );
        return Err(Error::file(path, message));
    }
    let samples = exr.samples.and_then(|samples| samples.into_iter().min());
    let samples = samples.map(u64::from);
    let mut image = ReferenceImage::exact(exr.width, doubles(&exr.mean));
    if let Some(variance) = &exr.variance {
        image.noise = doubles(variance);
        image.samples = samples.unwrap_or(0);
    }
    if !(image.mean.iter().chain(&image.noise).flatten()).all(|value| value.is_finite()) {
        return Err(Error::file(path, "a pixel of the reference is not finite"));
    }
    let kind = ReferenceKind::File {
        path: path.display().to_string(),
    };
    let mut report = ReferenceReport {
        samples,
        time: watch.span(),
        ..report(kind, &image)
    };
    if exr.variance.is_none() {
        (report.variance, report.relative_error) = (None, None);
    }
    Ok((image, report))
}

fn doubles(values: &[[f32; 3]]) -> Vec<[f64; 3]> {
    values.iter().map(|rgb| rgb.map(f64::from)).collect()
}

/// What is stored beside the two halves.
#[derive(Debug, Serialize, Deserialize)]
struct Stored {
    /// Scene and camera, for people.
    scene: String,
    report: ReferenceReport,
}

fn rendered(
    view: View<'_>,
    options: &ReferenceOptions,
    threads: usize,
    interrupted: &Interrupted<'_>,
    tell: &mut dyn FnMut(Event<'_>),
) -> Result<Option<(ReferenceImage, ReferenceReport)>> {
    let settings = RenderSettings {
        integrator: IntegratorKind::Path,
        strategy: Strategy::Mis,
        sampler: SamplerKind::Independent,
        accel: AccelKind::Auto,
        budget: Budget::Error(options.error),
        threads,
        max_depth: None,
        roulette_depth: ROULETTE_DEPTH,
        transparent_shadows: false,
        ..RenderSettings::default()
    };
    // Streams that no repeat has.
    let seeds = [u64::MAX - 2, u64::MAX - 1].map(|stream| seed(0, stream));
    let goal = format!("{} {} {BLOCK} {seeds:?}", options.error, options.seconds);
    let lasting = RenderSettings {
        threads: 1,
        ..settings.clone()
    };
    let version = env!("CARGO_PKG_VERSION");
    let key = reference_key(view.key, &format!("{version} {lasting:?} {goal}"));
    let place = options.cache.as_ref().map(|folder| folder.join(&key));
    if let Some(found) = place.as_ref().and_then(|place| find(place, view.size())) {
        return Ok(Some(found));
    }
    if let Some(folder) = &options.cache {
        fs::create_dir_all(folder).map_err(|error| Error::io(folder, &error))?;
    }

    let watch = Stopwatch::start();
    let (width, height) = view.size();
    let mut compiled = Vec::new();
    for seed in seeds {
        let settings = RenderSettings {
            seed,
            ..settings.clone()
        };
        compiled.push(compile(view.scene, view.camera, width, height, &settings)?);
    }
    let mut halves = Vec::new();
    for compiled in &compiled {
        halves.push(Session::new(view.scene, compiled, &settings, BLOCK)?);
    }
    let mut next_look = 1;
    let image = loop {
        for half in &mut halves {
            let samples = (half.samples().max(1) as u32).min(BLOCK);
            let stop = |_: &_| match interrupted() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            };
            if half.round(samples, &stop).is_break() {
                return Ok(None);
            }
        }
        let samples = halves[0].samples();
        let seconds: f64 = halves.iter().map(Session::cpu_seconds).sum();
        if samples < next_look && seconds < options.seconds {
            continue;
        }
        next_look = samples + samples / 8 + 1;
        let image = {
            let [a, b] = &mut halves[..] else {
                unreachable!("there are two halves");
            };
            let films = [&means(a.film())[..], &means(b.film())];
            ReferenceImage::from_halves(width, 2 * samples, films)
        };
        let error = image.relative_error();
        tell(Event::Progress(&format!(
            "reference: {} samples per pixel, relative error {:.2} %, {seconds:.0} CPU s",
            2 * samples,
            100.0 * error
        )));
        if (samples > 1 && error <= options.error) || seconds >= options.seconds {
            break image;
        }
    };
    let kind = ReferenceKind::Rendered { key, cached: false };
    let report = ReferenceReport {
        samples: Some(image.samples),
        seeds: seeds.to_vec(),
        time: watch.span(),
        ..report(kind, &image)
    };
    if let Some(place) = &place {
        store(place, view, &report, &mut halves)?;
    }
    Ok(Some((image, report)))
}

fn means(film: &Film) -> Vec<[f64; 3]> {
    (0..film.len()).map(|pixel| film.mean(pixel)).collect()
}

/// The files of a stored reference: its halves, and what is known about it.
fn files(place: &Path) -> ([PathBuf; 2], PathBuf) {
    let halves = ["a.exr", "b.exr"].map(|half| place.with_extension(half));
    (halves, place.with_extension("json"))
}

/// Stores both halves and last the report, which says that they are complete.
fn store(
    place: &Path,
    view: View<'_>,
    report: &ReferenceReport,
    halves: &mut [Session<'_>],
) -> Result<()> {
    let scene = format!(
        "{}, camera {}",
        view.scene.source.display(),
        view.scene.cameras[view.camera].name
    );
    let (images, json) = files(place);
    let build = Build::current();
    for ((half, path), &seed) in halves.iter_mut().zip(&images).zip(&report.seeds) {
        let provenance = Provenance {
            scene: scene.clone(),
            software: format!("wavepath {} ({})", build.version, build.commit),
            seed,
            bias: Vec::new(),
        };
        write_image(path, half.film(), 0.0, &provenance)?;
    }
    let stored = Stored {
        scene,
        report: report.clone(),
    };
    let text = serde_json::to_string_pretty(&stored).expect("plain data always serialises");
    write_atomically(&json, |file| {
        writeln!(file, "{text}").map_err(|error| Error::io(&json, &error))
    })
}

/// A stored reference; `None` if it is not there, or cannot be read and so must be rendered anew.
fn find(place: &Path, (width, height): (u32, u32)) -> Option<(ReferenceImage, ReferenceReport)> {
    let ([a, b], json) = files(place);
    let Stored { mut report, .. } = serde_json::from_str(&fs::read_to_string(json).ok()?).ok()?;
    let (a, b) = (read_exr(&a).ok()?, read_exr(&b).ok()?);
    let fits = |width_: u32, height_: u32| (width_, height_) == (width, height);
    if !(fits(a.width, a.height) && fits(b.width, b.height)) {
        return None;
    }
    if let ReferenceKind::Rendered { cached, .. } = &mut report.kind {
        *cached = true;
    }
    let halves = [doubles(&a.mean), doubles(&b.mean)];
    let samples = report.samples.unwrap_or(0);
    let image = ReferenceImage::from_halves(width, samples, [&halves[0], &halves[1]]);
    Some((image, report))
}
