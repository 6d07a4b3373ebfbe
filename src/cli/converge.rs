//! `wavepath converge`: error against run time.

use std::path::PathBuf;
use std::rc::Rc;

use crate::error::{Error, Result};
use crate::film::check_memory;
use crate::report::SceneReport;
use crate::report::converge::{
    Configuration, ConfigurationInput, ConvergeInput, ConvergeSettings, Event, Limit,
    ReferenceChoice, ReferenceOptions, Schedule, check_folder, converge, same_picture, write,
};
use crate::scene::{self, Budget};

use super::args::{ConvergeArgs, SceneArgs};
use super::job::{MAX_THREADS, SceneJob, check_positive, check_range};
use super::variations::{Variation, table_variations, variations};
use super::{Status, interrupt, note, print};

/// Most repeats. Beyond any patience; it stops a slip of the keyboard.
const MAX_REPEATS: u32 = 10_000;

pub(super) fn run(args: &ConvergeArgs) -> Result<Status> {
    // First what is quick to check: loading a large scene takes its time.
    check_range("--repeats", Some(args.repeats), 1, MAX_REPEATS)?;
    check_range("--threads", args.threads, 1, MAX_THREADS)?;
    check_range("--spp", args.spp, 1, u64::MAX >> 2)?;
    check_positive("--seconds", args.seconds)?;
    check_positive("--reference-error", Some(args.reference_error))?;
    check_positive("--reference-seconds", Some(args.reference_seconds))?;
    let variations = if args.table {
        table_variations()
    } else {
        variations(&args.vary, &args.config)?
    };
    let reference = reference(args)?;
    let folder = args.out.clone().unwrap_or_else(|| {
        let mut name = scene::name(&args.scene).to_owned();
        name.push("-converge");
        PathBuf::from(name)
    });
    let (base, configurations) = configurations(args, variations)?;
    check_folder(&folder)?;

    let film = base.scene.film;
    let settings = ConvergeSettings {
        repeats: args.repeats,
        limit: match (&configurations[0].schedule, args.seconds) {
            (_, Some(seconds)) => Limit::Seconds(seconds),
            _ => Limit::Samples(
                configurations
                    .iter()
                    .filter_map(|configuration| configuration.schedule.samples())
                    .max()
                    .unwrap_or_default(),
            ),
        },
        threads: args.threads.unwrap_or(base.settings.threads),
        seed: args.seed.unwrap_or(base.settings.seed),
    };
    let input = ConvergeInput {
        scene: SceneReport {
            name: base.name(),
            camera: base.camera_name().to_owned(),
            width: film.width,
            height: film.height,
        },
        configurations,
        settings,
        reference,
        noise: true,
        folder: &folder,
    };
    interrupt::listen()?;
    let results = converge(input, &interrupt::requested, &mut |event| match event {
        Event::Progress(_) if args.quiet => {}
        Event::Progress(text) => note(text),
        Event::Warning(text) => note(&format!("warning: {text}")),
    })?;
    let is_empty = |configuration: &Configuration| configuration.checkpoints.is_empty();
    if results.configurations.iter().any(is_empty) {
        note("interrupted before the first checkpoint; nothing was written");
        return Ok(Status::Interrupted);
    }
    write(&results, &folder)?;
    let table = if args.table {
        results.images_table()
    } else {
        results.to_string()
    };
    print(&format!("{table}wrote {}\n", folder.display()))?;
    Ok(if results.interrupted {
        Status::Interrupted
    } else {
        Status::Done
    })
}

/// The scene as it is, and every configuration of it.
fn configurations(
    args: &ConvergeArgs,
    variations: Vec<Variation>,
) -> Result<(SceneJob, Vec<ConfigurationInput>)> {
    let job = |overrides: &[String]| {
        SceneJob::new(&SceneArgs {
            scene: args.scene.clone(),
            view: args.view.clone(),
            set: args.set.iter().chain(overrides).cloned().collect(),
            ..SceneArgs::default()
        })
    };
    let base = job(&[])?;
    if !args.quiet {
        for warning in &base.scene.warnings {
            note(&format!("warning: {warning}"));
        }
    }
    check_memory(
        base.scene.film.width,
        base.scene.film.height,
        false,
        if base.settings.adaptive { 2 } else { 1 },
    )?;
    let mut inputs: Vec<ConfigurationInput> = Vec::new();
    for Variation {
        name,
        overrides,
        checkpoints,
    } in variations
    {
        let job = job(&overrides)?;
        let schedule = match (checkpoints, args.seconds, job.settings.budget) {
            (Some(checkpoints), _, _) => Schedule::At(checkpoints),
            (None, Some(seconds), _) => Schedule::Seconds(seconds),
            (None, None, Budget::Samples(samples)) => {
                Schedule::doubling(args.spp.unwrap_or(samples))
            }
            (None, None, Budget::Seconds(_) | Budget::Error(_)) => {
                return Err(Error::usage("give --spp or --seconds"));
            }
        };
        // A large scene is held once, whatever the number of configurations of its renders.
        let known = inputs
            .iter()
            .find(|other| same_picture(&other.scene, &job.scene, job.camera))
            .map(|other| Rc::clone(&other.scene));
        inputs.push(ConfigurationInput {
            name,
            overrides,
            camera: job.camera,
            settings: job.settings,
            load: job.load.time,
            schedule,
            scene: known.unwrap_or_else(|| Rc::new(job.scene)),
        });
    }
    Ok((base, inputs))
}

fn reference(args: &ConvergeArgs) -> Result<ReferenceOptions> {
    let choice = match args.reference.as_str() {
        "auto" => ReferenceChoice::Auto,
        "rendered" => ReferenceChoice::Rendered,
        file if file.to_ascii_lowercase().ends_with(".exr") => {
            ReferenceChoice::File(PathBuf::from(file))
        }
        other => {
            return Err(Error::usage(format!(
                "--reference is auto, rendered or an image that ends in .exr, not {other}"
            )));
        }
    };
    Ok(ReferenceOptions {
        choice,
        error: args.reference_error,
        seconds: args.reference_seconds,
        cache: args.cache.clone().or_else(user_cache),
    })
}

/// The program's folder in the user's cache folder (XDG Base Directory Specification), if there is one.
fn user_cache() -> Option<PathBuf> {
    let folder = |variable, below: &str| {
        let path = PathBuf::from(std::env::var_os(variable)?).join(below);
        path.is_absolute().then_some(path)
    };
    let cache = folder("XDG_CACHE_HOME", "").or_else(|| folder("HOME", ".cache"))?;
    Some(cache.join("wavepath"))
}
