//! Scene files that build on another: `extends = "base.toml"`.

use std::path::{Path, PathBuf};

use super::document::{self, Entry, Node, Value};
use super::files::read_at_most;
use crate::error::{Error, Result};

/// Files in a chain of `extends`, the first included.
const MAX_CHAIN: usize = 16;

/// Bytes of a scene file: some millions of hand-written triangles.
const MAX_SCENE_BYTES: u64 = 1 << 28;

/// Lists that a derived file adds to; any other array is replaced.
const APPENDED: [&str; 2] = ["shapes", "lights"];

/// The text of a scene file.
pub(super) fn read_text(path: &Path) -> Result<String> {
    let bytes = read_at_most(path, MAX_SCENE_BYTES).map_err(|error| Error::io(path, &error))?;
    decode(bytes, path)
}

/// Bytes as UTF-8; the error points to the first byte that is not.
fn decode(bytes: Vec<u8>, path: &Path) -> Result<String> {
    String::from_utf8(bytes).map_err(|error| {
        let valid = String::from_utf8_lossy(&error.as_bytes()[..error.utf8_error().valid_up_to()]);
        let line = valid.split('\n').count();
        let column = 1 + valid
            .rsplit('\n')
            .next()
            .map_or(0, |last| last.chars().count());
        let position = |count| u32::try_from(count).unwrap_or(u32::MAX);
        Error::file(path, "not UTF-8 text").at(position(line), position(column))
    })
}

/// The document in `text` on top of those that it extends.
pub(super) fn resolve(text: String, path: &Path) -> Result<Node> {
    let this = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    resolve_chain(text, path, &mut vec![this])
}

fn resolve_chain(text: String, path: &Path, chain: &mut Vec<PathBuf>) -> Result<Node> {
    let mut derived = document::parse(text, path)?;
    let Some(extends) = take(&mut derived, "extends") else {
        return Ok(derived);
    };
    let spot = &extends.node.spot;
    let base_path = spot.resolve(extends.node.string()?);
    let base_file = base_path
        .canonicalize()
        .map_err(|error| spot.io_error(&base_path, &error))?;
    if chain.contains(&base_file) {
        return Err(spot.error(format!(
            "`{}` extends itself through this file",
            base_path.display()
        )));
    }
    if chain.len() == MAX_CHAIN {
        return Err(spot.error(format!("more than {MAX_CHAIN} files extend one another")));
    }
    chain.push(base_file);
    let base = resolve_chain(read_text(&base_path)?, &base_path, chain)?;
    Ok(merge_documents(base, derived))
}

fn take(root: &mut Node, key: &str) -> Option<Entry> {
    let Value::Table(entries) = &mut root.value else {
        return None;
    };
    let index = entries.iter().position(|entry| entry.key == key)?;
    Some(entries.remove(index))
}

fn merge_documents(base: Node, derived: Node) -> Node {
    merge_tables(base, derived, |key, base, derived| {
        if APPENDED.contains(&key) {
            append(base, derived)
        } else {
            merge(base, derived)
        }
    })
}

/// The elements of `base`, then those of `derived`; `derived` if either is no array.
fn append(base: Node, mut derived: Node) -> Node {
    if let (Value::Array(mut all), Value::Array(more)) = (base.value, &mut derived.value) {
        all.append(more);
        *more = all;
    }
    derived
}

/// `derived` over `base`: two tables key by key, unless the derived one says its own `type`;
/// anything else is replaced.
fn merge(base: Node, derived: Node) -> Node {
    let says_type = |node: &Node| {
        node.table()
            .is_ok_and(|entries| entries.iter().any(|entry| entry.key == "type"))
    };
    if says_type(&derived) {
        derived
    } else {
        merge_tables(base, derived, |_, base, derived| merge(base, derived))
    }
}

/// Two tables key by key, `combine` deciding on keys that both have; `derived` if either is no table.
fn merge_tables(base: Node, mut derived: Node, combine: impl Fn(&str, Node, Node) -> Node) -> Node {
    let (Value::Table(base_entries), Value::Table(derived_entries)) =
        (base.value, &mut derived.value)
    else {
        return derived;
    };
    let mut fresh = std::mem::take(derived_entries);
    for mut entry in base_entries {
        if let Some(index) = fresh.iter().position(|other| other.key == entry.key) {
            let over = fresh.remove(index);
            entry.key_spot = over.key_spot;
            entry.node = combine(&entry.key, entry.node, over.node);
        }
        derived_entries.push(entry);
    }
    derived_entries.append(&mut fresh);
    derived
}
