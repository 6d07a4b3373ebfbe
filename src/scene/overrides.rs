//! Values of a scene that the command line replaces: `--set path.to.key=value`.

use std::rc::Rc;

use super::document::{self, Entry, Node, Source, Spot, Value, quoted_list};
use crate::error::{Error, Result};

/// Tables with fixed keys, which an override may begin where the file has none.
const CREATED: [&str; 4] = ["film", "render", "background", "closed_form"];

/// Applies one `path.to.key=value` to a document.
///
/// Elements of an array are named by their key `name` or counted from 0. A key that a table lacks
/// is added (and judged when the scene is read); every table on the way must exist. Errors quote
/// the option.
pub(super) fn apply(root: &mut Node, option: &str) -> Result<()> {
    let source = Source::from_override(option);
    let spot = Spot::start(Rc::clone(&source));
    let malformed = || spot.error("must be written path.to.key=value");
    let (path, text) = option.split_once('=').ok_or_else(malformed)?;
    if text.trim().is_empty() {
        return Err(malformed());
    }
    let keys = toml_edit::Key::parse(path.trim()).map_err(|_| malformed())?;
    let (last, parents) = keys.split_last().ok_or_else(malformed)?;
    let value = document::parse_override_value(text.trim(), &source)?;

    let mut node = root;
    for (depth, key) in parents.iter().enumerate() {
        let creates = depth == 0 && CREATED.contains(&key.get());
        node = child(node, key.get(), creates, &spot)?;
    }
    set(node, last.get(), value, &spot)
}

/// The table or array below `node` that `key` names.
fn child<'a>(node: &'a mut Node, key: &str, creates: bool, spot: &Spot) -> Result<&'a mut Node> {
    match &mut node.value {
        Value::Table(entries) => {
            let index = match entries.iter().position(|entry| entry.key == key) {
                Some(index) => index,
                None if creates => {
                    entries.push(Entry {
                        key: key.to_owned(),
                        key_spot: spot.clone(),
                        node: Node::empty_table(spot.clone()),
                    });
                    entries.len() - 1
                }
                None => {
                    let known = quoted_list(entries.iter().map(|entry| entry.key.as_str()));
                    return Err(spot.error(format!("there is no `{key}` here, only {known}")));
                }
            };
            Ok(&mut entries[index].node)
        }
        Value::Array(elements) => {
            let index =
                element_index(elements, key).ok_or_else(|| no_element(elements, key, spot))?;
            Ok(&mut elements[index])
        }
        Value::Scalar(_) => Err(no_table(key, spot)),
    }
}

/// Writes `value` under `key` of `node`.
fn set(node: &mut Node, key: &str, value: Node, spot: &Spot) -> Result<()> {
    match &mut node.value {
        Value::Table(entries) => match entries.iter_mut().find(|entry| entry.key == key) {
            Some(entry) => entry.node = value,
            None => entries.push(Entry {
                key: key.to_owned(),
                key_spot: spot.clone(),
                node: value,
            }),
        },
        Value::Array(elements) => {
            let index =
                element_index(elements, key).ok_or_else(|| no_element(elements, key, spot))?;
            elements[index] = value;
        }
        Value::Scalar(_) => return Err(no_table(key, spot)),
    }
    Ok(())
}

/// The element whose `name` is `key`, else the one at that index.
fn element_index(elements: &[Node], key: &str) -> Option<usize> {
    let has_name = |element: &Node| {
        element.table().is_ok_and(|entries| {
            entries
                .iter()
                .any(|entry| entry.key == "name" && entry.node.string() == Ok(key))
        })
    };
    let index = elements.iter().position(has_name).or(key.parse().ok())?;
    (index < elements.len()).then_some(index)
}

fn no_element(elements: &[Node], key: &str, spot: &Spot) -> Error {
    spot.error(format!(
        "`{key}` is neither the name nor the index of one of {} elements",
        elements.len()
    ))
}

fn no_table(key: &str, spot: &Spot) -> Error {
    spot.error(format!("a single value has no `{key}`"))
}
