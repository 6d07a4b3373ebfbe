//! What shapes add to a scene while they are read.

use std::collections::HashSet;

use super::description::{MaterialDescription, MaterialId, MeshFile, TextureDescription};

/// The parts of a scene that OBJ files add to.
#[derive(Debug, Default)]
pub(super) struct Library {
    pub(super) materials: Vec<MaterialDescription>,
    pub(super) textures: Vec<TextureDescription>,
    pub(super) mesh_files: Vec<MeshFile>,
    /// Findings that do not stop the load, one line each.
    pub(super) warnings: Vec<String>,
}

impl Library {
    /// Adds a material. If its name is taken, it gets a number.
    pub(super) fn add_material(&mut self, mut material: MaterialDescription) -> MaterialId {
        let taken: HashSet<&str> = self.materials.iter().map(|m| m.name.as_str()).collect();
        if taken.contains(material.name.as_str()) {
            let numbered = (2..).map(|number| format!("{}#{number}", material.name));
            let free = numbered
                .into_iter()
                .find(|name| !taken.contains(name.as_str()));
            material.name = free.expect("the taken names are finitely many");
        }
        self.materials.push(material);
        MaterialId(self.materials.len() as u32 - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::description::BsdfDescription;

    #[test]
    fn names_of_materials_are_unique() {
        let mut library = Library::default();
        for (name, unique) in [
            ("a", "a"),
            ("b", "b"),
            ("a", "a#2"),
            ("a", "a#3"),
            ("a#2", "a#2#2"),
        ] {
            let material = MaterialDescription::new(name, BsdfDescription::Black);
            let id = library.add_material(material);
            assert_eq!(library.materials[id.0 as usize].name, unique);
        }
    }
}
