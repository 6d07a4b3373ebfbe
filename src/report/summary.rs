//! The report as text for people.

use std::fmt;

use clap::ValueEnum;

use crate::integrator::stats::EndReason;
use crate::scene::{AccelKind, Budget};

use super::{DepthReport, RenderReport, ResumeReport, ratio};

/// Depths with a line of their own; deeper ones share the last line.
const DEPTH_LINES: usize = 8;

impl fmt::Display for RenderReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.header(f)?;
        self.time_table(f)?;
        self.ray_table(f)?;
        self.stage_table(f)?;
        self.depth_table(f)?;
        self.footer(f)
    }
}

impl RenderReport {
    fn header(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (scene, result, settings) = (&self.scene, &self.result, &self.settings);
        writeln!(
            f,
            "{}, camera {}, {} × {} pixels, {} samples per pixel",
            scene.name,
            scene.camera,
            scene.width,
            scene.height,
            result.samples_per_pixel(),
        )?;
        let error = match (result.relative_error, result.relative_error_interval) {
            (Some(error), Some([low, high])) => format!(
                "estimated relative error {:.3} %, 95 % interval {:.3} to {:.3} %",
                100.0 * error,
                100.0 * low,
                100.0 * high
            ),
            _ => "no error estimate (it takes two blocks at every pixel)".to_owned(),
        };
        writeln!(f, "{error}; ended by {}", self.end())?;
        if let Some(ResumeReport {
            sessions,
            before,
            after,
        }) = &self.resumed
        {
            writeln!(
                f,
                "resumed, session {sessions}: {} samples per pixel in {:.1} CPU s before, {} in {:.1} CPU s in this one",
                decimals(before.samples),
                before.cpu_seconds,
                decimals(after.samples),
                after.cpu_seconds
            )?;
        }
        for bias in &result.bias {
            writeln!(f, "biased: {bias}")?;
        }
        let depth = settings
            .max_depth
            .map_or("none".to_owned(), |depth| depth.to_string());
        let accel = match settings.accel {
            AccelKind::Auto => format!("auto ({})", self.accel),
            chosen => name(chosen),
        };
        writeln!(
            f,
            "{}, strategy {}, sampler {}, accel {accel}, depth limit {depth}, roulette from {}",
            name(settings.integrator),
            name(settings.strategy),
            name(settings.sampler),
            settings.roulette_depth,
        )?;
        let mut extras = Vec::new();
        if settings.light_samples > 1 {
            extras.push(format!("{} light samples per hit", settings.light_samples));
        }
        if settings.glass_splits > 0 {
            extras.push(format!("{} splits at glass", settings.glass_splits));
        }
        if settings.adaptive {
            extras.push("adaptive sampling".to_owned());
        }
        if !extras.is_empty() {
            writeln!(f, "{}", extras.join(", "))?;
        }
        writeln!(
            f,
            "seed {}, {} threads, wave {}, block {}, {} lanes",
            settings.seed, settings.threads, settings.wave, settings.block, self.build.lanes
        )
    }

    /// What ended the render, with the limit.
    fn end(&self) -> String {
        match (self.result.ended, self.settings.budget) {
            (EndReason::Interrupted, _) => "interruption".to_owned(),
            (EndReason::Seconds, Budget::Seconds(seconds)) => format!("time, {seconds} s"),
            (EndReason::Error, Budget::Error(goal)) => format!("error goal, {} %", 100.0 * goal),
            (EndReason::Seconds, _) => "time".to_owned(),
            (EndReason::Error, _) => "error goal".to_owned(),
            (EndReason::Samples, _) => "sample count".to_owned(),
        }
    }

    fn time_table(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "\n{:<14}{:>10}{:>10}", "phase", "wall s", "CPU s")?;
        for (phase, span) in self.times.phases() {
            writeln!(
                f,
                "{phase:<14}{:>10.3}{:>10.3}",
                span.wall_seconds, span.cpu_seconds
            )?;
        }
        let (other, all) = (
            self.times.other_cpu_seconds(),
            self.times.process_cpu_seconds,
        );
        writeln!(f, "{:<14}{:>10}{other:>10.3}", "other", "")?;
        writeln!(f, "{:<14}{:>10}{all:>10.3}", "process", "")?;
        write!(f, "{}", self.load)
    }

    fn ray_table(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (rays, paths) = (&self.rays, &self.paths);
        writeln!(
            f,
            "\n{:<14}{:>10}{:>10}{:>10}",
            "rays", "count", "share", "per path"
        )?;
        let kinds = [
            ("camera", rays.camera),
            ("bounce", rays.bounce),
            ("shadow", rays.shadow),
            ("all", rays.total),
        ];
        for (kind, count) in kinds {
            writeln!(
                f,
                "{kind:<14}{:>10}{:>10}{:>10.2}",
                quantity(count as f64),
                percent(ratio(count as f64, rays.total as f64)),
                ratio(count as f64, paths.count as f64),
            )?;
        }
        writeln!(
            f,
            "{:.2} Mrays/s, {:.2} Mrays and {} paths per CPU second, mean path length {:.2}",
            rays.per_second * 1e-6,
            rays.per_cpu_second * 1e-6,
            quantity(paths.per_cpu_second),
            paths.mean_length,
        )?;
        writeln!(
            f,
            "{:.1} nodes and {:.1} primitive tests per ray, {} contributions not finite or negative",
            rays.nodes_per_ray, rays.tests_per_ray, self.result.rejected
        )
    }

    fn stage_table(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "\n{:<14}{:>10}{:>10}{:>10}{:>10}",
            "stage", "CPU s", "share", "items", "ns each"
        )?;
        for stage in &self.stages {
            write!(
                f,
                "{:<14}{:>10.3}{:>10}",
                stage.name,
                stage.cpu_seconds,
                percent(stage.share)
            )?;
            if stage.items > 0 {
                let each = 1e9 * stage.cpu_seconds / stage.items as f64;
                write!(f, "{:>10}{each:>10.1}", quantity(stage.items as f64))?;
            }
            writeln!(f)?;
        }
        Ok(())
    }

    fn depth_table(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "\n{:<14}{:>10}{:>10}{:>10}",
            "depth", "rays", "shadow", "fill"
        )?;
        // A last line of one depth is printed as itself.
        let own_lines = if self.depths.len() > DEPTH_LINES + 1 {
            DEPTH_LINES
        } else {
            self.depths.len()
        };
        let (shallow, deep) = self.depths.split_at(own_lines);
        let mut line = |label: &str, depths: &[DepthReport]| {
            let sum = |count: fn(&DepthReport) -> u64| depths.iter().map(count).sum::<u64>() as f64;
            writeln!(
                f,
                "{label:<14}{:>10}{:>10}{:>10}",
                quantity(sum(|depth| depth.rays)),
                quantity(sum(|depth| depth.shadow_rays)),
                percent(depths.iter().map(|depth| depth.queue_fill).sum()),
            )
        };
        for depth in shallow {
            line(&depth.depth.to_string(), std::slice::from_ref(depth))?;
        }
        if let (Some(first), Some(last)) = (deep.first(), deep.last()) {
            line(&format!("{} to {}", first.depth, last.depth), deep)?;
        }
        Ok(())
    }

    fn footer(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "\nqueues {} full over {} passes, {} bytes per path in flight",
            percent(self.queues.fill),
            quantity(self.queues.passes as f64),
            self.queues.bytes_per_path,
        )?;
        let peak = self
            .memory
            .peak_bytes
            .map_or("unknown".to_owned(), mebibytes);
        let loaded = self.load.peak_bytes;
        writeln!(
            f,
            "peak memory {peak}, of which {} when the scene was loaded, film {}",
            loaded.map_or("unknown".to_owned(), mebibytes),
            mebibytes(self.memory.film_bytes)
        )?;
        let machine = &self.machine;
        write!(
            f,
            "{}, {} cores, {}",
            machine.cpu, machine.cores, machine.os
        )?;
        if let Some([one, five, fifteen]) = machine.load_average {
            write!(f, ", load before {one:.2} {five:.2} {fifteen:.2}")?;
        }
        writeln!(
            f,
            "\nwavepath {} ({})",
            self.build.version, self.build.commit
        )
    }
}

/// An option's value as it is typed.
pub(super) fn name(value: impl ValueEnum) -> String {
    value
        .to_possible_value()
        .map_or_else(String::new, |value| value.get_name().to_owned())
}

/// A number with at most two decimals.
fn decimals(number: f64) -> String {
    let text = format!("{number:.2}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// Up to four digits as they are, else three or more with a decimal prefix.
fn quantity(count: f64) -> String {
    match count {
        1e12.. => format!("{:.2} T", count * 1e-12),
        1e9.. => format!("{:.2} G", count * 1e-9),
        1e6.. => format!("{:.2} M", count * 1e-6),
        1e4.. => format!("{:.2} k", count * 1e-3),
        _ => format!("{count:.0}"),
    }
}

pub(super) fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

#[cfg(test)]
mod tests {
    use super::super::tests::sample;
    use super::*;

    #[test]
    fn text_has_every_figure_that_it_promises() {
        let text = sample().to_string();
        for part in [
            "room, camera 1, 2 × 1 pixels, 6 samples per pixel",
            "estimated relative error",
            "ended by interruption",
            "resumed, session 3: 1.5 samples per pixel in 0.5 CPU s before, 4.5 in 1.5 CPU s in this one",
            "biased: depth limit 16: 3 paths cut",
            "path, strategy mis, sampler sobol, accel auto (linear), depth limit 16, roulette from 5",
            "seed 18446744073709551615, 2 threads, wave 1000, block 16",
            "lanes",
            "load               0.100     0.300",
            "other                        2.200",
            "process                      2.500",
            "room.obj: 70000 triangles",
            "when the scene was loaded",
            "build",
            "render",
            "shadow              3000    50.0 %      3.00",
            "0.01 Mrays/s, 0.00 Mrays and 500 paths per CPU second, mean path length 3.00",
            "intersect          1.000    50.0 %      4000  250000.0",
            "other",
            "2                    500       400    25.0 %",
            "queues 87.5 % full over 4 passes, 96 bytes per path in flight",
            "peak memory",
            ", 0 contributions not finite or negative",
            "cores",
            env!("WAVEPATH_COMMIT"),
        ] {
            assert!(text.contains(part), "{part:?} is missing in\n{text}");
        }
        assert!(
            text.lines().all(|line| line.chars().count() <= 120),
            "{text}"
        );
    }

    #[test]
    fn deep_paths_share_the_last_line() {
        let mut report = sample();
        let depth = DepthReport {
            depth: 0,
            rays: 10,
            shadow_rays: 5,
            queue_fill: 0.01,
        };
        report.depths = (1..=20)
            .map(|index| DepthReport {
                depth: index,
                ..depth
            })
            .collect();
        let text = report.to_string();
        assert!(
            text.contains("\n8                     10         5     1.0 %\n9 to 20"),
            "{text}"
        );
        assert!(
            text.contains("9 to 20              120        60    12.0 %"),
            "{text}"
        );
        report.depths.truncate(9);
        assert!(
            report.to_string().contains("\n9                     10"),
            "{report}"
        );
    }

    #[test]
    fn quantities_keep_three_digits() {
        for (count, text) in [
            (0.0, "0"),
            (9999.0, "9999"),
            (12_345.0, "12.35 k"),
            (1e6, "1.00 M"),
            (3.2e8, "320.00 M"),
            (1e14, "100.00 T"),
        ] {
            assert_eq!(quantity(count), text);
        }
    }
}
