//! From the rows of the repeats to the figures of a configuration, and to comparisons of two.

use super::curve::{Curve, at_equal_abscissa, at_equal_error, fit, ratio, time_to};
use super::results::{Checkpoint, Configuration, Estimate, Fit, Pair, Repeat, Row, TimeToError};
use super::statistics::{geometric_mean, map, mean};

/// Relative errors to which the time is told.
const GOALS: [f64; 3] = [0.1, 0.03, 0.01];

/// The curves of a configuration: its rows by checkpoint, and which checkpoints are fitted.
#[derive(Debug)]
pub(super) struct Curves {
    /// A row of each repeat, by checkpoint.
    groups: Vec<Vec<Row>>,
    /// Whether the error is within three times the reference's own.
    near: Vec<bool>,
}

impl Curves {
    /// Of repeats held against a reference below whose `floor` an MSE is not fitted.
    ///
    /// Repeats that time ends have different last checkpoints, and perhaps different numbers of them:
    /// those that all have are taken together, and the last ones.
    pub(super) fn new(repeats: &[Repeat], floor: f64) -> Self {
        let shortest = repeats.iter().map(|repeat| repeat.rows.len()).min();
        let groups: Vec<Vec<Row>> = match shortest {
            None | Some(0) => Vec::new(),
            Some(count) => (0..count)
                .map(|index| {
                    let row = |repeat: &Repeat| {
                        let last = repeat.rows.len() - 1;
                        repeat.rows[if index == count - 1 { last } else { index }]
                    };
                    repeats.iter().map(row).collect()
                })
                .collect(),
        };
        let near = |group: &Vec<Row>| {
            let sum: f64 = group.iter().map(|row| row.errors.mse).sum();
            sum / group.len() as f64 <= floor
        };
        Self {
            near: groups.iter().map(near).collect(),
            groups,
        }
    }

    /// As they are in a report.
    fn of(configuration: &Configuration) -> Self {
        let mut curves = Self::new(&configuration.repeats, 0.0);
        curves.near = configuration
            .checkpoints
            .iter()
            .map(|checkpoint| checkpoint.near_reference)
            .collect();
        curves
    }

    /// Checkpoint by checkpoint.
    pub(super) fn checkpoints(&self) -> Vec<Checkpoint> {
        let groups = self.groups.iter().zip(&self.near);
        groups
            .map(|(group, &near)| checkpoint(group, near))
            .collect()
    }

    /// The slopes of ln RMSE on ln samples and on ln seconds.
    pub(super) fn slopes(&self) -> [Option<Fit>; 2] {
        [samples, seconds].map(|abscissa| fit(&self.fitted(abscissa)))
    }

    /// CPU seconds to the goals.
    pub(super) fn times_to_error(&self) -> Vec<TimeToError> {
        let curves = self.curves(|row| (row.cpu_seconds, row.errors.relmse), |_| true);
        GOALS.map(|goal| time_to(goal, &curves)).to_vec()
    }

    /// MSE × CPU seconds of each repeat, at the last checkpoint that is fitted, else at the last.
    fn times_to_unit_variance(&self) -> Vec<f64> {
        let last = self.near.iter().rposition(|near| !near);
        let group = last.map_or(self.groups.last(), |last| self.groups.get(last));
        group.map_or(Vec::new(), |group| {
            let product = |row: &Row| row.errors.mse * row.cpu_seconds;
            group.iter().map(product).collect()
        })
    }

    /// The same over the repeats.
    pub(super) fn time_to_unit_variance(&self) -> Option<Estimate> {
        let values = self.times_to_unit_variance();
        (!values.is_empty()).then(|| geometric_mean(&values))
    }

    /// A curve of root-mean-square errors per repeat, over the checkpoints that are fitted.
    fn fitted(&self, abscissa: fn(&Row) -> f64) -> Vec<Curve> {
        self.curves(
            |row| (abscissa(row), row.errors.mse),
            |index| !self.near[index],
        )
    }

    /// A curve per repeat of points (abscissa, squared error), over the `wanted` checkpoints.
    fn curves(
        &self,
        point: impl Fn(&Row) -> (f64, f64),
        wanted: impl Fn(usize) -> bool,
    ) -> Vec<Curve> {
        let repeats = self.groups.first().map_or(0, Vec::len);
        let curve = |repeat: usize| {
            let groups = self.groups.iter().enumerate();
            let wanted = groups.filter(|&(index, _)| wanted(index));
            Curve::of_squares(wanted.map(|(_, group)| point(&group[repeat])))
        };
        (0..repeats).map(curve).collect()
    }
}

fn samples(row: &Row) -> f64 {
    row.samples as f64
}

fn seconds(row: &Row) -> f64 {
    row.cpu_seconds
}

/// All rays of a row.
pub(super) fn rays(row: &Row) -> u64 {
    row.camera_rays + row.bounce_rays + row.shadow_rays
}

fn checkpoint(rows: &[Row], near_reference: bool) -> Checkpoint {
    let values = |value: &dyn Fn(&Row) -> f64| -> Vec<f64> { rows.iter().map(value).collect() };
    let geometric = |value: &dyn Fn(&Row) -> f64| geometric_mean(&values(value));
    let root = |estimate: Estimate| {
        (estimate.value > 0.0).then(|| map(estimate, |square| square.max(0.0).sqrt()))
    };
    let known = |value: &dyn Fn(&Row) -> Option<f64>| -> Option<Estimate> {
        let values: Option<Vec<f64>> = rows.iter().map(value).collect();
        values.map(|values| geometric_mean(&values))
    };
    let mse = geometric(&|row| row.errors.mse);
    let ratio = |row: &Row| {
        let variance = row.errors.estimated_variance?;
        (variance > 0.0).then_some(row.errors.mse / variance)
    };
    let total = |value: &dyn Fn(&Row) -> f64| values(value).iter().sum::<f64>();
    Checkpoint {
        samples: mean(&values(&samples)).value,
        cpu_seconds: geometric(&seconds),
        wall_seconds: geometric(&|row| row.wall_seconds),
        mse,
        rmse: root(mse),
        relative_error: root(geometric(&|row| row.errors.relmse)),
        relative_error_trimmed: geometric(&|row| row.errors.relmse_trimmed.max(0.0).sqrt()),
        smape: geometric(&|row| row.errors.smape),
        estimated_error: known(&|row| row.errors.estimated_error),
        calibration: known(&ratio),
        time_to_unit_variance: (mse.value > 0.0)
            .then(|| geometric(&|row| row.errors.mse * row.cpu_seconds)),
        rays_per_second: match total(&seconds) {
            0.0 => 0.0,
            seconds => total(&|row| rays(row) as f64) / seconds,
        },
        near_reference,
    }
}

/// Every two configurations that are held against the same reference.
pub(super) fn pairs(configurations: &[Configuration]) -> Vec<Pair> {
    let mut pairs = Vec::new();
    for (a, first) in configurations.iter().enumerate() {
        for (b, second) in configurations.iter().enumerate().skip(a + 1) {
            if first.reference == second.reference {
                pairs.push(pair(configurations, a, b));
            }
        }
    }
    pairs
}

fn pair(configurations: &[Configuration], a: usize, b: usize) -> Pair {
    let (first, second) = (
        Curves::of(&configurations[a]),
        Curves::of(&configurations[b]),
    );
    let compare = |abscissa: fn(&Row) -> f64, compare: fn(&Curve, &Curve) -> Option<(f64, f64)>| {
        let curves = first
            .fitted(abscissa)
            .into_iter()
            .zip(second.fitted(abscissa));
        ratio(curves.map(|(a, b)| compare(&a, &b)))
    };
    // Efficiency is the reciprocal of time to unit variance.
    let times = second
        .times_to_unit_variance()
        .into_iter()
        .zip(first.times_to_unit_variance());
    let efficiency = ratio(times.map(Some));
    let names = [&configurations[a].name, &configurations[b].name];
    Pair {
        a,
        b,
        efficiency,
        equal_samples: compare(samples, at_equal_abscissa),
        equal_time: compare(seconds, at_equal_abscissa),
        equal_error: compare(seconds, at_equal_error),
        verdict: verdict(names, efficiency),
    }
}

/// What the efficiency of the second over the first shows.
fn verdict([first, second]: [&String; 2], efficiency: Option<Estimate>) -> String {
    let Some(Estimate { value, low, high }) = efficiency else {
        return format!(
            "{second} and {first} cannot be compared: the error is that of the reference"
        );
    };
    let (Some(low), Some(high)) = (low, high) else {
        return format!(
            "{second} is {value:.2}x as efficient as {first}; a single repeat shows nothing"
        );
    };
    let interval = format!("{value:.2}x [{low:.2}, {high:.2}]");
    if low <= 1.0 && high >= 1.0 {
        format!("no difference shown between {second} and {first}: {interval}")
    } else {
        format!("{second} is {interval} as efficient as {first}")
    }
}
