//! `wavepath accels`: acceleration structures compared on rays of a scene.

use crate::compile::compile;
use crate::error::Result;
use crate::film::check_writable;
use crate::report::SceneReport;
use crate::report::accels::{AccelsInput, AccelsSettings, Contestant, Event, RayKind, compare};
use crate::scene::MAX_WAVE;

use super::args::{AccelsArgs, SceneArgs};
use super::job::{MAX_THREADS, SceneJob, check_range, check_report_name};
use super::{Status, note, print, write_json};

/// Most rays per set: some GiB of columns.
const MAX_RAYS: usize = 1 << 28;

/// Most rounds. Beyond any patience; it stops a slip of the keyboard.
const MAX_ROUNDS: usize = 10_000;

pub(super) fn run(args: &AccelsArgs) -> Result<Status> {
    // First what is quick to check: loading a large scene takes its time.
    check_range("--count", Some(args.count), 1, MAX_RAYS)?;
    check_range("--batch", Some(args.batch), 1, MAX_WAVE)?;
    check_range("--rounds", Some(args.rounds), 1, MAX_ROUNDS)?;
    check_range("--threads", args.threads, 1, MAX_THREADS)?;
    let contestants = Contestant::named(&args.structures)?;
    if let Some(path) = &args.json {
        check_report_name(path)?;
        check_writable(path)?;
    }
    let job = SceneJob::new(&SceneArgs {
        scene: args.scene.clone(),
        view: args.view.clone(),
        set: args.set.clone(),
        ..SceneArgs::default()
    })?;
    for warning in &job.scene.warnings {
        note(&format!("warning: {warning}"));
    }
    let film = job.scene.film;
    let settings = AccelsSettings {
        kinds: kinds(&args.rays),
        count: args.count,
        batch: args.batch,
        rounds: args.rounds,
        threads: args.threads.unwrap_or(job.settings.threads),
        quality: job.settings.accel_quality,
        seed: args.seed.unwrap_or(job.settings.seed),
    };
    let input = AccelsInput {
        scene: &job.scene,
        compiled: compile(
            &job.scene,
            job.camera,
            film.width,
            film.height,
            &job.settings,
        )?,
        report: SceneReport {
            name: job.name(),
            camera: job.camera_name().to_owned(),
            width: film.width,
            height: film.height,
        },
        contestants: &contestants,
        settings: &settings,
    };
    let report = compare(input, &mut |event| match event {
        Event::Progress(_) if args.quiet => {}
        Event::Progress(text) | Event::Note(text) => note(text),
    })?;
    if let Some(path) = &args.json {
        write_json(path, &report.to_json())?;
    }
    print(&report.to_string())?;
    let faults = report.faults();
    for fault in &faults {
        note(fault);
    }
    Ok(if faults.is_empty() {
        Status::Done
    } else {
        Status::Exceeded
    })
}

/// The chosen kinds of rays, each once; all of them if none is chosen.
fn kinds(chosen: &[RayKind]) -> Vec<RayKind> {
    let mut kinds = if chosen.is_empty() {
        RayKind::ALL.to_vec()
    } else {
        chosen.to_vec()
    };
    kinds.sort_unstable();
    kinds.dedup();
    kinds
}
