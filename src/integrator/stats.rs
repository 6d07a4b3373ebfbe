//! What a render counts and how it ends.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};

use super::clock::{Span, Step};
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

impl<'de> Deserialize<'de> for StageStats {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        /// As they are read.
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Record {
            name: String,
            cpu_seconds: f64,
            items: u64,
        }
        let record = Record::deserialize(deserializer)?;
        let mut steps = Step::ALL.into_iter().map(Step::name);
        let unknown = || D::Error::custom(format!("no stage is called {}", record.name));
        Ok(Self {
            name: steps
                .find(|name| *name == record.name)
                .ok_or_else(unknown)?,
            cpu_seconds: record.cpu_seconds,
            items: record.items,
        })
    }
}

/// Rays at one depth (1 = camera rays), summed over the render.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DepthStats {
    /// Closest-hit rays.
    pub rays: u64,
    /// Shadow rays sent from hits at this depth.
    pub shadow_rays: u64,
    /// Mean share of the wave's slots that held rays of this depth, in [0, 1].
    pub queue_fill: f64,
}

/// Counts and times of a render; of one that was resumed, over all its sessions.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RenderStats {
    /// CPU seconds of all workers in work items.
    pub cpu_seconds: f64,
    /// Wall seconds from the first work item to the last.
    pub wall_seconds: f64,
    /// Preparation in this session: film, queues, threads.
    pub prepare: Span,
    /// Rounds of work items in this session: the workers' time, and what it takes to wake them and to wait for them.
    pub rounds: Span,
    /// Between rounds in this session: estimates of the error, which work items are next, checkpoints.
    pub between: Span,
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
    /// Slots of the wave over all passes.
    pub slots: u64,
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

    /// Adds the counts and times of an earlier session of the same render; shares become those of both together.
    pub fn add(&mut self, earlier: &Self) {
        let [now, then] = [self.slots, earlier.slots].map(|slots| slots as f64);
        let mean = |a: f64, b: f64| (a * now + b * then) / (now + then).max(1.0);
        self.queue_fill = mean(self.queue_fill, earlier.queue_fill);
        let depths = self.depths.len().max(earlier.depths.len());
        self.depths.resize(depths, DepthStats::default());
        for (index, depth) in self.depths.iter_mut().enumerate() {
            let before = earlier.depths.get(index).copied().unwrap_or_default();
            depth.rays += before.rays;
            depth.shadow_rays += before.shadow_rays;
            depth.queue_fill = mean(depth.queue_fill, before.queue_fill);
        }
        for (stage, before) in self.stages.iter_mut().zip(&earlier.stages) {
            stage.cpu_seconds += before.cpu_seconds;
            stage.items += before.items;
        }
        self.cpu_seconds += earlier.cpu_seconds;
        self.wall_seconds += earlier.wall_seconds;
        self.paths += earlier.paths;
        self.camera_rays += earlier.camera_rays;
        self.bounce_rays += earlier.bounce_rays;
        self.shadow_rays += earlier.shadow_rays;
        self.passes += earlier.passes;
        self.slots += earlier.slots;
        self.accel_nodes += earlier.accel_nodes;
        self.accel_tests += earlier.accel_tests;
        self.rejected += earlier.rejected;
        self.rejected_by_stage.add(&earlier.rejected_by_stage);
        self.clamped += earlier.clamped;
        self.truncated += earlier.truncated;
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
