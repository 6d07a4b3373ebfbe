//! The roulette stage on the hexagonal room: next rays per second.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

mod support;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use support::Bench;

fn roulette(c: &mut Criterion) {
    let Bench {
        scene,
        kernels,
        mut wave,
        ..
    } = Bench::hexroom().advance(8, "roulette");
    let next = wave.next.len;
    let mut group = c.benchmark_group("roulette");
    group.throughput(Throughput::Elements(next as u64));
    group.bench_function("hexroom-exact", |b| {
        b.iter(|| {
            // Throughputs and generators change from round to round; the work does not.
            wave.next.len = next;
            (kernels.roulette)(&scene, &mut wave);
        });
    });
    assert!(wave.rays.len > 0 && wave.rays.len < next);
    group.finish();
}

criterion_group!(benches, roulette);
criterion_main!(benches);
