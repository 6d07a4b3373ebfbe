//! Finding the files that an OBJ or MTL file names.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// The file that `name` means in a file of the folder `folder`, if it exists: with either slash between
/// folders, in capitals or not, and if it lies nowhere else, beside the file that names it.
pub(super) fn file(folder: &Path, name: &str) -> Option<PathBuf> {
    let name = name.trim().trim_matches('"');
    let slashed = name.replace('\\', "/");
    let last = slashed.rsplit('/').next().unwrap_or_default();
    let exact = folder.join(name);
    if !name.is_empty() && exact.is_file() {
        return Some(exact);
    }
    [slashed.as_str(), last]
        .into_iter()
        .filter(|name| !name.is_empty())
        .find_map(|name| in_any_case(folder, name))
}

/// The file `name` under `folder`, each part as written or else in any case.
fn in_any_case(folder: &Path, name: &str) -> Option<PathBuf> {
    let mut path = folder.to_owned();
    for part in Path::new(name).components() {
        let exact = path.join(part);
        path = if exact.exists() {
            exact
        } else {
            entry_in_any_case(&path, part.as_os_str())?
        };
    }
    path.is_file().then_some(path)
}

/// The first entry by name of `folder` that differs from `wanted` in case only.
fn entry_in_any_case(folder: &Path, wanted: &OsStr) -> Option<PathBuf> {
    // The folder of a file without one is the working directory.
    let listed = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    let wanted = wanted.to_string_lossy().to_lowercase();
    let entries = std::fs::read_dir(listed).ok()?.filter_map(Result::ok);
    entries
        .map(|entry| entry.file_name())
        .filter(|name| name.to_string_lossy().to_lowercase() == wanted)
        .min()
        .map(|name| folder.join(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_found_however_their_path_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        std::fs::create_dir(root.join("Textures")).unwrap();
        for name in ["Textures/Wood 5.PNG", "here.jpg", "back\\slash.jpg"] {
            std::fs::write(root.join(name), "").unwrap();
        }
        for (name, found) in [
            ("here.jpg", "here.jpg"),
            (" here.jpg\r", "here.jpg"),
            ("HERE.JPG", "here.jpg"),
            ("./here.jpg", "./here.jpg"),
            ("Textures/Wood 5.PNG", "Textures/Wood 5.PNG"),
            ("textures\\wood 5.png", "Textures/Wood 5.PNG"),
            ("\"Textures/wood 5.png\"", "Textures/Wood 5.PNG"),
            ("C:\\Users\\me\\Here.jpg", "here.jpg"),
            ("/nowhere/here.jpg", "here.jpg"),
            ("back\\slash.jpg", "back\\slash.jpg"),
        ] {
            assert_eq!(file(root, name), Some(root.join(found)), "{name}");
        }
        for name in [
            "",
            " ",
            "/",
            "there.jpg",
            "Textures",
            "..\\..",
            "here.jpg/x",
        ] {
            assert_eq!(file(root, name), None, "{name}");
        }
    }
}
