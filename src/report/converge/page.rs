//! The page of a comparison: everything in one file that opens from disk.

mod curves;
mod format;
mod pictures;
mod tables;

use std::path::Path;

use maud::{Markup, PreEscaped, html};
use plotly::Plot;
use plotly::common::DashType;

use super::Results;
use crate::error::Result;
use crate::report::html::{document, json_element, machine_line};

use curves::{MEASURES, Plots};
use format::{number, percent};

/// Colours of configurations, readable on a light and on a dark ground.
const COLORS: [&str; 8] = [
    "#2f7ed8", "#d9762b", "#2a9d62", "#c2458f", "#8a63d2", "#a58a1c", "#1a9ba6", "#d14848",
];

/// The page of `results`, whose pictures are read from `folder`.
///
/// # Errors
/// If a picture cannot be read.
pub fn page(results: &Results, folder: &Path) -> Result<String> {
    let strip = pictures::strip(results, folder)?;
    let title = format!("{}: error against run time", results.scene.name);
    let body = html! {
        (header(results))
        section { h2 { "Which is the most efficient" } (efficiency_text()) (tables::summary(results)) }
        (curves(results))
        @if results.configurations.iter().any(|it| it.picture.is_some()) {
            section {
                h2 { "Pictures after equal time" }
                p {
                    "From top to bottom: the image; its relative difference from the reference, red where it is brighter, "
                    "blue where it is darker; the root of the mean squared relative error of each pixel over the repeats, "
                    "white at 100 %, with rings around the pixels that hold the error up most."
                }
                (strip)
            }
        }
        @if !results.pairs.is_empty() {
            section {
                h2 { "Two by two" }
                p {
                    "Ratios of the first configuration over the second, paired by repeat, with their 95 % intervals: in "
                    "efficiency above 1 is better, in error and time below 1."
                }
                (tables::pairs(results))
            }
        }
        section {
            h2 { "Bias" }
            p {
                "The mean signed error over its standard error, of the whole image and of each block of pixels (red above, "
                "blue below the reference). Errors by chance are within ±4."
            }
            (tables::bias(results))
            (pictures::bias_maps(results))
        }
        (conditions(results))
        section {
            h2 { "Definitions" }
            dl.definitions {
                @for definition in &results.definitions {
                    dt {
                        (definition.name)
                        @if !definition.unit.is_empty() { span.interval { " " (definition.unit) } }
                    }
                    dd { (definition.text) }
                }
            }
        }
        section {
            h2 { "Data" }
            h3 { "Means over the repeats" }
            (tables::checkpoints(results))
            details { summary { "Every image that was scored" } (tables::rows(results)) }
        }
        (json_element("plots", &Plots::new(results)))
        (plotly_script())
        script { (PreEscaped(include_str!("page/page.js"))) }
    };
    Ok(document(&title, include_str!("page/style.css"), &body))
}

fn header(results: &Results) -> Markup {
    let (scene, settings) = (&results.scene, &results.settings);
    let configurations = results.configurations.len();
    html! {
        header {
            h1 { (scene.name) ": error against run time" }
            p {
                "Camera " (scene.camera) ", " (scene.width) " × " (scene.height) " pixels; " (configurations)
                @if configurations == 1 { " configuration" } @else { " configurations" }
                ", each rendered " (settings.repeats)
                @if settings.repeats == 1 { " time" } @else { " times" }
                " to " (tables::limit(results)) " with " (settings.threads)
                @if settings.threads == 1 { " thread" } @else { " threads" }
                ", seed " (settings.seed) "."
            }
            p.faint.small { (machine_line(&results.machine)) }
            @if results.interrupted || !results.warnings.is_empty() {
                div.warnings.panel {
                    ul {
                        @if results.interrupted { li { "Interrupted: repeats and checkpoints may be missing." } }
                        @for warning in &results.warnings { li { (warning) } }
                    }
                }
            }
        }
    }
}

fn efficiency_text() -> Markup {
    html! {
        p {
            "Efficiency is 1 / (MSE × CPU time), relative to the first configuration of the same picture. In brackets: "
            "95 % intervals over the repeats. Slopes are those of ln RMSE; −0.5 is the law of independent samples."
        }
    }
}

fn curves(results: &Results) -> Markup {
    let has_stages = results
        .configurations
        .iter()
        .any(|it| !it.stages.is_empty());
    html! {
        section {
            h2 { "Curves" }
            p {
                "Lines are means over the repeats, areas their 95 % intervals, faint dots the repeats. Ringed points and the "
                "grey area are within three times the reference's own error and are not fitted. Triangles on the lower edge "
                "mark the time of setting up. A click on a name hides it, a double click shows it alone."
            }
            div.controls {
                label for="measure" { "Measure" }
                // Some browsers bring back the choice of the last visit.
                select #measure autocomplete="off" {
                    @for measure in &MEASURES { option { (measure.label) } }
                }
            }
            noscript { p.warn { "The curves need JavaScript; the tables below have their data." } }
            div.plots { div.plot.panel #by-time {} div.plot.panel #by-samples {} }
            @if has_stages {
                h2 { "Where the time goes" }
                p { "Share of each stage in the CPU time of the worker threads, over all repeats." }
                div.plot.panel #by-stage {}
            }
        }
    }
}

/// What the figures depend on: references, machine, time elsewhere.
fn conditions(results: &Results) -> Markup {
    let accounting = &results.accounting;
    html! {
        section {
            h2 { "Conditions" }
            (tables::configurations(results))
            (tables::references(results))
            (tables::phases(results))
            p.small {
                @if let Some(ratio) = accounting.ratio {
                    "The curves contain " (number(accounting.curves_cpu_seconds)) " CPU s, to wake the threads took "
                    (number(accounting.waking_cpu_seconds)) " CPU s; the process accounts for "
                    (number(accounting.process_cpu_seconds)) " CPU s in the same passes, a ratio of "
                    (format!("{ratio:.4}")) ". "
                }
                @if let Some(noise) = &results.noise {
                    "Two runs of the same work, " (number(noise.seconds)) " CPU s each, differ by " (percent(noise.spread))
                    " on this machine (" (noise.pairs) " pairs). "
                }
                @if let Some([one, five, fifteen]) = results.load_average_after {
                    "Load averages afterwards: " (format!("{one:.2} {five:.2} {fifteen:.2}")) "."
                }
            }
        }
    }
}

/// The plots library, as the first of the crate's embedded scripts. The second, which sets formulas, is
/// left out: a name with two dollar signs is no formula.
fn plotly_script() -> PreEscaped<String> {
    const END: &str = "</script>";
    let mut scripts = Plot::offline_js_sources();
    let end = scripts.find(END).expect("the crate embeds its library");
    scripts.truncate(end + END.len());
    PreEscaped(scripts)
}

fn series_color(index: usize) -> &'static str {
    COLORS[index % COLORS.len()]
}

/// Line style of a configuration; colours come again with another.
fn dash(index: usize) -> DashType {
    match index / COLORS.len() {
        0 => DashType::Solid,
        1 => DashType::Dot,
        _ => DashType::DashDot,
    }
}

/// A square in the colour of a configuration.
fn swatch(index: usize) -> Markup {
    html! { span.swatch style=(format!("background:{}", series_color(index))) {} }
}
