//! Error against run time: on scenes of which the image is known, slopes are what they must be, and what is
//! biased is caught.

use std::path::Path;
use std::process::Command;
use std::rc::Rc;

use wavepath::report::SceneReport;
use wavepath::report::Span;
use wavepath::report::converge::{
    BiasVerdict, Configuration, ConfigurationInput, ConvergeInput, ConvergeSettings, EndedBy,
    Limit, ReferenceChoice, ReferenceKind, ReferenceOptions, Results, Schedule, converge,
};
use wavepath::scene::{self, RenderSettings};

use crate::support::scenes;

/// What a test compares, and how.
struct Comparison<'a> {
    scene: &'a str,
    side: u32,
    /// Overrides of each configuration.
    configurations: &'a [&'a [&'a str]],
    schedule: Schedule,
    repeats: u32,
    threads: usize,
    reference: ReferenceOptions,
}

impl Comparison<'_> {
    fn new<'a>(
        scene: &'a str,
        configurations: &'a [&'a [&'a str]],
        samples: u64,
    ) -> Comparison<'a> {
        Comparison {
            scene,
            side: 32,
            configurations,
            schedule: Schedule::doubling(samples),
            repeats: 5,
            threads: 1,
            reference: ReferenceOptions {
                choice: ReferenceChoice::Auto,
                error: 0.08,
                seconds: 20.0,
                cache: None,
            },
        }
    }

    fn run(&self) -> Results {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let configuration = |overrides: &&[&str]| {
            let size = [
                format!("film.width={0}", self.side),
                format!("film.height={0}", self.side),
            ];
            let overrides: Vec<String> = overrides.iter().map(|o| (*o).to_owned()).collect();
            let all: Vec<String> = size.iter().chain(&overrides).cloned().collect();
            let scene = scene::load(&scenes().join(self.scene), &all).expect("a sound scene");
            ConfigurationInput {
                name: overrides.join(" "),
                overrides,
                settings: RenderSettings::from_defaults(&scene.render),
                scene: Rc::new(scene),
                camera: 0,
                load: Span::default(),
                schedule: self.schedule.clone(),
            }
        };
        let input = ConvergeInput {
            scene: SceneReport {
                name: self.scene.to_owned(),
                camera: String::new(),
                width: self.side,
                height: self.side,
            },
            configurations: self.configurations.iter().map(configuration).collect(),
            settings: ConvergeSettings {
                repeats: self.repeats,
                limit: Limit::Samples(1),
                threads: self.threads,
                seed: 1,
            },
            reference: self.reference.clone(),
            noise: false,
            folder: folder.path(),
        };
        let results = converge(input, &|| false, &mut |_| {}).unwrap_or_else(|e| panic!("{e}"));
        for configuration in &results.configurations {
            let picture = configuration.picture.as_ref().expect("it was rendered");
            for name in [&picture.image, &picture.error_image, &picture.error_map] {
                assert!(folder.path().join(name).exists(), "{name}");
            }
        }
        results
    }
}

/// The interval of the slope, widened as far as the worst of a dozen intervals may be off.
fn slope(configuration: &Configuration) -> [f64; 2] {
    let slope = configuration.slope_by_samples.expect("fitted").slope;
    let half = slope.high.expect("several repeats") - slope.value;
    [slope.value - 2.0 * half, slope.value + 2.0 * half]
}

#[test]
fn independent_samples_have_slope_one_half_where_the_image_is_known_and_strata_a_steeper_one() {
    for scene in ["panel.toml", "furnace.toml"] {
        let configurations: &[&[&str]] = &[
            &["render.sampler=independent"],
            &["render.sampler=stratified"],
        ];
        let results = Comparison::new(scene, configurations, 128).run();
        assert_eq!(results.references[0].kind, ReferenceKind::ClosedForm);
        let [independent, stratified] = &results.configurations[..] else {
            panic!("two configurations");
        };
        let [low, high] = slope(independent);
        assert!(
            low < -0.5 && high > -0.5 && high - low < 0.15,
            "{scene}: {low} to {high}"
        );
        assert_eq!(independent.bias.verdict, BiasVerdict::NotShown, "{scene}");
        let calibration = independent.checkpoints.last().unwrap().calibration.unwrap();
        assert!(
            (calibration.value - 1.0).abs() < 0.15,
            "{scene}: {calibration:?}"
        );
        if scene == "panel.toml" {
            assert!(slope(stratified)[1] < -0.55, "{:?}", slope(stratified));
            assert!(results.pairs[0].efficiency.unwrap().low.unwrap() > 1.0);
        }
    }
}

#[test]
fn transparent_shadows_and_a_depth_limit_are_caught_by_the_bias_test() {
    let configurations: &[&[&str]] = &[
        &[],
        &["render.transparent_shadows=true"],
        &["render.max_depth=2"],
    ];
    let results = Comparison::new("hexroom-exact.toml", configurations, 64).run();
    let verdicts: Vec<BiasVerdict> = results
        .configurations
        .iter()
        .map(|c| c.bias.verdict)
        .collect();
    let z: Vec<_> = results
        .configurations
        .iter()
        .map(|c| (c.bias.z, c.bias.block_p))
        .collect();
    let expected = [
        BiasVerdict::NotShown,
        BiasVerdict::Biased,
        BiasVerdict::Biased,
    ];
    assert_eq!(verdicts, expected, "{z:?}");
    let by_design = |index: usize| results.configurations[index].bias.by_design.len();
    assert_eq!([by_design(0), by_design(1), by_design(2)], [0, 1, 1]);
}

#[test]
fn a_wrong_closed_form_is_bias_in_every_configuration() {
    let wrong: &[&[&str]] = &[&["closed_form.radiance=0.99"]];
    let results = Comparison::new("furnace.toml", wrong, 64).run();
    assert_eq!(results.configurations[0].bias.verdict, BiasVerdict::Biased);
}

#[test]
fn every_sample_of_a_furnace_without_light_sampling_is_exact() {
    let plain: &[&[&str]] = &[&[
        "render.strategy=bsdf",
        "render.roulette_depth=1000",
        "render.max_depth=100",
    ]];
    let results = Comparison {
        repeats: 2,
        ..Comparison::new("furnace.toml", plain, 8)
    }
    .run();
    let configuration = &results.configurations[0];
    for checkpoint in &configuration.checkpoints {
        assert!(checkpoint.mse.value < 1e-12, "{checkpoint:?}");
        assert!(checkpoint.near_reference);
    }
    assert_eq!(configuration.slope_by_samples, None);
}

#[test]
fn errors_do_not_depend_on_threads_or_company() {
    let errors = |threads: usize, configurations: &[&[&str]]| -> Vec<f64> {
        let comparison = Comparison::new("cornell.toml", configurations, 16);
        let results = Comparison {
            threads,
            repeats: 2,
            side: 40,
            ..comparison
        }
        .run();
        let rows = results.configurations[0]
            .repeats
            .iter()
            .flat_map(|r| &r.rows);
        rows.map(|row| row.errors.mse).collect()
    };
    let alone = errors(1, &[&[]]);
    assert_eq!(alone.len(), 10);
    assert_eq!(errors(2, &[&[], &["render.strategy=nee"]]), alone);
}

#[test]
fn renders_go_on_from_checkpoint_to_checkpoint_and_end_in_time() {
    let comparison = Comparison::new("cornell.toml", &[&[]], 1);
    let schedule = Schedule::Seconds(0.05);
    let reference = ReferenceOptions {
        error: 0.5,
        ..comparison.reference.clone()
    };
    let results = Comparison {
        schedule,
        reference,
        repeats: 2,
        ..comparison
    }
    .run();
    let configuration = &results.configurations[0];
    assert_eq!(configuration.ended, EndedBy::Seconds);
    for repeat in &configuration.repeats {
        let last = repeat.rows.last().unwrap();
        assert!(last.cpu_seconds < 0.1, "{}", last.cpu_seconds);
        for pair in repeat.rows.windows(2) {
            assert!(pair[0].samples < pair[1].samples && pair[0].cpu_seconds < pair[1].cpu_seconds);
            assert_eq!(pair[1].paths, pair[1].samples * 32 * 32);
        }
    }
}

#[test]
fn scenes_that_differ_in_the_picture_have_references_of_their_own_which_are_found_again() {
    let folder = tempfile::tempdir().unwrap();
    let configurations: &[&[&str]] = &[
        &[],
        &["materials.red.reflectance=0.1"],
        &["render.strategy=nee"],
    ];
    let comparison = Comparison::new("cornell.toml", configurations, 2);
    let reference = ReferenceOptions {
        error: 0.5,
        cache: Some(folder.path().join("cache")),
        ..comparison.reference.clone()
    };
    let comparison = Comparison {
        reference,
        side: 16,
        repeats: 1,
        ..comparison
    };
    let first = comparison.run();
    assert_eq!(first.references.len(), 2);
    let of: Vec<usize> = first.configurations.iter().map(|c| c.reference).collect();
    assert_eq!(of, [0, 1, 0]);
    assert_eq!(first.pairs.len(), 1);
    let again = comparison.run();
    for (new, found) in first.references.iter().zip(&again.references) {
        let cached =
            |kind: &ReferenceKind| matches!(kind, ReferenceKind::Rendered { cached: true, .. });
        assert_eq!((cached(&new.kind), cached(&found.kind)), (false, true));
        assert_eq!(new.samples, found.samples);
        let (a, b) = (new.relative_error.unwrap(), found.relative_error.unwrap());
        assert_eq!(a, b);
        assert!(a <= 0.5 && a > 0.0);
    }
    // Stored in f32.
    let mse = |results: &Results| results.configurations[0].checkpoints[1].mse.value;
    assert!((mse(&first) / mse(&again) - 1.0).abs() < 1e-4);
}

fn run(folder: &Path, args: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_wavepath"))
        .arg("converge")
        .args(args)
        .current_dir(folder)
        .env("XDG_CACHE_HOME", folder.join("cache"))
        .output()
        .expect("the program starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (
        output.status.code(),
        text(&output.stdout),
        text(&output.stderr),
    )
}

#[test]
fn command_writes_its_files_and_accounts_for_its_time() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scenes().join("furnace.toml");
    let (code, text, notes) = run(
        folder.path(),
        &[
            scene.to_str().unwrap(),
            "--spp=32",
            "--repeats=2",
            "--width=128",
            "--height=128",
            "--threads=1",
            "--vary",
            "strategy=mis,bsdf",
            "-o",
            "out",
        ],
    );
    assert_eq!(code, Some(0), "{notes}");
    assert!(
        text.contains("strategy=bsdf") && text.contains("closed form"),
        "{text}"
    );
    let out = folder.path().join("out");
    let json = std::fs::read_to_string(out.join("converge.json")).unwrap();
    let results: Results = serde_json::from_str(&json).unwrap();
    assert_eq!(results.configurations.len(), 2);
    assert!(results.noise.is_some() && !results.definitions.is_empty());
    let csv = std::fs::read_to_string(out.join("converge.csv")).unwrap();
    assert_eq!(csv.lines().count(), 1 + 2 * 2 * 6);
    // The curves, and what it takes to wake the threads, are what the process says.
    let accounting = results.accounting;
    let passes = accounting.curves_cpu_seconds + accounting.waking_cpu_seconds;
    assert!(
        accounting.curves_cpu_seconds > 0.5 * passes,
        "{accounting:?}"
    );
    let missing = accounting.process_cpu_seconds - passes;
    assert!(
        missing.abs() < 0.02 * accounting.process_cpu_seconds,
        "{accounting:?}"
    );
}

#[test]
fn table_has_a_line_for_each_image() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scenes().join("hexroom.toml");
    let args = [
        "--table",
        "--width=16",
        "--height=16",
        "--repeats=2",
        "--reference-error=0.5",
        "-q",
    ];
    let (code, text, notes) = run(
        folder.path(),
        &[&[scene.to_str().unwrap()], &args[..]].concat(),
    );
    assert_eq!(code, Some(0), "{notes}");
    let lines: Vec<Vec<&str>> = text
        .lines()
        .map(|line| line.split_whitespace().collect())
        .collect();
    for start in [
        ["Whitted", "1"].as_slice(),
        &["Monte", "Carlo", "1"],
        &["Monte", "Carlo", "100"],
        &["Monte", "Carlo", "400"],
    ] {
        assert!(
            lines.iter().any(|line| line.starts_with(start)),
            "{start:?} in\n{text}"
        );
    }
    assert!(
        folder
            .path()
            .join("hexroom-converge/converge.json")
            .exists()
    );
}

#[test]
fn mistakes_are_one_line_that_quotes_them() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scenes().join("furnace.toml");
    for (args, part) in [
        (["--vary", "strategy=mis,none"], "none"),
        (["--vary", "strategy"], "--vary strategy"),
        (["--config", "fast"], "--config fast"),
        (["--repeats", "0"], "--repeats"),
        (["--seconds", "-1"], "--seconds"),
        (["--reference", "picture.png"], "picture.png"),
        (["--reference", "missing.exr"], "missing.exr"),
        (["--set", "render.block=65"], "`block`"),
    ] {
        let (code, _, notes) = run(
            folder.path(),
            &[&[scene.to_str().unwrap(), "-q"], &args[..]].concat(),
        );
        assert_eq!(code, Some(2), "{args:?}: {notes}");
        assert!(
            notes.trim_end().lines().count() == 1 && notes.contains(part),
            "{args:?}: {notes}"
        );
    }
}
