//! Renders: hands out work items to workers, round by round, until the budget is used.
//!
//! A round is one block of samples for every tile. Within a round each tile belongs to one work
//! item, and rounds follow one another, so each pixel's blocks are added in order, whatever the
//! number of threads: the film is bit-identical.

pub mod clock;
pub mod plan;
pub mod schedule;
pub mod stats;
pub mod wavefront;

use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::Instant;

use glam::{DVec3, Vec3};

use crate::compile::{CompiledScene, TILE, WorkItem};
use crate::error::{Error, Result};
use crate::film::{Film, check_memory};
use crate::math::float::flush_denormals;
use crate::reference::{RayCounts, Reference};
use crate::scene::{Budget, IntegratorKind, RenderSettings, SceneDescription};
use crate::stage::Kernels;
use crate::wave::{COUNTED_DEPTHS, Wave};

use clock::{StageClock, Step, thread_cpu_seconds};
use schedule::{Blocks, Tiles};
use stats::{DepthStats, EndReason, Progress, RenderStats, StageStats};
use wavefront::Passes;

/// Blocks that an error goal needs before it is believed.
const BLOCKS_BEFORE_ERROR: u64 = 5;
/// Wall seconds between calls of the observer.
const OBSERVER_INTERVAL: f64 = 0.05;

/// What a render leaves behind.
#[derive(Debug)]
pub struct Outcome {
    /// The image.
    pub film: Film,
    /// Counts and times.
    pub stats: RenderStats,
    /// What ended it.
    pub ended: EndReason,
}

/// Called with the state of the render every now and then, from any worker; to stop the render it
/// returns [`ControlFlow::Break`], and the work items in flight are completed.
pub type Observer<'a> = dyn Fn(&Progress) -> ControlFlow<()> + Sync + 'a;

/// Renders `compiled`, made of `scene`, until the budget of `settings` is used or the observer breaks.
///
/// # Errors
/// If the film does not fit into memory, or threads cannot be started.
pub fn render(
    scene: &SceneDescription,
    compiled: &CompiledScene,
    settings: &RenderSettings,
    observer: &Observer<'_>,
) -> Result<Outcome> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(settings.threads)
        .thread_name(|i| format!("worker-{i}"))
        .build()
        .map_err(|error| {
            Error::limit(format!(
                "cannot start {} threads: {error}",
                settings.threads
            ))
        })?;
    let (width, height) = (compiled.width, compiled.height);
    let blocks = Blocks::new(settings);
    let tiles = Tiles::new(width, height);
    check_memory(width, height, settings.aux)?;
    let film = Film::new(width, height, settings.aux);
    let reference = match settings.integrator {
        IntegratorKind::Reference => Some(Reference::new(
            scene,
            compiled.camera_index,
            width,
            height,
            settings,
        )?),
        IntegratorKind::Path | IntegratorKind::Whitted => None,
    };
    let workers: Vec<_> = (0..settings.threads)
        .map(|_| {
            Mutex::new(Worker::new(
                compiled,
                settings,
                reference.as_ref(),
                blocks.largest(),
            ))
        })
        .collect();

    let start = Instant::now();
    let shared = Shared {
        film: Mutex::new(film),
        observer,
        last_observed: Mutex::new(start),
        interrupted: AtomicBool::new(false),
        rays: AtomicU64::new(0),
    };
    let mut state = RoundState {
        block: 0,
        error: None,
        seconds: 0.0,
    };
    let ended = loop {
        let Some(samples) = blocks.get(state.block) else {
            break EndReason::Samples;
        };
        let next_tile = AtomicUsize::new(0);
        pool.broadcast(|context| {
            let mut worker = workers[context.index()]
                .lock()
                .expect("a worker's lock is its own");
            worker.timed(|worker| {
                while !shared.interrupted.load(Ordering::Relaxed) {
                    let tile = next_tile.fetch_add(1, Ordering::Relaxed);
                    if tile >= tiles.count() {
                        break;
                    }
                    let item = tiles.item(tile, state.block, samples);
                    let rays = worker.render_item(compiled, &item, &shared.film);
                    shared.rays.fetch_add(rays, Ordering::Relaxed);
                    shared.observe(start, || {
                        let done = (tile + 1) as f64 / tiles.count() as f64;
                        progress(settings, &state, samples, done, start)
                    });
                }
            });
        });
        let round_seconds = start.elapsed().as_secs_f64() - state.seconds;
        state.seconds += round_seconds;
        state.block += 1;
        if shared.interrupted.load(Ordering::Relaxed) {
            break EndReason::Interrupted;
        }
        let film = lock(&shared.film);
        state.error = film.relative_error();
        match settings.budget {
            Budget::Samples(_) => {}
            Budget::Seconds(seconds) => {
                // Not begun if it would overrun: a round takes as long per sample as the last.
                let per_sample = round_seconds / f64::from(samples.1);
                let next = blocks
                    .get(state.block)
                    .map_or(0.0, |(_, n)| f64::from(n) * per_sample);
                if state.seconds + next > seconds {
                    break EndReason::Seconds;
                }
            }
            Budget::Error(goal) => {
                let known = state.error.filter(|_| state.block >= BLOCKS_BEFORE_ERROR);
                if known.is_some_and(|error| error <= goal) {
                    break EndReason::Error;
                }
            }
        }
    };
    let wall_seconds = start.elapsed().as_secs_f64();
    let film = shared.film.into_inner().expect("no worker panicked");
    let workers: Vec<Worker<'_>> = workers
        .into_iter()
        .map(|w| w.into_inner().expect("no worker panicked"))
        .collect();
    let stats = summarise(compiled, settings, &workers, wall_seconds);
    Ok(Outcome { film, stats, ended })
}

/// Where the rounds stand.
#[derive(Clone, Copy)]
struct RoundState {
    /// Rounds completed, and the block of the running one.
    block: u64,
    /// Error estimate after the last complete round.
    error: Option<f64>,
    /// Wall seconds at the end of the last complete round.
    seconds: f64,
}

/// What the workers share while a round runs.
struct Shared<'a> {
    film: Mutex<Film>,
    observer: &'a Observer<'a>,
    last_observed: Mutex<Instant>,
    interrupted: AtomicBool,
    rays: AtomicU64,
}

impl Shared<'_> {
    /// Calls the observer if it was not called for a while and no other worker is doing so.
    fn observe(&self, start: Instant, progress: impl FnOnce() -> Progress) {
        let Ok(mut last) = self.last_observed.try_lock() else {
            return;
        };
        if last.elapsed().as_secs_f64() < OBSERVER_INTERVAL && *last != start {
            return;
        }
        *last = Instant::now();
        let progress = Progress {
            rays: self.rays.load(Ordering::Relaxed),
            ..progress()
        };
        if (self.observer)(&progress).is_break() {
            self.interrupted.store(true, Ordering::Relaxed);
        }
    }
}

fn progress(
    settings: &RenderSettings,
    state: &RoundState,
    (first, samples): (u64, u32),
    round_done: f64,
    start: Instant,
) -> Progress {
    let seconds = start.elapsed().as_secs_f64();
    let done = first as f64 + round_done * f64::from(samples);
    let fraction = match settings.budget {
        Budget::Samples(total) => done / total as f64,
        Budget::Seconds(total) => (seconds / total).min(1.0),
        // Error falls as the root of time: the share of the work done is the square of the ratio.
        Budget::Error(goal) => state
            .error
            .map_or(0.0, |error| (goal / error).powi(2).min(1.0)),
    };
    Progress {
        fraction,
        samples: done,
        rays: 0,
        seconds,
        error: state.error,
    }
}

/// One thread's queues and counts, kept from round to round.
struct Worker<'a> {
    tracer: Tracer<'a>,
    clock: StageClock,
    passes: Passes,
    paths: u64,
    clamp: Clamp,
    cpu_seconds: f64,
}

/// A limit on the radiance of camera samples.
struct Clamp {
    /// Of the brightest channel; infinite for none.
    most: f64,
    /// Samples that were above it.
    count: u64,
}

impl Clamp {
    fn new(settings: &RenderSettings) -> Self {
        Self {
            most: settings.clamp.unwrap_or(f64::INFINITY),
            count: 0,
        }
    }

    /// The radiance, darkened in all channels alike if it is above the limit.
    #[inline]
    fn limit(&mut self, radiance: DVec3) -> DVec3 {
        let brightest = radiance.max_element();
        if brightest <= self.most {
            return radiance;
        }
        self.count += 1;
        radiance * (self.most / brightest)
    }
}

enum Tracer<'a> {
    Wavefront {
        wave: Box<Wave>,
        kernels: Kernels,
    },
    Reference {
        reference: &'a Reference,
        counts: RayCounts,
    },
}

impl<'a> Worker<'a> {
    fn new(
        scene: &CompiledScene,
        settings: &RenderSettings,
        reference: Option<&'a Reference>,
        largest_block: u32,
    ) -> Self {
        let tracer = match reference {
            Some(reference) => Tracer::Reference {
                reference,
                counts: RayCounts::default(),
            },
            None => {
                let pixels = (TILE * TILE) as usize;
                let item_paths = pixels * largest_block as usize;
                Tracer::Wavefront {
                    wave: Box::new(Wave::new(settings.wave, scene.features, item_paths, pixels)),
                    kernels: Kernels::choose(scene.features, settings.force_features),
                }
            }
        };
        Self {
            tracer,
            clock: StageClock::default(),
            passes: Passes::default(),
            paths: 0,
            clamp: Clamp::new(settings),
            cpu_seconds: 0.0,
        }
    }

    /// Runs `work` on this thread and adds its CPU time.
    fn timed(&mut self, work: impl FnOnce(&mut Self)) {
        flush_denormals();
        let start = thread_cpu_seconds();
        work(self);
        self.cpu_seconds += thread_cpu_seconds() - start;
    }

    /// Renders a work item into the film; returns the rays that took.
    fn render_item(&mut self, scene: &CompiledScene, item: &WorkItem, film: &Mutex<Film>) -> u64 {
        self.paths += u64::from(item.paths());
        let before = self.rays();
        let clamp = &mut self.clamp;
        match &mut self.tracer {
            Tracer::Wavefront { wave, kernels } => {
                let passes = wavefront::trace(scene, kernels, item, wave, &mut self.clock);
                self.passes.count += passes.count;
                self.passes.rays += passes.rays;
                self.clock.run(Step::Film, item.paths() as usize, || {
                    develop(item, wave, clamp, film)
                });
            }
            Tracer::Reference { reference, counts } => {
                for pixel in 0..item.pixels() {
                    let index = item.image_index(pixel);
                    let (x, y) = (item.x + pixel % item.width, item.y + pixel / item.width);
                    let samples = item.first_sample..item.first_sample + u64::from(item.samples);
                    let sum: DVec3 = samples
                        .map(|s| clamp.limit(reference.sample(x, y, s, counts)))
                        .sum();
                    lock(film).add_block(index, item.samples, sum.to_array());
                }
            }
        }
        self.rays() - before
    }

    /// Rays so far.
    fn rays(&self) -> u64 {
        match &self.tracer {
            Tracer::Wavefront { wave, .. } => {
                let counters = &wave.counters;
                counters.rays.iter().chain(&counters.shadow_rays).sum()
            }
            Tracer::Reference { counts, .. } => counts.camera + counts.bounce + counts.shadow,
        }
    }
}

fn lock(film: &Mutex<Film>) -> std::sync::MutexGuard<'_, Film> {
    film.lock().expect("no worker panicked")
}

/// Sums the radiance of each pixel's samples, each within the clamp, in order, into the film.
fn develop(item: &WorkItem, wave: &Wave, clamp: &mut Clamp, film: &Mutex<Film>) {
    let mut film = lock(film);
    for (pixel, samples) in wave.radiance[..item.paths() as usize]
        .chunks_exact(item.samples as usize)
        .enumerate()
    {
        let sum: DVec3 = samples
            .iter()
            .map(|&[r, g, b, _]| clamp.limit(Vec3::new(r, g, b).as_dvec3()))
            .sum();
        film.add_block(item.image_index(pixel as u32), item.samples, sum.to_array());
    }
    if !wave.aux.is_empty() {
        for (pixel, aux) in wave.aux[..item.pixels() as usize].iter().enumerate() {
            let index = item.image_index(pixel as u32);
            film.add_aux(index, item.samples, aux.albedo, aux.normal, aux.depth);
        }
    }
}

/// Adds up what the workers counted.
fn summarise(
    scene: &CompiledScene,
    settings: &RenderSettings,
    workers: &[Worker<'_>],
    wall_seconds: f64,
) -> RenderStats {
    let mut stats = RenderStats {
        wall_seconds,
        ..RenderStats::default()
    };
    let mut clock = StageClock::default();
    let mut passes = Passes::default();
    let mut depths = vec![DepthStats::default(); COUNTED_DEPTHS];
    for worker in workers {
        stats.cpu_seconds += worker.cpu_seconds;
        stats.paths += worker.paths;
        stats.clamped += worker.clamp.count;
        clock.add(&worker.clock);
        passes.count += worker.passes.count;
        passes.rays += worker.passes.rays;
        match &worker.tracer {
            Tracer::Wavefront { wave, .. } => {
                let counters = &wave.counters;
                stats.camera_rays += counters.rays[0];
                stats.bounce_rays += counters.rays[1..].iter().sum::<u64>();
                stats.shadow_rays += counters.shadow_rays.iter().sum::<u64>();
                for (i, depth) in depths.iter_mut().enumerate() {
                    depth.rays += counters.rays[i];
                    depth.shadow_rays += counters.shadow_rays[i];
                }
                stats.accel_nodes += counters.accel.nodes;
                stats.accel_tests += counters.accel.tests;
                stats.rejected_by_stage.add(&counters.rejected);
                stats.truncated += counters.truncated;
            }
            Tracer::Reference { counts, .. } => {
                stats.camera_rays += counts.camera;
                stats.bounce_rays += counts.bounce;
                stats.shadow_rays += counts.shadow;
                stats.truncated += counts.truncated;
                stats.rejected_by_stage.add(&counts.rejected);
            }
        }
    }
    stats.rejected = stats.rejected_by_stage.total();
    if settings.integrator != IntegratorKind::Reference {
        let slots = (passes.count * settings.wave as u64).max(1) as f64;
        stats.passes = passes.count;
        stats.queue_fill = passes.rays as f64 / slots;
        for depth in &mut depths {
            depth.queue_fill = depth.rays as f64 / slots;
        }
        let used = depths
            .iter()
            .rposition(|d| d.rays > 0)
            .map_or(0, |last| last + 1);
        depths.truncate(used);
        stats.depths = depths;
        stats.bytes_per_path = Wave::bytes_per_path(scene.features);
        // Wall time per step, scaled to the CPU time of the workers: the machine may be shared.
        let measured: f64 = clock
            .time
            .iter()
            .map(std::time::Duration::as_secs_f64)
            .sum();
        let scale = if measured > 0.0 {
            (stats.cpu_seconds / measured).min(1.0)
        } else {
            0.0
        };
        stats.stages = Step::ALL
            .into_iter()
            .map(|step| StageStats {
                name: step.name(),
                cpu_seconds: clock.time[step as usize].as_secs_f64() * scale,
                items: clock.items[step as usize],
            })
            .collect();
    }
    stats
}
