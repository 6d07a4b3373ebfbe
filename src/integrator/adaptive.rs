//! Adaptive sampling: tiles with a larger estimated error get more blocks.
//!
//! # Without bias
//!
//! The film has two halves, which use unrelated random numbers and whose means count the same (see
//! [`Parts::Halves`](crate::film::Parts::Halves)). Each half has a floor, a number of blocks that every tile gets. Once all tiles have
//! it, the estimates from the floor of one half decide how many blocks each tile gets in the *other* one.
//! So the number of samples of a tile in half A is a function of half B's random numbers alone: given
//! half B, it is a constant, and the mean of half A is unbiased, as is its variance. That takes three
//! precautions. Sums of both halves may not be pooled, as then the number of samples in half B, which
//! half A has chosen, would decide how much half A counts. Of a half nothing beyond the floor may be looked at, as how
//! much there is has been chosen by the other. And half A may not stop before its blocks are done because
//! of what it has seen; stopping all tiles together, as a time or an error goal does, is the same small
//! matter that it is for uniform sampling.
//!
//! Where the difference of the halves tells the variance ([`Parts::Replicates`](crate::film::Parts::Replicates)), it leaves out
//! their covariance. That is the square of the covariance between the mean of a half's floor and what the other half makes of
//! it, the floor's share of its samples; as a pixel moves that of its whole tile by little, it is small.
//!
//! # How many
//!
//! The error to be lowered is the image's relative one. Σ V_t/n_t, V_t the sum over the pixels of tile t
//! of the relative variance of one sample, is least for Σ w_t·n_t, w_t the pixels of the tile, where
//! n_t ∝ √(V_t/w_t) (Neyman 1934); no tile gets fewer samples than the floor. As many samples are
//! given out this way as the floor has, so at most half of them are misplaced where the estimate misleads.
//! A render of a given length has one floor; one that ends by time or error doubles it again and again.
//! A tile is the unit because a work item is: single pixels would leave lanes empty.

use super::schedule::{Blocks, MOST_BLOCKS, Tiles};
use crate::compile::WorkItem;
use crate::error::{Error, Result};
use crate::film::{Film, PixelSums, RELATIVE_EPSILON, relative_variance};
use crate::scene::{Budget, RenderSettings};

/// Fewest samples per pixel of a render of a given length: a floor and as much again, of two blocks in each
/// half.
const LEAST_SAMPLES: u64 = 8;

/// Blocks of the first floor of a render without a given length: 1 + 1 + 2 + 4 samples.
const FIRST_FLOOR: u64 = 4;

/// Most samples of a tile, as a multiple of the floor: so that all threads have work, and one bright
/// sample does not take everything.
const MOST_FLOORS: f64 = 16.0;

/// The least root of a tile's variance, as a share of the mean over tiles: what has not been seen to vary may
/// vary yet, and is next when the noisier ones have all they may have.
const LEAST_SPREAD: f64 = 1e-3;

/// Most floors: each has twice the samples of the one before.
const MOST_FLOORS_KNOWN: usize = 64;

/// Which work items exist, decided round by round.
#[derive(Debug)]
pub struct Adaptive {
    tiles: Tiles,
    /// Pixels of each tile.
    weights: Vec<f64>,
    blocks: Blocks,
    /// The floors so far, in blocks, rising; those beyond the present one have been reached by some tiles.
    floors: Vec<u64>,
    /// Which floor is the present one.
    stage: usize,
    /// Whether the present floor is complete and blocks are given out beyond it.
    beyond_floor: bool,
    /// Mean samples per pixel of a half at the end, if the render has a given length.
    mean: Option<f64>,
    halves: [Half; 2],
}

/// One half of the film.
#[derive(Debug, Default)]
struct Half {
    /// Blocks that each tile has.
    done: Vec<u64>,
    /// Blocks that each tile is to have before the next decision.
    target: Vec<u64>,
    /// At each floor, of each tile, Σ relative variance of one sample over its pixels.
    variances: Vec<Vec<f64>>,
    /// What keeps black pixels from deciding, of the first floor.
    epsilon: Option<f64>,
}

impl Adaptive {
    /// The schedule of a render with these settings.
    ///
    /// # Errors
    /// If a given number of samples per pixel is too small to be divided.
    pub fn new(settings: &RenderSettings, tiles: Tiles) -> Result<Self> {
        let blocks = Blocks::of_half(settings);
        let (floor, mean) = match settings.budget {
            Budget::Samples(total) if total < LEAST_SAMPLES => {
                return Err(Error::usage(format!(
                    "adaptive sampling needs at least {LEAST_SAMPLES} samples per pixel, not {total}"
                )));
            }
            Budget::Samples(total) => {
                let mean = 0.5 * total as f64;
                (blocks.count(0.5 * mean).max(2), Some(mean))
            }
            Budget::Seconds(_) | Budget::Error(_) => (FIRST_FLOOR, None),
        };
        let count = tiles.count();
        let half = || Half {
            done: vec![0; count],
            target: vec![floor; count],
            ..Half::default()
        };
        Ok(Self {
            weights: (0..count)
                .map(|tile| f64::from(tiles.item(tile, 0, (0, 1)).pixels()))
                .collect(),
            tiles,
            blocks,
            floors: vec![floor],
            stage: 0,
            beyond_floor: false,
            mean,
            halves: [half(), half()],
        })
    }

    /// The schedule of a render that goes on for as long as it is asked to, whatever its budget.
    pub fn endless(settings: &RenderSettings, tiles: Tiles) -> Self {
        let settings = RenderSettings {
            budget: Budget::Seconds(f64::INFINITY),
            ..settings.clone()
        };
        Self::new(&settings, tiles).expect("there is no number of samples to be too small")
    }

    /// The blocks of each half.
    pub(super) fn blocks(&self) -> &Blocks {
        &self.blocks
    }

    /// The tiles.
    pub(super) fn tiles(&self) -> Tiles {
        self.tiles
    }

    /// Mean samples per pixel of a half at the end, if the render has a given length.
    pub(super) fn mean(&self) -> Option<f64> {
        self.mean
    }

    /// Blocks of a tile in a half after the finished rounds.
    pub(super) fn done(&self, tile: usize, half: usize) -> u64 {
        self.halves[half].done[tile]
    }

    /// Where the schedule is, for [`Self::resume`].
    pub(super) fn words(&self) -> Vec<u64> {
        let mut words = vec![
            self.stage as u64,
            self.beyond_floor.into(),
            self.floors.len() as u64,
        ];
        words.extend(&self.floors);
        for half in &self.halves {
            words.extend([
                half.epsilon.is_some().into(),
                half.epsilon.unwrap_or(0.0).to_bits(),
                half.variances.len() as u64,
            ]);
            words.extend(half.done.iter().chain(&half.target));
            words.extend(half.variances.iter().flatten().map(|v| v.to_bits()));
        }
        words
    }

    /// Goes to where a schedule of the same settings was. `None` if there is no such place; the schedule is then of no use.
    pub(super) fn resume(&mut self, words: &[u64]) -> Option<()> {
        let tiles = self.weights.len();
        let mut words = words.iter().copied();
        let mut take = |count: usize| -> Option<Vec<u64>> {
            let taken: Vec<u64> = words.by_ref().take(count).collect();
            (taken.len() == count).then_some(taken)
        };
        let [stage, beyond_floor, floors] = take(3)?.try_into().ok()?;
        self.floors = take(
            usize::try_from(floors)
                .ok()
                .filter(|n| *n <= MOST_FLOORS_KNOWN)?,
        )?;
        self.stage = usize::try_from(stage).ok()?;
        self.beyond_floor = beyond_floor != 0;
        let floor = *self.floors.get(self.stage)?;
        let is_rising = self.floors.is_sorted_by(|a, b| a < b);
        let is_only = self.mean.is_none() || self.floors.len() == 1;
        if !is_rising || !is_only || self.floors.iter().any(|floor| *floor > MOST_BLOCKS) {
            return None;
        }
        for half in &mut self.halves {
            let [has_epsilon, epsilon, rows] = take(3)?.try_into().ok()?;
            half.epsilon = (has_epsilon != 0).then_some(f64::from_bits(epsilon));
            half.done = take(tiles)?;
            half.target = take(tiles)?;
            let rows = usize::try_from(rows)
                .ok()
                .filter(|rows| *rows <= self.floors.len())?;
            let row = |_| Some(take(tiles)?.into_iter().map(f64::from_bits).collect());
            half.variances = (0..rows).map(row).collect::<Option<_>>()?;
            // What was decided: no tile ends below the floor, nor has more than it is to have; and each floor
            // that a tile has reached has its variances.
            let sound = |(done, target): (&u64, &u64)| {
                done <= target && (floor..=MOST_BLOCKS).contains(target)
            };
            let most = half.done.iter().max()?;
            let reached = self.floors.partition_point(|floor| floor <= most);
            if !half.done.iter().zip(&half.target).all(sound) || rows < reached {
                return None;
            }
        }
        // A floor is known as soon as a tile reaches it.
        let most = self.halves.iter().flat_map(|half| &half.done).max()?;
        let all_known = self.next_floor().is_none_or(|floor| floor > *most);
        (all_known && take(1).is_none()).then_some(())
    }

    /// The next round: at most one block of each half of each tile. Empty when the render is complete.
    pub fn round(&mut self) -> Vec<WorkItem> {
        loop {
            let items = self.pending();
            if !items.is_empty() {
                return items;
            }
            if !self.beyond_floor {
                self.give_out();
            } else if self.mean.is_none() {
                self.raise_floor();
            } else {
                return items;
            }
            self.beyond_floor = !self.beyond_floor;
        }
    }

    /// The next block of each half of each tile that is to have one.
    fn pending(&self) -> Vec<WorkItem> {
        (0..self.tiles.count())
            .flat_map(|tile| [(tile, 0), (tile, 1)])
            .filter_map(|(tile, index)| {
                let half = &self.halves[index];
                let block = half.done[tile];
                let range = self.blocks.get(block)?;
                (block < half.target[tile])
                    .then(|| self.tiles.item(tile, block, range).in_half(index))
            })
            .collect()
    }

    /// Notes that the items of a round are in the film.
    pub fn finished(&mut self, items: &[WorkItem], film: &Film) {
        for item in items {
            self.halves[item.half()].done[self.tiles.index(item)] += 1;
        }
        let most = |half: &Half| half.done.iter().copied().max();
        let most = self.halves.iter().filter_map(most).max().unwrap_or(0);
        while let Some(floor) = self.next_floor().filter(|&floor| floor <= most) {
            self.floors.push(floor);
        }
        for item in items {
            let tile = self.tiles.index(item);
            let done = self.halves[item.half()].done[tile];
            if let Ok(floor) = self.floors.binary_search(&done) {
                let half = &mut self.halves[item.half()];
                half.note(
                    floor,
                    tile,
                    item,
                    film.half(item.half()),
                    self.weights.len(),
                );
            }
        }
    }

    /// The floor after the last one known: twice its samples. `None` where there is one only.
    fn next_floor(&self) -> Option<u64> {
        if self.mean.is_some() {
            return None;
        }
        let last = *self.floors.last()?;
        Some(
            self.blocks
                .count(2.0 * self.blocks.samples(last) as f64)
                .max(last + 1),
        )
    }

    /// Lets each half's floor decide over the other half.
    fn give_out(&mut self) {
        let floor = self.blocks.samples(self.floors[self.stage]) as f64;
        let mean = self.mean.unwrap_or(2.0 * floor);
        for (index, other) in [(0, 1), (1, 0)] {
            let variances = &self.halves[other].variances[self.stage];
            let samples = allocate(variances, &self.weights, floor, mean);
            for (target, samples) in self.halves[index].target.iter_mut().zip(samples) {
                *target = (*target).max(self.blocks.count(samples));
            }
        }
    }

    /// Brings every tile to the next floor.
    fn raise_floor(&mut self) {
        self.stage += 1;
        if self.stage == self.floors.len() {
            self.floors.extend(self.next_floor());
        }
        let floor = self.floors[self.stage];
        for target in self.halves.iter_mut().flat_map(|half| &mut half.target) {
            *target = (*target).max(floor);
        }
    }
}

impl Half {
    /// Keeps the variance of a tile that has just reached a floor; `film` is this half.
    fn note(
        &mut self,
        floor: usize,
        tile: usize,
        item: &WorkItem,
        film: &[PixelSums],
        tiles: usize,
    ) {
        let epsilon = *self.epsilon.get_or_insert_with(|| {
            let sum: f64 = film.iter().flat_map(PixelSums::mean).sum();
            RELATIVE_EPSILON * sum / (3 * film.len()) as f64
        });
        while self.variances.len() <= floor {
            self.variances.push(vec![0.0; tiles]);
        }
        self.variances[floor][tile] = (0..item.pixels())
            .filter_map(|pixel| {
                let sums = &film[item.image_index(pixel)];
                let of_mean = relative_variance(sums.mean(), sums.variance()?, epsilon);
                Some(of_mean * sums.samples as f64)
            })
            .sum();
    }
}

/// Samples per pixel of each tile: in proportion to √(variance/weight), at least `floor` and at most
/// [`MOST_FLOORS`] of them, `mean` > `floor` on average over the weights.
fn allocate(variances: &[f64], weights: &[f64], floor: f64, mean: f64) -> Vec<f64> {
    let pixels: f64 = weights.iter().sum();
    let spread: Vec<f64> = variances
        .iter()
        .zip(weights)
        .map(|(variance, weight)| (variance / weight).sqrt())
        .collect();
    let least = LEAST_SPREAD * spread.iter().sum::<f64>() / spread.len() as f64;
    // An image that is black or without noise so far is treated as noisy all over.
    let least = if least > 0.0 && least.is_finite() {
        least
    } else {
        1.0
    };
    let samples = |scale: f64| {
        let of_tile = move |spread: &f64| {
            let spread = if spread.is_finite() {
                spread.max(least)
            } else {
                least
            };
            (scale * spread).clamp(floor, MOST_FLOORS * floor)
        };
        spread.iter().map(of_tile)
    };
    let total = |scale: f64| -> f64 { samples(scale).zip(weights).map(|(n, w)| n * w).sum() };
    // At the upper end every tile has the most it may have.
    let (mut low, mut high) = (0.0, MOST_FLOORS * floor / least);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if total(middle) < mean * pixels {
            low = middle;
        } else {
            high = middle;
        }
    }
    samples(high).collect()
}

#[cfg(test)]
mod tests {
    use rand_core::Rng;
    use rand_pcg::Pcg32;

    use super::*;
    use crate::film::{Film, Parts};

    #[test]
    fn samples_are_given_out_in_proportion_to_the_root_of_the_variance() {
        let weights = [4.0, 4.0, 2.0, 1.0];
        // Roots of variance over weight: 1, 2, 4, 0.
        let samples = allocate(&[4.0, 16.0, 32.0, 0.0], &weights, 8.0, 16.0);
        let total: f64 = samples.iter().zip(weights).map(|(n, w)| n * w).sum();
        assert!((total / 11.0 - 16.0).abs() < 1e-9, "{samples:?}");
        assert_eq!(samples[3], 8.0);
        assert!((samples[2] / samples[1] - 2.0).abs() < 1e-9, "{samples:?}");
        assert!(samples[0] >= 8.0 && samples[0] < samples[1]);
        // What differs more than the bounds allow is cut off, and the rest goes to the others.
        let samples = allocate(&[1e12, 1e-12, 0.0], &[1.0; 3], 8.0, 60.0);
        assert_eq!(samples[0], 128.0);
        assert!((samples.iter().sum::<f64>() / 3.0 - 60.0).abs() < 1e-9);
        // Nothing known: all the same.
        for unknown in [0.0, f64::NAN] {
            let samples = allocate(&[unknown; 3], &[1.0, 2.0, 3.0], 8.0, 16.0);
            assert!(
                samples.iter().all(|n| (n - 16.0).abs() < 1e-9),
                "{samples:?}"
            );
        }
    }

    /// A row of two tiles, of 32 and of 8 pixels.
    const WIDTH: u32 = 40;

    fn schedule(budget: Budget) -> Adaptive {
        let settings = RenderSettings {
            budget,
            adaptive: true,
            ..RenderSettings::default()
        };
        Adaptive::new(&settings, Tiles::new(WIDTH, 1)).expect("enough samples")
    }

    /// Renders up to `rounds` rounds of rare bright samples: 100 with a probability of 1/50 in the second
    /// tile, 1 with 1/2 in the first. The expectations are 2 and 1/2.
    fn render(schedule: &mut Adaptive, rounds: usize, seed: u64) -> Film {
        let mut random = Pcg32::new(seed, 1);
        let mut film = Film::in_parts(WIDTH, 1, false, Parts::Halves);
        for _ in 0..rounds {
            let items = schedule.round();
            for item in &items {
                for pixel in 0..item.pixels() {
                    let mut sum = 0.0;
                    for _ in 0..item.samples {
                        let u = f64::from(random.next_u32()) / 4_294_967_296.0;
                        sum += match item.x {
                            0 => f64::from(u8::from(u < 0.5)),
                            _ => 100.0 * f64::from(u8::from(u < 0.02)),
                        };
                    }
                    let index = item.image_index(pixel);
                    film.half_mut(item.half())
                        .add_block(index, item.samples, [sum; 3]);
                }
            }
            schedule.finished(&items, &film);
            if items.is_empty() {
                break;
            }
        }
        film
    }

    #[test]
    fn means_are_unbiased_though_samples_are_not_placed_evenly() {
        // A short render, in which throwing both halves together would show, and one whose floor has risen
        // several times.
        for (budget, rounds, runs, shows_pooling) in [
            (Budget::Samples(16), usize::MAX, 4000, true),
            (Budget::Seconds(1.0), 14, 1000, false),
        ] {
            let (mut sum, mut squares, mut pooled) = (0.0, 0.0, 0.0);
            let mut spread = [u64::MAX, 0];
            for seed in 0..runs {
                let film = render(&mut schedule(budget), rounds, seed);
                // The second tile's 8 pixels.
                let mean = (32..40).map(|pixel| film.mean(pixel)[0]).sum::<f64>() / 8.0;
                sum += mean - 2.0;
                squares += (mean - 2.0).powi(2);
                let taken = film.samples(39);
                spread = [spread[0].min(taken), spread[1].max(taken)];
                // All samples thrown together, as should not be done.
                let halves = || [0, 1].into_iter().flat_map(|half| &film.half(half)[32..]);
                let total: f64 = halves().map(|p| p.mean()[0] * p.samples as f64).sum();
                let count: f64 = halves().map(|p| p.samples as f64).sum();
                pooled += total / count - 2.0;
            }
            let n = runs as f64;
            let error = squares.sqrt();
            assert!(spread[1] >= 2 * spread[0], "{budget:?}: {spread:?} samples");
            assert!((sum / error).abs() < 4.0, "{budget:?}: bias {}", sum / n);
            let z = pooled / error;
            assert!(z < -6.0 || !shows_pooling, "no power: z = {z}");
        }
    }
}
