//! Real meshes: every file of the folder that `WAVEPATH_MESHES` names.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use wavepath::scene::{self, ShapeGeometry};

/// Triangles of each file as the tables of the folder's README count them, by the file's name without
/// folder and compression. Where a table has no number, neither has this.
fn counts(readme: &str) -> HashMap<String, u64> {
    let mut counts = HashMap::new();
    let mut column = 0;
    for line in readme.lines().filter(|line| line.starts_with('|')) {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        if let Some(found) = cells.iter().position(|cell| cell.starts_with("triangles")) {
            column = found;
        }
        let count = cells.get(column).map(|cell| cell.replace(',', ""));
        if let (Some(name), Some(Ok(count))) =
            (cells[1].strip_prefix('`'), count.map(|c| c.parse()))
        {
            let name = name.trim_end_matches('`').trim_end_matches(".zst");
            let folder = if name.starts_with("tinyobjloader") || name.starts_with("tobj") {
                "nasty/"
            } else {
                ""
            };
            counts.insert(format!("{folder}{name}"), count);
        }
    }
    counts
}

fn obj_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.to_string_lossy().into_owned();
        if path.is_dir() {
            files.extend(obj_files(&path));
        } else if name.ends_with(".obj") || name.ends_with(".obj.zst") {
            files.push(path);
        }
    }
    files.sort();
    files
}

/// Faces that the loader says it removed.
fn removed(warnings: &[String]) -> u64 {
    let kinds = [" of zero area", " equal to another", " beyond 1.8e18"];
    let counts = warnings.iter().filter(|warning| {
        let is_face = warning.contains(" face ") || warning.contains(" faces ");
        is_face && kinds.iter().any(|kind| warning.contains(kind))
    });
    let count = |warning: &String| -> u64 {
        let sentence = warning.rsplit(": ").next().unwrap();
        sentence.split(' ').next().unwrap().parse().unwrap()
    };
    counts.map(count).sum()
}

#[test]
#[allow(
    clippy::print_stderr,
    reason = "tells the developer that the test did nothing"
)]
fn every_mesh_has_its_triangles_or_is_refused_at_a_line() {
    let Some(root) = std::env::var_os("WAVEPATH_MESHES").map(PathBuf::from) else {
        eprintln!("skipped: set WAVEPATH_MESHES to a folder of OBJ files with a README.md");
        return;
    };
    let readme = std::fs::read_to_string(root.join("README.md")).unwrap();
    let counts = counts(&readme);
    let mut counted = 0;
    for path in obj_files(&root) {
        let relative = path.strip_prefix(&root).unwrap().to_string_lossy();
        let expected = counts.get(relative.trim_end_matches(".zst"));
        match scene::load(&path, &[]) {
            Ok(scene) => {
                let triangles = scene.mesh_files[0].triangles;
                let mesh = scene.shapes.last().map(|shape| &shape.geometry);
                let Some(ShapeGeometry::Mesh(mesh)) = mesh else {
                    panic!("{relative}: no mesh");
                };
                let kept = mesh.faces.len() as u64;
                assert_eq!(kept + removed(&scene.warnings), triangles, "{relative}");
                assert!(mesh.positions.iter().all(|position| position.is_finite()));
                if let Some(&expected) = expected {
                    assert_eq!(triangles, expected, "{relative}");
                    counted += 1;
                }
            }
            Err(error) => {
                let place = error.place.as_ref().expect("the file is named");
                assert_eq!(place.file, path);
                let has_none = error.message == "the file has no faces";
                assert!(place.line.is_some() || has_none, "{error}");
                assert!(expected.is_none_or(|&count| count == 0 || place.line.is_some()));
            }
        }
    }
    assert!(counted >= 60, "only {counted} files are in the README");
}
