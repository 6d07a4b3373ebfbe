//! The emission stage on the hexagonal room: emitter hits per second.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

mod support;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use support::Bench;

fn emission(c: &mut Criterion) {
    let Bench {
        scene,
        kernels,
        mut wave,
        ..
    } = Bench::hexroom().advance(8, "emission");
    let shade_emission = kernels.shade_emission.expect("the room has a light");
    let mut group = c.benchmark_group("emission");
    group.throughput(Throughput::Elements(wave.emitters.len as u64));
    group.bench_function("hexroom-exact", |b| {
        b.iter(|| shade_emission(&scene, &mut wave))
    });
    assert!(wave.emitters.len > 0);
    group.finish();
}

criterion_group!(benches, emission);
criterion_main!(benches);
