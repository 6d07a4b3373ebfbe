//! Which face has which material.

use std::collections::HashMap;
use std::path::Path;

use super::assemble::statements;
use super::material::{self, Changes};
use super::mtl::{self, MtlMaterial};
use super::parse::{Statement, StatementKind};
use super::texture::Pictures;
use super::{locate, stem};
use crate::error::Error;
use crate::scene::description::{MaterialDescription, MaterialId, Mesh};
use crate::scene::diagnostics::Finding;
use crate::scene::library::Library;

/// Names that a warning lists.
const MAX_NAMES: usize = 5;

/// Name of the material of faces without one.
const GREY: &str = "grey";

/// Gives each face of `mesh` its material from the statements of the OBJ file `path`, adds those that
/// are used to `library`, and returns the one of faces that `face_materials` does not name.
pub(super) fn assign(
    mesh: &mut Mesh,
    statements: &[Statement],
    path: &Path,
    library: &mut Library,
) -> MaterialId {
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut warn = |finding: String| {
        let warning = Error::file(path, finding).to_string();
        library.warnings.push(warning);
    };
    let (known, is_complete) = read_libraries(statements, folder, &mut warn);
    let runs = runs(statements, mesh.faces.len() as u32);
    let mut unknown = Unknown::default();
    let mut changes = Changes::default();
    let mut pictures = Pictures::new(folder, &mut library.textures);
    // Materials in the order of their first face; the name of none is that of the grey one.
    let mut used: Vec<MaterialDescription> = Vec::new();
    let mut index_of: HashMap<Option<&str>, u32> = HashMap::new();
    let mut indices = Vec::new();
    for run in &runs {
        let found = run.name.and_then(|name| find(&known, name));
        if let (Some(name), None) = (run.name, found) {
            unknown.add(name, run);
        }
        let name = found.map(|(name, _)| name);
        let index = *index_of.entry(name).or_insert_with(|| {
            let full_name = |name| format!("{}/{name}", stem(path).unwrap_or("obj"));
            used.push(match found {
                Some((name, mtl)) => {
                    material::describe(full_name(name), mtl, &mut pictures, &mut changes)
                }
                None => material::grey(full_name(GREY)),
            });
            used.len() as u32 - 1
        });
        indices.push(index);
    }
    let pictures_told = pictures.failures.into_iter();
    let options = Finding::new(pictures.options, []);
    pictures_told
        .map(|failure| format!("{failure}; its materials are plain"))
        .for_each(&mut warn);
    let sentences = [
        options.sentence("texture", "with options, which are not used"),
        told(
            &changes.clamped,
            "with values out of range, which are moved into it",
        ),
        told(
            &changes.scaled,
            "reflecting more than all light, scaled down",
        ),
        // The warning about the missing file says the same already.
        unknown.sentence().filter(|_| is_complete),
    ];
    sentences.into_iter().flatten().for_each(&mut warn);

    let ids: Vec<MaterialId> = used
        .into_iter()
        .map(|material| library.add_material(material))
        .collect();
    if ids.len() > 1 {
        mesh.face_materials = Vec::with_capacity(mesh.faces.len());
        for (run, index) in runs.iter().zip(indices) {
            let end = run.end as usize;
            mesh.face_materials.resize(end, ids[index as usize]);
        }
    }
    ids[0]
}

/// Consecutive faces with one material.
#[derive(Debug)]
struct Run<'a> {
    name: Option<&'a str>,
    /// The line that names it, from 1; 0 if none does.
    line: u32,
    start: u32,
    end: u32,
}

/// All faces, at least one, in runs that are not empty.
fn runs(all: &[Statement], face_count: u32) -> Vec<Run<'_>> {
    let mut runs = vec![Run {
        name: None,
        line: 0,
        start: 0,
        end: face_count,
    }];
    for statement in statements(all, StatementKind::Material) {
        let start = statement.faces_before;
        if let Some(above) = runs.last_mut() {
            above.end = start;
        }
        runs.push(Run {
            name: Some(&statement.text),
            line: statement.line,
            start,
            end: face_count,
        });
    }
    runs.retain(|run| run.start < run.end);
    runs
}

/// Materials of all MTL files by name, and whether all could be read.
fn read_libraries(
    all: &[Statement],
    folder: &Path,
    warn: &mut impl FnMut(String),
) -> (HashMap<String, MtlMaterial>, bool) {
    let mut known = HashMap::new();
    let mut missing = Vec::new();
    let mut is_complete = true;
    for statement in statements(all, StatementKind::Library) {
        for name in library_names(&statement.text, folder) {
            let Some(file) = locate::file(folder, &name) else {
                if !missing.contains(&name) {
                    missing.push(name);
                }
                continue;
            };
            match mtl::read(&file) {
                Ok(library) => {
                    let mistakes = library
                        .mistakes
                        .sentence("line", "that makes no sense left out");
                    if let Some(sentence) = mistakes {
                        warn(format!("`{name}`: {sentence}"));
                    }
                    known.extend(library.materials);
                }
                Err(error) => {
                    is_complete = false;
                    warn(format!(
                        "cannot read `{name}`: {error}; its materials are grey"
                    ));
                }
            }
        }
    }
    if !missing.is_empty() {
        is_complete = false;
        let names = quoted(&missing);
        warn(format!(
            "there is no {names}; materials that are in no other file are grey"
        ));
    }
    (known, is_complete)
}

/// The files of a line `mtllib`: one whose name may have spaces, if that exists, else one per word. A
/// backslash before a space makes it part of a name.
fn library_names(text: &str, folder: &Path) -> Vec<String> {
    let text = text.split(" #").next().unwrap_or_default().trim();
    if text.is_empty() {
        return Vec::new();
    }
    let whole = text.replace("\\ ", " ");
    let has_spaces = whole.contains(char::is_whitespace);
    if !has_spaces || locate::file(folder, &whole).is_some() {
        return vec![whole];
    }
    // Nothing else in a line of text is this character.
    const ESCAPED: &str = "\u{0}";
    text.replace("\\ ", ESCAPED)
        .split_whitespace()
        .map(|name| name.replace(ESCAPED, " "))
        .collect()
}

/// The material that `usemtl` names, with or without a comment behind it.
fn find<'a>(
    known: &'a HashMap<String, MtlMaterial>,
    name: &str,
) -> Option<(&'a str, &'a MtlMaterial)> {
    let short = name.split(" #").next().unwrap_or_default().trim_end();
    let found = known
        .get_key_value(name)
        .or_else(|| known.get_key_value(short));
    found.map(|(name, material)| (name.as_str(), material))
}

/// Materials that no file describes.
#[derive(Debug, Default)]
struct Unknown {
    names: Vec<String>,
    faces: usize,
    lines: Finding,
}

impl Unknown {
    fn add(&mut self, name: &str, run: &Run<'_>) {
        if !self.names.iter().any(|known| known == name) {
            self.names.push(name.to_owned());
            self.lines.add(run.line);
        }
        self.faces += (run.end - run.start) as usize;
    }

    fn sentence(&self) -> Option<String> {
        let names = quoted(&self.names);
        let faces = Finding::new(self.faces, []).sentence("triangle", "")?;
        Some(format!(
            "no MTL file has {names}{}; {}are grey",
            self.lines, faces
        ))
    }
}

/// How many materials, which, and what is with them; `None` for none.
fn told(names: &[String], what: &str) -> Option<String> {
    let finding = Finding::new(names.len(), []);
    let sentence = finding.sentence("material", what)?;
    Some(format!("{sentence}: {}", quoted(names)))
}

/// The first few names in quotes.
fn quoted(names: &[String]) -> String {
    let shown: Vec<String> = names
        .iter()
        .take(MAX_NAMES)
        .map(|name| format!("`{name}`"))
        .collect();
    let more = if names.len() > MAX_NAMES { ", …" } else { "" };
    shown.join(", ") + more
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_libraries_is_one_name_or_several() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("my house.mtl"), "").unwrap();
        for (text, names) in [
            ("a.mtl", vec!["a.mtl"]),
            ("a.mtl # comment", vec!["a.mtl"]),
            ("my house.mtl", vec!["my house.mtl"]),
            ("MY HOUSE.mtl", vec!["MY HOUSE.mtl"]),
            ("your house.mtl", vec!["your", "house.mtl"]),
            ("a.mtl my\\ house.mtl", vec!["a.mtl", "my house.mtl"]),
            ("dir\\a.mtl", vec!["dir\\a.mtl"]),
            ("", vec![]),
        ] {
            assert_eq!(library_names(text, folder.path()), names, "{text}");
        }
    }

    #[test]
    fn runs_cover_all_faces_once_and_are_not_empty() {
        let statement = |text: &str, faces_before| Statement {
            kind: StatementKind::Material,
            text: text.to_owned(),
            line: 1,
            faces_before,
        };
        let all = [
            statement("a", 0),
            statement("b", 2),
            statement("c", 2),
            statement("a", 5),
            statement("d", 7),
        ];
        let told: Vec<_> = runs(&all, 7)
            .iter()
            .map(|run| (run.name.unwrap(), run.start, run.end))
            .collect();
        assert_eq!(told, [("a", 0, 2), ("c", 2, 5), ("a", 5, 7)]);
        assert_eq!(runs(&all[1..], 7)[0].name, None);
    }
}
