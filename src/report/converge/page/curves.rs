//! The curves: each measure against CPU time and against samples, both axes logarithmic.

use maud::html;
use plotly::color::NamedColor;
use plotly::common::{
    Anchor, DashType, ExponentFormat, Fill, Font, HoverInfo, Line, Marker, MarkerSymbol, Mode,
    Orientation, Title,
};
use plotly::layout::{Annotation, Axis, AxisType, BarMode, HoverMode, Legend, Margin};
use plotly::{Bar, Layout, Plot, Scatter};
use serde::Serialize;

use super::super::{Checkpoint, Configuration, Estimate, Fit, ReferenceReport, Results, Row};
use super::format::{estimate_text, number, percent};
use super::{dash, series_color};

/// Pixels of the height of the axis of a plot, and those above it.
const AXIS: usize = 330;
const TOP: usize = 14;
/// Pixels below it: its numbers and name, and a line of the legend.
const X_TITLE: usize = 60;
const LEGEND_LINE: usize = 20;
/// About the width of the legend.
const LEGEND_WIDTH: usize = 390;
/// Pixels on the right of a plot, where labels are.
const RIGHT: usize = 170;
/// Least pixels between two labels.
const LABEL_DISTANCE: f64 = 17.0;
/// Curves with labels: more would run over the lower edge.
const MOST_LABELS: usize = 8;
/// Letters of a name in a label; the legend has all.
const LABEL_LETTERS: usize = 18;
/// Share of the range of an axis that is left free at each end.
const PADDING: f64 = 0.04;
/// Decades between the first point and a mark of the time before it, at most.
const SETUP_DECADES: f64 = 2.0;
/// An error within this many times the reference's own is not fitted.
const REFERENCE_TIMES: f64 = 3.0;

/// A measure that can be drawn.
pub(super) struct Measure {
    /// What it is called on the page.
    pub(super) label: &'static str,
    /// Its exponent over samples where these are independent.
    law: f64,
    of_checkpoint: fn(&Checkpoint) -> Option<Estimate>,
    of_row: fn(&Row) -> Option<f64>,
    /// The reference's own, in the same unit.
    of_reference: fn(&ReferenceReport) -> Option<f64>,
    text: fn(f64) -> String,
    is_fraction: bool,
    /// Whether the fits of the results are those of this measure.
    is_fitted: bool,
}

/// Every measure, the first is shown first.
pub(super) const MEASURES: [Measure; 7] = [
    Measure {
        label: "relative error",
        law: -0.5,
        of_checkpoint: |at| at.relative_error,
        of_row: |row| root(row.errors.relmse),
        of_reference: |reference| reference.relative_error,
        text: percent,
        is_fraction: true,
        is_fitted: false,
    },
    Measure {
        label: "RMSE",
        law: -0.5,
        of_checkpoint: |at| at.rmse,
        of_row: |row| root(row.errors.mse),
        of_reference: |reference| reference.variance.map(f64::sqrt),
        text: number,
        is_fraction: false,
        is_fitted: true,
    },
    Measure {
        label: "MSE",
        law: -1.0,
        of_checkpoint: |at| Some(at.mse),
        of_row: |row| Some(row.errors.mse),
        of_reference: |reference| reference.variance,
        text: number,
        is_fraction: false,
        is_fitted: false,
    },
    Measure {
        label: "relative error without the worst 0.1 % of the pixels",
        law: -0.5,
        of_checkpoint: |at| Some(at.relative_error_trimmed),
        of_row: |row| root(row.errors.relmse_trimmed),
        of_reference: |_| None,
        text: percent,
        is_fraction: true,
        is_fitted: false,
    },
    Measure {
        label: "SMAPE",
        law: -0.5,
        of_checkpoint: |at| Some(at.smape),
        of_row: |row| Some(row.errors.smape),
        of_reference: |_| None,
        text: percent,
        is_fraction: true,
        is_fitted: false,
    },
    Measure {
        label: "relative error as the renderer estimates it",
        law: -0.5,
        of_checkpoint: |at| at.estimated_error,
        of_row: |row| row.errors.estimated_error,
        of_reference: |_| None,
        text: percent,
        is_fraction: true,
        is_fitted: false,
    },
    Measure {
        label: "time to unit variance, MSE × CPU s",
        law: 0.0,
        of_checkpoint: |at| at.time_to_unit_variance,
        of_row: |row| Some(row.errors.mse * row.cpu_seconds),
        of_reference: |_| None,
        text: number,
        is_fraction: false,
        is_fitted: false,
    },
];

/// What curves are drawn over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Abscissa {
    CpuSeconds,
    Samples,
}

/// The plots of the page, as its script reads them.
#[derive(Serialize)]
pub(super) struct Plots {
    measures: Vec<MeasurePlots>,
    stages: Option<serde_json::Value>,
}

#[derive(Serialize)]
struct MeasurePlots {
    time: serde_json::Value,
    samples: serde_json::Value,
}

impl Plots {
    pub(super) fn new(results: &Results) -> Self {
        let measures = MEASURES.iter().map(|measure| MeasurePlots {
            time: plot(results, measure, Abscissa::CpuSeconds),
            samples: plot(results, measure, Abscissa::Samples),
        });
        Self {
            measures: measures.collect(),
            stages: stages(results),
        }
    }
}

fn root(square: f64) -> Option<f64> {
    (square > 0.0).then(|| square.sqrt())
}

/// What a logarithmic axis can show.
fn is_shown(value: f64) -> bool {
    value.is_finite() && value > 0.0
}

/// Text as plotly.js takes it, which reads tags and entities.
fn escaped(text: &str) -> String {
    html! { (text) }.into_string()
}

/// A point of a curve.
struct Point {
    x: f64,
    y: Estimate,
    text: String,
    near_reference: bool,
}

fn points(configuration: &Configuration, measure: &Measure, abscissa: Abscissa) -> Vec<Point> {
    let point = |at: &Checkpoint| {
        let y = (measure.of_checkpoint)(at)?;
        let x = match abscissa {
            Abscissa::CpuSeconds => at.cpu_seconds.value,
            Abscissa::Samples => at.samples,
        };
        let text = format!(
            "<b>{}</b><br>{} samples per pixel<br>{} CPU s<br>{} {}",
            escaped(&configuration.name),
            number(at.samples),
            estimate_text(&at.cpu_seconds, number),
            measure.label,
            estimate_text(&y, measure.text),
        );
        (is_shown(x) && is_shown(y.value)).then_some(Point {
            x,
            y,
            text,
            near_reference: at.near_reference,
        })
    };
    configuration.checkpoints.iter().filter_map(point).collect()
}

/// Points of every repeat.
fn repeats(
    configuration: &Configuration,
    measure: &Measure,
    abscissa: Abscissa,
) -> (Vec<f64>, Vec<f64>) {
    let point = |row: &Row| {
        let x = match abscissa {
            Abscissa::CpuSeconds => row.cpu_seconds,
            Abscissa::Samples => row.samples as f64,
        };
        let y = (measure.of_row)(row)?;
        (is_shown(x) && is_shown(y)).then_some((x, y))
    };
    configuration
        .repeats
        .iter()
        .flat_map(|repeat| &repeat.rows)
        .filter_map(point)
        .unzip()
}

/// The decades that values span, with some room at both ends.
fn decades(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let (least, most) = values.map(f64::log10).fold(
        (f64::INFINITY, f64::NEG_INFINITY),
        |(least, most), value| (least.min(value), most.max(value)),
    );
    if least > most {
        return [-1.0, 1.0];
    }
    let room = (PADDING * (most - least)).max(0.05);
    [least - room, most + room]
}

fn plot(results: &Results, measure: &Measure, abscissa: Abscissa) -> serde_json::Value {
    let curves: Vec<Vec<Point>> = results
        .configurations
        .iter()
        .map(|configuration| points(configuration, measure, abscissa))
        .collect();
    let dots: Vec<(Vec<f64>, Vec<f64>)> = results
        .configurations
        .iter()
        .map(|configuration| repeats(configuration, measure, abscissa))
        .collect();
    let first_x = decades(curves.iter().flatten().map(|point| point.x))[0];
    let setups: Vec<f64> = results
        .configurations
        .iter()
        .map(|it| it.load.cpu_seconds + it.build.cpu_seconds)
        .map(|setup| {
            let is_near = is_shown(setup) && setup.log10() > first_x - SETUP_DECADES;
            if abscissa == Abscissa::CpuSeconds && is_near {
                setup
            } else {
                f64::NAN
            }
        })
        .collect();
    let shown_setups = setups.iter().copied().filter(|setup| is_shown(*setup));
    let all_x = curves.iter().flatten().map(|point| point.x);
    let all_x = all_x.chain(dots.iter().flat_map(|dots| dots.0.iter().copied()));
    let x_range = decades(all_x.chain(shown_setups));
    let all_y = curves.iter().flatten().map(|point| point.y.value);
    let y_range = decades(all_y.chain(dots.iter().flat_map(|dots| dots.1.iter().copied())));

    let mut plot = Plot::new();
    let floor = results
        .references
        .iter()
        .filter_map(measure.of_reference)
        .map(|error| {
            // A squared error is as near at the square of the factor.
            error * REFERENCE_TIMES.powf(measure.law / -0.5)
        })
        .filter(|floor| is_shown(*floor) && floor.log10() > y_range[0])
        .fold(None, |most: Option<f64>, floor| {
            Some(most.map_or(floor, |most| most.max(floor)))
        });
    if let Some(floor) = floor {
        plot.add_trace(floor_band(x_range, y_range[0], floor));
    }
    if let Some(start) = curves.iter().flatten().next() {
        plot.add_trace(guide(start, x_range, y_range, measure.law));
    }
    for (index, (curve, (x, y))) in curves.iter().zip(dots).enumerate() {
        let (name, color) = (
            escaped(&results.configurations[index].name),
            series_color(index),
        );
        let group = format!("configuration {index}");
        plot.add_trace(band(curve, color, &group));
        let faint = Marker::new().color(color).size(4).opacity(0.35);
        plot.add_trace(
            Scatter::new(x, y)
                .mode(Mode::Markers)
                .marker(faint)
                .legend_group(&group)
                .show_legend(false)
                .hover_info(HoverInfo::Skip),
        );
        let near = curve.iter().filter(|point| point.near_reference);
        let (x, y) = near.map(|point| (point.x, point.y.value)).unzip();
        let ring = Marker::new()
            .symbol(MarkerSymbol::CircleOpen)
            .color(color)
            .size(13);
        plot.add_trace(
            Scatter::new(x, y)
                .mode(Mode::Markers)
                .marker(ring)
                .legend_group(&group)
                .show_legend(false)
                .hover_info(HoverInfo::Skip),
        );
        let (x, y) = curve.iter().map(|point| (point.x, point.y.value)).unzip();
        let texts = curve.iter().map(|point| point.text.clone()).collect();
        plot.add_trace(
            Scatter::new(x, y)
                .name(&name)
                .mode(Mode::LinesMarkers)
                .line(Line::new().color(color).width(2.0).dash(dash(index)))
                .marker(Marker::new().color(color).size(7))
                .legend_group(&group)
                .text_array(texts)
                .hover_template("%{text}<extra></extra>"),
        );
        if is_shown(setups[index]) {
            plot.add_trace(setup_mark(setups[index], y_range[0], &name, color, &group));
        }
    }
    plot.set_layout(layout(
        measure,
        abscissa,
        [x_range, y_range],
        labels(results, &curves, measure, abscissa, y_range),
        legend_lines(results),
    ));
    serde_json::to_value(&plot).expect("a plot is plain data")
}

/// From the lower edge to what the reference can resolve.
fn floor_band(x: [f64; 2], bottom: f64, floor: f64) -> Box<Scatter<f64, f64>> {
    let [left, right] = x.map(|decade| 10f64.powf(decade));
    let bottom = 10f64.powf(bottom);
    Scatter::new(
        vec![left, left, right, right],
        vec![bottom, floor, floor, bottom],
    )
    .name("near the reference's own error")
    .mode(Mode::Lines)
    .line(Line::new().width(0.0).color(NamedColor::Gray))
    .fill(Fill::ToSelf)
    .opacity(0.25)
    .hover_info(HoverInfo::Skip)
}

/// A dashed line with the slope of independent samples, from a curve's first point.
fn guide(start: &Point, x: [f64; 2], y: [f64; 2], law: f64) -> Box<Scatter<f64, f64>> {
    let (left, height) = (start.x.log10(), start.y.value.log10());
    // It ends at the lower edge if it meets that first.
    let lowest = if law < 0.0 {
        left + (y[0] - height) / law
    } else {
        x[1]
    };
    let right = x[1].min(lowest);
    let at = |decade: f64| 10f64.powf(height + law * (decade - left));
    Scatter::new(
        vec![10f64.powf(left), 10f64.powf(right)],
        vec![at(left), at(right)],
    )
    .name(format!("slope {law}").replace('-', "−"))
    .mode(Mode::Lines)
    .line(
        Line::new()
            .dash(DashType::Dash)
            .width(1.5)
            .color(NamedColor::Gray),
    )
    .hover_info(HoverInfo::Skip)
}

/// The interval of each point, as one area.
fn band(curve: &[Point], color: &'static str, group: &str) -> Box<Scatter<f64, f64>> {
    let ends = |point: &Point| {
        let (low, high) = (point.y.low?, point.y.high?);
        // What reaches 0 or less ends a decade below the curve.
        Some((point.x, low.max(0.1 * point.y.value), high))
    };
    let ends: Vec<(f64, f64, f64)> = curve.iter().filter_map(ends).collect();
    let upper = ends.iter().map(|&(x, _, high)| (x, high));
    let lower = ends.iter().rev().map(|&(x, low, _)| (x, low));
    let (x, y) = upper.chain(lower).unzip();
    Scatter::new(x, y)
        .mode(Mode::Lines)
        .line(Line::new().width(0.0).color(color))
        .fill(Fill::ToSelf)
        .fill_color(color)
        .opacity(0.18)
        .legend_group(group)
        .show_legend(false)
        .hover_info(HoverInfo::Skip)
}

/// A mark on the lower edge where setting up took as long.
fn setup_mark(
    seconds: f64,
    bottom: f64,
    name: &str,
    color: &'static str,
    group: &str,
) -> Box<Scatter<f64, f64>> {
    let text = format!("<b>{name}</b><br>set up in {} CPU s", number(seconds));
    Scatter::new(vec![seconds], vec![10f64.powf(bottom)])
        .mode(Mode::Markers)
        .marker(
            Marker::new()
                .symbol(MarkerSymbol::TriangleUp)
                .color(color)
                .size(12),
        )
        .legend_group(group)
        .show_legend(false)
        .text_array(vec![text])
        .hover_template("%{text}<extra></extra>")
}

/// A label at the end of each curve, moved apart where they would overlap.
fn labels(
    results: &Results,
    curves: &[Vec<Point>],
    measure: &Measure,
    abscissa: Abscissa,
    y_range: [f64; 2],
) -> Vec<Annotation> {
    if curves.len() > MOST_LABELS {
        return Vec::new();
    }
    let pixels_per_decade = AXIS as f64 / (y_range[1] - y_range[0]);
    let mut ends: Vec<(usize, f64, f64)> = curves
        .iter()
        .enumerate()
        .filter_map(|(index, curve)| {
            let last = curve.last()?;
            Some((index, last.x.log10(), last.y.value.log10()))
        })
        .collect();
    ends.sort_by(|a, b| b.2.total_cmp(&a.2));
    let mut place = f64::NEG_INFINITY;
    let label = |(index, x, y): (usize, f64, f64)| {
        let down = (y_range[1] - y) * pixels_per_decade;
        place = below(place, down);
        let configuration = &results.configurations[index];
        let fit = match abscissa {
            Abscissa::CpuSeconds => configuration.slope_by_time,
            Abscissa::Samples => configuration.slope_by_samples,
        };
        let color = series_color(index);
        Annotation::new()
            .x(x)
            .y(y)
            .text(label_text(
                &configuration.name,
                fit.filter(|_| measure.is_fitted),
            ))
            .font(Font::new().size(12).color(color))
            .x_anchor(Anchor::Left)
            .show_arrow(true)
            .arrow_head(0)
            .arrow_width(1.0)
            .arrow_color(color)
            .ax(16)
            .ay(place - down)
    };
    ends.into_iter().map(label).collect()
}

/// Where a label goes that belongs `down` pixels below the upper edge, if the one above it is at `above`.
fn below(above: f64, down: f64) -> f64 {
    down.max(above + LABEL_DISTANCE)
}

fn label_text(name: &str, fit: Option<Fit>) -> String {
    let mut text = if name.chars().count() > LABEL_LETTERS {
        let start: String = name.chars().take(LABEL_LETTERS - 1).collect();
        format!("{}…", escaped(start.trim_end()))
    } else {
        escaped(name)
    };
    if let Some(Fit { slope, .. }) = fit {
        text += &format!(" {:.2}", slope.value).replace('-', "−");
        if let (Some(low), Some(high)) = (slope.low, slope.high) {
            text += &format!(" ± {:.2}", 0.5 * (high - low));
        }
    }
    text
}

/// About how many lines the legend has, at most: of columns as wide as the longest name.
fn legend_lines(results: &Results) -> usize {
    let names = results
        .configurations
        .iter()
        .map(|c| c.name.chars().count());
    let longest = names.max().unwrap_or(0);
    let columns = (LEGEND_WIDTH / (50 + 7 * longest)).max(1);
    // The expected slope has an entry as well.
    (results.configurations.len() + 1).div_ceil(columns)
}

fn layout(
    measure: &Measure,
    abscissa: Abscissa,
    ranges: [[f64; 2]; 2],
    labels: Vec<Annotation>,
    legend_lines: usize,
) -> Layout {
    let bottom = X_TITLE + LEGEND_LINE * legend_lines;
    let axis = |title: &str, range: [f64; 2]| {
        Axis::new()
            .title(Title::with_text(title))
            .type_(AxisType::Log)
            .range(range.to_vec())
            .exponent_format(ExponentFormat::Power)
            .zero_line(false)
    };
    let [x_range, y_range] = ranges;
    let x = axis(
        match abscissa {
            Abscissa::CpuSeconds => "CPU seconds",
            Abscissa::Samples => "samples per pixel",
        },
        x_range,
    );
    let y = axis(measure.label, y_range).auto_margin(true);
    let y = if measure.is_fraction {
        y.tick_format("~%")
    } else {
        y
    };
    Layout::new()
        .height(TOP + AXIS + bottom)
        .margin(Margin::new().left(60).right(RIGHT).top(TOP).bottom(bottom))
        .x_axis(x)
        .y_axis(y)
        .hover_mode(HoverMode::Closest)
        .legend(
            Legend::new()
                .orientation(Orientation::Horizontal)
                .trace_group_gap(0)
                .x(0.0)
                .y(-(X_TITLE as f64) / AXIS as f64),
        )
        .annotations(labels)
}

/// Share of each stage, a bar per configuration; `None` if none has stages.
fn stages(results: &Results) -> Option<serde_json::Value> {
    let timed: Vec<&Configuration> = results
        .configurations
        .iter()
        .filter(|configuration| !configuration.stages.is_empty())
        .collect();
    let mut names: Vec<&str> = Vec::new();
    for stage in timed.iter().flat_map(|configuration| &configuration.stages) {
        if !names.contains(&stage.name.as_str()) {
            names.push(&stage.name);
        }
    }
    if names.is_empty() {
        return None;
    }
    let mut plot = Plot::new();
    for (index, name) in names.into_iter().enumerate() {
        let of = |configuration: &&Configuration| {
            let stage = configuration.stages.iter().find(|stage| stage.name == name);
            stage.map_or((0.0, 0.0), |stage| (stage.share, stage.cpu_seconds))
        };
        let (shares, seconds): (Vec<f64>, Vec<f64>) = timed.iter().map(of).unzip();
        let texts = shares.iter().zip(seconds).map(|(share, seconds)| {
            format!(
                "<b>{name}</b><br>{}<br>{} CPU s",
                percent(*share),
                number(seconds)
            )
        });
        let bars: Vec<String> = timed.iter().map(|it| escaped(&it.name)).collect();
        plot.add_trace(
            Bar::new(shares.clone(), bars)
                .name(name)
                .orientation(Orientation::Horizontal)
                .marker(
                    Marker::new()
                        .color(series_color(index))
                        .opacity(stage_opacity(index)),
                )
                .hover_text_array(texts.collect())
                .hover_template("%{hovertext}<extra></extra>"),
        );
    }
    plot.set_layout(
        Layout::new()
            .height(130 + 34 * timed.len())
            .margin(Margin::new().left(20).right(20).top(8).bottom(40))
            .bar_mode(BarMode::Stack)
            .x_axis(Axis::new().tick_format(".0%").range(vec![0.0, 1.0]))
            // The first configuration on top.
            .y_axis(
                Axis::new()
                    .auto_margin(true)
                    .range(vec![timed.len() as f64 - 0.5, -0.5]),
            )
            .legend(
                Legend::new()
                    .orientation(Orientation::Horizontal)
                    .trace_order(plotly::layout::TraceOrder::Normal)
                    .x(0.0)
                    .y(-0.3),
            ),
    );
    Some(serde_json::to_value(&plot).expect("a plot is plain data"))
}

/// Stages after the colours have been used once are paler.
fn stage_opacity(index: usize) -> f64 {
    if index < super::COLORS.len() {
        0.95
    } else {
        0.55
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(x: f64, value: f64, low: Option<f64>, high: Option<f64>) -> Point {
        Point {
            x,
            y: Estimate { value, low, high },
            text: String::new(),
            near_reference: false,
        }
    }

    /// The points of a trace.
    fn drawn(trace: &Scatter<f64, f64>) -> Vec<(f64, f64)> {
        let trace = serde_json::to_value(trace).unwrap();
        let of = |axis: &str| -> Vec<f64> { serde_json::from_value(trace[axis].clone()).unwrap() };
        of("x").into_iter().zip(of("y")).collect()
    }

    #[test]
    fn guide_has_the_slope_of_the_law_and_ends_within_the_axes() {
        let start = point(1.0, 0.1, None, None);
        for (law, end) in [(-0.5, 1e4), (-1.0, 1e2), (0.0, 1e6)] {
            let ends = drawn(&guide(&start, [-1.0, 6.0], [-3.0, 0.0], law));
            let [(x0, y0), (x1, y1)] = ends[..] else {
                panic!("two ends");
            };
            assert!((x0 - 1.0).abs() < 1e-12 && (y0 - 0.1).abs() < 1e-12);
            assert!((x1 / end - 1.0).abs() < 1e-9, "{law}: {x1}");
            let slope = (y1 / y0).ln() / (x1 / x0).ln();
            assert!((slope - law).abs() < 1e-12, "{slope}");
        }
    }

    #[test]
    fn band_runs_along_the_upper_ends_and_back_along_the_lower_ones() {
        let curve = [
            point(1.0, 2.0, Some(1.0), Some(3.0)),
            point(2.0, 1.5, None, None),
            // An interval that a logarithm cannot show.
            point(4.0, 1.0, Some(-0.5), Some(2.0)),
        ];
        assert_eq!(
            drawn(&band(&curve, "#000", "")),
            [(1.0, 3.0), (4.0, 2.0), (4.0, 0.1), (1.0, 1.0)]
        );
    }

    #[test]
    fn axes_span_all_values_with_some_room() {
        let [left, right] = decades([1.0, 100.0].into_iter());
        assert!(-0.2 < left && left < 0.0 && 2.0 < right && right < 2.2);
        let [left, right] = decades([10.0].into_iter());
        assert!(left < 1.0 && 1.0 < right);
        assert_eq!(decades(std::iter::empty()), [-1.0, 1.0]);
    }

    #[test]
    fn labels_keep_their_place_unless_one_is_in_the_way() {
        assert_eq!(below(f64::NEG_INFINITY, 5.0), 5.0);
        assert_eq!(below(5.0, 100.0), 100.0);
        assert_eq!(below(5.0, 6.0), 5.0 + LABEL_DISTANCE);
    }

    #[test]
    fn labels_are_short_and_tell_the_slope() {
        let slope = Estimate {
            value: -0.5,
            low: Some(-0.52),
            high: Some(-0.48),
        };
        let fit = Fit {
            slope,
            intercept: 0.0,
            points: 5,
        };
        assert_eq!(label_text("a<b", None), "a&lt;b");
        assert_eq!(label_text("mis", Some(fit)), "mis −0.50 ± 0.02");
        let long = label_text("a name of many letters", None);
        assert_eq!(long, "a name of many le…");
    }
}
