//! What loading a scene takes, apart from building and tracing it.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::summary::mebibytes;
use super::{Span, peak_memory, ratio};
use crate::scene::MeshFile;

/// What loading a scene took.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadReport {
    /// All of it: scene file, meshes, materials, textures, checks.
    pub time: Span,
    /// Most bytes that the process held until the scene was loaded.
    pub peak_bytes: Option<u64>,
    /// Each OBJ file.
    pub meshes: Vec<MeshReport>,
}

/// What reading an OBJ file took.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshReport {
    /// The file.
    pub file: String,
    /// Bytes of its text, uncompressed.
    pub bytes: u64,
    /// Wall seconds from opening it to its triangles.
    pub seconds: f64,
    /// Millions of those bytes per second.
    pub megabytes_per_second: f64,
    /// Vertices in the file.
    pub vertices: u64,
    /// Triangles in the file.
    pub triangles: u64,
}

impl LoadReport {
    /// The report of a load that took `time` and has just ended.
    pub fn new(time: Span, files: &[MeshFile]) -> Self {
        let mesh = |file: &MeshFile| MeshReport {
            file: file.path.display().to_string(),
            bytes: file.bytes,
            seconds: file.seconds,
            megabytes_per_second: ratio(file.bytes as f64 * 1e-6, file.seconds),
            vertices: file.vertices,
            triangles: file.triangles,
        };
        Self {
            time,
            peak_bytes: peak_memory(),
            meshes: files.iter().map(mesh).collect(),
        }
    }

    /// Time and memory of the whole load, in words.
    pub fn total(&self) -> String {
        format!(
            "loaded in {:.3} s, {:.3} s of CPU, peak memory {}",
            self.time.wall_seconds,
            self.time.cpu_seconds,
            self.peak_bytes.map_or("unknown".to_owned(), mebibytes),
        )
    }
}

/// A line per mesh.
impl fmt::Display for LoadReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for mesh in &self.meshes {
            writeln!(
                f,
                "{}: {} triangles, {} vertices, {:.1} MB parsed in {:.3} s, {:.0} MB/s",
                mesh.file,
                mesh.triangles,
                mesh.vertices,
                mesh.bytes as f64 * 1e-6,
                mesh.seconds,
                mesh.megabytes_per_second
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::path::PathBuf;

    use super::*;

    /// The report of one small invented mesh.
    pub(in crate::report) fn sample() -> LoadReport {
        let file = MeshFile {
            path: PathBuf::from("room.obj"),
            bytes: 3_000_000,
            seconds: 0.025,
            vertices: 40_000,
            triangles: 70_000,
        };
        LoadReport::new(Span::default(), &[file])
    }

    #[test]
    fn text_and_rate_follow_from_size_and_time() {
        let report = sample();
        assert!((report.meshes[0].megabytes_per_second - 120.0).abs() < 1e-9);
        assert_eq!(
            report.to_string(),
            "room.obj: 70000 triangles, 40000 vertices, 3.0 MB parsed in 0.025 s, 120 MB/s\n"
        );
        assert!(report.peak_bytes.is_some_and(|bytes| bytes > 0));
        assert_eq!(LoadReport::default().to_string(), "");
        let total = LoadReport {
            time: Span {
                wall_seconds: 0.25,
                cpu_seconds: 0.5,
            },
            peak_bytes: Some(3 << 20),
            ..report
        };
        assert_eq!(
            total.total(),
            "loaded in 0.250 s, 0.500 s of CPU, peak memory 3.0 MiB"
        );
    }
}
