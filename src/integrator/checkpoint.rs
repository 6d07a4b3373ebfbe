//! Checkpoints: what a render leaves behind so that it can go on, and how it does.
//!
//! A checkpoint holds the film, where the schedule is, and the counts. It is taken between work items, each of
//! which is in the film as a whole or not at all; of a round that is under way, the film's own counts of blocks
//! tell which tiles have had theirs. As a work item depends on nothing but (scene, settings, seed, tile,
//! block), the image of a resumed render is that of an uninterrupted one, bit for bit.
//!
//! A last block that is shorter than the others is not in any checkpoint: a longer render has a whole block
//! there. So a render that is complete can be resumed with more samples.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::Session;
use super::clock::Step;
use super::schedule::{self, MOST_BLOCKS, Position, Schedule, Tiles};
use super::stats::RenderStats;
use crate::error::{Error, Result};
use crate::film::{self, Film};
use crate::scene::{RenderSettings, SceneDescription, fingerprint};
use crate::wave::COUNTED_DEPTHS;

/// Largest count that a checkpoint may state: sums of several are far from the end of their type.
const MOST_COUNTED: f64 = (1u64 << 60) as f64;

/// Longest value that is quoted where it differs.
const LONGEST_QUOTED: usize = 40;

/// What the image of a render depends on beside its budget, by name. Only a render with the same identity can
/// go on with a checkpoint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Identity(BTreeMap<String, Value>);

impl Identity {
    /// The identity of a render of `scene`, its film's size included, through camera number `camera`.
    /// `build` tells the program from others that may round differently: a struct whose fields are named
    /// where they differ.
    ///
    /// # Panics
    /// If `build` is not a struct.
    pub fn new(
        scene: &SceneDescription,
        camera: usize,
        settings: &RenderSettings,
        build: &impl Serialize,
    ) -> Self {
        let mut values = fields(settings);
        // Blocks have a check of their own: they follow from this and from the budget.
        for same_image in [
            "budget",
            "block",
            "threads",
            "wave",
            "accel_quality",
            "force_features",
        ] {
            values.remove(same_image).expect("a setting");
        }
        values.append(&mut fields(build));
        let size = format!("{} × {}", scene.film.width, scene.film.height);
        values.insert("size".to_owned(), size.into());
        values.insert(
            "camera".to_owned(),
            scene.cameras[camera].name.clone().into(),
        );
        values.insert(SCENE.to_owned(), fingerprint(scene, camera).into());
        Self(values)
    }

    /// What differs in `other`, in words; empty if nothing does.
    fn differences(&self, other: &Self) -> Vec<String> {
        let keys = self
            .0
            .keys()
            .chain(other.0.keys().filter(|key| !self.0.contains_key(*key)));
        let differing = keys.filter(|key| self.0.get(*key) != other.0.get(*key));
        let named: Vec<&String> = differing.collect();
        let is_told = |key: &&&String| {
            // The fingerprint is of the size and the camera too.
            let explained = ["size", "camera"]
                .iter()
                .any(|part| named.iter().any(|key| key == part));
            key.as_str() != SCENE || !explained
        };
        let text = |identity: &Self, key: &str| match identity.0.get(key) {
            None | Some(Value::Null) => "none".to_owned(),
            Some(Value::String(text)) => text.clone(),
            Some(value) => value.to_string(),
        };
        let describe = |key: &&String| {
            let name = key.replace('_', " ");
            let [then, now] = [text(other, key), text(self, key)];
            if key.as_str() == SCENE || then.len().max(now.len()) > LONGEST_QUOTED {
                name
            } else {
                format!("{name} ({then}, now {now})")
            }
        };
        named.iter().filter(is_told).map(describe).collect()
    }
}

/// Name of the scene's fingerprint in an [`Identity`].
const SCENE: &str = "content of the scene or its files";

/// The fields of a struct.
fn fields(of: &impl Serialize) -> BTreeMap<String, Value> {
    match serde_json::to_value(of) {
        Ok(Value::Object(fields)) => fields.into_iter().collect(),
        _ => panic!("plain data with named fields always serialises"),
    }
}

/// What a checkpoint says of its render beside film and schedule.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Record {
    identity: Identity,
    position: Position,
    /// Rounds completed.
    rounds: u64,
    /// Samples in the film when its error was last estimated.
    estimated_at: u64,
    /// That error, if there was one.
    error: Option<f64>,
    /// Sessions that the render has had.
    sessions: u32,
    /// Counts and times of all of them.
    stats: RenderStats,
}

impl Record {
    /// Whether its counts can be those of a render with this film.
    fn is_sound(&self, film: &Film) -> bool {
        let stats = &self.stats;
        let stages = stats.stages.iter().map(|stage| stage.name);
        stats.paths == film.total_samples()
            && self.rounds <= MOST_BLOCKS
            && self.estimated_at <= stats.paths
            && stats.depths.len() <= COUNTED_DEPTHS
            && (stats.stages.is_empty() || stages.eq(Step::ALL.map(Step::name)))
            && serde_json::to_value(stats).is_ok_and(|stats| is_countable(&stats))
    }
}

/// Whether all numbers are in the range of counts.
fn is_countable(value: &Value) -> bool {
    match value {
        Value::Number(number) => number
            .as_f64()
            .is_some_and(|number| (0.0..=MOST_COUNTED).contains(&number)),
        Value::Array(values) => values.iter().all(is_countable),
        Value::Object(fields) => fields.values().all(is_countable),
        _ => true,
    }
}

/// A render that was interrupted, ready to go on.
#[derive(Debug)]
pub struct Resume {
    film: Film,
    schedule: Schedule,
    past: Past,
}

/// Where a render has come to beside its film and schedule.
#[derive(Debug, Default)]
pub(super) struct Past {
    /// Rounds completed.
    pub(super) rounds: u64,
    /// Samples in the film when its error was last estimated.
    pub(super) estimated_at: u64,
    /// That error, if there was one.
    pub(super) error: Option<f64>,
    /// Earlier sessions, if there were any.
    pub(super) earlier: Option<Earlier>,
    /// Their counts and times.
    pub(super) stats: RenderStats,
}

/// What the sessions of a render before this one have done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Earlier {
    /// How many there were.
    pub sessions: u32,
    /// Mean samples per pixel after them.
    pub samples: f64,
    /// CPU seconds of the workers in them.
    pub cpu_seconds: f64,
    /// Wall seconds of rendering in them.
    pub wall_seconds: f64,
}

impl Resume {
    /// Reads a checkpoint, of which a render of `scene` with these settings is to go on; its film has the size
    /// that the scene's film says.
    ///
    /// # Errors
    /// If there is no such file, it is damaged, it is of a render with another identity, or one with this
    /// budget does not come by there.
    pub fn read(
        path: &Path,
        scene: &SceneDescription,
        settings: &RenderSettings,
        identity: &Identity,
    ) -> Result<Self> {
        let refuse = |reason: &str| Error::file(path, format!("the checkpoint {reason}"));
        let film::Checkpoint {
            film,
            record,
            words,
        } = film::read_checkpoint::<Record>(path)?;
        let differences = identity.differences(&record.identity);
        if !differences.is_empty() {
            return Err(refuse(&format!(
                "is of another render, with different {}",
                differences.join(", ")
            )));
        }
        let (width, height) = (scene.film.width, scene.film.height);
        let parts = schedule::parts(settings);
        let film = film.told_by(parts);
        let kind = (film.width(), film.height(), film.has_aux(), film.parts());
        if kind != (width, height, settings.aux, parts) || !record.is_sound(&film) {
            return Err(refuse("is damaged: its counts are not those of its film"));
        }
        let mut schedule = Schedule::new(settings, Tiles::new(width, height))?;
        schedule
            .resume(&record.position, &words, &film)
            .map_err(|reason| refuse(&reason))?;
        let earlier = Earlier {
            sessions: record.sessions,
            samples: film.total_samples() as f64 / film.len() as f64,
            cpu_seconds: record.stats.cpu_seconds,
            wall_seconds: record.stats.wall_seconds,
        };
        Ok(Self {
            film,
            schedule,
            past: Past {
                rounds: record.rounds,
                estimated_at: record.estimated_at,
                error: record.error,
                earlier: Some(earlier),
                stats: record.stats,
            },
        })
    }

    /// What goes on, the film and the rest.
    pub(super) fn parts(self) -> (Schedule, Option<Film>, Past) {
        (self.schedule, Some(self.film), self.past)
    }
}

/// A render as it is between two work items.
#[derive(Debug)]
pub struct Snapshot<'a> {
    film: &'a Film,
    record: Record,
    words: Vec<u64>,
}

impl Snapshot<'_> {
    /// Writes the checkpoint: it is there complete, or what was there before is.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        film::write_checkpoint(path, self.film, &self.record, &self.words)
    }
}

/// When and how checkpoints are taken.
pub struct Saving<'a> {
    /// Of the render.
    pub identity: Identity,
    /// Time between two; the next work items to end after it are waited for.
    pub every: Duration,
    /// Does something with one, writes it as a rule. Also called at the end of the render, whatever ends it.
    pub save: &'a mut dyn FnMut(&Snapshot<'_>),
}

impl std::fmt::Debug for Saving<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            identity, every, ..
        } = self;
        f.debug_struct("Saving")
            .field("identity", identity)
            .field("every", every)
            .finish_non_exhaustive()
    }
}

/// Takes checkpoints when they are due, and none where nothing has been rendered since the last.
#[derive(Debug)]
pub(super) struct Saver<'a> {
    saving: Option<Saving<'a>>,
    /// Sessions of the render, this one included.
    sessions: u32,
    /// When the last checkpoint was taken.
    taken: Instant,
    /// Samples that are in it.
    samples: u64,
}

impl<'a> Saver<'a> {
    pub(super) fn new(saving: Option<Saving<'a>>, earlier: Option<&Earlier>, samples: u64) -> Self {
        Self {
            saving,
            sessions: earlier.map_or(1, |earlier| earlier.sessions.saturating_add(1)),
            taken: Instant::now(),
            samples,
        }
    }

    /// When the next checkpoint is to be taken, if ever.
    pub(super) fn due(&self) -> Option<Instant> {
        self.taken.checked_add(self.saving.as_ref()?.every)
    }

    /// Takes a checkpoint of a session whose schedule has so many finished rounds.
    pub(super) fn save(
        &mut self,
        session: &mut Session<'_>,
        schedule: &Schedule,
        rounds: u64,
        estimated_at: u64,
    ) {
        let samples = session.paths;
        let Some(saving) = self.saving.as_mut().filter(|_| samples > self.samples) else {
            return;
        };
        let (position, words) = schedule.position();
        let record = Record {
            identity: saving.identity.clone(),
            position,
            rounds,
            estimated_at,
            error: session.error,
            sessions: self.sessions,
            stats: session.stats_until_now(),
        };
        (saving.save)(&Snapshot {
            film: session.film(),
            record,
            words,
        });
        self.taken = Instant::now();
        self.samples = samples;
    }

    /// Takes no more checkpoints.
    pub(super) fn stop(&mut self) {
        self.saving = None;
    }
}
