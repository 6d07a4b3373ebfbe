//! Image files: which formats there are, whether a path can be written, and writing without leaving
//! half a file.

use std::ffi::OsStr;
use std::fs::{self, File, OpenOptions};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::{Error, Result};

use super::{Film, openexr, png};

/// Formats that can be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageFormat {
    /// 8-bit sRGB, for looking at.
    Png,
    /// Linear f32 with every layer that the film has, for computing with.
    Exr,
}

impl ImageFormat {
    /// The format that a path's extension names, in either case. Errors on any other extension.
    pub fn from_path(path: &Path) -> Result<Self> {
        match path.extension().map(OsStr::to_ascii_lowercase) {
            Some(extension) if extension == "png" => Ok(Self::Png),
            Some(extension) if extension == "exr" => Ok(Self::Exr),
            _ => Err(Error::usage(format!(
                "{}: the name of an image must end in .png or .exr",
                path.display()
            ))),
        }
    }
}

/// Where an image comes from, recorded in files that have room for it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Provenance {
    /// Scene and camera.
    pub scene: String,
    /// Program and commit.
    pub software: String,
    /// Seed of the render.
    pub seed: u64,
    /// What makes the image differ from the full solution on average, one phrase each.
    pub bias: Vec<String>,
}

/// Writes the film's image to `path`, in the format of its extension. `exposure` (stops) applies to
/// PNG alone; EXR holds radiance. The file appears complete or not at all.
pub fn write_image(path: &Path, film: &Film, exposure: f64, provenance: &Provenance) -> Result<()> {
    match ImageFormat::from_path(path)? {
        ImageFormat::Png => png::write(path, film, exposure),
        ImageFormat::Exr => openexr::write(path, film, provenance),
    }
}

/// Errors unless a file could be written to `path` now, so that nobody waits for a render that
/// cannot be saved. An existing file is left as it is.
pub fn check_writable(path: &Path) -> Result<()> {
    let target = resolve(path)?;
    if target.exists() {
        OpenOptions::new()
            .write(true)
            .open(&target)
            .map_err(|error| Error::io(path, &error))?;
    }
    temporary(path, &target).map(drop)
}

/// Writes a file by way of a temporary one in the same directory, renamed when `write` has
/// succeeded. A symbolic link is followed, not replaced.
pub fn write_atomically(path: &Path, write: impl FnOnce(&mut File) -> Result<()>) -> Result<()> {
    let target = resolve(path)?;
    let mut file = temporary(path, &target)?;
    write(file.as_file_mut())?;
    file.persist(&target)
        .map(drop)
        .map_err(|error| Error::io(path, &error.error))
}

/// The file that `path` stands for, links followed. Errors if something other than a file is there.
fn resolve(path: &Path) -> Result<PathBuf> {
    let Ok(metadata) = fs::metadata(path) else {
        return Ok(path.to_owned());
    };
    if !metadata.is_file() {
        return Err(Error::io(
            path,
            &std::io::Error::other("exists and is not a regular file"),
        ));
    }
    fs::canonicalize(path).map_err(|error| Error::io(path, &error))
}

/// An empty temporary file next to `target`, removed when dropped.
fn temporary(path: &Path, target: &Path) -> Result<NamedTempFile> {
    let directory = match target.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".wavepath-").suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // As any new file's: what the user's umask leaves of it.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(directory).map_err(|error| {
        // The library's message names the temporary file, of which the user knows nothing.
        let reason = error.kind();
        let text = format!(
            "cannot write in the directory {}: {reason}",
            directory.display()
        );
        Error::io(path, &std::io::Error::other(text))
    })
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;
    use crate::error::ErrorKind;

    fn names(directory: &Path) -> Vec<String> {
        let entries = fs::read_dir(directory).unwrap();
        entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect()
    }

    #[test]
    fn extension_chooses_the_format() {
        assert_eq!(
            ImageFormat::from_path(Path::new("a/b.png")).unwrap(),
            ImageFormat::Png
        );
        assert_eq!(
            ImageFormat::from_path(Path::new("B.EXR")).unwrap(),
            ImageFormat::Exr
        );
        for path in ["a.jpg", "png", "a.", ""] {
            let error = ImageFormat::from_path(Path::new(path)).unwrap_err();
            assert_eq!(error.kind, ErrorKind::Usage, "{path}");
        }
    }

    #[test]
    fn failed_write_leaves_the_old_file_and_no_other() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("image.png");
        fs::write(&path, "old").unwrap();
        let result = write_atomically(&path, |file| {
            file.write_all(b"half").unwrap();
            Err(Error::limit("stop"))
        });
        assert_eq!(result.unwrap_err().kind, ErrorKind::Limit);
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(names(directory.path()), ["image.png"]);
    }

    #[test]
    fn written_file_replaces_the_old_one_through_a_link() {
        let directory = tempfile::tempdir().unwrap();
        let real = directory.path().join("real.png");
        let link = directory.path().join("link.png");
        fs::write(&real, "old").unwrap();
        std::os::unix::fs::symlink("real.png", &link).unwrap();
        write_atomically(&link, |file| {
            file.write_all(b"new").unwrap();
            Ok(())
        })
        .unwrap();
        assert_eq!(fs::read_to_string(&real).unwrap(), "new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    }

    #[test]
    fn check_finds_what_cannot_be_written_and_leaves_no_trace() {
        let directory = tempfile::tempdir().unwrap();
        let good = directory.path().join("image.png");
        check_writable(&good).unwrap();
        assert_eq!(names(directory.path()), Vec::<String>::new());

        let missing = directory.path().join("missing/image.png");
        let message = check_writable(&missing).unwrap_err().to_string();
        assert!(message.contains("missing/image.png"), "{message}");
        assert!(!message.contains(".wavepath-"), "{message}");

        for special in [directory.path(), Path::new("/dev/null")] {
            let error = check_writable(special).unwrap_err();
            assert!(error.message.contains("not a regular file"), "{error}");
        }
    }
}
