//! Renders that are interrupted and go on: the image is that of a render that was not.

use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use tempfile::TempDir;
use wavepath::compile::compile;
use wavepath::film::{Film, read_exr};
use wavepath::integrator::checkpoint::{Identity, Resume, Saving};
use wavepath::integrator::stats::{EndReason, RenderStats};
use wavepath::integrator::{Outcome, render_resumable};
use wavepath::report::Build;
use wavepath::scene::{Budget, IntegratorKind, RenderSettings, SamplerKind, SceneDescription};

use crate::cli::{
    directory, files, interrupt_when_rendering, refuse, report, start, stderr, stdout, succeed,
    wavepath,
};
use crate::support::load;

/// Six tiles.
const SIZE: [u32; 2] = [70, 40];

/// Never due.
const NEVER: Duration = Duration::MAX;

fn scene(name: &str) -> SceneDescription {
    let mut scene = load(name);
    [scene.film.width, scene.film.height] = SIZE;
    scene
}

fn identity(scene: &SceneDescription, settings: &RenderSettings) -> Identity {
    Identity::new(scene, 0, settings, &Build::current())
}

/// What of a checkpoint a render with these settings goes on with, or why it does not.
fn resume(
    file: &Path,
    scene: &SceneDescription,
    settings: &RenderSettings,
) -> Result<Resume, String> {
    Resume::read(file, scene, settings, &identity(scene, settings))
        .map_err(|error| error.to_string())
}

/// A session: goes on with `from`, if it is given, and is interrupted when the observer was called so many
/// times. Checkpoints become files of the folder, numbered in order.
fn session(
    scene: &SceneDescription,
    settings: &RenderSettings,
    from: Option<&Path>,
    every: Duration,
    calls: usize,
    folder: &TempDir,
) -> (Outcome, Vec<PathBuf>) {
    let [width, height] = SIZE;
    let compiled = compile(scene, 0, width, height, settings).unwrap();
    let resumed = from.map(|file| resume(file, scene, settings).unwrap());
    let mut written = Vec::new();
    let first = fs::read_dir(folder.path()).unwrap().count();
    let saving = Saving {
        identity: identity(scene, settings),
        every,
        save: &mut |snapshot| {
            let file = folder.path().join((first + written.len()).to_string());
            snapshot.write(&file).unwrap();
            written.push(file);
        },
    };
    let called = std::sync::atomic::AtomicUsize::new(0);
    let observer = |_: &_| match called.fetch_add(1, std::sync::atomic::Ordering::Relaxed) {
        count if count + 1 >= calls => ControlFlow::Break(()),
        _ => ControlFlow::Continue(()),
    };
    let outcome =
        render_resumable(scene, &compiled, settings, &observer, resumed, Some(saving)).unwrap();
    (outcome, written)
}

/// The render without interruption.
fn whole(scene: &SceneDescription, settings: &RenderSettings) -> Outcome {
    session(scene, settings, None, NEVER, usize::MAX, &directory()).0
}

/// Every bit of the image, its variance and its layers.
fn bits(film: &Film) -> Vec<u64> {
    (0..film.len())
        .flat_map(|pixel| {
            let aux = film.aux(pixel).unwrap_or_default();
            film.mean(pixel)
                .into_iter()
                .chain(film.variance(pixel).unwrap_or_default())
                .chain(aux.albedo)
                .chain(aux.normal)
                .chain([aux.depth, film.samples(pixel) as f64])
        })
        .map(f64::to_bits)
        .collect()
}

fn base() -> RenderSettings {
    RenderSettings {
        budget: Budget::Samples(20),
        threads: 1,
        ..RenderSettings::default()
    }
}

/// Scenes and settings of every kind of schedule, sampler and integrator.
fn cases() -> Vec<(&'static str, RenderSettings)> {
    let sampler = |sampler| RenderSettings { sampler, ..base() };
    vec![
        ("hexroom.toml", RenderSettings { block: 4, ..base() }),
        ("hexroom.toml", sampler(SamplerKind::Independent)),
        ("hexroom.toml", sampler(SamplerKind::Stratified)),
        (
            "materials.toml",
            RenderSettings {
                aux: true,
                max_depth: Some(4),
                ..sampler(SamplerKind::Sobol)
            },
        ),
        (
            "hexroom.toml",
            RenderSettings {
                integrator: IntegratorKind::Whitted,
                sampler: SamplerKind::Stratified,
                transparent_shadows: true,
                ..base()
            },
        ),
        (
            "hexroom.toml",
            RenderSettings {
                integrator: IntegratorKind::Reference,
                budget: Budget::Samples(4),
                ..base()
            },
        ),
        (
            "furnace.toml",
            RenderSettings {
                budget: Budget::Error(0.02),
                ..base()
            },
        ),
        (
            "hexroom.toml",
            RenderSettings {
                adaptive: true,
                aux: true,
                sampler: SamplerKind::Sobol,
                budget: Budget::Samples(16),
                ..base()
            },
        ),
        (
            "hexroom.toml",
            RenderSettings {
                adaptive: true,
                budget: Budget::Error(0.6),
                ..base()
            },
        ),
    ]
}

/// What is counted and is the same for any number of threads and any wave.
fn counts(stats: &RenderStats) -> Vec<u64> {
    let depths = stats.depths.iter().map(|depth| depth.rays);
    [
        stats.paths,
        stats.camera_rays,
        stats.bounce_rays,
        stats.shadow_rays,
        stats.rejected,
        stats.truncated,
        stats.stages.last().map_or(0, |film| film.items),
    ]
    .into_iter()
    .chain(depths)
    .collect()
}

#[test]
fn the_image_is_bit_identical_from_every_checkpoint_of_a_render() {
    for (name, settings) in cases() {
        let scene = scene(name);
        let folder = directory();
        // One after every work item.
        let (outcome, checkpoints) =
            session(&scene, &settings, None, Duration::ZERO, usize::MAX, &folder);
        assert!(checkpoints.len() >= 10, "{} of {name}", checkpoints.len());
        let expected = bits(&outcome.film);
        let step = checkpoints.len().div_ceil(12);
        for (index, file) in checkpoints.iter().enumerate().step_by(step) {
            let other = RenderSettings {
                threads: 2 + index % 2,
                wave: [1000, 64, 4096][index % 3],
                ..settings.clone()
            };
            let (resumed, _) = session(&scene, &other, Some(file), NEVER, usize::MAX, &folder);
            assert_eq!(resumed.ended, outcome.ended);
            assert!(
                bits(&resumed.film) == expected,
                "{name} differs from checkpoint {index}: {settings:?}"
            );
            assert_eq!(counts(&resumed.stats), counts(&outcome.stats), "{name}");
        }
    }
}

#[test]
fn a_render_interrupted_again_and_again_comes_to_the_same_image_and_counts() {
    for (name, settings) in cases() {
        let scene = scene(name);
        let expected = whole(&scene, &settings);
        let folder = directory();
        let mut last: Option<PathBuf> = None;
        let mut sessions = 0;
        let outcome = loop {
            // The observer is called after the first work item, and then by time.
            let calls = if sessions < 4 { 1 } else { usize::MAX };
            let now = RenderSettings {
                threads: 1 + sessions % 2,
                wave: [4096, 100][sessions % 2],
                ..settings.clone()
            };
            let (outcome, written) = session(&scene, &now, last.as_deref(), NEVER, calls, &folder);
            assert_eq!(
                outcome.earlier.map_or(0, |earlier| earlier.sessions),
                sessions as u32
            );
            sessions += 1;
            last = written.last().cloned().or(last);
            if outcome.ended != EndReason::Interrupted {
                break outcome;
            }
        };
        assert_eq!(sessions, 5, "{name}");
        assert!(bits(&outcome.film) == bits(&expected.film), "{name}");
        assert_eq!(counts(&outcome.stats), counts(&expected.stats), "{name}");
    }
}

#[test]
fn more_samples_continue_a_render_that_was_complete() {
    let scene = scene("hexroom.toml");
    let samples = |count| RenderSettings {
        budget: Budget::Samples(count),
        ..base()
    };
    // Blocks of 16, the last one of 100 samples has 4.
    for (first, then) in [(64, 100), (100, 160), (100, 100), (64, 64)] {
        let folder = directory();
        let (complete, written) =
            session(&scene, &samples(first), None, NEVER, usize::MAX, &folder);
        assert_eq!(complete.film.min_samples(), first);
        let file = written.last().unwrap();
        let (outcome, _) = session(
            &scene,
            &samples(then),
            Some(file),
            NEVER,
            usize::MAX,
            &folder,
        );
        assert!(
            bits(&outcome.film) == bits(&whole(&scene, &samples(then)).film),
            "{first} and then {then} samples"
        );
        assert_eq!(outcome.stats.paths, then * u64::from(SIZE[0] * SIZE[1]));
    }
}

#[test]
fn time_and_error_goals_continue_each_other() {
    let scene = scene("hexroom.toml");
    for adaptive in [false, true] {
        let until = |budget| RenderSettings {
            budget,
            adaptive,
            ..base()
        };
        let goal = until(Budget::Error(0.15));
        let expected = whole(&scene, &goal);
        let folder = directory();
        for first in [Budget::Seconds(1e-9), Budget::Error(0.9)] {
            let (_, written) = session(&scene, &until(first), None, NEVER, usize::MAX, &folder);
            let file = written.last().unwrap();
            let (outcome, again) = session(&scene, &goal, Some(file), NEVER, usize::MAX, &folder);
            assert!(bits(&outcome.film) == bits(&expected.film), "{first:?}");
            // What is reached already ends at once, with nothing new.
            let (outcome, none) =
                session(&scene, &goal, Some(&again[0]), NEVER, usize::MAX, &folder);
            assert_eq!(outcome.ended, EndReason::Error);
            assert!(none.is_empty() && bits(&outcome.film) == bits(&expected.film));
        }
    }
}

#[test]
fn budgets_whose_blocks_are_others_are_refused_with_the_way_out() {
    let scene = scene("hexroom.toml");
    let folder = directory();
    let until = |budget| RenderSettings { budget, ..base() };
    let samples = |count| until(Budget::Samples(count));
    let adaptive = |count| RenderSettings {
        adaptive: true,
        ..samples(count)
    };
    let last = |settings: &RenderSettings| {
        let (_, written) = session(&scene, settings, None, NEVER, usize::MAX, &folder);
        written.last().unwrap().clone()
    };
    let twenty = last(&samples(20));
    let many = last(&samples(64));
    let timed = last(&until(Budget::Seconds(1e-9)));
    let placed = last(&adaptive(16));
    for (file, settings, part) in [
        (&twenty, samples(64), "give --block 5"),
        (&many, samples(62), "more than --spp 62"),
        (&many, samples(20), "give --spp 61 or more"),
        (&timed, samples(64), "give --seconds or --error"),
        (&many, until(Budget::Error(0.1)), "give --spp"),
        (&placed, adaptive(32), "cannot be given another"),
    ] {
        let message = resume(file, &scene, &settings).unwrap_err();
        assert!(message.contains(part), "{message}");
        assert!(message.contains(file.to_str().unwrap()), "{message}");
    }
    // The way out leads there.
    let block = RenderSettings {
        block: 5,
        ..samples(64)
    };
    let (outcome, _) = session(&scene, &block, Some(&twenty), NEVER, usize::MAX, &folder);
    assert!(bits(&outcome.film) == bits(&whole(&scene, &block).film));
}

#[test]
fn another_scene_setting_or_build_is_refused_by_its_name() {
    let room = scene("hexroom.toml");
    let folder = directory();
    let settings = base();
    let (_, written) = session(&room, &settings, None, NEVER, usize::MAX, &folder);
    let file = written.last().unwrap();
    assert!(resume(file, &room, &settings).is_ok());

    let mut moved = room.clone();
    moved.background.x += 1e-12;
    let mut small = room.clone();
    small.film.width -= 1;
    let with = |change: &dyn Fn(&mut RenderSettings)| {
        let mut settings = base();
        change(&mut settings);
        settings
    };
    for (scene, settings, parts) in [
        (&moved, base(), vec!["different content of the scene"]),
        (
            &small,
            base(),
            vec!["different size (70 × 40, now 69 × 40)"],
        ),
        (
            &room,
            with(&|s| s.seed = 1),
            vec!["different seed (0, now 1)"],
        ),
        (
            &room,
            with(&|s| {
                s.max_depth = Some(3);
                s.sampler = SamplerKind::Stratified;
            }),
            vec!["max depth (none, now 3)", "sampler (sobol, now stratified)"],
        ),
        (
            &room,
            with(&|s| s.aux = true),
            vec!["aux (false, now true)"],
        ),
        (
            &room,
            with(&|s| s.integrator = IntegratorKind::Whitted),
            vec!["integrator (path, now whitted)"],
        ),
        (
            &room,
            with(&|s| s.adaptive = true),
            vec!["adaptive (false, now true)"],
        ),
    ] {
        let message = resume(file, scene, &settings).unwrap_err();
        for part in parts {
            assert!(message.contains(part), "{message}");
        }
    }
    let build = Build {
        lanes: 3,
        commit: "0123".to_owned(),
        ..Build::current()
    };
    let identity = Identity::new(&room, 0, &settings, &build);
    let error = Resume::read(file, &room, &settings, &identity).unwrap_err();
    let lanes = format!("lanes ({}, now 3)", Build::current().lanes);
    assert!(error.message.contains(&lanes), "{error}");
    assert!(error.message.contains("commit ("), "{error}");
}

#[test]
fn textures_and_meshes_belong_to_the_scene() {
    let folder = directory();
    let at = |name: &str| folder.path().join(name);
    let texture = |value: u8| {
        let picture = image::RgbImage::from_pixel(2, 2, image::Rgb([value; 3]));
        picture.save(at("a.png")).unwrap();
    };
    let material = |extra: &str| {
        fs::write(
            at("a.mtl"),
            format!("newmtl m\nKd 0.5 0.5 0.5\nmap_Kd a.png\n{extra}"),
        )
        .unwrap();
    };
    let mesh = |extra: &str| {
        let text = format!(
            "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n{extra}"
        );
        fs::write(at("a.obj"), text).unwrap();
    };
    texture(100);
    material("");
    mesh("");
    let key =
        || wavepath::scene::fingerprint(&wavepath::scene::load(&at("a.obj"), &[]).unwrap(), 0);
    let mut keys = vec![key()];
    assert_eq!(key(), keys[0]);
    texture(101);
    keys.push(key());
    material("Ke 1 1 1\n");
    keys.push(key());
    mesh("v 0 0 1\nf 1 2 4\n");
    keys.push(key());
    keys.sort();
    keys.dedup();
    assert_eq!(keys.len(), 4);
}

/// A small render of the hexagonal room; samples are to be added.
fn room(folder: &TempDir) -> Command {
    let mut command = wavepath(folder);
    command.args(["render", "--width=80", "--height=60"]);
    command.arg(crate::support::scenes().join("hexroom.toml"));
    command
}

/// Waits for a file.
fn wait_for(file: &Path) {
    let start = Instant::now();
    while !file.exists() {
        assert!(start.elapsed() < Duration::from_secs(60), "no {file:?}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_killed_and_an_interrupted_render_end_with_the_image_of_a_whole_one() {
    let folder = directory();
    let options = ["--spp=3000", "--checkpoint=c", "--resume", "-o=a.exr"];
    // Killed after its first checkpoint.
    let mut child = start(room(&folder).args(options).arg("--checkpoint-every=0.05"));
    wait_for(&folder.path().join("c"));
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!folder.path().join("a.exr").exists());
    // Interrupted.
    let child = start(room(&folder).args(options));
    interrupt_when_rendering(&child);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
    assert!(
        stderr(&output).contains("--resume goes on"),
        "{}",
        stderr(&output)
    );
    // Goes on to the end, by another number of threads.
    let output =
        succeed(
            room(&folder)
                .args(options)
                .args(["--threads=1", "--wave=512", "--report=r.json"]),
        );
    assert!(
        stdout(&output).contains("resumed, session 3: "),
        "{}",
        stdout(&output)
    );
    assert!(stdout(&output).contains("/c\n"), "{}", stdout(&output));
    let report = report(&folder.path().join("r.json"));
    let resumed = report.resumed.unwrap();
    assert_eq!(resumed.sessions, 3);
    assert!(resumed.before.samples > 0.0 && resumed.before.cpu_seconds > 0.0);
    assert_eq!(resumed.before.samples + resumed.after.samples, 3000.0);
    assert_eq!(report.paths.count, 80 * 60 * 3000);
    assert_eq!(report.depths[0].rays, report.paths.count);

    succeed(room(&folder).args(["--spp=3000", "-o=b.exr"]));
    let [a, b] = ["a.exr", "b.exr"].map(|name| read_exr(&folder.path().join(name)).unwrap());
    assert!(a == b);
}

#[test]
fn a_checkpoint_is_not_overwritten_nor_used_unasked() {
    let folder = directory();
    let options = ["--spp=8", "--checkpoint=c", "-o=a.png"];
    let output = succeed(room(&folder).args(options).arg("--resume"));
    assert!(
        stderr(&output).contains("this is the beginning"),
        "{}",
        stderr(&output)
    );
    assert_eq!(files(&folder), ["a.png", "c"]);
    let kept = fs::read(folder.path().join("c")).unwrap();
    for (arguments, part) in [
        (
            vec!["--spp=8", "--checkpoint=c"],
            "is there already; give --resume",
        ),
        (
            vec!["--spp=8", "--checkpoint=c", "--resume", "--seed=1"],
            "c: the checkpoint is of another render, with different seed (0, now 1)",
        ),
        (
            vec![
                "--spp=8",
                "--checkpoint=c",
                "--resume",
                "--set=materials.glass.ior=1.6",
            ],
            "different content of the scene",
        ),
        (
            vec!["--spp=8", "--checkpoint=c", "--resume", "--camera=2"],
            "different camera (1, now 2)",
        ),
        (
            vec!["--spp=4", "--checkpoint=c", "--resume"],
            "c: the checkpoint",
        ),
        (vec!["--resume"], "--checkpoint"),
        (vec!["--checkpoint-every=1"], "--checkpoint"),
        (
            vec!["--checkpoint=d", "--checkpoint-every=0"],
            "--checkpoint-every must be",
        ),
        (vec!["--checkpoint=missing/d"], "missing/d: cannot write"),
        (vec!["--checkpoint=.", "--resume"], "not a regular file"),
        (vec!["-o=d.png", "--checkpoint=d.png"], "named twice"),
        (
            vec!["--checkpoint=a.png", "--resume", "-o=b.png"],
            "a.png: is not a checkpoint",
        ),
    ] {
        let message = refuse(room(&folder).args(arguments));
        assert!(message.contains(part), "{message}");
        assert_eq!(files(&folder), ["a.png", "c"], "{message}");
        assert!(fs::read(folder.path().join("c")).unwrap() == kept);
    }
    fs::write(folder.path().join("c"), &kept[..kept.len() / 2]).unwrap();
    let message = refuse(room(&folder).args(options).arg("--resume"));
    assert!(
        message.contains("c: the checkpoint is cut off"),
        "{message}"
    );
}

#[test]
fn a_folder_that_vanishes_costs_the_checkpoint_and_not_the_image() {
    let folder = directory();
    let inner = folder.path().join("inner");
    fs::create_dir(&inner).unwrap();
    let options = [
        "--spp=1000000",
        "--checkpoint=inner/c",
        "--checkpoint-every=0.05",
        "-o=a.png",
    ];
    let child = start(room(&folder).args(options));
    wait_for(&inner.join("c"));
    fs::rename(&inner, folder.path().join("outer")).unwrap();
    interrupt_when_rendering(&child);
    let output = child.wait_with_output().unwrap();
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(
        message.contains("warning: no checkpoint: inner/c"),
        "{message}"
    );
    assert!(message.contains("error: inner/c: "), "{message}");
    assert!(message.contains("interrupted: "), "{message}");
    assert!(!message.contains("goes on"), "{message}");
    assert_eq!(files(&folder), ["a.png", "outer"]);
}
