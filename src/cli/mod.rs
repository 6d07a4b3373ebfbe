//! The command line. Only this module and `main` print.

mod accels;
mod args;
mod compare;
mod converge;
mod gallery;
mod interrupt;
mod job;
mod mesh;
mod plan;
mod progress;
mod render;
mod stability;
mod variations;

use std::ffi::OsString;
use std::io::{self, Write};
use std::path::Path;
use std::process::ExitCode;

use clap::Parser;

use crate::error::{Error, Result};
use crate::film::write_atomically;

use args::{Args, Command};
use job::{RenderJob, SceneJob};

/// Exit code of bad input, bad usage and every other error.
pub const BAD_INPUT: u8 = 2;

/// How a command ended that met no error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// It did what was asked: exit code 0.
    Done,
    /// Images, answers of structures, or cases of stability are off by more than is allowed: exit code 1.
    Exceeded,
    /// It was interrupted: exit code 130, as shells report SIGINT. A render has written what there was.
    Interrupted,
}

impl From<Status> for ExitCode {
    fn from(status: Status) -> Self {
        Self::from(match status {
            Status::Done => 0,
            Status::Exceeded => 1,
            Status::Interrupted => interrupt::EXIT_CODE,
        })
    }
}

/// Runs the command in `args`, whose first item is the program's name.
pub fn run(args: impl IntoIterator<Item = OsString>) -> Result<Status> {
    let args = match Args::try_parse_from(args) {
        Ok(args) => args,
        Err(error) if error.use_stderr() => return Err(Error::usage(one_line(&error.to_string()))),
        // Help and version arrive as errors that belong on standard output.
        Err(help) => return print(&help.to_string()),
    };
    match args.command {
        None => render::run(&RenderJob::built_in()?),
        Some(Command::Render(args)) => render::run(&RenderJob::new(&args)?),
        Some(Command::Plan(args)) => plan::run(&SceneJob::new(&args)?),
        Some(Command::Compare(args)) => compare::run(&args),
        Some(Command::Mesh(args)) => mesh::run(&args),
        Some(Command::Accels(args)) => accels::run(&args),
        Some(Command::Converge(args)) => converge::run(&args),
        Some(Command::Gallery(args)) => gallery::run(&args),
        Some(Command::Stability(args)) => stability::run(&args),
    }
}

/// The message of a usage error without its heading and its repetition of the usage.
fn one_line(message: &str) -> String {
    let lines = message.lines().map(str::trim);
    let telling = lines
        .take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more information"))
        .filter(|line| !line.is_empty());
    let joined = telling.collect::<Vec<_>>().join(" ");
    joined.strip_prefix("error: ").unwrap_or(&joined).to_owned()
}

/// Prints to standard output. A reader that has gone (`| head`) is no error.
fn print(text: &str) -> Result<Status> {
    let mut output = io::stdout().lock();
    match output
        .write_all(text.as_bytes())
        .and_then(|()| output.flush())
    {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Error::io(Path::new("standard output"), &error))
        }
        _ => Ok(Status::Done),
    }
}

/// Writes a report aside and renames it.
fn write_json(path: &Path, json: &str) -> Result<()> {
    write_atomically(path, |file| {
        writeln!(file, "{json}").map_err(|error| Error::io(path, &error))
    })
}

/// Prints a line to standard error, if it can be.
fn note(line: &str) {
    let _ = writeln!(io::stderr(), "{line}");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn usage_error(args: &[&str]) -> String {
        let args = ["wavepath"].iter().chain(args).map(OsString::from);
        let message = run(args).unwrap_err().message;
        assert!(!message.contains('\n'), "{message}");
        message
    }

    #[test]
    fn usage_errors_are_one_line_that_names_the_option() {
        for (args, parts) in [
            (
                vec!["render", "a.toml", "--frobnicate"],
                vec!["--frobnicate"],
            ),
            (
                vec!["render", "a.toml", "--integrator", "x"],
                vec!["'x'", "--integrator", "whitted"],
            ),
            (
                vec!["render", "a.toml", "--width", "-5"],
                vec!["'-5'", "--width"],
            ),
            (
                vec!["render", "a.toml", "--spp", "many"],
                vec!["'many'", "--spp"],
            ),
            (
                vec!["render", "a.toml", "--spp", "1", "--error", "0.1"],
                vec!["--spp", "--error"],
            ),
            (
                vec!["render", "a.toml", "--seconds", "1", "--spp", "1"],
                vec!["--spp", "--seconds"],
            ),
            (vec!["render"], vec!["<SCENE>"]),
            (vec!["compare", "a.exr"], vec!["<B>"]),
            (vec!["mesh", "soup", "-o", "a.obj"], vec!["--triangles"]),
            (
                vec!["mesh", "cube", "--triangles=1000", "-o", "a.obj"],
                vec!["'cube'", "hairball", "terrain", "sponge", "soup"],
            ),
            (vec!["paint"], vec!["'paint'"]),
        ] {
            let message = usage_error(&args);
            for part in parts {
                assert!(message.contains(part), "{args:?}: {message}");
            }
        }
    }
}
