//! What a case is given to run with, and where its findings go.

use rayon::ThreadPool;

use super::renders::Picture;
use super::{Case, Effort, Finding, StabilitySettings, StructureFigure, Unit};
use crate::accel::Structure;
use crate::error::Result;
use crate::integrator::clock::process_cpu_seconds;
use crate::scene::{RenderSettings, SceneDescription};

/// Standard errors by which a right mean may be off: one in 16 000 is by more.
const MOST_STANDARD_ERRORS: f64 = 4.0;

/// A deviation and how much of it is tolerated.
#[derive(Debug, Clone, Copy)]
pub(super) struct Figure {
    measured: f64,
    tolerance: f64,
    unit: Unit,
    samples: u64,
}

impl Figure {
    /// Wrong answers, of which there may be none.
    pub(super) fn none_of(wrong: u64, samples: u64) -> Self {
        Self {
            measured: wrong as f64,
            tolerance: 0.0,
            unit: Unit::Count,
            samples,
        }
    }

    /// Wrong answers, of which this share is tolerated.
    pub(super) fn share(wrong: u64, samples: u64, tolerance: f64) -> Self {
        Self {
            measured: wrong as f64 / samples as f64,
            tolerance,
            unit: Unit::Share,
            samples,
        }
    }

    /// The largest relative error.
    pub(super) fn relative(measured: f64, tolerance: f64, samples: u64) -> Self {
        Self {
            measured,
            tolerance,
            unit: Unit::Relative,
            samples,
        }
    }

    /// The largest absolute error.
    pub(super) fn absolute(measured: f64, tolerance: f64, samples: u64) -> Self {
        Self {
            measured,
            tolerance,
            unit: Unit::Absolute,
            samples,
        }
    }

    /// A deviation in standard errors.
    pub(super) fn standard_errors(measured: f64, samples: u64) -> Self {
        Self::standard_errors_within(measured, MOST_STANDARD_ERRORS, samples)
    }

    /// A deviation in standard errors where there are so many that the largest is larger.
    pub(super) fn standard_errors_within(measured: f64, tolerance: f64, samples: u64) -> Self {
        Self {
            measured: measured.abs(),
            tolerance,
            unit: Unit::StandardErrors,
            samples,
        }
    }

    /// Time over that of the ordinary case.
    pub(super) fn time_ratio(measured: f64, tolerance: f64, samples: u64) -> Self {
        Self {
            measured,
            tolerance,
            unit: Unit::TimeRatio,
            samples,
        }
    }

    fn passes(&self) -> bool {
        self.measured <= self.tolerance
    }

    /// A number that can be compared and written.
    fn finite(&self) -> f64 {
        if self.measured.is_nan() {
            f64::MAX
        } else {
            self.measured.min(f64::MAX)
        }
    }
}

/// A running case.
pub(super) struct Trial<'a> {
    case: &'static Case,
    settings: &'a StabilitySettings,
    /// The structures to run on.
    pub(super) structures: &'a [Structure],
    pool: &'a ThreadPool,
    tell: &'a mut dyn FnMut(&Finding),
    findings: Vec<Finding>,
    cpu_seconds: f64,
    /// Contributions that renders left out.
    rejected: u64,
    /// Samples of renders.
    rendered: u64,
}

impl<'a> Trial<'a> {
    pub(super) fn new(
        case: &'static Case,
        settings: &'a StabilitySettings,
        structures: &'a [Structure],
        pool: &'a ThreadPool,
        tell: &'a mut dyn FnMut(&Finding),
    ) -> Self {
        Self {
            case,
            settings,
            structures,
            pool,
            tell,
            findings: Vec::new(),
            cpu_seconds: process_cpu_seconds(),
            rejected: 0,
            rendered: 0,
        }
    }

    /// How many samples to take where the quick run takes this many.
    pub(super) fn count(&self, quick: u64) -> u64 {
        match self.settings.effort {
            Effort::Test => quick.div_ceil(8),
            Effort::Quick => quick,
            Effort::Full => quick * 32,
        }
    }

    /// Which effort was asked for, for cases that more samples alone do not suit.
    pub(super) fn effort(&self) -> Effort {
        self.settings.effort
    }

    /// Rays, or bounces, per closed mesh and structure that were asked for.
    pub(super) fn leak_rays(&self) -> Option<u64> {
        self.settings.leak_rays
    }

    /// Runs on the threads of the run.
    pub(super) fn install<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        self.pool.install(work)
    }

    /// The picture of camera 0, on the threads of the run.
    pub(super) fn picture(
        &mut self,
        scene: &SceneDescription,
        size: [u32; 2],
        settings: &RenderSettings,
    ) -> Result<Picture> {
        let settings = RenderSettings {
            threads: self.settings.threads,
            ..settings.clone()
        };
        let picture = Picture::render(scene, size, &settings)?;
        self.rejected += picture.stats.rejected;
        self.rendered += picture.film.total_samples();
        Ok(picture)
    }

    /// Notes a finding.
    pub(super) fn note(&mut self, extreme: impl Into<String>, oracle: &str, figure: Figure) {
        self.record(extreme.into(), oracle, figure, Vec::new());
    }

    /// Measures on every structure; the largest deviation counts.
    ///
    /// # Errors
    /// Those of `measure`.
    pub(super) fn on_structures(
        &mut self,
        extreme: impl Into<String>,
        oracle: &str,
        measure: impl FnMut(&mut Self, Structure) -> Result<Figure>,
    ) -> Result<()> {
        self.on(self.structures, extreme, oracle, measure)
    }

    /// Measures on these structures; the largest deviation counts. Without any there is no finding.
    ///
    /// # Errors
    /// Those of `measure`.
    pub(super) fn on(
        &mut self,
        structures: &[Structure],
        extreme: impl Into<String>,
        oracle: &str,
        mut measure: impl FnMut(&mut Self, Structure) -> Result<Figure>,
    ) -> Result<()> {
        let mut figures: Vec<(Structure, Figure)> = Vec::new();
        for &structure in structures {
            let figure = measure(self, structure)?;
            figures.push((structure, figure));
        }
        let worst = figures
            .iter()
            .map(|(_, figure)| *figure)
            .max_by(|a, b| a.finite().total_cmp(&b.finite()));
        let Some(worst) = worst else {
            return Ok(());
        };
        let samples = figures.iter().map(|(_, figure)| figure.samples).sum();
        let parts = figures
            .iter()
            .map(|(structure, figure)| StructureFigure {
                structure: structure.name().to_owned(),
                measured: figure.finite(),
            })
            .collect();
        self.record(extreme.into(), oracle, Figure { samples, ..worst }, parts);
        Ok(())
    }

    fn record(
        &mut self,
        extreme: String,
        oracle: &str,
        figure: Figure,
        structures: Vec<StructureFigure>,
    ) {
        let now = process_cpu_seconds();
        let finding = Finding {
            case: self.case.name.to_owned(),
            row: self.case.row,
            extreme,
            oracle: oracle.to_owned(),
            measured: figure.finite(),
            tolerance: figure.tolerance,
            unit: figure.unit,
            samples: figure.samples,
            passed: figure.passes(),
            structures,
            cpu_seconds: now - self.cpu_seconds,
        };
        self.cpu_seconds = now;
        (self.tell)(&finding);
        self.findings.push(finding);
    }

    /// The findings; the last one is that no render left out a contribution.
    pub(super) fn finish(mut self) -> Vec<Finding> {
        if self.rendered > 0 {
            let figure = Figure::none_of(self.rejected, self.rendered);
            self.note(
                "all renders of the case",
                "no contribution is unsound",
                figure,
            );
        }
        self.findings
    }
}
