//! Whole renders: camera paths per second of the wavefront against the reference, of lean kernels
//! against those that can do everything, and over wave sizes from a vector to far past the cache.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

mod support;

use std::hint::black_box;
use std::ops::ControlFlow;

use criterion::{
    BenchmarkId, Criterion, SamplingMode, Throughput, criterion_group, criterion_main,
};
use wavepath::compile::compile;
use wavepath::integrator::render;
use wavepath::scene::{Budget, IntegratorKind, RenderSettings, SceneDescription};

const SIZE: u32 = 128;

fn run(scene: &SceneDescription, settings: &RenderSettings) -> f64 {
    let compiled = compile(scene, 0, SIZE, SIZE, settings).expect("compiles");
    let outcome =
        render(scene, &compiled, settings, &|_| ControlFlow::Continue(())).expect("renders");
    assert!(outcome.film.mean(0)[0].is_finite());
    outcome.film.mean(0)[0]
}

fn bench(c: &mut Criterion, group: &str, cases: &[(String, &str, RenderSettings)]) {
    let mut group = c.benchmark_group(group);
    group.sampling_mode(SamplingMode::Flat).sample_size(10);
    for (name, file, settings) in cases {
        let Budget::Samples(spp) = settings.budget else {
            unreachable!("benches count samples")
        };
        group.throughput(Throughput::Elements(spp * u64::from(SIZE * SIZE)));
        let scene = support::load(file);
        group.bench_with_input(
            BenchmarkId::from_parameter(name),
            settings,
            |b, settings| {
                b.iter(|| black_box(run(&scene, settings)));
            },
        );
    }
    group.finish();
}

fn integrators(c: &mut Criterion) {
    let base = RenderSettings {
        budget: Budget::Samples(16),
        ..support::settings()
    };
    let reference = RenderSettings {
        integrator: IntegratorKind::Reference,
        budget: Budget::Samples(1),
        ..base.clone()
    };
    let file = "hexroom-exact.toml";
    bench(
        c,
        "integrator",
        &[
            ("wavefront".to_owned(), file, base),
            ("reference".to_owned(), file, reference),
        ],
    );
}

fn features(c: &mut Criterion) {
    let lean = RenderSettings {
        budget: Budget::Samples(16),
        ..support::settings()
    };
    let full = RenderSettings {
        force_features: true,
        ..lean.clone()
    };
    for file in ["hexroom-exact.toml", "cornell.toml"] {
        bench(
            c,
            &format!("features {file}"),
            &[
                ("lean".to_owned(), file, lean.clone()),
                ("everything".to_owned(), file, full.clone()),
            ],
        );
    }
}

fn wave_sizes(c: &mut Criterion) {
    let cases: Vec<_> = [1, 16, 64, 256, 1024, 4096, 16_384, 65_536]
        .into_iter()
        .map(|wave| {
            let settings = RenderSettings {
                wave,
                budget: Budget::Samples(16),
                ..support::settings()
            };
            (wave.to_string(), "hexroom-exact.toml", settings)
        })
        .collect();
    bench(c, "wave", &cases);
}

criterion_group!(benches, integrators, features, wave_sizes);
criterion_main!(benches);
