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
    /// Sobol's sequence in pairs of dimensions with Owen's scrambling, over all samples of a pixel.
    Sobol,
}

/// Most light samples per hit.
pub const MOST_LIGHT_SAMPLES: u32 = 64;

/// Most splits of a path at glass: it may become 2 to this power of rays.
pub const MOST_GLASS_SPLITS: u32 = 8;

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

/// Where in a pixel camera rays pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Supersampling {
    /// Off for Whitted's method, else on.
    Auto,
    /// Anywhere in it: edges are smooth.
    On,
    /// Through its centre: edges are stairs.
    Off,
}

/// What ends a render; the first limit reached does.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Budget {
    /// This many samples per pixel.
    Samples(u64),
    /// This many wall seconds of rendering, over all sessions of a resumed render; decided per round of blocks.
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
    /// Light samples per hit, 1 ..= [`MOST_LIGHT_SAMPLES`].
    pub light_samples: Option<u32>,
    /// Splits at glass per path, 0 ..= [`MOST_GLASS_SPLITS`].
    pub glass_splits: Option<u32>,
    /// Shadow rays pass straight through glass, weighted by its transmittance (biased).
    pub transparent_shadows: Option<bool>,
    /// Secondary rays start this far off their surface, in scene units, ≥ 0, instead of where rounding
    /// errors say (biased).
    pub shadow_bias: Option<f64>,
    /// Largest radiance of a camera sample's brightest channel, > 0; brighter samples are darkened to it (biased).
    pub clamp: Option<f64>,
    /// More samples where the error is large.
    pub adaptive: Option<bool>,
    /// Where in a pixel camera rays pass.
    pub supersampling: Option<Supersampling>,
    /// Seed.
    pub seed: Option<u64>,
    /// Paths in flight per worker, 1 ..= [`MAX_WAVE`].
    pub wave: Option<usize>,
    /// Samples per pixel in one block, 1 ..= [`MAX_BLOCK`].
    pub block: Option<u32>,
    /// Run the kernels that can do everything.
    pub force_features: Option<bool>,
}

/// Most paths in flight per thread: a few GiB of queues.
pub const MAX_WAVE: usize = 1 << 24;

/// Most samples per block: the film sums a block in f32 before it adds it in f64.
pub const MAX_BLOCK: u32 = 64;

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
    /// Light samples, each with a shadow ray, at every hit that scatters other than as a mirror or glass;
    /// 1 ..= [`MOST_LIGHT_SAMPLES`].
    pub light_samples: u32,
    /// How often a path that has met nothing but mirrors and glass follows both what glass reflects and what
    /// it refracts, before it chooses one at random; 0 ..= [`MOST_GLASS_SPLITS`]. Whitted's method has a
    /// number of its own.
    pub glass_splits: u32,
    /// Shadow rays pass straight through glass, weighted by its transmittance (biased).
    pub transparent_shadows: bool,
    /// Secondary rays start this far off their surface, in scene units, ≥ 0, and may hit it again, as in renderers
    /// that leave the choice of a bias to their user (biased). `None`: outside of the error bound of the point,
    /// and not to hit the primitive that they start on.
    pub shadow_bias: Option<f64>,
    /// Largest radiance of a camera sample's brightest channel, > 0; brighter samples are darkened to it (biased).
    /// `None` is no limit.
    pub clamp: Option<f64>,
    /// Give tiles with larger estimated error more samples; see [`crate::integrator::adaptive`].
    pub adaptive: bool,
    /// Where in a pixel camera rays pass.
    pub supersampling: Supersampling,
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
            sampler: SamplerKind::Sobol,
            accel: AccelKind::Auto,
            accel_quality: AccelQuality::Medium,
            budget: Budget::Samples(64),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            seed: 0,
            wave: 4096,
            block: 16,
            max_depth: None,
            roulette_depth: 5,
            light_samples: 1,
            glass_splits: 0,
            transparent_shadows: false,
            shadow_bias: None,
            clamp: None,
            adaptive: false,
            supersampling: Supersampling::Auto,
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
            light_samples: defaults.light_samples.unwrap_or(base.light_samples),
            glass_splits: defaults.glass_splits.unwrap_or(base.glass_splits),
            transparent_shadows: defaults
                .transparent_shadows
                .unwrap_or(base.transparent_shadows),
            shadow_bias: defaults.shadow_bias,
            clamp: defaults.clamp,
            adaptive: defaults.adaptive.unwrap_or(base.adaptive),
            supersampling: defaults.supersampling.unwrap_or(base.supersampling),
            seed: defaults.seed.unwrap_or(base.seed),
            wave: defaults.wave.unwrap_or(base.wave),
            block: defaults.block.unwrap_or(base.block),
            force_features: defaults.force_features.unwrap_or(base.force_features),
            ..base
        }
    }

    /// Whether camera rays pass anywhere in a pixel rather than through its centre.
    pub fn supersamples(&self) -> bool {
        match self.supersampling {
            Supersampling::Auto => self.integrator != IntegratorKind::Whitted,
            Supersampling::On => true,
            Supersampling::Off => false,
        }
    }
}
