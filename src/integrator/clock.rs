//! Time per stage, and CPU time of threads and of the process.

use std::time::{Duration, Instant};

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
}
