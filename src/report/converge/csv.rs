//! `converge.csv`: one row per configuration, repeat and checkpoint. What is unknown is empty.

use super::aggregate::rays;
use super::results::{Configuration, Repeat, Results, Row};

/// Names of the columns.
const COLUMNS: [&str; 33] = [
    "scene",
    "configuration",
    "repeat",
    "seed",
    "samples",
    "paths",
    "rays_camera",
    "rays_bounce",
    "rays_shadow",
    "cpu_s",
    "wall_s",
    "load_s",
    "build_s",
    "rays_per_cpu_s",
    "mse",
    "mse_error",
    "rmse",
    "relmse",
    "relative_error",
    "relmse_trimmed",
    "smape",
    "estimated_variance",
    "estimated_error",
    "calibration",
    "bias_z",
    "block_p",
    "outliers",
    "outlier_share",
    "rejected",
    "near_reference",
    "ttuv",
    "efficiency",
    "features",
];

/// The table with its heading, lines ended by \n (RFC 4180 but for that).
pub(super) fn table(results: &Results) -> String {
    let mut text = COLUMNS.join(",") + "\n";
    for configuration in &results.configurations {
        for (number, repeat) in configuration.repeats.iter().enumerate() {
            for (index, row) in repeat.rows.iter().enumerate() {
                // A repeat may have more rows than the checkpoints that all repeats have.
                let near = configuration
                    .checkpoints
                    .get(index)
                    .or(configuration.checkpoints.last())
                    .is_some_and(|checkpoint| checkpoint.near_reference);
                let place = (number, repeat);
                let cells = cells(&results.scene.name, configuration, place, row, near);
                text += &cells.join(",");
                text.push('\n');
            }
        }
    }
    text
}

fn cells(
    scene: &str,
    configuration: &Configuration,
    (number, repeat): (usize, &Repeat),
    row: &Row,
    near_reference: bool,
) -> [String; COLUMNS.len()] {
    let errors = &row.errors;
    let positive = |value: f64| (value > 0.0).then_some(value);
    let ttuv = errors.mse * row.cpu_seconds;
    let calibration = errors
        .estimated_variance
        .and_then(positive)
        .map(|variance| errors.mse / variance);
    [
        quoted(scene),
        quoted(&configuration.name),
        (number + 1).to_string(),
        repeat.seed.to_string(),
        row.samples.to_string(),
        row.paths.to_string(),
        row.camera_rays.to_string(),
        row.bounce_rays.to_string(),
        row.shadow_rays.to_string(),
        row.cpu_seconds.to_string(),
        row.wall_seconds.to_string(),
        configuration.load.wall_seconds.to_string(),
        configuration.build.wall_seconds.to_string(),
        known(positive(row.cpu_seconds).map(|seconds| rays(row) as f64 / seconds)),
        number_text(errors.mse),
        number_text(errors.mse_error),
        known(positive(errors.mse).map(f64::sqrt)),
        number_text(errors.relmse),
        known(positive(errors.relmse).map(f64::sqrt)),
        number_text(errors.relmse_trimmed),
        number_text(errors.smape),
        known(errors.estimated_variance),
        known(errors.estimated_error),
        known(calibration),
        known(errors.bias_z),
        known(errors.block_p),
        errors
            .outliers
            .map_or(String::new(), |count| count.to_string()),
        known(errors.outlier_share),
        row.rejected.to_string(),
        u8::from(near_reference).to_string(),
        number_text(ttuv),
        known(positive(ttuv).map(|ttuv| 1.0 / ttuv)),
        quoted(&configuration.features.join("+")),
    ]
}

/// Enough digits to be read back as the same number.
fn number_text(value: f64) -> String {
    format!("{value:e}")
}

fn known(value: Option<f64>) -> String {
    value.map_or(String::new(), number_text)
}

/// A text, in quotes if it needs them.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_with_separators_are_quoted() {
        assert_eq!(quoted("strategy=mis"), "strategy=mis");
        assert_eq!(quoted("eye=[0, 1]"), "\"eye=[0, 1]\"");
        assert_eq!(quoted("a \"b\""), "\"a \"\"b\"\"\"");
    }
}
