//! What the arguments mean, after every check that needs no rendering.

use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::error::{Error, Result};
use crate::film::{ImageFormat, check_memory, check_writable};
use crate::integrator::thread_pool;
use crate::report::{LoadReport, Stopwatch};
use crate::scene::{
    self, Budget, MAX_BLOCK, MAX_WAVE, MOST_GLASS_SPLITS, MOST_LIGHT_SAMPLES, RenderSettings,
    SceneDescription,
};

use super::args::{BudgetArgs, CheckpointArgs, RenderArgs, SceneArgs};

/// Scene of the default command, as a path from the repository's root.
pub(super) const BUILT_IN_PATH: &str = "scenes/hexroom.toml";

/// The same scene, for when that file is not there.
const BUILT_IN_TEXT: &str = include_str!("../../scenes/hexroom.toml");

/// Most pixels across or down, as for scene files.
const MAX_SIDE: u32 = 65_535;

/// Most worker threads. Beyond any machine; it stops a slip of the keyboard from exhausting one.
pub(super) const MAX_THREADS: usize = 4096;

/// Seconds between two checkpoints unless others are asked for.
const CHECKPOINT_EVERY: f64 = 60.0;

/// Largest fixed bias of secondary rays, as for coordinates.
const MAX_SHADOW_BIAS: f64 = 1.8e18;

/// A loaded scene with the settings and the camera to look with. The film's size is the wanted one.
#[derive(Debug)]
pub(super) struct SceneJob {
    pub(super) scene: SceneDescription,
    /// Index into the scene's cameras.
    pub(super) camera: usize,
    pub(super) settings: RenderSettings,
    /// What loading took.
    pub(super) load: LoadReport,
}

/// A render with everything that it needs, files found to be writable.
#[derive(Debug)]
pub(super) struct RenderJob {
    pub(super) scene_job: SceneJob,
    /// Images to write, at least one.
    pub(super) images: Vec<PathBuf>,
    pub(super) report: Option<PathBuf>,
    pub(super) checkpoint: Option<CheckpointJob>,
    pub(super) quiet: bool,
}

/// Where and when checkpoints are written.
#[derive(Debug)]
pub(super) struct CheckpointJob {
    pub(super) file: PathBuf,
    pub(super) every: Duration,
    /// Whether the render is to go on with what is in the file.
    pub(super) resume: bool,
    /// Whether it is there.
    pub(super) exists: bool,
}

impl CheckpointJob {
    /// `None` if none was asked for. Errors rather than to overwrite what might still be of use.
    fn new(args: &CheckpointArgs) -> Result<Option<Self>> {
        check_positive("--checkpoint-every", args.checkpoint_every)?;
        let Some(file) = args.checkpoint.clone() else {
            return Ok(None);
        };
        let exists = file.exists();
        if exists && !args.resume {
            return Err(Error::usage(format!(
                "{}: is there already; give --resume to go on with it, or name another file",
                file.display()
            )));
        }
        let every = args.checkpoint_every.unwrap_or(CHECKPOINT_EVERY);
        Ok(Some(Self {
            file,
            every: Duration::try_from_secs_f64(every).unwrap_or(Duration::MAX),
            resume: args.resume,
            exists,
        }))
    }
}

impl SceneJob {
    pub(super) fn new(args: &SceneArgs) -> Result<Self> {
        check_scene_args(args)?;
        let watch = Stopwatch::start();
        let mut scene = load_scene(&args.scene, &args.set)?;
        let load = LoadReport::new(watch.span(), &scene.mesh_files);
        if args.strict {
            check_warnings(&scene)?;
        }
        scene.film.width = args.view.width.unwrap_or(scene.film.width);
        scene.film.height = args.view.height.unwrap_or(scene.film.height);
        let camera = args
            .view
            .camera
            .as_ref()
            .map_or(Ok(0), |name| find_camera(&scene, name))?;
        let defaults = RenderSettings::from_defaults(&scene.render);
        let settings = RenderSettings {
            integrator: args.integrator.unwrap_or(defaults.integrator),
            strategy: args.strategy.unwrap_or(defaults.strategy),
            sampler: args.sampler.unwrap_or(defaults.sampler),
            accel: args.accel.unwrap_or(defaults.accel),
            accel_quality: args.accel_quality.unwrap_or(defaults.accel_quality),
            wave: args.wave.unwrap_or(defaults.wave),
            block: args.block.unwrap_or(defaults.block),
            max_depth: args.max_depth.or(defaults.max_depth),
            roulette_depth: args.roulette_depth.unwrap_or(defaults.roulette_depth),
            light_samples: args.light_samples.unwrap_or(defaults.light_samples),
            glass_splits: args.glass_splits.unwrap_or(defaults.glass_splits),
            transparent_shadows: args.transparent_shadows || defaults.transparent_shadows,
            shadow_bias: args.shadow_bias.or(defaults.shadow_bias),
            clamp: args.clamp.or(defaults.clamp),
            supersampling: args.supersampling.unwrap_or(defaults.supersampling),
            aux: args.aux,
            force_features: args.force_features || defaults.force_features,
            ..defaults
        };
        Ok(Self {
            scene,
            camera,
            settings,
            load,
        })
    }

    /// The scene of the default command, as its file says.
    fn built_in() -> Result<Self> {
        Self::new(&SceneArgs {
            scene: PathBuf::from(BUILT_IN_PATH),
            ..SceneArgs::default()
        })
    }

    /// The scene's name: its file without the extension.
    pub(super) fn name(&self) -> String {
        scene::name(&self.scene.source)
            .to_string_lossy()
            .into_owned()
    }

    /// Name of the chosen camera.
    pub(super) fn camera_name(&self) -> &str {
        &self.scene.cameras[self.camera].name
    }
}

impl RenderJob {
    pub(super) fn new(args: &RenderArgs) -> Result<Self> {
        // First what is quick to check: loading a large scene takes its time.
        let budget = budget(&args.budget)?;
        check_range("--threads", args.threads, 1, MAX_THREADS)?;
        let images = match args.output.as_slice() {
            [] => vec![default_image(&args.scene.scene)],
            given => given.to_vec(),
        };
        let checkpoint = CheckpointJob::new(&args.checkpoint)?;
        let checkpoint_file = checkpoint.as_ref().map(|job| job.file.as_path());
        check_outputs(&images, args.report.as_deref(), checkpoint_file)?;
        let load = || SceneJob::new(&args.scene);
        let mut scene_job = match args.threads {
            Some(threads) => thread_pool(threads)?.install(load)?,
            None => load()?,
        };
        let settings = &mut scene_job.settings;
        settings.budget = budget.unwrap_or(settings.budget);
        settings.adaptive |= args.adaptive;
        settings.threads = args.threads.unwrap_or(settings.threads);
        settings.seed = args.seed.unwrap_or(settings.seed);
        Self {
            scene_job,
            images,
            report: args.report.clone(),
            checkpoint,
            quiet: args.quiet,
        }
        .checked()
    }

    /// The default command: the hexagonal room into `hexroom.png`.
    pub(super) fn built_in() -> Result<Self> {
        let images = vec![default_image(Path::new(BUILT_IN_PATH))];
        check_outputs(&images, None, None)?;
        Self {
            scene_job: SceneJob::built_in()?,
            images,
            report: None,
            checkpoint: None,
            quiet: false,
        }
        .checked()
    }

    /// The job, if the machine can hold its film.
    fn checked(self) -> Result<Self> {
        let SceneJob {
            scene, settings, ..
        } = &self.scene_job;
        let halves = if settings.adaptive { 2 } else { 1 };
        check_memory(scene.film.width, scene.film.height, settings.aux, halves)?;
        Ok(self)
    }
}

/// The scene in a file, or the program's own copy of the default one where its file is not there.
fn load_scene(path: &Path, overrides: &[String]) -> Result<SceneDescription> {
    if path == Path::new(BUILT_IN_PATH) && !path.exists() {
        scene::parse(BUILT_IN_TEXT, path, overrides)
    } else {
        scene::load(path, overrides)
    }
}

fn check_scene_args(args: &SceneArgs) -> Result<()> {
    check_range("--width", args.view.width, 1, MAX_SIDE)?;
    check_range("--height", args.view.height, 1, MAX_SIDE)?;
    check_range("--max-depth", args.max_depth, 1, u32::MAX)?;
    check_range("--light-samples", args.light_samples, 1, MOST_LIGHT_SAMPLES)?;
    check_range("--glass-splits", args.glass_splits, 0, MOST_GLASS_SPLITS)?;
    check_range("--wave", args.wave, 1, MAX_WAVE)?;
    check_positive("--clamp", args.clamp)?;
    if args.shadow_bias.is_some_and(f64::is_nan) {
        return Err(Error::usage("--shadow-bias must be a number"));
    }
    check_range("--shadow-bias", args.shadow_bias, 0.0, MAX_SHADOW_BIAS)?;
    check_range("--block", args.block, 1, MAX_BLOCK)
}

/// Errors with all warnings about the scene, if there are any.
fn check_warnings(scene: &SceneDescription) -> Result<()> {
    let warnings = &scene.warnings;
    if warnings.is_empty() {
        return Ok(());
    }
    let listed = warnings.join("; ");
    let message = format!("{} warnings under --strict: {listed}", warnings.len());
    Err(Error::file(&scene.source, message))
}

/// The limit that was typed, if one was.
fn budget(args: &BudgetArgs) -> Result<Option<Budget>> {
    check_range("--spp", args.spp, 1, u64::MAX)?;
    check_positive("--seconds", args.seconds)?;
    check_positive("--error", args.error)?;
    let samples = args.spp.map(Budget::Samples);
    Ok(samples
        .or(args.seconds.map(Budget::Seconds))
        .or(args.error.map(Budget::Error)))
}

/// Errors if an image's format is unknown, two outputs are the same file, or one cannot be written.
fn check_outputs(
    images: &[PathBuf],
    report: Option<&Path>,
    checkpoint: Option<&Path>,
) -> Result<()> {
    for image in images {
        ImageFormat::from_path(image)?;
    }
    report.map_or(Ok(()), check_report_name)?;
    let outputs: Vec<&Path> = images
        .iter()
        .map(PathBuf::as_path)
        .chain(report)
        .chain(checkpoint)
        .collect();
    let absolute = |path: &&Path| std::path::absolute(path).unwrap_or(path.to_path_buf());
    let places: Vec<PathBuf> = outputs.iter().map(absolute).collect();
    for (index, place) in places.iter().enumerate() {
        if places[..index].contains(place) {
            return Err(Error::usage(format!(
                "{}: named twice as output",
                place.display()
            )));
        }
    }
    outputs.into_iter().try_for_each(check_writable)
}

/// Errors unless the name of a report ends in `.json`.
pub(super) fn check_report_name(path: &Path) -> Result<()> {
    match path.extension() {
        Some(extension) if extension.eq_ignore_ascii_case("json") => Ok(()),
        _ => Err(Error::usage(format!(
            "{}: the name of a report must end in .json",
            path.display()
        ))),
    }
}

pub(super) fn check_range<T>(option: &str, value: Option<T>, least: T, most: T) -> Result<()>
where
    T: PartialOrd + std::fmt::Display,
{
    match value {
        Some(value) if value < least => Err(Error::usage(format!(
            "{option} must be at least {least}, not {value}"
        ))),
        Some(value) if value > most => Err(Error::usage(format!(
            "{option} must be at most {most}, not {value}"
        ))),
        _ => Ok(()),
    }
}

pub(super) fn check_positive(option: &str, value: Option<f64>) -> Result<()> {
    match value {
        Some(value) if !(value.is_finite() && value > 0.0) => Err(Error::usage(format!(
            "{option} must be a number greater than 0, not {value}"
        ))),
        _ => Ok(()),
    }
}

fn find_camera(scene: &SceneDescription, name: &str) -> Result<usize> {
    scene
        .cameras
        .iter()
        .position(|camera| camera.name == name)
        .ok_or_else(|| {
            let names: Vec<&str> = scene
                .cameras
                .iter()
                .map(|camera| camera.name.as_str())
                .collect();
            Error::usage(format!(
                "{} has no camera \"{name}\"; it has {}",
                scene.source.display(),
                names.join(", ")
            ))
        })
}

/// The image of a scene if none is named: its name with `.png`, in the current directory.
fn default_image(scene: &Path) -> PathBuf {
    let mut name = scene::name(scene).to_owned();
    name.push(".png");
    PathBuf::from(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_refused_with_the_limit() {
        let message = check_range("--wave", Some(0), 1, MAX_WAVE)
            .unwrap_err()
            .message;
        assert_eq!(message, "--wave must be at least 1, not 0");
        let message = check_range("--block", Some(65), 1, MAX_BLOCK)
            .unwrap_err()
            .message;
        assert_eq!(message, "--block must be at most 64, not 65");
        assert!(check_range("--block", Some(MAX_BLOCK), 1, MAX_BLOCK).is_ok());
        assert!(check_range("--block", None, 1, MAX_BLOCK).is_ok());
    }

    #[test]
    fn goals_must_be_positive_numbers() {
        for value in [0.0, -0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(check_positive("--seconds", Some(value)).is_err(), "{value}");
        }
        assert!(check_positive("--seconds", Some(1e-9)).is_ok());
    }

    #[test]
    fn each_limit_becomes_its_budget() {
        let none = BudgetArgs::default();
        assert_eq!(budget(&none).unwrap(), None);
        let spp = BudgetArgs {
            spp: Some(7),
            ..none
        };
        assert_eq!(budget(&spp).unwrap(), Some(Budget::Samples(7)));
        let seconds = BudgetArgs {
            seconds: Some(0.5),
            ..BudgetArgs::default()
        };
        assert_eq!(budget(&seconds).unwrap(), Some(Budget::Seconds(0.5)));
        let error = BudgetArgs {
            error: Some(0.01),
            ..BudgetArgs::default()
        };
        assert_eq!(budget(&error).unwrap(), Some(Budget::Error(0.01)));
    }

    #[test]
    fn default_image_is_named_after_the_scene_and_lies_here() {
        assert_eq!(
            default_image(Path::new("/a/b/room.v2.toml")),
            Path::new("room.v2.png")
        );
        assert_eq!(default_image(Path::new("..")), Path::new("scene.png"));
        let mesh = Path::new("a/bunny.obj.zst");
        assert_eq!(default_image(mesh), Path::new("bunny.png"));
    }

    #[test]
    fn outputs_must_have_a_known_format_and_differ() {
        let directory = tempfile::tempdir().unwrap();
        let at = |name: &str| directory.path().join(name);
        assert!(
            check_outputs(
                &[at("a.png"), at("a.exr")],
                Some(&at("a.json")),
                Some(&at("a"))
            )
            .is_ok()
        );
        let twice = check_outputs(&[at("a.png"), at("./a.png")], None, None).unwrap_err();
        assert!(twice.message.contains("named twice"), "{twice}");
        let report = check_outputs(&[at("a.png")], Some(&at("a.toml")), None).unwrap_err();
        let checkpoint = check_outputs(&[at("a.png")], None, Some(&at("a.png"))).unwrap_err();
        assert!(checkpoint.message.contains("named twice"), "{checkpoint}");
        assert!(report.message.contains("must end in .json"), "{report}");
        assert!(check_outputs(&[at("a.bmp")], None, None).is_err());
        assert!(check_outputs(&[at("no/a.png")], None, None).is_err());
    }
}
