//! The key under which a reference is stored: a hash of everything that its image depends on.

use std::fmt::Write;

use crate::scene::fingerprint::Hasher;

/// Raised by whoever changes what images come out of the same scene and settings on average.
const REVISION: u32 = 1;

/// The key of a reference: the fingerprint of the scene and the settings that it is rendered with, hashed.
pub(super) fn reference_key(fingerprint: &str, settings: &str) -> String {
    let mut hasher = Hasher::new();
    write!(hasher, "{REVISION};{fingerprint};{settings}").expect("hashing does not fail");
    hasher.to_string()
}
