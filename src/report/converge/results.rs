//! What a comparison by error and time has found; its serialised form is the format of `converge.json`.
//!
//! Seconds are CPU seconds of the worker threads unless a name says wall. Errors are defined in
//! [`Results::definitions`]. A figure that does not exist (too few blocks, repeats or checkpoints) is
//! `None`, never NaN.

use serde::{Deserialize, Serialize};

use crate::report::{Build, Machine, SceneReport, Span, StageReport};
use crate::scene::RenderSettings;

/// Version of the JSON format; it changes when a field changes its meaning or disappears.
pub const FORMAT: u32 = 2;

/// A whole comparison.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Results {
    /// [`FORMAT`] of the program that wrote it.
    pub format: u32,
    /// The program.
    pub build: Build,
    /// The machine, its load as it was before the comparison.
    pub machine: Machine,
    /// Load average over 1, 5 and 15 minutes after the comparison.
    pub load_average_after: Option<[f64; 3]>,
    /// How much two runs of the same work differ in CPU time on this machine now.
    pub noise: Option<MachineNoise>,
    /// What was rendered: the scene as it is without the settings that vary.
    pub scene: SceneReport,
    /// What was compared, and how.
    pub settings: ConvergeSettings,
    /// What each figure means, in the order in which a reader meets them.
    pub definitions: Vec<Definition>,
    /// What images are held against; more than one if the configurations differ in the picture.
    pub references: Vec<ReferenceReport>,
    /// What was compared, in the order of the command line; the first is what others are related to.
    pub configurations: Vec<Configuration>,
    /// Configurations of the same picture, two by two.
    pub pairs: Vec<Pair>,
    /// Where the time went that is in no curve.
    pub phases: Phases,
    /// The time that the curves say against the process's own accounting.
    pub accounting: Accounting,
    /// What the reader must know before believing a figure, in words; empty if there is nothing.
    pub warnings: Vec<String>,
    /// Whether it was interrupted: then repeats and checkpoints may be missing.
    pub interrupted: bool,
}

/// What was compared, and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConvergeSettings {
    /// Independent renders of each configuration, ≥ 1.
    pub repeats: u32,
    /// What ends a render.
    pub limit: Limit,
    /// Worker threads, ≥ 1.
    pub threads: usize,
    /// What the seeds of repeats and reference are derived from.
    pub seed: u64,
}

/// What ends each render of each configuration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Limit {
    /// This many samples per pixel.
    Samples(u64),
    /// This many CPU seconds of rendering.
    Seconds(f64),
}

/// What a figure means.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Definition {
    /// Name of the field.
    pub name: String,
    /// Its unit; empty if it has none.
    pub unit: String,
    /// Its definition.
    pub text: String,
}

/// A figure with its 95 % interval over the repeats.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Estimate {
    /// The figure.
    pub value: f64,
    /// Lower end; `None` with a single repeat.
    pub low: Option<f64>,
    /// Upper end; `None` with a single repeat.
    pub high: Option<f64>,
}

/// Spread of CPU time of the same work.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MachineNoise {
    /// Pairs of runs.
    pub pairs: u32,
    /// CPU seconds of a run, the median.
    pub seconds: f64,
    /// Standard deviation of ln(b/a) over the pairs, about the relative spread of a ratio.
    pub spread: f64,
}

/// What images are held against.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReferenceReport {
    /// Where it came from.
    pub kind: ReferenceKind,
    /// Mean over pixels and channels.
    pub mean: f64,
    /// Samples per pixel over both halves; 0 for a closed form, `None` if a file does not say.
    pub samples: Option<u64>,
    /// Seeds of the two halves; none for a closed form or a file.
    pub seeds: Vec<u64>,
    /// Mean variance of the reference's pixels: 0 for a closed form, `None` if a file does not say.
    pub variance: Option<f64>,
    /// The reference's own root-mean-square relative error, as a fraction.
    pub relative_error: Option<f64>,
    /// Image file in the output folder; none for a closed form.
    pub image: Option<String>,
    /// Time that rendering it took, now or when it was stored.
    pub time: Span,
}

/// Where a reference came from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum ReferenceKind {
    /// The closed form that the scene states.
    ClosedForm,
    /// An image file.
    File {
        /// The file.
        path: String,
    },
    /// Two independent halves, rendered by this program.
    Rendered {
        /// Key of scene and settings under which it is stored.
        key: String,
        /// Whether it was found rather than rendered.
        cached: bool,
    },
}

/// One combination of settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Configuration {
    /// Its name: what differs from other configurations, or what the user called it.
    pub name: String,
    /// `path.to.key=value`, as for `--set`.
    pub overrides: Vec<String>,
    /// Its settings.
    pub settings: RenderSettings,
    /// Index into [`Results::references`].
    pub reference: usize,
    /// What the scene and the settings need, by name.
    pub features: Vec<String>,
    /// Name of the acceleration structure that was used.
    pub accel: String,
    /// Reading and checking the scene.
    pub load: Span,
    /// Compiling it: acceleration structure, lights.
    pub build: Span,
    /// Why its renders ended.
    pub ended: EndedBy,
    /// Each repeat with each of its checkpoints.
    pub repeats: Vec<Repeat>,
    /// Over the repeats, by checkpoint, samples ascending.
    pub checkpoints: Vec<Checkpoint>,
    /// Slope of ln RMSE on ln samples; −1/2 for independent samples of finite variance.
    pub slope_by_samples: Option<Fit>,
    /// Slope of ln RMSE on ln CPU seconds.
    pub slope_by_time: Option<Fit>,
    /// MSE × CPU seconds at the last fitted checkpoint (else the last): time to unit variance.
    pub time_to_unit_variance: Option<Estimate>,
    /// Efficiency, 1 / (MSE × CPU seconds), over that of the first configuration of the same picture.
    pub efficiency: Option<Estimate>,
    /// CPU seconds to root-mean-square relative errors of 10 %, 3 % and 1 %.
    pub times_to_error: Vec<TimeToError>,
    /// Rays of any kind per CPU second, over all passes.
    pub rays_per_second: f64,
    /// CPU time by stage, summed over the repeats; empty for the plain reference integrator.
    pub stages: Vec<StageReport>,
    /// Whether the images are wrong on average.
    pub bias: BiasTest,
    /// Pictures of the first repeat after about the same CPU time as the other configurations.
    pub picture: Option<Picture>,
    /// Pixels that hold the error up, worst first.
    pub slowest: Vec<SlowPixel>,
}

/// Why the renders of a configuration ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EndedBy {
    /// The sample count was reached.
    Samples,
    /// The time was used up.
    Seconds,
    /// The user asked to stop.
    Interrupted,
}

/// One independent render of a configuration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Repeat {
    /// Its seed. The same in every configuration, so that configurations are compared in pairs.
    pub seed: u64,
    /// Its checkpoints, samples ascending.
    pub rows: Vec<Row>,
}

/// One image held against the reference. A row of `converge.csv`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// Samples per pixel.
    pub samples: u64,
    /// Camera paths so far.
    pub paths: u64,
    /// Camera rays so far.
    pub camera_rays: u64,
    /// Closest-hit rays after the first of a path so far.
    pub bounce_rays: u64,
    /// Shadow rays so far.
    pub shadow_rays: u64,
    /// CPU seconds of the worker threads in render passes so far.
    pub cpu_seconds: f64,
    /// Wall seconds of render passes so far.
    pub wall_seconds: f64,
    /// The measures of the image.
    pub errors: Errors,
    /// Contributions so far that were not finite or negative and were left out.
    pub rejected: u64,
}

/// Measures of one image against the reference.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Errors {
    /// Mean squared error, the reference's own error taken out; may be negative where it is near that.
    pub mse: f64,
    /// Standard error of `mse` over the pixels.
    pub mse_error: f64,
    /// Mean squared relative error, the reference's own error taken out.
    pub relmse: f64,
    /// The same without the worst 0.1 % of the pixels: to look at, not to fit.
    pub relmse_trimmed: f64,
    /// Symmetric mean absolute relative error, in [0, 2].
    pub smape: f64,
    /// Mean variance that the renderer estimates by itself. `None` below two blocks.
    pub estimated_variance: Option<f64>,
    /// Relative error that the renderer itself estimates, as a fraction. `None` below two blocks.
    pub estimated_error: Option<f64>,
    /// Mean signed error of the image over its standard error. `None` below two blocks.
    pub bias_z: Option<f64>,
    /// Smallest p of the same per block of pixels, times the number of blocks. `None` below two blocks.
    pub block_p: Option<f64>,
    /// Pixels beyond 20 of the standard deviations that are usual around them. `None` below two blocks.
    pub outliers: Option<u64>,
    /// Share of the squared error that these carry, in [0, 1]. `None` below two blocks.
    pub outlier_share: Option<f64>,
}

/// A checkpoint over the repeats.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Checkpoint {
    /// Samples per pixel, the mean over the repeats where time ends them.
    pub samples: f64,
    /// CPU seconds.
    pub cpu_seconds: Estimate,
    /// Wall seconds.
    pub wall_seconds: Estimate,
    /// Mean squared error.
    pub mse: Estimate,
    /// Its root. `None` if the MSE is not positive.
    pub rmse: Option<Estimate>,
    /// Root of relMSE, as a fraction. `None` if relMSE is not positive.
    pub relative_error: Option<Estimate>,
    /// Root of the trimmed relMSE.
    pub relative_error_trimmed: Estimate,
    /// SMAPE.
    pub smape: Estimate,
    /// Relative error that the renderer itself estimates, as a fraction.
    pub estimated_error: Option<Estimate>,
    /// MSE over the variance that the renderer estimates: 1 if the estimate can be trusted.
    pub calibration: Option<Estimate>,
    /// MSE × CPU seconds.
    pub time_to_unit_variance: Option<Estimate>,
    /// Rays of any kind per CPU second.
    pub rays_per_second: f64,
    /// Whether the error is within three times the reference's own: such a point is not fitted.
    pub near_reference: bool,
}

/// A straight line through a curve in logarithms.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fit {
    /// The slope; its interval is Student's over the repeats' slopes.
    pub slope: Estimate,
    /// ln RMSE where the logarithm of the abscissa is 0, mean over the repeats.
    pub intercept: f64,
    /// Checkpoints fitted.
    pub points: u32,
}

/// CPU time after which a relative error is reached.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeToError {
    /// Root-mean-square relative error, as a fraction.
    pub error: f64,
    /// CPU seconds. `None` if it is not reached within twice the time rendered.
    pub seconds: Option<Estimate>,
    /// How it was found.
    pub found: Found,
}

/// How the time to an error was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Found {
    /// Between two checkpoints, along a straight line in logarithms.
    Interpolated,
    /// After the last checkpoint, by the law of −1/2, in at most twice its time.
    Extrapolated,
    /// The first checkpoint was below it already: an upper bound.
    AtMost,
    /// Not reached.
    NotReached,
}

/// Whether images are wrong on average, from all repeats together at their last checkpoint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BiasTest {
    /// What the test says.
    pub verdict: BiasVerdict,
    /// Mean signed error of the image, mean over the channels.
    pub mean_error: f64,
    /// The same over its standard error. `None` below two blocks.
    pub z: Option<f64>,
    /// Smallest p of a block of pixels, times the number of blocks. `None` below two blocks.
    pub block_p: Option<f64>,
    /// The block of that p: column and row of its first pixel, from the top left.
    pub worst_block: Option<(u32, u32)>,
    /// Pixels across and down a block.
    pub block: u32,
    /// Mean signed error over its standard error per block, row by row; empty below two blocks.
    pub blocks: Vec<f64>,
    /// What makes the image differ from the full solution by design, in words.
    pub by_design: Vec<String>,
}

/// What a bias test says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BiasVerdict {
    /// The mean of the image, or of a block of pixels, is off by more than chance explains.
    Biased,
    /// No bias was shown.
    NotShown,
    /// There are too few samples for a test.
    Untested,
}

/// The image of a configuration and its error, as PNG files in the output folder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Picture {
    /// The image, sRGB with the scene's exposure.
    pub image: String,
    /// Relative difference of luminance from the reference: red brighter, blue darker, full colour at 100 %.
    pub error_image: String,
    /// Where the error is: root of the mean squared relative error per pixel over the repeats, white at 100 %.
    pub error_map: String,
    /// Samples per pixel of the image.
    pub samples: u64,
    /// CPU seconds of the image.
    pub cpu_seconds: f64,
    /// Root-mean-square relative error of the image. `None` if relMSE is not positive.
    pub relative_error: Option<f64>,
}

/// A pixel that holds the error up.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SlowPixel {
    /// Column from the left.
    pub x: u32,
    /// Row from the top.
    pub y: u32,
    /// Root of its mean squared relative error over the repeats, as a fraction.
    pub relative_error: f64,
    /// Share of the image's squared relative error that it carries, in [0, 1].
    pub share: f64,
}

/// Two configurations of the same picture. Ratios are b over a, so that below 1 b is better in
/// error and time, and above 1 in efficiency.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pair {
    /// Index of the first.
    pub a: usize,
    /// Index of the second.
    pub b: usize,
    /// Efficiency of b over that of a, paired by repeat.
    pub efficiency: Option<Estimate>,
    /// RMSE of b over that of a after the same samples.
    pub equal_samples: Option<Estimate>,
    /// RMSE of b over that of a after the same CPU time.
    pub equal_time: Option<Estimate>,
    /// CPU time of b over that of a to the same RMSE.
    pub equal_error: Option<Estimate>,
    /// What the efficiencies show, in words; "no difference shown" if the interval contains 1.
    pub verdict: String,
}

/// Time outside of the curves.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Phases {
    /// Reading and checking scenes.
    pub load: Span,
    /// Compiling them.
    pub build: Span,
    /// Making the reference: rendering it, reading it, or evaluating the closed form.
    pub reference: Span,
    /// Measuring the machine's noise.
    pub noise: Span,
    /// Render passes, as the process accounts for them.
    pub render: Span,
    /// Holding images against the reference.
    pub score: Span,
    /// Fits, pairs and writing.
    pub write: Span,
}

/// The rendering time in the curves against the process's own accounting of the same passes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Accounting {
    /// CPU seconds that the curves contain: those of worker threads in work items.
    pub curves_cpu_seconds: f64,
    /// CPU seconds that it took to wake the workers for each pass and to wait for them.
    pub waking_cpu_seconds: f64,
    /// CPU seconds of the whole process in the same passes.
    pub process_cpu_seconds: f64,
    /// The first two over the third; `None` if nothing was rendered.
    pub ratio: Option<f64>,
}
