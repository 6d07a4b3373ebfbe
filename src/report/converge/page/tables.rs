//! The tables: one row per configuration, per pair, per checkpoint, and what is said once.

use maud::{Markup, html};

use super::super::{
    BiasTest, BiasVerdict, Checkpoint, Configuration, EndedBy, Found, Limit, Pair, ReferenceKind,
    ReferenceReport, Results, Row, TimeToError,
};
use super::format::{NONE, estimate, number, optional, percent};
use super::swatch;
use crate::report::Span;

/// One row per configuration: what a reader looks for first.
pub(super) fn summary(results: &Results) -> Markup {
    let goals: Vec<f64> = results
        .configurations
        .first()
        .map(|it| it.times_to_error.iter().map(|goal| goal.error).collect())
        .unwrap_or_default();
    html! {
        div.wide {
            table {
                thead {
                    tr {
                        th { "configuration" }
                        th { "efficiency, relative" }
                        th { "slope by samples" }
                        th { "slope by time" }
                        @for goal in &goals { th { "CPU s to " (percent(*goal)) } }
                        th { "last relative error" }
                        th { "time to unit variance" }
                        th { "Mrays per CPU s" }
                        th { "set up, CPU s" }
                        th { "bias" }
                    }
                }
                tbody {
                    @for (index, configuration) in results.configurations.iter().enumerate() {
                        (summary_row(index, configuration, &goals))
                    }
                }
            }
        }
    }
}

fn summary_row(index: usize, configuration: &Configuration, goals: &[f64]) -> Markup {
    let last = configuration.checkpoints.last();
    let time_to = |goal: f64| {
        let mut times = configuration.times_to_error.iter();
        times.find(|time| time.error == goal)
    };
    let slope = |fit: Option<super::super::Fit>| {
        let slope = fit.map(|fit| fit.slope);
        estimate(slope.as_ref(), |slope| {
            format!("{slope:.3}").replace('-', "−")
        })
    };
    html! {
        tr {
            th scope="row" { (swatch(index)) (configuration.name) }
            td { (estimate(configuration.efficiency.as_ref(), number)) }
            td { (slope(configuration.slope_by_samples)) }
            td { (slope(configuration.slope_by_time)) }
            @for goal in goals { td { (time_to(*goal).map(reached).unwrap_or_else(|| html! { (NONE) })) } }
            td { (estimate(last.and_then(|last| last.relative_error.as_ref()), percent)) }
            td { (estimate(configuration.time_to_unit_variance.as_ref(), number)) }
            td { (number(1e-6 * configuration.rays_per_second)) }
            td { (number(configuration.load.cpu_seconds + configuration.build.cpu_seconds)) }
            td { (verdict(&configuration.bias)) }
        }
    }
}

fn reached(time: &TimeToError) -> Markup {
    let sign = match time.found {
        Found::Interpolated => "",
        Found::Extrapolated => "≈ ",
        Found::AtMost => "≤ ",
        Found::NotReached => return html! { span.faint { "not reached" } },
    };
    html! { (sign) (estimate(time.seconds.as_ref(), number)) }
}

fn verdict(bias: &BiasTest) -> Markup {
    match bias.verdict {
        BiasVerdict::Biased => html! { span.warn { "biased" } },
        BiasVerdict::NotShown => html! { "not shown" },
        BiasVerdict::Untested => html! { span.faint { "untested" } },
    }
}

/// Configurations two by two.
pub(super) fn pairs(results: &Results) -> Markup {
    let name = |index: usize| {
        html! { (swatch(index)) (results.configurations.get(index).map_or(NONE, |it| it.name.as_str())) }
    };
    let row = |pair: &Pair| {
        html! {
            tr {
                th scope="row" { (name(pair.b)) }
                th scope="row" { (name(pair.a)) }
                td { (estimate(pair.efficiency.as_ref(), number)) }
                td { (estimate(pair.equal_time.as_ref(), number)) }
                td { (estimate(pair.equal_error.as_ref(), number)) }
                td { (estimate(pair.equal_samples.as_ref(), number)) }
                td.text { (pair.verdict) }
            }
        }
    };
    html! {
        div.wide {
            table {
                thead {
                    tr {
                        th { "configuration" } th { "over" } th { "efficiency" }
                        th { "RMSE at equal time" } th { "time to equal RMSE" } th { "RMSE at equal samples" }
                        th { "what it shows" }
                    }
                }
                tbody { @for pair in &results.pairs { (row(pair)) } }
            }
        }
    }
}

/// The bias test in figures.
pub(super) fn bias(results: &Results) -> Markup {
    html! {
        div.wide {
            table {
                thead {
                    tr {
                        th { "configuration" } th { "verdict" } th { "mean error" } th { "z" }
                        th { "least p of a block" } th { "where" } th { "by design" }
                    }
                }
                tbody {
                    @for (index, configuration) in results.configurations.iter().enumerate() {
                        @let bias = &configuration.bias;
                        tr {
                            th scope="row" { (swatch(index)) (configuration.name) }
                            td { (verdict(bias)) }
                            td { (number(bias.mean_error)) }
                            td { (optional(bias.z, number)) }
                            td { (optional(bias.block_p, number)) }
                            td {
                                @match bias.worst_block {
                                    Some((x, y)) => { "column " (x) ", row " (y) }
                                    None => (NONE),
                                }
                            }
                            td.text { (bias.by_design.join("; ")) }
                        }
                    }
                }
            }
        }
    }
}

/// What images are held against.
pub(super) fn references(results: &Results) -> Markup {
    let kind = |reference: &ReferenceReport| match &reference.kind {
        ReferenceKind::ClosedForm => "closed form".to_owned(),
        ReferenceKind::File { path } => path.clone(),
        ReferenceKind::Rendered { key, cached } => {
            let found = if *cached { "found" } else { "rendered" };
            format!("two halves, {found}, key {key}")
        }
    };
    html! {
        div.wide {
            table {
                thead {
                    tr {
                        th { "reference" } th { "samples per pixel" } th { "own relative error" } th { "mean radiance" }
                        th { "CPU s" } th { "image" }
                    }
                }
                tbody {
                    @for reference in &results.references {
                        tr {
                            th scope="row" { (kind(reference)) }
                            td { @match reference.samples { Some(n) => (n), None => "unknown" } }
                            td { (optional(reference.relative_error, percent)) }
                            td { (number(reference.mean)) }
                            td { (number(reference.time.cpu_seconds)) }
                            td.text { (reference.image.as_deref().unwrap_or(NONE)) }
                        }
                    }
                }
            }
        }
    }
}

/// Time outside of the curves.
pub(super) fn phases(results: &Results) -> Markup {
    let phases = &results.phases;
    let rows: [(&str, Span); 7] = [
        ("load", phases.load),
        ("build", phases.build),
        ("reference", phases.reference),
        ("noise of the machine", phases.noise),
        ("render passes", phases.render),
        ("score", phases.score),
        ("fit and write", phases.write),
    ];
    html! {
        div.wide {
            table {
                thead { tr { th { "phase" } th { "CPU s" } th { "wall s" } } }
                tbody {
                    @for (name, span) in rows {
                        tr {
                            th scope="row" { (name) }
                            td { (number(span.cpu_seconds)) }
                            td { (number(span.wall_seconds)) }
                        }
                    }
                }
            }
        }
    }
}

/// What ends each render, in words.
pub(super) fn limit(results: &Results) -> String {
    match results.settings.limit {
        Limit::Samples(samples) => format!("{samples} samples per pixel"),
        Limit::Seconds(seconds) => format!("{} CPU s each", number(seconds)),
    }
}

/// Every checkpoint of every configuration, means over the repeats.
pub(super) fn checkpoints(results: &Results) -> Markup {
    let row = |index: usize, name: &str, at: &Checkpoint| {
        html! {
            tr {
                th scope="row" { (swatch(index)) (name) }
                td { (number(at.samples)) }
                td { (estimate(Some(&at.cpu_seconds), number)) }
                td { (estimate(Some(&at.wall_seconds), number)) }
                td { (estimate(Some(&at.mse), number)) }
                td { (estimate(at.rmse.as_ref(), number)) }
                td {
                    (estimate(at.relative_error.as_ref(), percent))
                    @if at.near_reference { br; span.interval { "near the reference" } }
                }
                td { (estimate(Some(&at.relative_error_trimmed), percent)) }
                td { (estimate(Some(&at.smape), percent)) }
                td { (estimate(at.estimated_error.as_ref(), percent)) }
                td { (estimate(at.calibration.as_ref(), number)) }
                td { (estimate(at.time_to_unit_variance.as_ref(), number)) }
                td { (number(1e-6 * at.rays_per_second)) }
            }
        }
    };
    html! {
        div.wide.tall {
            table #checkpoints {
                thead {
                    tr {
                        th { "configuration" } th { "samples per pixel" } th { "CPU s" } th { "wall s" } th { "MSE" }
                        th { "RMSE" } th { "relative error" } th { "without the worst 0.1 %" } th { "SMAPE" }
                        th { "estimated error" } th { "MSE / estimate" } th { "time to unit variance" }
                        th { "million rays per CPU s" }
                    }
                }
                tbody {
                    @for (index, configuration) in results.configurations.iter().enumerate() {
                        @for at in &configuration.checkpoints { (row(index, &configuration.name, at)) }
                    }
                }
            }
        }
    }
}

/// Every image that was scored.
pub(super) fn rows(results: &Results) -> Markup {
    let cells = |row: &Row| {
        let errors = &row.errors;
        html! {
            td { (row.samples) }
            td { (row.camera_rays + row.bounce_rays + row.shadow_rays) }
            td { (number(row.cpu_seconds)) }
            td { (number(row.wall_seconds)) }
            td { (number(errors.mse)) }
            td { (number(errors.relmse)) }
            td { (number(errors.relmse_trimmed)) }
            td { (number(errors.smape)) }
            td { (optional(errors.estimated_error, percent)) }
            td { (optional(errors.bias_z, number)) }
            td { (optional(errors.block_p, number)) }
            td { @match errors.outliers { Some(n) => (n), None => (NONE) } }
            td { (row.rejected) }
        }
    };
    html! {
        div.wide.tall {
            table #rows {
                thead {
                    tr {
                        th { "configuration" } th { "seed" } th { "samples per pixel" } th { "rays" } th { "CPU s" }
                        th { "wall s" } th { "MSE" } th { "relMSE" } th { "trimmed relMSE" } th { "SMAPE" }
                        th { "estimated error" } th { "z" } th { "least p" } th { "outliers" } th { "rejected" }
                    }
                }
                tbody {
                    @for (index, configuration) in results.configurations.iter().enumerate() {
                        @for repeat in &configuration.repeats {
                            @for row in &repeat.rows {
                                tr {
                                    th scope="row" { (swatch(index)) (configuration.name) }
                                    td { (repeat.seed) }
                                    (cells(row))
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// How each configuration was rendered.
pub(super) fn configurations(results: &Results) -> Markup {
    let ended = |ended: EndedBy| match ended {
        EndedBy::Samples => "samples",
        EndedBy::Seconds => "time",
        EndedBy::Interrupted => "interruption",
    };
    html! {
        div.wide {
            table {
                thead {
                    tr {
                        th { "configuration" } th { "overrides" } th { "structure" } th { "ended by" } th { "features" }
                    }
                }
                tbody {
                    @for (index, configuration) in results.configurations.iter().enumerate() {
                        tr {
                            th scope="row" { (swatch(index)) (configuration.name) }
                            td.text { code { (configuration.overrides.join(" ")) } }
                            td { (configuration.accel) }
                            td { (ended(configuration.ended)) }
                            td.text { (configuration.features.join(", ")) }
                        }
                    }
                }
            }
        }
    }
}
