//! The generate stage on the hexagonal room: camera rays per second.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

mod support;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use support::Bench;

fn generate(c: &mut Criterion) {
    let Bench {
        scene,
        kernels,
        item,
        mut wave,
    } = Bench::hexroom().advance(0, "generate");
    let mut group = c.benchmark_group("generate");
    group.throughput(Throughput::Elements(wave.capacity as u64));
    group.bench_function("hexroom-exact", |b| {
        b.iter(|| {
            wave.begin(&item);
            (kernels.generate)(&scene, &item, &mut wave);
        });
    });
    assert_eq!(wave.rays.len, wave.capacity, "the wave is full");
    group.finish();
}

criterion_group!(benches, generate);
criterion_main!(benches);
