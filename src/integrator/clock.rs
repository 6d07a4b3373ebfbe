//! Time per stage and per phase, and CPU time of threads and of the process.

use std::ops::{AddAssign, Sub};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

/// The steps of the driver loop; their names label every profile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(usize)]
pub enum Step {
    /// work item → rays.
    Generate,
    /// rays → hits.
    Intersect,
    /// hits → queues.
    Sort,
    /// escaped rays and emitter hits → radiance, camera hits → auxiliary sums.
    Emission,
    /// material queues → shadow rays, next rays.
    Shade,
    /// shadow rays → radiance.
    Connect,
    /// next rays → rays.
    Roulette,
    /// radiance per path → sums per pixel.
    Film,
}

impl Step {
    /// Every step, in loop order.
    pub const ALL: [Self; 8] = [
        Self::Generate,
        Self::Intersect,
        Self::Sort,
        Self::Emission,
        Self::Shade,
        Self::Connect,
        Self::Roulette,
        Self::Film,
    ];

    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Generate => "generate",
            Self::Intersect => "intersect",
            Self::Sort => "sort",
            Self::Emission => "emission",
            Self::Shade => "shade",
            Self::Connect => "connect",
            Self::Roulette => "roulette",
            Self::Film => "film",
        }
    }
}

/// Time and items per step of one worker.
#[derive(Debug, Clone, Copy, Default)]
pub struct StageClock {
    /// Time per step.
    pub time: [Duration; Step::ALL.len()],
    /// Items per step.
    pub items: [u64; Step::ALL.len()],
}

impl StageClock {
    /// Runs `step` on `items` items and adds its time.
    #[inline]
    pub fn run<R>(&mut self, step: Step, items: usize, work: impl FnOnce() -> R) -> R {
        let start = Instant::now();
        let result = work();
        self.time[step as usize] += start.elapsed();
        self.items[step as usize] += items as u64;
        result
    }

    /// Adds another worker's figures.
    pub fn add(&mut self, other: &Self) {
        for i in 0..Step::ALL.len() {
            self.time[i] += other.time[i];
            self.items[i] += other.items[i];
        }
    }
}

/// Time that a phase took.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Span {
    /// Wall seconds.
    pub wall_seconds: f64,
    /// CPU seconds of all threads of the process, user and system.
    pub cpu_seconds: f64,
}

/// Measures a [`Span`].
#[derive(Debug, Clone, Copy)]
pub struct Stopwatch {
    wall: Instant,
    cpu_seconds: f64,
}

impl Stopwatch {
    /// Starts now.
    pub fn start() -> Self {
        Self {
            wall: Instant::now(),
            cpu_seconds: process_cpu_seconds(),
        }
    }

    /// Time since the start.
    pub fn span(&self) -> Span {
        Span {
            wall_seconds: self.wall.elapsed().as_secs_f64(),
            cpu_seconds: process_cpu_seconds() - self.cpu_seconds,
        }
    }
}

impl AddAssign for Span {
    fn add_assign(&mut self, other: Self) {
        self.wall_seconds += other.wall_seconds;
        self.cpu_seconds += other.cpu_seconds;
    }
}

impl Sub for Span {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self {
            wall_seconds: self.wall_seconds - other.wall_seconds,
            cpu_seconds: self.cpu_seconds - other.cpu_seconds,
        }
    }
}

/// CPU seconds of the calling thread so far.
pub fn thread_cpu_seconds() -> f64 {
    clock_seconds(libc::CLOCK_THREAD_CPUTIME_ID)
}

/// CPU seconds of the whole process so far.
pub fn process_cpu_seconds() -> f64 {
    clock_seconds(libc::CLOCK_PROCESS_CPUTIME_ID)
}

#[expect(unsafe_code, reason = "the standard library has no CPU clocks")]
fn clock_seconds(clock: libc::clockid_t) -> f64 {
    let mut time = libc::timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    // SAFETY: `time` is a valid timespec that the call fills in; on failure it stays zero.
    unsafe { libc::clock_gettime(clock, &raw mut time) };
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cpu_time_advances_with_work_and_steps_are_named_in_order() {
        let start = thread_cpu_seconds();
        let mut clock = StageClock::default();
        let sum = clock.run(Step::Shade, 5, || {
            (0..20_000_000u64).fold(0, |a, b| std::hint::black_box(a ^ b))
        });
        std::hint::black_box(sum);
        assert!(thread_cpu_seconds() > start);
        assert!(clock.time[Step::Shade as usize] > Duration::ZERO);
        assert_eq!(clock.items[Step::Shade as usize], 5);
        for (i, step) in Step::ALL.into_iter().enumerate() {
            assert_eq!(step as usize, i);
        }
    }

    #[test]
    fn busy_work_counts_as_cpu_time_and_sleep_does_not() {
        let watch = Stopwatch::start();
        std::thread::sleep(std::time::Duration::from_millis(20));
        assert!(watch.span().wall_seconds >= 0.02);

        let before = process_cpu_seconds();
        let start = Instant::now();
        while process_cpu_seconds() - before < 0.01 {
            assert!(start.elapsed().as_secs() < 60, "the CPU clock stands still");
        }
    }
}
