//! How the cost of a ray grows with the number of triangles, for incoherent rays over meshes from 10³
//! triangles on, up to `SCALING_TRIANGLES` (10⁷ unless it is set, 3·10⁷ at most). Times are CPU seconds,
//! throughput is in rays.
//!
//! After the measurements it prints what fits the least times: the exponent k of cost ∝ nᵏ, and for trees the line
//! cost = a + b·log₂ n, with r², both from 10⁴ triangles on.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]
#![allow(clippy::print_stdout, reason = "prints the fits")]

#[path = "support/mesh_scenes.rs"]
mod mesh_scenes;

use std::time::Duration;

use criterion::{
    BenchmarkId, Criterion, SamplingMode, Throughput, criterion_group, criterion_main,
};
use rayon::ThreadPool;
use wavepath::accel::{Structure, build};
use wavepath::report::accels::{RayKind, run};

use mesh_scenes::{MeshScene, is_test, made};

/// Rays per call.
const BATCH: usize = 4_096;

/// Most triangles over which the scan is run.
const MOST_SCANNED: usize = 100_000;

/// Ray–triangle tests in a round of the scan: it gets fewer rays of larger meshes.
const SCAN_TESTS: usize = 100_000_000;

/// Smallest mesh that counts in a fit: smaller ones are in the first-level cache.
const LEAST_FITTED: f64 = 1e4;

const MESHES: [&str; 2] = ["terrain", "hairball"];
const STRUCTURES: [Structure; 3] = [Structure::Linear, Structure::Octree, Structure::Bvh8];

/// Powers of ten, and their products with √10, up to the largest.
fn sizes() -> Vec<u32> {
    let most = std::env::var("SCALING_TRIANGLES")
        .ok()
        .and_then(|value| value.parse::<f64>().ok())
        .unwrap_or(1e7)
        .min(3e7);
    let most = if is_test() { 3_200.0 } else { most };
    (0..)
        .map(|half_decade| 10f64.powf(3.0 + 0.5 * f64::from(half_decade)))
        .take_while(|&size| size <= most)
        .map(|size| size as u32)
        .collect()
}

/// Triangles, and least CPU nanoseconds per ray.
type Point = (f64, f64);

/// Measures one mesh with every structure that has time for it.
fn measure(
    criterion: &mut Criterion,
    pool: &ThreadPool,
    mesh: &str,
    triangles: u32,
) -> Vec<(Structure, Point)> {
    let (image, count) = if is_test() {
        ([32, 32], 1_000)
    } else {
        ([512, 384], 1 << 17)
    };
    let scene = MeshScene::new(&made(mesh, triangles), image);
    let sets = scene.rays(count);
    let incoherent = sets.iter().find(|set| set.kind() == RayKind::Diffuse2);
    let incoherent = incoherent.expect("every kind was asked for");
    let mut group = criterion.benchmark_group("scaling");
    group
        .sampling_mode(SamplingMode::Flat)
        .sample_size(10)
        .warm_up_time(Duration::from_millis(500))
        .measurement_time(Duration::from_secs(2));
    let mut points = Vec::new();
    for structure in STRUCTURES {
        let primitives = scene.geometry.len();
        let rays = match structure {
            Structure::Linear if primitives > MOST_SCANNED => continue,
            Structure::Linear => incoherent.sample(SCAN_TESTS / primitives),
            _ => incoherent.sample(count),
        };
        let accel = build(structure, &scene.geometry).expect("not too many");
        let mut least = f64::INFINITY;
        group.throughput(Throughput::Elements(rays.len() as u64));
        let id = BenchmarkId::new(format!("{}-{mesh}", structure.name()), primitives);
        group.bench_function(id, |bencher| {
            bencher.iter_custom(|rounds| {
                let seconds = |_| run(pool, &*accel, &rays, BATCH).0.cpu_seconds;
                let each: Vec<f64> = (0..rounds).map(seconds).collect();
                least = each.iter().copied().fold(least, f64::min);
                Duration::from_secs_f64(each.iter().sum())
            });
        });
        points.push((
            structure,
            (primitives as f64, 1e9 * least / rays.len() as f64),
        ));
    }
    group.finish();
    points
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

fn print_fits(mesh: &str, structure: Structure, points: &[Point]) {
    let name = structure.name();
    for (triangles, cost) in points {
        println!("{mesh}, {name}: {triangles} triangles, {cost:.1} ns per ray");
    }
    let fitted: Vec<Point> = points
        .iter()
        .copied()
        .filter(|point| structure == Structure::Linear || point.0 >= LEAST_FITTED)
        .collect();
    let power: Vec<_> = fitted.iter().map(|(n, cost)| (n.ln(), cost.ln())).collect();
    if let Some([_, exponent, r2]) = fit(&power) {
        println!("{mesh}, {name}: cost ~ n^{exponent:.3}, r² = {r2:.3}");
    }
    let line: Vec<_> = fitted.iter().map(|(n, cost)| (n.log2(), *cost)).collect();
    if let Some([a, b, r2]) = fit(&line).filter(|_| structure != Structure::Linear) {
        println!("{mesh}, {name}: cost = {a:.1} + {b:.2} log2 n ns, r² = {r2:.3}");
    }
}

fn scaling(criterion: &mut Criterion) {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread");
    for mesh in MESHES {
        let points: Vec<_> = sizes()
            .into_iter()
            .flat_map(|triangles| measure(criterion, &pool, mesh, triangles))
            .collect();
        for structure in STRUCTURES {
            let own = points.iter().filter(|point| point.0 == structure);
            let own: Vec<Point> = own.map(|point| point.1).collect();
            print_fits(mesh, structure, &own);
        }
    }
}

criterion_group!(benches, scaling);
criterion_main!(benches);
