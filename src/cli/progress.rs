//! Shows how far a render is: a bar on a terminal, else a line every few seconds.

use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::integrator::stats::Progress;

use super::note;

/// Time between two lines where the output is no terminal.
const LINE_INTERVAL: Duration = Duration::from_secs(3);

/// Time between two states of the bar.
const BAR_INTERVAL: Duration = Duration::from_millis(100);

/// Steps of the bar.
const BAR_LENGTH: u64 = 1000;

/// Where progress goes.
#[derive(Debug)]
enum Target {
    Nowhere,
    Lines,
    Bar(ProgressBar),
}

/// The display; workers may tell it their progress at any rate and at the same time.
#[derive(Debug)]
pub(super) struct ProgressDisplay {
    target: Target,
    interval: Duration,
    /// When something was last shown.
    shown: Mutex<Instant>,
}

/// A bar over `length` triangles to be written; invisible if `quiet` or where the output is no terminal.
pub(super) fn triangle_bar(length: u32, quiet: bool) -> ProgressBar {
    if quiet || !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style =
        ProgressStyle::with_template("{bar:30} {percent:>3} %, {human_pos} triangles, {eta} left")
            .expect("the template is a constant and well formed");
    ProgressBar::new(length.into()).with_style(style)
}

impl ProgressDisplay {
    pub(super) fn new(quiet: bool) -> Self {
        let (target, interval) = if quiet {
            (Target::Nowhere, Duration::MAX)
        } else if std::io::stderr().is_terminal() {
            let style = ProgressStyle::with_template("{bar:30} {msg}")
                .expect("the template is a constant and well formed");
            (
                Target::Bar(ProgressBar::new(BAR_LENGTH).with_style(style)),
                BAR_INTERVAL,
            )
        } else {
            (Target::Lines, LINE_INTERVAL)
        };
        Self {
            target,
            interval,
            shown: Mutex::new(Instant::now()),
        }
    }

    /// Shows the state if the last one is old enough.
    pub(super) fn show(&self, progress: &Progress) {
        // Another worker is showing its state just now if the lock is taken.
        let Ok(mut shown) = self.shown.try_lock() else {
            return;
        };
        if shown.elapsed() < self.interval {
            return;
        }
        *shown = Instant::now();
        match &self.target {
            Target::Nowhere => {}
            Target::Lines => note(&describe(progress)),
            Target::Bar(bar) => {
                bar.set_position((progress.fraction * BAR_LENGTH as f64) as u64);
                bar.set_message(describe(progress));
            }
        }
    }

    /// Removes the bar.
    pub(super) fn finish(&self) {
        if let Target::Bar(bar) = &self.target {
            bar.finish_and_clear();
        }
    }
}

/// One line: share done, samples, rate, error, time left.
fn describe(progress: &Progress) -> String {
    let Progress {
        fraction,
        samples,
        rays,
        seconds,
        error,
    } = *progress;
    let rate = if seconds > 0.0 {
        rays as f64 / seconds * 1e-6
    } else {
        0.0
    };
    let mut text = format!(
        "{:3.0} %, {samples:.1} samples per pixel, {rate:.2} Mrays/s",
        100.0 * fraction
    );
    if let Some(error) = error {
        text += &format!(", error {:.2} %", 100.0 * error);
    }
    if fraction > 0.0 {
        text += &format!(
            ", {} left",
            duration(seconds * (1.0 - fraction).max(0.0) / fraction)
        );
    }
    text
}

fn duration(seconds: f64) -> String {
    // Rounded up, so that the last second is not called 0.
    let whole = seconds.ceil() as u64;
    match (whole / 3600, whole / 60 % 60, whole % 60) {
        (0, 0, seconds) => format!("{seconds} s"),
        (0, minutes, seconds) => format!("{minutes} min {seconds} s"),
        (hours, minutes, _) => format!("{hours} h {minutes} min"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn line_tells_samples_rate_error_and_time_left() {
        let progress = Progress {
            fraction: 0.25,
            samples: 16.0,
            rays: 60_000_000,
            seconds: 4.0,
            error: Some(0.0312),
        };
        assert_eq!(
            describe(&progress),
            " 25 %, 16.0 samples per pixel, 15.00 Mrays/s, error 3.12 %, 12 s left"
        );
    }

    #[test]
    fn nothing_is_invented_before_the_first_sample() {
        let progress = Progress {
            fraction: 0.0,
            samples: 0.0,
            rays: 0,
            seconds: 0.0,
            error: None,
        };
        assert_eq!(
            describe(&progress),
            "  0 %, 0.0 samples per pixel, 0.00 Mrays/s"
        );
    }

    #[test]
    fn durations_are_rounded_up_and_carry() {
        for (seconds, text) in [
            (0.0, "0 s"),
            (0.2, "1 s"),
            (59.5, "1 min 0 s"),
            (3599.0, "59 min 59 s"),
            (7260.0, "2 h 1 min"),
        ] {
            assert_eq!(duration(seconds), text);
        }
    }
}
