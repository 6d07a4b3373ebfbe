//! Compares acceleration structures on ray sets that a scene itself gives.

mod contestants;
mod differences;
mod memory;
mod rays;
mod rounds;
mod scan;
mod table;

pub use contestants::{BuildFigures, Builder, Built, Contestant};
pub use differences::{Differences, rounding};
pub use rays::{RayKind, RaySet, ray_sets};
pub use rounds::{Answers, Round, answers, run};

use rayon::ThreadPool;
use serde::{Deserialize, Serialize};

use self::differences::Reference;
use self::scan::Scan;
use super::{Build, Machine, SceneReport, median};
use crate::accel::AccelCounters;
use crate::compile::{CompiledScene, build_quality};
use crate::error::{Error, Result};
use crate::integrator::thread_pool;
use crate::scene::{AccelQuality, SceneDescription};

/// Version of the JSON format; it changes when a field changes its meaning or disappears.
pub const FORMAT: u32 = 1;

/// Ray–primitive tests of the scan that answers are held against: about two CPU seconds at 1 ns each.
/// Where a set has more rays than that allows, a sample of it is compared.
pub const SCAN_TESTS: usize = 2_000_000_000;

/// Ray–primitive tests in a round and in the comparison of [`crate::accel::Structure::Linear`], at up to
/// 10 ns each; as above.
pub const LINEAR_TESTS: usize = 200_000_000;

/// What is compared, and how.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AccelsSettings {
    /// Kinds of rays.
    pub kinds: Vec<RayKind>,
    /// Rays per set, ≥ 1.
    pub count: usize,
    /// Rays per call, ≥ 1.
    pub batch: usize,
    /// Timed runs per structure and kind of ray, ≥ 1.
    pub rounds: usize,
    /// Threads, ≥ 1.
    pub threads: usize,
    /// Quality of the builds of this program's structures.
    pub quality: AccelQuality,
    /// Seed of the rays.
    pub seed: u64,
}

/// The comparison; its serialised form is the format of `--json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AccelsReport {
    /// [`FORMAT`] of the program that wrote it.
    pub format: u32,
    /// The program.
    pub build: Build,
    /// The machine, its load as it was before the comparison.
    pub machine: Machine,
    /// Where the rays are.
    pub scene: SceneReport,
    /// Triangles in the scene.
    pub triangles: usize,
    /// Spheres in the scene.
    pub spheres: usize,
    /// What was compared, and how.
    pub settings: AccelsSettings,
    /// The structures, in the order in which they ran.
    pub structures: Vec<StructureReport>,
    /// Who or what was left out, and why; sets that came out smaller than was asked for.
    pub notes: Vec<String>,
}

/// One structure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StructureReport {
    /// Name as on the command line.
    pub name: String,
    /// Whether it is one of this program's.
    pub own: bool,
    /// What its build took.
    pub build: BuildFigures,
    /// Its figures for each kind of rays.
    pub kinds: Vec<KindFigures>,
}

/// One structure on one kind of rays.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KindFigures {
    /// Kind of the rays.
    pub kind: RayKind,
    /// Rays per round.
    pub rays: u64,
    /// The timed rounds, in order.
    pub rounds: Vec<Round>,
    /// Million rays per CPU second over the rounds.
    pub mrays_per_cpu_second: Spread,
    /// Median rate over the best median rate on these rays, in (0, 1].
    pub ratio_to_best: f64,
    /// Nodes visited per ray; `None` if it does not count.
    pub nodes_per_ray: Option<f64>,
    /// Primitives tested per ray; `None` if it does not count.
    pub tests_per_ray: Option<f64>,
    /// Rays after which build and queries took less CPU time than those of the structure that was
    /// built fastest; `None` if that never comes, and for that structure itself.
    pub pays_after: Option<f64>,
    /// Differences from a scan over all primitives.
    pub differences: Differences,
}

/// Median and extremes of a figure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spread {
    /// Smallest value.
    pub least: f64,
    /// Median; the mean of the middle two of an even number.
    pub median: f64,
    /// Largest value.
    pub most: f64,
}

impl Spread {
    /// Of the values, of which there is at least one.
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.collect();
        let median = median(&mut values);
        Self {
            least: values[0],
            median,
            most: values[values.len() - 1],
        }
    }
}

impl AccelsReport {
    /// The report as indented JSON.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("plain data with string keys always serialises")
    }

    /// This program's structures that differ from the scan by more than ties, in words.
    pub fn faults(&self) -> Vec<String> {
        let own = self.structures.iter().filter(|structure| structure.own);
        own.flat_map(|structure| {
            structure.kinds.iter().filter_map(|figures| {
                let Differences {
                    rays, differing, ..
                } = figures.differences;
                (differing > 0).then(|| {
                    format!(
                        "{} differs from the scan on {differing} of {rays} {} rays",
                        structure.name,
                        figures.kind.name()
                    )
                })
            })
        })
        .collect()
    }
}

/// What a comparison starts from.
#[derive(Debug)]
pub struct AccelsInput<'a> {
    /// The scene.
    pub scene: &'a SceneDescription,
    /// Its compiled form, which is needed for the rays alone and dropped after that.
    pub compiled: CompiledScene,
    /// Its name, camera and size.
    pub report: SceneReport,
    /// Who takes part.
    pub contestants: &'a [Contestant],
    /// What is compared, and how.
    pub settings: &'a AccelsSettings,
}

/// What a comparison tells while it runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event<'a> {
    /// What begins now.
    Progress(&'a str),
    /// One of [`AccelsReport::notes`].
    Note(&'a str),
}

/// Builds and runs every contestant, and tells what it does.
///
/// # Errors
/// If threads cannot be started, or none of the contestants can take part. One that cannot is left out.
pub fn compare(input: AccelsInput<'_>, tell: &mut dyn FnMut(Event<'_>)) -> Result<AccelsReport> {
    let AccelsInput {
        scene,
        compiled,
        report,
        contestants,
        settings,
    } = input;
    let machine = Machine::read();
    let pool = thread_pool(settings.threads)?;
    let mut notes = Vec::new();

    tell(Event::Progress("making rays"));
    let sets = ray_sets(&compiled, &settings.kinds, settings.count, settings.seed);
    let mut geometry = compiled.geometry(scene);
    if compiled.lights.kinds() == 0 {
        // Then shadow rays do not end on a light.
        geometry.segment_ends = None;
    }
    drop(compiled);
    for set in sets.iter().filter(|set| set.len() < settings.count) {
        notes.push(format!(
            "{}: only {} rays, since too many leave the scene",
            set.kind().name(),
            set.len()
        ));
        tell(Event::Note(&notes[notes.len() - 1]));
    }

    memory::keep_no_freed_memory();
    let built = build_all(
        contestants,
        &mut Builder::new(&geometry, &pool, build_quality(settings.quality)),
        &mut notes,
        tell,
    )?;

    let mut structures: Vec<StructureReport> = built
        .iter()
        .map(|built| StructureReport {
            name: built.contestant.name().to_owned(),
            own: built.contestant.is_own(),
            build: built.figures,
            kinds: Vec::new(),
        })
        .collect();
    let scan = Scan::new(&geometry);
    for set in sets.iter().filter(|set| !set.is_empty()) {
        tell(Event::Progress(&format!(
            "{}: comparing answers",
            set.kind().name()
        )));
        let reference = |tests: usize| {
            let rays = set.sample((tests / geometry.len().max(1)).max(1));
            Reference {
                hits: pool.install(|| scan.nearest(&rays)),
                rays,
            }
        };
        let (many, few) = (reference(SCAN_TESTS), reference(LINEAR_TESTS));
        let differences: Vec<Differences> = built
            .iter()
            .map(|built| {
                let reference = if built.contestant.is_scan() {
                    &few
                } else {
                    &many
                };
                let answers = answers(&pool, &*built.accel, &reference.rays, settings.batch);
                reference.compare(&geometry, &answers)
            })
            .collect();
        let timings = time(&pool, &built, set, &few.rays, settings, tell);
        let figures = figures(set.kind(), &built, timings, &differences);
        for (structure, figures) in structures.iter_mut().zip(figures) {
            structure.kinds.push(figures);
        }
    }
    Ok(AccelsReport {
        format: FORMAT,
        build: Build::current(),
        machine,
        scene: report,
        triangles: geometry.triangles.len(),
        spheres: geometry.spheres.len(),
        settings: settings.clone(),
        structures,
        notes,
    })
}

/// Builds who can take part, and notes who cannot.
fn build_all(
    contestants: &[Contestant],
    builder: &mut Builder<'_>,
    notes: &mut Vec<String>,
    tell: &mut dyn FnMut(Event<'_>),
) -> Result<Vec<Built>> {
    memory::keep_no_freed_memory();
    let mut built = Vec::new();
    for &contestant in contestants {
        tell(Event::Progress(&format!("building {}", contestant.name())));
        match builder.build(contestant) {
            Ok(contestant) => built.push(contestant),
            Err(error) => {
                let note = format!("{} is left out: {error}", contestant.name());
                tell(Event::Note(&note));
                notes.push(note);
            }
        }
    }
    if built.is_empty() {
        return Err(Error::usage("none of the structures can take part"));
    }
    Ok(built)
}

/// Rounds of a structure, its work, and how many rays a round has.
struct Timing {
    rounds: Vec<Round>,
    counters: AccelCounters,
    rays: usize,
}

/// Runs all structures once, then in rounds, one after the other in each. A scan over all primitives
/// answers only the `few` rays that it has time for.
fn time(
    pool: &ThreadPool,
    built: &[Built],
    set: &RaySet,
    few: &RaySet,
    settings: &AccelsSettings,
    tell: &mut dyn FnMut(Event<'_>),
) -> Vec<Timing> {
    let rays = |built: &Built| if built.contestant.is_scan() { few } else { set };
    let run_one = |built: &Built| run(pool, &*built.accel, rays(built), settings.batch);
    let mut timings: Vec<Timing> = built
        .iter()
        .map(|built| Timing {
            rounds: Vec::new(),
            counters: run_one(built).1,
            rays: rays(built).len(),
        })
        .collect();
    for round in 1..=settings.rounds {
        tell(Event::Progress(&format!(
            "{}: round {round} of {}",
            set.kind().name(),
            settings.rounds
        )));
        for (built, timing) in built.iter().zip(&mut timings) {
            timing.rounds.push(run_one(built).0);
        }
    }
    timings
}

/// Rates and ratios of all structures on one kind of rays.
fn figures(
    kind: RayKind,
    built: &[Built],
    timings: Vec<Timing>,
    differences: &[Differences],
) -> Vec<KindFigures> {
    let rates: Vec<Spread> = timings
        .iter()
        .map(|timing| {
            let rays = timing.rays as f64;
            // A clock that did not move would make the rate infinite, which JSON does not have.
            let seconds = timing
                .rounds
                .iter()
                .map(|round| round.cpu_seconds.max(1e-9));
            Spread::of(seconds.map(|seconds| 1e-6 * rays / seconds))
        })
        .collect();
    let best = rates.iter().map(|rate| rate.median).fold(0.0, f64::max);
    let build = |i: usize| built[i].figures.time.cpu_seconds;
    let fastest = (0..built.len())
        .min_by(|&a, &b| build(a).total_cmp(&build(b)))
        .expect("somebody takes part");
    let costs = |i: usize| (build(i), 1e-6 / rates[i].median);
    timings
        .into_iter()
        .enumerate()
        .map(|(i, timing)| {
            let counts = timing.counters != AccelCounters::default();
            let per_ray = |count: u64| counts.then(|| count as f64 / timing.rays as f64);
            KindFigures {
                kind,
                rays: timing.rays as u64,
                rounds: timing.rounds,
                mrays_per_cpu_second: rates[i],
                ratio_to_best: rates[i].median / best,
                nodes_per_ray: per_ray(timing.counters.nodes),
                tests_per_ray: per_ray(timing.counters.tests),
                pays_after: pays_after(costs(fastest), costs(i)),
                differences: differences[i],
            }
        })
        .collect()
}

/// Rays after which the second of two structures, each with seconds of its build and seconds per ray,
/// has taken less time than the first.
fn pays_after(first: (f64, f64), second: (f64, f64)) -> Option<f64> {
    let (build, per_ray) = (second.0 - first.0, first.1 - second.1);
    (build > 0.0 && per_ray > 0.0).then(|| build / per_ray)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_is_of_the_sorted_values() {
        let of = |values: &[f64]| Spread::of(values.iter().copied());
        let spread = |least, median, most| Spread {
            least,
            median,
            most,
        };
        assert_eq!(of(&[3.0]), spread(3.0, 3.0, 3.0));
        assert_eq!(of(&[3.0, 1.0, 2.0]), spread(1.0, 2.0, 3.0));
        assert_eq!(of(&[4.0, 1.0, 3.0, 2.0]), spread(1.0, 2.5, 4.0));
    }

    #[test]
    fn a_slower_build_pays_when_its_rays_have_won_the_time_back() {
        // One second more, and a hundredth of a second less per ray.
        assert_eq!(pays_after((1.0, 0.02), (2.0, 0.01)), Some(100.0));
        assert_eq!(pays_after((1.0, 0.01), (2.0, 0.02)), None);
        assert_eq!(pays_after((1.0, 0.02), (1.0, 0.02)), None);
    }
}
