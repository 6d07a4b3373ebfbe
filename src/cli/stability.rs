//! `wavepath stability`: stiff and extreme cases against what is known of them.

use std::fmt::Write;

use crate::error::Result;
use crate::film::check_writable;
use crate::report::stability::{self, CASES, Effort, StabilityReport, StabilitySettings};

use super::args::StabilityArgs;
use super::job::{MAX_THREADS, check_range, check_report_name};
use super::{Status, note, print, write_json};

/// Most rays per mesh and structure. Beyond any patience; it stops a slip of the keyboard.
const MAX_RAYS: u64 = 1 << 40;

pub(super) fn run(args: &StabilityArgs) -> Result<Status> {
    if args.list {
        return print(&list());
    }
    check_range("--rays", args.rays, 1, MAX_RAYS)?;
    check_range("--threads", args.threads, 1, MAX_THREADS)?;
    if let Some(path) = &args.json {
        check_report_name(path)?;
        check_writable(path)?;
    }
    let defaults = StabilitySettings::default();
    let settings = StabilitySettings {
        cases: args.cases.clone(),
        structures: args.structures.clone(),
        effort: if args.full {
            Effort::Full
        } else {
            Effort::Quick
        },
        leak_rays: args.rays,
        threads: args.threads.unwrap_or(defaults.threads),
    };
    let mut last = String::new();
    let report = stability::run(&settings, &mut |finding| {
        if !args.quiet && last != finding.case {
            last.clone_from(&finding.case);
            note(&format!("{} ...", finding.case));
        }
    })?;
    if let Some(path) = &args.json {
        write_json(path, &report.to_json())?;
    }
    print(&report.to_string())?;
    Ok(status(&report))
}

fn status(report: &StabilityReport) -> Status {
    if report.failures().next().is_none() {
        Status::Done
    } else {
        Status::Exceeded
    }
}

/// The cases, one per line.
fn list() -> String {
    let width = CASES.iter().map(|case| case.name.len()).max().unwrap_or(0);
    CASES.iter().fold(String::new(), |mut text, case| {
        let _ = writeln!(
            text,
            "{:>3}  {:<width$}  {}",
            case.row, case.name, case.about
        );
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_row_that_fails_is_enough() {
        let settings = StabilitySettings {
            cases: vec!["mis-weights".to_owned()],
            effort: Effort::Test,
            ..StabilitySettings::default()
        };
        let mut report = stability::run(&settings, &mut |_| {}).unwrap();
        assert_eq!(status(&report), Status::Done);
        report.findings[2].passed = false;
        assert_eq!(status(&report), Status::Exceeded);
    }
}
