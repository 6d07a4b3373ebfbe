//! Rounds, blocks and tiles: in which order a render's work items exist, and when it ends.

use serde::{Deserialize, Serialize};

use super::adaptive::Adaptive;
use crate::compile::{TILE, WorkItem};
use crate::error::Result;
use crate::film::{Film, Parts};
use crate::scene::{Budget, IntegratorKind, RenderSettings, SamplerKind};

/// The blocks of a render: block b is the same for every budget of its kind, however it ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Blocks {
    /// Samples of a full block.
    full: u32,
    /// Whether blocks grow (1, 1, 2, 4, …) up to a full one, so that a render that is to end by
    /// time or error can end soon.
    growing: bool,
    /// Samples per pixel after which the render is complete.
    total: Option<u64>,
}

impl Blocks {
    /// The blocks of a render with these settings. A given sample count is cut into at least four
    /// blocks (where it has four samples), so that block means give an error estimate.
    pub fn new(settings: &RenderSettings) -> Self {
        match settings.budget {
            Budget::Samples(total) => {
                let quarter = u32::try_from(total.div_ceil(4)).unwrap_or(u32::MAX);
                Self {
                    full: settings.block.min(quarter).max(1),
                    growing: false,
                    total: Some(total),
                }
            }
            Budget::Seconds(_) | Budget::Error(_) => Self {
                full: settings.block,
                growing: true,
                total: None,
            },
        }
    }

    /// The blocks of one of the parts of a film that these samples are dealt out to in turn.
    fn of_part(self, part: usize, parts: usize) -> Self {
        let deal = |total| samples_of_part(total, part, parts);
        Self {
            total: self.total.map(deal),
            ..self
        }
    }

    /// The blocks of each half of a render that places samples adaptively. They have no end, as one tile has
    /// more of them than another; a given sample count makes at least eight of a half's mean.
    pub fn of_half(settings: &RenderSettings) -> Self {
        match settings.budget {
            Budget::Samples(total) => {
                let sixteenth = u32::try_from(total / 16).unwrap_or(u32::MAX);
                Self {
                    full: settings.block.min(sixteenth).max(1),
                    growing: false,
                    total: None,
                }
            }
            Budget::Seconds(_) | Budget::Error(_) => Self::new(settings),
        }
    }

    /// Samples in the first `count` blocks.
    pub fn samples(&self, count: u64) -> u64 {
        let (first, _) = self.whole(count);
        self.total.map_or(first, |total| first.min(total))
    }

    /// How many blocks come closest to `samples` in a render without end, the fewer if two do.
    pub fn count(&self, samples: f64) -> u64 {
        let (mut low, mut high) = (0, (samples as u64).saturating_add(1));
        while low < high {
            let middle = low + (high - low) / 2;
            if (self.samples(middle) as f64) < samples {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        let missing = |count: u64| (self.samples(count) as f64 - samples).abs();
        match low.checked_sub(1) {
            Some(fewer) if missing(fewer) <= missing(low) => fewer,
            _ => low,
        }
    }

    /// Samples of the largest block.
    pub fn largest(&self) -> u32 {
        self.full
    }

    /// First sample and number of samples of block `block`, or `None` past the last.
    pub fn get(&self, block: u64) -> Option<(u64, u32)> {
        let (first, samples) = self.whole(block);
        match self.total {
            Some(total) if first >= total => None,
            Some(total) => Some((first, u64::from(samples).min(total - first) as u32)),
            None => Some((first, samples)),
        }
    }

    /// Whether a longer render has more samples in block `block` than this one.
    fn is_short(&self, block: u64) -> bool {
        self.get(block) != Some(self.whole(block))
    }

    /// As [`Self::get`], of a render without end.
    fn whole(&self, block: u64) -> (u64, u32) {
        let full = u64::from(self.full);
        // Saturating: a user may ask for as many samples as there are numbers.
        if !self.growing {
            return (block.saturating_mul(full), self.full);
        }
        // Blocks of 1, 1, 2, 4, …: after k ≥ 1 of them there are 2^(k−1) samples.
        let ramp = u64::from(self.full.ilog2()) + 1;
        match block {
            0 => (0, 1),
            b if b < ramp => (1 << (b - 1), 1 << (b - 1)),
            b => {
                let beyond = (b - ramp).saturating_mul(full);
                (beyond.saturating_add(1 << (ramp - 1)), self.full)
            }
        }
    }

    /// Errors, with the reason, unless a render in these blocks has begun as one in `other` blocks does.
    fn check_beginning(&self, other: &Self) -> std::result::Result<(), String> {
        match (self.growing, other.growing) {
            (true, false) => Err(
                "was begun with a given number of samples, in blocks that a render until a time or an error \
                 has not: give --spp"
                    .to_owned(),
            ),
            (false, true) => Err(
                "was begun until a time or an error, in blocks that a render of a given number of samples \
                 has not: give --seconds or --error"
                    .to_owned(),
            ),
            _ if self.full == other.full => Ok(()),
            _ => {
                let remedy = match self.total {
                    Some(total) if total.div_ceil(4) < u64::from(other.full) => {
                        format!("--spp {} or more", 4 * u64::from(other.full) - 3)
                    }
                    _ => format!("--block {}", other.full),
                };
                Err(format!(
                    "was begun in blocks of {} samples per pixel, and this render has blocks of {}: give {remedy}",
                    other.full, self.full
                ))
            }
        }
    }
}

/// The parts of the film of a render with these settings. Blocks of one of Sobol's sequences avoid each
/// other, and their spread says too much of the error; so there are two independent sequences. The reference
/// integrator has a generator of its own.
pub fn parts(settings: &RenderSettings) -> Parts {
    let sequences =
        settings.sampler == SamplerKind::Sobol && settings.integrator != IntegratorKind::Reference;
    match (settings.adaptive, sequences) {
        (_, true) => Parts::Replicates,
        (true, false) => Parts::Halves,
        (false, false) => Parts::Whole,
    }
}

/// Of `total` samples that are dealt out to the parts of a film in turn, those of one part.
pub(super) fn samples_of_part(total: u64, part: usize, parts: usize) -> u64 {
    let (part, parts) = (part as u64, parts as u64);
    total / parts + u64::from(part < total % parts)
}

/// Tiles of an image, row by row.
#[derive(Debug, Clone, Copy)]
pub struct Tiles {
    width: u32,
    height: u32,
}

impl Tiles {
    /// Tiles of an image of this size.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height }
    }

    /// Number of tiles.
    pub fn count(&self) -> usize {
        self.width.div_ceil(TILE) as usize * self.height.div_ceil(TILE) as usize
    }

    /// Number of the tile of a work item.
    pub fn index(&self, item: &WorkItem) -> usize {
        let across = self.width.div_ceil(TILE) as usize;
        (item.y / TILE) as usize * across + (item.x / TILE) as usize
    }

    /// The work item of a tile and a block.
    pub fn item(&self, tile: usize, block: u64, (first_sample, samples): (u64, u32)) -> WorkItem {
        let across = self.width.div_ceil(TILE) as usize;
        let (x, y) = ((tile % across) as u32 * TILE, (tile / across) as u32 * TILE);
        WorkItem {
            x,
            y,
            width: TILE.min(self.width - x),
            height: TILE.min(self.height - y),
            image_width: self.width,
            block,
            first_sample,
            samples,
        }
    }

    /// The work items of a block in all tiles, of one part of the film.
    pub fn items(&self, block: u64, samples: (u64, u32), part: usize) -> Vec<WorkItem> {
        let item = |tile| self.item(tile, block, samples).in_half(part);
        (0..self.count()).map(item).collect()
    }
}

/// Which work items exist, round by round. Within a round each half of each tile belongs to at most one work
/// item.
#[derive(Debug)]
pub enum Schedule {
    /// A round is one block of every tile in each part of the film.
    Uniform {
        /// The blocks of each part of the film.
        blocks: Vec<Blocks>,
        /// The tiles.
        tiles: Tiles,
        /// Block of the next round.
        block: u64,
    },
    /// More blocks for some tiles than for others.
    Adaptive(Box<Adaptive>),
}

/// Where a schedule is, with what it must have in common with the schedule of a render that goes on there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Position {
    /// The blocks.
    blocks: Blocks,
    /// Block of the next round; 0 of an adaptive render, whose tiles have each their own.
    block: u64,
    /// Mean samples per pixel of a half at the end of an adaptive render of a given length.
    mean: Option<f64>,
}

/// Most blocks of a pixel: so many that no render has them, and so few that counts of samples are far from the
/// ends of their types.
pub(super) const MOST_BLOCKS: u64 = 1 << 40;

impl Schedule {
    /// The schedule of a render with these settings.
    ///
    /// # Errors
    /// If the settings ask for an adaptive render of too few samples.
    pub fn new(settings: &RenderSettings, tiles: Tiles) -> Result<Self> {
        Ok(if settings.adaptive {
            Self::Adaptive(Box::new(Adaptive::new(settings, tiles)?))
        } else {
            let blocks = Blocks::new(settings);
            let count = parts(settings).count();
            Self::Uniform {
                blocks: (0..count).map(|part| blocks.of_part(part, count)).collect(),
                tiles,
                block: 0,
            }
        })
    }

    /// Samples of the largest block.
    pub fn largest_block(&self) -> u32 {
        self.blocks(0).largest()
    }

    /// The work items of the next round; none when the render is complete. The same ones until they are
    /// finished.
    pub fn round(&mut self) -> Vec<WorkItem> {
        match self {
            Self::Uniform {
                blocks,
                tiles,
                block,
            } => {
                let parts = blocks.iter().enumerate();
                let items = parts.filter_map(|(part, blocks)| {
                    Some(tiles.items(*block, blocks.get(*block)?, part))
                });
                items.flatten().collect()
            }
            Self::Adaptive(adaptive) => adaptive.round(),
        }
    }

    /// Notes that all items of the round are in the film.
    pub fn finished(&mut self, items: &[WorkItem], film: &Film) {
        match self {
            Self::Uniform { block, .. } => *block += 1,
            Self::Adaptive(adaptive) => adaptive.finished(items, film),
        }
    }

    /// Those of a round's items that are not in the film yet.
    pub fn missing(&self, items: &[WorkItem], film: &Film) -> Vec<WorkItem> {
        let tiles = self.tiles();
        let is_missing = |item: &&WorkItem| {
            let sums = &film.half(item.half())[item.image_index(0)];
            sums.blocks == self.done(tiles.index(item), item.half())
        };
        items.iter().filter(is_missing).copied().collect()
    }

    /// Whether the next round is a last one of fewer samples than it has in a longer render.
    pub fn is_short(&self) -> bool {
        match self {
            Self::Uniform { blocks, block, .. } => blocks.iter().any(|part| part.is_short(*block)),
            // A longer render is another one from the start.
            Self::Adaptive(_) => false,
        }
    }

    /// Where the schedule is, for [`Self::resume`].
    pub fn position(&self) -> (Position, Vec<u64>) {
        let (block, words) = match self {
            Self::Uniform { block, .. } => (*block, Vec::new()),
            Self::Adaptive(adaptive) => (0, adaptive.words()),
        };
        let position = Position {
            blocks: *self.blocks(0),
            block,
            mean: self.mean(),
        };
        (position, words)
    }

    /// Goes to where another schedule was when all finished rounds and part of the next one were in `film`.
    ///
    /// # Errors
    /// With the reason, if this schedule does not come by there or the film is not the one that it has there.
    pub fn resume(
        &mut self,
        position: &Position,
        words: &[u64],
        film: &Film,
    ) -> std::result::Result<(), String> {
        let damaged = || "is damaged: its film is not that of its schedule".to_owned();
        if let (Some(now), Some(then)) = (self.mean(), position.mean)
            && now != then
        {
            return Err(
                "is of an adaptive render, which has placed its samples by their number and cannot be given \
                 another"
                    .to_owned(),
            );
        }
        self.blocks(0).check_beginning(&position.blocks)?;
        match self {
            Self::Uniform { blocks, block, .. } => {
                let total: Option<u64> = blocks.iter().map(|part| part.total).sum();
                if let Some(total) = total
                    && total < film.max_samples()
                {
                    return Err(format!(
                        "has {} samples per pixel, more than --spp {total}",
                        film.max_samples()
                    ));
                }
                *block = position.block;
            }
            Self::Adaptive(adaptive) => {
                adaptive.resume(words).ok_or_else(damaged)?;
            }
        }
        if self.mean() != position.mean {
            return Err(damaged());
        }
        let bounded = position.block <= MOST_BLOCKS;
        (bounded && self.has_come_to(film))
            .then_some(())
            .ok_or_else(damaged)
    }

    /// Whether the film has the blocks of all finished rounds at every pixel, and of the next round those of
    /// some tiles.
    fn has_come_to(&mut self, film: &Film) -> bool {
        let tiles = self.tiles();
        let next = self.round();
        (0..film.parts().count()).all(|half| {
            let mut most: Vec<u64> = (0..tiles.count())
                .map(|tile| self.done(tile, half))
                .collect();
            for item in next.iter().filter(|item| item.half() == half) {
                most[tiles.index(item)] += 1;
            }
            let sums = film.half(half);
            most.into_iter().enumerate().all(|(tile, most)| {
                let item = tiles.item(tile, 0, (0, 1));
                let blocks = sums[item.image_index(0)].blocks;
                let samples = self.blocks(half).samples(blocks.min(MOST_BLOCKS));
                let is_whole = |pixel| {
                    let sums = &sums[item.image_index(pixel)];
                    sums.blocks == blocks && sums.samples == samples
                };
                (self.done(tile, half)..=most).contains(&blocks) && (0..item.pixels()).all(is_whole)
            })
        })
    }

    /// The blocks of a part of the film.
    fn blocks(&self, part: usize) -> &Blocks {
        match self {
            Self::Uniform { blocks, .. } => &blocks[part],
            Self::Adaptive(adaptive) => adaptive.blocks(),
        }
    }

    /// Mean samples per pixel of a half at the end of an adaptive render of a given length.
    fn mean(&self) -> Option<f64> {
        match self {
            Self::Uniform { .. } => None,
            Self::Adaptive(adaptive) => adaptive.mean(),
        }
    }

    fn tiles(&self) -> Tiles {
        match self {
            Self::Uniform { tiles, .. } => *tiles,
            Self::Adaptive(adaptive) => adaptive.tiles(),
        }
    }

    /// Blocks of a tile in a half of the film after the finished rounds.
    fn done(&self, tile: usize, half: usize) -> u64 {
        match self {
            Self::Uniform { block, .. } => *block,
            Self::Adaptive(adaptive) => adaptive.done(tile, half),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blocks(budget: Budget, block: u32) -> Blocks {
        Blocks::new(&RenderSettings {
            budget,
            block,
            ..RenderSettings::default()
        })
    }

    #[test]
    fn blocks_cover_every_sample_once_in_order() {
        for total in [1, 2, 3, 5, 16, 17, 64, 100, 400] {
            for block in [1, 7, 16, 64] {
                let blocks = blocks(Budget::Samples(total), block);
                let mut next = 0;
                let mut count = 0;
                while let Some((first, samples)) = blocks.get(count) {
                    assert_eq!(first, next);
                    assert!(samples >= 1 && samples <= blocks.largest());
                    next += u64::from(samples);
                    count += 1;
                }
                assert_eq!(next, total);
                assert!(count >= total.min(3), "{total} samples in {count} blocks");
            }
        }
    }

    #[test]
    fn samples_are_dealt_out_to_the_parts_of_a_film_in_turn() {
        for total in [1, 2, 5, 6, 33, 64] {
            let parts = [0, 1].map(|part| blocks(Budget::Samples(total), 16).of_part(part, 2));
            let counts = parts.map(|part| part.samples(MOST_BLOCKS));
            assert_eq!(counts, [total.div_ceil(2), total / 2]);
            // A longer render goes on from where this one has had whole blocks alone.
            let last = (0..).find(|&block| parts[0].get(block).is_none()).unwrap() - 1;
            let short = parts.map(|part| part.is_short(last));
            assert!((0..last).all(|block| parts.iter().all(|part| !part.is_short(block))));
            let full = u64::from(parts[0].largest());
            assert_eq!(short, counts.map(|count| count != (last + 1) * full));
        }
    }

    #[test]
    fn growing_blocks_double_up_to_a_full_one() {
        for block in [1, 6, 16, 64] {
            let blocks = blocks(Budget::Seconds(1.0), block);
            let mut next = 0;
            for b in 0..40 {
                let (first, samples) = blocks.get(b).expect("no end");
                assert_eq!(first, next, "block {b} of {block}");
                assert!(samples <= block);
                next += u64::from(samples);
            }
        }
        let sizes: Vec<u32> = (0..8)
            .map(|b| blocks(Budget::Error(0.1), 16).get(b).unwrap().1)
            .collect();
        assert_eq!(sizes, [1, 1, 2, 4, 8, 16, 16, 16]);
    }

    #[test]
    fn counts_of_blocks_come_closest_to_their_samples() {
        let settings = |block| RenderSettings {
            budget: Budget::Error(0.1),
            block,
            ..RenderSettings::default()
        };
        for block in [1, 6, 16] {
            let blocks = Blocks::of_half(&settings(block));
            for samples in 0..200 {
                let count = blocks.count(f64::from(samples));
                let missing = |n| (blocks.samples(n) as f64 - f64::from(samples)).abs();
                assert!((0..200).all(|n| missing(n) >= missing(count)), "{samples}");
            }
        }
    }

    #[test]
    fn tiles_cover_every_pixel_once() {
        for (width, height) in [(1, 1), (16, 16), (17, 31), (200, 5)] {
            let tiles = Tiles::new(width, height);
            let mut seen = vec![0; (width * height) as usize];
            for tile in 0..tiles.count() {
                let item = tiles.item(tile, 0, (0, 1)).in_half(tile % 2);
                assert_eq!((tiles.index(&item), item.half()), (tile, tile % 2));
                for pixel in 0..item.pixels() {
                    seen[item.image_index(pixel)] += 1;
                }
            }
            assert!(seen.iter().all(|&n| n == 1));
        }
    }
}
