//! Error against run time: what a second of rendering buys.
//!
//! Each configuration is rendered several times with different seeds. Sample counts double; at each
//! checkpoint the image is held against a reference, with the clock stopped. Configurations take turns
//! checkpoint by checkpoint, in reverse order every second turn, so that what disturbs the machine
//! disturbs all of them; and the repeats of two configurations have the same seeds, so that they are
//! compared in pairs.
//!
//! The squared error against a reference of two independent halves r₁ and r₂ is taken as the mean of
//! (x − r₁)(x − r₂), which is right on average however noisy the halves are. Intervals over repeats are
//! Student's on the repeats' values or, of what is a ratio by nature, on their logarithms.

mod aggregate;
mod bias;
mod csv;
mod curve;
mod definitions;
mod errors;
mod judge;
mod key;
mod noise;
mod page;
mod pictures;
mod reference;
mod results;
mod run;
mod statistics;
mod summary;
mod table;
#[cfg(test)]
mod tests;

pub use page::page;
pub use reference::{ReferenceChoice, ReferenceOptions};
pub use results::*;
pub use run::{ConfigurationInput, ConvergeInput, Schedule, converge};

use std::fs;
use std::io::Write;
use std::path::Path;

use crate::error::{Error, Result};
use crate::film::write_atomically;
use crate::scene::{SceneDescription, fingerprint};

/// What a comparison tells while it runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event<'a> {
    /// What is being done.
    Progress(&'a str),
    /// One of [`Results::warnings`].
    Warning(&'a str),
}

/// Asked every now and then, from any worker, whether to stop.
pub type Interrupted<'a> = dyn Fn() -> bool + Sync + 'a;

/// The seed of stream `index` of a base seed. It has 48 bits, so that every reader of JSON keeps them.
/// (SplitMix64's output function: G. L. Steele, D. Lea, C. H. Flood, OOPSLA 2014.)
fn seed(base: u64, index: u64) -> u64 {
    let golden = 0x9e37_79b9_7f4a_7c15;
    let mut z = base
        .wrapping_mul(golden)
        .wrapping_add(index.wrapping_add(1))
        .wrapping_mul(golden);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z ^ (z >> 31)) >> 16
}

/// Whether two scenes seen by their cameras of this number make the same picture.
pub fn same_picture(a: &SceneDescription, b: &SceneDescription, camera: usize) -> bool {
    fingerprint(a, camera) == fingerprint(b, camera)
}

/// Makes the folder of a comparison, if it is not there. Errors if files could not be written to it.
pub fn check_folder(folder: &Path) -> Result<()> {
    fs::create_dir_all(folder).map_err(|error| Error::io(folder, &error))?;
    crate::film::check_writable(&folder.join("converge.json"))
}

/// Writes `converge.json`, `converge.csv` and `index.html`. The pictures must be in the folder.
pub fn write(results: &Results, folder: &Path) -> Result<()> {
    write_text(&folder.join("converge.json"), &(results.to_json() + "\n"))?;
    write_text(&folder.join("converge.csv"), &csv::table(results))?;
    write_text(&folder.join("index.html"), &page(results, folder)?)
}

fn write_text(path: &Path, text: &str) -> Result<()> {
    write_atomically(path, |file| {
        file.write_all(text.as_bytes())
            .map_err(|error| Error::io(path, &error))
    })
}

impl Results {
    /// The results as indented JSON.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("plain data with string keys always serialises")
    }
}
