//! The connect stage on the hexagonal room: shadow rays per second.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

mod support;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use support::Bench;

fn connect(c: &mut Criterion) {
    let Bench {
        scene,
        kernels,
        mut wave,
        ..
    } = Bench::hexroom().advance(8, "connect");
    let connect = kernels.connect.expect("the room has a light");
    let shadow_rays = wave.shadows.len;
    let mut group = c.benchmark_group("connect");
    group.throughput(Throughput::Elements(shadow_rays as u64));
    group.bench_function("hexroom-exact", |b| {
        b.iter(|| {
            wave.shadows.len = shadow_rays;
            connect(&scene, &mut wave);
        });
    });
    assert!(shadow_rays > 0);
    group.finish();
}

criterion_group!(benches, connect);
criterion_main!(benches);
