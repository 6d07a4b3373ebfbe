//! Wall and CPU time of a phase, and the process's peak memory.

use std::time::Instant;

use serde::{Deserialize, Serialize};

use crate::film::memory::bytes_field;
use crate::integrator::clock::process_cpu_seconds;

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

/// Most bytes that the process ever held in memory. `None` where the system does not say.
pub fn peak_memory() -> Option<u64> {
    bytes_field(
        &std::fs::read_to_string("/proc/self/status").ok()?,
        "VmHWM:",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn peak_memory_includes_what_was_touched() {
        let touched = vec![1u8; 32 << 20];
        assert!(peak_memory().unwrap() >= touched.len() as u64);
    }
}
