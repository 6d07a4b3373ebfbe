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
        "\n{:<width$}{:>10}{:>13}{:>18}{:>8}{:>8}{:>8}{:>12}{:>8}{:>8}  {}",
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
        "of"
    )?;
    for (structure, figures) in rows {
        let rate = &figures.mrays_per_cpu_second;
        writeln!(
            f,
            "{:<width$}{:>10}{:>13.3}{:>18}{:>8.3}{:>8}{:>8}{:>12}{:>8}{:>8}  {}",
            structure.name,
            figures.rays,
            rate.median,
            format!("{:.3}..{:.3}", rate.least, rate.most),
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
