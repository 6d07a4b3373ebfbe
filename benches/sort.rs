//! The sort stage on the hexagonal room: hits per second.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

mod support;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use support::Bench;

fn sort(c: &mut Criterion) {
    let Bench {
        scene,
        kernels,
        mut wave,
        ..
    } = Bench::hexroom().advance(8, "sort");
    let mut group = c.benchmark_group("sort");
    group.throughput(Throughput::Elements(wave.rays.len as u64));
    group.bench_function("hexroom-exact", |b| {
        b.iter(|| (kernels.sort)(&scene, &mut wave))
    });
    let sorted: usize = wave.by_material.iter().map(|queue| queue.len).sum();
    assert!(sorted > 0 && sorted <= wave.rays.len);
    group.finish();
}

criterion_group!(benches, sort);
criterion_main!(benches);
