//! Numerical stability: a catalogue of stiff and extreme cases, each held against something known.
//!
//! A case belongs to a row of the catalogue and makes findings: what is extreme about it as a number, what
//! it is held against, what was measured, and what is tolerated. Where acceleration structures matter it
//! runs on each of them. `wavepath stability` prints the findings as a table; the tests run the same
//! cases with fewer samples.
//!
//! The program is compiled for one lane width. Its lane kernels are held against f64 and against the scalar
//! renderer [`reference`](mod@crate::reference) in the same program; a second build without AVX runs the
//! same table for the other width: `profiling/stability.sh` does both.

mod agreement;
mod camera;
pub mod closed_meshes;
mod containment;
mod degenerate;
mod dielectric;
mod film;
mod furnaces;
mod light_choice;
mod lights;
mod materials;
mod needles;
pub mod oracles;
mod queues;
mod rays;
pub mod renders;
mod roulette;
mod sampler;
mod scales;
pub mod scenes;
mod self_intersection;
mod spheres;
mod table;
#[cfg(test)]
mod tests;
mod trial;
mod watertight;

use serde::{Deserialize, Serialize};

use super::{Build, Machine, Span, Stopwatch};
use crate::accel::Structure;
use crate::error::{Error, Result};
use crate::integrator::thread_pool;

use trial::Trial;

/// Version of the JSON format; it changes when a field changes its meaning or disappears.
pub const FORMAT: u32 = 1;

/// How many samples cases take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Effort {
    /// So few that all cases are part of the tests.
    Test,
    /// About a minute of CPU time altogether.
    Quick,
    /// For a release.
    Full,
}

/// What is run, and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StabilitySettings {
    /// Names of the cases; empty for all.
    pub cases: Vec<String>,
    /// Names of the acceleration structures; empty for all.
    pub structures: Vec<String>,
    /// How many samples.
    pub effort: Effort,
    /// Rays per closed mesh and structure in the cases of vertices and edges and of closed rooms, instead of those by
    /// effort.
    pub leak_rays: Option<u64>,
    /// Worker threads, ≥ 1. Does not change any finding.
    pub threads: usize,
}

impl Default for StabilitySettings {
    fn default() -> Self {
        Self {
            cases: Vec::new(),
            structures: Vec::new(),
            effort: Effort::Quick,
            leak_rays: None,
            threads: std::thread::available_parallelism().map_or(1, usize::from),
        }
    }
}

/// One structure's part of a finding.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StructureFigure {
    /// Name of the structure.
    pub structure: String,
    /// What was measured.
    pub measured: f64,
}

/// What a measured number is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Unit {
    /// Wrong answers.
    Count,
    /// Wrong answers over all answers.
    Share,
    /// |measured − expected| over the expected value.
    Relative,
    /// |measured − expected|.
    Absolute,
    /// |measured − expected| in standard errors.
    StandardErrors,
    /// Time over the time of the ordinary case.
    TimeRatio,
}

/// One row of the table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Finding {
    /// Name of the case.
    pub case: String,
    /// Its row in the catalogue.
    pub row: u8,
    /// What is extreme about it.
    pub extreme: String,
    /// What it is held against.
    pub oracle: String,
    /// The deviation; of several structures the largest. What is not a number counts as [`f64::MAX`].
    pub measured: f64,
    /// The largest deviation that passes.
    pub tolerance: f64,
    /// What the two are.
    pub unit: Unit,
    /// Rays, samples, pixels or other trials behind it.
    pub samples: u64,
    /// Whether the deviation is tolerated.
    pub passed: bool,
    /// The structures it was measured on, if structures matter.
    pub structures: Vec<StructureFigure>,
    /// CPU time of the process.
    pub cpu_seconds: f64,
}

/// All findings of a run; its serialised form is the format of `--json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StabilityReport {
    /// [`FORMAT`] of the program that wrote it.
    pub format: u32,
    /// The program.
    pub build: Build,
    /// The machine, its load as it was before the run.
    pub machine: Machine,
    /// What was run.
    pub settings: StabilitySettings,
    /// The rows, in the order of the catalogue.
    pub findings: Vec<Finding>,
    /// Time of the run.
    pub time: Span,
}

impl StabilityReport {
    /// The report as indented JSON.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("plain data with string keys always serialises")
    }

    /// Findings that are not tolerated.
    pub fn failures(&self) -> impl Iterator<Item = &Finding> {
        self.findings.iter().filter(|finding| !finding.passed)
    }
}

/// A case of the catalogue.
#[derive(Debug, Clone, Copy)]
pub struct Case {
    /// Its row in the catalogue.
    pub row: u8,
    /// Name as on the command line.
    pub name: &'static str,
    /// What it shows, in a few words.
    pub about: &'static str,
    run: fn(&mut Trial<'_>) -> Result<()>,
}

/// Shorthand for the list below.
const fn case(
    row: u8,
    name: &'static str,
    about: &'static str,
    run: fn(&mut Trial<'_>) -> Result<()>,
) -> Case {
    Case {
        row,
        name,
        about,
        run,
    }
}

/// Every case, by its row in the catalogue. Rows 15 and 20 are part of 14 and 19. Row 54, renders that are stopped
/// and merged, is left to tests of the program; rows 52 and 53 are about photon maps and radiosity, which there are none of.
pub const CASES: [Case; 61] = [
    case(
        1,
        "vertices",
        "rays from inside closed meshes, aimed at vertices and edges",
        watertight::vertices,
    ),
    case(
        2,
        "axes",
        "rays along axes, in planes of boxes, with zeros and denormals",
        watertight::axes,
    ),
    case(
        3,
        "closed-room",
        "bounces in closed rooms of any size",
        self_intersection::closed_room,
    ),
    case(
        4,
        "self-hits",
        "rays that leave a triangle",
        self_intersection::self_hits,
    ),
    case(
        5,
        "convex-neighbours",
        "rays that leave a convex mesh along its faces",
        self_intersection::convex_neighbours,
    ),
    case(
        6,
        "tiny-spheres",
        "sphere lights of any size and the same power",
        lights::tiny_spheres,
    ),
    case(
        7,
        "tiny-flat-lights",
        "small flat lights of huge radiance, near and far",
        lights::tiny_flat_lights,
    ),
    case(
        8,
        "touching-light",
        "a light that touches a surface: 1/d² has no bound",
        lights::touching_light,
    ),
    case(
        9,
        "mis-weights",
        "weights of densities of any magnitude",
        lights::mis_weights,
    ),
    case(
        10,
        "furnace",
        "closed glowing rooms of any albedo and depth",
        furnaces::exact,
    ),
    case(
        10,
        "lit-furnace",
        "the same where lights are sampled",
        furnaces::lit,
    ),
    case(
        11,
        "scaled-furnace",
        "the same of any size and at any place",
        furnaces::scaled,
    ),
    case(
        11,
        "same-picture",
        "a scene of everything of any size and at any place",
        scales::same_picture,
    ),
    case(
        12,
        "film-sums",
        "sums of very many samples",
        film::film_sums,
    ),
    case(
        13,
        "invalid-rays",
        "rays that are not finite",
        containment::invalid_rays,
    ),
    case(
        14,
        "sampling",
        "samples of materials against densities, weights and albedos",
        materials::sampling,
    ),
    case(
        16,
        "long-paths",
        "paths of thousands of reflections",
        furnaces::long_paths,
    ),
    case(
        16,
        "perfect-mirrors",
        "a closed hall of perfect mirrors",
        roulette::perfect_mirrors,
    ),
    case(
        17,
        "roulette",
        "roulette from the first hit",
        roulette::unbiased,
    ),
    case(
        18,
        "light-ends",
        "shadow rays that end on lights in walls, meshes and at floors",
        lights::light_ends,
    ),
    case(
        19,
        "far-spheres",
        "spheres many radii away",
        spheres::far_spheres,
    ),
    case(
        21,
        "leaving-spheres",
        "rays that leave their own sphere",
        spheres::leaving_spheres,
    ),
    case(
        22,
        "ground-sphere",
        "planets underfoot, pellets far away",
        spheres::ground_sphere,
    ),
    case(23, "needles", "slivers at grazing angles", needles::needles),
    case(
        24,
        "needle-fan",
        "thousands of needles at one vertex",
        watertight::needle_fan,
    ),
    case(
        25,
        "broken-faces",
        "OBJ files with faces that cannot be traced",
        degenerate::broken_faces,
    ),
    case(
        25,
        "garbage",
        "random triangles of all magnitudes",
        degenerate::garbage,
    ),
    case(
        26,
        "duplicates",
        "thousands of triangles at one place",
        degenerate::duplicates,
    ),
    case(
        27,
        "depths",
        "sizes that make trees deep",
        degenerate::depths,
    ),
    case(
        28,
        "same-hits",
        "structures and qualities of builds against one another",
        agreement::same_hits,
    ),
    case(
        28,
        "same-bits",
        "pictures by any number of threads",
        agreement::same_bits,
    ),
    case(
        28,
        "reference",
        "lane kernels against the scalar renderer in f64",
        agreement::reference,
    ),
    case(
        29,
        "total-reflection",
        "glass at grazing and critical angles",
        dielectric::total_reflection,
    ),
    case(
        30,
        "equal-indices",
        "glass in glass of almost the same index",
        dielectric::equal_indices,
    ),
    case(
        31,
        "glass-sphere",
        "a lossless ball in uniform light, of any size",
        dielectric::glass_sphere,
    ),
    case(
        32,
        "smallest-gap",
        "a plate just over a floor",
        self_intersection::smallest_gap,
    ),
    case(
        32,
        "thin-plates",
        "plates of glass as thin as rounding allows",
        dielectric::thin_plates,
    ),
    case(
        33,
        "nested-glass",
        "glass in glass, and glass on a wall",
        dielectric::nested,
    ),
    case(34, "frames", "frames about every normal", materials::frames),
    case(
        35,
        "oren-nayar",
        "roughness from 0 to infinity, grazing in and out",
        materials::oren_nayar_extremes,
    ),
    case(
        36,
        "phong",
        "exponents from 0 to 10⁶",
        materials::phong_extremes,
    ),
    case(
        37,
        "schlick",
        "the approximation against the exact formula",
        dielectric::schlick,
    ),
    case(
        38,
        "reciprocity",
        "light there and back",
        materials::reciprocity,
    ),
    case(
        38,
        "energy",
        "albedos by quadrature of the lane code",
        materials::energy,
    ),
    case(
        39,
        "behind-glass",
        "a light seen only through glass",
        lights::behind_glass,
    ),
    case(
        40,
        "random-numbers",
        "dimensions, pixels, samples and seeds without correlation",
        sampler::random_numbers,
    ),
    case(
        41,
        "unit-ends",
        "random numbers at the ends of the unit interval",
        sampler::unit_ends,
    ),
    case(
        42,
        "light-choice",
        "up to 10⁶ lights of any power",
        light_choice::light_choice,
    ),
    case(
        42,
        "many-lights",
        "a floor under 10⁴ lights",
        lights::many_lights,
    ),
    case(
        43,
        "small-scenes",
        "nothing, a sky, one primitive",
        camera::small_scenes,
    ),
    case(
        43,
        "eyes",
        "eyes on surfaces, within glass, before nothing",
        camera::eyes,
    ),
    case(
        44,
        "limits",
        "more primitives than memory holds, or indices count",
        degenerate::limits,
    ),
    case(
        45,
        "counters",
        "sample and pixel numbers at the ends of their range",
        sampler::counters,
    ),
    case(
        46,
        "coverage",
        "views of 10⁻⁵ to 179 degrees",
        camera::coverage,
    ),
    case(
        46,
        "picture-sizes",
        "pictures of one pixel, one row, and too many",
        camera::picture_sizes,
    ),
    case(
        47,
        "normals",
        "vertex normals that contradict the faces",
        degenerate::normals,
    ),
    case(
        48,
        "bad-reflectances",
        "reflectances outside of [0, 1]",
        degenerate::bad_reflectances,
    ),
    case(
        49,
        "queue-sizes",
        "any number of paths in flight",
        queues::queue_sizes,
    ),
    case(
        49,
        "all-or-none",
        "all paths end at once, or none does",
        queues::all_or_none,
    ),
    case(
        50,
        "denormals",
        "throughput below the smallest normal number",
        roulette::denormals,
    ),
    case(
        51,
        "whitted",
        "Whitted's method against path tracing",
        agreement::whitted_and_path,
    ),
];

/// The structures of these names, each once; all if there are no names.
///
/// # Errors
/// If a name is unknown.
pub fn structures(names: &[String]) -> Result<Vec<Structure>> {
    let unknown = names
        .iter()
        .find(|name| Structure::ALL.iter().all(|s| s.name() != name.as_str()));
    if let Some(name) = unknown {
        return Err(Error::usage(format!(
            "there is no structure \"{name}\"; there are {}",
            Structure::ALL.map(Structure::name).join(", ")
        )));
    }
    let wanted =
        |structure: &Structure| names.is_empty() || names.iter().any(|n| n == structure.name());
    Ok(Structure::ALL.into_iter().filter(wanted).collect())
}

/// The cases of these names, in the order of the catalogue; all if there are no names.
///
/// # Errors
/// If a name is unknown.
pub fn cases(names: &[String]) -> Result<Vec<&'static Case>> {
    let unknown = names
        .iter()
        .find(|name| CASES.iter().all(|case| case.name != name.as_str()));
    if let Some(name) = unknown {
        return Err(Error::usage(format!(
            "there is no case \"{name}\"; there are {}",
            CASES.map(|case| case.name).join(", ")
        )));
    }
    let wanted = |case: &&Case| names.is_empty() || names.iter().any(|name| name == case.name);
    Ok(CASES.iter().filter(wanted).collect())
}

/// Runs the cases and tells of each finding as it is made.
///
/// # Errors
/// If a case or a structure is unknown, threads cannot be started, or a case's scene is refused.
pub fn run(
    settings: &StabilitySettings,
    tell: &mut dyn FnMut(&Finding),
) -> Result<StabilityReport> {
    let machine = Machine::read();
    let watch = Stopwatch::start();
    let cases = cases(&settings.cases)?;
    let structures = structures(&settings.structures)?;
    let pool = thread_pool(settings.threads)?;
    let mut findings = Vec::new();
    for case in cases {
        let mut trial = Trial::new(case, settings, &structures, &pool, tell);
        (case.run)(&mut trial)?;
        findings.extend(trial.finish());
    }
    Ok(StabilityReport {
        format: FORMAT,
        build: Build::current(),
        machine,
        settings: settings.clone(),
        findings,
        time: watch.span(),
    })
}
