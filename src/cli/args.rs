//! What the user typed. What it means is decided in `job`.

use std::path::PathBuf;

use clap::{Parser, Subcommand};

use crate::report::accels::RayKind;
use crate::scene::procedural::ScalableKind;
use crate::scene::{AccelKind, AccelQuality, IntegratorKind, SamplerKind, Strategy, Supersampling};

/// A data-oriented wavefront path tracer for CPUs.
///
/// Without a command it renders the hexagonal room into hexroom.png.
#[derive(Debug, Parser)]
#[command(
    name = "wavepath",
    version = concat!(env!("CARGO_PKG_VERSION"), " (", env!("WAVEPATH_COMMIT"), ")")
)]
pub(super) struct Args {
    #[command(subcommand)]
    pub(super) command: Option<Command>,
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Render a scene
    Render(Box<RenderArgs>),
    /// Print what a scene needs, and what was left out because it does not
    Plan(Box<SceneArgs>),
    /// Compare an image with a reference
    Compare(CompareArgs),
    /// Make a mesh of any size, for measuring how cost grows with the number of triangles
    Mesh(MeshArgs),
    /// Compare acceleration structures on rays of a scene
    Accels(AccelsArgs),
    /// Measure error against run time, and compare settings by it
    Converge(Box<ConvergeArgs>),
    /// Render figures of the hexagonal room, and a page that shows them
    Gallery(GalleryArgs),
    /// Hold stiff and extreme cases against what is known of them
    Stability(StabilityArgs),
}

/// What decides how a scene is compiled.
#[derive(Debug, Default, clap::Args)]
pub(super) struct SceneArgs {
    /// Scene file (TOML), or a mesh (.obj, .obj.gz, .obj.zst), which gets a camera, a sky and a sun
    pub(super) scene: PathBuf,

    /// End with an error where there would be warnings about the scene
    #[arg(long)]
    pub(super) strict: bool,

    #[command(flatten)]
    pub(super) view: ViewArgs,

    /// Which light transport is computed [default: the scene's, else path]
    #[arg(long, value_name = "KIND")]
    pub(super) integrator: Option<IntegratorKind>,

    /// How a path finds light [default: the scene's, else mis]
    #[arg(long, value_name = "KIND")]
    pub(super) strategy: Option<Strategy>,

    /// Where sample points come from [default: the scene's, else sobol]
    #[arg(long, value_name = "KIND")]
    pub(super) sampler: Option<SamplerKind>,

    /// Acceleration structure [default: the scene's, else auto]
    #[arg(long, value_name = "KIND")]
    pub(super) accel: Option<AccelKind>,

    /// How much time its build takes for faster rays (same image) [default: the scene's, else medium]
    #[arg(long, value_name = "QUALITY")]
    pub(super) accel_quality: Option<AccelQuality>,

    /// Most path segments: 1 is emitted light alone, 2 adds direct light [default: the scene's, else
    /// no limit]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) max_depth: Option<u32>,

    /// First depth, in segments already traced, at which roulette may end a path [default: the
    /// scene's, else 5]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) roulette_depth: Option<u32>,

    /// Light samples per hit, each with a shadow ray, 1 to 64 [default: the scene's, else 1]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) light_samples: Option<u32>,

    /// How often a path that has met only mirrors and glass follows both what glass reflects and what it
    /// refracts, 0 to 8 [default: the scene's, else 0]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) glass_splits: Option<u32>,

    /// Let shadow rays pass straight through glass, weighted by its transmittance (biased)
    #[arg(long)]
    pub(super) transparent_shadows: bool,

    /// Start secondary rays this far off their surface, in scene units, instead of where rounding errors
    /// say: shows what a bias set by hand does to a picture (biased)
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    pub(super) shadow_bias: Option<f64>,

    /// Darken camera samples whose brightest channel is above this radiance to it (biased) [default: the
    /// scene's, else none are]
    #[arg(long, value_name = "RADIANCE", allow_negative_numbers = true)]
    pub(super) clamp: Option<f64>,

    /// Where in a pixel camera rays pass: on, anywhere in it; off, through its centre; auto, off for
    /// whitted alone [default: the scene's, else auto]
    #[arg(long, value_name = "WHERE")]
    pub(super) supersampling: Option<Supersampling>,

    /// Also accumulate albedo, normal and depth of the first hit, as layers of an EXR image
    #[arg(long)]
    pub(super) aux: bool,

    /// Run the kernels that can do everything, though the scene does not need them (same image)
    #[arg(long)]
    pub(super) force_features: bool,

    /// Paths in flight per thread (same image) [default: 4096]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) wave: Option<usize>,

    /// Samples per pixel in one block, the unit of scheduling and of the error estimate [default: 16]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) block: Option<u32>,

    /// Replace a value of the scene file; may be given several times
    #[arg(long, value_name = "PATH.TO.KEY=VALUE")]
    pub(super) set: Vec<String>,
}

/// With which camera and how large a scene is looked at.
#[derive(Debug, Default, Clone, clap::Args)]
pub(super) struct ViewArgs {
    /// Camera, by its name in the scene [default: the scene's first]
    #[arg(long, value_name = "NAME")]
    pub(super) camera: Option<String>,

    /// Pixels across [default: the scene's]
    #[arg(long, value_name = "PIXELS", allow_negative_numbers = true)]
    pub(super) width: Option<u32>,

    /// Pixels down [default: the scene's]
    #[arg(long, value_name = "PIXELS", allow_negative_numbers = true)]
    pub(super) height: Option<u32>,
}

/// `wavepath render`
#[derive(Debug, clap::Args)]
pub(super) struct RenderArgs {
    #[command(flatten)]
    pub(super) scene: SceneArgs,

    /// Image to write, .png or .exr; may be given several times [default: the scene's name with .png]
    #[arg(short, long, value_name = "FILE")]
    pub(super) output: Vec<PathBuf>,

    #[command(flatten)]
    pub(super) budget: BudgetArgs,

    /// Give tiles with a larger estimated error more samples; the mean number of samples, the time or the
    /// error of the image is what was asked for
    #[arg(long)]
    pub(super) adaptive: bool,

    /// Threads that load, build and render (same image) [default: all cores]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) threads: Option<usize>,

    /// Seed of every random number [default: the scene's, else 0]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) seed: Option<u64>,

    #[command(flatten)]
    pub(super) checkpoint: CheckpointArgs,

    /// Write the report of the render as JSON
    #[arg(long, value_name = "FILE.json")]
    pub(super) report: Option<PathBuf>,

    /// Show neither progress nor summary
    #[arg(short, long)]
    pub(super) quiet: bool,
}

/// How a render survives its interruption.
#[derive(Debug, Default, clap::Args)]
pub(super) struct CheckpointArgs {
    /// Keep in this file what the render needs to go on after an interruption: written every now and then, at
    /// Ctrl-C or the signal to terminate, and at the end
    #[arg(long, value_name = "FILE")]
    pub(super) checkpoint: Option<PathBuf>,

    /// Seconds between two checkpoints [default: 60]
    #[arg(
        long,
        value_name = "S",
        requires = "checkpoint",
        allow_negative_numbers = true
    )]
    pub(super) checkpoint_every: Option<f64>,

    /// Go on with the render in the checkpoint, to the same image as without interruption; from the beginning
    /// if the file is not there yet. Samples, seconds and error are those of the whole render
    #[arg(long, requires = "checkpoint")]
    pub(super) resume: bool,
}

/// What ends a render; at most one of them.
#[derive(Debug, Default, clap::Args)]
#[group(multiple = false)]
pub(super) struct BudgetArgs {
    /// End after this many samples per pixel [default: the scene's, else 64]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) spp: Option<u64>,

    /// End after this many seconds of rendering
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub(super) seconds: Option<f64>,

    /// End when the image's estimated relative error is at most this fraction (0.03 is 3 %)
    #[arg(long, value_name = "E", allow_negative_numbers = true)]
    pub(super) error: Option<f64>,
}

/// `wavepath compare`
#[derive(Debug, clap::Args)]
pub(super) struct CompareArgs {
    /// EXR image
    pub(super) a: PathBuf,

    /// EXR image of the same size, the reference
    pub(super) b: PathBuf,

    /// Exit with code 1 if relMSE is larger, or if a pixel is not finite
    #[arg(long, value_name = "X", allow_negative_numbers = true)]
    pub(super) max_relmse: Option<f64>,

    /// Write the relative difference of luminance: red where A is brighter, blue where B is
    #[arg(long, value_name = "FILE.png")]
    pub(super) diff: Option<PathBuf>,
}

/// `wavepath mesh`
#[derive(Debug, clap::Args)]
pub(super) struct MeshArgs {
    /// What to make; it fits into [-1, 1]³
    pub(super) kind: ScalableKind,

    /// Most triangles, 1000 to 30000000: a hairball may have 7 less, a terrain a row less, and a sponge
    /// comes in steps
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) triangles: u32,

    /// Wavefront OBJ file to write
    #[arg(short, long, value_name = "FILE.obj")]
    pub(super) output: PathBuf,

    /// Seed of the random numbers; a sponge has none
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        allow_negative_numbers = true
    )]
    pub(super) seed: u64,

    /// Show neither progress nor summary
    #[arg(short, long)]
    pub(super) quiet: bool,
}

/// `wavepath accels`
///
/// Builds each structure over the scene, makes sets of rays from the scene itself, and runs the
/// structures over them in turn, in rounds. Every figure is per CPU second of the worker threads. Each
/// structure's answers are held against a scan over all primitives, in a large scene on a sample; if one
/// of this program's own differs by more than rounding explains, the exit code is 1.
#[derive(Debug, clap::Args)]
pub(super) struct AccelsArgs {
    /// Scene file (TOML), or a mesh (.obj, .obj.gz, .obj.zst), which gets a camera, a sky and a sun
    pub(super) scene: PathBuf,

    /// Structures, separated by commas: linear, octree, bvh2, bvh8, packet; bvh8-best and packet-best, built at
    /// best quality; obvhs-bvh2 and obvhs-cwbvh, with their own traversals; embree-{medium,high,robust}, by
    /// single rays or with -packet or -coherent by packets; embree for all of those [default: all]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(super) structures: Vec<String>,

    /// Kinds of rays, separated by commas [default: all]
    #[arg(long, value_name = "KINDS", value_delimiter = ',')]
    pub(super) rays: Vec<RayKind>,

    /// Worker threads, and threads of the builds [default: all cores]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) threads: Option<usize>,

    /// Rays per set
    #[arg(long, value_name = "N", default_value_t = 1 << 20, allow_negative_numbers = true)]
    pub(super) count: usize,

    /// Rays per call, as many as the renderer's wave has
    #[arg(
        long,
        value_name = "N",
        default_value_t = 4096,
        allow_negative_numbers = true
    )]
    pub(super) batch: usize,

    /// Timed runs of each structure over each set, after one that is not timed
    #[arg(
        long,
        value_name = "N",
        default_value_t = 5,
        allow_negative_numbers = true
    )]
    pub(super) rounds: usize,

    /// Seed of the rays [default: the scene's, else 0]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) seed: Option<u64>,

    #[command(flatten)]
    pub(super) view: ViewArgs,

    /// Replace a value of the scene file; may be given several times
    #[arg(long, value_name = "PATH.TO.KEY=VALUE")]
    pub(super) set: Vec<String>,

    /// Write the comparison with every round as JSON
    #[arg(long, value_name = "FILE.json")]
    pub(super) json: Option<PathBuf>,

    /// Do not tell what is being done
    #[arg(short, long)]
    pub(super) quiet: bool,
}

/// `wavepath converge`
///
/// Renders each configuration several times and holds the image against a reference at 1, 2, 4, … samples
/// per pixel; the clock runs while rendering alone. Configurations take turns. Writes converge.json,
/// converge.csv, index.html and pictures, and prints a summary.
#[derive(Debug, clap::Args)]
pub(super) struct ConvergeArgs {
    /// Scene file (TOML), or a mesh (.obj, .obj.gz, .obj.zst), which gets a camera, a sky and a sun
    pub(super) scene: PathBuf,

    /// Compare these values of a setting: any path as for --set, a single word being one of the scene's
    /// [render] table, as in strategy=mis,nee. Given several times, every combination is compared
    #[arg(long, value_name = "KEY=VALUE,VALUE,…")]
    pub(super) vary: Vec<String>,

    /// Compare these settings under a name; may be given several times
    #[arg(long, value_name = "NAME=KEY=VALUE,…")]
    pub(super) config: Vec<String>,

    /// Replace a value of the scene file in all configurations; may be given several times
    #[arg(long, value_name = "PATH.TO.KEY=VALUE")]
    pub(super) set: Vec<String>,

    /// End each render after this many samples per pixel [default: the scene's, else 64]
    #[arg(
        long,
        value_name = "N",
        conflicts_with = "seconds",
        allow_negative_numbers = true
    )]
    pub(super) spp: Option<u64>,

    /// End each render before it takes longer than this many CPU seconds
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub(super) seconds: Option<f64>,

    /// Independent renders of each configuration; intervals come from their spread
    #[arg(
        long,
        value_name = "N",
        default_value_t = 5,
        allow_negative_numbers = true
    )]
    pub(super) repeats: u32,

    /// What images are held against: an EXR image; auto, the scene's closed form if it states one, else
    /// rendered; or rendered
    #[arg(long, value_name = "FILE.exr|auto|rendered", default_value = "auto")]
    pub(super) reference: String,

    /// Relative error at which a rendered reference is good enough (0.005 is 0.5 %)
    #[arg(
        long,
        value_name = "E",
        default_value_t = 0.005,
        allow_negative_numbers = true
    )]
    pub(super) reference_error: f64,

    /// CPU seconds after which a rendered reference has to be good enough
    #[arg(
        long,
        value_name = "S",
        default_value_t = 300.0,
        allow_negative_numbers = true
    )]
    pub(super) reference_seconds: f64,

    /// Folder where rendered references are kept [default: wavepath in the user's cache folder]
    #[arg(long, value_name = "FOLDER")]
    pub(super) cache: Option<PathBuf>,

    /// Folder to write to [default: the scene's name with -converge]
    #[arg(short, long, value_name = "FOLDER")]
    pub(super) out: Option<PathBuf>,

    /// The table of the hexagonal room's first report: Whitted's method, and paths at 1, 100 and 400
    /// samples per pixel
    #[arg(long, conflicts_with_all = ["vary", "config", "spp", "seconds"])]
    pub(super) table: bool,

    /// Worker threads [default: all cores]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) threads: Option<usize>,

    /// Seed from which those of the repeats are derived [default: the scene's, else 0]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) seed: Option<u64>,

    #[command(flatten)]
    pub(super) view: ViewArgs,

    /// Do not tell what is being done
    #[arg(short, long)]
    pub(super) quiet: bool,
}

/// `wavepath gallery`
///
/// Renders the hexagonal room by every method and with every change that it is made to show, writes the
/// pictures as PNG, and a page that has them all, each with its settings, time, error and command. It opens
/// from disk and needs no other file.
#[derive(Debug, clap::Args)]
pub(super) struct GalleryArgs {
    /// Folder to write to; made if it is not there
    #[arg(long, value_name = "DIR", default_value = "gallery")]
    pub(super) out: PathBuf,

    /// Pictures this many times as wide and as high; 0.25 is quick
    #[arg(
        long,
        value_name = "S",
        default_value_t = 1.0,
        allow_negative_numbers = true
    )]
    pub(super) scale: f64,

    /// Also write small copies of the pictures as JPEG into this folder
    #[arg(long, value_name = "DIR")]
    pub(super) thumbnails: Option<PathBuf>,

    /// Worker threads (same pictures) [default: all cores]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) threads: Option<usize>,

    /// Do not tell what is being done
    #[arg(short, long)]
    pub(super) quiet: bool,
}

/// `wavepath stability`
#[derive(Debug, clap::Args)]
pub(super) struct StabilityArgs {
    /// Case, by its name in the table; may be given several times [default: all]
    #[arg(long = "case", value_name = "NAME")]
    pub(super) cases: Vec<String>,

    /// Acceleration structures, separated by commas [default: all of this program]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(super) structures: Vec<String>,

    /// Samples as for every change, about a minute of CPU time: the default
    #[arg(long, conflicts_with = "full")]
    pub(super) quick: bool,

    /// Samples as for a release, thirty times as many
    #[arg(long)]
    pub(super) full: bool,

    /// Rays per closed mesh and structure in the case `vertices` (fewer for the linear scan), bounces in `closed-room`
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) rays: Option<u64>,

    /// Worker threads (same findings) [default: all cores]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) threads: Option<usize>,

    /// Print the names of the cases and what they are about, and run none
    #[arg(long)]
    pub(super) list: bool,

    /// Write the findings as JSON
    #[arg(long, value_name = "FILE.json")]
    pub(super) json: Option<PathBuf>,

    /// Do not tell of each case as it ends
    #[arg(short, long)]
    pub(super) quiet: bool,
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn definitions_do_not_contradict_each_other() {
        Args::command().debug_assert();
    }

    #[test]
    fn batches_are_as_large_as_the_wave() {
        let Some(Command::Accels(args)) = Args::parse_from(["wavepath", "accels", "a"]).command
        else {
            panic!("accels is a command");
        };
        assert_eq!(args.batch, crate::scene::RenderSettings::default().wave);
        assert!(args.rays.is_empty() && args.structures.is_empty());
    }

    #[test]
    fn documented_defaults_are_those_of_the_settings() {
        let settings = crate::scene::RenderSettings::default();
        let help = Args::command()
            .find_subcommand_mut("render")
            .unwrap()
            .render_long_help()
            .to_string()
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ");
        for default in [
            format!("[default: {}]", settings.wave),
            format!("[default: {}]", settings.block),
            format!("else {}]", settings.roulette_depth),
            format!("64 [default: the scene's, else {}]", settings.light_samples),
            format!("8 [default: the scene's, else {}]", settings.glass_splits),
            "else 64]".to_owned(),
        ] {
            assert!(help.contains(&default), "{default} is not in\n{help}");
        }
        assert_eq!(settings.budget, crate::scene::Budget::Samples(64));
    }
}
