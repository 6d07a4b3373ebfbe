//! A hash of what a picture shows: scenes with the same one look the same.

use std::fmt::{self, Write};

use super::{Mesh, SceneDescription, ShapeGeometry};

/// FNV-1a of 128 bits (G. Fowler, L. C. Noll, K.-P. Vo, RFC 9923): the same in every build.
pub(crate) struct Hasher(u128);

impl Hasher {
    pub(crate) fn new() -> Self {
        Self(0x6c62_272e_07bb_0142_62b8_2175_6295_c58d)
    }

    fn bytes(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = (self.0 ^ u128::from(byte)).wrapping_mul(0x0100_0000_0000_0000_0000_013b);
        }
    }
}

impl fmt::Display for Hasher {
    /// 32 hexadecimal digits.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

impl Write for Hasher {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.bytes(text.as_bytes());
        Ok(())
    }
}

/// Hash of the picture that camera number `camera` sees of the scene, of its film's size and of what was read
/// from files included: 32 hexadecimal digits. Settings of the render and the display do not count, nor do
/// names of files.
pub fn fingerprint(scene: &SceneDescription, camera: usize) -> String {
    let mut hasher = Hasher::new();
    let film = scene.film;
    // The debug form of plain data holds every digit of its numbers.
    let mut add = |value: &dyn fmt::Debug| {
        write!(hasher, "{value:?};").expect("hashing does not fail");
    };
    add(&(film.width, film.height, scene.background));
    add(&scene.cameras[camera].projection);
    add(&scene.point_lights);
    add(&scene.materials);
    for shape in &scene.shapes {
        add(&shape.material);
        if !matches!(shape.geometry, ShapeGeometry::Mesh(_)) {
            add(&shape.geometry);
        }
    }
    for shape in &scene.shapes {
        if let ShapeGeometry::Mesh(mesh) = &shape.geometry {
            add_mesh(&mut hasher, mesh);
        }
    }
    for texture in &scene.textures {
        write!(hasher, "{}×{};", texture.width, texture.height).expect("hashing does not fail");
        hasher.bytes(texture.texels.as_flattened());
    }
    hasher.to_string()
}

fn add_mesh(hasher: &mut Hasher, mesh: &Mesh) {
    let Mesh {
        positions,
        faces,
        face_materials,
        normals,
        face_normals,
        uvs,
        face_uvs,
    } = mesh;
    for position in positions {
        for coordinate in position.to_array() {
            hasher.bytes(&coordinate.to_le_bytes());
        }
    }
    for index in [faces, face_normals, face_uvs]
        .into_iter()
        .flatten()
        .flatten()
    {
        hasher.bytes(&index.to_le_bytes());
    }
    for material in face_materials {
        hasher.bytes(&material.0.to_le_bytes());
    }
    for value in normals.as_flattened().iter().chain(uvs.as_flattened()) {
        hasher.bytes(&value.to_le_bytes());
    }
    // Columns of different lengths are told apart by these.
    let lengths = [positions.len(), faces.len(), normals.len(), uvs.len()];
    write!(hasher, "{lengths:?};").expect("hashing does not fail");
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::scene;

    fn key(scene: &str, overrides: &[&str]) -> String {
        let path = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("scenes")
            .join(scene);
        let overrides: Vec<String> = overrides.iter().map(|o| (*o).to_owned()).collect();
        fingerprint(&scene::load(&path, &overrides).unwrap(), 0)
    }

    #[test]
    fn key_is_that_of_the_picture_and_of_nothing_else() {
        let base = key("hexroom.toml", &[]);
        for same in ["render.strategy=nee", "render.seed=7", "film.exposure=2"] {
            assert_eq!(key("hexroom.toml", &[same]), base, "{same}");
        }
        let mut keys = vec![base];
        for other in [
            "film.width=799",
            "materials.glass.ior=1.5000000001",
            "materials.light.emission=41",
            "shapes.matte-sphere.radius=1.5",
            "shapes.floor.positions.0=[-3,0,-5.5]",
            "cameras.1.eye=[-1.5,0,0]",
            "background={radiance=0.5}",
        ] {
            keys.push(key("hexroom.toml", &[other]));
        }
        keys.push(key("cornell.toml", &[]));
        keys.sort_unstable();
        keys.dedup();
        assert_eq!(keys.len(), 9);
    }

    #[test]
    fn hash_has_its_published_values() {
        let of = |text: &str| {
            let mut hasher = Hasher::new();
            hasher.bytes(text.as_bytes());
            hasher.0
        };
        assert_eq!(of(""), 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d);
        assert_eq!(of("a"), 0xd228_cb69_6f1a_8caf_7891_2b70_4e4a_8964);
    }
}
