//! `wavepath render` and the default command.

use std::io::Write;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use crate::compile::compile_with_progress;
use crate::error::{Error, Result};
use crate::film::{Provenance, write_atomically, write_image};
use crate::integrator::{self, Outcome, plan::Plan, stats::EndReason};
use crate::report::{
    Build, Machine, RenderReport, ReportInput, SceneReport, Stopwatch, Times, bias,
};

use super::job::{RenderJob, SceneJob};
use super::progress::ProgressDisplay;
use super::{Status, interrupt, note, print};

pub(super) fn run(job: &RenderJob) -> Result<Status> {
    let SceneJob {
        scene,
        camera,
        settings,
        load,
    } = &job.scene_job;
    if !job.quiet {
        for warning in &scene.warnings {
            note(&format!("warning: {warning}"));
        }
    }
    let machine = Machine::read();

    let progress = ProgressDisplay::new(job.quiet);
    let watch = Stopwatch::start();
    let compiled = compile_with_progress(
        scene,
        *camera,
        scene.film.width,
        scene.film.height,
        settings,
        &|phase, share| progress.show_build(phase, share),
    )?;
    let build = watch.span();

    interrupt::listen()?;
    let watch = Stopwatch::start();
    let outcome = integrator::render(scene, &compiled, settings, &|state| {
        progress.show(state);
        if interrupt::requested() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    let render = watch.span();
    progress.finish();
    let outcome = outcome?;

    let watch = Stopwatch::start();
    let images = write_images(job, &outcome)?;
    let write = watch.span();

    let plan = Plan::new(&compiled, settings);
    let report = RenderReport::new(ReportInput {
        scene: SceneReport {
            name: job.scene_job.name(),
            camera: job.scene_job.camera_name().to_owned(),
            width: outcome.film.width(),
            height: outcome.film.height(),
        },
        settings,
        plan: serde_json::to_value(&plan).expect("a plan is plain data with string keys"),
        accel: plan.accel,
        machine,
        film: &outcome.film,
        stats: &outcome.stats,
        ended: outcome.ended,
        load: load.clone(),
        times: Times {
            load: load.time,
            build,
            render,
            write,
        },
        images: images
            .iter()
            .map(|path| path.display().to_string())
            .collect(),
    });
    if let Some(path) = &job.report {
        write_json(path, &report)?;
    }
    if !job.quiet {
        print(&format!("{report}{}", places(&images)))?;
    }
    if outcome.ended != EndReason::Interrupted {
        return Ok(Status::Done);
    }
    note(&interruption(&report));
    Ok(Status::Interrupted)
}

/// Writes every image that was asked for and returns where they are. A film without a sample is no
/// picture and does not replace one.
fn write_images(job: &RenderJob, outcome: &Outcome) -> Result<Vec<PathBuf>> {
    let film = &outcome.film;
    if film.total_samples() == 0 {
        return Ok(Vec::new());
    }
    let SceneJob {
        scene, settings, ..
    } = &job.scene_job;
    let build = Build::current();
    let provenance = Provenance {
        scene: format!(
            "{}, camera {}",
            job.scene_job.name(),
            job.scene_job.camera_name()
        ),
        software: format!("wavepath {} ({})", build.version, build.commit),
        seed: settings.seed,
        bias: bias(settings, &outcome.stats),
    };
    for path in &job.images {
        write_image(path, film, scene.film.exposure, &provenance)?;
    }
    Ok(job
        .images
        .iter()
        .map(|path| std::path::absolute(path).unwrap_or(path.clone()))
        .collect())
}

fn write_json(path: &Path, report: &RenderReport) -> Result<()> {
    write_atomically(path, |file| {
        writeln!(file, "{}", report.to_json()).map_err(|error| Error::io(path, &error))
    })
}

fn places(images: &[PathBuf]) -> String {
    images
        .iter()
        .map(|path| format!("wrote {}\n", path.display()))
        .collect()
}

fn interruption(report: &RenderReport) -> String {
    match report.result.images.as_slice() {
        [] => "interrupted before the first sample; no image was written".to_owned(),
        images => format!(
            "interrupted: {} written with {} samples per pixel",
            images.join(" and "),
            report.result.samples_per_pixel()
        ),
    }
}
