//! What a render tells about itself: one struct, written as JSON and as text.

pub mod accels;
pub mod converge;
pub mod gallery;
mod html;
mod load;
mod machine;
mod memory;
pub mod stability;
mod summary;

pub use crate::integrator::clock::{Span, Stopwatch};
pub use load::{LoadReport, MeshReport};
pub use machine::{Build, Machine};
pub use memory::peak_memory;

use serde::{Deserialize, Serialize};

use crate::film::Film;
use crate::integrator::checkpoint::Earlier;
use crate::integrator::stats::{DepthStats, EndReason, RenderStats};
use crate::scene::{IntegratorKind, RenderSettings};
use crate::wave::Rejections;

/// Version of the JSON format; it changes when a field changes its meaning or disappears.
pub const FORMAT: u32 = 2;

/// The report of a render; its serialised form is the format of `--report`. Rates are 0 where
/// nothing was timed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RenderReport {
    /// [`FORMAT`] of the program that wrote it.
    pub format: u32,
    /// The program.
    pub build: Build,
    /// The machine, its load as it was before the render.
    pub machine: Machine,
    /// What was rendered.
    pub scene: SceneReport,
    /// How it was rendered.
    pub settings: RenderSettings,
    /// What the scene needs and what was left out, as `wavepath plan` tells.
    pub plan: serde_json::Value,
    /// Name of the acceleration structure that was used.
    pub accel: String,
    /// What came out.
    pub result: ResultReport,
    /// What loading the scene took, and each mesh.
    #[serde(default)]
    pub load: LoadReport,
    /// Of a render that was resumed, what was done when; all counts and rates are those of the whole render.
    #[serde(default)]
    pub resumed: Option<ResumeReport>,
    /// Where the time of this session went, by phase.
    pub times: Times,
    /// Camera paths.
    pub paths: PathReport,
    /// Rays by kind.
    pub rays: RayReport,
    /// CPU time by stage of the wave loop.
    pub stages: Vec<StageReport>,
    /// Rays and queue fill by depth, from depth 1.
    pub depths: Vec<DepthReport>,
    /// The wave's queues.
    pub queues: QueueReport,
    /// Memory.
    pub memory: MemoryReport,
}

/// What was rendered.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneReport {
    /// The scene's name: its file without the extension.
    pub name: String,
    /// Name of the camera.
    pub camera: String,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
}

/// What came out of a render.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResultReport {
    /// What ended the render.
    pub ended: EndReason,
    /// Fewest samples of a pixel.
    pub min_samples: u64,
    /// Most samples of a pixel.
    pub max_samples: u64,
    /// Mean samples per pixel.
    pub mean_samples: f64,
    /// [`Film::relative_error`], as a fraction.
    pub relative_error: Option<f64>,
    /// Bounds of the true relative error, met with a probability of about 95 %; see
    /// [`Film::error_estimate`].
    #[serde(default)]
    pub relative_error_interval: Option<[f64; 2]>,
    /// What makes the image differ from the full solution on average, in words; empty if nothing does.
    pub bias: Vec<String>,
    /// Contributions that were not finite or negative and were left out; 0 in a healthy render.
    pub rejected: u64,
    /// The same by stage.
    #[serde(default)]
    pub rejected_by_stage: Rejections,
    /// Camera samples that were darkened to the clamp.
    #[serde(default)]
    pub clamped: u64,
    /// Paths cut at the depth limit while still carrying weight.
    pub truncated: u64,
    /// Files written.
    pub images: Vec<String>,
    /// The checkpoint, if there is one.
    #[serde(default)]
    pub checkpoint: Option<String>,
}

/// How a render is divided in sessions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResumeReport {
    /// Sessions so far, this one included.
    pub sessions: u32,
    /// What the earlier ones have done.
    pub before: SessionReport,
    /// What this one has done.
    pub after: SessionReport,
}

/// What was done in one session or several.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SessionReport {
    /// Mean samples per pixel.
    pub samples: f64,
    /// CPU seconds of the workers.
    pub cpu_seconds: f64,
    /// Wall seconds of rendering.
    pub wall_seconds: f64,
}

impl ResumeReport {
    /// Of a render with `samples` per pixel on average after all sessions.
    fn new(earlier: &Earlier, samples: f64, stats: &RenderStats) -> Self {
        let before = SessionReport {
            samples: earlier.samples,
            cpu_seconds: earlier.cpu_seconds,
            wall_seconds: earlier.wall_seconds,
        };
        Self {
            sessions: earlier.sessions.saturating_add(1),
            before,
            after: SessionReport {
                samples: samples - before.samples,
                cpu_seconds: stats.cpu_seconds - before.cpu_seconds,
                wall_seconds: stats.wall_seconds - before.wall_seconds,
            },
        }
    }
}

impl ResultReport {
    /// Samples per pixel in words: one number where all pixels have the same.
    pub fn samples_per_pixel(&self) -> String {
        let Self {
            min_samples: min,
            max_samples: max,
            mean_samples: mean,
            ..
        } = self;
        if min == max {
            min.to_string()
        } else {
            format!("{min} to {max} (mean {mean:.2})")
        }
    }
}

/// Time of each phase.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Times {
    /// Reading and checking the scene.
    pub load: Span,
    /// Compiling it: acceleration structure, lights, plan.
    pub build: Span,
    /// Film, queues and threads of the render.
    pub prepare: Span,
    /// Rounds of work items. The stages share the workers' part of it; the rest is to wake and to await them.
    pub render: Span,
    /// Between rounds: estimates of the error, and which work items are next.
    pub estimate: Span,
    /// Writing the images.
    pub write: Span,
    /// CPU seconds of the whole process from its start until the report was made.
    pub process_cpu_seconds: f64,
}

impl Times {
    /// Each phase with its name, in order.
    pub fn phases(&self) -> [(&'static str, Span); 6] {
        [
            ("load", self.load),
            ("build", self.build),
            ("prepare", self.prepare),
            ("render", self.render),
            ("estimate", self.estimate),
            ("write", self.write),
        ]
    }

    /// CPU seconds of the process in no phase: its start, checks, what the report itself takes.
    pub fn other_cpu_seconds(&self) -> f64 {
        let phases = self.phases().into_iter();
        self.process_cpu_seconds - phases.map(|(_, span)| span.cpu_seconds).sum::<f64>()
    }
}

/// Camera paths and their rate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PathReport {
    /// How many.
    pub count: u64,
    /// Per CPU second of the workers.
    pub per_cpu_second: f64,
    /// Mean number of segments (camera and bounce rays) per path.
    pub mean_length: f64,
}

/// Rays by kind and their rates.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RayReport {
    /// Camera rays.
    pub camera: u64,
    /// Closest-hit rays after the first.
    pub bounce: u64,
    /// Shadow rays.
    pub shadow: u64,
    /// All of them.
    pub total: u64,
    /// All per wall second.
    pub per_second: f64,
    /// All per CPU second of the workers.
    pub per_cpu_second: f64,
    /// Nodes of the acceleration structure visited, per ray.
    pub nodes_per_ray: f64,
    /// Ray–primitive tests, per ray.
    pub tests_per_ray: f64,
}

/// CPU time of one stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StageReport {
    /// Name as in the driver loop; `other` is what no stage accounts for: scheduling and the film.
    pub name: String,
    /// CPU seconds, all workers.
    pub cpu_seconds: f64,
    /// Share of the workers' CPU seconds, in [0, 1].
    pub share: f64,
    /// Items (rays, hits, paths) processed.
    pub items: u64,
}

/// Rays at one depth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DepthReport {
    /// 1 is the camera rays' depth.
    pub depth: usize,
    /// Closest-hit rays.
    pub rays: u64,
    /// Shadow rays from hits at this depth.
    pub shadow_rays: u64,
    /// Mean share of the wave's slots that held rays of this depth, in [0, 1].
    pub queue_fill: f64,
}

/// The wave's queues.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct QueueReport {
    /// Mean share of slots with a live ray when rays were intersected, in [0, 1].
    pub fill: f64,
    /// Passes of the wave loop.
    pub passes: u64,
    /// Bytes of queues per path in flight.
    pub bytes_per_path: usize,
}

/// Memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MemoryReport {
    /// Most bytes that the process held.
    pub peak_bytes: Option<u64>,
    /// Bytes of the film.
    pub film_bytes: u64,
}

/// What a report is made from.
#[derive(Debug)]
pub struct ReportInput<'a> {
    /// What was rendered.
    pub scene: SceneReport,
    /// How.
    pub settings: &'a RenderSettings,
    /// The serialised plan.
    pub plan: serde_json::Value,
    /// Name of the acceleration structure that was used.
    pub accel: String,
    /// The machine before the render.
    pub machine: Machine,
    /// The film at the end.
    pub film: &'a Film,
    /// The counts.
    pub stats: &'a RenderStats,
    /// Why it ended.
    pub ended: EndReason,
    /// What had been done before, if it was resumed.
    pub earlier: Option<Earlier>,
    /// The checkpoint, if there is one.
    pub checkpoint: Option<String>,
    /// Loading the scene.
    pub load: LoadReport,
    /// The phases.
    pub times: Times,
    /// Files written.
    pub images: Vec<String>,
}

impl RenderReport {
    /// Derives shares and rates from the counts and adds the build and the peak memory so far.
    pub fn new(input: ReportInput<'_>) -> Self {
        let ReportInput {
            scene,
            settings,
            plan,
            accel,
            machine,
            film,
            stats,
            ended,
            earlier,
            checkpoint,
            load,
            times,
            images,
        } = input;
        let rays = stats.rays();
        let mean_samples = ratio(film.total_samples() as f64, film.len() as f64);
        let error = film.error_estimate();
        Self {
            format: FORMAT,
            build: Build::current(),
            machine,
            scene,
            settings: settings.clone(),
            plan,
            accel,
            result: ResultReport {
                ended,
                min_samples: film.min_samples(),
                max_samples: film.max_samples(),
                mean_samples,
                relative_error: error.map(|error| error.estimate),
                relative_error_interval: error.map(|error| error.interval),
                bias: bias(settings, stats),
                rejected: stats.rejected,
                rejected_by_stage: stats.rejected_by_stage,
                clamped: stats.clamped,
                truncated: stats.truncated,
                images,
                checkpoint,
            },
            load,
            resumed: earlier.map(|earlier| ResumeReport::new(&earlier, mean_samples, stats)),
            times,
            paths: PathReport {
                count: stats.paths,
                per_cpu_second: ratio(stats.paths as f64, stats.cpu_seconds),
                mean_length: ratio(
                    (stats.camera_rays + stats.bounce_rays) as f64,
                    stats.paths as f64,
                ),
            },
            rays: RayReport {
                camera: stats.camera_rays,
                bounce: stats.bounce_rays,
                shadow: stats.shadow_rays,
                total: rays,
                per_second: ratio(rays as f64, stats.wall_seconds),
                per_cpu_second: ratio(rays as f64, stats.cpu_seconds),
                nodes_per_ray: ratio(stats.accel_nodes as f64, rays as f64),
                tests_per_ray: ratio(stats.accel_tests as f64, rays as f64),
            },
            stages: stages(stats),
            depths: depths(&stats.depths),
            queues: QueueReport {
                fill: stats.queue_fill,
                passes: stats.passes,
                bytes_per_path: stats.bytes_per_path,
            },
            memory: MemoryReport {
                peak_bytes: peak_memory(),
                film_bytes: film.parts().count() as u64
                    * Film::bytes(film.width(), film.height(), film.has_aux()),
            },
        }
    }

    /// The report as indented JSON.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("plain data with string keys always serialises")
    }
}

fn stages(stats: &RenderStats) -> Vec<StageReport> {
    let report = |name: &str, cpu_seconds: f64, items: u64| StageReport {
        name: name.to_owned(),
        cpu_seconds,
        share: ratio(cpu_seconds, stats.cpu_seconds),
        items,
    };
    let in_stages: f64 = stats.stages.iter().map(|stage| stage.cpu_seconds).sum();
    let other = (stats.cpu_seconds - in_stages).max(0.0);
    stats
        .stages
        .iter()
        .map(|stage| report(stage.name, stage.cpu_seconds, stage.items))
        .chain([report("other", other, 0)])
        .collect()
}

fn depths(depths: &[DepthStats]) -> Vec<DepthReport> {
    let report = |(index, stats): (usize, &DepthStats)| DepthReport {
        depth: index + 1,
        rays: stats.rays,
        shadow_rays: stats.shadow_rays,
        queue_fill: stats.queue_fill,
    };
    depths.iter().enumerate().map(report).collect()
}

/// What makes the image of a render differ from the full solution on average, one phrase each; empty if nothing
/// does.
pub fn bias(settings: &RenderSettings, stats: &RenderStats) -> Vec<String> {
    let mut bias = Vec::new();
    if settings.transparent_shadows {
        bias.push("transparent shadows: light passes straight through glass".to_owned());
    }
    if settings.integrator != IntegratorKind::Whitted && !settings.supersamples() {
        bias.push("no supersampling: rays through the centres of pixels".to_owned());
    }
    if let (Some(depth), 1..) = (settings.max_depth, stats.truncated) {
        bias.push(format!(
            "depth limit {depth}: {} paths cut",
            stats.truncated
        ));
    }
    if let Some(length) = settings.shadow_bias {
        bias.push(format!(
            "shadow bias {length}: secondary rays start at a fixed distance"
        ));
    }
    if let (Some(clamp), 1..) = (settings.clamp, stats.clamped) {
        bias.push(format!("clamp {clamp}: {} samples darkened", stats.clamped));
    }
    if stats.rejected > 0 {
        let Rejections {
            emission,
            shade,
            connect,
        } = stats.rejected_by_stage;
        bias.push(format!(
            "{} contributions not finite or negative, left out: \
             {emission} in emission, {shade} in shade, {connect} in connect",
            stats.rejected
        ));
    }
    bias
}

/// Sorts the values, of which there is at least one. Their median; the mean of the middle two of an even
/// number.
fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len() - 1;
    0.5 * (values[last / 2] + values[last.div_ceil(2)])
}

/// a / b, or 0 where b is 0.
fn ratio(a: f64, b: f64) -> f64 {
    if b == 0.0 { 0.0 } else { a / b }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::integrator::stats::StageStats;
    use crate::scene::Supersampling;

    /// The report of a small invented render.
    pub(crate) fn sample() -> RenderReport {
        let stats = RenderStats {
            cpu_seconds: 2.0,
            wall_seconds: 1.0,
            stages: vec![
                StageStats {
                    name: "generate",
                    cpu_seconds: 0.5,
                    items: 1000,
                },
                StageStats {
                    name: "intersect",
                    cpu_seconds: 1.0,
                    items: 4000,
                },
            ],
            paths: 1000,
            camera_rays: 1000,
            bounce_rays: 2000,
            shadow_rays: 3000,
            depths: vec![
                DepthStats {
                    rays: 1000,
                    shadow_rays: 900,
                    queue_fill: 0.625,
                },
                DepthStats {
                    rays: 500,
                    shadow_rays: 400,
                    queue_fill: 0.25,
                },
            ],
            queue_fill: 0.875,
            passes: 4,
            slots: 4000,
            bytes_per_path: 96,
            accel_nodes: 0,
            accel_tests: 192_000,
            rejected: 0,
            rejected_by_stage: Rejections::default(),
            clamped: 0,
            truncated: 3,
            ..RenderStats::default()
        };
        let settings = RenderSettings {
            wave: 1000,
            max_depth: Some(16),
            threads: 2,
            seed: u64::MAX,
            ..RenderSettings::default()
        };
        let mut film = Film::new(2, 1, false);
        for (pixel, sum) in [(0, 1.0), (1, 1.1), (0, 1.3), (1, 0.7)] {
            film.add_block(pixel, 3, [sum; 3]);
        }
        RenderReport::new(ReportInput {
            scene: SceneReport {
                name: "room".into(),
                camera: "1".into(),
                width: 2,
                height: 1,
            },
            settings: &settings,
            plan: serde_json::json!({ "stages": ["generate", "intersect"], "bytes": 96 }),
            accel: "linear".into(),
            machine: Machine::read(),
            film: &film,
            stats: &stats,
            ended: EndReason::Interrupted,
            earlier: Some(Earlier {
                sessions: 2,
                samples: 1.5,
                cpu_seconds: 0.5,
                wall_seconds: 0.25,
            }),
            checkpoint: Some("room.checkpoint".into()),
            load: load::tests::sample(),
            times: Times {
                load: Span {
                    wall_seconds: 0.1,
                    cpu_seconds: 0.3,
                },
                process_cpu_seconds: 2.5,
                ..Times::default()
            },
            images: vec!["room.png".into()],
        })
    }

    #[test]
    fn json_reads_back_as_the_same_report() {
        let report = sample();
        let read: RenderReport = serde_json::from_str(&report.to_json()).unwrap();
        assert_eq!(read, report);
    }

    #[test]
    fn rates_and_shares_follow_from_the_counts() {
        let report = sample();
        assert_eq!(report.rays.total, 6000);
        assert_eq!(
            (report.rays.per_second, report.rays.per_cpu_second),
            (6000.0, 3000.0)
        );
        assert_eq!(
            (report.rays.nodes_per_ray, report.rays.tests_per_ray),
            (0.0, 32.0)
        );
        assert_eq!(
            (report.paths.per_cpu_second, report.paths.mean_length),
            (500.0, 3.0)
        );
        assert_eq!(
            (report.depths[1].depth, report.depths[1].queue_fill),
            (2, 0.25)
        );
        assert_eq!(
            (report.result.min_samples, report.result.mean_samples),
            (6, 6.0)
        );
        assert!(report.result.relative_error.is_some());
    }

    #[test]
    fn sessions_of_a_resumed_render_add_up() {
        let resumed = sample().resumed.unwrap();
        assert_eq!(resumed.sessions, 3);
        assert_eq!((resumed.before.samples, resumed.after.samples), (1.5, 4.5));
        assert_eq!(
            (resumed.after.cpu_seconds, resumed.after.wall_seconds),
            (1.5, 0.75)
        );
    }

    #[test]
    fn unequal_sample_counts_are_told_with_their_mean() {
        let mut result = sample().result;
        assert_eq!(result.samples_per_pixel(), "6");
        result.max_samples = 12;
        result.mean_samples = 7.5;
        assert_eq!(result.samples_per_pixel(), "6 to 12 (mean 7.50)");
    }

    #[test]
    fn stages_and_the_rest_add_up_to_all_cpu_time() {
        let stages = sample().stages;
        assert_eq!(stages.last().unwrap().name, "other");
        assert_eq!(
            stages.iter().map(|stage| stage.cpu_seconds).sum::<f64>(),
            2.0
        );
        assert_eq!(stages.iter().map(|stage| stage.share).sum::<f64>(), 1.0);
    }

    #[test]
    fn every_source_of_bias_is_named() {
        let stats = RenderStats {
            rejected: 1,
            clamped: 4,
            truncated: 2,
            ..RenderStats::default()
        };
        let biased = RenderSettings {
            transparent_shadows: true,
            supersampling: Supersampling::Off,
            shadow_bias: Some(1e-3),
            clamp: Some(10.0),
            max_depth: Some(3),
            ..RenderSettings::default()
        };
        assert_eq!(bias(&biased, &stats).len(), 6);
        assert!(bias(&RenderSettings::default(), &RenderStats::default()).is_empty());
    }

    #[test]
    fn render_that_did_nothing_has_finite_figures() {
        let report = RenderReport::new(ReportInput {
            scene: SceneReport {
                name: String::new(),
                camera: String::new(),
                width: 1,
                height: 1,
            },
            settings: &RenderSettings::default(),
            plan: serde_json::Value::Null,
            accel: String::new(),
            machine: Machine::read(),
            film: &Film::new(1, 1, false),
            stats: &RenderStats::default(),
            ended: EndReason::Interrupted,
            earlier: None,
            checkpoint: None,
            load: LoadReport::default(),
            times: Times::default(),
            images: Vec::new(),
        });
        let read: RenderReport = serde_json::from_str(&report.to_json()).unwrap();
        assert_eq!(read, report);
    }

    #[test]
    fn median_is_of_the_sorted_values() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [4.0, 1.0, 3.0, 2.0]), 2.5);
    }
}
