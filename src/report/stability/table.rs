//! The findings as text.

use std::fmt;

use super::{Finding, StabilityReport, Unit};

impl fmt::Display for StabilityReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "wavepath {} ({}), {} lanes, {} threads, {}",
            self.build.version,
            self.build.commit,
            self.build.lanes,
            self.settings.threads,
            self.machine.cpu
        )?;
        let column = |text: &dyn Fn(&Finding) -> usize, least: usize| {
            self.findings.iter().map(text).fold(least, usize::max) + 2
        };
        let case = column(&|finding| finding.case.chars().count(), 4);
        let extreme = column(&|finding| finding.extreme.chars().count(), 7);
        let oracle = column(&|finding| finding.oracle.chars().count(), 6);
        writeln!(
            f,
            "\n{:>3}  {:<case$}{:<extreme$}{:<oracle$}{:>12}{:>11}  {:<16}{:>11}{:>8}  result",
            "row",
            "case",
            "extreme",
            "held against",
            "measured",
            "tolerated",
            "unit",
            "samples",
            "CPU s",
        )?;
        for finding in &self.findings {
            writeln!(
                f,
                "{:>3}  {:<case$}{:<extreme$}{:<oracle$}{:>12}{:>11}  {:<16}{:>11}{:>8.2}  {}",
                finding.row,
                finding.case,
                finding.extreme,
                finding.oracle,
                number(finding.measured, finding.unit),
                number(finding.tolerance, finding.unit),
                unit(finding.unit),
                finding.samples,
                finding.cpu_seconds,
                verdict(finding),
            )?;
        }
        let failed = self.failures().count();
        writeln!(
            f,
            "\n{} of {} pass, in {:.1} CPU s ({:.1} s)",
            self.findings.len() - failed,
            self.findings.len(),
            self.time.cpu_seconds,
            self.time.wall_seconds
        )
    }
}

/// Whether it passed, and which structures did not.
fn verdict(finding: &Finding) -> String {
    if finding.passed {
        return match finding.structures.len() {
            0 => "pass".to_owned(),
            1 => format!("pass ({})", finding.structures[0].structure),
            n => format!("pass ({n} structures)"),
        };
    }
    let failed: Vec<&str> = finding
        .structures
        .iter()
        .filter(|part| part.measured > finding.tolerance)
        .map(|part| part.structure.as_str())
        .collect();
    if failed.is_empty() {
        "FAIL".to_owned()
    } else {
        format!("FAIL ({})", failed.join(", "))
    }
}

fn unit(unit: Unit) -> &'static str {
    match unit {
        Unit::Count => "wrong",
        Unit::Share => "of all",
        Unit::Relative => "relative",
        Unit::Absolute => "absolute",
        Unit::StandardErrors => "standard errors",
        Unit::TimeRatio => "times as long",
    }
}

fn number(value: f64, unit: Unit) -> String {
    match unit {
        Unit::Count => format!("{value:.0}"),
        _ if value == f64::MAX => "not finite".to_owned(),
        Unit::StandardErrors | Unit::TimeRatio if value < 1e3 => format!("{value:.2}"),
        _ if value == 0.0 => "0".to_owned(),
        _ => format!("{value:.1e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Build, Effort, FORMAT, Machine, Span, StabilitySettings, StructureFigure};
    use super::*;

    fn finding(measured: f64, structures: &[(&str, f64)]) -> Finding {
        Finding {
            case: "vertices".to_owned(),
            row: 1,
            extreme: "radius 2e-6".to_owned(),
            oracle: "closed mesh".to_owned(),
            measured,
            tolerance: 0.0,
            unit: Unit::Count,
            samples: 1000,
            passed: measured <= 0.0,
            structures: structures
                .iter()
                .map(|&(name, measured)| StructureFigure {
                    structure: name.to_owned(),
                    measured,
                })
                .collect(),
            cpu_seconds: 0.25,
        }
    }

    fn report() -> StabilityReport {
        StabilityReport {
            format: FORMAT,
            build: Build::current(),
            machine: Machine::read(),
            settings: StabilitySettings {
                effort: Effort::Test,
                ..StabilitySettings::default()
            },
            findings: vec![
                finding(0.0, &[("bvh2", 0.0), ("bvh8", 0.0)]),
                finding(3.0, &[("bvh2", 0.0), ("bvh8", 3.0)]),
                finding(f64::MAX, &[]),
            ],
            time: Span::default(),
        }
    }

    #[test]
    fn a_row_that_fails_names_the_structures_that_do() {
        let text = report().to_string();
        let rows: Vec<&str> = text.lines().filter(|line| line.contains("2e-6")).collect();
        assert!(rows[0].ends_with("pass (2 structures)"), "{text}");
        assert!(rows[1].ends_with("FAIL (bvh8)"), "{text}");
        assert!(rows[2].ends_with("FAIL"), "{text}");
        assert!(
            text.ends_with("1 of 3 pass, in 0.0 CPU s (0.0 s)\n"),
            "{text}"
        );
        assert_eq!(report().failures().count(), 2);
    }

    #[test]
    fn the_report_is_read_back_as_it_was_written() {
        let read: StabilityReport = serde_json::from_str(&report().to_json()).unwrap();
        assert_eq!(read, report());
    }
}
