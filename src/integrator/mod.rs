//! Renders: hands out work items to workers, round by round, until the budget is used.
//!
//! A round is one block of samples for every tile, or for those that an adaptive render chooses. Within
//! a round each tile belongs to one work item (in each half of the film), and rounds follow one another, so
//! each pixel's blocks are added in order, whatever the number of threads: the film is bit-identical.

pub mod adaptive;
pub mod checkpoint;
pub mod clock;
pub mod plan;
pub mod schedule;
pub mod stats;
pub mod wavefront;

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard};
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

use adaptive::Adaptive;
use checkpoint::{Earlier, Past, Resume, Saver, Saving};
use clock::{Span, StageClock, Step, Stopwatch, thread_cpu_seconds};
use schedule::{Schedule, Tiles, samples_of_part};
use stats::{DepthStats, EndReason, Progress, RenderStats, StageStats};
use wavefront::Passes;

/// Mean samples per pixel that an error goal needs before it is believed.
const SAMPLES_BEFORE_ERROR: u64 = 16;
/// An estimate takes as long as half a sample of every pixel, and the more often one looks the sooner one
/// meets one that is too small. So the error is estimated when there are a quarter more samples than the last
/// time if it is a goal, half as many more if it is only told.
const LOOKS: u64 = 4;
const LOOKS_WITHOUT_GOAL: u64 = 2;
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
    /// What had been done of it before, if it was resumed.
    pub earlier: Option<Earlier>,
}

/// Called with the state of the render every now and then, from any worker; to stop the render it
/// returns [`ControlFlow::Break`], and the work items in flight are completed.
pub type Observer<'a> = dyn Fn(&Progress) -> ControlFlow<()> + Sync + 'a;

/// Starts so many threads to work on.
///
/// # Errors
/// [`crate::ErrorKind::Limit`] if they cannot be started.
pub fn thread_pool(threads: usize) -> Result<rayon::ThreadPool> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|i| format!("worker-{i}"))
        .build()
        .map_err(|error| Error::limit(format!("cannot start {threads} threads: {error}")))
}

/// Renders `compiled`, made of `scene`, until the budget of `settings` is used or the observer breaks.
///
/// # Errors
/// As [`Session::new`], and if an adaptive render is to have too few samples.
pub fn render(
    scene: &SceneDescription,
    compiled: &CompiledScene,
    settings: &RenderSettings,
    observer: &Observer<'_>,
) -> Result<Outcome> {
    render_resumable(scene, compiled, settings, observer, None, None)
}

/// As [`render`], from where an interrupted render had come to, and with checkpoints. A budget is that of
/// the whole render, what was done before included.
///
/// # Errors
/// As [`render`].
///
/// # Panics
/// If what is resumed was read for a scene with another size of film or for other settings.
pub fn render_resumable(
    scene: &SceneDescription,
    compiled: &CompiledScene,
    settings: &RenderSettings,
    observer: &Observer<'_>,
    resume: Option<Resume>,
    saving: Option<Saving<'_>>,
) -> Result<Outcome> {
    let watch = Stopwatch::start();
    let tiles = Tiles::new(compiled.width, compiled.height);
    let (mut schedule, film, past) = match resume {
        Some(resume) => resume.parts(),
        None => (Schedule::new(settings, tiles)?, None, Past::default()),
    };
    let Past {
        mut rounds,
        mut estimated_at,
        error,
        earlier,
        stats,
    } = past;
    let largest = schedule.largest_block();
    let mut session = Session::with_film(scene, compiled, settings, largest, film)?;
    session.error = error;
    session.earlier = stats;
    let mut saver = Saver::new(saving, earlier.as_ref(), session.paths);
    let prepare = watch.span();
    let pixels = session.film().len() as u64;
    let looks = match settings.budget {
        Budget::Error(_) => LOOKS,
        Budget::Samples(_) | Budget::Seconds(_) => LOOKS_WITHOUT_GOAL,
    };
    let start = Stopwatch::start();
    let mut seconds = session.earlier.wall_seconds;
    let mut seconds_per_path = match session.paths {
        0 => 0.0,
        paths => seconds / paths as f64,
    };
    let ended = 'render: loop {
        if let Budget::Error(goal) = settings.budget
            && estimated_at == session.paths
        {
            let known = session.paths >= SAMPLES_BEFORE_ERROR * pixels;
            if known && session.error.is_some_and(|error| error <= goal) {
                break EndReason::Error;
            }
        }
        let items = schedule.round();
        if items.is_empty() {
            break EndReason::Samples;
        }
        let mut missing = schedule.missing(&items, session.film());
        let paths: u64 = missing.iter().map(|item| u64::from(item.paths())).sum();
        // Not begun if it would overrun: a path takes as long as in the last round.
        if let Budget::Seconds(limit) = settings.budget
            && seconds + seconds_per_path * paths as f64 > limit
        {
            break EndReason::Seconds;
        }
        if schedule.is_short() {
            saver.save(&mut session, &schedule, rounds, estimated_at);
            saver.stop();
        }
        while !missing.is_empty() {
            let (done, flow) = session.trace(&missing, saver.due(), observer);
            missing.drain(..done);
            if flow.is_break() {
                break 'render EndReason::Interrupted;
            }
            if !missing.is_empty() {
                saver.save(&mut session, &schedule, rounds, estimated_at);
            }
        }
        schedule.finished(&items, session.film());
        let now = session.seconds();
        // All of them may have been in the film before.
        if paths > 0 {
            seconds_per_path = (now - seconds) / paths as f64;
        }
        seconds = now;
        rounds += 1;
        if session.paths - estimated_at >= pixels.max(estimated_at / looks) {
            estimated_at = session.paths;
            session.error = session.film().relative_error();
        }
        if saver.due().is_some_and(|due| due <= Instant::now()) {
            saver.save(&mut session, &schedule, rounds, estimated_at);
        }
    };
    saver.save(&mut session, &schedule, rounds, estimated_at);
    let stats = RenderStats {
        prepare,
        between: start.span() - session.rounds,
        ..session.stats_until_now()
    };
    Ok(Outcome {
        film: session.into_film(),
        stats,
        ended,
        earlier,
    })
}

/// A render that goes on round by round for as long as its owner asks. Its clocks run in rounds alone:
/// to look at the image between them costs nothing in the figures.
#[derive(Debug)]
pub struct Session<'a> {
    compiled: &'a CompiledScene,
    settings: RenderSettings,
    pool: rayon::ThreadPool,
    tiles: Tiles,
    reference: Option<Reference>,
    workers: Vec<Mutex<Worker>>,
    film: Mutex<Film>,
    /// Which work items [`Self::round`] renders where samples are placed adaptively; from its first call on.
    adaptive: Option<Adaptive>,
    /// Rounds of [`Self::round`] completed, and the block of the next one.
    blocks: u64,
    /// Samples per pixel in them, of an adaptive render their mean rounded down.
    samples: u64,
    /// Paths in the film.
    paths: u64,
    /// Time in rounds.
    rounds: Span,
    /// Counts and times of earlier sessions, if the render was resumed.
    earlier: RenderStats,
    /// Error estimate to tell the observer.
    error: Option<f64>,
    started: Instant,
}

impl<'a> Session<'a> {
    /// Prepares to render `compiled`, made of `scene`, in blocks of at most `largest_block` samples per
    /// pixel. The budget of `settings` only tells the observer how far the render is.
    ///
    /// # Errors
    /// If the film does not fit into memory, or threads cannot be started.
    pub fn new(
        scene: &SceneDescription,
        compiled: &'a CompiledScene,
        settings: &RenderSettings,
        largest_block: u32,
    ) -> Result<Self> {
        Self::with_film(scene, compiled, settings, largest_block, None)
    }

    /// As [`Self::new`], with what is in `film` already.
    fn with_film(
        scene: &SceneDescription,
        compiled: &'a CompiledScene,
        settings: &RenderSettings,
        largest_block: u32,
        film: Option<Film>,
    ) -> Result<Self> {
        let pool = thread_pool(settings.threads)?;
        let (width, height) = (compiled.width, compiled.height);
        let film = match film {
            Some(film) => {
                assert_eq!((film.width(), film.height()), (width, height));
                assert_eq!(film.parts(), schedule::parts(settings));
                film
            }
            None => {
                let parts = schedule::parts(settings);
                check_memory(width, height, settings.aux, parts.count() as u64)?;
                Film::in_parts(width, height, settings.aux, parts)
            }
        };
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
        let worker = |_| Mutex::new(Worker::new(compiled, settings, largest_block));
        Ok(Self {
            compiled,
            settings: settings.clone(),
            pool,
            adaptive: None,
            tiles: Tiles::new(width, height),
            reference,
            workers: (0..settings.threads).map(worker).collect(),
            paths: film.total_samples(),
            film: Mutex::new(film),
            blocks: 0,
            samples: 0,
            rounds: Span::default(),
            earlier: RenderStats::default(),
            error: None,
            started: Instant::now(),
        })
    }

    /// Renders the next block, of `samples` ≥ 1 samples per pixel; at most the largest block's. An adaptive
    /// render takes as many on average, or some more. Breaks if the observer does, the block then being
    /// incomplete.
    pub fn round(&mut self, samples: u32, observer: &Observer<'_>) -> ControlFlow<()> {
        if self.settings.adaptive {
            let begun = self.adaptive.take();
            let mut adaptive =
                begun.unwrap_or_else(|| Adaptive::endless(&self.settings, self.tiles));
            let flow = self.adaptive_rounds(&mut adaptive, samples, observer);
            self.adaptive = Some(adaptive);
            return flow;
        }
        let parts = schedule::parts(&self.settings).count();
        let items = |part| {
            let until = |total| samples_of_part(total, part, parts);
            let (first, end) = (
                until(self.samples),
                until(self.samples + u64::from(samples)),
            );
            let range = (first, (end - first) as u32);
            let items = (range.1 > 0).then(|| self.tiles.items(self.blocks, range, part));
            items.unwrap_or_default()
        };
        let items: Vec<WorkItem> = (0..parts).flat_map(items).collect();
        let (_, flow) = self.trace(&items, None, observer);
        self.blocks += 1;
        self.samples += u64::from(samples);
        flow
    }

    /// Rounds of an adaptive render, until there are `samples` more per pixel on average.
    fn adaptive_rounds(
        &mut self,
        adaptive: &mut Adaptive,
        samples: u32,
        observer: &Observer<'_>,
    ) -> ControlFlow<()> {
        let pixels = self.film().len() as u64;
        let goal = self.paths + u64::from(samples) * pixels;
        while self.paths < goal {
            let items = adaptive.round();
            self.trace(&items, None, observer).1?;
            adaptive.finished(&items, self.film());
        }
        self.samples = self.paths / pixels;
        ControlFlow::Continue(())
    }

    /// Renders work items, of which no two belong to one tile (of one half of the film). Returns how many: the
    /// first ones, and all of them unless the observer breaks or it is later than `until`. In that case
    /// every worker has rendered one. Breaks if the observer does.
    fn trace(
        &mut self,
        items: &[WorkItem],
        until: Option<Instant>,
        observer: &Observer<'_>,
    ) -> (usize, ControlFlow<()>) {
        let shared = Shared {
            film: &self.film,
            observer,
            last_observed: Mutex::new(self.started),
            interrupted: AtomicBool::new(false),
            rays: AtomicU64::new(
                self.earlier.rays() + self.locked_workers().map(|w| w.rays()).sum::<u64>(),
            ),
        };
        let pixels = f64::from(self.compiled.width) * f64::from(self.compiled.height);
        let paths_of =
            |items: &[WorkItem]| -> u64 { items.iter().map(|item| u64::from(item.paths())).sum() };
        let paths = paths_of(items);
        let watch = Stopwatch::start();
        let next_item = AtomicUsize::new(0);
        self.pool.broadcast(|context| {
            let mut worker = self.workers[context.index()]
                .lock()
                .expect("a worker's lock is its own");
            worker.timed(|worker| {
                while !shared.interrupted.load(Ordering::Relaxed) {
                    let index = next_item.fetch_add(1, Ordering::Relaxed);
                    let Some(item) = items.get(index) else {
                        break;
                    };
                    let reference = self.reference.as_ref();
                    let rays = worker.render_item(self.compiled, reference, item, shared.film);
                    shared.rays.fetch_add(rays, Ordering::Relaxed);
                    shared.observe(self.started, || {
                        let done = (index + 1) as f64 / items.len() as f64;
                        self.progress((self.paths as f64 + done * paths as f64) / pixels)
                    });
                    if until.is_some_and(|until| until <= Instant::now()) {
                        break;
                    }
                }
            });
        });
        let interrupted = shared.interrupted.into_inner();
        self.rounds += watch.span();
        // Whoever takes an item renders it.
        let done = next_item.into_inner().min(items.len());
        self.paths += paths_of(&items[..done]);
        let flow = if interrupted {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        };
        (done, flow)
    }

    /// Samples per pixel in the rounds so far, of an adaptive render their mean rounded down.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// CPU seconds of the workers in all rounds so far.
    pub fn cpu_seconds(&self) -> f64 {
        self.locked_workers().map(|worker| worker.cpu_seconds).sum()
    }

    /// The image so far.
    pub fn film(&mut self) -> &Film {
        self.film.get_mut().expect("no worker panicked")
    }

    /// The image, the render being at its end.
    pub fn into_film(self) -> Film {
        self.film.into_inner().expect("no worker panicked")
    }

    /// Counts and times of all rounds so far, and of earlier sessions.
    pub fn stats(&self) -> RenderStats {
        let mut stats = summarise(
            self.compiled,
            &self.settings,
            self.locked_workers(),
            self.rounds,
        );
        stats.add(&self.earlier);
        stats
    }

    /// As [`Self::stats`], with all wall seconds since the start, between rounds too.
    fn stats_until_now(&self) -> RenderStats {
        RenderStats {
            wall_seconds: self.seconds(),
            ..self.stats()
        }
    }

    /// Wall seconds since the start, and of earlier sessions.
    fn seconds(&self) -> f64 {
        self.earlier.wall_seconds + self.started.elapsed().as_secs_f64()
    }

    /// The workers, none of which is at work.
    fn locked_workers(&self) -> impl Iterator<Item = MutexGuard<'_, Worker>> {
        let workers = self.workers.iter();
        workers.map(|worker| worker.lock().expect("no worker panicked"))
    }

    /// What the observer is told when there are `done` samples per pixel.
    fn progress(&self, done: f64) -> Progress {
        let seconds = self.seconds();
        let fraction = match self.settings.budget {
            Budget::Samples(total) => (done / total as f64).min(1.0),
            Budget::Seconds(total) => (seconds / total).min(1.0),
            // Error falls as the root of time: the share of the work done is the square of the ratio.
            Budget::Error(goal) => self
                .error
                .map_or(0.0, |error| (goal / error).powi(2).min(1.0)),
        };
        Progress {
            fraction,
            samples: done,
            rays: 0,
            seconds,
            error: self.error,
        }
    }
}

/// What the workers share while a round runs.
struct Shared<'a> {
    film: &'a Mutex<Film>,
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

/// One thread's queues and counts, kept from round to round.
#[derive(Debug)]
struct Worker {
    tracer: Tracer,
    clock: StageClock,
    passes: Passes,
    paths: u64,
    clamp: Clamp,
    cpu_seconds: f64,
}

/// A limit on the radiance of camera samples.
#[derive(Debug)]
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

#[derive(Debug)]
enum Tracer {
    Wavefront { wave: Box<Wave>, kernels: Kernels },
    Reference { counts: RayCounts },
}

impl Worker {
    fn new(scene: &CompiledScene, settings: &RenderSettings, largest_block: u32) -> Self {
        let tracer = match settings.integrator {
            IntegratorKind::Reference => Tracer::Reference {
                counts: RayCounts::default(),
            },
            IntegratorKind::Path | IntegratorKind::Whitted => {
                let pixels = (TILE * TILE) as usize;
                let item_paths = pixels * largest_block as usize;
                Tracer::Wavefront {
                    wave: Box::new(Wave::new(
                        settings.wave,
                        scene.features,
                        scene.branching,
                        item_paths,
                        pixels,
                    )),
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

    /// Renders a work item into the film; returns the rays that took. `reference` is there if the
    /// integrator is it.
    fn render_item(
        &mut self,
        scene: &CompiledScene,
        reference: Option<&Reference>,
        item: &WorkItem,
        film: &Mutex<Film>,
    ) -> u64 {
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
            Tracer::Reference { counts } => {
                let reference = reference.expect("made with the session");
                for pixel in 0..item.pixels() {
                    let index = item.image_index(pixel);
                    let (x, y) = (item.x + pixel % item.width, item.y + pixel / item.width);
                    let samples = item.first_sample..item.first_sample + u64::from(item.samples);
                    let sum: DVec3 = samples
                        .map(|s| clamp.limit(reference.sample(x, y, s, counts)))
                        .sum();
                    lock(film)
                        .half_mut(item.half())
                        .add_block(index, item.samples, sum.to_array());
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
            Tracer::Reference { counts } => counts.camera + counts.bounce + counts.shadow,
        }
    }
}

fn lock(film: &Mutex<Film>) -> MutexGuard<'_, Film> {
    film.lock().expect("no worker panicked")
}

/// Sums the radiance of each pixel's samples, each within the clamp, in order, into the film.
fn develop(item: &WorkItem, wave: &Wave, clamp: &mut Clamp, film: &Mutex<Film>) {
    let mut film = lock(film);
    let film = film.half_mut(item.half());
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
fn summarise<'w>(
    scene: &CompiledScene,
    settings: &RenderSettings,
    workers: impl Iterator<Item = MutexGuard<'w, Worker>>,
    rounds: Span,
) -> RenderStats {
    let mut stats = RenderStats {
        wall_seconds: rounds.wall_seconds,
        rounds,
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
            Tracer::Reference { counts } => {
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
        stats.slots = passes.count * settings.wave as u64;
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
        stats.bytes_per_path = Wave::bytes_per_path(scene.features, scene.branching);
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
