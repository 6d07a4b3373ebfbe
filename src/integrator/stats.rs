//! What a render counts and how it ends.

use serde::{Deserialize, Serialize};

use crate::wave::Rejections;

/// CPU time of one stage, summed over workers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StageStats {
    /// Name as in the driver loop.
    pub name: &'static str,
    /// CPU seconds of the worker threads.
    pub cpu_seconds: f64,
    /// Items (rays, hits, paths) processed.
    pub items: u64,
}

/// Rays at one depth (1 = camera rays), summed over the render.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct DepthStats {
    /// Closest-hit rays.
    pub rays: u64,
    /// Shadow rays sent from hits at this depth.
    pub shadow_rays: u64,
    /// Mean share of the wave's slots that held rays of this depth, in [0, 1].
    pub queue_fill: f64,
}

/// Counts and times of a render.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct RenderStats {
    /// CPU seconds of all workers in work items.
    pub cpu_seconds: f64,
    /// Wall seconds from the first work item to the last.
    pub wall_seconds: f64,
    /// Time per stage; the rest of `cpu_seconds` is scheduling and the film.
    pub stages: Vec<StageStats>,
    /// Camera paths.
    pub paths: u64,
    /// Camera rays.
    pub camera_rays: u64,
    /// Closest-hit rays after the first.
    pub bounce_rays: u64,
    /// Shadow rays.
    pub shadow_rays: u64,
    /// By depth, index 0 is depth 1.
    pub depths: Vec<DepthStats>,
    /// Mean share of the wave's slots that held a live ray when the intersect stage ran, in [0, 1].
    pub queue_fill: f64,
    /// Passes of the wave loop.
    pub passes: u64,
    /// Bytes of queues per path in flight.
    pub bytes_per_path: usize,
    /// Nodes visited by ray queries.
    pub accel_nodes: u64,
    /// Ray–primitive tests.
    pub accel_tests: u64,
    /// Contributions that were not finite or negative and were left out; 0 in a healthy render.
    pub rejected: u64,
    /// The same by stage.
    pub rejected_by_stage: Rejections,
    /// Camera samples that were darkened to the clamp (0 without one).
    pub clamped: u64,
    /// Paths cut at the depth limit while still carrying weight (0 without a limit).
    pub truncated: u64,
}

impl RenderStats {
    /// All rays.
    pub fn rays(&self) -> u64 {
        self.camera_rays + self.bounce_rays + self.shadow_rays
    }
}

/// Why a render ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EndReason {
    /// The sample count was reached.
    Samples,
    /// The time was used up.
    Seconds,
    /// The error estimate reached its goal.
    Error,
    /// The observer asked to stop (Ctrl-C).
    Interrupted,
}

/// State of a running render, given to the observer after each tile or so.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Share of the budget used, in [0, 1].
    pub fraction: f64,
    /// Samples per pixel done (rounds completed, plus the part of the running one).
    pub samples: f64,
    /// Rays traced so far.
    pub rays: u64,
    /// Wall seconds since the start.
    pub seconds: f64,
    /// Estimated relative error of the image after the last complete round, as a fraction.
    pub error: Option<f64>,
}
