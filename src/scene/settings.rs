//! Settings of a render: what a scene file may default and the command line may override.

use serde::{Deserialize, Serialize};

/// Which light transport is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum IntegratorKind {
    /// Path tracing through the wavefront.
    Path,
    /// Whitted's: direct light at diffuse hits, both branches at glass, no indirect diffuse light.
    Whitted,
    /// The same pictures by a plain recursive f64 renderer, for checking and comparing.
    Reference,
}

/// How a path finds light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Strategy {
    /// Light and direction sampling combined with the power heuristic.
    Mis,
    /// Light sampling alone ("next event estimation"); emitters count when seen by the camera or by specular bounces.
    Nee,
    /// Direction sampling alone; point lights, which no ray can hit, are still sampled.
    Bsdf,
}

/// Where sample points come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum SamplerKind {
    /// Independent uniform numbers.
    Independent,
    /// Jittered strata within each block of samples of a pixel.
    Stratified,
}

/// Which acceleration structure answers ray queries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum AccelKind {
    /// By measured thresholds on the number of primitives.
    Auto,
    /// No structure: every ray against every primitive, lanes of rays at a time.
    Linear,
    /// Tree of cubes, each halved along all axes.
    Octree,
    /// Binary tree.
    Bvh2,
    /// 8-wide tree.
    Bvh8,
    /// 8-wide tree, rays in packets wherever they can.
    Packet,
}

/// How much time the build of a tree takes for faster rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum AccelQuality {
    /// Shortest build.
    Fast,
    /// About the time of a binned surface-area builder.
    Medium,
    /// Several times longer; large triangles are split among leaves.
    Best,
}

/// What ends a render; the first limit reached does.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Budget {
    /// This many samples per pixel.
    Samples(u64),
    /// This many wall seconds of rendering; decided per round of blocks.
    Seconds(f64),
    /// An estimated relative error of the image, as a fraction (0.03 is 3 %); decided per round of blocks.
    Error(f64),
}

/// Render defaults of a scene file: what is `None` is left to the program.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RenderDefaults {
    /// Samples per pixel, > 0.
    pub spp: Option<u64>,
    /// Integrator.
    pub integrator: Option<IntegratorKind>,
    /// Strategy of the path integrator.
    pub strategy: Option<Strategy>,
    /// Sampler.
    pub sampler: Option<SamplerKind>,
    /// Acceleration structure.
    pub accel: Option<AccelKind>,
    /// Quality of its build.
    pub accel_quality: Option<AccelQuality>,
    /// Most path segments; 1 is emitted light alone, 2 adds direct light.
    pub max_depth: Option<u32>,
    /// First depth (in segments already traced) at which roulette may end a path.
    pub roulette_depth: Option<u32>,
    /// Shadow rays pass straight through glass, weighted by its transmittance (biased).
    pub transparent_shadows: Option<bool>,
    /// Secondary rays start this far off their surface, in scene units, ≥ 0, instead of where rounding
    /// errors say (biased).
    pub shadow_bias: Option<f64>,
    /// Largest radiance of a camera sample's brightest channel, > 0; brighter samples are darkened to it (biased).
    pub clamp: Option<f64>,
    /// Seed.
    pub seed: Option<u64>,
}

/// Everything that a render's picture depends on beside the scene and the budget.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RenderSettings {
    /// Integrator.
    pub integrator: IntegratorKind,
    /// Strategy of the path integrator.
    pub strategy: Strategy,
    /// Sampler.
    pub sampler: SamplerKind,
    /// Acceleration structure.
    pub accel: AccelKind,
    /// Quality of its build. Does not change the picture.
    pub accel_quality: AccelQuality,
    /// What ends the render.
    pub budget: Budget,
    /// Worker threads, ≥ 1. Does not change the picture.
    pub threads: usize,
    /// Seed of every random number.
    pub seed: u64,
    /// Paths in flight per worker, ≥ 1. Does not change the picture.
    pub wave: usize,
    /// Samples per pixel in one block (the unit of scheduling and of the error estimate), 1 ..= 64.
    pub block: u32,
    /// Most path segments; 1 is emitted light alone, 2 adds direct light. `None` is no limit.
    pub max_depth: Option<u32>,
    /// First depth (in segments already traced) at which roulette may end a path.
    pub roulette_depth: u32,
    /// Shadow rays pass straight through glass, weighted by its transmittance (biased).
    pub transparent_shadows: bool,
    /// Secondary rays start this far off their surface, in scene units, ≥ 0, and may hit it again, as in renderers
    /// that leave the choice of a bias to their user (biased). `None`: outside of the error bound of the point,
    /// and not to hit the primitive that they start on.
    pub shadow_bias: Option<f64>,
    /// Largest radiance of a camera sample's brightest channel, > 0; brighter samples are darkened to it (biased).
    /// `None` is no limit.
    pub clamp: Option<f64>,
    /// Also accumulate albedo, normal and depth of the first hit.
    pub aux: bool,
    /// Run the kernels that can do everything, though the scene does not need them. Does not change the picture.
    pub force_features: bool,
}

impl Default for RenderSettings {
    fn default() -> Self {
        Self {
            integrator: IntegratorKind::Path,
            strategy: Strategy::Mis,
            sampler: SamplerKind::Independent,
            accel: AccelKind::Auto,
            accel_quality: AccelQuality::Medium,
            budget: Budget::Samples(64),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            seed: 0,
            wave: 4096,
            block: 16,
            max_depth: None,
            roulette_depth: 5,
            transparent_shadows: false,
            shadow_bias: None,
            clamp: None,
            aux: false,
            force_features: false,
        }
    }
}

impl RenderSettings {
    /// Program defaults overlaid with those of a scene file.
    pub fn from_defaults(defaults: &RenderDefaults) -> Self {
        let base = Self::default();
        Self {
            integrator: defaults.integrator.unwrap_or(base.integrator),
            strategy: defaults.strategy.unwrap_or(base.strategy),
            sampler: defaults.sampler.unwrap_or(base.sampler),
            accel: defaults.accel.unwrap_or(base.accel),
            accel_quality: defaults.accel_quality.unwrap_or(base.accel_quality),
            budget: defaults.spp.map_or(base.budget, Budget::Samples),
            max_depth: defaults.max_depth.or(base.max_depth),
            roulette_depth: defaults.roulette_depth.unwrap_or(base.roulette_depth),
            transparent_shadows: defaults
                .transparent_shadows
                .unwrap_or(base.transparent_shadows),
            shadow_bias: defaults.shadow_bias,
            clamp: defaults.clamp,
            seed: defaults.seed.unwrap_or(base.seed),
            ..base
        }
    }
}
