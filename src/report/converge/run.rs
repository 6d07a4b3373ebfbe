//! Runs a comparison: configurations in turn, repeat by repeat, checkpoint by checkpoint.

use std::ops::ControlFlow;
use std::path::Path;
use std::rc::Rc;

use super::aggregate::{Curves, pairs, rays};
use super::bias::{SignedErrors, verdict};
use super::definitions::definitions;
use super::errors::{ReferenceImage, errors};
use super::judge::judge;
use super::noise::measure;
use super::pictures::{Snapshot, slowest, write_picture, write_reference};
use super::reference::{ReferenceOptions, View, obtain};
use super::results::*;
use super::{Event, Interrupted, seed};
use crate::compile::{CompiledScene, compile};
use crate::error::Result;
use crate::integrator::Session;
use crate::integrator::plan::Plan;
use crate::integrator::stats::{RenderStats, StageStats};
use crate::report::{Build, Machine, SceneReport, Span, Stopwatch, bias, stages};
use crate::scene::{RenderSettings, SceneDescription};

/// One combination of settings to be compared.
#[derive(Debug)]
pub struct ConfigurationInput {
    /// Its name, unique.
    pub name: String,
    /// `path.to.key=value` that make it.
    pub overrides: Vec<String>,
    /// The scene with these.
    pub scene: Rc<SceneDescription>,
    /// Index of the camera.
    pub camera: usize,
    /// The settings with these. Threads, seed and budget are the comparison's.
    pub settings: RenderSettings,
    /// What loading the scene took.
    pub load: Span,
    /// When its images are scored.
    pub schedule: Schedule,
}

/// When the images of a configuration are scored.
#[derive(Debug, Clone, PartialEq)]
pub enum Schedule {
    /// At these sample counts, ascending, the last of which ends the render.
    At(Vec<u64>),
    /// At 1, 2, 4, … samples per pixel and when this many CPU seconds are used up, in whole rounds.
    Seconds(f64),
}

impl Schedule {
    /// At 1, 2, 4, … and `samples` samples per pixel.
    pub fn doubling(samples: u64) -> Self {
        let powers = (0..63).map(|k| 1 << k).take_while(|&power| power < samples);
        Self::At(powers.chain([samples]).collect())
    }

    /// The samples per pixel that end the render, if samples do.
    pub fn samples(&self) -> Option<u64> {
        match self {
            Self::At(checkpoints) => checkpoints.last().copied(),
            Self::Seconds(_) => None,
        }
    }

    /// The checkpoint after `samples` samples per pixel, if there is one.
    fn next(&self, samples: u64) -> Option<u64> {
        match self {
            Self::At(checkpoints) => checkpoints.iter().copied().find(|&at| at > samples),
            Self::Seconds(_) => Some((2 * samples).max(1)),
        }
    }
}

/// What a comparison starts from.
#[derive(Debug)]
pub struct ConvergeInput<'a> {
    /// Name, camera and size of the scene.
    pub scene: SceneReport,
    /// What is compared, at least one.
    pub configurations: Vec<ConfigurationInput>,
    /// Repeats, limit, threads, seed.
    pub settings: ConvergeSettings,
    /// How references are made.
    pub reference: ReferenceOptions,
    /// Whether the machine's noise is measured first.
    pub noise: bool,
    /// Where pictures go; the folder exists.
    pub folder: &'a Path,
}

/// Renders and scores everything, and writes the pictures; the results are not written.
///
/// # Errors
/// If a scene cannot be compiled, a reference cannot be made, or a picture not written.
pub fn converge(
    input: ConvergeInput<'_>,
    interrupted: &Interrupted<'_>,
    tell: &mut dyn FnMut(Event<'_>),
) -> Result<Results> {
    let machine = Machine::read();
    let mut phases = Phases::default();
    let settings = &input.settings;
    let mut runs = Vec::new();
    for configuration in input.configurations {
        phases.load += configuration.load;
        let run = Run::new(configuration, settings)?;
        phases.build += run.build;
        runs.push(run);
    }

    let watch = Stopwatch::start();
    let references = references(&mut runs, &input.reference, settings, interrupted, tell)?;
    phases.reference = watch.span();
    let (images, mut references): (Vec<ReferenceImage>, Vec<ReferenceReport>) =
        references.into_iter().unzip();

    let watch = Stopwatch::start();
    let noise = match input.noise && !interrupted() {
        true => Some(measure(
            &runs[0].scene,
            &runs[0].compiled,
            &runs[0].settings,
        )?),
        false => None,
    };
    phases.noise = watch.span();

    for repeat in 0..settings.repeats {
        if interrupted() || images.is_empty() {
            break;
        }
        let progress = Progress {
            repeat,
            repeats: settings.repeats,
        };
        render_repeat(
            &mut runs,
            &images,
            &progress,
            settings,
            &mut phases,
            interrupted,
            tell,
        )?;
    }

    let watch = Stopwatch::start();
    for (number, (image, report)) in images.iter().zip(&mut references).enumerate() {
        let exposure = runs[0].scene.film.exposure;
        report.image = Some(write_reference(input.folder, number, image, exposure)?);
    }
    let equal_time = equal_time(&runs);
    let totals: Vec<RenderStats> = runs.iter().map(Run::total).collect();
    let mut configurations = Vec::new();
    for (number, run) in runs.into_iter().enumerate() {
        let picture = run.picture(number, equal_time, input.folder)?;
        let floor = images.get(run.reference).map_or(0.0, ReferenceImage::floor);
        configurations.push(run.report(floor, picture));
    }
    let pairs = pairs(&configurations);
    relate_to_first(&mut configurations, &pairs);
    phases.write = watch.span();
    let mut results = Results {
        format: FORMAT,
        build: Build::current(),
        machine,
        load_average_after: Machine::read().load_average,
        noise,
        scene: input.scene,
        settings: input.settings,
        definitions: definitions(),
        references,
        configurations,
        pairs,
        phases,
        accounting: accounting(&totals, phases.render),
        warnings: Vec::new(),
        interrupted: interrupted(),
    };
    results.warnings = judge(&results, input.reference.error);
    for warning in &results.warnings {
        tell(Event::Warning(warning));
    }
    Ok(results)
}

/// Sets each configuration's efficiency relative to the first of the same picture.
fn relate_to_first(configurations: &mut [Configuration], pairs: &[Pair]) {
    for number in 0..configurations.len() {
        let reference = configurations[number].reference;
        let first = configurations
            .iter()
            .position(|other| other.reference == reference);
        let pair = pairs
            .iter()
            .find(|pair| Some(pair.a) == first && pair.b == number);
        configurations[number].efficiency = match pair {
            Some(pair) => pair.efficiency,
            // The first itself.
            None => configurations[number]
                .time_to_unit_variance
                .map(|_| Estimate {
                    value: 1.0,
                    low: None,
                    high: None,
                }),
        };
    }
}

/// CPU seconds that every configuration has an image of about.
fn equal_time(runs: &[Run]) -> f64 {
    runs.iter()
        .filter_map(|run| run.snapshots.last())
        .map(|snapshot| snapshot.cpu_seconds)
        .fold(f64::INFINITY, f64::min)
}

/// A configuration while it is rendered.
struct Run {
    name: String,
    overrides: Vec<String>,
    scene: Rc<SceneDescription>,
    camera: usize,
    /// With the seed of the current repeat.
    settings: RenderSettings,
    compiled: CompiledScene,
    plan: Plan,
    load: Span,
    build: Span,
    schedule: Schedule,
    /// Index of its reference.
    reference: usize,
    repeats: Vec<Repeat>,
    /// Counts and times of the repeats at their ends.
    totals: Vec<RenderStats>,
    ended: EndedBy,
    /// Signed errors over the repeats at their ends.
    signed: Option<SignedErrors>,
    /// Squared relative error per pixel, summed over the repeats at their ends.
    relative: Vec<f64>,
    /// Images of the first repeat.
    snapshots: Vec<Snapshot>,
}

impl Run {
    fn new(input: ConfigurationInput, settings: &ConvergeSettings) -> Result<Self> {
        let film = input.scene.film;
        let settings = RenderSettings {
            threads: settings.threads,
            ..input.settings
        };
        let watch = Stopwatch::start();
        let compiled = compile(
            &input.scene,
            input.camera,
            film.width,
            film.height,
            &settings,
        )?;
        Ok(Self {
            name: input.name,
            overrides: input.overrides,
            plan: Plan::new(&compiled, &settings),
            relative: vec![0.0; film.width as usize * film.height as usize],
            scene: input.scene,
            camera: input.camera,
            settings,
            compiled,
            load: input.load,
            build: watch.span(),
            schedule: input.schedule,
            reference: 0,
            repeats: Vec::new(),
            totals: Vec::new(),
            ended: EndedBy::Samples,
            signed: None,
            snapshots: Vec::new(),
        })
    }
}

/// The reference of each distinct picture; tells each configuration which is its. None if interrupted.
fn references(
    runs: &mut [Run],
    options: &ReferenceOptions,
    settings: &ConvergeSettings,
    interrupted: &Interrupted<'_>,
    tell: &mut dyn FnMut(Event<'_>),
) -> Result<Vec<(ReferenceImage, ReferenceReport)>> {
    let mut keys: Vec<String> = Vec::new();
    let mut references = Vec::new();
    for run in runs {
        let key = View::key_of(&run.scene, run.camera);
        run.reference = keys.iter().position(|k| *k == key).unwrap_or(keys.len());
        if run.reference < keys.len() {
            continue;
        }
        tell(Event::Progress("reference"));
        let view = View {
            scene: &run.scene,
            camera: run.camera,
            key: &key,
        };
        match obtain(view, options, settings.threads, interrupted, tell)? {
            Some(reference) => references.push(reference),
            None => return Ok(Vec::new()),
        }
        keys.push(key);
    }
    Ok(references)
}

/// Which repeat is being rendered.
struct Progress {
    repeat: u32,
    repeats: u32,
}

/// One repeat of a configuration while it is rendered.
struct Turn<'a> {
    session: Session<'a>,
    rows: Vec<Row>,
    snapshots: Vec<Snapshot>,
    ended: Option<EndedBy>,
}

/// Renders all configurations once, checkpoint by checkpoint in turn, and adds what came out. An
/// interrupted repeat is dropped, unless it is the first.
fn render_repeat(
    runs: &mut [Run],
    images: &[ReferenceImage],
    progress: &Progress,
    settings: &ConvergeSettings,
    phases: &mut Phases,
    interrupted: &Interrupted<'_>,
    tell: &mut dyn FnMut(Event<'_>),
) -> Result<()> {
    let seed = seed(settings.seed, progress.repeat.into());
    for run in &mut *runs {
        run.compiled.seed = seed;
        run.settings.seed = seed;
    }
    let mut turns = Vec::new();
    for run in &*runs {
        let block = run.settings.block;
        let session = |settings| Session::new(&run.scene, &run.compiled, settings, block);
        if progress.repeat == 0 {
            // Discarded: page faults, caches, clock rate.
            let _ = session(&run.settings)?.round(1, &|_| ControlFlow::Continue(()));
        }
        turns.push(Turn {
            session: session(&run.settings)?,
            rows: Vec::new(),
            snapshots: Vec::new(),
            ended: None,
        });
    }
    for turn in 0.. {
        if turns.iter().all(|turn| turn.ended.is_some()) {
            break;
        }
        let mut order: Vec<usize> = (0..turns.len()).collect();
        if turn % 2 == 1 {
            order.reverse();
        }
        for number in order {
            let (run, turn) = (&runs[number], &mut turns[number]);
            if turn.ended.is_some() {
                continue;
            }
            tell(Event::Progress(&format!(
                "repeat {} of {}, {}: from {} samples per pixel",
                progress.repeat + 1,
                progress.repeats,
                run.name,
                turn.session.samples()
            )));
            let watch = Stopwatch::start();
            turn.advance(&run.schedule, run.settings.block, interrupted);
            phases.render += watch.span();
            if turn.ended == Some(EndedBy::Interrupted) {
                break;
            }
            let watch = Stopwatch::start();
            turn.score(&images[run.reference], progress.repeat == 0, &run.scene);
            phases.score += watch.span();
        }
        if interrupted() {
            break;
        }
    }
    let complete = turns
        .iter()
        .all(|turn| matches!(turn.ended, Some(EndedBy::Samples | EndedBy::Seconds)));
    if !complete && progress.repeat > 0 {
        return Ok(());
    }
    let ends: Vec<Ended> = turns
        .into_iter()
        .zip(&*runs)
        .map(|(turn, run)| turn.end(&images[run.reference]))
        .collect();
    for (run, end) in runs.iter_mut().zip(ends) {
        run.take(end, seed);
    }
    Ok(())
}

impl Turn<'_> {
    /// Renders to the next checkpoint, or to the end of the time. Sets why it ended if it did.
    fn advance(&mut self, schedule: &Schedule, block: u32, interrupted: &Interrupted<'_>) {
        let session = &mut self.session;
        let Some(target) = schedule.next(session.samples()) else {
            self.ended = Some(EndedBy::Samples);
            return;
        };
        let mut spent = session.cpu_seconds();
        let mut per_sample = match session.samples() {
            0 => 0.0,
            samples => spent / samples as f64,
        };
        while session.samples() < target {
            let samples = block.min(u32::try_from(target - session.samples()).unwrap_or(block));
            if let Schedule::Seconds(limit) = *schedule
                && session.samples() > 0
                && spent + per_sample * f64::from(samples) > limit
            {
                self.ended = Some(EndedBy::Seconds);
                return;
            }
            let observer = |_: &_| match interrupted() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            };
            if session.round(samples, &observer).is_break() {
                self.ended = Some(EndedBy::Interrupted);
                return;
            }
            let now = session.cpu_seconds();
            per_sample = (now - spent) / f64::from(samples);
            spent = now;
        }
        if schedule.next(session.samples()).is_none() {
            self.ended = Some(EndedBy::Samples);
        }
    }

    /// Holds the image against the reference, unless nothing was added since the last time.
    fn score(&mut self, reference: &ReferenceImage, keeps_images: bool, scene: &SceneDescription) {
        let samples = self.session.samples();
        if self.rows.last().is_some_and(|row| row.samples == samples) {
            return;
        }
        let stats = self.session.stats();
        let film = self.session.film();
        let row = Row {
            samples,
            paths: stats.paths,
            camera_rays: stats.camera_rays,
            bounce_rays: stats.bounce_rays,
            shadow_rays: stats.shadow_rays,
            cpu_seconds: stats.cpu_seconds,
            wall_seconds: stats.wall_seconds,
            errors: errors(film, reference),
            rejected: stats.rejected,
        };
        self.rows.push(row);
        if keeps_images {
            let snapshot = Snapshot::of(film, reference, scene.film.exposure, &row);
            self.snapshots.push(snapshot);
        }
    }

    /// What is left of it.
    fn end(mut self, reference: &ReferenceImage) -> Ended {
        let stats = self.session.stats();
        let film = self.session.film();
        Ended {
            rows: self.rows,
            snapshots: self.snapshots,
            ended: self.ended.unwrap_or(EndedBy::Interrupted),
            signed: SignedErrors::of(film, reference),
            relative: (0..film.len())
                .map(|pixel| reference.relative_square(pixel, film.mean(pixel)))
                .collect(),
            stats,
        }
    }
}

/// A repeat of a configuration that has ended.
struct Ended {
    rows: Vec<Row>,
    snapshots: Vec<Snapshot>,
    ended: EndedBy,
    signed: Option<SignedErrors>,
    relative: Vec<f64>,
    stats: RenderStats,
}

impl Run {
    /// Adds a repeat.
    fn take(&mut self, end: Ended, seed: u64) {
        self.repeats.push(Repeat {
            seed,
            rows: end.rows,
        });
        self.totals.push(end.stats);
        self.ended = end.ended;
        match (&mut self.signed, end.signed) {
            (Some(sum), Some(more)) => sum.add(&more),
            (sum, more) => *sum = more,
        }
        for (sum, more) in self.relative.iter_mut().zip(end.relative) {
            *sum += more;
        }
        self.snapshots.extend(end.snapshots);
    }

    /// Counts and times over all repeats.
    fn total(&self) -> RenderStats {
        let mut total = RenderStats::default();
        for stats in &self.totals {
            total.cpu_seconds += stats.cpu_seconds;
            total.rounds += stats.rounds;
            total.rejected += stats.rejected;
            total.truncated += stats.truncated;
            total.stages.resize_with(stats.stages.len(), || StageStats {
                name: "",
                cpu_seconds: 0.0,
                items: 0,
            });
            for (sum, stage) in total.stages.iter_mut().zip(&stats.stages) {
                sum.name = stage.name;
                sum.cpu_seconds += stage.cpu_seconds;
                sum.items += stage.items;
            }
        }
        total
    }

    /// Writes the pictures of the checkpoint nearest to this CPU time.
    fn picture(&self, number: usize, seconds: f64, folder: &Path) -> Result<Option<Picture>> {
        let distance = |snapshot: &&Snapshot| (snapshot.cpu_seconds / seconds).ln().abs();
        let nearest = self
            .snapshots
            .iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)));
        nearest
            .map(|snapshot| {
                let width = self.scene.film.width;
                write_picture(folder, number, snapshot, width, &self.mean_relative())
            })
            .transpose()
    }

    /// Mean squared relative error per pixel at the ends of the repeats.
    fn mean_relative(&self) -> Vec<f64> {
        let repeats = self.repeats.len().max(1) as f64;
        self.relative.iter().map(|sum| sum / repeats).collect()
    }

    /// Its figures; an MSE below `floor` is not fitted.
    fn report(self, floor: f64, picture: Option<Picture>) -> Configuration {
        let total = self.total();
        let curves = Curves::new(&self.repeats, floor);
        let [slope_by_samples, slope_by_time] = curves.slopes();
        let rays: u64 = self
            .repeats
            .iter()
            .filter_map(|repeat| repeat.rows.last())
            .map(rays)
            .sum();
        Configuration {
            features: self
                .plan
                .needed
                .iter()
                .map(|&name| name.to_owned())
                .collect(),
            accel: self.plan.accel.clone(),
            reference: self.reference,
            load: self.load,
            build: self.build,
            ended: self.ended,
            checkpoints: curves.checkpoints(),
            slope_by_samples,
            slope_by_time,
            time_to_unit_variance: curves.time_to_unit_variance(),
            efficiency: None,
            times_to_error: curves.times_to_error(),
            rays_per_second: match total.cpu_seconds {
                0.0 => 0.0,
                seconds => rays as f64 / seconds,
            },
            stages: match total.stages.is_empty() {
                true => Vec::new(),
                false => stages(&total),
            },
            bias: verdict(self.signed.as_ref(), bias(&self.settings, &total)),
            picture,
            slowest: slowest(self.scene.film.width, &self.mean_relative()),
            name: self.name,
            overrides: self.overrides,
            settings: self.settings,
            repeats: self.repeats,
        }
    }
}

/// What the curves say of the rendering time, and what the process says of the same passes.
fn accounting(totals: &[RenderStats], render: Span) -> Accounting {
    let curves: f64 = totals.iter().map(|stats| stats.cpu_seconds).sum();
    let rounds: f64 = totals.iter().map(|stats| stats.rounds.cpu_seconds).sum();
    let process = render.cpu_seconds;
    Accounting {
        curves_cpu_seconds: curves,
        waking_cpu_seconds: rounds - curves,
        process_cpu_seconds: process,
        ratio: (process > 0.0).then(|| rounds / process),
    }
}
