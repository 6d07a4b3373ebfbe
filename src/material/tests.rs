//! Statistical and pointwise tests of all materials.

use std::f64::consts::{FRAC_PI_2, PI};

use super::*;
use crate::math::LANES;
use crate::math::testing::{
    ChiSquared, DirectionBins, Mean, Uniform, direction, first, outgoing, splat,
};

/// Outgoing angles in degrees: normal incidence to grazing.
const ANGLES: [f64; 5] = [0.0, 30.0, 60.0, 85.0, 89.9];
const SIGMAS: [f64; 4] = [0.0, 0.3, 0.7, f64::INFINITY];
const EXPONENTS: [f32; 5] = [0.0, 1.0, 10.0, 1e3, 1e6];
const WHITE: [f32; 3] = [1.0; 3];

/// Parameters of a material alone in its table.
fn params<M: Material>(spec: MaterialSpec) -> M::Params {
    let mut table = MaterialTable::default();
    // A neighbour, so that a wrong index shows.
    table.push(MaterialSpec::Phong {
        reflectance: [0.1, 0.2, 0.3],
        exponent: 7.0,
    });
    let index = table.push(spec);
    assert_eq!(table.kinds()[1], spec.kind());
    M::fetch(&table, U32s::splat(index))
}

fn lambertian() -> LambertianParams {
    params::<Lambertian>(MaterialSpec::Lambertian { reflectance: WHITE })
}

fn oren_nayar(sigma: f64) -> OrenNayarParams {
    params::<OrenNayar>(MaterialSpec::OrenNayar {
        reflectance: WHITE,
        sigma,
    })
}

fn phong(exponent: f32) -> PhongParams {
    params::<Phong>(MaterialSpec::Phong {
        reflectance: WHITE,
        exponent,
    })
}

fn glossy(diffuse: f32, specular: f32, exponent: f32) -> GlossyParams {
    params::<Glossy>(MaterialSpec::Glossy {
        diffuse: [diffuse; 3],
        specular: [specular; 3],
        exponent,
    })
}

fn dielectric(ior: f32, fresnel: FresnelFormula) -> DielectricParams {
    params::<Dielectric>(MaterialSpec::Dielectric { ior, fresnel })
}

/// What the sampling of a lobe does for one outgoing direction.
struct Sampled {
    /// Integral of the stated density.
    integral: f64,
    /// Mean of the weights, absorbed paths counting 0.
    albedo: Mean,
}

/// Samples `M` for `wo`: chi-squared test of the directions, weight against eval/pdf at each one.
///
/// `sharpness` is the exponent of a lobe about the mirror direction, 0 for a broad one: it magnifies
/// the rounding of wi in the density, d ln pdf = n·tan α·dα.
fn sample_many<M: Material>(
    params: &M::Params,
    wo: [f64; 3],
    bins: &DirectionBins,
    sharpness: f32,
    what: &str,
) -> Sampled {
    let mirror = [-wo[0], -wo[1], wo[2]];
    let mut random = Uniform::new(0x5eed);
    let mut counts = ChiSquared::new(bins);
    let mut albedo = Mean::default();
    let wo = splat(wo);
    for _ in 0..300_000 / LANES {
        let s = M::sample(params, wo, [random.lanes(), random.lanes(), random.lanes()]);
        counts.add(s.wi, s.valid);
        let (value, pdf) = M::eval(params, wo, s.wi);
        let wi = s.wi.to_lanes();
        for (lane, wi) in wi.into_iter().enumerate() {
            let at = |x: F32s| f64::from(x.to_array()[lane]);
            if !s.valid.test(lane) {
                albedo.add(0.0);
                continue;
            }
            albedo.add(at(s.weight.x));
            assert!(at(s.pdf) > 0.0 && at(s.pdf).is_finite(), "{what}");
            // 6e-7 is what the rounding of the lobe's frame and of wi comes to.
            let delta = (0..3).map(|k| (wi[k] - mirror[k]).powi(2)).sum::<f64>() / 2.0;
            let tan = (delta * (2.0 - delta)).sqrt() / (1.0 - delta);
            let rounding = if sharpness > 0.0 {
                6e-7 * f64::from(sharpness) * tan
            } else {
                0.0
            };
            let difference = (at(pdf) / at(s.pdf) - 1.0).abs();
            assert!(
                difference < 2e-6 + rounding,
                "{what}: pdf {} when sampled, {} when evaluated",
                at(s.pdf),
                at(pdf)
            );
            let ratio = at(value.x) / at(pdf);
            assert!(
                (ratio / at(s.weight.x) - 1.0).abs() < 1e-5,
                "{what}: weight {} against {ratio}",
                at(s.weight.x)
            );
        }
    }
    let integral = counts.check(&|wi| M::eval(params, wo, wi).1, what);
    Sampled { integral, albedo }
}

fn hemisphere() -> DirectionBins {
    DirectionBins::new([0.0, 0.0, 1.0], 1.0)
}

/// Directional albedo of Oren–Nayar at ρ = 1, in closed form.
fn oren_nayar_albedo(sigma: f64, degrees: f64) -> f64 {
    let [a, b] = oren_nayar::parameters(sigma).map(f64::from);
    let theta = degrees.to_radians();
    let (s, c) = theta.sin_cos();
    a + 2.0 * b / PI * (s * (theta - s * c) / 2.0 + s * c * (1.0 + s + s * s) / (3.0 * (1.0 + s)))
}

#[test]
fn lambertian_samples_follow_the_density_and_return_the_albedo() {
    for angle in ANGLES {
        let s = sample_many::<Lambertian>(
            &lambertian(),
            outgoing(angle),
            &hemisphere(),
            0.0,
            "Lambertian",
        );
        assert!((s.integral - 1.0).abs() < 1e-5);
        assert_eq!(s.albedo.mean(), 1.0);
    }
}

#[test]
fn oren_nayar_samples_follow_the_density_and_return_the_albedo() {
    for sigma in SIGMAS {
        for angle in ANGLES {
            let what = format!("Oren–Nayar σ = {sigma}, {angle}°");
            let s = sample_many::<OrenNayar>(
                &oren_nayar(sigma),
                outgoing(angle),
                &hemisphere(),
                0.0,
                &what,
            );
            assert!((s.integral - 1.0).abs() < 1e-5, "{what}");
            s.albedo.check(oren_nayar_albedo(sigma, angle), &what);
        }
    }
}

/// Bins that resolve a Phong lobe, and hold all of it but e⁻²⁵.
fn phong_bins(exponent: f32, wo: [f64; 3]) -> DirectionBins {
    if exponent <= 10.0 {
        return hemisphere();
    }
    DirectionBins::new([-wo[0], -wo[1], wo[2]], 25.0 / f64::from(exponent))
}

#[test]
fn phong_samples_follow_the_density() {
    for exponent in EXPONENTS {
        for angle in ANGLES {
            let what = format!("Phong n = {exponent}, {angle}°");
            let wo = outgoing(angle);
            let s = sample_many::<Phong>(
                &phong(exponent),
                wo,
                &phong_bins(exponent, wo),
                exponent,
                &what,
            );
            assert!(s.integral < 1.0 + 1e-4, "{what}: {}", s.integral);
            // Nothing is cut off where the lobe is far above the horizon.
            if angle == 0.0 || angle <= 60.0 && exponent >= 1e3 {
                assert!((s.integral - 1.0).abs() < 1e-4, "{what}: {}", s.integral);
            }
        }
    }
}

#[test]
#[expect(
    clippy::approx_constant,
    reason = "the table's numbers are what they are"
)]
fn phong_albedo_is_that_of_the_table() {
    // Quadrature to 1e-10, reflectance 1; angles 0, 30, 45, 60, 75, 85, 90 degrees.
    let table: [(f32, [f64; 7]); 5] = [
        (
            1.0,
            [
                1.0, 0.880843, 0.755409, 0.608998, 0.458442, 0.363097, 0.318310,
            ],
        ),
        (
            5.0,
            [
                1.0, 0.866254, 0.710393, 0.519407, 0.327132, 0.216561, 0.169765,
            ],
        ),
        (
            10.0,
            [
                1.0, 0.866029, 0.707374, 0.504736, 0.291901, 0.171275, 0.123047,
            ],
        ),
        (
            50.0,
            [
                1.0, 0.866025, 0.707107, 0.500002, 0.260465, 0.110063, 0.056138,
            ],
        ),
        (
            1000.0,
            [
                1.0, 0.866025, 0.707107, 0.500000, 0.258819, 0.087183, 0.012613,
            ],
        ),
    ];
    for (exponent, row) in table {
        for (angle, exact) in [0.0, 30.0, 45.0, 60.0, 75.0, 85.0, 90.0]
            .into_iter()
            .zip(row)
        {
            let wo = outgoing(angle);
            let bins = phong_bins(exponent, wo);
            let what = format!("Phong n = {exponent}, {angle}°");
            let s = sample_many::<Phong>(&phong(exponent), wo, &bins, exponent, &what);
            s.albedo.check(exact, &what);
        }
    }
}

/// Weights of the diffuse part and the lobe.
const MIXTURES: [[f32; 2]; 4] = [[0.5, 0.5], [0.9, 0.05], [0.0, 1.0], [0.3, 0.0]];

#[test]
fn glossy_samples_follow_the_density_of_both_parts() {
    // Bins of the hemisphere resolve lobes of these exponents.
    for exponent in [0.0, 1.0, 10.0] {
        for [diffuse, specular] in MIXTURES {
            for angle in ANGLES {
                let what = format!("glossy {diffuse} + {specular}, n = {exponent}, {angle}°");
                let p = glossy(diffuse, specular, exponent);
                let wo = outgoing(angle);
                // Its samples are evaluated as any direction is: rounding of wi changes nothing.
                let s = sample_many::<Glossy>(&p, wo, &hemisphere(), 0.0, &what);
                assert!(s.integral < 1.0 + 1e-4, "{what}: {}", s.integral);
                // What is missing is the part of the lobe below the surface. For n = 0 that is a lune
                // of known size, on whose edge the density jumps, which quadrature sees to a bin.
                let (above, tolerance) = if exponent == 0.0 {
                    (1.0 - angle / 180.0, 1e-3)
                } else {
                    let pdf = |wi| Phong::eval(&phong(exponent), splat(wo), wi).1;
                    (hemisphere().total(&pdf), 2e-4)
                };
                let share = f64::from(specular / (diffuse + specular));
                let expected = 1.0 - share + share * above;
                assert!(
                    (s.integral - expected).abs() < tolerance,
                    "{what}: {}",
                    s.integral
                );
            }
        }
    }
}

#[test]
fn glossy_is_the_sum_of_its_parts_and_reflects_their_albedos() {
    for exponent in EXPONENTS {
        for [diffuse, specular] in MIXTURES {
            let (both, lobe) = (glossy(diffuse, specular, exponent), phong(exponent));
            let mut random = Uniform::new(31);
            for angle in ANGLES {
                let wo = outgoing(angle);
                let mut difference = Mean::default();
                for _ in 0..20_000 / LANES {
                    let u = [random.lanes(), random.lanes(), random.lanes()];
                    let s = Glossy::sample(&both, splat(wo), u);
                    let wi = if s.valid.any() { s.wi } else { splat(wo) };
                    let value = first(Glossy::eval(&both, splat(wo), wi).0.x);
                    let parts = f64::from(diffuse)
                        * first(Lambertian::eval(&lambertian(), splat(wo), wi).0.x)
                        + f64::from(specular) * first(Phong::eval(&lobe, splat(wo), wi).0.x);
                    assert!(
                        (value - parts).abs() <= 1e-6 * parts + 1e-30,
                        "{value}, {parts}"
                    );
                    // Its weights against those of its parts, on the same numbers.
                    let matte = Lambertian::sample(&lambertian(), splat(wo), u);
                    let gloss = Phong::sample(&lobe, splat(wo), u);
                    for lane in 0..LANES {
                        let weight = |s: &BsdfSample| {
                            let weight = f64::from(s.weight.x.to_array()[lane]);
                            if s.valid.test(lane) { weight } else { 0.0 }
                        };
                        // No weight is large: the greater albedo of the two over its own share.
                        assert!(weight(&s) <= 2.0 * f64::from(diffuse + specular) + 1e-5);
                        let parts = f64::from(diffuse) * weight(&matte)
                            + f64::from(specular) * weight(&gloss);
                        // About 1, so that rounding is relative to all of the light.
                        difference.add(1.0 + weight(&s) - parts);
                    }
                }
                let what = format!("glossy {diffuse} + {specular}, n = {exponent}, {angle}°");
                difference.check(1.0, &what);
            }
        }
    }
}

#[test]
fn textures_tint_reflectance_and_the_diffuse_part_of_glossy_surfaces() {
    let by = Vec3s::splat([0.5, 0.25, 0.0]);
    fn tinted<M: Material>(spec: MaterialSpec, by: Vec3s) -> M::Params {
        let mut p = params::<M>(spec);
        M::tint(&mut p, by);
        p
    }
    let reflectance = [0.8, 0.4, 0.2];
    let expected = Vec3s::splat(reflectance).mul_elem(by).to_lanes()[0];
    let spec = MaterialSpec::Lambertian { reflectance };
    assert_eq!(
        tinted::<Lambertian>(spec, by).reflectance.to_lanes()[0],
        expected
    );
    let spec = MaterialSpec::OrenNayar {
        reflectance,
        sigma: 0.3,
    };
    assert_eq!(
        tinted::<OrenNayar>(spec, by).reflectance.to_lanes()[0],
        expected
    );
    let spec = MaterialSpec::Mirror { reflectance };
    assert_eq!(
        tinted::<Mirror>(spec, by).reflectance.to_lanes()[0],
        expected
    );
    let spec = MaterialSpec::Phong {
        reflectance,
        exponent: 3.0,
    };
    assert_eq!(
        tinted::<Phong>(spec, by).reflectance.to_lanes()[0],
        expected
    );
    let p = tinted::<Glossy>(
        MaterialSpec::Glossy {
            diffuse: reflectance,
            specular: [0.1; 3],
            exponent: 3.0,
        },
        by,
    );
    assert_eq!(p.diffuse.to_lanes()[0], expected);
    assert_eq!(p.specular.to_lanes()[0], [0.1f32; 3].map(f64::from));
    let clear = dielectric(1.5, FresnelFormula::Exact);
    let spec = MaterialSpec::Dielectric {
        ior: 1.5,
        fresnel: FresnelFormula::Exact,
    };
    assert_eq!(first(tinted::<Dielectric>(spec, by).ior), first(clear.ior));
}

#[test]
fn zero_spread_is_lambertian_to_the_last_bit() {
    let mut random = Uniform::new(21);
    let (rough, smooth) = (oren_nayar(0.0), lambertian());
    for _ in 0..10_000 {
        let wo = splat(direction(random.next(), 6.0 * random.next()));
        let wi = splat(direction(2.0 * random.next() - 1.0, 6.0 * random.next()));
        let (a, b) = (
            OrenNayar::eval(&rough, wo, wi),
            Lambertian::eval(&smooth, wo, wi),
        );
        assert_eq!(
            (a.0.to_lanes(), a.1.to_array()),
            (b.0.to_lanes(), b.1.to_array())
        );
        let u = [random.lanes(), random.lanes(), random.lanes()];
        let (a, b) = (
            OrenNayar::sample(&rough, wo, u),
            Lambertian::sample(&smooth, wo, u),
        );
        assert_eq!(
            (a.wi.to_lanes(), a.weight.to_lanes()),
            (b.wi.to_lanes(), b.weight.to_lanes())
        );
    }
}

#[test]
fn oren_nayar_constants_and_values_match_the_trigonometric_formula() {
    for (sigma, a, b) in [
        (0.0, 1.0, 0.0),
        (0.3, 0.892857, 0.225000),
        (0.5, 0.784483, 0.330882),
        (0.7, 0.701220, 0.380172),
        (1.0, 0.624060, 0.412844),
        (1e200, 0.5, 0.45),
        (f64::INFINITY, 0.5, 0.45),
    ] {
        let [got_a, got_b] = oren_nayar::parameters(sigma).map(f64::from);
        assert!(
            (got_a - a).abs() < 1e-6 && (got_b - b).abs() < 1e-6,
            "σ = {sigma}: {got_a}, {got_b}"
        );
    }
    let mut random = Uniform::new(22);
    for i in 0..20_000 {
        let sigma = [1e-6, 0.3, 0.5745, 1.0, 1e3, f64::INFINITY][i % 6];
        let theta = |random: &mut Uniform| (random.next() * FRAC_PI_2).min(89.999f64.to_radians());
        let (o, i) = (theta(&mut random), theta(&mut random));
        let turn = 6.0 * random.next();
        let p = oren_nayar(sigma);
        let (value, _) = OrenNayar::eval(
            &p,
            splat(direction(o.cos(), 0.0)),
            splat(direction(i.cos(), turn)),
        );
        let shape = first(p.a) + first(p.b) * turn.cos().max(0.0) * o.max(i).sin() * o.min(i).tan();
        let exact = shape * i.cos() / PI;
        // f·cos is at most 1/π; its rounding is absolute where cosines are tiny.
        assert!(
            (first(value.x) - exact).abs() < 4e-7 * (exact + 0.3),
            "{} for {exact}",
            first(value.x)
        );
    }
}

#[test]
fn no_direction_reflects_more_than_it_receives() {
    // At 89.9° the integrand has a kink that quadrature misses; there the sampling tests above
    // compare with the closed form.
    for angle in (0..90).step_by(3).map(f64::from) {
        for sigma in [0.0, 0.1, 0.1987, 0.3, 0.3261, 0.5, 0.7, f64::INFINITY] {
            let wo = splat(outgoing(angle));
            let p = oren_nayar(sigma);
            let albedo = hemisphere().total(&|wi| OrenNayar::eval(&p, wo, wi).0.x);
            let exact = oren_nayar_albedo(sigma, angle);
            assert!(
                (albedo - exact).abs() < 2e-4,
                "σ = {sigma}, {angle}°: {albedo}, closed form {exact}"
            );
            let bound = if sigma > 0.0 && sigma < 0.3261 {
                1.0152
            } else {
                1.0
            };
            assert!(albedo < bound + 2e-4, "σ = {sigma}, {angle}°: {albedo}");
        }
        for exponent in [0.0, 1.0, 10.0, 100.0] {
            let wo = outgoing(angle);
            let p = phong(exponent);
            let albedo = phong_bins(exponent, wo).total(&|wi| Phong::eval(&p, splat(wo), wi).0.x);
            assert!(albedo < 1.0 + 1e-4, "n = {exponent}, {angle}°: {albedo}");
        }
    }
}

/// f(wo, wi)·cos wi·cos wo is the same with the directions exchanged.
fn check_reciprocity<M: Material>(params: &M::Params, tolerance: f64, what: &str) {
    let mut random = Uniform::new(23);
    for _ in 0..20_000 {
        // The square brings half of the directions to within 15° of the horizon.
        let mut any = || {
            direction(
                random.next().powi(2).max(1e-5),
                std::f64::consts::TAU * random.next(),
            )
        };
        let (wo, wi) = (splat(any()), splat(any()));
        let there = first(M::eval(params, wo, wi).0.x) * first(wo.z);
        let back = first(M::eval(params, wi, wo).0.x) * first(wi.z);
        // The tail of a sharp lobe ends in subnormal numbers, which have fewer digits.
        let difference = (there - back).abs() - f64::from(f32::MIN_POSITIVE);
        assert!(
            difference <= tolerance * there.max(back),
            "{what}: {there} and {back}"
        );
    }
}

#[test]
fn reflection_is_reciprocal() {
    check_reciprocity::<Lambertian>(&lambertian(), 1e-6, "Lambertian");
    for sigma in SIGMAS {
        check_reciprocity::<OrenNayar>(&oren_nayar(sigma), 1e-6, "Oren–Nayar");
    }
    for exponent in [0.0, 1.0, 10.0, 100.0] {
        check_reciprocity::<Phong>(&phong(exponent), 1e-6, "Phong");
        check_reciprocity::<Glossy>(&glossy(0.4, 0.6, exponent), 1e-6, "glossy");
    }
}

#[test]
fn reflecting_materials_are_dark_below_the_surface() {
    fn check<M: Material>(params: &M::Params) {
        for z in [-1.0, -0.5, -1e-7] {
            let (value, pdf) = M::eval(params, splat(outgoing(40.0)), splat(direction(z, 4.0)));
            assert_eq!(
                (first(value.x), first(value.y), first(value.z), first(pdf)),
                (0.0, 0.0, 0.0, 0.0)
            );
        }
    }
    check::<Lambertian>(&lambertian());
    check::<OrenNayar>(&oren_nayar(0.5));
    check::<Phong>(&phong(0.0));
    check::<Phong>(&phong(50.0));
    check::<Glossy>(&glossy(0.4, 0.6, 0.0));
    check::<Glossy>(&glossy(0.0, 0.6, 50.0));
}

#[test]
fn reflectance_scales_each_channel() {
    let reflectance = [0.25, 0.5, 1.0];
    let wo = splat(outgoing(20.0));
    let u = [0.3, 0.6, 0.9].map(F32s::splat);
    let weights = [
        Lambertian::sample(
            &params::<Lambertian>(MaterialSpec::Lambertian { reflectance }),
            wo,
            u,
        )
        .weight,
        OrenNayar::sample(
            &params::<OrenNayar>(MaterialSpec::OrenNayar {
                reflectance,
                sigma: 0.4,
            }),
            wo,
            u,
        )
        .weight,
        Phong::sample(
            &params::<Phong>(MaterialSpec::Phong {
                reflectance,
                exponent: 20.0,
            }),
            wo,
            u,
        )
        .weight,
        Mirror::sample(
            &params::<Mirror>(MaterialSpec::Mirror { reflectance }),
            wo,
            u,
        )
        .weight,
    ];
    for weight in weights {
        assert_eq!(first(weight.y) / first(weight.x), 2.0);
        assert_eq!(first(weight.z) / first(weight.y), 2.0);
    }
}

#[test]
fn black_absorbs_and_mirror_reflects_about_the_normal() {
    let wo = splat([0.48, -0.36, 0.8]);
    let u = [F32s::splat(0.5); 3];
    assert_eq!(Black::sample(&(), wo, u).valid, Mask::NONE);
    let s = Mirror::sample(
        &params::<Mirror>(MaterialSpec::Mirror { reflectance: WHITE }),
        wo,
        u,
    );
    let wi = s.wi.to_lanes()[0];
    for (got, exact) in wi.into_iter().zip([-0.48, 0.36, 0.8]) {
        assert!((got - exact).abs() < 1e-7);
    }
    assert_eq!((first(s.pdf), first(s.eta), s.valid), (0.0, 1.0, Mask::ALL));
}

#[test]
fn kinds_name_their_kernels() {
    let specular: Vec<_> = MaterialKind::ALL
        .into_iter()
        .filter(|kind| kind.is_specular())
        .collect();
    assert_eq!(
        specular,
        [
            MaterialKind::Black,
            MaterialKind::Mirror,
            MaterialKind::Dielectric
        ]
    );
}

/// Exact reflectance in f64 at the cosine on the side of the ray, η = n_t/n_i.
fn fresnel(eta: f64, cos: f64) -> f64 {
    let sin2_t = (1.0 - cos * cos) / (eta * eta);
    if sin2_t >= 1.0 {
        return 1.0;
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let s = (1.0 - eta * eta) / (cos + eta * cos_t).powi(2);
    let p = (eta * eta - 1.0) * (cos * cos - sin2_t) / (eta * cos + cos_t).powi(2);
    0.5 * (s * s + p * p)
}

fn reflectance(p: &DielectricParams, cos: f64) -> f64 {
    1.0 - first(Dielectric::transmittance(p, F32s::splat(cos as f32)))
}

#[test]
fn reflectance_is_that_of_the_tables_on_both_sides() {
    let angles = [0.0f64, 30.0, 45.0, 60.0, 70.0, 75.0, 80.0, 85.0, 89.0];
    let rows: [(f32, FresnelFormula, [f64; 9]); 4] = [
        (
            1.5,
            FresnelFormula::Exact,
            [
                0.040000, 0.041523, 0.050240, 0.089187, 0.171043, 0.253061, 0.387704, 0.612800,
                0.904185,
            ],
        ),
        (
            1.5,
            FresnelFormula::Schlick,
            [
                0.040000, 0.040041, 0.042069, 0.070000, 0.158395, 0.254730, 0.409910, 0.648492,
                0.919102,
            ],
        ),
        (
            1.75,
            FresnelFormula::Exact,
            [
                0.074380, 0.076222, 0.086214, 0.127579, 0.209007, 0.287919, 0.415530, 0.628299,
                0.907095,
            ],
        ),
        (
            1.75,
            FresnelFormula::Schlick,
            [
                0.074380, 0.074420, 0.076375, 0.103306, 0.188535, 0.281420, 0.431043, 0.661080,
                0.921999,
            ],
        ),
    ];
    for (ior, formula, row) in rows {
        let p = dielectric(ior, formula);
        for (angle, exact) in angles.into_iter().zip(row) {
            let outside = angle.to_radians();
            let inside_cos = (1.0 - (outside.sin() / f64::from(ior)).powi(2)).sqrt();
            // Inside, rounding of the cosine and of its square moves c_t by n²·(c/c_t)·1e-7 at most,
            // and |dR/dc_t| ≤ 6.
            let magnified = f64::from(ior).powi(2) * inside_cos / outside.cos() * 1e-7 * 6.0;
            for (cos, tolerance) in [(outside.cos(), 2e-6), (-inside_cos, 2e-6 + magnified)] {
                let got = reflectance(&p, cos);
                assert!(
                    (got - exact).abs() < tolerance,
                    "n = {ior}, {formula:?}, {angle}°, cos {cos}: {got}"
                );
            }
        }
    }
}

#[test]
fn reflectance_keeps_its_precision_where_the_indices_almost_agree() {
    for exponent in 1..=6 {
        let n = (1.0 + 10f64.powi(-exponent)) as f32;
        for angle in [0.0f64, 60.0, 85.0] {
            // The cosine as f32 sees it.
            let cos = f64::from(angle.to_radians().cos() as f32);
            let p = dielectric(n, FresnelFormula::Exact);
            let got = first(
                Dielectric::branches(&p, splat([(1.0 - cos * cos).sqrt(), 0.0, cos])).reflectance,
            );
            let exact = fresnel(f64::from(n), cos);
            assert!(
                (got / exact - 1.0).abs() < 1e-5,
                "n = {n}, {angle}°: {got}, exact {exact}"
            );
        }
    }
    let wo = splat([0.48, -0.36, 0.8]);
    for formula in [FresnelFormula::Exact, FresnelFormula::Schlick] {
        let b = Dielectric::branches(&dielectric(1.0, formula), wo);
        for (got, exact) in b.refracted.to_lanes()[0].into_iter().zip(wo.to_lanes()[0]) {
            assert!((got + exact).abs() < 1e-7, "{formula:?}");
        }
    }
    let same = dielectric(1.0, FresnelFormula::Exact);
    assert_eq!(first(Dielectric::branches(&same, wo).reflectance), 0.0);
}

/// Every lane is finite, of unit length and not negative, for the uniform numbers at their ends.
fn check_ends<M: Material>(params: &M::Params, signs: &[f64], what: &str) {
    const ENDS: [f32; 4] = [0.0, 1.0 / 16_777_216.0, 0.5, 1.0 - 1.0 / 16_777_216.0];
    for (i, angle) in (0..64).flat_map(|i| ANGLES.map(|angle| (i, angle))) {
        let u = [ENDS[i % 4], ENDS[i / 4 % 4], ENDS[i / 16]].map(F32s::splat);
        for sign in signs {
            let [x, y, z] = outgoing(angle);
            let s = M::sample(params, splat([x, y, z * sign]), u);
            let wi = s.wi.to_lanes()[0];
            let length: f64 = wi.iter().map(|x| x * x).sum();
            assert!(
                (length - 1.0).abs() < 2e-6,
                "{what}, {angle}°, {u:?}: {wi:?}"
            );
            let weight = first(s.weight.x);
            assert!(
                !s.valid.any() || weight >= 0.0 && weight.is_finite(),
                "{what}: {weight}"
            );
            assert!(first(s.pdf) >= 0.0 && first(s.pdf).is_finite(), "{what}");
        }
    }
}

#[test]
fn samples_are_sound_at_the_ends_of_the_unit_interval() {
    check_ends::<Lambertian>(&lambertian(), &[1.0], "Lambertian");
    for sigma in SIGMAS {
        check_ends::<OrenNayar>(&oren_nayar(sigma), &[1.0], "Oren–Nayar");
    }
    for exponent in EXPONENTS {
        check_ends::<Phong>(&phong(exponent), &[1.0], "Phong");
        for [diffuse, specular] in MIXTURES {
            check_ends::<Glossy>(&glossy(diffuse, specular, exponent), &[1.0], "glossy");
        }
        check_ends::<Glossy>(&glossy(0.0, 0.0, exponent), &[1.0], "black glossy");
    }
    for formula in [FresnelFormula::Exact, FresnelFormula::Schlick] {
        for ior in [1.0, 1.5, 0.7] {
            check_ends::<Dielectric>(&dielectric(ior, formula), &[1.0, -1.0], "dielectric");
        }
    }
}

#[test]
fn refraction_obeys_snell_and_shares_all_energy() {
    let mut random = Uniform::new(24);
    for i in 0..60_000 {
        let ior = [1.5f32, 1.75, 2.4, 1.0 / 1.5, 1.0001, 1.33][i % 6];
        let formula = if i % 4 < 2 {
            FresnelFormula::Exact
        } else {
            FresnelFormula::Schlick
        };
        let p = dielectric(ior, formula);
        // Cosines from 1 down to 1e-7, from both sides.
        let cos = 10f64.powf(-7.0 * random.next().powi(2)) * if i % 2 == 0 { 1.0 } else { -1.0 };
        let wo = splat(direction(cos, 6.0 * random.next()));
        let b = Dielectric::branches(&p, wo);
        let r = first(b.reflectance);
        assert!((0.0..=1.0).contains(&r));
        let eta = if cos > 0.0 {
            f64::from(ior)
        } else {
            1.0 / f64::from(ior)
        };
        assert!((first(b.eta) / eta - 1.0).abs() < 1e-6);
        assert!((r + first(b.transmission_weight) * eta * eta - 1.0).abs() < 1e-6);
        let wo = wo.to_lanes()[0];
        let cos2_t = 1.0 - (1.0 - wo[2] * wo[2]) / (eta * eta);
        if cos2_t < -1e-6 {
            assert_eq!((r, first(b.transmission_weight)), (1.0, 0.0));
        }
        if cos2_t > 1e-6 {
            let wi = b.refracted.to_lanes()[0];
            let tolerance = if cos2_t < 1e-2 { 1e-4 } else { 2e-6 };
            let exact = -cos2_t.sqrt() * wo[2].signum();
            assert!(
                (wi[2] - exact).abs() < tolerance,
                "n = {ior}, cos {cos}: {} against {exact}",
                wi[2]
            );
            for k in 0..2 {
                assert!((wi[k] + wo[k] / eta).abs() < 1e-6, "n = {ior}: {wi:?}");
            }
            let length: f64 = wi.iter().map(|x| x * x).sum();
            assert!((length - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn total_reflection_begins_at_the_critical_angle() {
    for ior in [1.5f32, 1.75, 2.4] {
        for formula in [FresnelFormula::Exact, FresnelFormula::Schlick] {
            let p = dielectric(ior, formula);
            let critical = (1.0 - 1.0 / f64::from(ior).powi(2)).sqrt();
            for (shift, total) in [(-1e-3, true), (-1e-6, true), (1e-6, false), (1e-3, false)] {
                let r = reflectance(&p, -(critical + shift));
                assert_eq!(r == 1.0, total, "n = {ior}, {formula:?}, {shift}: R = {r}");
                // From outside the same cosine is no special one.
                assert!(reflectance(&p, critical + shift) < 0.2);
            }
            for shift in [-1e-7, 0.0, 1e-7] {
                let r = reflectance(&p, -(critical + shift));
                assert!(r > 0.98 && r <= 1.0, "n = {ior}, {shift}: {r}");
            }
        }
    }
}

#[test]
fn branches_are_chosen_by_reflectance_and_keep_their_weights() {
    for (ior, cos) in [
        (1.5f32, 0.9),
        (1.5, 0.1),
        (1.5, -0.95),
        (1.75, -0.85),
        (1.5, -0.5),
    ] {
        let p = dielectric(ior, FresnelFormula::Exact);
        let wo = splat(direction(cos, 1.0));
        let b = Dielectric::branches(&p, wo);
        let mut random = Uniform::new(25);
        let (mut reflected, mut transmitted) = (Mean::default(), Mean::default());
        for _ in 0..200_000 / LANES {
            let s = Dielectric::sample(&p, wo, [random.lanes(), random.lanes(), random.lanes()]);
            assert_eq!(s.valid, Mask::ALL);
            let wi = s.wi.to_lanes();
            for (lane, wi) in wi.into_iter().enumerate() {
                let same_side = wi[2] * cos > 0.0;
                let weight = f64::from(s.weight.x.to_array()[lane]);
                reflected.add(if same_side { weight } else { 0.0 });
                transmitted.add(if same_side { 0.0 } else { weight });
                let eta = f64::from(s.eta.to_array()[lane]);
                assert_eq!(eta, if same_side { 1.0 } else { first(b.eta) });
                assert_eq!(f64::from(s.pdf.to_array()[lane]), 0.0);
                let branch = if same_side { b.reflected } else { b.refracted };
                assert_eq!(wi, branch.to_lanes()[0]);
            }
        }
        reflected.check(first(b.reflectance), "reflected");
        transmitted.check(first(b.transmission_weight), "transmitted");
        assert!((first(b.reflectance) - fresnel(first(b.eta), cos.abs())).abs() < 2e-6);
    }
}

#[test]
fn hemispherical_means_of_the_reflectance_match_their_closed_forms() {
    // ∫ R(c)·2c dc by midpoints over c².
    let mean = |p: &DielectricParams, sign: f64| {
        let n = 20_000;
        (0..n)
            .map(|i| reflectance(p, sign * ((f64::from(i) + 0.5) / f64::from(n)).sqrt()))
            .sum::<f64>()
            / f64::from(n)
    };
    for (ior, outside, inside, schlick) in [
        (1.5, 0.09177796, 0.59634576, 0.08571429),
        (1.75, 0.12722765, 0.71501311, 0.11845730),
    ] {
        let exact = dielectric(ior, FresnelFormula::Exact);
        assert!((mean(&exact, 1.0) - outside).abs() < 1e-5);
        assert!((mean(&exact, -1.0) - inside).abs() < 1e-4);
        assert!((mean(&dielectric(ior, FresnelFormula::Schlick), 1.0) - schlick).abs() < 1e-5);
    }
}
