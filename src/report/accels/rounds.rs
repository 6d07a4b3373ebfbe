//! Times queries: batches of a ray set, taken by worker threads one after the other.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use rayon::ThreadPool;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::rays::{RayKind, RaySet};
use crate::accel::{Accel, AccelCounters, HitBatch};
use crate::geometry::PrimitiveId;
use crate::integrator::clock::thread_cpu_seconds;
use crate::math::float::flush_denormals;
use crate::math::lanes::padded;

/// One run of a structure over a ray set.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Round {
    /// CPU seconds of the worker threads.
    pub cpu_seconds: f64,
    /// Wall seconds.
    pub wall_seconds: f64,
}

/// Answers to a set: of shadow rays whether they are occluded, of others the closest hits.
#[derive(Debug, Clone, PartialEq)]
pub enum Answers {
    /// Distance and primitive, infinite and [`PrimitiveId::NONE`] where nothing is hit.
    Closest(Vec<(f32, u32)>),
    /// Whether something is in the way.
    Occluded(Vec<bool>),
}

/// One worker's room for a batch and its answers.
struct Buffers {
    none: Vec<u32>,
    t: Vec<f32>,
    /// Primitives, or whether rays are occluded.
    words: Vec<u32>,
    counters: AccelCounters,
}

impl Buffers {
    fn new(batch: usize) -> Self {
        Self {
            none: vec![PrimitiveId::NONE; padded(batch)],
            t: vec![0.0; padded(batch)],
            words: vec![0; padded(batch)],
            counters: AccelCounters::default(),
        }
    }

    fn answer(&mut self, accel: &dyn Accel, rays: &RaySet, at: usize, len: usize) {
        if rays.kind() == RayKind::Shadow {
            let shadows = rays.shadows(at, len, &self.none);
            accel.occluded(shadows, &mut self.words, &mut self.counters);
        } else {
            let hits = HitBatch {
                t: &mut self.t,
                primitive: &mut self.words,
            };
            accel.closest(rays.rays(at, len, &self.none), hits, &mut self.counters);
        }
    }
}

/// Runs the structure over the set in batches of `batch` rays, on every thread of the pool.
pub fn run(
    pool: &ThreadPool,
    accel: &dyn Accel,
    rays: &RaySet,
    batch: usize,
) -> (Round, AccelCounters) {
    let next = AtomicUsize::new(0);
    let start = Instant::now();
    let workers = pool.broadcast(|_| {
        flush_denormals();
        let mut buffers = Buffers::new(batch);
        let start = thread_cpu_seconds();
        loop {
            let at = next.fetch_add(batch, Ordering::Relaxed);
            if at >= rays.len() {
                break;
            }
            buffers.answer(accel, rays, at, batch.min(rays.len() - at));
        }
        (thread_cpu_seconds() - start, buffers.counters)
    });
    let mut round = Round {
        cpu_seconds: 0.0,
        wall_seconds: start.elapsed().as_secs_f64(),
    };
    let mut total = AccelCounters::default();
    for (cpu_seconds, counters) in workers {
        round.cpu_seconds += cpu_seconds;
        total.nodes += counters.nodes;
        total.tests += counters.tests;
    }
    (round, total)
}

/// The structure's answers to the whole set, in batches of `batch` rays.
pub fn answers(pool: &ThreadPool, accel: &dyn Accel, rays: &RaySet, batch: usize) -> Answers {
    let batches: Vec<Buffers> = pool.install(|| {
        let starts = (0..rays.len()).into_par_iter().step_by(batch);
        starts
            .map(|at| {
                flush_denormals();
                let len = batch.min(rays.len() - at);
                let mut buffers = Buffers::new(len);
                buffers.answer(accel, rays, at, len);
                buffers.t.truncate(len);
                buffers.words.truncate(len);
                buffers
            })
            .collect()
    });
    if rays.kind() == RayKind::Shadow {
        let words = batches.iter().flat_map(|batch| &batch.words);
        Answers::Occluded(words.map(|&word| word != 0).collect())
    } else {
        let hits = batches
            .iter()
            .flat_map(|batch| batch.t.iter().zip(&batch.words));
        Answers::Closest(hits.map(|(&t, &primitive)| (t, primitive)).collect())
    }
}
