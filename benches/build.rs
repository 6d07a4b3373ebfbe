//! Builds of every structure at every quality over several meshes, on all threads. Throughput is in
//! triangles.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

#[path = "support/mesh_scenes.rs"]
mod mesh_scenes;

use criterion::{
    BenchmarkId, Criterion, SamplingMode, Throughput, criterion_group, criterion_main,
};
use wavepath::accel::{BuildOptions, BuildQuality, Structure, build_with};
use wavepath::geometry::Geometry;

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
            ("dragon", "medium/stanford-dragon.obj.zst"),
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

criterion_group!(benches, build);
criterion_main!(benches);
