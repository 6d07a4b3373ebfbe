//! The one error type, sorted by who must act.

use std::fmt;
use std::path::{Path, PathBuf};

/// What went wrong, by who must act on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ErrorKind {
    /// A scene, mesh or image file says something it must not.
    File,
    /// An option or a setting is wrong or contradicts another.
    Usage,
    /// Reading or writing failed.
    Io,
    /// A stated limit of this program or of the machine is exceeded.
    Limit,
}

/// A place in a file: 1-based line and column where known.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// The file.
    pub file: PathBuf,
    /// 1-based line, if known.
    pub line: Option<u32>,
    /// 1-based column in characters, if known.
    pub column: Option<u32>,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
            if let Some(column) = self.column {
                write!(f, ":{column}")?;
            }
        }
        Ok(())
    }
}

/// An error with one sentence for the user and, for files, the place.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub struct Error {
    /// Who must act.
    pub kind: ErrorKind,
    /// One sentence, lower case, no full stop.
    pub message: String,
    /// Where in a file, if in a file.
    pub place: Option<Place>,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.place {
            Some(place) => write!(f, "{place}: {}", self.message),
            None => f.write_str(&self.message),
        }
    }
}

/// Result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An error in an option or setting.
    pub fn usage(message: impl Into<String>) -> Self {
        Self {
            kind: ErrorKind::Usage,
            message: message.into(),
            place: None,
        }
    }

    /// A limit of the program or machine that is exceeded.
    pub fn limit(message: impl Into<String>) -> Self {
        Self {
            kind: ErrorKind::Limit,
            message: message.into(),
            place: None,
        }
    }

    /// An error in the content of `file`.
    pub fn file(file: &Path, message: impl Into<String>) -> Self {
        Self {
            kind: ErrorKind::File,
            message: message.into(),
            place: Some(Place {
                file: file.to_owned(),
                line: None,
                column: None,
            }),
        }
    }

    /// An input or output error on `file`.
    pub fn io(file: &Path, error: &std::io::Error) -> Self {
        Self {
            kind: ErrorKind::Io,
            ..Self::file(file, error.to_string())
        }
    }

    /// The same error with a 1-based line and column in its file.
    #[must_use]
    pub fn at(mut self, line: u32, column: u32) -> Self {
        if let Some(place) = &mut self.place {
            place.line = Some(line);
            place.column = Some(column);
        }
        self
    }
}
