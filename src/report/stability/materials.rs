//! Materials over the whole range of their parameters, the lane code against f64.

use std::f64::consts::{FRAC_PI_2, PI};

use super::oracles;
use super::renders::{deviation, max_or_nan};
use super::trial::{Figure, Trial};
use crate::error::Result;
use crate::material::{
    Dielectric, FresnelFormula, Glossy, Lambertian, Material, MaterialSpec, MaterialTable,
    OrenNayar, Phong,
};
use crate::math::testing::{
    ChiSquared, DirectionBins, Mean, Uniform, direction, first, outgoing, splat,
};
use crate::math::{F32s, Frame, LANES, U32s, Vec3s};

const WHITE: [f32; 3] = [1.0; 3];
const SIGMAS: [f64; 10] = [
    0.0,
    1e-8,
    1e-6,
    0.3,
    0.5745,
    0.7,
    1.0,
    1e3,
    1e8,
    f64::INFINITY,
];
const EXPONENTS: [f32; 5] = [0.0, 1.0, 10.0, 1e3, 1e6];
/// Outgoing angles in degrees.
const ANGLES: [f64; 5] = [0.0, 30.0, 60.0, 85.0, 89.9];

fn fetch<M: Material>(spec: MaterialSpec) -> M::Params {
    let mut table = MaterialTable::default();
    let index = table.push(spec);
    M::fetch(&table, U32s::splat(index))
}

fn oren_nayar(sigma: f64) -> <OrenNayar as Material>::Params {
    let reflectance = WHITE;
    fetch::<OrenNayar>(MaterialSpec::OrenNayar { reflectance, sigma })
}

fn phong(exponent: f32) -> <Phong as Material>::Params {
    let reflectance = WHITE;
    fetch::<Phong>(MaterialSpec::Phong {
        reflectance,
        exponent,
    })
}

fn glossy_of(diffuse: f32, specular: f32, exponent: f32) -> <Glossy as Material>::Params {
    fetch::<Glossy>(MaterialSpec::Glossy {
        diffuse: [diffuse; 3],
        specular: [specular; 3],
        exponent,
    })
}

fn glossy(exponent: f32) -> <Glossy as Material>::Params {
    glossy_of(0.6, 0.4, exponent)
}

fn glass(ior: f32, fresnel: FresnelFormula) -> <Dielectric as Material>::Params {
    fetch::<Dielectric>(MaterialSpec::Dielectric { ior, fresnel })
}

const FORMULAS: [FresnelFormula; 2] = [FresnelFormula::Exact, FresnelFormula::Schlick];

/// From `low` to `high` > 0, evenly by their logarithm.
fn magnitude(random: &mut Uniform, low: f64, high: f64) -> f64 {
    low * (high / low).powf(random.next())
}

fn lambertian() -> <Lambertian as Material>::Params {
    fetch::<Lambertian>(MaterialSpec::Lambertian { reflectance: WHITE })
}

fn hemisphere() -> DirectionBins {
    DirectionBins::new([0.0, 0.0, 1.0], 1.0)
}

/// Bins that resolve a Phong lobe, and hold all of it but e⁻²⁵.
fn lobe_bins(exponent: f32, wo: [f64; 3]) -> DirectionBins {
    if exponent <= 10.0 {
        hemisphere()
    } else {
        let width = (25.0 / f64::from(exponent)).min(2.0);
        DirectionBins::new([-wo[0], -wo[1], wo[2]], width)
    }
}

/// What sampling of a material for one outgoing direction comes to.
struct Sampled {
    /// By how many standard errors χ² is too large.
    chi: f64,
    /// Integral of the stated density.
    integral: f64,
    /// Samples where the density is zero.
    outside: u32,
    /// Largest relative difference of the weight and eval/pdf.
    weight_error: f64,
    /// Mean of the weights.
    albedo: Mean,
    samples: u64,
}

fn sample<M: Material>(
    params: &M::Params,
    wo: [f64; 3],
    bins: &DirectionBins,
    count: u64,
) -> Sampled {
    let mut random = Uniform::new(0x5eed);
    let mut counts = ChiSquared::new(bins);
    let mut albedo = Mean::default();
    let mut weight_error = 0.0;
    let wo = splat(wo);
    let groups = count.div_ceil(LANES as u64);
    for _ in 0..groups {
        let s = M::sample(params, wo, [random.lanes(), random.lanes(), random.lanes()]);
        counts.add(s.wi, s.valid);
        let (value, pdf) = M::eval(params, wo, s.wi);
        for lane in 0..LANES {
            let at = |x: F32s| f64::from(x.to_array()[lane]);
            if !s.valid.test(lane) {
                albedo.add(0.0);
                continue;
            }
            albedo.add(at(s.weight.x));
            let stated = at(value.x) / at(pdf);
            weight_error = max_or_nan(weight_error, (stated / at(s.weight.x) - 1.0).abs());
        }
    }
    let verdict = counts.verdict(&|wi| M::eval(params, wo, wi).1);
    Sampled {
        chi: verdict.standard_errors.max(0.0),
        integral: verdict.integral,
        outside: verdict.outside,
        weight_error,
        albedo,
        samples: groups * LANES as u64,
    }
}

/// The largest of several samplings.
struct Worst {
    chi: f64,
    integral: f64,
    outside: u64,
    weight: f64,
    albedo: f64,
    samples: u64,
}

impl Worst {
    fn new() -> Self {
        Self {
            chi: 0.0,
            integral: 0.0,
            outside: 0,
            weight: 0.0,
            albedo: 0.0,
            samples: 0,
        }
    }

    /// Adds a sampling whose density should integrate to `integral`, or at most to 1, and the weights to
    /// `albedo`, if that is known.
    fn add(&mut self, s: &Sampled, integral: Option<f64>, albedo: Option<f64>) {
        self.chi = max_or_nan(self.chi, s.chi);
        let off = integral.map_or((s.integral - 1.0).max(0.0), |known| {
            (s.integral - known).abs()
        });
        self.integral = max_or_nan(self.integral, off);
        self.outside += u64::from(s.outside);
        self.weight = max_or_nan(self.weight, s.weight_error);
        if let Some(albedo) = albedo {
            let error = s.albedo.standard_error();
            let off = deviation(s.albedo.mean() - albedo, error, 1e-5 * albedo);
            self.albedo = max_or_nan(self.albedo, off);
        }
        self.samples += s.samples;
    }

    fn note(&self, trial: &mut Trial<'_>, label: &str, tolerance_of_weight: f64) {
        let n = self.samples;
        trial.note(
            label,
            "χ² of samples in 768 bins",
            Figure::standard_errors(self.chi, n),
        );
        trial.note(
            label,
            "integral of the density",
            Figure::absolute(self.integral, 1e-4, n),
        );
        trial.note(
            label,
            "samples of density 0",
            Figure::share(self.outside, n, 1e-5),
        );
        trial.note(
            label,
            "weight = f·cos/pdf",
            Figure::relative(self.weight, tolerance_of_weight, n),
        );
        trial.note(
            label,
            "mean weight = albedo",
            Figure::standard_errors(self.albedo, n),
        );
    }
}

pub(super) fn sampling(trial: &mut Trial<'_>) -> Result<()> {
    let count = trial.count(200_000);
    let mut worst = Worst::new();
    for angle in ANGLES {
        let s = sample::<Lambertian>(&lambertian(), outgoing(angle), &hemisphere(), count);
        worst.add(&s, Some(1.0), Some(1.0));
    }
    worst.note(trial, "Lambert, 0 to 89.9°", 1e-5);
    for sigma in [0.0, 0.3, 0.7, f64::INFINITY] {
        let mut worst = Worst::new();
        for angle in ANGLES {
            let s = sample::<OrenNayar>(&oren_nayar(sigma), outgoing(angle), &hemisphere(), count);
            let albedo = oracles::oren_nayar_albedo(sigma, angle.to_radians());
            worst.add(&s, Some(1.0), Some(albedo));
        }
        worst.note(trial, &format!("Oren–Nayar σ {sigma}, 0 to 89.9°"), 1e-5);
    }
    for exponent in EXPONENTS {
        let mut worst = Worst::new();
        for angle in ANGLES {
            let wo = outgoing(angle);
            let s = sample::<Phong>(&phong(exponent), wo, &lobe_bins(exponent, wo), count);
            // Nothing is cut off where the lobe is far above the horizon; there the albedo is that of
            // the mirror direction's cosine, times k, but at normal incidence.
            let whole = angle == 0.0 || angle <= 60.0 && exponent >= 1e3;
            let narrow = exponent >= 1e3 && angle <= 60.0;
            let known = if angle == 0.0 {
                Some(1.0)
            } else {
                narrow.then(|| angle.to_radians().cos())
            };
            worst.add(&s, whole.then_some(1.0), known);
        }
        // The rounding of wi in the density grows with the root of the exponent.
        let tolerance = 1e-5 + 1e-7 * f64::from(exponent).sqrt();
        worst.note(
            trial,
            &format!("Phong n {exponent:e}, 0 to 89.9°"),
            tolerance,
        );
    }
    Ok(())
}

pub(super) fn oren_nayar_extremes(trial: &mut Trial<'_>) -> Result<()> {
    let count = trial.count(20_000);
    for sigma in SIGMAS {
        let p = oren_nayar(sigma);
        let s2 = sigma * sigma;
        let share = |c: f64| if s2.is_infinite() { 1.0 } else { s2 / (s2 + c) };
        let (a, b) = (1.0 - 0.5 * share(0.33), 0.45 * share(0.09));
        let mut random = Uniform::new(22);
        let mut worst = 0.0;
        for _ in 0..count {
            let mut theta = || (random.next() * FRAC_PI_2 * 1.001).min(89.999f64.to_radians());
            let (o, i) = (theta(), theta());
            let turn = 6.0 * random.next();
            let (wo, wi) = (
                splat(direction(o.cos(), 0.0)),
                splat(direction(i.cos(), turn)),
            );
            let value = first(OrenNayar::eval(&p, wo, wi).0.x);
            let [o, i] = [wo, wi].map(|w| w.to_lanes()[0]);
            let along = (o[0] * i[0] + o[1] * i[1]).max(0.0);
            let exact = (a + b * along / o[2].max(i[2])) * i[2] / PI;
            // f·cos is at most about 1/π.
            worst = max_or_nan(worst, (value - exact).abs() * PI);
        }
        trial.note(
            format!("σ {sigma:e}, to 89.999°"),
            "closed form in f64",
            Figure::absolute(worst, 1e-6, count),
        );
    }
    let mut wrong = 0;
    let mut random = Uniform::new(21);
    for _ in 0..count {
        let wo = splat(direction(random.next(), 6.0 * random.next()));
        let wi = splat(direction(random.next(), 6.0 * random.next()));
        let [rough, smooth] = [
            OrenNayar::eval(&oren_nayar(0.0), wo, wi),
            Lambertian::eval(&lambertian(), wo, wi),
        ]
        .map(|(value, pdf)| (value.to_lanes(), pdf.to_array()));
        wrong += u64::from(rough != smooth);
    }
    trial.note("σ 0", "Lambert, bit for bit", Figure::none_of(wrong, count));
    Ok(())
}

pub(super) fn phong_extremes(trial: &mut Trial<'_>) -> Result<()> {
    let count = trial.count(200_000);
    // By quadrature to 1e-10, for k = 1.
    let table: [(f32, [f64; 4]); 3] = [
        (1.0, [0.880843, 0.608998, 0.458442, 0.363097]),
        (10.0, [0.866029, 0.504736, 0.291901, 0.171275]),
        (1000.0, [0.866025, 0.500000, 0.258819, 0.087183]),
    ];
    for (exponent, row) in table {
        let mut worst = 0.0;
        for (angle, exact) in [30.0, 60.0, 75.0, 85.0].into_iter().zip(row) {
            let wo = outgoing(angle);
            let s = sample::<Phong>(&phong(exponent), wo, &lobe_bins(exponent, wo), count);
            let off = deviation(
                s.albedo.mean() - exact,
                s.albedo.standard_error(),
                1e-5 * exact,
            );
            worst = max_or_nan(worst, off);
        }
        trial.note(
            format!("n {exponent:e}, 30° to 85°"),
            "table of albedos",
            Figure::standard_errors(worst, 4 * count),
        );
    }
    let mut below = 0;
    let mut random = Uniform::new(8);
    for _ in 0..count {
        let exponent = EXPONENTS[(5.0 * random.next()) as usize];
        let wo = splat(outgoing(90.0 * random.next()));
        let wi = splat(direction(-random.next(), 6.0 * random.next()));
        let (value, pdf) = Phong::eval(&phong(exponent), wo, wi);
        below += u64::from(first(value.x) != 0.0 || first(pdf) != 0.0);
    }
    trial.note(
        "below the horizon",
        "value and density 0",
        Figure::none_of(below, count),
    );
    Ok(())
}

pub(super) fn energy(trial: &mut Trial<'_>) -> Result<()> {
    let step = match trial.effort() {
        super::Effort::Test => 9,
        super::Effort::Quick => 3,
        super::Effort::Full => 1,
    };
    let angles = || (0..90).step_by(step).map(f64::from);
    let n = angles().count() as u64;
    for sigma in [0.0, 0.1, 0.1987, 0.3, 0.5745, 0.7, 1.0, f64::INFINITY] {
        let worst = angles().fold(0.0, |worst, angle| {
            let (p, wo) = (oren_nayar(sigma), splat(outgoing(angle)));
            let albedo = hemisphere().total(&|wi| OrenNayar::eval(&p, wo, wi).0.x);
            max_or_nan(
                worst,
                (albedo - oracles::oren_nayar_albedo(sigma, angle.to_radians())).abs(),
            )
        });
        trial.note(
            format!("Oren–Nayar σ {sigma}, 0 to 89°"),
            "closed form of the albedo",
            Figure::absolute(worst, 2e-4, n),
        );
    }
    for exponent in [0.0, 1.0, 10.0, 100.0, 1e3, 1e4, 1e6] {
        let gain = |albedo: f64| albedo - 1.0;
        let lobe = angles().fold(0.0, |worst, angle| {
            let wo = outgoing(angle);
            let albedo = lobe_bins(exponent, wo)
                .total(&|wi| Phong::eval(&phong(exponent), splat(wo), wi).0.x);
            max_or_nan(worst, gain(albedo))
        });
        trial.note(
            format!("Phong n {exponent:e}, 0 to 89°"),
            "albedo ≤ 1",
            Figure::absolute(lobe, 1e-4, n),
        );
        // Its diffuse part needs bins over the hemisphere, which resolve broad lobes alone.
        if exponent <= 10.0 {
            let both = angles().fold(0.0, |worst, angle| {
                let wo = splat(outgoing(angle));
                let p = glossy(exponent);
                max_or_nan(
                    worst,
                    gain(hemisphere().total(&|wi| Glossy::eval(&p, wo, wi).0.x)),
                )
            });
            trial.note(
                format!("glossy n {exponent:e}, 0 to 89°"),
                "albedo ≤ 1",
                Figure::absolute(both, 1e-4, n),
            );
        }
    }
    random_energy(trial);
    Ok(())
}

/// Albedos of materials with random parameters over their whole range, seen at random angles.
fn random_energy(trial: &mut Trial<'_>) {
    let count = trial.count(240);
    let mut random = Uniform::new(0x38);
    let mut worst_rough = 0.0;
    let mut worst_lobe = 0.0;
    let mut worst_glossy = 0.0;
    let mut most = 0.0;
    for _ in 0..count {
        let sigma = magnitude(&mut random, 1e-8, 1e8);
        let degrees = 89.0 * random.next();
        let (wo, theta) = (outgoing(degrees), degrees.to_radians());
        let p = oren_nayar(sigma);
        let albedo = hemisphere().total(&|wi| OrenNayar::eval(&p, splat(wo), wi).0.x);
        let expected = oracles::oren_nayar_albedo(sigma, theta);
        worst_rough = max_or_nan(worst_rough, (albedo - expected).abs());

        let exponent = magnitude(&mut random, 1e-2, 1e6) as f32;
        let bins = lobe_bins(exponent, wo);
        let p = phong(exponent);
        let albedo = bins.total(&|wi| Phong::eval(&p, splat(wo), wi).0.x);
        let lobe = oracles::phong_albedo(exponent.into(), theta);
        worst_lobe = max_or_nan(worst_lobe, (albedo - lobe).abs());
        most = max_or_nan(most, albedo - 1.0);

        // The diffuse part over the hemisphere, what the lobe adds to it where the lobe is.
        let diffuse = random.next() as f32;
        let both = glossy_of(diffuse, 1.0 - diffuse, exponent);
        let base = glossy_of(diffuse, 0.0, exponent);
        let value = |p: &<Glossy as Material>::Params, wi| Glossy::eval(p, splat(wo), wi).0.x;
        let albedo = hemisphere().total(&|wi| value(&base, wi))
            + bins.total(&|wi| value(&both, wi) - value(&base, wi));
        let expected = f64::from(diffuse) + f64::from(1.0 - diffuse) * lobe;
        worst_glossy = max_or_nan(worst_glossy, (albedo - expected).abs());
        most = max_or_nan(most, albedo - 1.0);
    }
    for (label, worst) in [
        ("Oren–Nayar, random σ 1e-8 to 1e8", worst_rough),
        ("Phong, random n 0.01 to 1e6", worst_lobe),
        ("glossy, random parts and n", worst_glossy),
    ] {
        let figure = Figure::absolute(worst, 2e-4, count);
        trial.note(label, "albedo of the model in f64", figure);
    }
    trial.note(
        "Phong and glossy, random",
        "albedo ≤ 1",
        Figure::absolute(most, 1e-4, count),
    );

    // Glass: what is not reflected is refracted, its radiance over η².
    let count = 100 * count;
    for formula in FORMULAS {
        let (mut lost, mut outside) = (0.0, 0);
        for _ in 0..count {
            let ior = magnitude(&mut random, 1.0 / 3.0, 3.0) as f32;
            let side = if random.next() < 0.5 { 1.0 } else { -1.0 };
            let cos = side * magnitude(&mut random, 1e-7, 1.0);
            let ways = Dielectric::branches(&glass(ior, formula), splat(direction(cos, 1.0)));
            let (r, eta) = (first(ways.reflectance), first(ways.eta));
            let through = first(ways.transmission_weight) * eta * eta;
            lost = max_or_nan(lost, (r + through - 1.0).abs());
            outside += u64::from(!(0.0..=1.0).contains(&r) || through.is_nan() || through < 0.0);
        }
        let label = format!("glass, {formula:?}, random n 1/3 to 3");
        trial.note(&*label, "R + T = 1", Figure::absolute(lost, 1e-6, count));
        trial.note(&*label, "0 ≤ R ≤ 1, T ≥ 0", Figure::none_of(outside, count));
    }
}

/// f·cos over the cosine of where it goes.
fn value<M: Material>(params: &M::Params, wo: [f64; 3], wi: [f64; 3]) -> f64 {
    let wi = splat(wi);
    first(M::eval(params, splat(wo), wi).0.x) / first(wi.z)
}

pub(super) fn reciprocity(trial: &mut Trial<'_>) -> Result<()> {
    let count = trial.count(50_000);
    let mut random = Uniform::new(38);
    // From the pole to a cosine of 10⁻⁴.
    let mut somewhere = || {
        direction(
            10f64.powf(-4.0 * random.next().powi(3)),
            std::f64::consts::TAU * random.next(),
        )
    };
    let pairs: Vec<[[f64; 3]; 2]> = (0..count).map(|_| [somewhere(), somewhere()]).collect();
    let worst_of = |pairs: &[[[f64; 3]; 2]], f: &dyn Fn([f64; 3], [f64; 3]) -> f64| {
        pairs.iter().fold(0.0, |worst, &[a, b]| {
            let (there, back) = (f(a, b), f(b, a));
            // What is far down a lobe carries nothing.
            if there.max(back) < 1e-6 {
                return worst;
            }
            max_or_nan(worst, (there / back - 1.0).abs())
        })
    };
    let worst = |f: &dyn Fn([f64; 3], [f64; 3]) -> f64| worst_of(&pairs, f);
    let mut note = |label: String, figure: f64, tolerance: f64| {
        trial.note(
            label,
            "f(a, b) = f(b, a)",
            Figure::relative(figure, tolerance, count),
        );
    };
    note(
        "Lambert".to_owned(),
        worst(&|a, b| value::<Lambertian>(&lambertian(), a, b)),
        1e-6,
    );
    for sigma in [1e-8, 0.3, 1.0, f64::INFINITY] {
        let p = oren_nayar(sigma);
        let figure = worst(&|a, b| value::<OrenNayar>(&p, a, b));
        note(format!("Oren–Nayar σ {sigma:e}"), figure, 1e-6);
    }
    // cosⁿα magnifies the rounding of directions, by n·tan α·10⁻⁷, down to values of 10⁻⁶: tan α is
    // at most √(2·14/n) where the lobe is narrow.
    let lobe_tolerance = |exponent: f32| 1e-6 + 3e-7 * (28.0 * f64::from(exponent)).sqrt();
    for exponent in [0.0, 1.0, 10.0, 1e3] {
        let p = phong(exponent);
        let figure = worst(&|a, b| value::<Phong>(&p, a, b));
        note(
            format!("Phong n {exponent:e}"),
            figure,
            lobe_tolerance(exponent),
        );
        let p = glossy(exponent);
        let figure = worst(&|a, b| value::<Glossy>(&p, a, b));
        note(
            format!("glossy n {exponent:e}"),
            figure,
            lobe_tolerance(exponent),
        );
    }
    // Random parameters, new ones for every so many pairs. Lobes are held against their tolerance.
    let mut random = Uniform::new(39);
    let (mut rough, mut lobes) = (0.0, 0.0);
    for pairs in pairs.chunks(64) {
        let p = oren_nayar(magnitude(&mut random, 1e-8, 1e8));
        let figure = worst_of(pairs, &|a, b| value::<OrenNayar>(&p, a, b));
        rough = max_or_nan(rough, figure);
        let exponent = magnitude(&mut random, 1e-2, 1e6) as f32;
        let p = phong(exponent);
        let figure = worst_of(pairs, &|a, b| value::<Phong>(&p, a, b));
        lobes = max_or_nan(lobes, figure / lobe_tolerance(exponent));
        let diffuse = random.next() as f32;
        let p = glossy_of(diffuse, 1.0 - diffuse, exponent);
        let figure = worst_of(pairs, &|a, b| value::<Glossy>(&p, a, b));
        lobes = max_or_nan(lobes, figure / lobe_tolerance(exponent));
    }
    note("Oren–Nayar, random σ 1e-8 to 1e8".to_owned(), rough, 1e-6);
    let label = "Phong and glossy, random, over 1e-6 + 3e-7·√28n";
    note(label.to_owned(), lobes, 1.0);
    // Glass: what goes in at one angle comes out the other way by the same share. The way back starts
    // from the refracted direction as rounded, off by 2u at most; that moves its far side's cosine by
    // n²·2u over the smaller of both cosines, to which the way back adds its own rounding, 2u over the
    // same; and R by 4n times as much at most, or for n near 1 by 2(n² + 1)/√(n² − 1), its slope at
    // grazing angles.
    let off = |ior: f32, formula: FresnelFormula, cos: f64| {
        let p = glass(ior, formula);
        let there = Dielectric::branches(&p, splat(direction(cos, 1.0)));
        if first(there.reflectance) == 1.0 {
            return 0.0;
        }
        let back = Dielectric::branches(&p, there.refracted);
        let difference = first(there.reflectance) - first(back.reflectance);
        let n = f64::from(ior.max(1.0 / ior));
        let least = cos.min(first(there.refracted.z).abs());
        let slope = (4.0 * n).max(2.0 * (n * n + 1.0) / (n * n - 1.0).sqrt());
        difference.abs() * least / (slope * (n * n + 1.0) * f64::from(f32::EPSILON))
    };
    let draws = 20 * count.div_ceil(64);
    for formula in FORMULAS {
        let mut note = |label: String, figure: f64, samples: u64| {
            let figure = Figure::relative(figure, 1.0, samples);
            trial.note(label, "R in = R out, over its bound", figure);
        };
        for ior in [1.5f32, 1.75, 2.4] {
            let cosines = (1..2_000).map(|i| f64::from(i) / 2_000.0);
            let worst = cosines.fold(0.0, |worst, cos| max_or_nan(worst, off(ior, formula, cos)));
            note(format!("glass n {ior}, {formula:?}"), worst, 2_000);
        }
        let worst = (0..draws).fold(0.0, |worst, _| {
            let ior = magnitude(&mut random, 1.0 / 3.0, 3.0) as f32;
            max_or_nan(worst, off(ior, formula, magnitude(&mut random, 1e-4, 1.0)))
        });
        note(
            format!("glass, {formula:?}, random n 1/3 to 3"),
            worst,
            draws,
        );
    }
    Ok(())
}

pub(super) fn frames(trial: &mut Trial<'_>) -> Result<()> {
    let count = trial.count(400_000);
    let mut random = Uniform::new(34);
    let mut worst = 0.0;
    for i in 0..count.div_ceil(LANES as u64) {
        let normals: [[f64; 3]; LANES] = std::array::from_fn(|_| {
            let z = if i % 2 == 0 {
                1.0 - 2.0 * random.next()
            } else {
                // Within 10⁻⁸ to 10⁻¹ of −z, where one formula divides by almost zero.
                let tilt = 10f64.powf(-8.0 + 7.0 * random.next());
                -(1.0 - tilt * tilt).max(0.0).sqrt()
            };
            direction(z, std::f64::consts::TAU * random.next())
        });
        let n = Vec3s::from_lanes(&normals);
        let frame = Frame::from_normal(n);
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            .map(|axis| frame.to_world(splat(axis)).to_lanes());
        for lane in 0..LANES {
            let [a, b, c] = axes.map(|axis| glam::DVec3::from_array(axis[lane]));
            for (u, v, expected) in [
                (a, a, 1.0),
                (b, b, 1.0),
                (a, b, 0.0),
                (a, c, 0.0),
                (b, c, 0.0),
            ] {
                worst = max_or_nan(worst, (u.dot(v) - expected).abs());
            }
        }
    }
    trial.note(
        "normals to 1e-8 from −z",
        "orthonormal",
        Figure::absolute(worst, 5e-7, count),
    );
    // The two vectors for which earlier formulas fail (Duff et al. 2017).
    let hard = [
        [0.00038527316, 0.00038460016, -0.99999988079],
        [-0.00019813581, -0.00008946839, -0.99999988079],
    ];
    let mut worst = 0.0;
    for n in hard {
        let frame = Frame::from_normal(splat(n));
        let [a, b] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
            .map(|axis| glam::DVec3::from_array(frame.to_world(splat(axis)).to_lanes()[0]));
        worst = max_or_nan(
            worst,
            (a.length() - 1.0).abs().max((b.length() - 1.0).abs()),
        );
        worst = max_or_nan(worst, a.dot(b).abs());
    }
    trial.note(
        "Duff's two vectors",
        "orthonormal",
        Figure::absolute(worst, 5e-7, 2),
    );
    Ok(())
}
