//! Glass: grazing light, indices next to one another, total reflection, thin and nested bodies.

use std::f64::consts::PI;

use glam::DVec3;

use super::oracles;
use super::renders::{STRATEGIES, endless, kind, max_or_nan, path, whitted};
use super::scenes::{SceneBuilder, glass};
use super::trial::{Figure, Trial};
use crate::error::Result;
use crate::material::{
    Dielectric, DielectricBranches, DielectricParams, FresnelFormula, Material, MaterialSpec,
    MaterialTable,
};
use crate::math::testing::{Uniform, direction, splat};
use crate::math::{F32s, U32s};
use crate::scene::{BsdfDescription, Budget, RenderSettings, SceneDescription, Strategy};

fn params(ior: f32, fresnel: FresnelFormula) -> DielectricParams {
    let mut table = MaterialTable::default();
    let index = table.push(MaterialSpec::Dielectric { ior, fresnel });
    Dielectric::fetch(&table, U32s::splat(index))
}

fn first(x: F32s) -> f64 {
    f64::from(x.to_array()[0])
}

/// A look at a boundary of index `ior` at this cosine to its outward normal, negative from inside.
struct Look {
    branches: DielectricBranches,
    /// n_t/n_i.
    eta: f64,
    /// The cosine as rounded to f32.
    cos: f64,
}

impl Look {
    fn new(ior: f32, fresnel: FresnelFormula, cos: f64) -> Self {
        let wo = splat(direction(cos, 1.0));
        let ior_wide = f64::from(ior);
        Self {
            branches: Dielectric::branches(&params(ior, fresnel), wo),
            eta: if cos > 0.0 { ior_wide } else { 1.0 / ior_wide },
            cos: wo.to_lanes()[0][2].abs(),
        }
    }

    fn reflectance(&self) -> f64 {
        first(self.branches.reflectance)
    }

    /// |R + T − 1|, and how far either is outside of [0, 1].
    fn energy_error(&self) -> f64 {
        let (r, t) = (
            self.reflectance(),
            first(self.branches.transmission_weight) * self.eta * self.eta,
        );
        (r + t - 1.0).abs().max(-r).max(r - 1.0).max(-t)
    }

    /// Squared cosine on the far side.
    fn cos2_t(&self) -> f64 {
        1.0 - (1.0 - self.cos * self.cos) / (self.eta * self.eta)
    }
}

/// Cosine on the far side below which a look counts as next to the critical angle: there the root
/// magnifies roundings of n²·cos² by more than their half over this.
const NEAR_CRITICAL: f64 = 0.5;

pub(super) fn total_reflection(trial: &mut Trial<'_>) -> Result<()> {
    let count = trial.count(100_000);
    for ior in [1.5f32, 1.75, 2.4, 3.0, 1.0 / 1.5] {
        let mut random = Uniform::new(24);
        let (mut energy, mut cos_near, mut cos_far) = (0.0, 0.0, 0.0);
        let mut wrong = 0;
        for i in 0..count {
            // From 1 down to 10⁻⁷, from both sides.
            let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
            let look = Look::new(
                ior,
                FresnelFormula::Exact,
                sign * 10f64.powf(-7.0 * random.next().powi(2)),
            );
            energy = max_or_nan(energy, look.energy_error());
            let cos2_t = look.cos2_t();
            if cos2_t > 0.0 {
                let error = (first(look.branches.refracted.z).abs() - cos2_t.sqrt()).abs();
                if cos2_t < NEAR_CRITICAL * NEAR_CRITICAL {
                    cos_near = max_or_nan(cos_near, if cos2_t > 1e-6 { error } else { 0.0 });
                } else {
                    cos_far = max_or_nan(cos_far, error);
                }
            } else if cos2_t < -1e-6 {
                let t = first(look.branches.transmission_weight);
                wrong += u64::from(look.reflectance() != 1.0 || t != 0.0);
            }
        }
        let label = format!("n = {ior:.4}, cosines 1 to 1e-7");
        trial.note(&*label, "R + T = 1", Figure::absolute(energy, 1e-6, count));
        trial.note(
            &*label,
            "R = 1 beyond critical angle",
            Figure::none_of(wrong, count),
        );
        trial.note(
            &*label,
            "Snell in f64, near critical",
            Figure::absolute(cos_near, 1e-4, count),
        );
        trial.note(
            &*label,
            "Snell in f64, elsewhere",
            Figure::absolute(cos_far, 1e-6, count),
        );
    }
    let mut energy = 0.0;
    for ior in [1.5f32, 1.75, 2.4] {
        let critical = (1.0 - 1.0 / f64::from(ior).powi(2)).sqrt();
        for shift in [-1e-7, -6e-8, 0.0, 6e-8, 1e-7] {
            for fresnel in [FresnelFormula::Exact, FresnelFormula::Schlick] {
                let look = Look::new(ior, fresnel, -(critical + shift));
                energy = max_or_nan(energy, look.energy_error());
            }
        }
    }
    trial.note(
        "critical angle ± 1e-7",
        "R + T = 1",
        Figure::absolute(energy, 1e-6, 30),
    );
    Ok(())
}

pub(super) fn equal_indices(trial: &mut Trial<'_>) -> Result<()> {
    for exponent in 1..=6 {
        let ior = (1.0 + 10f64.powi(-exponent)) as f32;
        let mut worst = 0.0;
        for degrees in [0.0, 60.0, 85.0] {
            for sign in [1.0, -1.0] {
                let look = Look::new(
                    ior,
                    FresnelFormula::Exact,
                    sign * f64::to_radians(degrees).cos(),
                );
                let exact = fresnel_without_cancellation(look.eta, look.cos);
                if exact < 1.0 {
                    worst = max_or_nan(worst, (look.reflectance() / exact - 1.0).abs());
                }
            }
        }
        trial.note(
            format!("n − 1 = 1e-{exponent}, to 85°"),
            "Fresnel in f64",
            Figure::relative(worst, 1e-5, 6),
        );
    }
    let (mut bent, mut reflected) = (0.0, 0.0);
    for i in 1..=1_000 {
        let wo = splat(direction(f64::from(i) / 1_000.0, 1.0));
        let branches = Dielectric::branches(&params(1.0, FresnelFormula::Exact), wo);
        let turn = (branches.refracted + wo).length_squared();
        bent = max_or_nan(bent, first(turn).sqrt());
        reflected = max_or_nan(reflected, first(branches.reflectance));
    }
    trial.note(
        "n1 = n2",
        "direction unchanged",
        Figure::absolute(bent, 1.2e-7, 1_000),
    );
    trial.note("n1 = n2", "R = 0", Figure::absolute(reflected, 0.0, 1_000));
    Ok(())
}

/// Fresnel's reflectance by sums alone; the differences are given by n² − 1.
fn fresnel_without_cancellation(eta: f64, cos: f64) -> f64 {
    let eta2_minus_1 = (eta - 1.0) * (eta + 1.0);
    let cos2_t = (cos * cos + eta2_minus_1) / (eta * eta);
    if cos2_t <= 0.0 {
        return 1.0;
    }
    let cos_t = cos2_t.sqrt();
    let s = -eta2_minus_1 / (cos + eta * cos_t).powi(2);
    let p =
        eta2_minus_1 * (cos * cos - (1.0 - cos * cos) / (eta * eta)) / (eta * cos + cos_t).powi(2);
    0.5 * (s * s + p * p)
}

pub(super) fn schlick(trial: &mut Trial<'_>) -> Result<()> {
    // The approximation's own largest errors, entering and leaving.
    for (ior, documented) in [(1.5f32, 0.0357), (1.75, 0.0330)] {
        let mut worst = 0.0f64;
        for i in 1..10_000 {
            for sign in [1.0, -1.0] {
                let cos = sign * f64::from(i) / 10_000.0;
                let [approximate, exact] = [FresnelFormula::Schlick, FresnelFormula::Exact]
                    .map(|formula| Look::new(ior, formula, cos).reflectance());
                worst = max_or_nan(worst, (approximate - exact).abs());
            }
        }
        trial.note(
            format!("n = {ior}, in and out"),
            "exact Fresnel",
            // The documented figure is rounded to four digits.
            Figure::absolute(worst, documented + 5e-5, 20_000),
        );
    }
    Ok(())
}

pub(super) fn glass_sphere(trial: &mut Trial<'_>) -> Result<()> {
    let samples = trial.count(64);
    // Mean over the disc of the share that has left after so many surface events, n = 1.5.
    let table = [(1, 0.091778), (2, 0.927322), (3, 0.988506), (5, 0.998467)];
    for (size, far) in [(1e-6, 0.0), (1e-3, 0.0), (1.0, 0.0), (1e6, 0.0), (1.0, 1e6)] {
        let center = far * DVec3::new(1.0, -0.3, 0.7);
        let mut scene = SceneBuilder::new();
        let ball = scene.matter(glass(1.5));
        scene.sphere(center.to_array(), size, ball);
        scene.background(1.0);
        let at = |v: DVec3| (center + v * size).to_array();
        // So far away that the rays are as good as parallel; the window holds the disc and its corners.
        scene.window(
            at(DVec3::new(0.0, 0.0, 1e3)),
            at(DVec3::new(-1.0, 1.0, 0.0)),
            [2.0 * size, 0.0, 0.0],
            [0.0, -2.0 * size, 0.0],
        );
        let scene = scene.build();
        let mut worst = 0.0;
        let settings = |max_depth: u32| RenderSettings {
            budget: Budget::Samples(samples),
            block: samples.div_ceil(16).min(64) as u32,
            ..path(Strategy::Mis, max_depth)
        };
        for (events, disc) in table {
            let expected = 1.0 + (disc - 1.0) * PI / 4.0;
            let picture = trial.picture(&scene, [32, 32], &settings(events + 1))?;
            worst = max_or_nan(worst, picture.deviation(expected));
        }
        let label = format!("radius {size:e} at {far:e}");
        trial.note(
            &*label,
            "1, 2, 3 and 5 surface events",
            Figure::standard_errors(worst, 4 * 1_024 * samples),
        );
        trial.on_structures(label, "radiance 1 everywhere", |trial, structure| {
            let settings = RenderSettings {
                accel: kind(structure),
                budget: Budget::Samples(16),
                ..endless(Strategy::Mis)
            };
            let picture = trial.picture(&scene, [32, 32], &settings)?;
            // Factors of 1/η² and η² cancel along any path.
            Ok(Figure::relative(
                picture.worst_pixel(1.0),
                1e-5,
                picture.film.total_samples(),
            ))
        })?;
    }
    Ok(())
}

/// A plate of glass, this thick, seen at 60° over a wall that emits 1, all in units of `size`.
fn plate(thickness: f64, size: f64) -> SceneDescription {
    let mut scene = SceneBuilder::new();
    let clear = scene.matter(glass(1.5));
    let wall = scene.two_sided(BsdfDescription::Black, 1.0);
    scene.ceiling(20.0 * size, 0.0, clear);
    scene.floor(20.0 * size, thickness * size, clear);
    scene.floor(200.0 * size, -size, wall);
    let (sin, cos) = f64::to_radians(60.0).sin_cos();
    let at = [0.0, 0.0, thickness * size];
    scene.aim([sin * size, 0.0, (cos + thickness) * size], at);
    scene.build()
}

pub(super) fn thin_plates(trial: &mut Trial<'_>) -> Result<()> {
    let samples = trial.count(256);
    let expected = oracles::slab_transmittance(oracles::fresnel(1.5, 0.5));
    // Coordinates go to 200 sizes: 4e-4 is 2e-6 of them.
    for (thickness, size) in [
        (1e-1, 1.0),
        (1e-2, 1.0),
        (1e-3, 1.0),
        (4e-4, 1.0),
        (4e-5, 1.0),
        (4e-4, 1e-6),
        (4e-4, 1e6),
    ] {
        let label = format!("{:.0e} of coordinates, size {size:e}", thickness / 200.0);
        let scene = plate(thickness, size);
        trial.on_structures(label, "(1 − R)/(1 + R)", |trial, structure| {
            let settings = RenderSettings {
                accel: kind(structure),
                budget: Budget::Samples(samples),
                block: samples.div_ceil(16).min(64) as u32,
                ..endless(Strategy::Mis)
            };
            let picture = trial.picture(&scene, [16, 16], &settings)?;
            let taken = picture.film.total_samples();
            Ok(Figure::standard_errors(picture.deviation(expected), taken))
        })?;
    }
    Ok(())
}

pub(super) fn nested(trial: &mut Trial<'_>) -> Result<()> {
    let samples = trial.count(256);
    let settings = |strategy| RenderSettings {
        budget: Budget::Samples(samples),
        block: samples.div_ceil(16).min(64) as u32,
        roulette_depth: 40,
        ..endless(strategy)
    };
    // Lossless bodies in a uniform room are invisible: water in glass, a bubble in glass, a shell so
    // thin that both boundaries have the same radius but for 4e-5, a cube, and spheres that touch.
    let bodies: [(&str, &[(f64, f64)]); 4] = [
        ("water in glass", &[(1.0, 1.5), (0.7, 1.33 / 1.5)]),
        ("bubble in glass", &[(1.0, 1.5), (0.7, 1.0 / 1.5)]),
        ("shell of 4e-5", &[(1.0 + 4e-5, 1.5), (1.0, 1.0 / 1.5)]),
        (
            "four shells, n = 3",
            &[(1.0, 3.0), (0.8, 0.4), (0.6, 2.0), (0.4, 0.5)],
        ),
    ];
    for (name, spheres) in bodies {
        let mut scene = SceneBuilder::new();
        for &(radius, ior) in spheres {
            let body = scene.matter(glass(ior));
            scene.sphere([0.0; 3], radius, body);
        }
        scene.background(2.0);
        scene.window(
            [0.0, 0.3, 5.0],
            [-1.2, 1.2, 0.0],
            [2.4, 0.0, 0.0],
            [0.0, -2.4, 0.0],
        );
        let picture = trial.picture(&scene.build(), [32, 32], &settings(Strategy::Mis))?;
        let taken = picture.film.total_samples();
        trial.note(
            name,
            "invisible in uniform light",
            Figure::standard_errors(picture.deviation(2.0), taken),
        );
    }
    // A plate that lies on a wall that emits: of what the wall sends into it all comes out but what is
    // reflected back and absorbed.
    for gap in [1e-2, 1e-4, 1e-5] {
        let mut scene = SceneBuilder::new();
        let clear = scene.matter(glass(1.5));
        let wall = scene.two_sided(BsdfDescription::Black, 1.0);
        scene.floor(1.0, 0.0, wall);
        scene.ceiling(1.0, gap, clear);
        scene.floor(1.0, 0.1, clear);
        scene.aim([0.6, 0.0, 0.9], [0.0, 0.0, 0.1]);
        let expected = oracles::slab_transmittance(oracles::fresnel(1.5, 0.8));
        for strategy in STRATEGIES {
            let picture = trial.picture(&scene.build(), [16, 16], &settings(strategy))?;
            let taken = picture.film.total_samples();
            trial.note(
                format!("plate {gap:e} over a wall, {strategy:?}"),
                "(1 − R)/(1 + R)",
                Figure::standard_errors(picture.deviation(expected), taken),
            );
        }
        let both = RenderSettings {
            budget: Budget::Samples(4),
            ..whitted(60)
        };
        let picture = trial.picture(&scene.build(), [8, 8], &both)?;
        trial.note(
            format!("plate {gap:e} over a wall, Whitted"),
            "(1 − R)/(1 + R)",
            Figure::standard_errors(picture.deviation(expected), picture.film.total_samples()),
        );
    }
    Ok(())
}
