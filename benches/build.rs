//! Builds of every structure at every quality over several meshes. Throughput is in triangles.
//!
//! After criterion's groups, which take all threads, every structure is built `BUILD_ROUNDS` times (9 unless
//! it is set) on `BUILD_THREADS` threads (1), one after the other in each round, beside Embree if the crate was built
//! with the feature `embree` and finds the library. It prints medians and quartiles of the process's CPU
//! seconds, and their ratios to Embree's medium build of the same round; then how the time of the own medium and
//! best build divides into phases.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]
#![allow(clippy::print_stdout, reason = "prints the comparison")]

#[path = "support/mesh_scenes.rs"]
mod mesh_scenes;

use std::cell::RefCell;

use criterion::{BenchmarkId, Criterion, SamplingMode, Throughput, criterion_group};
use rayon::ThreadPool;
use wavepath::accel::foreign::{EmbreeBuild, EmbreeCalls};
use wavepath::accel::{BuildOptions, BuildPhase, BuildQuality, Structure, build_with};
use wavepath::geometry::Geometry;
use wavepath::report::accels::{Builder, Contestant};
use wavepath::report::{Span, Stopwatch};

use mesh_scenes::{MeshScene, folder, is_test, made, read};

const QUALITIES: [(BuildQuality, &str); 3] = [
    (BuildQuality::Fast, "fast"),
    (BuildQuality::Medium, "medium"),
    (BuildQuality::Best, "best"),
];

/// What the structures are built over.
fn meshes() -> Vec<(String, Geometry)> {
    let triangles = if is_test() { 1_000 } else { 200_000 };
    let mut scenes: Vec<_> = ["terrain", "hairball", "soup"]
        .map(|kind| (kind.to_owned(), made(kind, triangles)))
        .into();
    if let Some(folder) = folder().filter(|_| !is_test()) {
        for (name, file) in [
            ("bunny", "small/stanford-bunny.obj.zst"),
            ("sponza", "medium/sponza-crytek/sponza.obj.zst"),
            ("dragon", "medium/stanford-dragon.obj.zst"),
            ("star-destroyer", "large/lego-10030-star-destroyer.obj.zst"),
        ] {
            scenes.push((name.to_owned(), read(&folder, file)));
        }
    }
    let geometry = |scene| MeshScene::new(scene, [64, 48]).unmerged();
    scenes
        .iter()
        .map(|(name, scene)| (name.clone(), geometry(scene)))
        .collect()
}

fn build(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("build");
    group.sampling_mode(SamplingMode::Flat).sample_size(10);
    for (mesh, geometry) in meshes() {
        group.throughput(Throughput::Elements(geometry.len() as u64));
        for structure in Structure::ALL {
            let qualities = match structure {
                // Not built at all, and built as the 8-wide tree is.
                Structure::Linear | Structure::Packet => continue,
                // It has no qualities.
                Structure::Octree => &QUALITIES[1..2],
                Structure::Bvh2 | Structure::Bvh8 => &QUALITIES[..],
            };
            for &(quality, name) in qualities {
                let options = BuildOptions {
                    quality,
                    ..BuildOptions::default()
                };
                let id = BenchmarkId::new(format!("{}-{name}", structure.name()), &mesh);
                group.bench_function(id, |bencher| {
                    bencher.iter_with_large_drop(|| {
                        build_with(structure, &geometry, &options).expect("not too many")
                    });
                });
            }
        }
    }
    group.finish();
}

/// A number from the environment, or the one given.
fn setting(name: &str, otherwise: usize) -> usize {
    let value = std::env::var(name).ok();
    value
        .and_then(|value| value.parse().ok())
        .unwrap_or(otherwise)
}

/// Lower quartile, median and upper quartile.
fn quartiles(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    [1, 2, 3].map(|quarter| values[(values.len() - 1) * quarter / 4])
}

/// The structure whose builds the others are compared with.
const YARDSTICK: Contestant = Contestant::Embree(EmbreeBuild::Medium, EmbreeCalls::Single);

/// Builds everything in rounds and prints the comparison.
fn compare() {
    let rounds = if is_test() {
        1
    } else {
        setting("BUILD_ROUNDS", 9)
    };
    let threads = setting("BUILD_THREADS", 1);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .expect("threads");
    println!("{rounds} interleaved rounds on {threads} threads: CPU seconds, median (quartiles)");
    for (mesh, geometry) in meshes() {
        let contestants = [
            (Contestant::Own(Structure::Bvh8), BuildQuality::Fast),
            (Contestant::Own(Structure::Bvh8), BuildQuality::Medium),
            (Contestant::Own(Structure::Bvh8), BuildQuality::Best),
            (Contestant::Own(Structure::Octree), BuildQuality::Medium),
            (YARDSTICK, BuildQuality::Medium),
            (
                Contestant::Embree(EmbreeBuild::High, EmbreeCalls::Single),
                BuildQuality::Medium,
            ),
        ];
        let mut spans: Vec<Vec<Span>> = vec![Vec::new(); contestants.len()];
        for _ in 0..rounds {
            for (&(contestant, quality), spans) in contestants.iter().zip(&mut spans) {
                let built = Builder::new(&geometry, &pool, quality).build(contestant);
                spans.extend(built.ok().map(|built| built.figures.time));
            }
        }
        println!("{mesh}, {} triangles", geometry.triangles.len());
        let yardstick = contestants.iter().position(|entry| entry.0 == YARDSTICK);
        let yardstick = spans[yardstick.expect("it takes part")].clone();
        for ((contestant, quality), spans) in contestants.iter().zip(spans) {
            if spans.is_empty() {
                continue;
            }
            let column = |of: &dyn Fn(&Span) -> f64| quartiles(spans.iter().map(of).collect());
            let [low, cpu, high] = column(&|span| span.cpu_seconds);
            let [_, wall, _] = column(&|span| span.wall_seconds);
            let ratio = |of: fn(&Span) -> f64| {
                let pairs = spans.iter().zip(&yardstick);
                let ratios: Vec<f64> = pairs.map(|(own, other)| of(own) / of(other)).collect();
                (!ratios.is_empty()).then(|| quartiles(ratios))
            };
            let name = format!("{} {quality:?}", contestant.name());
            print!("  {name:24} {cpu:8.4} ({low:.4}..{high:.4}), wall {wall:.4}");
            if let Some([low, middle, high]) = ratio(|span| span.cpu_seconds) {
                print!(
                    "; to {}: {middle:.3} ({low:.3}..{high:.3})",
                    YARDSTICK.name()
                );
            }
            if let Some([_, middle, _]) = ratio(|span| span.wall_seconds) {
                print!(", wall {middle:.3}");
            }
            println!();
        }
        for quality in [BuildQuality::Medium, BuildQuality::Best] {
            phases(&pool, &geometry, quality, rounds);
        }
    }
}

/// Prints how the time of builds of the 8-wide tree divides into phases.
fn phases(pool: &ThreadPool, geometry: &Geometry, quality: BuildQuality, rounds: usize) {
    const PHASES: [BuildPhase; 4] = [
        BuildPhase::Sort,
        BuildPhase::Cluster,
        BuildPhase::Optimize,
        BuildPhase::Collapse,
    ];
    // And what follows the last phase.
    let mut seconds = [const { Vec::new() }; PHASES.len() + 1];
    for _ in 0..rounds {
        let ends = pool.install(|| {
            let ends = RefCell::new([0.0; PHASES.len() + 1]);
            let watch = Stopwatch::start();
            let hear = |phase, _| {
                let at = PHASES.iter().position(|&known| known == phase);
                ends.borrow_mut()[at.expect("a known phase")] = watch.span().cpu_seconds;
            };
            let options = BuildOptions {
                quality,
                progress: Some(&hear),
            };
            let built = build_with(Structure::Bvh8, geometry, &options);
            ends.borrow_mut()[PHASES.len()] = watch.span().cpu_seconds;
            drop(built);
            ends.into_inner()
        });
        let mut begin = 0.0;
        for (seconds, end) in seconds.iter_mut().zip(ends) {
            seconds.push(end - begin);
            begin = end;
        }
    }
    print!("  phases of {quality:?}:");
    for (at, seconds) in seconds.into_iter().enumerate() {
        let name = PHASES.get(at).map_or("layout".to_owned(), |phase| {
            format!("{phase:?}").to_lowercase()
        });
        print!(" {name} {:.4}", quartiles(seconds)[1]);
    }
    println!();
}

criterion_group!(benches, build);

fn main() {
    if std::env::var_os("BUILD_COMPARISON_ONLY").is_none() {
        benches();
        Criterion::default().configure_from_args().final_summary();
    }
    compare();
}
