//! The measures and fits on noise of which the truth is known.

use std::f64::consts::TAU;

use super::aggregate::{Curves, pairs};
use super::bias::{SignedErrors, verdict};
use super::errors::{ReferenceImage, errors};
use super::judge::judge;
use super::results::*;
use super::seed;
use crate::film::Film;
use crate::report::{Build, Machine, SceneReport, Span};
use crate::scene::RenderSettings;

const WIDTH: u32 = 200;
const HEIGHT: u32 = 100;
const PIXELS: usize = (WIDTH * HEIGHT) as usize;

/// Random numbers of a stream.
struct Random {
    stream: u64,
    drawn: u64,
}

impl Random {
    fn new(stream: u64) -> Self {
        Self { stream, drawn: 0 }
    }

    /// Uniform in (0, 1].
    fn uniform(&mut self) -> f64 {
        self.drawn += 1;
        (seed(self.stream, self.drawn) + 1) as f64 / (1u64 << 48) as f64
    }

    /// Standard normal (Box and Muller).
    fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (TAU * self.uniform()).cos()
    }
}

/// A film whose pixels are rendered by `block`, which gives the sum of a number of samples.
fn add(
    film: &mut Film,
    samples: u64,
    random: &mut Random,
    block: &dyn Fn(u64, &mut Random) -> f64,
) {
    for pixel in 0..film.len() {
        let sum = block(samples, random);
        film.add_block(pixel, samples as u32, [sum; 3]);
    }
}

/// Samples of this mean and standard deviation.
fn gaussian(mean: f64, deviation: f64) -> impl Fn(u64, &mut Random) -> f64 {
    move |samples, random| {
        let n = samples as f64;
        n * mean + deviation * n.sqrt() * random.normal()
    }
}

/// An image of this many samples per pixel in eight blocks.
fn image(samples: u64, stream: u64, block: &dyn Fn(u64, &mut Random) -> f64) -> Film {
    let mut film = Film::new(WIDTH, HEIGHT, false);
    let mut random = Random::new(stream);
    for _ in 0..8 {
        add(&mut film, samples / 8, &mut random, block);
    }
    film
}

/// Repeats of checkpoints at `first` samples per pixel and `doublings` times twice as many. CPU time is
/// a microsecond per pixel and sample.
fn repeats(
    count: u64,
    first: u64,
    doublings: u32,
    size: [u32; 2],
    reference: &ReferenceImage,
    block: &dyn Fn(u64, &mut Random) -> f64,
) -> Vec<Repeat> {
    let repeat = |seed: u64| {
        let mut film = Film::new(size[0], size[1], false);
        let mut random = Random::new(1000 + seed);
        let mut rows = Vec::new();
        for doubling in 0..=doublings {
            let samples = first << doubling;
            let done = if doubling == 0 { 0 } else { samples / 2 };
            add(&mut film, samples - done, &mut random, block);
            rows.push(row(samples, errors(&film, reference)));
        }
        Repeat { seed, rows }
    };
    (0..count).map(repeat).collect()
}

fn row(samples: u64, errors: Errors) -> Row {
    Row {
        samples,
        paths: 0,
        camera_rays: samples,
        bounce_rays: 0,
        shadow_rays: 0,
        cpu_seconds: 1e-6 * samples as f64,
        wall_seconds: 1e-6 * samples as f64,
        errors,
        rejected: 0,
    }
}

fn constant(value: f64, pixels: usize, width: u32) -> ReferenceImage {
    ReferenceImage::exact(width, vec![[value; 3]; pixels])
}

fn means(film: &Film) -> Vec<[f64; 3]> {
    (0..film.len()).map(|pixel| film.mean(pixel)).collect()
}

/// Results that hold a configuration with these repeats.
fn results(all: Vec<Vec<Repeat>>) -> Results {
    let configuration = |(number, repeats): (usize, Vec<Repeat>)| {
        let curves = Curves::new(&repeats, 0.0);
        let [slope_by_samples, slope_by_time] = curves.slopes();
        Configuration {
            name: format!("{number}"),
            overrides: Vec::new(),
            settings: RenderSettings::default(),
            reference: 0,
            features: Vec::new(),
            accel: String::new(),
            load: Span::default(),
            build: Span::default(),
            ended: EndedBy::Samples,
            checkpoints: curves.checkpoints(),
            slope_by_samples,
            slope_by_time,
            time_to_unit_variance: curves.time_to_unit_variance(),
            efficiency: None,
            times_to_error: curves.times_to_error(),
            rays_per_second: 0.0,
            stages: Vec::new(),
            bias: verdict(None, Vec::new()),
            picture: None,
            slowest: Vec::new(),
            repeats,
        }
    };
    let configurations: Vec<Configuration> =
        all.into_iter().enumerate().map(configuration).collect();
    Results {
        format: FORMAT,
        build: Build::current(),
        machine: Machine::read(),
        load_average_after: None,
        noise: None,
        scene: SceneReport {
            name: "noise".into(),
            camera: "1".into(),
            width: WIDTH,
            height: HEIGHT,
        },
        settings: ConvergeSettings {
            repeats: 2,
            limit: Limit::Samples(1),
            threads: 1,
            seed: 0,
        },
        definitions: Vec::new(),
        references: Vec::new(),
        pairs: pairs(&configurations),
        configurations,
        phases: Phases::default(),
        accounting: Accounting {
            curves_cpu_seconds: 0.0,
            waking_cpu_seconds: 0.0,
            process_cpu_seconds: 0.0,
            ratio: None,
        },
        warnings: Vec::new(),
        interrupted: false,
    }
}

#[test]
fn gaussian_noise_has_its_error_slope_and_calibration() {
    let (mean, deviation) = (1.0, 0.5);
    let reference = constant(mean, PIXELS, WIDTH);
    let block = gaussian(mean, deviation);
    let repeats = repeats(5, 1, 10, [WIDTH, HEIGHT], &reference, &block);
    let curves = Curves::new(&repeats, reference.floor());
    for checkpoint in curves.checkpoints() {
        let expected = deviation * deviation / checkpoint.samples;
        let off = checkpoint.mse.value / expected - 1.0;
        assert!(off.abs() < 0.02, "{} samples: {off}", checkpoint.samples);
        let relative = checkpoint.relative_error.unwrap().value / (expected / 1.0001).sqrt() - 1.0;
        assert!(relative.abs() < 0.01, "{relative}");
        assert!(!checkpoint.near_reference);
    }
    let last = curves.checkpoints().pop().unwrap();
    assert!((last.calibration.unwrap().value - 1.0).abs() < 0.02);
    for fit in curves.slopes() {
        let slope = fit.unwrap().slope;
        assert!((slope.value + 0.5).abs() < 0.01, "{slope:?}");
        assert!(
            slope.low.unwrap() < -0.5 && slope.high.unwrap() > -0.5,
            "{slope:?}"
        );
    }
}

#[test]
fn noise_of_the_reference_bends_no_curve() {
    // The reference has no more samples than the last checkpoint.
    let block = gaussian(1.0, 0.5);
    let halves = [1, 2].map(|stream| means(&image(2048, stream, &block)));
    let reference = ReferenceImage::from_halves(WIDTH, 4096, [&halves[0], &halves[1]]);
    let naive = ReferenceImage::exact(WIDTH, reference.mean.clone());
    let slope = |reference: &ReferenceImage| {
        let repeats = repeats(4, 16, 8, [WIDTH, HEIGHT], reference, &block);
        let [by_samples, _] = Curves::new(&repeats, 0.0).slopes();
        2.0 * by_samples.unwrap().slope.value
    };
    assert!(
        (slope(&reference) + 1.0).abs() < 0.01,
        "{}",
        slope(&reference)
    );
    assert!(slope(&naive) > -0.96, "{}", slope(&naive));
    // And it knows its own error: 0.5/√4096.
    assert!((reference.variance() / (0.25 / 4096.0) - 1.0).abs() < 0.03);
    assert!((reference.relative_error() / (0.5 / 64.0) - 1.0).abs() < 0.02);
    // Within three times of it nothing is fitted.
    let repeats = repeats(4, 16, 8, [WIDTH, HEIGHT], &reference, &block);
    let curves = Curves::new(&repeats, reference.floor());
    for checkpoint in curves.checkpoints() {
        assert_eq!(
            checkpoint.near_reference,
            checkpoint.samples > 455.0,
            "{checkpoint:?}"
        );
    }
}

#[test]
fn darkening_by_one_percent_is_bias_and_noise_is_none() {
    let reference = constant(1.0, PIXELS, WIDTH);
    let test = |stream: u64, mean: f64| {
        let film = image(64, stream, &gaussian(mean, 1.64));
        verdict(SignedErrors::of(&film, &reference).as_ref(), Vec::new())
    };
    let dark = test(0, 0.99);
    assert_eq!(dark.verdict, BiasVerdict::Biased);
    assert!((-10.0..-4.0).contains(&dark.z.unwrap()), "{:?}", dark.z);
    for stream in 1..21 {
        let fair = test(stream, 1.0);
        assert_eq!(
            fair.verdict,
            BiasVerdict::NotShown,
            "{:?} {:?}",
            fair.z,
            fair.block_p
        );
    }
}

#[test]
fn bias_of_one_block_of_pixels_is_found_though_the_mean_is_right() {
    let reference = constant(1.0, PIXELS, WIDTH);
    let mut film = image(64, 7, &gaussian(1.0, 0.5));
    for y in 32..48 {
        for x in 48..64 {
            film.add_block((y * WIDTH + x) as usize, 8, [12.0; 3]);
        }
    }
    let bias = verdict(SignedErrors::of(&film, &reference).as_ref(), Vec::new());
    assert_eq!(bias.verdict, BiasVerdict::Biased);
    assert!(bias.z.unwrap().abs() < 4.0, "{:?}", bias.z);
    assert_eq!(bias.worst_block, Some((48, 32)));
    assert_eq!(bias.blocks.len(), 13 * 7);
}

#[test]
fn rounding_of_an_exact_image_is_no_bias_and_is_not_fitted() {
    let reference = constant(1.0, PIXELS, WIDTH);
    let film = image(64, 7, &|samples, _| samples as f64 * (1.0 + 1e-7));
    let bias = verdict(SignedErrors::of(&film, &reference).as_ref(), Vec::new());
    assert_eq!((bias.verdict, bias.z), (BiasVerdict::NotShown, Some(0.0)));
    let errors = errors(&film, &reference);
    assert!(errors.mse < 1e-12 && errors.mse < reference.floor());
    assert_eq!(errors.outliers, Some(0));
}

#[test]
fn infinite_variance_is_told_by_the_slope() {
    // Pareto's tail of exponent 3/2, mean 3.
    let pareto = |samples: u64, random: &mut Random| {
        (0..samples)
            .map(|_| random.uniform().powf(-2.0 / 3.0))
            .sum()
    };
    let reference = constant(3.0, 2000, 50);
    let results = results(vec![repeats(8, 1, 9, [50, 40], &reference, &pareto)]);
    let slope = results.configurations[0].slope_by_samples.unwrap().slope;
    assert!((slope.value + 1.0 / 3.0).abs() < 0.07, "{slope:?}");
    let warnings = judge(&results, 1.0);
    assert!(
        warnings.iter().any(|w| w.contains("infinite variance")),
        "{warnings:?} {slope:?}"
    );
}

/// Samples of 1, of which a share `p` is `value` brighter.
fn rare(p: f64, value: f64) -> impl Fn(u64, &mut Random) -> f64 {
    move |samples, random| {
        // Poisson by inversion.
        let limit = (-p * samples as f64).exp();
        let (mut product, mut count) = (random.uniform(), 0.0);
        while product > limit {
            product *= random.uniform();
            count += 1.0;
        }
        samples as f64 + value * count
    }
}

#[test]
fn rare_paths_that_a_short_render_has_not_seen_are_no_bias_and_in_a_long_one_are() {
    let rare = rare(1e-4, 1e4);
    let halves = [1, 2].map(|stream| means(&image(16384, stream, &rare)));
    let reference = ReferenceImage::from_halves(WIDTH, 2 * 16384, [&halves[0], &halves[1]]);
    let unknown = ReferenceImage {
        samples: 0,
        ..reference.clone()
    };
    let verdict_of = |film: &Film, reference: &ReferenceImage| {
        verdict(SignedErrors::of(film, reference).as_ref(), Vec::new()).verdict
    };
    let mut misled = 0;
    for stream in 3..13 {
        let short = image(16, stream, &rare);
        assert_eq!(verdict_of(&short, &reference), BiasVerdict::NotShown);
        misled += u32::from(verdict_of(&short, &unknown) == BiasVerdict::Biased);
    }
    assert!(misled >= 5, "{misled} of 10");
    assert_eq!(
        verdict_of(&image(8, 3, &rare), &unknown),
        BiasVerdict::Untested
    );
    let without = image(4096, 3, &|samples, _| samples as f64);
    assert_eq!(verdict_of(&without, &reference), BiasVerdict::Biased);
}

#[test]
fn rare_bright_samples_are_in_the_error_and_not_in_the_trimmed_one() {
    // One sample in 10⁵ is 10⁴.
    let (p, value) = (1e-5, 1e4);
    let rare = rare(p, value);
    let reference = constant(1.0 + p * value, PIXELS, WIDTH);
    let repeats = repeats(6, 64, 9, [WIDTH, HEIGHT], &reference, &rare);
    let curves = Curves::new(&repeats, reference.floor());
    let [slope, _] = curves.slopes();
    assert!(
        (2.0 * slope.unwrap().slope.value + 1.0).abs() < 0.1,
        "{slope:?}"
    );
    let first = curves.checkpoints()[0];
    let error = first.relative_error.unwrap().value;
    assert!(
        first.relative_error_trimmed.value < 0.1 * error,
        "{first:?}"
    );
    assert!(first.calibration.is_none());
    let outliers = repeats[0].rows[2].errors;
    assert!(outliers.outliers.unwrap() > 0 && outliers.outlier_share.unwrap() > 0.9);
}

#[test]
fn intervals_of_equal_configurations_contain_one_as_often_as_they_say() {
    let template = errors(
        &image(8, 0, &gaussian(1.0, 0.5)),
        &constant(1.0, PIXELS, WIDTH),
    );
    let trials = 400;
    let mut random = Random::new(5);
    let mut side = || -> Vec<Repeat> {
        (0..5)
            .map(|seed| {
                let mut row = row(
                    64,
                    Errors {
                        mse: (0.05 * random.normal()).exp(),
                        ..template
                    },
                );
                row.cpu_seconds = (0.05 * random.normal()).exp();
                Repeat {
                    seed,
                    rows: vec![row],
                }
            })
            .collect()
    };
    let contained = (0..trials)
        .filter(|_| {
            let pair = &results(vec![side(), side()]).pairs[0];
            pair.verdict.starts_with("no difference shown")
        })
        .count();
    let share = contained as f64 / f64::from(trials);
    assert!((0.93..0.98).contains(&share), "{share}");
}

#[test]
fn twice_the_speed_is_twice_the_efficiency() {
    let side = |factor: f64| -> Vec<Repeat> {
        let errors = errors(
            &image(8, 0, &gaussian(1.0, 0.5)),
            &constant(1.0, PIXELS, WIDTH),
        );
        (0..3)
            .map(|seed| Repeat {
                seed,
                rows: (0..6)
                    .map(|k| {
                        let samples = 1u64 << k;
                        let mse = (1.0 + 0.01 * seed as f64) / samples as f64;
                        let mut row = row(
                            samples,
                            Errors {
                                mse,
                                relmse: mse,
                                ..errors
                            },
                        );
                        row.cpu_seconds *= factor;
                        row
                    })
                    .collect(),
            })
            .collect()
    };
    let results = results(vec![side(1.0), side(0.5)]);
    let pair = &results.pairs[0];
    let close = |estimate: Option<Estimate>, expected: f64| {
        let value = estimate.unwrap().value;
        assert!((value / expected - 1.0).abs() < 1e-9, "{value} {expected}");
    };
    close(pair.efficiency, 2.0);
    close(pair.equal_samples, 1.0);
    close(pair.equal_time, 0.5f64.sqrt());
    close(pair.equal_error, 0.5);
    assert!(
        pair.verdict.starts_with("1 is 2.00x [2.00, 2.00]"),
        "{}",
        pair.verdict
    );
    let read: Results = serde_json::from_str(&results.to_json()).unwrap();
    assert_eq!(read, results);
    let csv = super::csv::table(&results);
    assert_eq!(csv.lines().count(), 1 + 2 * 3 * 6);
    let columns = |line: &str| line.split(',').count();
    assert!(
        csv.lines()
            .all(|line| columns(line) == columns(csv.lines().next().unwrap()))
    );
}

#[test]
fn seeds_of_all_streams_differ() {
    let mut seeds: Vec<u64> = [0, 1, 2, 7, u64::MAX]
        .into_iter()
        .flat_map(|base| (0..100).map(move |index| seed(base, index)))
        .collect();
    assert!(seeds.iter().all(|seed| seed >> 48 == 0));
    seeds.sort_unstable();
    seeds.dedup();
    assert_eq!(seeds.len(), 500);
}
