//! What a scene needs and what was left out, for people and for reports.

use std::fmt;

use serde::Serialize;

use crate::compile::{CompiledScene, Features};
use crate::material::MaterialKind;
use crate::math::LANES;
use crate::scene::{IntegratorKind, RenderSettings};
use crate::stage::Kernels;
use crate::wave::soa::ColumnInfo;
use crate::wave::{HitQueue, IndexQueue, RayQueue, ShadowQueue, Wave, material_feature};

/// A stage of the plan.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StagePlan {
    /// Name, with the material for shading.
    pub name: String,
    /// Whether it runs.
    pub runs: bool,
}

/// A queue of the plan.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct QueuePlan {
    /// Name.
    pub name: String,
    /// How many queues of this form there are (0: left out).
    pub count: usize,
    /// Bytes per item of one.
    pub bytes_per_item: usize,
    /// Columns that exist.
    pub columns: Vec<&'static str>,
    /// Columns that were left out.
    pub left_out: Vec<&'static str>,
}

/// What runs for a scene and its settings.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Plan {
    /// Triangles traced.
    pub triangles: usize,
    /// Spheres traced.
    pub spheres: usize,
    /// Lights that are sampled.
    pub lights: usize,
    /// Faces without area after rounding, which are not traced.
    pub dropped: usize,
    /// Acceleration structure.
    pub accel: String,
    /// Its bytes.
    pub accel_bytes: usize,
    /// Needed features.
    pub needed: Vec<&'static str>,
    /// Features left out.
    pub left_out: Vec<&'static str>,
    /// Kernel instance: what it was compiled for.
    pub kernels: String,
    /// Stages in loop order.
    pub stages: Vec<StagePlan>,
    /// Queues.
    pub queues: Vec<QueuePlan>,
    /// Bytes of queues per path in flight.
    pub bytes_per_path: usize,
    /// Paths in flight per worker.
    pub wave: usize,
    /// Rays per vector.
    pub lanes: usize,
}

impl Plan {
    /// The plan of a compiled scene. The reference integrator runs no stage and has no queue.
    pub fn new(scene: &CompiledScene, settings: &RenderSettings) -> Self {
        let features = scene.features;
        let mut plan = Self {
            triangles: scene.surfaces.first_sphere as usize,
            spheres: scene.surfaces.radius.len(),
            lights: scene.lights.len(),
            dropped: scene.dropped,
            accel: scene.accel.name().to_owned(),
            accel_bytes: scene.accel.bytes(),
            needed: features.names().collect(),
            left_out: features.absent().collect(),
            kernels: String::new(),
            stages: Vec::new(),
            queues: Vec::new(),
            bytes_per_path: 0,
            wave: settings.wave,
            lanes: LANES,
        };
        if settings.integrator == IntegratorKind::Reference {
            "linear, scalar, f64".clone_into(&mut plan.accel);
            "none: the reference traces one ray at a time".clone_into(&mut plan.kernels);
            return plan;
        }
        let kernels = Kernels::choose(features, settings.force_features);
        kernels.name.clone_into(&mut plan.kernels);
        let mut stage = |name: &str, runs: bool| {
            plan.stages.push(StagePlan {
                name: name.to_owned(),
                runs,
            })
        };
        stage("generate", true);
        stage("intersect", true);
        stage("sort", true);
        stage("record aux", kernels.record_aux.is_some());
        stage("shade escaped", kernels.shade_escaped.is_some());
        stage("shade emission", kernels.shade_emission.is_some());
        for kind in &MaterialKind::ALL[1..] {
            stage(
                &format!("shade {}", kind.name()),
                kernels.shade[*kind as usize].is_some(),
            );
        }
        let transparent = features.contains(Features::TRANSPARENT_SHADOWS);
        stage("connect", kernels.connect.is_some() && !transparent);
        stage(
            "connect transparent",
            kernels.connect.is_some() && transparent,
        );
        stage("roulette", true);

        let branching = scene.branching;
        let samples = branching.light_samples as usize;
        let has = |needs: Features| usize::from(features.intersects(needs));
        let index_queues = (0..MaterialKind::COUNT)
            .map(|kind| has(material_feature(kind)))
            .sum::<usize>()
            + has(Features::LIGHT_FLAT | Features::LIGHT_SPHERE)
            + has(Features::BACKGROUND);
        plan.queues = vec![
            queue(
                "rays, and next rays",
                1 + branching.next_per_ray(),
                RayQueue::COLUMNS,
                features,
            ),
            queue(
                "hits",
                if transparent { samples } else { 1 },
                HitQueue::COLUMNS,
                features,
            ),
            queue(
                "shadow rays",
                samples * (has(Features::SHADOW_RAYS) + has(Features::TRANSPARENT_SHADOWS)),
                ShadowQueue::COLUMNS,
                features,
            ),
            queue(
                "indices: one per material, emitters, escaped",
                index_queues,
                IndexQueue::COLUMNS,
                features,
            ),
        ];
        plan.bytes_per_path = Wave::bytes_per_path(features, branching);
        plan
    }
}

fn queue(name: &str, count: usize, columns: &[ColumnInfo], features: Features) -> QueuePlan {
    let names = |present: bool| {
        let chosen = columns
            .iter()
            .filter(|c| features.require(c.needs) == present);
        chosen.map(|c| c.name).collect()
    };
    QueuePlan {
        name: name.to_owned(),
        count,
        bytes_per_item: columns
            .iter()
            .filter(|c| features.require(c.needs))
            .map(|c| c.bytes)
            .sum(),
        columns: names(true),
        left_out: names(false),
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "scene      {} triangles, {} spheres, {} lights; {} faces without area dropped",
            self.triangles, self.spheres, self.lights, self.dropped
        )?;
        writeln!(f, "structure  {} ({} bytes)", self.accel, self.accel_bytes)?;
        writeln!(f, "needs      {}", self.needed.join(", "))?;
        writeln!(f, "left out   {}", self.left_out.join(", "))?;
        writeln!(f, "kernels    {}", self.kernels)?;
        let stages = |runs: bool| {
            let chosen = self.stages.iter().filter(|s| s.runs == runs);
            chosen
                .map(|s| s.name.as_str())
                .collect::<Vec<_>>()
                .join(", ")
        };
        if self.stages.is_empty() {
            return Ok(());
        }
        writeln!(f, "stages     {}", stages(true))?;
        writeln!(f, "not run    {}", stages(false))?;
        writeln!(f, "queues")?;
        for queue in &self.queues {
            writeln!(
                f,
                "  {} × {}: {} bytes per item",
                queue.count, queue.name, queue.bytes_per_item
            )?;
            writeln!(f, "    has    {}", queue.columns.join(" "))?;
            if !queue.left_out.is_empty() {
                writeln!(f, "    lacks  {}", queue.left_out.join(" "))?;
            }
        }
        writeln!(
            f,
            "a path in flight takes {} bytes; a wave of {} takes {:.1} KiB; vectors have {} lanes",
            self.bytes_per_path,
            self.wave,
            (self.bytes_per_path * self.wave) as f64 / 1024.0,
            self.lanes
        )
    }
}
