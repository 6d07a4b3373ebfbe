//! Queries of every structure with every kind of ray, in a small room and over meshes, 4096 rays per call on
//! one thread; and the plain loop over all triangles of the room. Times are CPU seconds, throughput is
//! in rays. Real meshes take part where `WAVEPATH_MESHES` names their folder.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]
#![allow(clippy::print_stderr, reason = "says what was left out")]

#[path = "support/mesh_scenes.rs"]
mod mesh_scenes;

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use wavepath::accel::{Accel, Structure, build};
use wavepath::geometry::triangle::ShearRay;
use wavepath::geometry::{PrimitiveId, Triangle};
use wavepath::report::accels::{Answers, RaySet, answers, run};
use wavepath::scene::{self, SceneDescription};

use mesh_scenes::{MeshScene, folder, is_test, made, read};

/// Rays per call.
const BATCH: usize = 4_096;

/// Most primitives over which every one is tested.
const MOST_SCANNED: usize = 1_000;

fn scenes() -> Vec<(&'static str, SceneDescription)> {
    let room = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/hexroom-exact.toml");
    let room = scene::load(room.as_ref(), &[]).expect("the repository's scenes are sound");
    let triangles = if is_test() { 1_000 } else { 200_000 };
    let mut scenes = vec![("room", room)];
    let kinds = ["icosphere", "sponge", "terrain", "hairball", "soup"];
    scenes.extend(kinds.map(|kind| (kind, made(kind, triangles))));
    match folder() {
        _ if is_test() => {}
        Some(folder) => scenes.extend(
            [
                ("bunny", "small/stanford-bunny.obj.zst"),
                ("dragon", "medium/stanford-dragon.obj.zst"),
                ("sponza", "medium/sponza-crytek/sponza.obj.zst"),
            ]
            .map(|(name, file)| (name, read(&folder, file))),
        ),
        None => eprintln!("real meshes skipped: WAVEPATH_MESHES names no folder"),
    }
    scenes
}

/// How many rays hit something.
fn hits(answers: &Answers) -> usize {
    match answers {
        Answers::Closest(hits) => {
            let hits = hits.iter().filter(|hit| hit.1 != PrimitiveId::NONE);
            hits.count()
        }
        Answers::Occluded(occluded) => occluded.iter().filter(|&&occluded| occluded).count(),
    }
}

/// The nearest distance along each ray, by the scalar test of every triangle; their sum.
fn plain_loop(triangles: &[Triangle], rays: &RaySet) -> f32 {
    let nearest = |i| {
        let (origin, direction, _) = rays.ray(i);
        let ray = ShearRay::new(origin, direction);
        let distances = triangles.iter().filter_map(|t| ray.intersect(t));
        distances.fold(f32::INFINITY, f32::min)
    };
    (0..rays.len()).map(nearest).sum()
}

fn traverse(criterion: &mut Criterion) {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread");
    let mut group = criterion.benchmark_group("traverse");
    group.sample_size(20);
    let (image, count) = if is_test() {
        ([32, 32], 1_000)
    } else {
        ([512, 384], 1 << 17)
    };
    for (name, scene) in scenes() {
        let scene = MeshScene::new(&scene, image);
        let geometry = &scene.geometry;
        let is_small = geometry.len() <= MOST_SCANNED;
        let accels: Vec<_> = Structure::ALL
            .into_iter()
            .filter(|&structure| is_small || structure != Structure::Linear)
            .map(|structure| build(structure, geometry).expect("not too many"))
            .collect();
        for rays in scene.rays(count).iter().filter(|rays| !rays.is_empty()) {
            let kind = rays.kind().name();
            group.throughput(Throughput::Elements(rays.len() as u64));
            let given = |accel: &dyn Accel| answers(&pool, accel, rays, BATCH);
            let expected = given(&*accels[accels.len() - 1]);
            for accel in &accels {
                let found = given(&**accel);
                let is_right = match accel.name() {
                    // It has a test of its own, which decides otherwise where a ray starts on a plane.
                    "linear" => hits(&found).abs_diff(hits(&expected)) <= rays.len() / 10,
                    _ => found == expected,
                };
                assert!(is_right, "{}, {name}, {kind}", accel.name());

                let id = BenchmarkId::new(accel.name(), format!("{name}/{kind}"));
                group.bench_function(id, |bencher| {
                    bencher.iter_custom(|rounds| {
                        let seconds = |_| run(&pool, &**accel, rays, BATCH).0.cpu_seconds;
                        Duration::from_secs_f64((0..rounds).map(seconds).sum())
                    });
                });
            }
            if is_small {
                let id = BenchmarkId::new("plain-loop", format!("{name}/{kind}"));
                group.bench_function(id, |bencher| {
                    bencher.iter(|| plain_loop(black_box(&geometry.triangles), rays))
                });
            }
        }
    }
    group.finish();
}

criterion_group!(benches, traverse);
criterion_main!(benches);
