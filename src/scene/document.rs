//! A TOML document in which every key and value knows where it was written.

use std::path::{Path, PathBuf};
use std::rc::Rc;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::error::{Error, ErrorKind, Result};

/// Text with values in it.
#[derive(Debug)]
pub(super) struct Source {
    origin: Origin,
    /// What offsets count in; empty for an option, which is quoted whole.
    text: String,
}

/// Where text came from.
#[derive(Debug)]
enum Origin {
    /// A scene file, its path as given.
    File(PathBuf),
    /// An option of the command line, `path.to.key=value`.
    Override(String),
}

impl Source {
    /// The option `path.to.key=value` of the command line.
    pub(super) fn from_override(option: &str) -> Rc<Self> {
        Rc::new(Self {
            origin: Origin::Override(option.to_owned()),
            text: String::new(),
        })
    }
}

/// A place in a [`Source`]: what an error or a warning points to.
#[derive(Debug, Clone)]
pub(super) struct Spot {
    source: Rc<Source>,
    /// Bytes from the start of the source's text.
    offset: usize,
}

impl Spot {
    /// The start of a source.
    pub(super) fn start(source: Rc<Source>) -> Self {
        Self { source, offset: 0 }
    }

    /// An error here: with file, line and column, or with the option that caused it.
    pub(super) fn error(&self, message: impl Into<String>) -> Error {
        match &self.source.origin {
            Origin::File(path) => {
                let (line, column) = line_and_column(&self.source.text, self.offset);
                Error::file(path, message).at(line, column)
            }
            Origin::Override(option) => Error::usage(format!("--set {option}: {}", message.into())),
        }
    }

    /// The failure to read `file`, which is named here.
    pub(super) fn io_error(&self, file: &Path, error: &std::io::Error) -> Error {
        let error = self.error(format!("cannot read `{}`: {error}", file.display()));
        Error {
            kind: ErrorKind::Io,
            ..error
        }
    }

    /// One line for the user: the place and what was found there.
    pub(super) fn warning(&self, message: &str) -> String {
        self.error(message).to_string()
    }

    /// `file`, which is named here, as a path from the working directory: relative to the scene
    /// file that names it, or as it is when an option of the command line does.
    pub(super) fn resolve(&self, file: &str) -> PathBuf {
        match &self.source.origin {
            Origin::File(path) => path.parent().unwrap_or(Path::new("")).join(file),
            Origin::Override(_) => PathBuf::from(file),
        }
    }
}

/// 1-based line and column (in characters) of the byte at `offset`, which may lie past the end.
fn line_and_column(text: &str, offset: usize) -> (u32, u32) {
    let mut offset = offset.min(text.len());
    while !text.is_char_boundary(offset) {
        offset -= 1;
    }
    let before = &text[..offset];
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    let line = 1 + before.bytes().filter(|&byte| byte == b'\n').count();
    let column = 1 + before[line_start..].chars().count();
    (saturate(line), saturate(column))
}

fn saturate(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}

/// A value and its place.
#[derive(Debug, Clone)]
pub(super) struct Node {
    /// Where the value (for a table, its header) begins.
    pub(super) spot: Spot,
    /// The value.
    pub(super) value: Value,
}

/// What a [`Node`] holds.
#[derive(Debug, Clone)]
pub(super) enum Value {
    /// Unique keys, in the order of the file.
    Table(Vec<Entry>),
    /// Elements in order.
    Array(Vec<Node>),
    /// Neither table nor array.
    Scalar(toml::Value),
}

/// One key of a table.
#[derive(Debug, Clone)]
pub(super) struct Entry {
    /// The key.
    pub(super) key: String,
    /// Where the key is written.
    pub(super) key_spot: Spot,
    /// Its value.
    pub(super) node: Node,
}

/// The document in `text`; `path` names it in errors. Errors with the place of the first mistake in the syntax.
pub(super) fn parse(text: String, path: &Path) -> Result<Node> {
    let source = Rc::new(Source {
        origin: Origin::File(path.to_owned()),
        text,
    });
    let table = DeTable::parse(&source.text).map_err(|error| syntax_error(&source, &error))?;
    let span = table.span();
    let table = Spanned::new(span, DeValue::Table(table.into_inner()));
    let mut root = convert(&source, table)?;
    root.spot.offset = 0;
    Ok(root)
}

/// The value of an override: TOML, or where it is none, the text itself as a string.
pub(super) fn parse_override_value(text: &str, source: &Rc<Source>) -> Result<Node> {
    let mut node = match DeValue::parse(text) {
        Ok(value) => convert(source, value)?,
        Err(_) => Node {
            spot: Spot::start(Rc::clone(source)),
            value: Value::Scalar(toml::Value::String(text.to_owned())),
        },
    };
    node.spot.offset = 0;
    Ok(node)
}

fn syntax_error(source: &Rc<Source>, error: &toml::de::Error) -> Error {
    let offset = error.span().map_or(0, |span| span.start);
    let spot = Spot {
        source: Rc::clone(source),
        offset,
    };
    spot.error(error.message().replace('\n', ", "))
}

fn convert(source: &Rc<Source>, value: Spanned<DeValue<'_>>) -> Result<Node> {
    let spot_at = |offset| Spot {
        source: Rc::clone(source),
        offset,
    };
    let spot = spot_at(value.span().start);
    let value = match value.into_inner() {
        DeValue::String(text) => Value::Scalar(toml::Value::String(text.into_owned())),
        DeValue::Integer(digits) => i64::from_str_radix(digits.as_str(), digits.radix())
            .map(|integer| Value::Scalar(toml::Value::Integer(integer)))
            .map_err(|_| spot.error("integer too large"))?,
        DeValue::Float(digits) => match digits.as_str().parse::<f64>() {
            Ok(float) if float.is_finite() || digits.as_str().contains("inf") || float.is_nan() => {
                Value::Scalar(toml::Value::Float(float))
            }
            _ => return Err(spot.error("number too large")),
        },
        DeValue::Boolean(boolean) => Value::Scalar(toml::Value::Boolean(boolean)),
        DeValue::Datetime(datetime) => Value::Scalar(toml::Value::Datetime(datetime)),
        DeValue::Array(elements) => Value::Array(
            elements
                .into_iter()
                .map(|element| convert(source, element))
                .collect::<Result<_>>()?,
        ),
        DeValue::Table(table) => {
            let mut entries = table
                .into_iter()
                .map(|(key, value)| {
                    Ok(Entry {
                        key_spot: spot_at(key.span().start),
                        key: key.into_inner().into_owned(),
                        node: convert(source, value)?,
                    })
                })
                .collect::<Result<Vec<_>>>()?;
            entries.sort_by_key(|entry| entry.key_spot.offset);
            Value::Table(entries)
        }
    };
    Ok(Node { spot, value })
}

impl Node {
    /// A table without keys.
    pub(super) fn empty_table(spot: Spot) -> Self {
        Self {
            spot,
            value: Value::Table(Vec::new()),
        }
    }

    /// What the value is, for messages.
    fn describe(&self) -> String {
        match &self.value {
            Value::Table(_) => "a table".to_owned(),
            Value::Array(_) => "an array".to_owned(),
            Value::Scalar(toml::Value::String(text)) => format!("the string \"{text}\""),
            Value::Scalar(scalar) => format!("{scalar}"),
        }
    }

    fn expected(&self, what: &str) -> Error {
        self.spot
            .error(format!("expected {what}, found {}", self.describe()))
    }

    /// The entries of a table.
    pub(super) fn table(&self) -> Result<&[Entry]> {
        match &self.value {
            Value::Table(entries) => Ok(entries),
            _ => Err(self.expected("a table")),
        }
    }

    /// The elements of an array.
    pub(super) fn array(&self) -> Result<&[Node]> {
        match &self.value {
            Value::Array(elements) => Ok(elements),
            _ => Err(self.expected("an array")),
        }
    }

    /// A scalar as TOML has it.
    pub(super) fn scalar(&self) -> Result<&toml::Value> {
        match &self.value {
            Value::Scalar(scalar) => Ok(scalar),
            _ => Err(self.expected("a single value")),
        }
    }

    /// A number, whole or not, possibly infinite or NaN.
    pub(super) fn number(&self) -> Result<f64> {
        match self.value {
            Value::Scalar(toml::Value::Integer(integer)) => Ok(integer as f64),
            Value::Scalar(toml::Value::Float(float)) => Ok(float),
            _ => Err(self.expected("a number")),
        }
    }

    /// A whole number.
    pub(super) fn integer(&self) -> Result<i64> {
        match self.value {
            Value::Scalar(toml::Value::Integer(integer)) => Ok(integer),
            _ => Err(self.expected("a whole number")),
        }
    }

    /// A truth value.
    pub(super) fn boolean(&self) -> Result<bool> {
        match self.value {
            Value::Scalar(toml::Value::Boolean(boolean)) => Ok(boolean),
            _ => Err(self.expected("true or false")),
        }
    }

    /// A string.
    pub(super) fn string(&self) -> Result<&str> {
        match &self.value {
            Value::Scalar(toml::Value::String(text)) => Ok(text),
            _ => Err(self.expected("a string")),
        }
    }

    /// A table whose keys are all in `known`; `what` names it in errors, with its article.
    pub(super) fn fields<'a>(&'a self, what: &'a str, known: &[&str]) -> Result<Fields<'a>> {
        let entries = self.table()?;
        match entries
            .iter()
            .find(|entry| !known.contains(&entry.key.as_str()))
        {
            Some(unknown) => Err(unknown.key_spot.error(format!(
                "unknown key `{}`; {what} has {}",
                unknown.key,
                quoted_list(known.iter().copied())
            ))),
            None => Ok(Fields {
                node: self,
                entries,
                what,
            }),
        }
    }

    /// The value of the key `type`, which is one of `known`; `what` names the table in errors, with its article.
    pub(super) fn tag(&self, what: &str, known: &[&'static str]) -> Result<&'static str> {
        let entry = self.table()?.iter().find(|entry| entry.key == "type");
        let node = &entry
            .ok_or_else(|| self.spot.error(format!("{what} needs `type`")))?
            .node;
        one_of(node, "type", known)
    }
}

/// The string `node`, which must be one of `known`; `name` is its key.
pub(super) fn one_of(node: &Node, name: &str, known: &[&'static str]) -> Result<&'static str> {
    let text = node.string()?;
    known
        .iter()
        .find(|&&word| word == text)
        .copied()
        .ok_or_else(|| {
            node.spot.error(format!(
                "unknown {name} `{text}`; known: {}",
                quoted_list(known.iter().copied())
            ))
        })
}

/// `a`, `b`, `c`, or "nothing".
pub(super) fn quoted_list<'a>(words: impl Iterator<Item = &'a str>) -> String {
    let list: Vec<String> = words.map(|word| format!("`{word}`")).collect();
    if list.is_empty() {
        "nothing".to_owned()
    } else {
        list.join(", ")
    }
}

/// A table without unknown keys, see [`Node::fields`].
#[derive(Debug)]
pub(super) struct Fields<'a> {
    node: &'a Node,
    entries: &'a [Entry],
    what: &'a str,
}

impl<'a> Fields<'a> {
    /// The value of `key`, if written.
    pub(super) fn optional(&self, key: &str) -> Option<&'a Node> {
        self.entries
            .iter()
            .find(|entry| entry.key == key)
            .map(|entry| &entry.node)
    }

    /// The value of `key`; an error at the table's place if it is missing.
    pub(super) fn required(&self, key: &str) -> Result<&'a Node> {
        self.optional(key)
            .ok_or_else(|| self.node.spot.error(format!("{} needs `{key}`", self.what)))
    }
}
