//! The program as a user runs it.

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;
use wavepath::film::{ExrImage, read_exr};
use wavepath::integrator::stats::EndReason;
use wavepath::report::RenderReport;
use wavepath::report::accels::{AccelsReport, RayKind};
use wavepath::report::stability::StabilityReport;
use wavepath::scene::{AccelQuality, Budget, SamplerKind, Strategy};

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/hexroom.toml");

/// A render small enough for a test.
const SMALL: [&str; 7] = [
    "render",
    SCENE,
    "--width=24",
    "--height=16",
    "--threads=2",
    "--spp",
    "32",
];

/// The program in a directory of its own.
pub(crate) fn wavepath(directory: &TempDir) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_wavepath"));
    command.current_dir(directory.path());
    command
}

pub(crate) fn directory() -> TempDir {
    tempfile::tempdir().unwrap()
}

pub(crate) fn stdout(output: &Output) -> &str {
    std::str::from_utf8(&output.stdout).unwrap()
}

pub(crate) fn stderr(output: &Output) -> &str {
    std::str::from_utf8(&output.stderr).unwrap()
}

pub(crate) fn files(directory: &TempDir) -> Vec<String> {
    let entries = fs::read_dir(directory.path()).unwrap();
    let mut names: Vec<String> = entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// Runs and expects success.
pub(crate) fn succeed(command: &mut Command) -> Output {
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    output
}

/// Runs and expects exit code 2 with one line, which it returns, and nothing else.
pub(crate) fn refuse(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.starts_with("error: "), "{message}");
    assert_eq!(message.lines().count(), 1, "{message}");
    assert_eq!(stdout(&output), "");
    message.trim_end().to_owned()
}

fn png_size(path: &Path) -> (u32, u32) {
    image::open(path).unwrap().into_rgb8().dimensions()
}

pub(crate) fn report(path: &Path) -> RenderReport {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// Waits until the process handles SIGINT, gives it time for some samples, and sends the signal.
pub(crate) fn interrupt_when_rendering(child: &Child) {
    const SIGINT_BIT: u64 = 1 << (libc::SIGINT - 1);
    let status = format!("/proc/{}/status", child.id());
    let start = Instant::now();
    loop {
        assert!(
            start.elapsed() < Duration::from_secs(60),
            "SIGINT is never handled"
        );
        let text = fs::read_to_string(&status).unwrap();
        let caught = text
            .lines()
            .find_map(|line| line.strip_prefix("SigCgt:"))
            .unwrap();
        if u64::from_str_radix(caught.trim(), 16).unwrap() & SIGINT_BIT != 0 {
            break;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    std::thread::sleep(Duration::from_millis(500));
    let id = libc::pid_t::try_from(child.id()).unwrap();
    // SAFETY: sends a signal to a child that has not been waited for, so that its id is still its own.
    assert_eq!(unsafe { libc::kill(id, libc::SIGINT) }, 0);
}

pub(crate) fn start(command: &mut Command) -> Child {
    command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

#[test]
fn every_named_image_is_written_and_said_where() {
    let directory = directory();
    let output = succeed(
        wavepath(&directory)
            .args(SMALL)
            .args(["-o", "a.png", "-o", "b.exr"]),
    );
    assert_eq!(files(&directory), ["a.png", "b.exr"]);
    assert_eq!(png_size(&directory.path().join("a.png")), (24, 16));
    let image = read_exr(&directory.path().join("b.exr")).unwrap();
    assert_eq!((image.width, image.height), (24, 16));
    assert_eq!(image.samples.unwrap(), vec![32; 24 * 16]);
    assert!(image.variance.is_some());
    assert!(image.mean.iter().flatten().any(|value| *value > 0.0));
    for name in ["a.png", "b.exr"] {
        assert!(
            stdout(&output).contains(&format!("/{name}\n")),
            "{}",
            stdout(&output)
        );
    }
    assert!(stdout(&output).contains("24 × 16 pixels, 32 samples per pixel"));
}

#[test]
fn image_is_named_after_the_scene_unless_told_otherwise() {
    let directory = directory();
    succeed(wavepath(&directory).args(SMALL));
    assert_eq!(files(&directory), ["hexroom.png"]);
}

#[test]
fn aux_adds_layers_to_the_exr_image() {
    let directory = directory();
    succeed(
        wavepath(&directory)
            .args(SMALL)
            .args(["--aux", "-o", "a.exr"]),
    );
    let metadata =
        exr::meta::MetaData::read_from_file(directory.path().join("a.exr"), true).unwrap();
    let names: Vec<String> = metadata.headers[0]
        .channels
        .list
        .iter()
        .map(|channel| channel.name.to_string())
        .collect();
    for name in [
        "R",
        "albedo.G",
        "normal.X",
        "depth.Z",
        "variance.B",
        "samples.Y",
    ] {
        assert!(
            names.iter().any(|other| other == name),
            "{name} is not in {names:?}"
        );
    }
}

#[test]
fn quiet_render_says_nothing() {
    let directory = directory();
    let output = succeed(wavepath(&directory).args(SMALL).arg("--quiet"));
    assert_eq!((stdout(&output), stderr(&output)), ("", ""));
    assert_eq!(files(&directory), ["hexroom.png"]);
}

#[test]
fn report_holds_the_settings_that_were_typed_and_consistent_counts() {
    let directory = directory();
    let options = [
        "--seed=18446744073709551615",
        "--wave=64",
        "--block=8",
        "--max-depth=3",
        "--roulette-depth=2",
        "--strategy=nee",
        "--sampler=stratified",
        "--camera=2",
        "--report=r.json",
    ];
    succeed(wavepath(&directory).args(SMALL).args(options));
    let report = report(&directory.path().join("r.json"));
    let settings = &report.settings;
    assert_eq!(
        (settings.seed, settings.wave, settings.block),
        (u64::MAX, 64, 8)
    );
    assert_eq!((settings.max_depth, settings.roulette_depth), (Some(3), 2));
    assert_eq!(
        (settings.strategy, settings.sampler),
        (Strategy::Nee, SamplerKind::Stratified)
    );
    assert_eq!(
        (settings.budget, settings.threads),
        (Budget::Samples(32), 2)
    );
    assert_eq!(
        (report.scene.name.as_str(), report.scene.camera.as_str()),
        ("hexroom", "2")
    );
    assert_eq!(
        (report.result.ended, report.result.min_samples),
        (EndReason::Samples, 32)
    );
    assert!(report.result.relative_error.unwrap() > 0.0);
    assert_eq!(report.paths.count, 24 * 16 * 32);
    assert_eq!(
        report.rays.total,
        report.rays.camera + report.rays.bounce + report.rays.shadow
    );
    assert_eq!(report.depths[0].rays, report.rays.camera);
    assert!(report.times.render.wall_seconds > 0.0 && report.memory.peak_bytes.unwrap() > 0);
}

/// Seconds in a line of the shell's `times`: `0m1.25s 0m0.03s`, user and system.
fn shell_seconds(line: &str) -> f64 {
    line.split_whitespace()
        .map(|time| {
            let (minutes, seconds) = time.strip_suffix('s').unwrap().split_once('m').unwrap();
            60.0 * minutes.parse::<f64>().unwrap() + seconds.parse::<f64>().unwrap()
        })
        .sum()
}

#[test]
#[cfg(unix)]
fn time_that_is_told_is_what_the_system_accounts_for() {
    let directory = directory();
    let options = "--width=300 --height=300 --spp=96 --threads=1 --quiet --report=r.json";
    let output = Command::new("sh")
        .current_dir(directory.path())
        .args([
            "-c",
            "\"$@\"; times",
            "sh",
            env!("CARGO_BIN_EXE_wavepath"),
            "render",
            SCENE,
        ])
        .args(options.split(' '))
        .output()
        .unwrap();
    // The shell's own time, then that of the program.
    let system = shell_seconds(stdout(&output).lines().nth(1).unwrap());
    let report = report(&directory.path().join("r.json"));
    // Shells count in ticks of 10 ms, of user and of system time.
    let ticks = 0.02;
    let near = |told: f64, from: f64, ticks: f64| (told - from).abs() <= 0.02 * from + ticks;
    let times = report.times;
    assert!(system > 0.5, "{system} s are too few to tell");
    assert!(
        near(times.process_cpu_seconds, system, ticks),
        "{system}: {times:?}"
    );
    // Almost all of it is in a phase, and the stages have the rendering.
    let phases = times.process_cpu_seconds - times.other_cpu_seconds();
    assert!(near(phases, system, ticks), "{system}: {times:?}");
    let stages: f64 = report.stages.iter().map(|stage| stage.cpu_seconds).sum();
    assert!(
        near(stages, times.render.cpu_seconds, 0.0),
        "{stages}: {times:?}"
    );
}

#[test]
fn time_limit_ends_the_render_and_progress_is_told_in_lines() {
    let directory = directory();
    let output = succeed(wavepath(&directory).args([
        "render",
        SCENE,
        "--width=24",
        "--height=16",
        "--seconds=4",
        "--report=r.json",
    ]));
    let report = report(&directory.path().join("r.json"));
    assert_eq!(report.result.ended, EndReason::Seconds);
    // A round that would overrun is not begun, so the end may come a slow round before the limit;
    // the first line of progress comes after 3 s.
    assert!(
        (3.1..30.0).contains(&report.times.render.wall_seconds),
        "{:?}",
        report.times
    );
    assert!(report.result.min_samples > 0);
    let progress = stderr(&output);
    assert!(
        progress.contains("samples per pixel") && progress.contains("Mrays/s"),
        "{progress}"
    );
}

#[test]
fn error_goal_ends_the_render_once_the_estimate_meets_it() {
    let directory = directory();
    succeed(wavepath(&directory).args([
        "render",
        SCENE,
        "--width=24",
        "--height=16",
        "--error=0.25",
        "--report=r.json",
    ]));
    let result = report(&directory.path().join("r.json")).result;
    assert_eq!(result.ended, EndReason::Error);
    assert!(result.relative_error.unwrap() <= 0.25, "{result:?}");
}

#[test]
fn adaptive_renders_tell_their_samples_and_error_or_what_is_missing() {
    let directory = directory();
    let output = succeed(wavepath(&directory).args([
        "render",
        SCENE,
        "--width=70",
        "--height=40",
        "--spp=32",
        "--adaptive",
        "--sampler=sobol",
        "--light-samples=2",
        "--glass-splits=2",
        "--report=r.json",
    ]));
    let text = stdout(&output);
    for part in [
        "sampler sobol",
        "2 light samples per hit, 2 splits at glass, adaptive sampling",
        "95 % interval",
        " (mean 3",
    ] {
        assert!(text.contains(part), "{part:?} is not in\n{text}");
    }
    let report = report(&directory.path().join("r.json"));
    assert!(report.settings.adaptive && report.result.min_samples < report.result.max_samples);
    let [low, high] = report.result.relative_error_interval.unwrap();
    let error = report.result.relative_error.unwrap();
    assert!(
        0.0 < low && low < error && error < high,
        "{low} {error} {high}"
    );

    for (setting, reason) in [
        ("render.spp=7", "at least 8 samples per pixel, not 7"),
        ("render.light_samples=0", "between 1 and 64, got 0"),
        ("render.glass_splits=9", "between 0 and 8, got 9"),
    ] {
        let message =
            refuse(wavepath(&directory).args(["render", SCENE, "--adaptive", "--set", setting]));
        assert!(message.contains(reason), "{message}");
    }
}

#[test]
fn interrupted_render_writes_complete_images_and_tells_their_samples() {
    let directory = directory();
    let child = start(wavepath(&directory).args([
        "render",
        SCENE,
        "--width=24",
        "--height=16",
        "--spp=1000000000000",
        "-o",
        "a.png",
        "-o",
        "a.exr",
        "--report=r.json",
    ]));
    interrupt_when_rendering(&child);
    let output = child.wait_with_output().unwrap();
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(130), "{message}");
    assert_eq!(files(&directory), ["a.exr", "a.png", "r.json"]);
    assert_eq!(png_size(&directory.path().join("a.png")), (24, 16));
    let samples = read_exr(&directory.path().join("a.exr"))
        .unwrap()
        .samples
        .unwrap();
    let (min, max) = (
        *samples.iter().min().unwrap(),
        *samples.iter().max().unwrap(),
    );
    assert!(max > 0);
    let told = if min == max {
        min.to_string()
    } else {
        format!("{min} to {max}")
    };
    let line = message.lines().last().unwrap();
    assert!(
        line.starts_with("interrupted: ") && line.contains("a.png"),
        "{line}"
    );
    assert!(
        line.contains(&format!("with {told} ")),
        "{line}, and the image has {told}"
    );
    let result = report(&directory.path().join("r.json")).result;
    assert_eq!(
        (result.ended, result.max_samples),
        (EndReason::Interrupted, u64::from(max))
    );
}

#[test]
fn default_command_renders_the_built_in_room_anywhere() {
    let directory = directory();
    let child = start(&mut wavepath(&directory));
    interrupt_when_rendering(&child);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
    assert_eq!(png_size(&directory.path().join("hexroom.png")), (800, 800));
    assert!(
        stdout(&output).contains("/hexroom.png\n"),
        "{}",
        stdout(&output)
    );
}

#[test]
fn default_command_prefers_the_scene_file_to_the_built_in_text() {
    let directory = directory();
    fs::create_dir(directory.path().join("scenes")).unwrap();
    fs::write(
        directory.path().join("scenes/hexroom.toml"),
        "nonsense = 1\n",
    )
    .unwrap();
    let message = refuse(&mut wavepath(&directory));
    assert!(
        message.starts_with("error: scenes/hexroom.toml:1:1: "),
        "{message}"
    );
}

#[test]
fn scene_that_is_missing_or_wrong_is_named() {
    let directory = directory();
    let message = refuse(wavepath(&directory).args(["render", "no/such.toml"]));
    assert!(message.contains("no/such.toml"), "{message}");
    fs::write(directory.path().join("bad.toml"), "film = [\n").unwrap();
    for command in ["render", "plan"] {
        let message = refuse(wavepath(&directory).args([command, "bad.toml"]));
        assert!(message.contains("bad.toml:"), "{message}");
    }
    assert_eq!(files(&directory), ["bad.toml"]);
}

#[test]
fn each_wrong_option_is_named_with_what_is_wrong() {
    let directory = directory();
    for (option, value, reason) in [
        ("--threads", "0", "at least 1"),
        ("--threads", "99999", "at most"),
        ("--wave", "0", "at least 1"),
        ("--wave", "99999999999", "at most"),
        ("--block", "0", "at least 1"),
        ("--block", "65", "at most 64"),
        ("--width", "0", "at least 1"),
        ("--height", "65536", "at most 65535"),
        ("--width", "-3", "-3"),
        ("--max-depth", "0", "at least 1"),
        ("--roulette-depth", "-1", "-1"),
        ("--spp", "0", "at least 1"),
        ("--spp", "1.5", "1.5"),
        ("--seconds", "-1", "greater than 0"),
        ("--seconds", "NaN", "greater than 0"),
        ("--seconds", "inf", "greater than 0"),
        ("--error", "0", "greater than 0"),
        ("--error", "few", "few"),
        ("--seed", "-1", "-1"),
        ("--integrator", "magic", "whitted"),
        ("--strategy", "magic", "nee"),
        ("--sampler", "magic", "sobol"),
        ("--light-samples", "0", "at least 1"),
        ("--light-samples", "65", "at most 64"),
        ("--glass-splits", "9", "at most 8"),
        ("--accel", "magic", "bvh2"),
    ] {
        let message = refuse(wavepath(&directory).args(["render", SCENE, option, value]));
        assert!(
            message.contains(option) && message.contains(reason),
            "{message}"
        );
    }
    let message = refuse(wavepath(&directory).args(["render", SCENE, "--camera", "9"]));
    assert!(
        message.contains("\"9\"") && message.contains("1, 2"),
        "{message}"
    );
    refuse(wavepath(&directory).args(["render", SCENE, "--set", "nonsense"]));
    let message = refuse(wavepath(&directory).args(["render", SCENE, "--spp=1", "--seconds=1"]));
    assert!(
        message.contains("--spp") && message.contains("--seconds"),
        "{message}"
    );
    assert_eq!(files(&directory), Vec::<String>::new());
}

#[test]
fn output_that_cannot_be_written_is_found_before_rendering() {
    // Rendered first, this would not end.
    let endless = ["render", SCENE, "--spp=1000000000000"];
    let directory = directory();
    fs::create_dir(directory.path().join("taken.png")).unwrap();
    for (options, part) in [
        (vec!["-o", "missing/a.png"], "missing/a.png"),
        (vec!["-o", "taken.png"], "taken.png"),
        (vec!["-o", "a.png", "-o", "missing/a.exr"], "missing/a.exr"),
        (vec!["-o", "a.gif"], "a.gif"),
        (vec!["-o", "a.png", "-o", "./a.png"], "a.png"),
        (vec!["--report", "missing/r.json"], "missing/r.json"),
        (vec!["--report", "scene.toml"], "scene.toml"),
    ] {
        let message = refuse(wavepath(&directory).args(endless).args(options));
        assert!(message.contains(part), "{message}");
    }
    assert_eq!(files(&directory), ["taken.png"]);
}

#[test]
fn image_too_large_for_the_memory_is_refused_with_numbers() {
    let directory = directory();
    let message = refuse(wavepath(&directory).args([
        "render",
        SCENE,
        "--width=65535",
        "--height=65535",
        "--aux",
    ]));
    assert!(
        message.contains("65535 × 65535") && message.contains("GiB"),
        "{message}"
    );
}

#[test]
fn set_replaces_a_value_of_the_scene_file() {
    let directory = directory();
    let options = [
        "--set",
        "film.width=12",
        "--set",
        "film.height=9",
        "--spp=1",
        "-o",
        "a.png",
    ];
    succeed(wavepath(&directory).args(["render", SCENE]).args(options));
    assert_eq!(png_size(&directory.path().join("a.png")), (12, 9));
}

#[test]
fn plan_is_printed_and_nothing_is_written() {
    let directory = directory();
    let output = succeed(wavepath(&directory).args(["plan", SCENE, "--width=24", "--height=16"]));
    let text = stdout(&output);
    assert!(
        text.starts_with("hexroom, camera 1, 24 × 16 pixels\nloaded in "),
        "{text}"
    );
    assert!(text.lines().count() > 1, "{text}");
    assert_eq!(files(&directory), Vec::<String>::new());
}

/// Writes a small render to `name` with a seed of its own.
fn render_exr(directory: &TempDir, name: &str, seed: &str) -> ExrImage {
    succeed(
        wavepath(directory)
            .args(SMALL)
            .args(["--seed", seed, "-o", name]),
    );
    read_exr(&directory.path().join(name)).unwrap()
}

#[test]
fn equal_images_compare_as_equal() {
    let directory = directory();
    let (a, b) = (
        render_exr(&directory, "a.exr", "1"),
        render_exr(&directory, "b.exr", "1"),
    );
    assert_eq!(a, b);
    let output =
        succeed(wavepath(&directory).args(["compare", "a.exr", "b.exr", "--max-relmse=0"]));
    assert!(
        stdout(&output).contains("relMSE              0.000000e0\n"),
        "{}",
        stdout(&output)
    );
}

#[test]
fn difference_beyond_the_limit_is_exit_code_1_with_the_image_written() {
    let directory = directory();
    render_exr(&directory, "a.exr", "1");
    render_exr(&directory, "b.exr", "2");
    let compare = |limit: &str| {
        let options = [
            "compare",
            "a.exr",
            "b.exr",
            "--diff=d.png",
            "--max-relmse",
            limit,
        ];
        wavepath(&directory).args(options).output().unwrap()
    };
    let output = compare("0");
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(stderr(&output).contains("exceeds 0"), "{}", stderr(&output));
    assert!(
        stdout(&output).contains("standard error"),
        "{}",
        stdout(&output)
    );
    assert_eq!(png_size(&directory.path().join("d.png")), (24, 16));
    assert_eq!(compare("1e9").status.code(), Some(0));
}

#[test]
fn comparison_refuses_what_it_cannot_compare() {
    let directory = directory();
    render_exr(&directory, "a.exr", "1");
    succeed(wavepath(&directory).args([
        "render",
        SCENE,
        "--width=8",
        "--height=8",
        "--spp=1",
        "-o",
        "small.exr",
    ]));
    fs::write(
        directory.path().join("cut.exr"),
        &fs::read(directory.path().join("a.exr")).unwrap()[..900],
    )
    .unwrap();
    for (arguments, part) in [
        (vec!["a.exr", "small.exr"], "24 × 16 and 8 × 8"),
        (vec!["a.exr", "missing.exr"], "missing.exr"),
        (vec!["cut.exr", "a.exr"], "cut.exr"),
        (vec!["a.exr", "a.exr", "--max-relmse=NaN"], "--max-relmse"),
        (vec!["a.exr", "a.exr", "--max-relmse=-1"], "--max-relmse"),
        (vec!["a.exr", "a.exr", "--diff=d.exr"], "d.exr"),
        (
            vec!["a.exr", "a.exr", "--diff=missing/d.png"],
            "missing/d.png",
        ),
    ] {
        let message = refuse(wavepath(&directory).arg("compare").args(arguments));
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn help_and_version_are_no_errors() {
    let directory = directory();
    let help = succeed(wavepath(&directory).arg("--help"));
    for command in ["render", "plan", "compare", "mesh"] {
        assert!(stdout(&help).contains(command), "{}", stdout(&help));
    }
    let version = succeed(wavepath(&directory).arg("--version"));
    assert!(stdout(&version).starts_with(concat!("wavepath ", env!("CARGO_PKG_VERSION"))));
}

#[test]
fn every_kind_of_mesh_is_written_as_announced_and_renders() {
    let directory = directory();
    for kind in ["hairball", "terrain", "sponge", "soup"] {
        let (mesh, scene) = (format!("{kind}.obj"), format!("{kind}.toml"));
        let options = ["mesh", kind, "--triangles=3000", "--seed=5", "-o", &mesh];
        let output = succeed(wavepath(&directory).args(options));
        let text = fs::read_to_string(directory.path().join(&mesh)).unwrap();
        let faces = text.lines().filter(|line| line.starts_with("f ")).count();
        assert!((2_112..=3_000).contains(&faces), "{kind}: {faces}");
        let said = stdout(&output);
        assert!(
            said.starts_with(&format!("{kind}, {faces} triangles\nwrote /")),
            "{said}"
        );
        assert!(said.ends_with(&format!("/{mesh}\n")), "{said}");
        assert_eq!(stderr(&output), "");

        fs::write(
            directory.path().join(&scene),
            format!(
                "film = {{ width = 8, height = 8 }}\nbackground = {{ radiance = 1 }}\n\
                 cameras.a = {{ eye = [0, -4, 2], look_at = [0, 0, 0], up = [0, 0, 1], fov = 40 }}\n\
                 materials.grey = {{ type = \"lambertian\", reflectance = 0.5 }}\n\
                 [[shapes]]\ntype = \"obj\"\nmaterial = \"grey\"\nfile = \"{mesh}\"\n"
            ),
        )
        .unwrap();
        let image = format!("{kind}.png");
        let render = ["render", &scene, "--spp=1", "--quiet", "-o", &image];
        let output = succeed(wavepath(&directory).args(render));
        assert_eq!((stdout(&output), stderr(&output)), ("", ""), "{kind}");
        assert_eq!(png_size(&directory.path().join(image)), (8, 8));
    }
}

#[test]
fn quiet_mesh_says_nothing_and_equal_seeds_make_equal_files() {
    let directory = directory();
    let mut contents = Vec::new();
    for (name, seed) in [("a.obj", "1"), ("b.OBJ", "1"), ("c.obj", "2")] {
        let options = ["mesh", "soup", "--triangles=1000", "-q", "-o", name];
        let output = succeed(wavepath(&directory).args(options).args(["--seed", seed]));
        assert_eq!((stdout(&output), stderr(&output)), ("", ""));
        contents.push(fs::read(directory.path().join(name)).unwrap());
    }
    assert_eq!(contents[0], contents[1]);
    assert_ne!(contents[0], contents[2]);
}

#[test]
fn mesh_that_cannot_be_made_or_written_is_refused() {
    let directory = directory();
    fs::create_dir(directory.path().join("taken.obj")).unwrap();
    for (triangles, output, part) in [
        ("999", "a.obj", "999"),
        ("30000001", "a.obj", "30000000"),
        ("-5", "a.obj", "--triangles"),
        ("1e6", "a.obj", "--triangles"),
        ("1000", "a.ply", ".obj"),
        ("1000", "taken.obj", "taken.obj"),
        ("1000", "missing/a.obj", "missing/a.obj"),
    ] {
        let options = ["mesh", "terrain", "--triangles", triangles, "-o", output];
        let message = refuse(wavepath(&directory).args(options));
        assert!(message.contains(part), "{message}");
    }
    assert_eq!(files(&directory), ["taken.obj"]);
}

#[test]
fn interrupted_mesh_leaves_no_file() {
    let directory = directory();
    let options = ["mesh", "hairball", "--triangles=30000000", "-o", "a.obj"];
    let child = start(wavepath(&directory).args(options));
    interrupt_when_rendering(&child);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
    assert_eq!(stderr(&output), "interrupted; no file was written\n");
    assert_eq!(files(&directory), Vec::<String>::new());
}

/// A comparison small enough for a test.
fn accels<'a>(scene: &'a str, structures: &'a str) -> [&'a str; 9] {
    [
        "accels",
        scene,
        "--width=64",
        "--height=48",
        "--threads=2",
        "--rounds=2",
        "--count=5000",
        "--structures",
        structures,
    ]
}

const CORNELL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell.toml");

#[test]
fn accels_compares_structures_and_writes_every_figure() {
    let directory = directory();
    let output = succeed(
        wavepath(&directory)
            .args(accels(
                CORNELL,
                "linear,octree,bvh2,bvh8,obvhs-bvh2,obvhs-cwbvh",
            ))
            .args(["--set", "render.accel_quality=fast"])
            .args(["--json", "a.json", "-q"]),
    );
    assert_eq!(stderr(&output), "");
    assert_eq!(files(&directory), ["a.json"]);
    let text = fs::read_to_string(directory.path().join("a.json")).unwrap();
    let report: AccelsReport = serde_json::from_str(&text).unwrap();
    assert_eq!((report.triangles, report.spheres), (32, 0));
    assert_eq!(report.scene.width, 64);
    assert_eq!(report.settings.kinds, RayKind::ALL);
    assert_eq!(report.settings.quality, AccelQuality::Fast);
    let names: Vec<&str> = report.structures.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "linear",
            "octree",
            "bvh2",
            "bvh8",
            "obvhs-bvh2",
            "obvhs-cwbvh"
        ]
    );
    for structure in &report.structures {
        assert!(stdout(&output).contains(&structure.name));
        assert_eq!(structure.kinds.len(), 4);
        for figures in &structure.kinds {
            assert_eq!(figures.rays, 5000);
            assert_eq!(figures.rounds.len(), 2);
            assert_eq!(figures.nodes_per_ray.is_some(), structure.own);
            assert_eq!(figures.differences.rays, 5000);
            assert!(figures.mrays_per_cpu_second.least > 0.0);
            assert!(figures.ratio_to_best > 0.0 && figures.ratio_to_best <= 1.0);
            if structure.own {
                assert_eq!(figures.differences.differing, 0, "{}", structure.name);
            }
        }
    }
}

#[test]
fn accels_leaves_out_who_cannot_take_part_and_says_why() {
    let directory = directory();
    // Other projects' structures hold no spheres, and this scene has three.
    let output = succeed(
        wavepath(&directory)
            .args(accels(SCENE, "bvh8,obvhs-bvh2"))
            .args(["--rays", "primary", "-q"]),
    );
    assert!(
        stderr(&output).contains("obvhs-bvh2 is left out"),
        "{}",
        stderr(&output)
    );
    assert!(stderr(&output).contains("spheres"));
    assert!(!stdout(&output).contains("obvhs") && stdout(&output).contains("bvh8"));

    let output = succeed(
        wavepath(&directory)
            .env("EMBREE_LIBRARY", directory.path().join("nowhere"))
            .args(accels(CORNELL, "bvh8,embree-medium"))
            .args(["--rays", "primary", "-q"]),
    );
    assert!(
        stderr(&output).contains("embree-medium is left out"),
        "{}",
        stderr(&output)
    );
    assert!(stdout(&output).contains("bvh8"));
}

#[test]
fn accels_refuses_what_it_does_not_know() {
    let directory = directory();
    let refused = |more: &[&str]| {
        let mut command = wavepath(&directory);
        command.args(["accels", CORNELL]).args(more);
        refuse(&mut command)
    };
    let message = refused(&["--structures", "bvh8,oak"]);
    assert!(
        message.contains("\"oak\"") && message.contains("bvh8"),
        "{message}"
    );
    assert!(refused(&["--rays", "gamma"]).contains("'gamma'"));
    assert!(refused(&["--count", "0"]).contains("--count"));
    assert!(refused(&["--rounds", "0"]).contains("--rounds"));
    assert!(refused(&["--json", "a.txt"]).contains(".json"));
    assert!(refused(&["--json", "no/a.json"]).contains("no/a.json"));
    // Nobody left to compare.
    let message = {
        let mut command = wavepath(&directory);
        command.args(accels(SCENE, "obvhs-bvh2")).arg("-q");
        let output = command.output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        stderr(&output).to_owned()
    };
    assert!(message.contains("none of the structures"), "{message}");
}

#[test]
fn a_mesh_renders_without_a_scene_file_and_tells_what_loading_took() {
    let directory = directory();
    let mesh = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/octahedron.obj");
    fs::copy(mesh, directory.path().join("stone.v2.obj")).unwrap();
    let output = succeed(wavepath(&directory).args([
        "render",
        "stone.v2.obj",
        "--width=24",
        "--height=16",
        "--spp=4",
        "--report=r.json",
    ]));
    assert!(stdout(&output).contains("stone.v2.obj: 8 triangles, 6 vertices"));
    assert_eq!(
        files(&directory),
        ["r.json", "stone.v2.obj", "stone.v2.png"]
    );
    let load = report(&directory.path().join("r.json")).load;
    let bytes = fs::metadata(mesh).unwrap().len();
    assert_eq!((load.meshes[0].bytes, load.meshes[0].triangles), (bytes, 8));
    let picture = image::open(directory.path().join("stone.v2.png")).unwrap();
    let row = picture.into_rgb8();
    let (middle, corner) = (row.get_pixel(12, 8), row.get_pixel(0, 0));
    assert_ne!(
        middle, corner,
        "the mesh is in the middle, the sky around it"
    );
}

#[test]
fn warnings_are_one_error_when_strict() {
    let directory = directory();
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 5 5\nf 1 2 3\nf 1 1 2\n";
    fs::write(directory.path().join("a.obj"), text).unwrap();
    let message = refuse(wavepath(&directory).args(["plan", "a.obj", "--strict"]));
    for part in [
        "a.obj: 2 warnings under --strict: ",
        "1 face of zero area removed (line 6)",
        "1 vertex of no face removed (line 4)",
    ] {
        assert!(message.contains(part), "{message}");
    }
    let output = succeed(wavepath(&directory).args(["plan", "a.obj"]));
    assert_eq!(stderr(&output).lines().count(), 2, "{}", stderr(&output));
}

#[test]
fn gallery_is_a_page_with_every_picture_and_the_command_that_repeats_it() {
    let directory = directory();
    let place = |name: &str| directory.path().join(name);
    let arguments = [
        "gallery",
        "--scale=0.04",
        "--out=pictures",
        "--thumbnails=small",
    ];
    let output = succeed(wavepath(&directory).args(arguments).arg("-q"));
    assert_eq!(stdout(&output), "");
    let page = fs::read_to_string(place("pictures/index.html")).unwrap();
    let names: Vec<String> = fs::read_dir(place("pictures"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name != "index.html")
        .collect();
    assert!(names.len() >= 16, "{names:?}");
    for name in &names {
        assert!(page.contains(&format!("href=\"{name}\"")), "{name}");
        let small = place("small").join(name).with_extension("jpg");
        assert_eq!(png_size(&small), (200, 200));
    }
    assert_eq!(
        page.matches("src=\"data:image/png;base64,").count(),
        names.len()
    );

    // The options of one of them, as the page has them, make its file again.
    succeed(
        wavepath(&directory)
            .args(["render", "scenes/hexroom.toml", "--spp=100", "-q"])
            .args(["--width=16", "--height=16", "-o", "again.png"]),
    );
    assert_eq!(
        fs::read(place("again.png")).unwrap(),
        fs::read(place("pictures/100spp.png")).unwrap()
    );

    let message = refuse(wavepath(&directory).args(["gallery", "--scale=0"]));
    assert!(message.contains("--scale"), "{message}");
}

#[test]
fn stability_prints_the_cases_asked_for_and_writes_them() {
    let directory = directory();
    let output = succeed(wavepath(&directory).args([
        "stability",
        "--quiet",
        "--case=self-hits",
        "--case=frames",
        "--structures=bvh8,octree",
        "--json=findings.json",
    ]));
    assert_eq!(stderr(&output), "");
    let text = stdout(&output);
    assert!(text.contains("pass (2 structures)"), "{text}");
    let json = fs::read_to_string(directory.path().join("findings.json")).unwrap();
    let report: StabilityReport = serde_json::from_str(&json).unwrap();
    assert_eq!(report.settings.cases, ["self-hits", "frames"]);
    let cases = |name: &str| report.findings.iter().filter(|f| f.case == name).count();
    assert_eq!((cases("self-hits"), cases("frames")), (7, 2));
    assert!(report.findings.iter().all(|finding| finding.passed));
    let structures: Vec<&str> = report.findings[0]
        .structures
        .iter()
        .map(|part| part.structure.as_str())
        .collect();
    assert_eq!(structures, ["octree", "bvh8"]);

    let listed = succeed(wavepath(&directory).args(["stability", "--list"]));
    assert!(
        stdout(&listed)
            .lines()
            .any(|line| line.contains("needle-fan"))
    );
}

#[test]
fn stability_refuses_what_it_does_not_know_before_it_runs() {
    let directory = directory();
    for (argument, part) in [
        ("--case=speed", "there is no case \"speed\""),
        ("--structures=bvh9", "there is no structure \"bvh9\""),
        ("--rays=0", "--rays must be at least 1"),
        ("--json=findings.txt", "must end in .json"),
    ] {
        let message = refuse(wavepath(&directory).args(["stability", argument]));
        assert!(message.contains(part), "{message}");
    }
    assert!(files(&directory).is_empty());
}
