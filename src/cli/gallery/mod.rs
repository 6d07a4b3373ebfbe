//! `wavepath gallery`: figures of the hexagonal room, and a page that shows them.

mod figures;
mod thumbnail;

use std::fs;
use std::io::Write;

use clap::Parser;

use crate::error::{Error, Result};
use crate::film::write_atomically;
use crate::integrator::stats::EndReason;
use crate::report::gallery::{GalleryFigure, GallerySection, gallery_page};

use super::args::{Args, Command, GalleryArgs, RenderArgs};
use super::job::{BUILT_IN_PATH, MAX_THREADS, RenderJob, check_range};
use super::{Status, note, print, render};

use figures::{Figure, SECTIONS};

/// Range of `--scale`: from pictures of a few pixels to such as fill a wall.
const SCALES: std::ops::RangeInclusive<f64> = 0.01..=20.0;

pub(super) fn run(args: &GalleryArgs) -> Result<Status> {
    check_range("--threads", args.threads, 1, MAX_THREADS)?;
    if !SCALES.contains(&args.scale) {
        return Err(Error::usage(format!(
            "--scale must be {} to {}, not {}",
            SCALES.start(),
            SCALES.end(),
            args.scale
        )));
    }
    for folder in [Some(&args.out), args.thumbnails.as_ref()]
        .into_iter()
        .flatten()
    {
        fs::create_dir_all(folder).map_err(|error| Error::io(folder, &error))?;
    }
    let count: usize = SECTIONS.iter().map(|section| section.figures.len()).sum();
    let mut done = 0;
    let mut sections = Vec::new();
    for section in SECTIONS {
        let mut figures = Vec::new();
        for figure in section.figures {
            done += 1;
            if !args.quiet {
                note(&format!("{done} of {count}: {}", figure.name));
            }
            let made = make(figure, args)?;
            if made.report.result.ended == EndReason::Interrupted {
                note("interrupted: the last picture is not complete, the page was not written");
                return Ok(Status::Interrupted);
            }
            figures.push(made);
        }
        sections.push(GallerySection {
            title: section.title.to_owned(),
            text: section.text.to_owned(),
            figures,
        });
    }
    let page = args.out.join("index.html");
    let html = gallery_page(
        "The hexagonal room",
        "A room with a mirror for one of its walls, lit by one lamp; a matte, a glass and a mirror sphere, and a \
         tetrahedron of variable roughness. Each picture has the command that repeats it to the last bit.",
        &sections,
    );
    write_atomically(&page, |file| {
        file.write_all(html.as_bytes())
            .map_err(|error| Error::io(&page, &error))
    })?;
    if args.quiet {
        return Ok(Status::Done);
    }
    let place = std::path::absolute(&page).unwrap_or(page);
    print(&format!("wrote {}\n", place.display()))
}

/// Renders a figure into its files.
fn make(figure: &Figure, args: &GalleryArgs) -> Result<GalleryFigure> {
    let file = format!("{}.png", figure.name);
    let words = words(figure, args.scale, &file);
    let mut options = render_args(&words)?;
    let path = args.out.join(&file);
    options.output = vec![path.clone()];
    options.threads = args.threads;
    options.quiet = args.quiet;
    let (report, _) = render::execute(&RenderJob::new(&options)?)?;
    let png = fs::read(&path).map_err(|error| Error::io(&path, &error))?;
    if let Some(folder) = &args.thumbnails {
        thumbnail::write(&folder.join(format!("{}.jpg", figure.name)), &png)?;
    }
    Ok(GalleryFigure {
        title: figure.title.to_owned(),
        text: figure.text.to_owned(),
        file,
        png,
        command: words.iter().map(|word| quoted(word)).collect(),
        report,
    })
}

/// The command that renders a figure into `file`, word by word.
fn words(figure: &Figure, scale: f64, file: &str) -> Vec<String> {
    let side = (f64::from(figure.side) * scale)
        .round()
        .max(1.0)
        .to_string();
    let mut words: Vec<&str> = vec!["wavepath", "render", BUILT_IN_PATH];
    words.extend(["--width", &side, "--height", &side]);
    words.extend(figure.options);
    for value in figure.view.overrides() {
        words.extend(["--set", value]);
    }
    words.extend(["-o", file]);
    words.into_iter().map(str::to_owned).collect()
}

/// What the words of a `wavepath render` mean.
fn render_args(words: &[String]) -> Result<RenderArgs> {
    match Args::try_parse_from(words).map(|args| args.command) {
        Ok(Some(Command::Render(args))) => Ok(*args),
        Ok(_) => Err(Error::usage("a figure is made by `render`")),
        Err(error) => Err(Error::usage(super::one_line(&error.to_string()))),
    }
}

/// A word as one types it in a shell.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_=./".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    fn figures() -> impl Iterator<Item = &'static Figure> {
        SECTIONS.iter().flat_map(|section| section.figures)
    }

    #[test]
    fn every_figure_is_a_render_that_can_be_compiled() {
        let directory = tempfile::tempdir().unwrap();
        for figure in figures() {
            let mut options = render_args(&words(figure, 0.1, "a.png")).unwrap();
            options.output = vec![directory.path().join("a.png")];
            let job = RenderJob::new(&options).unwrap_or_else(|error| panic!("{error}"));
            let film = job.scene_job.scene.film;
            assert_eq!(
                (film.width, film.height),
                (figure.side / 10, figure.side / 10)
            );
            assert!(
                options.budget.spp.is_some(),
                "{} says its samples",
                figure.name
            );
        }
    }

    #[test]
    fn no_two_figures_share_a_name_or_a_picture() {
        let names: HashSet<&str> = figures().map(|figure| figure.name).collect();
        let pictures: HashSet<Vec<String>> =
            figures().map(|figure| words(figure, 1.0, "")).collect();
        assert_eq!(names.len(), figures().count());
        assert_eq!(pictures.len(), figures().count());
    }

    #[test]
    fn words_are_quoted_where_a_shell_would_change_them() {
        let words = ["a", "--set", "b=[0, 1]", "it's", ""].map(quoted);
        assert_eq!(words, ["a", "--set", "'b=[0, 1]'", r"'it'\''s'", "''"]);
    }
}
