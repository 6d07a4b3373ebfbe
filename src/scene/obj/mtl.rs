//! MTL files: the values of each material, and which lines make no sense.

use std::collections::HashMap;
use std::io;
use std::path::Path;

use glam::DVec3;

use crate::scene::diagnostics::Finding;
use crate::scene::files::read_at_most;

/// Bytes of an MTL file: some hundred thousand materials.
const MAX_MTL_BYTES: u64 = 1 << 26;

/// A material as its file has it: `None` where the file is silent.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct MtlMaterial {
    pub(super) diffuse: Option<DVec3>,
    pub(super) specular: Option<DVec3>,
    pub(super) emission: Option<DVec3>,
    /// Transmission filter.
    pub(super) filter: Option<DVec3>,
    /// Ns
    pub(super) exponent: Option<f64>,
    /// Ni
    pub(super) ior: Option<f64>,
    /// d, else 1 − Tr
    pub(super) opacity: Option<f64>,
    pub(super) illum: Option<u8>,
    /// The rest of the line `map_Kd`: options and a file name.
    pub(super) diffuse_map: Option<String>,
    /// The rest of the line `map_d`.
    pub(super) opacity_map: Option<String>,
}

/// Materials of a file by name, and the lines that could not be understood.
#[derive(Debug, Default)]
pub(super) struct Library {
    pub(super) materials: HashMap<String, MtlMaterial>,
    pub(super) mistakes: Finding,
}

/// Reads `path`. Of two materials with one name the last counts.
pub(super) fn read(path: &Path) -> io::Result<Library> {
    let bytes = read_at_most(path, MAX_MTL_BYTES)?;
    Ok(parse(&String::from_utf8_lossy(&bytes)))
}

fn parse(text: &str) -> Library {
    let mut mistakes = Finding::default();
    let mut sound = String::with_capacity(text.len());
    let mut has_material = false;
    for (line, number) in text.lines().zip(1..) {
        // Values before the first name belong to nothing.
        has_material |= line.split_whitespace().next() == Some("newmtl");
        match sound_line(line) {
            Ok(line) if has_material => {
                sound += &line;
                sound.push('\n');
            }
            Ok(_) => {}
            Err(Senseless) => mistakes.add(number),
        }
    }
    let (materials, _) = tobj::load_mtl_buf(&mut sound.as_bytes()).unwrap_or_default();
    Library {
        materials: materials
            .into_iter()
            .map(|material| (material.name.clone(), MtlMaterial::from(material)))
            .collect(),
        mistakes,
    }
}

/// A line that cannot be understood.
struct Senseless;

/// The line as the parser wants it: without indentation and comments, a colour with three numbers. The
/// parser refuses the whole file for one bad number, and panics on a colour with fewer than three.
fn sound_line(line: &str) -> Result<String, Senseless> {
    let line = line.trim();
    let mut words = line.split_whitespace();
    let Some(keyword) = words.next() else {
        return Ok(String::new());
    };
    let rest = line[keyword.len()..].trim();
    let numbers = || {
        let words = rest.split_whitespace();
        let words = words.take_while(|word| !word.starts_with('#'));
        let numbers = words.map(|word| word.parse().map_err(|_| Senseless));
        numbers.collect::<Result<Vec<f64>, Senseless>>()
    };
    match keyword {
        "Ka" | "Kd" | "Ks" | "Ke" | "Tf" => match numbers()?.as_slice() {
            [grey] => Ok(format!("{keyword} {grey} {grey} {grey}")),
            [r, g, b, ..] => Ok(format!("{keyword} {r} {g} {b}")),
            _ => Err(Senseless),
        },
        "Ns" | "Ni" | "d" | "Tr" => {
            // `d -halo 0.5` lets the silhouette be denser; its number is that of the middle.
            let words = rest.split_whitespace().find(|&word| word != "-halo");
            let number: f64 = words.unwrap_or("").parse().map_err(|_| Senseless)?;
            Ok(format!("{keyword} {number}"))
        }
        "illum" => {
            let word = rest.split_whitespace().next().unwrap_or("");
            let model: f64 = word.parse().map_err(|_| Senseless)?;
            // A model without a meaning counts as none; 255 is none.
            Ok(format!("illum {}", model as u8))
        }
        "newmtl" | "map_Ka" | "map_Kd" | "map_Ks" | "map_Ns" | "map_d" | "bump" | "map_bump"
        | "map_Bump" | "map_ns" | "map_NS"
            if rest.is_empty() =>
        {
            Err(Senseless)
        }
        "newmtl" | "map_Kd" | "map_d" => Ok(format!("{keyword} {rest}")),
        // Nothing else is used.
        _ => Ok(String::new()),
    }
}

impl From<tobj::Material> for MtlMaterial {
    fn from(material: tobj::Material) -> Self {
        let unknown = |key: &str| material.unknown_param.get(key);
        let filter = unknown("Tf").map(|text| {
            let mut numbers = text.split_whitespace().flat_map(str::parse);
            DVec3::from_array([(); 3].map(|()| numbers.next().unwrap_or(0.0)))
        });
        let transparency: Option<f64> = unknown("Tr").and_then(|text| text.parse().ok());
        Self {
            diffuse: material.diffuse.map(DVec3::from_array),
            specular: material.specular.map(DVec3::from_array),
            emission: material.emissive.map(DVec3::from_array),
            filter,
            exponent: material.shininess,
            ior: material.optical_density,
            opacity: material.dissolve.or(transparency.map(|tr| 1.0 - tr)),
            illum: material.illumination_model,
            diffuse_map: material.diffuse_texture,
            opacity_map: material.dissolve_texture,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_is_read_in_its_spellings() {
        let library = parse(
            "# comment\nKd 9 9 9\nnewmtl  a b \r\n\tKa 1\n  Kd 0.1 0.2 0.3 # red\nKs 0.5\nKe 17 12 4\n\
             Tf 1 1 1\nNs 10.5\nNi 1.5\nd -halo 0.75\nTr 0.5\nillum 2.0\nmap_Kd -s 2 2 2 a b.png\n\
             map_d mask.png\nPr 0.2\nnewmtl c\nTr 0.25\n",
        );
        assert_eq!(library.mistakes, Finding::default());
        let expected = MtlMaterial {
            diffuse: Some(DVec3::new(0.1, 0.2, 0.3)),
            specular: Some(DVec3::splat(0.5)),
            emission: Some(DVec3::new(17.0, 12.0, 4.0)),
            filter: Some(DVec3::ONE),
            exponent: Some(10.5),
            ior: Some(1.5),
            opacity: Some(0.75),
            illum: Some(2),
            diffuse_map: Some("-s 2 2 2 a b.png".to_owned()),
            opacity_map: Some("mask.png".to_owned()),
        };
        assert_eq!(library.materials["a b"], expected);
        assert_eq!(library.materials["c"].opacity, Some(0.75));
        assert_eq!(library.materials.len(), 2);
    }

    #[test]
    fn senseless_lines_are_counted_and_the_others_kept() {
        let library = parse(
            "newmtl a\nKd 1 2\nKd red\nNs\nNi x\nillum many\nnewmtl\nmap_Kd\nd\nKs 0.1 0.2 0.3\nnewmtl b\n",
        );
        assert_eq!(library.mistakes, Finding::new(8, [2, 3, 4, 5, 6]));
        let expected = MtlMaterial {
            specular: Some(DVec3::new(0.1, 0.2, 0.3)),
            ..MtlMaterial::default()
        };
        assert_eq!(library.materials["a"], expected);
        assert_eq!(library.materials["b"], MtlMaterial::default());
    }

    #[test]
    fn numbers_beyond_all_bounds_are_passed_on() {
        let library = parse("newmtl a\nKd nan inf -1\nNs 1e400\n");
        let material = &library.materials["a"];
        assert!(
            material
                .diffuse
                .is_some_and(|kd| kd.x.is_nan() && kd.y.is_infinite())
        );
        assert_eq!(material.exponent, Some(f64::INFINITY));
    }
}
