//! The comparison as text.

use std::fmt;

use super::{AccelsReport, KindFigures, StructureReport};

impl fmt::Display for AccelsReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (scene, settings) = (&self.scene, &self.settings);
        writeln!(
            f,
            "{}, camera {}, {} × {} pixels, {} triangles, {} spheres",
            scene.name, scene.camera, scene.width, scene.height, self.triangles, self.spheres
        )?;
        writeln!(
            f,
            "{}; {} threads, batches of {} rays, {} rounds, seed {}, {} lanes",
            self.machine.cpu,
            settings.threads,
            settings.batch,
            settings.rounds,
            settings.seed,
            self.build.lanes
        )?;
        self.build_table(f)?;
        for kind in &settings.kinds {
            let rows: Vec<(&StructureReport, &KindFigures)> = self
                .structures
                .iter()
                .filter_map(|structure| {
                    let figures = structure
                        .kinds
                        .iter()
                        .find(|figures| figures.kind == *kind)?;
                    Some((structure, figures))
                })
                .collect();
            kind_table(f, &rows)?;
        }
        Ok(())
    }
}

impl AccelsReport {
    fn build_table(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let primitives = (self.triangles + self.spheres).max(1) as f64;
        let width = self.name_width();
        writeln!(
            f,
            "\n{:<width$}{:>10}{:>10}{:>14}{:>14}",
            "build", "wall s", "CPU s", "bytes/prim.", "peak"
        )?;
        for structure in &self.structures {
            let figures = &structure.build;
            let peak = figures.peak_bytes.max(figures.monitored_peak_bytes);
            writeln!(
                f,
                "{:<width$}{:>10.3}{:>10.3}{:>14.1}{:>14}",
                structure.name,
                figures.time.wall_seconds,
                figures.time.cpu_seconds,
                figures.bytes as f64 / primitives,
                optional(peak.map(|bytes| bytes as f64 / primitives), 1),
            )?;
        }
        Ok(())
    }

    fn name_width(&self) -> usize {
        name_width(self.structures.iter())
    }
}

fn name_width<'a>(structures: impl Iterator<Item = &'a StructureReport>) -> usize {
    structures
        .map(|structure| structure.name.len())
        .max()
        .unwrap_or(0)
        .max(12)
        + 2
}

fn kind_table(
    f: &mut fmt::Formatter<'_>,
    rows: &[(&StructureReport, &KindFigures)],
) -> fmt::Result {
    let Some((_, first)) = rows.first() else {
        return Ok(());
    };
    let width = name_width(rows.iter().map(|(structure, _)| *structure));
    writeln!(
        f,
        "\n{:<width$}{:>10}{:>13}{:>18}{:>8}{:>8}{:>11}{:>12}{:>8}{:>8}  of",
        first.kind.name(),
        "rays",
        "Mrays/CPU s",
        "spread",
        "ratio",
        "nodes",
        "tests",
        "pays after",
        "ties",
        "differ",
    )?;
    for (structure, figures) in rows {
        let rate = &figures.mrays_per_cpu_second;
        writeln!(
            f,
            "{:<width$}{:>10}{:>13}{:>18}{:>8.3}{:>8}{:>11}{:>12}{:>8}{:>8}  {}",
            structure.name,
            figures.rays,
            rate_text(rate.median),
            format!("{}..{}", rate_text(rate.least), rate_text(rate.most)),
            figures.ratio_to_best,
            optional(figures.nodes_per_ray, 1),
            optional(figures.tests_per_ray, 1),
            figures.pays_after.map_or("-".to_owned(), quantity),
            figures.differences.ties,
            figures.differences.differing,
            figures.differences.rays,
        )?;
    }
    Ok(())
}

/// With three decimals, or as a power of ten where those would be zero.
fn rate_text(rate: f64) -> String {
    if rate >= 0.01 {
        format!("{rate:.3}")
    } else {
        format!("{rate:.1e}")
    }
}

fn optional(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.digits$}"))
}

/// Rounded, with a prefix.
fn quantity(value: f64) -> String {
    match value {
        v if v >= 1e9 => format!("{:.2} G", v * 1e-9),
        v if v >= 1e6 => format!("{:.2} M", v * 1e-6),
        v if v >= 1e3 => format!("{:.2} k", v * 1e-3),
        v => format!("{v:.0}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::accels::{
        AccelsSettings, BuildFigures, Differences, FORMAT, RayKind, Round, Spread,
    };
    use crate::report::{Build, Machine, SceneReport, Span};

    fn structure(name: &str, nodes: Option<f64>) -> StructureReport {
        StructureReport {
            name: name.to_owned(),
            own: nodes.is_some(),
            build: BuildFigures {
                time: Span {
                    wall_seconds: 1.25,
                    cpu_seconds: 2.5,
                },
                bytes: 4000,
                peak_bytes: None,
                monitored_peak_bytes: None,
            },
            kinds: vec![KindFigures {
                kind: RayKind::Shadow,
                rays: 1000,
                rounds: vec![Round {
                    cpu_seconds: 0.5,
                    wall_seconds: 0.25,
                }],
                mrays_per_cpu_second: Spread {
                    least: 1.5,
                    median: 2.0,
                    most: 2.5,
                },
                ratio_to_best: 0.75,
                nodes_per_ray: nodes,
                tests_per_ray: nodes,
                pays_after: nodes.map(|_| 3_210_000.0),
                differences: Differences {
                    rays: 900,
                    ties: 7,
                    differing: 3,
                },
            }],
        }
    }

    #[test]
    fn rows_have_every_figure_and_dashes_where_nothing_is_known() {
        let report = AccelsReport {
            format: FORMAT,
            build: Build::current(),
            machine: Machine::read(),
            scene: SceneReport {
                name: "room".to_owned(),
                camera: "front".to_owned(),
                width: 4,
                height: 3,
            },
            triangles: 99,
            spheres: 1,
            settings: AccelsSettings {
                kinds: vec![RayKind::Primary, RayKind::Shadow],
                count: 1000,
                batch: 100,
                rounds: 1,
                threads: 2,
                seed: 0,
            },
            structures: vec![
                structure("bvh8", Some(12.5)),
                structure("a-name-longer-than-others", None),
            ],
            notes: Vec::new(),
        };
        let text = report.to_string();
        let row = |name: &str, number: usize| {
            let mut rows = text.lines().filter(|line| line.starts_with(name));
            let words = rows.nth(number).unwrap().split_whitespace();
            words.skip(1).map(str::to_owned).collect::<Vec<_>>()
        };
        assert_eq!(row("bvh8", 0), ["1.250", "2.500", "40.0", "-"]);
        let common = ["1000", "2.000", "1.500..2.500", "0.750"];
        let last = ["7", "3", "900"];
        let own = [&common[..], &["12.5", "12.5", "3.21", "M"], &last].concat();
        assert_eq!(row("bvh8", 1), own);
        let foreign = [&common[..], &["-"; 3], &last].concat();
        assert_eq!(row("a-name", 1), foreign);
        // Columns are right-aligned: rows of a table are equally long.
        let lengths: Vec<usize> = text
            .lines()
            .filter(|line| line.ends_with(" 900"))
            .map(|line| line.chars().count())
            .collect();
        assert!(lengths.len() == 2 && lengths[0] == lengths[1], "{text}");
        // No rays of that kind were run.
        assert!(!text.contains("primary"), "{text}");
        assert_eq!(
            report.faults(),
            ["bvh8 differs from the scan on 3 of 900 shadow rays"]
        );
        let read: AccelsReport = serde_json::from_str(&report.to_json()).unwrap();
        assert_eq!(read, report);
    }

    #[test]
    fn quantities_have_three_digits_and_a_prefix() {
        for (value, text) in [
            (12.0, "12"),
            (1234.0, "1.23 k"),
            (2.5e6, "2.50 M"),
            (3e9, "3.00 G"),
        ] {
            assert_eq!(quantity(value), text);
        }
    }
}
