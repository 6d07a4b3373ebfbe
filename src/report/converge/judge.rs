//! What a reader must know before believing the figures.

use super::noise::SPREAD_WARNING;
use super::results::{BiasVerdict, Configuration, ReferenceKind, ReferenceReport, Results};

/// Largest share by which the rendering time may differ from the process's own accounting of it.
const ACCOUNTING: f64 = 0.02;

/// Slope above which errors fall more slowly than those of independent samples of finite variance.
const FLAT_SLOPE: f64 = -0.45;

/// Factor by which the renderer's own estimate of its variance may be off.
const CALIBRATION: f64 = 2.0;

/// Everything that is wrong with these results, in words. `goal` is the relative error that a rendered
/// reference was to have.
pub(super) fn judge(results: &Results, goal: f64) -> Vec<String> {
    let mut warnings = Vec::new();
    if let Some(noise) = results.noise.filter(|noise| noise.spread > SPREAD_WARNING) {
        warnings.push(format!(
            "the machine is not quiet: CPU time of the same work differs by {:.0} % between runs",
            100.0 * noise.spread
        ));
    }
    if results.settings.repeats == 1 {
        warnings.push("a single repeat: no figure has an interval".to_owned());
    }
    if let Some(ratio) = results.accounting.ratio
        && (ratio - 1.0).abs() > ACCOUNTING
    {
        warnings.push(format!(
            "the passes hold {:.1} % of the CPU time that the process accounts for",
            100.0 * ratio
        ));
    }
    for reference in &results.references {
        warnings.extend(judge_reference(reference, goal));
    }
    for configuration in &results.configurations {
        let name = &configuration.name;
        let findings = judge_configuration(configuration).into_iter();
        warnings.extend(findings.map(|finding| format!("{name}: {finding}")));
    }
    warnings
}

fn judge_reference(reference: &ReferenceReport, goal: f64) -> Option<String> {
    match (&reference.kind, reference.relative_error) {
        (ReferenceKind::Rendered { .. }, Some(error)) if error > goal => Some(format!(
            "the reference has a relative error of {:.2} %, not the {:.2} % that were wanted",
            100.0 * error,
            100.0 * goal
        )),
        (ReferenceKind::File { path }, None) => Some(format!(
            "{path} does not say its own error: where curves flatten, it may be that of the reference"
        )),
        _ => None,
    }
}

fn judge_configuration(configuration: &Configuration) -> Vec<String> {
    let mut findings = Vec::new();
    for reason in &configuration.bias.by_design {
        findings.push(format!("biased by design: {reason}"));
    }
    let bias = &configuration.bias;
    if bias.verdict == BiasVerdict::Biased {
        let (column, row) = bias.worst_block.unwrap_or_default();
        findings.push(format!(
            "biased: the image's mean is off by {:.1} standard errors; of blocks of pixels, that at column \
             {column}, row {row} is off with p = {:.1e}",
            bias.z.unwrap_or_default(),
            bias.block_p.unwrap_or_default()
        ));
    }
    let rows = configuration.repeats.iter();
    let rejected: u64 = rows
        .filter_map(|repeat| repeat.rows.last())
        .map(|row| row.rejected)
        .sum();
    if rejected > 0 {
        findings.push(format!(
            "{rejected} contributions not finite or negative, left out"
        ));
    }
    let checkpoints = &configuration.checkpoints;
    if let Some(near) = checkpoints
        .iter()
        .find(|checkpoint| checkpoint.near_reference)
    {
        findings.push(format!(
            "within three times the reference's own error from {:.0} samples on: not fitted there",
            near.samples
        ));
    }
    if let Some(low) = configuration.slope_by_samples.and_then(|fit| fit.slope.low)
        && low > FLAT_SLOPE
    {
        findings.push(format!(
            "error falls more slowly than 1/√samples (slope above {low:.2}): infinite variance, or bias"
        ));
    }
    let last = checkpoints
        .iter()
        .rev()
        .find(|checkpoint| !checkpoint.near_reference);
    if let Some(calibration) = last.and_then(|checkpoint| checkpoint.calibration) {
        let sure = |bound: Option<f64>| bound.unwrap_or(calibration.value);
        if sure(calibration.low) > CALIBRATION || sure(calibration.high) < 1.0 / CALIBRATION {
            findings.push(format!(
                "the renderer's own estimate of its variance is off: the MSE is {:.2} times as large",
                calibration.value
            ));
        }
    }
    findings
}
