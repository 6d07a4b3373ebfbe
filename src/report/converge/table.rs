//! Time and error of single images, a line for each checkpoint: the form of Table 3.1 of the report that
//! first showed the hexagonal room.

use std::fmt::Write;

use super::results::{Estimate, Results};

impl Results {
    /// The table as text.
    pub fn images_table(&self) -> String {
        let mut text = format!(
            "{}, camera {}, {} × {} pixels, {} threads; means over {} repeats with 95 % intervals\n\n",
            self.scene.name,
            self.scene.camera,
            self.scene.width,
            self.scene.height,
            self.settings.threads,
            self.settings.repeats
        );
        let mut line = |cells: [&str; 7]| {
            let [image, samples, cells @ ..] = cells;
            let cells: String = cells.iter().map(|cell| format!(" {cell:>28}")).collect();
            writeln!(text, "{image:<14}{samples:>8}{cells}").expect("writing to a string");
        };
        line([
            "image",
            "samples",
            "CPU s",
            "wall s",
            "RMSE",
            "relative error %",
            "its estimate %",
        ]);
        for configuration in &self.configurations {
            for checkpoint in &configuration.checkpoints {
                let known = |estimate: Option<Estimate>, factor: f64| {
                    estimate.map_or(String::new(), |estimate| cell(estimate, factor))
                };
                line([
                    &configuration.name,
                    &format!("{:.0}", checkpoint.samples),
                    &cell(checkpoint.cpu_seconds, 1.0),
                    &cell(checkpoint.wall_seconds, 1.0),
                    &known(checkpoint.rmse, 1.0),
                    &known(checkpoint.relative_error, 100.0),
                    &known(checkpoint.estimated_error, 100.0),
                ]);
            }
        }
        text
    }
}

/// Three significant digits of the value, and its interval.
fn cell(estimate: Estimate, factor: f64) -> String {
    let number = |value: f64| {
        let value = value * factor;
        let digits = (2.0 - value.abs().max(1e-9).log10().floor()).clamp(0.0, 9.0);
        format!("{value:.*}", digits as usize)
    };
    match (estimate.low, estimate.high) {
        (Some(low), Some(high)) => format!(
            "{} [{}, {}]",
            number(estimate.value),
            number(low),
            number(high)
        ),
        _ => number(estimate.value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_have_three_significant_digits() {
        let alone = |value| {
            cell(
                Estimate {
                    value,
                    low: None,
                    high: None,
                },
                1.0,
            )
        };
        assert_eq!(alone(0.012_345), "0.0123");
        assert_eq!(alone(12.345), "12.3");
        assert_eq!(alone(12_345.0), "12345");
        let interval = Estimate {
            value: 0.5,
            low: Some(0.4),
            high: Some(0.6),
        };
        assert_eq!(cell(interval, 100.0), "50.0 [40.0, 60.0]");
    }
}
