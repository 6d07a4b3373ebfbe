//! OBJ files: what is read, what is removed, and where mistakes are.

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
        "{TETRAHEDRON}v nan 0 0\nv 1e19 0 0\nv 5 5 5\nf 1 2 5\nf 1 2 6\nf 1 1 2\nf 2 1 3\nf 1 2\nf\n"
    );
    let scene = load_obj(text.as_bytes(), "").unwrap();
    assert_eq!(mesh_of(&scene).faces.len(), 4);
    let expected = [
        "mesh.obj: 1 vertex with a coordinate that is not finite (line 11)",
        "mesh.obj: 2 faces with fewer than three corners removed (lines 18, 19)",
        "mesh.obj: 2 faces with a coordinate that is not finite or beyond 1.8e18 removed (lines 14, 15)",
        "mesh.obj: 1 face of zero area removed (line 16)",
        "mesh.obj: 1 face equal to another removed (line 17)",
        "mesh.obj: 1 vertex of no face removed (line 13)",
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

/// Loads a scene whose one shape is `mesh.obj` with its own materials, beside these files.
fn load_with_materials(files: &[(&str, &str)]) -> SceneDescription {
    let text = "[film]\nwidth = 8\nheight = 8\n\
        [cameras.a]\neye = [0, -4, 1]\nlook_at = [0, 0, 1]\nup = [0, 0, 1]\nfov = 40\n\
        [materials.grey]\ntype = \"lambertian\"\nreflectance = 0.5\n\
        [[shapes]]\ntype = \"obj\"\nfile = \"mesh.obj\"\n";
    let folder = folder(&[&[("scene.toml", text)], files].concat());
    load(&folder.path().join("scene.toml"), &[]).unwrap()
}

/// The names of the materials of `scene`'s faces, in order.
fn face_materials(scene: &SceneDescription) -> Vec<&str> {
    let name = |id: MaterialId| scene.materials[id.0 as usize].name.as_str();
    let mesh = mesh_of(scene);
    if mesh.face_materials.is_empty() {
        vec![name(scene.shapes[0].material); mesh.faces.len()]
    } else {
        mesh.face_materials.iter().copied().map(name).collect()
    }
}

/// Four triangles about a corner.
const FACES: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";

#[test]
fn faces_have_the_materials_that_the_file_names() {
    let obj = format!(
        "mtllib Colours.mtl\n{FACES}f 1 2 3\nusemtl red car\nf 1 3 4\nf 1 4 2\nusemtl glass # c\nf 2 3 4\n"
    );
    let mtl = "newmtl unused\nNi 3\nillum 7\nd 0\nnewmtl red car\nKd 1 0 0\nnewmtl glass\nNi 1.5\nillum 7\nd 0\n";
    let scene = load_with_materials(&[("mesh.obj", &obj), ("colours.MTL", mtl)]);
    assert_eq!(
        face_materials(&scene),
        ["mesh/grey", "mesh/red car", "mesh/red car", "mesh/glass"]
    );
    let names: Vec<&str> = scene.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["grey", "mesh/grey", "mesh/red car", "mesh/glass"]);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn a_shape_with_a_material_keeps_it_for_all_faces() {
    let text =
        format!("mtllib none.mtl\nusemtl red\n{FACES}f 1 2 3\nusemtl blue\nf 2 3 4\nf 1 2 4\n");
    let scene = load_obj(text.as_bytes(), "").unwrap();
    assert_eq!(face_materials(&scene), ["grey"; 3]);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn missing_materials_are_one_warning_and_grey() {
    let faces = format!("{FACES}usemtl red\nf 1 2 3\nf 1 3 4\nusemtl blue\nf 2 3 4\nf 1 2 4\n");
    let missing = format!("mtllib none.mtl\n{faces}");
    let scene = load_with_materials(&[("mesh.obj", &missing)]);
    assert_eq!(face_materials(&scene), ["mesh/grey"; 4]);
    assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
    assert!(scene.warnings[0].contains("mesh.obj: there is no `none.mtl`"));

    let known = format!("mtllib a.mtl\n{faces}");
    let mtl = "newmtl blue\nKd 0 0 1\nKs red\n";
    let scene = load_with_materials(&[("mesh.obj", &known), ("a.mtl", mtl)]);
    assert_eq!(face_materials(&scene)[1..3], ["mesh/grey", "mesh/blue"]);
    assert_eq!(scene.warnings.len(), 2, "{:?}", scene.warnings);
    assert!(scene.warnings[0].ends_with("`a.mtl`: 1 line that makes no sense left out (line 3)"));
    assert!(scene.warnings[1].ends_with("no MTL file has `red` (line 6); 2 triangles are grey"));
}

#[test]
fn a_missing_texture_leaves_the_plain_colour() {
    let obj = format!("mtllib a.mtl\n{FACES}usemtl wood\nf 1 2 3\nf 2 3 4\n");
    let mtl = "newmtl wood\nKd 0.4 0.3 0.2\nmap_Kd none.png\n";
    let scene = load_with_materials(&[("mesh.obj", &obj), ("a.mtl", mtl)]);
    let wood = &scene.materials[scene.shapes[0].material.0 as usize];
    let reflectance = DVec3::new(0.4, 0.3, 0.2);
    assert_eq!(wood.bsdf, BsdfDescription::Lambertian { reflectance });
    assert_eq!((wood.reflectance_texture, scene.textures.len()), (None, 0));
    assert!(
        scene.warnings[0].ends_with("no texture `none.png`; its materials are plain"),
        "{:?}",
        scene.warnings
    );
}

#[test]
fn attributes_stay_with_their_corners() {
    let text = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\nv 0 0 1\n\
        vt 0 0\nvt 1 0\nvt 1 1\nvt .5 .25\nvt 0 1\nvt nan 0\nvn 0 0 2\nvn 0 0 0\n\
        f 1 1 2\nf 1 2 6\nf 1/1/1 2/2/1 3/3/1 4/4/1 5/5/2\nf 1/6 3 6\n";
    let scene = load_obj(text.as_bytes(), "").unwrap();
    let mesh = mesh_of(&scene);
    assert_eq!(mesh.faces.len(), 5, "one of zero area removed");
    assert_eq!((mesh.face_uvs.len(), mesh.face_normals.len()), (5, 5));
    assert_eq!(mesh.normals[0], [0.0, 0.0, 1.0]);
    for (face, uvs) in mesh.faces.iter().zip(&mesh.face_uvs).skip(1).take(3) {
        for (&vertex, &uv) in face.iter().zip(uvs) {
            let position = mesh.positions[vertex as usize];
            let [u, v] = mesh.uvs[uv as usize];
            assert_eq!([4.0 * u, 4.0 * v], [position.x as f32, position.y as f32]);
        }
    }
    assert_eq!(mesh.face_uvs[0], [Mesh::ABSENT; 3]);
    assert_eq!(mesh.face_uvs[4], [Mesh::ABSENT; 3], "nan is no coordinate");
    let absent = mesh.face_normals[1..4].as_flattened();
    let last_corner = absent.iter().filter(|&&index| index == Mesh::ABSENT);
    assert!(last_corner.count() >= 1, "a normal of length 0 is none");
    let area: f64 = mesh.faces[1..4]
        .iter()
        .map(|face| face.map(|index| mesh.positions[index as usize]))
        .map(|[a, b, c]| 0.5 * (b - a).cross(c - a).z)
        .sum();
    assert_eq!(area, 10.0, "the notch is open");
}

#[test]
fn indices_may_count_back_and_point_forward() {
    let text = "f 1 2 -1\n".to_owned() + TETRAHEDRON;
    let error = load_obj(text.as_bytes(), "").unwrap_err();
    assert_eq!(place_in(&error, "mesh.obj"), (1, 7));
    let forward = "f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 4\nv 0 0 1\n";
    let scene = load_obj(forward.as_bytes(), "").unwrap();
    assert_eq!(mesh_of(&scene).faces, [[0, 1, 2], [2, 1, 3]]);
    let beyond = forward.replace("-2 4", "-2 5");
    let error = load_obj(beyond.as_bytes(), "").unwrap_err();
    assert_eq!(place_in(&error, "mesh.obj"), (5, 9));
}

#[test]
fn a_file_of_many_chunks_is_read_like_one_and_places_are_right() {
    // 9 MB of text in chunks of 4 MiB.
    let count = 120_000_u32;
    let mut text = String::new();
    for k in 0..count {
        let (x, y) = (k % 300, k / 300);
        text += &format!("v {x}.000000000000000 {y}.000000000000000 0.0000000000000000\n");
        if x > 0 && y > 0 {
            text += if k % 2 == 0 { "f -1 -301 -302\n" } else { "f " };
            if k % 2 == 1 {
                text += &format!("{} {} {}\n", k + 1, k - 299, k - 300);
            }
        }
    }
    assert!(text.len() > 2 << 22);
    let scene = load_obj(text.as_bytes(), "").unwrap();
    let mesh = mesh_of(&scene);
    assert_eq!(mesh.faces.len(), 299 * 399);
    for face in &mesh.faces {
        let [a, b, c] = face.map(|index| mesh.positions[index as usize]);
        assert_eq!((b - a, c - a), (-DVec3::Y, DVec3::new(-1.0, -1.0, 0.0)));
    }
    let line_count = text.lines().count() as u32;
    let error = load_obj((text + "f 1 2 120001\n").as_bytes(), "").unwrap_err();
    assert_eq!(place_in(&error, "mesh.obj"), (line_count + 1, 7));
}

#[test]
fn a_mesh_alone_is_a_scene_with_light_unless_it_has_its_own() {
    let obj = format!("mtllib a.mtl\n{FACES}usemtl a\nf 1 2 3\nf 2 3 4\n");
    let files = [("a.mtl", "newmtl a\nKd 1 0 0\n"), ("plain.obj", &obj)];
    let plain = folder(&files);
    let path = plain.path().join("plain.obj");
    let overrides = ["film.width=64".to_owned(), "cameras.view.fov=30".to_owned()];
    let scene = load(&path, &overrides).unwrap();
    assert_eq!((scene.film.width, scene.film.height), (64, 600));
    assert!(scene.background.min_element() > 0.0);
    let names: Vec<&str> = scene
        .shapes
        .iter()
        .map(|shape| shape.name.as_str())
        .collect();
    assert_eq!(names, ["sun", "plain"]);
    let material = scene.shapes[1].material;
    assert_eq!(scene.materials[material.0 as usize].name, "plain/a");
    assert_eq!(scene.mesh_files[0].triangles, 2);
    assert_eq!(name(&path), "plain");

    let lit = folder(&[("a.mtl", "newmtl a\nKe 1 1 1\n"), ("lit.obj", &obj)]);
    let scene = load(&lit.path().join("lit.obj"), &[]).unwrap();
    assert_eq!((scene.shapes.len(), scene.background), (1, DVec3::ZERO));
    let error = load(Path::new("none.obj"), &[]).unwrap_err();
    assert_eq!(error.kind, ErrorKind::Io);
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
