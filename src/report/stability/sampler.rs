//! Random numbers: uniform, and without correlation between dimensions, pixels, samples and seeds.

use super::renders::max_or_nan;
use super::trial::{Figure, Trial};
use crate::error::Result;
use crate::geometry::PrimitiveId;
use crate::light::{Light, LightTable, PointLight, Receiver, kinds, sample};
use crate::math::testing::normal_of_chi_squared;
use crate::math::warp::{cosine_hemisphere, triangle_or_square, uniform_sphere};
use crate::math::{F32s, LANES, U32s, Vec3s};
use crate::sampler::pcg::{Pcg32s, STREAM, path_key};
use rand_core::Rng;
use rand_pcg::Pcg32;

/// Dimensions of a path that are looked at.
const DIMENSIONS: usize = 16;
/// Bins of the unit interval.
const BINS: usize = 64;

/// Numbers of pixels `first ..` by dimension, LANES paths at a time.
fn numbers(seed: u64, first: u32, sample: u64) -> [[f32; LANES]; DIMENSIONS] {
    let pixels = U32s::from(std::array::from_fn::<u32, LANES, _>(|i| {
        first.wrapping_add(i as u32)
    }));
    let mut rng = Pcg32s::for_paths(seed, pixels, sample, U32s::splat(0));
    [(); DIMENSIONS].map(|()| rng.next_f32().to_array())
}

/// Correlation of pairs of uniform numbers, in its standard errors.
#[derive(Default, Clone, Copy)]
struct Correlation {
    sum: f64,
    n: f64,
}

impl Correlation {
    fn add(&mut self, a: f32, b: f32) {
        self.sum += (f64::from(a) - 0.5) * (f64::from(b) - 0.5);
        self.n += 1.0;
    }

    /// The product has mean 0 and variance 1/144.
    fn standard_errors(&self) -> f64 {
        (self.sum / self.n * 12.0 * self.n.sqrt()).abs()
    }
}

pub(super) fn random_numbers(trial: &mut Trial<'_>) -> Result<()> {
    let pixels = trial.count(1 << 18).min(1 << 22) as u32;
    let mut bins = [[0u32; BINS]; DIMENSIONS];
    let mut shifted = [[Correlation::default(); 4]; DIMENSIONS];
    for first in (0..pixels).step_by(LANES) {
        let own = numbers(0, first, 0);
        let others = [
            numbers(0, first + 1, 0),
            numbers(0, first, 1),
            numbers(1, first, 0),
            // Far apart: the other end of the pixels, and a sample beyond 32 bits.
            numbers(0, first ^ (1 << 31), 1 << 32),
        ];
        for d in 0..DIMENSIONS {
            for lane in 0..LANES {
                bins[d][(own[d][lane] * BINS as f32) as usize] += 1;
                for (correlation, other) in shifted[d].iter_mut().zip(&others) {
                    correlation.add(own[d][lane], other[d][lane]);
                    // And the next dimension there.
                    correlation.add(own[d][lane], other[(d + 1) % DIMENSIONS][lane]);
                }
            }
        }
    }
    let n = f64::from(pixels.next_multiple_of(LANES as u32));
    let worst_bins = bins.iter().fold(0.0, |worst, counts| {
        let expected = n / BINS as f64;
        let chi2: f64 = counts
            .iter()
            .map(|&k| (f64::from(k) - expected).powi(2) / expected)
            .sum();
        max_or_nan(worst, normal_of_chi_squared(chi2, BINS as u32 - 1))
    });
    // Of 80 figures the largest may be more than 4.
    let limit = 5.0;
    let samples = u64::from(pixels) * DIMENSIONS as u64;
    trial.note(
        format!("{pixels} pixels, {DIMENSIONS} dimensions"),
        "χ² of 64 bins",
        Figure::standard_errors_within(worst_bins.max(0.0), limit, samples),
    );
    for (i, name) in [
        "next pixel",
        "next sample",
        "next seed",
        "pixel + 2³¹, sample 2³²",
    ]
    .into_iter()
    .enumerate()
    {
        let worst = shifted
            .iter()
            .fold(0.0, |worst, c| max_or_nan(worst, c[i].standard_errors()));
        trial.note(
            name,
            "no correlation",
            Figure::standard_errors_within(worst, limit, 2 * samples),
        );
    }
    Ok(())
}

pub(super) fn counters(trial: &mut Trial<'_>) -> Result<()> {
    // Sample numbers beyond 32 bits, pixels at the end of theirs; against the scalar generator.
    let mut wrong = 0;
    let ends = [
        0,
        1,
        u32::MAX as u64,
        1 << 32,
        (1 << 33) + 1,
        u64::MAX - LANES as u64,
    ];
    for first in ends {
        for pixel in [0, 1, u32::MAX] {
            let samples = U32s::from(std::array::from_fn::<u32, LANES, _>(|i| i as u32));
            let mut lanes = Pcg32s::for_paths(7, U32s::splat(pixel), first, samples);
            let drawn = [(); 4].map(|()| lanes.next_f32().to_array());
            for lane in 0..LANES {
                let mut scalar = Pcg32::new(path_key(7, pixel, first + lane as u64), STREAM);
                for numbers in drawn {
                    let expected = (scalar.next_u32() >> 8) as f32 / 16_777_216.0;
                    wrong += u64::from(numbers[lane].to_bits() != expected.to_bits());
                }
            }
        }
    }
    let samples = 3 * 4 * (ends.len() * LANES) as u64;
    trial.note(
        "samples to 2⁶⁴, pixels to 2³²",
        "scalar PCG32, bit for bit",
        Figure::none_of(wrong, samples),
    );
    Ok(())
}

pub(super) fn unit_ends(trial: &mut Trial<'_>) -> Result<()> {
    let ends = [0.0, f32::MIN_POSITIVE, 0.5, 1.0 - f32::EPSILON / 2.0];
    let lights: Vec<Light> = (0..5)
        .map(|i| {
            Light::Point(PointLight {
                position: [0.0, 0.0, 1.0],
                intensity: [1.0 + i as f32; 3],
            })
        })
        .collect();
    let lights = LightTable::new(&lights)?;
    let at = Receiver {
        p: Vec3s::zero(),
        n: Vec3s::splat([0.0, 0.0, 1.0]),
        primitive: U32s::splat(PrimitiveId::NONE),
    };
    let mut wrong = 0;
    let first = |x: F32s| x.to_array()[0];
    for u in ends {
        for v in ends {
            let (a, b) = (F32s::splat(u), F32s::splat(v));
            let unit = |d: Vec3s| (first(d.length_squared()) - 1.0).abs() < 1e-6;
            let hemisphere = cosine_hemisphere(a, b);
            wrong += u64::from(!unit(hemisphere) || first(hemisphere.z) <= 0.0);
            wrong += u64::from(!unit(uniform_sphere(a, b)));
            for fold in [0.0, 0.5] {
                let (s, t) = triangle_or_square(F32s::splat(fold), a, b);
                let (s, t) = (first(s), first(t));
                let inside =
                    s >= 0.0 && t >= 0.0 && s.max(t) <= 1.0 && (fold == 0.0 || s + t <= 1.0 + 1e-6);
                wrong += u64::from(!inside);
            }
            let chosen = sample::<{ kinds::POINT | kinds::MANY }>(&lights, &at, [a, b, b]);
            let pdf = first(chosen.pdf);
            wrong += u64::from(!(pdf > 0.0 && pdf <= 1.0));
        }
    }
    trial.note(
        "u = 0, 1e-38, 1/2, 1 − 2⁻²⁴",
        "in range and of unit length",
        Figure::none_of(wrong, 5 * 16),
    );
    let mut largest = 0f32;
    let mut most = 0;
    for first in (0..1u32 << 16).step_by(LANES) {
        for numbers in numbers(3, first, 0) {
            for u in numbers {
                largest = largest.max(u);
                most += u64::from(!(0.0..1.0).contains(&u));
            }
        }
    }
    trial.note(
        format!("largest of 2²⁰ numbers: 1 − {:e}", 1.0 - largest),
        "in [0, 1)",
        Figure::none_of(most, 1 << 20),
    );
    Ok(())
}
