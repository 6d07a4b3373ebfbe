//! `wavepath render` and the default command.

use std::io::Write;
use std::ops::ControlFlow;
use std::path::Path;

use crate::compile::compile_with_progress;
use crate::error::{Error, Result};
use crate::film::{Provenance, write_atomically, write_image};
use crate::integrator::checkpoint::{Identity, Resume, Saving, Snapshot};
use crate::integrator::{self, Outcome, clock::process_cpu_seconds, plan::Plan, stats::EndReason};
use crate::report::{
    Build, Machine, RenderReport, ReportInput, ResultReport, SceneReport, Stopwatch, Times, bias,
};

use super::job::{CheckpointJob, RenderJob, SceneJob};
use super::progress::ProgressDisplay;
use super::{Status, interrupt, note, print};

pub(super) fn run(job: &RenderJob) -> Result<Status> {
    let (report, checkpoint) = execute(job)?;
    if !job.quiet {
        print(&format!("{report}{}", places(&report.result)))?;
    }
    let interrupted = report.result.ended == EndReason::Interrupted;
    if interrupted {
        note(&interruption(&report));
    }
    checkpoint?;
    Ok(match interrupted {
        true => Status::Interrupted,
        false => Status::Done,
    })
}

/// Renders, shows progress, writes the images and the report, and returns it. Ctrl-C ends the render,
/// not the rest, nor does a checkpoint that could not be written: what comes with the report tells.
pub(super) fn execute(job: &RenderJob) -> Result<(RenderReport, Result<()>)> {
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
    let identity = || Identity::new(scene, *camera, settings, &Build::current());
    let mut checkpoints = job
        .checkpoint
        .as_ref()
        .map(|job| Checkpoints::new(job, identity()));
    let resume = match &checkpoints {
        Some(checkpoints) => checkpoints.resume(job)?,
        None => None,
    };

    let progress = ProgressDisplay::new(job.quiet);
    let watch = Stopwatch::start();
    let compiled = integrator::thread_pool(settings.threads)?.install(|| {
        compile_with_progress(
            scene,
            *camera,
            scene.film.width,
            scene.film.height,
            settings,
            &|phase, share| progress.show_build(phase, share),
        )
    })?;
    let build = watch.span();

    interrupt::listen()?;
    let observer = |state: &_| {
        progress.show(state);
        if interrupt::requested() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let outcome = match &mut checkpoints {
        None => integrator::render(scene, &compiled, settings, &observer),
        Some(checkpoints) => {
            let saving = Saving {
                identity: checkpoints.identity.clone(),
                every: checkpoints.job.every,
                save: &mut |snapshot| checkpoints.save(snapshot),
            };
            integrator::render_resumable(
                scene,
                &compiled,
                settings,
                &observer,
                resume,
                Some(saving),
            )
        }
    };
    progress.finish();
    let outcome = outcome?;

    let watch = Stopwatch::start();
    let images = write_images(job, &outcome)?;
    let write = watch.span();

    let plan = Plan::new(&compiled, settings);
    let mut report = RenderReport::new(ReportInput {
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
        earlier: outcome.earlier,
        checkpoint: checkpoints.as_ref().and_then(Checkpoints::written),
        load: load.clone(),
        times: Times {
            load: load.time,
            build,
            prepare: outcome.stats.prepare,
            render: outcome.stats.rounds,
            estimate: outcome.stats.between,
            write,
            process_cpu_seconds: 0.0,
        },
        images,
    });
    // To free the film and the scene takes time too.
    drop((outcome, compiled));
    report.times.process_cpu_seconds = process_cpu_seconds();
    if let Some(path) = &job.report {
        write_json(path, &report)?;
    }
    let failed = checkpoints.and_then(|checkpoints| checkpoints.failed);
    Ok((report, failed.map_or(Ok(()), Err)))
}

/// The checkpoints of a render.
struct Checkpoints<'a> {
    job: &'a CheckpointJob,
    identity: Identity,
    /// Whether there is one.
    exists: bool,
    /// Why the last one was not written.
    failed: Option<Error>,
}

impl<'a> Checkpoints<'a> {
    fn new(job: &'a CheckpointJob, identity: Identity) -> Self {
        Self {
            job,
            identity,
            exists: job.exists,
            failed: None,
        }
    }

    /// What there is to go on with.
    fn resume(&self, job: &RenderJob) -> Result<Option<Resume>> {
        let CheckpointJob {
            file,
            resume,
            exists,
            ..
        } = self.job;
        if *resume && !exists && !job.quiet {
            note(&format!(
                "there is no {} yet: this is the beginning",
                file.display()
            ));
        }
        let SceneJob {
            scene, settings, ..
        } = &job.scene_job;
        exists
            .then(|| Resume::read(file, scene, settings, &self.identity))
            .transpose()
    }

    /// Writes one. The render goes on if that fails: the next may be written, and the image will be.
    fn save(&mut self, snapshot: &Snapshot<'_>) {
        self.failed = snapshot.write(&self.job.file).err();
        match &self.failed {
            Some(error) => note(&format!("warning: no checkpoint: {error}")),
            None => self.exists = true,
        }
    }

    /// The file, if it is there.
    fn written(&self) -> Option<String> {
        (self.exists && self.job.file.exists()).then(|| absolute(&self.job.file))
    }
}

/// Writes every image that was asked for and returns where they are. A film without a sample is no
/// picture and does not replace one.
fn write_images(job: &RenderJob, outcome: &Outcome) -> Result<Vec<String>> {
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
    Ok(job.images.iter().map(|path| absolute(path)).collect())
}

/// The path from the root, to be told.
fn absolute(path: &Path) -> String {
    let absolute = std::path::absolute(path);
    absolute.as_deref().unwrap_or(path).display().to_string()
}

fn write_json(path: &Path, report: &RenderReport) -> Result<()> {
    write_atomically(path, |file| {
        writeln!(file, "{}", report.to_json()).map_err(|error| Error::io(path, &error))
    })
}

fn places(result: &ResultReport) -> String {
    let written = result.images.iter().chain(&result.checkpoint);
    written.map(|path| format!("wrote {path}\n")).collect()
}

fn interruption(report: &RenderReport) -> String {
    let mut text = match report.result.images.as_slice() {
        [] => "interrupted before the first sample; no image was written".to_owned(),
        images => format!(
            "interrupted: {} written with {} samples per pixel",
            images.join(" and "),
            report.result.samples_per_pixel()
        ),
    };
    if let Some(file) = &report.result.checkpoint {
        text += &format!("; --checkpoint {file} --resume goes on");
    }
    text
}
