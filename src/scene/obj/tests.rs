//! OBJ files as a whole, against another reader.

use std::io::Read;

use super::*;

#[test]
fn obj_files_are_known_by_their_names() {
    for (name, stem_of_name) in [
        ("a/b.obj", Some("b")),
        ("b.OBJ", Some("b")),
        ("b.v2.obj.gz", Some("b.v2")),
        ("b.Obj.zst", Some("b")),
        ("b.toml", None),
        ("b.gz", None),
        ("obj", None),
        ("größe", None),
    ] {
        assert_eq!(stem(Path::new(name)), stem_of_name, "{name}");
    }
}

/// Corners of a polygon: positions and texture coordinates in bits, sorted, without repetitions.
type Corners = Vec<[u64; 5]>;

fn corners(of: impl Iterator<Item = [u64; 5]>) -> Corners {
    let mut corners: Corners = of.collect();
    corners.sort_unstable();
    corners.dedup();
    corners
}

fn corner(position: &[f64], uv: Option<[f32; 2]>) -> [u64; 5] {
    let [x, y, z] = [0, 1, 2].map(|axis| position[axis].to_bits());
    let [u, v] = uv.map_or([0; 2], |uv| uv.map(|value| u64::from(value.to_bits())));
    [x, y, z, u, v]
}

/// The polygons that tobj reads; `None` if it refuses the file.
fn by_tobj(text: &[u8], with_uvs: bool) -> Option<Vec<Corners>> {
    let options = tobj::LoadOptions {
        ignore_points: true,
        ignore_lines: true,
        ..tobj::LoadOptions::default()
    };
    let no_materials = |_: &Path| Ok(Default::default());
    let (models, _) = tobj::load_obj_buf(&mut &text[..], &options, no_materials).ok()?;
    let mut polygons = Vec::new();
    for tobj::Model { mesh, .. } in models {
        let corner_at = |k: usize| {
            let position = &mesh.positions[3 * mesh.indices[k] as usize..][..3];
            let uv = with_uvs.then(|| {
                let uv = &mesh.texcoords[2 * mesh.texcoord_indices[k] as usize..][..2];
                [uv[0] as f32, uv[1] as f32]
            });
            corner(position, uv)
        };
        let arities = match mesh.face_arities.as_slice() {
            [] => vec![3; mesh.indices.len() / 3],
            arities => arities.to_vec(),
        };
        let mut start = 0;
        for arity in arities {
            let end = start + arity as usize;
            polygons.push(corners((start..end).map(corner_at)));
            start = end;
        }
    }
    Some(polygons)
}

/// The same of a file that this crate has read: the triangles of a line are a polygon.
fn by_us(file: &ObjFile, with_uvs: bool) -> Vec<Corners> {
    let mesh = &file.mesh;
    let numbers: Vec<u32> = (0..mesh.faces.len() as u32).collect();
    let on_one_line = |a: &u32, b: &u32| {
        let [a, b] = [a, b].map(|&face| file.face_lines.line_of(face));
        a == b
    };
    let polygons = numbers.chunk_by(on_one_line);
    let corner_at = |face: u32, k: usize| {
        let position = mesh.positions[mesh.faces[face as usize][k] as usize];
        let uv = with_uvs.then(|| mesh.uvs[mesh.face_uvs[face as usize][k] as usize]);
        corner(&position.to_array(), uv)
    };
    polygons
        .map(|faces| {
            let all = faces
                .iter()
                .flat_map(|&face| [0, 1, 2].map(|k| corner_at(face, k)));
            corners(all)
        })
        .collect()
}

/// Every file below the folder `WAVEPATH_MESHES` but those of its folder `large`, if that is set.
#[test]
fn polygons_are_those_that_tobj_reads() {
    let Some(root) = std::env::var_os("WAVEPATH_MESHES") else {
        skipped();
        return;
    };
    let mut folders = vec![std::path::PathBuf::from(root)];
    let (mut compared, mut with_uvs) = (0, 0);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() && !path.ends_with("large") {
                folders.push(path);
            } else if stem(&path).is_some() {
                let mut text = Vec::new();
                let mut content = decompress::open(&path).unwrap();
                content.read_to_end(&mut text).unwrap();
                let file = read(&path, |error| Error::io(&path, error));
                let Ok(file) = file else { continue };
                // tobj has no way to say that one corner of many lacks them.
                let indices = file.mesh.face_uvs.as_flattened();
                let has_uvs = !indices.is_empty() && !indices.contains(&Mesh::ABSENT);
                if let Some(expected) = by_tobj(&text, has_uvs) {
                    assert!(by_us(&file, has_uvs) == expected, "{}", path.display());
                    compared += 1;
                    with_uvs += u32::from(has_uvs);
                }
            }
        }
    }
    assert!(compared >= 50, "only {compared} files");
    assert!(
        with_uvs >= 4,
        "only {with_uvs} files with texture coordinates"
    );
}

#[allow(
    clippy::print_stderr,
    reason = "tells the developer that a test did nothing"
)]
fn skipped() {
    eprintln!("skipped: set WAVEPATH_MESHES to a folder of OBJ files");
}
