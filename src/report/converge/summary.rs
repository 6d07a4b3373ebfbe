//! The results as text for people.

use std::fmt;

use super::results::{
    BiasVerdict, Configuration, Estimate, Found, ReferenceKind, ReferenceReport, Results,
    TimeToError,
};

impl fmt::Display for Results {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}, camera {}, {} × {} pixels, {} repeats, {} threads",
            self.scene.name,
            self.scene.camera,
            self.scene.width,
            self.scene.height,
            self.settings.repeats,
            self.settings.threads
        )?;
        for reference in &self.references {
            writeln!(f, "{}", describe(reference))?;
        }
        if let Some(noise) = self.noise {
            writeln!(
                f,
                "machine noise {:.1} %: CPU time of the same work, {} pairs of {:.3} s",
                100.0 * noise.spread,
                noise.pairs,
                noise.seconds
            )?;
        }
        let width = self
            .configurations
            .iter()
            .map(|configuration| configuration.name.chars().count())
            .max()
            .unwrap_or(0)
            .max(13);
        self.end_table(f, width)?;
        self.time_table(f, width)?;
        for pair in &self.pairs {
            writeln!(f, "{}", pair.verdict)?;
            let known = |ratio: Option<Estimate>| {
                ratio.map_or("unknown".to_owned(), |ratio| {
                    interval(ratio, |x| format!("{x:.3}"))
                })
            };
            writeln!(
                f,
                "    times the RMSE at equal samples {}, at equal time {}; times the time at equal error {}",
                known(pair.equal_samples),
                known(pair.equal_time),
                known(pair.equal_error)
            )?;
        }
        if let Some(ratio) = self.accounting.ratio {
            writeln!(
                f,
                "rendering took {:.3} CPU s in the curves and {:.3} to wake threads, {:.2} % of the process's accounting",
                self.accounting.curves_cpu_seconds,
                self.accounting.waking_cpu_seconds,
                100.0 * ratio
            )?;
        }
        Ok(())
    }
}

impl Results {
    /// Where each configuration ended.
    fn end_table(&self, f: &mut fmt::Formatter<'_>, width: usize) -> fmt::Result {
        writeln!(
            f,
            "\n{:<width$}{:>9}{:>9}{:>9}{:>24}{:>10}{:>8}{:>18}{:>7}{:>8}",
            "configuration",
            "samples",
            "CPU s",
            "wall s",
            "relative error",
            "estimate",
            "calib",
            "slope",
            "bias z",
            "Mrays/s"
        )?;
        for configuration in &self.configurations {
            let Some(end) = configuration.checkpoints.last() else {
                writeln!(f, "{:<width$}  nothing was rendered", configuration.name)?;
                continue;
            };
            let error = end
                .relative_error
                .map_or("< reference".to_owned(), |error| {
                    interval(error, |x| format!("{:.2}", 100.0 * x)) + " %"
                });
            let estimate = end.estimated_error.map_or(String::new(), |error| {
                format!("{:.2} %", 100.0 * error.value)
            });
            let calibration = end
                .calibration
                .map_or(String::new(), |value| format!("{:.2}", value.value));
            let slope = configuration
                .slope_by_samples
                .map_or("not fitted".to_owned(), |fit| slope(fit.slope));
            writeln!(
                f,
                "{:<width$}{:>9.0}{:>9.3}{:>9.3}{error:>24}{estimate:>10}{calibration:>8}{slope:>18}{:>7}{:>8.2}",
                configuration.name,
                end.samples,
                end.cpu_seconds.value,
                end.wall_seconds.value,
                bias(configuration),
                configuration.rays_per_second * 1e-6,
            )?;
        }
        Ok(())
    }

    /// Efficiency and the time to each error.
    fn time_table(&self, f: &mut fmt::Formatter<'_>, width: usize) -> fmt::Result {
        write!(f, "\n{:<width$}{:>24}", "configuration", "efficiency")?;
        let goals = self
            .configurations
            .first()
            .map_or(&[][..], |first| first.times_to_error.as_slice());
        for goal in goals {
            write!(f, "{:>24}", format!("CPU s to {} %", 100.0 * goal.error))?;
        }
        writeln!(f)?;
        for configuration in &self.configurations {
            let efficiency = configuration.efficiency.map_or(String::new(), |value| {
                interval(value, |x| format!("{x:.2}")) + " x"
            });
            write!(f, "{:<width$}{efficiency:>24}", configuration.name)?;
            for time in &configuration.times_to_error {
                write!(f, "{:>24}", time_text(time))?;
            }
            writeln!(f)?;
        }
        writeln!(f)
    }
}

fn describe(reference: &ReferenceReport) -> String {
    let error = reference
        .relative_error
        .map_or("of unknown error".to_owned(), |error| {
            format!("of relative error {:.3} %", 100.0 * error)
        });
    match &reference.kind {
        ReferenceKind::ClosedForm => "reference: the scene's closed form".to_owned(),
        ReferenceKind::File { path } => format!("reference: {path}, {error}"),
        ReferenceKind::Rendered { cached, .. } => format!(
            "reference: two halves, {} samples per pixel together, {error}, {} in {:.1} CPU s",
            reference.samples.unwrap_or(0),
            if *cached { "stored before" } else { "rendered" },
            reference.time.cpu_seconds
        ),
    }
}

fn interval(estimate: Estimate, text: impl Fn(f64) -> String) -> String {
    let value = text(estimate.value);
    match (estimate.low, estimate.high) {
        (Some(low), Some(high)) => format!("{value} [{}, {}]", text(low.max(0.0)), text(high)),
        _ => value,
    }
}

fn slope(slope: Estimate) -> String {
    match slope.high {
        Some(high) => format!("{:.3} ± {:.3}", slope.value, high - slope.value),
        None => format!("{:.3}", slope.value),
    }
}

fn bias(configuration: &Configuration) -> String {
    let mark = match configuration.bias.verdict {
        BiasVerdict::Biased => "!",
        BiasVerdict::NotShown | BiasVerdict::Untested => "",
    };
    let z = configuration.bias.z;
    z.map_or(String::new(), |z| format!("{mark}{z:.1}"))
}

fn time_text(time: &TimeToError) -> String {
    let Some(seconds) = time.seconds else {
        return "not reached".to_owned();
    };
    let text = interval(seconds, |x| format!("{x:.3}"));
    match time.found {
        Found::AtMost => format!("< {text}"),
        Found::Extrapolated => format!("~ {text}"),
        Found::Interpolated | Found::NotReached => text,
    }
}
