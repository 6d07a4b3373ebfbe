//! The shade stage on the hexagonal room: hits per second, all materials of the scene.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

mod support;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use support::Bench;

fn shade(c: &mut Criterion) {
    let Bench {
        scene,
        kernels,
        item,
        mut wave,
    } = Bench::hexroom().advance(8, "shade");
    let hits: usize = wave.by_material.iter().map(|queue| queue.len).sum();
    let mut group = c.benchmark_group("shade");
    group.throughput(Throughput::Elements(hits as u64));
    group.bench_function("hexroom-exact", |b| {
        b.iter(|| {
            wave.next.len = 0;
            wave.shadows.len = 0;
            for stage in kernels.shade.iter().flatten() {
                stage(&scene, &item, &mut wave);
            }
        });
    });
    assert_eq!(
        wave.next.len, hits,
        "every hit leaves a next ray, dead or alive"
    );
    group.finish();
}

criterion_group!(benches, shade);
criterion_main!(benches);
