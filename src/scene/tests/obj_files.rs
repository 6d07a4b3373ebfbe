//! OBJ files: what is read, what is removed, and where mistakes are.

use std::path::PathBuf;

use glam::DVec3;

use super::*;
use crate::scene::procedural::{ObjWriter, ScalableKind, ScalableMesh};

#[test]
fn an_obj_file_is_read_scaled_and_moved() {
    let scene = load_obj(TETRAHEDRON.as_bytes(), "").unwrap();
    let mesh = mesh_of(&scene);
    assert_eq!((mesh.positions.len(), mesh.faces.len()), (4, 4));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let scene = load_obj(
        TETRAHEDRON.as_bytes(),
        "scale = [2, 2, -4]\ntranslate = [0, 0, 1]",
    );
    let scene = scene.unwrap();
    let mesh = mesh_of(&scene);
    let sum: DVec3 = mesh.positions.iter().sum();
    assert_eq!(sum, DVec3::new(2.0, 2.0, 0.0));
    let volume = mesh.faces.iter().map(|face| {
        let [a, b, c] = face.map(|index| mesh.positions[index as usize] - DVec3::Z);
        a.dot(b.cross(c)) / 6.0
    });
    assert!(
        (volume.sum::<f64>() - 16.0 / 6.0).abs() < 1e-14,
        "normals stay outward"
    );
}

#[test]
fn obj_files_keep_double_precision_and_weld_nothing_away() {
    let text =
        "v 148376.123456789 0 0\nv 148376.123456790 0 0\nv 148376.1234567895 1e-9 0\nf 1 2 3\n";
    let scene = load_obj(text.as_bytes(), "").unwrap();
    assert_eq!(mesh_of(&scene).positions[1].x, 148376.123456790);
}

#[test]
fn polygons_groups_and_attributes_are_read_and_curves_are_not() {
    let text = "mtllib none.mtl\nvt 0 0\nvn 0 0 1\nv 0 0 0\nv 1 0 0 1.0\nv 1 1 0\nv 0 1 0\n\
        usemtl a\ng one\nf 1/1/1 2/1/1 3/1/1 4/1/1\ng two\nusemtl b\nv 2 2 2\nf 1//1 2//1 5//1\n\
        l 1 2 3 4\np 1\ns off\nf 1/0/0 3 5\n";
    let scene = load_obj(text.as_bytes(), "").unwrap();
    assert_eq!(mesh_of(&scene).faces.len(), 4);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn faces_of_an_obj_file_that_cannot_be_traced_are_removed_and_counted() {
    let text = format!(
        "{TETRAHEDRON}v nan 0 0\nv 1e19 0 0\nf 1 2 5\nf 1 2 6\nf 1 1 2\nf 2 1 3\nf 1 2\nf\n"
    );
    let scene = load_obj(text.as_bytes(), "").unwrap();
    assert_eq!(mesh_of(&scene).faces.len(), 4);
    let expected = [
        "mesh.obj: 2 faces with fewer than three corners removed",
        "scene.toml:15:8: 2 faces with a coordinate that is not finite or beyond 1.8e18 removed",
        "scene.toml:15:8: 1 face of zero area removed",
        "scene.toml:15:8: 1 face equal to another removed",
    ];
    assert_eq!(scene.warnings.len(), expected.len(), "{:?}", scene.warnings);
    for (warning, expected) in scene.warnings.iter().zip(expected) {
        assert!(warning.ends_with(expected), "{warning}");
    }
}

#[test]
fn mistakes_in_an_obj_file_name_its_line() {
    for (bad_line, column, message) in [
        (
            "f 1 2 5",
            Some(7),
            "vertex 5 does not exist; the file has 4",
        ),
        ("f 1 2 0", Some(7), "vertex 0 does not exist"),
        ("f 1 -5 2", Some(5), "vertex -5 does not exist"),
        ("f 1/1 2/x 3", Some(7), "`2/x` is no corner of a face"),
        ("f 1 2 3.5", Some(7), "`3.5` is no corner of a face"),
        ("f 1/2/3/4 2 3", Some(3), "`1/2/3/4` is no corner of a face"),
        ("f /1 2 3", Some(3), "`/1` is no corner of a face"),
        (
            "f 1/-1 2 3",
            Some(3),
            "texture coordinate -1 does not exist",
        ),
        (
            "f 1//-9223372036854775808 2 3",
            Some(3),
            "normal -9223372036854775808 does not exist",
        ),
        (
            "f 9223372036854775807 2 3",
            Some(3),
            "vertex 9223372036854775807 does not exist",
        ),
        (
            "f 99999999999999999999 2 3",
            Some(3),
            "is no corner of a face",
        ),
        ("v 1 2", None, "a vertex needs three numbers"),
        ("v 1 2 x", None, "a vertex needs three numbers"),
        ("v 1 2 3 0", None, "a vertex has weight 0"),
        ("v 1 2 3 4 5", None, "a vertex needs 3, 4 or 6 numbers"),
        ("vn 1 2", None, "a normal needs three numbers"),
        ("vt 1", None, "a texture coordinate needs two numbers"),
        ("usemtl", None, "`usemtl` needs a name"),
    ] {
        let text = TETRAHEDRON.replace("o t\n", &format!("{bad_line}\n"));
        let error = load_obj(text.as_bytes(), "").expect_err(bad_line);
        assert!(error.message.contains(message), "{bad_line}: {error}");
        let place = error.place.unwrap();
        assert!(place.file.ends_with("mesh.obj"));
        assert_eq!((place.line, place.column), (Some(2), column), "{bad_line}");
    }
}

#[test]
fn an_obj_file_without_usable_faces_is_an_error() {
    for text in ["", "# nothing\n", "v 0 0 0\nv 1 0 0\nl 1 2\n"] {
        let error = load_obj(text.as_bytes(), "").unwrap_err();
        assert!(
            error
                .to_string()
                .ends_with("mesh.obj: the file has no faces"),
            "{error}"
        );
    }
    let error = load_obj(b"v 0 0 0\nv 1 0 0\nf 1 2 2\n", "").unwrap_err();
    assert!(
        error.message.contains("no face of the mesh can be traced"),
        "{error}"
    );
    assert_eq!(place_in(&error, "scene.toml"), (15, 8));
}

#[test]
fn an_obj_file_may_have_names_in_any_encoding() {
    let mut bytes = b"# caf\xe9\n".to_vec();
    bytes.extend(TETRAHEDRON.bytes());
    assert_eq!(mesh_of(&load_obj(&bytes, "").unwrap()).faces.len(), 4);
}

/// Every uncompressed OBJ file below the folder `WAVEPATH_MESHES`, if that is set.
#[test]
fn meshes_of_the_world_never_panic() {
    let Some(root) = std::env::var_os("WAVEPATH_MESHES") else {
        eprintln_skipped();
        return;
    };
    let mut folders = vec![PathBuf::from(root)];
    let mut loaded = 0;
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "obj") {
                match load_obj(&fs::read(&path).unwrap(), "") {
                    Ok(scene) => {
                        assert!(!mesh_of(&scene).faces.is_empty());
                        loaded += 1;
                    }
                    Err(error) => assert!(error.place.is_some(), "{error}"),
                }
            }
        }
    }
    assert!(loaded > 0, "no mesh could be loaded");
}

#[allow(
    clippy::print_stderr,
    reason = "tells the developer that a test did nothing"
)]
fn eprintln_skipped() {
    eprintln!("skipped: set WAVEPATH_MESHES to a folder of OBJ files");
}

#[test]
fn a_generated_mesh_written_as_obj_is_read_back_to_the_last_bit() {
    for kind in ScalableKind::ALL {
        let generated = ScalableMesh::new(kind, 1_000, 9).unwrap();
        let mut bytes = Vec::new();
        let mut writer = ObjWriter::new(&mut bytes, "a comment").unwrap();
        generated.make(&mut writer).unwrap();
        writer.finish().unwrap();
        let expected = generated.to_mesh();
        let scene = load_obj(&bytes, "").unwrap();
        let read = mesh_of(&scene);
        assert_eq!(scene.warnings, Vec::<String>::new(), "{kind:?}");
        assert_eq!(read.faces.len(), expected.faces.len());
        // Vertices may be renumbered, corners not; positions are decimals of f32.
        let corners = |mesh: &Mesh| -> Vec<_> {
            let faces = mesh.faces.iter().flatten();
            faces
                .map(|&vertex| mesh.positions[vertex as usize].as_vec3())
                .collect()
        };
        assert_eq!(corners(read), corners(&expected), "{kind:?}");
    }
}
