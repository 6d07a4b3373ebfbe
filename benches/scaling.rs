//! How the cost of a ray grows with the number of triangles, for incoherent rays over meshes from 10³
//! triangles on, up to `SCALING_TRIANGLES` (10⁷ unless it is set, 3·10⁷ at most).
//!
//! All structures over all sizes of a mesh are built first. Then they are run in rounds, `SCALING_ROUNDS` (7) of
//! them, one after the other in each round, so that what else the machine does meets all of them alike. Costs are CPU
//! nanoseconds per ray on one thread: the median over the rounds, with the quartiles.
//!
//! Last it prints what fits the medians: the exponent k of cost ∝ nᵏ, and for trees the line
//! cost = a + b·log₂ n, with r², both from 10⁴ triangles on. The same for visits, that is, nodes visited and primitives
//! tested per ray, which neither caches nor neighbours change.
#![allow(clippy::print_stdout, reason = "prints the measurements")]

#[path = "support/mesh_scenes.rs"]
mod mesh_scenes;

use rayon::ThreadPool;
use wavepath::accel::{Accel, Structure, build};
use wavepath::report::accels::{RayKind, RaySet, run};

use mesh_scenes::{MeshScene, is_test, made};

/// Rays per call.
const BATCH: usize = 4_096;

/// Most triangles over which the scan is run.
const MOST_SCANNED: usize = 100_000;

/// Ray–triangle tests in a round of the scan: it gets fewer rays of larger meshes.
const SCAN_TESTS: usize = 100_000_000;

/// Smallest mesh that counts in a fit of trees: smaller ones are in the first-level cache.
const LEAST_FITTED: f64 = 1e4;

const MESHES: [&str; 2] = ["terrain", "hairball"];
const STRUCTURES: [Structure; 3] = [Structure::Linear, Structure::Octree, Structure::Bvh8];

/// A number from the environment, or the one given.
fn setting(name: &str, otherwise: f64) -> f64 {
    let value = std::env::var(name).ok();
    value
        .and_then(|value| value.parse().ok())
        .unwrap_or(otherwise)
}

/// Powers of ten, and their products with √10, up to the largest.
fn sizes() -> Vec<u32> {
    let most = setting("SCALING_TRIANGLES", 1e7).min(3e7);
    let most = if is_test() { 3_200.0 } else { most };
    (0..)
        .map(|half_decade| 10f64.powf(3.0 + 0.5 * f64::from(half_decade)))
        .take_while(|&size| size <= most)
        .map(|size| size as u32)
        .collect()
}

/// A structure over one size of a mesh, its rays, and what they have cost.
struct Candidate {
    structure: Structure,
    accel: Box<dyn Accel>,
    primitives: usize,
    rays: RaySet,
    /// CPU nanoseconds per ray in each round.
    costs: Vec<f64>,
    /// Nodes visited and primitives tested per ray.
    visits: f64,
}

/// Builds what has time for a mesh of this size.
fn candidates(mesh: &str, triangles: u32) -> Vec<Candidate> {
    let (image, count) = if is_test() {
        ([32, 32], 1_000)
    } else {
        ([512, 384], 1 << 16)
    };
    let scene = MeshScene::new(&made(mesh, triangles), image);
    let sets = scene.rays(count);
    let incoherent = sets.iter().find(|set| set.kind() == RayKind::Diffuse2);
    let incoherent = incoherent.expect("every kind was asked for");
    let primitives = scene.geometry.len();
    let has_time =
        |structure: &Structure| *structure != Structure::Linear || primitives <= MOST_SCANNED;
    STRUCTURES
        .into_iter()
        .filter(has_time)
        .map(|structure| Candidate {
            structure,
            accel: build(structure, &scene.geometry).expect("not too many"),
            primitives,
            rays: match structure {
                Structure::Linear => incoherent.sample(SCAN_TESTS / primitives),
                _ => incoherent.sample(count),
            },
            costs: Vec::new(),
            visits: 0.0,
        })
        .collect()
}

impl Candidate {
    /// Runs all rays once.
    fn run(&mut self, pool: &ThreadPool) {
        let (round, counters) = run(pool, &*self.accel, &self.rays, BATCH);
        let rays = self.rays.len() as f64;
        self.costs.push(1e9 * round.cpu_seconds / rays);
        self.visits = (counters.nodes + counters.tests) as f64 / rays;
    }

    /// Lower quartile, median and upper quartile of the costs.
    fn quartiles(&self) -> [f64; 3] {
        let mut costs = self.costs.clone();
        costs.sort_by(f64::total_cmp);
        [1, 2, 3].map(|quarter| costs[(costs.len() - 1) * quarter / 4])
    }
}

/// Intercept, slope and r² of the line through points by least squares; none through fewer than three.
fn fit(points: &[(f64, f64)]) -> Option<[f64; 3]> {
    let n = points.len() as f64;
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(f).sum::<f64>() / n;
    let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
    let xx = mean(&|p| (p.0 - x).powi(2));
    let xy = mean(&|p| (p.0 - x) * (p.1 - y));
    let yy = mean(&|p| (p.1 - y).powi(2));
    let slope = xy / xx;
    (points.len() >= 3).then(|| [y - slope * x, slope, xy * xy / (xx * yy)])
}

/// Prints the exponent of `what` ∝ nᵏ, and for trees the line over log₂ n.
fn print_fit(name: &str, what: &str, points: &[(f64, f64)], tree: bool) {
    let power: Vec<_> = points.iter().map(|(n, y)| (n.ln(), y.ln())).collect();
    if let Some([_, exponent, r2]) = fit(&power) {
        println!("{name}: {what} ~ n^{exponent:.3}, r² = {r2:.3}");
    }
    let line: Vec<_> = points.iter().map(|(n, y)| (n.log2(), *y)).collect();
    if let Some([a, b, r2]) = fit(&line).filter(|_| tree) {
        println!("{name}: {what} = {a:.1} + {b:.2} log2 n, r² = {r2:.3}");
    }
}

fn print_fits(mesh: &str, structure: Structure, candidates: &[Candidate]) {
    let name = format!("{mesh}, {}", structure.name());
    let tree = structure != Structure::Linear;
    let (mut costs, mut visits) = (Vec::new(), Vec::new());
    for candidate in candidates.iter().filter(|own| own.structure == structure) {
        let [low, cost, high] = candidate.quartiles();
        let n = candidate.primitives as f64;
        println!(
            "{name}: {n} triangles, {cost:.1} ({low:.1}..{high:.1}) ns and {:.1} visits per ray",
            candidate.visits
        );
        if !tree || n >= LEAST_FITTED {
            costs.push((n, cost));
            visits.push((n, candidate.visits));
        }
    }
    print_fit(&name, "ns", &costs, tree);
    print_fit(&name, "visits", &visits, tree);
}

fn main() {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread");
    let rounds = if is_test() {
        1
    } else {
        setting("SCALING_ROUNDS", 7.0).max(1.0) as usize
    };
    for mesh in MESHES {
        let mut candidates: Vec<Candidate> = sizes()
            .into_iter()
            .flat_map(|triangles| candidates(mesh, triangles))
            .collect();
        // Once to warm up.
        for round in 0..=rounds {
            for candidate in &mut candidates {
                candidate.run(&pool);
                if round == 0 {
                    candidate.costs.clear();
                }
            }
        }
        for structure in STRUCTURES {
            print_fits(mesh, structure, &candidates);
        }
    }
}
