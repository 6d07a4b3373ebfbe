//! The machine and the build that a figure belongs to.

use std::fs;

use serde::{Deserialize, Serialize};

use crate::math::LANES;

/// The machine, as far as it tells.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    /// CPU model, or `unknown`.
    pub cpu: String,
    /// Logical cores that this process may use.
    pub cores: usize,
    /// Operating system with its release, and the architecture.
    pub os: String,
    /// Load average over 1, 5 and 15 minutes when this was read.
    pub load_average: Option<[f64; 3]>,
}

impl Machine {
    /// Asks the machine now: before a render, so that the load is not its own.
    pub fn read() -> Self {
        let file = |path: &str| fs::read_to_string(path).ok();
        Self {
            cpu: file("/proc/cpuinfo")
                .as_deref()
                .and_then(cpu_model)
                .unwrap_or_else(|| "unknown".to_owned()),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            os: match (
                file("/proc/sys/kernel/ostype"),
                file("/proc/sys/kernel/osrelease"),
            ) {
                (Some(kind), Some(release)) => {
                    format!(
                        "{} {} {}",
                        kind.trim(),
                        release.trim(),
                        std::env::consts::ARCH
                    )
                }
                _ => format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            },
            load_average: file("/proc/loadavg").as_deref().and_then(load_average),
        }
    }
}

fn cpu_model(cpuinfo: &str) -> Option<String> {
    let line = cpuinfo
        .lines()
        .find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

fn load_average(loadavg: &str) -> Option<[f64; 3]> {
    let mut values = loadavg.split_whitespace().map(|word| word.parse().ok());
    Some([values.next()??, values.next()??, values.next()??])
}

/// What was built, and how.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Build {
    /// Version of the program.
    pub version: String,
    /// Commit it was built from, with `-dirty` if files had changed.
    pub commit: String,
    /// Rays per lane kernel step.
    pub lanes: usize,
    /// Instruction sets that the compiler could use, comma separated.
    pub target_features: String,
    /// The compiler with its version.
    #[serde(default)]
    pub compiler: String,
}

impl Build {
    /// This program.
    pub fn current() -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: env!("WAVEPATH_COMMIT").to_owned(),
            lanes: LANES,
            target_features: env!("WAVEPATH_TARGET_FEATURES").to_owned(),
            compiler: env!("WAVEPATH_COMPILER").to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_processor_names_the_model() {
        let text =
            "processor\t: 0\nmodel\t\t: 85\nmodel name\t: A CPU @ 2.00GHz\nmodel name\t: B\n";
        assert_eq!(cpu_model(text).as_deref(), Some("A CPU @ 2.00GHz"));
        assert_eq!(cpu_model("Hardware : board\n"), None);
    }

    #[test]
    fn load_average_is_the_first_three_numbers() {
        assert_eq!(
            load_average("0.50 1.25 2.00 3/400 12345\n"),
            Some([0.5, 1.25, 2.0])
        );
        assert_eq!(load_average("0.50 x 2.00"), None);
        assert_eq!(load_average(""), None);
    }
}
