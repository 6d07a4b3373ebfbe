//! Random small scenes of extreme sizes, lengths and brightness: the wavefront and the reference show the same.

use glam::{DQuat, DVec3};
use proptest::prelude::{Just, any, prop, prop_assert, prop_oneof, proptest};
use proptest::strategy::Strategy as Generate;
use proptest::test_runner::{Config, RngSeed};
use wavepath::reference::{RayCounts, Reference};
use wavepath::scene::{BsdfDescription, Budget, RenderSettings, SceneDescription, Strategy};

use crate::builder::{SceneBuilder, glass, lambertian, mirror};
use crate::renderer::path;
use crate::support::{estimate, picture};
use crate::ztest::{ImageEstimate, compare};

const SIZE: [u32; 2] = [16, 16];
const SAMPLES: u64 = 64;
/// Chance that the comparison of one case fails though both are right.
const FALSE_ALARM: f64 = 5e-6;

/// A shape in a scene about the origin, of about unit size.
#[derive(Debug, Clone)]
enum Form {
    Sphere,
    Quad,
    /// A triangle this many times as long as wide.
    Triangle(f64),
    Cube,
}

#[derive(Debug, Clone)]
struct Thing {
    form: Form,
    bsdf: BsdfDescription,
    /// Of the scene's brightness; 0 for what does not shine.
    emission: f64,
    place: DVec3,
    size: f64,
    turn: DVec3,
}

#[derive(Debug, Clone)]
struct Case {
    things: Vec<Thing>,
    /// What all lengths and all radiances are multiplied by.
    unit: f64,
    brightness: f64,
    sky: bool,
    strategy: Strategy,
    max_depth: u32,
}

/// 10 to a power in this range.
fn decades(low: f64, high: f64) -> impl Generate<Value = f64> {
    (low..high).prop_map(|exponent| 10f64.powf(exponent))
}

fn vector() -> impl Generate<Value = DVec3> {
    prop::array::uniform3(-1.0..1.0f64).prop_map(DVec3::from)
}

fn bsdf() -> impl Generate<Value = BsdfDescription> {
    prop_oneof![
        (0.0..=1.0).prop_map(lambertian),
        Just(lambertian(1.0)),
        (0.5..=1.0).prop_map(mirror),
        (1.0..2.5).prop_map(glass),
        Just(glass(1.000_001)),
        prop_oneof![Just(0.0), Just(f64::INFINITY), decades(-8.0, 8.0)].prop_map(|sigma| {
            BsdfDescription::OrenNayar {
                reflectance: DVec3::splat(0.8),
                sigma,
            }
        }),
        prop_oneof![Just(0.0), decades(0.0, 6.0)].prop_map(|exponent| BsdfDescription::Phong {
            reflectance: DVec3::new(0.9, 0.5, 0.1),
            exponent,
        }),
        Just(BsdfDescription::Black),
    ]
}

fn thing() -> impl Generate<Value = Thing> {
    let form = prop_oneof![
        Just(Form::Sphere),
        Just(Form::Quad),
        decades(0.0, 5.0).prop_map(Form::Triangle),
        Just(Form::Cube),
    ];
    let emission = prop_oneof![2 => Just(0.0), 1 => Just(1.0)];
    (
        form,
        bsdf(),
        emission,
        vector(),
        decades(-2.0, 0.3),
        vector(),
    )
        .prop_map(|(form, bsdf, emission, place, size, turn)| Thing {
            form,
            bsdf,
            emission,
            place,
            size,
            turn,
        })
}

fn case() -> impl Generate<Value = Case> {
    let strategy = prop_oneof![3 => Just(Strategy::Mis), 1 => Just(Strategy::Bsdf)];
    let things = prop::collection::vec(thing(), 1..7);
    let decades = (decades(-6.0, 6.0), decades(-12.0, 12.0));
    (things, decades, any::<bool>(), strategy, 1..6u32).prop_map(
        |(things, (unit, brightness), sky, strategy, max_depth)| Case {
            things,
            unit,
            brightness,
            sky,
            strategy,
            max_depth,
        },
    )
}

impl Case {
    fn scene(&self) -> SceneDescription {
        let mut scene = SceneBuilder::new();
        for thing in &self.things {
            let material = if thing.emission > 0.0 {
                scene.two_sided(thing.bsdf, thing.emission * self.brightness)
            } else {
                scene.matter(thing.bsdf)
            };
            let turn = DQuat::from_scaled_axis(3.0 * thing.turn);
            let place = |x: f64, y: f64| {
                ((thing.place + turn * DVec3::new(x, y, 0.0) * thing.size) * self.unit).to_array()
            };
            match thing.form {
                Form::Sphere => {
                    let radius = 0.5 * thing.size * self.unit;
                    scene.sphere(place(0.0, 0.0), radius, material);
                }
                Form::Quad => {
                    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
                    scene.quad(corners.map(|(x, y)| place(x, y)), material);
                }
                Form::Triangle(aspect) => {
                    let corners = [(-1.0, 0.0), (1.0, 0.0), (0.3, 1.0 / aspect)];
                    let corners = corners.map(|(x, y)| DVec3::from(place(x, y)));
                    scene.mesh(corners.to_vec(), vec![[0, 1, 2]], material);
                }
                Form::Cube => {
                    let corner = DVec3::from(place(0.0, 0.0));
                    scene.skew_cube(thing.size * self.unit, corner, material);
                }
            }
        }
        if self.sky {
            scene.background(0.3 * self.brightness);
        }
        let [eye, top_left] =
            [[0.3, -4.0, 0.5], [-0.6, -2.0, 0.9]].map(|p| p.map(|x| x * self.unit));
        let (right, down) = ([1.3 * self.unit, 0.0, 0.0], [0.0, 0.0, -1.3 * self.unit]);
        scene.window(eye, top_left, right, down);
        scene.build()
    }
}

proptest! {
    #![proptest_config(Config {
        cases: 32,
        rng_seed: RngSeed::Fixed(5),
        failure_persistence: None,
        max_shrink_iters: 60,
        ..Config::default()
    })]

    #[test]
    fn random_scenes_of_any_magnitude_look_the_same_to_both(case in case()) {
        let scene = case.scene();
        let settings = RenderSettings {
            budget: Budget::Samples(SAMPLES),
            block: 1,
            threads: 1,
            ..path(case.strategy, case.max_depth)
        };
        // Also that nothing was left out for not being finite.
        let ours = estimate(&picture(&scene, 0, SIZE, &settings).film);
        let reference =
            Reference::new(&scene, 0, SIZE[0], SIZE[1], &settings).expect("a sound scene");
        let mut counts = RayCounts::default();
        let theirs = ImageEstimate::from_samples(SIZE.map(|n| n as usize), SAMPLES, |x, y, sample| {
            reference.sample(x as u32, y as u32, sample, &mut counts).to_array()
        });
        prop_assert!(counts.rejected.total() == 0);
        let comparison = compare(&ours, &theirs, FALSE_ALARM);
        prop_assert!(comparison.passes(), "{comparison}");
    }
}
