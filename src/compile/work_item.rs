//! The unit of everything: one tile of the image times one block of samples.

use crate::math::F32s;
use crate::math::lanes::{U32s, to_f32, to_u32};

/// Side of a tile in pixels.
pub const TILE: u32 = 32;

/// One tile times one block of samples. Its result depends on nothing but (scene, settings, seed,
/// tile, block).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WorkItem {
    /// Left edge, pixels.
    pub x: u32,
    /// Top edge, pixels.
    pub y: u32,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Width of the whole image.
    pub image_width: u32,
    /// Number of the block.
    pub block: u64,
    /// First sample of the block.
    pub first_sample: u64,
    /// Samples per pixel in the block.
    pub samples: u32,
}

/// Bit of the numbers of blocks and samples that belong to the second half of a film in two halves: so all
/// their random numbers are unrelated to those of the first.
const SECOND_HALF: u64 = 1 << 63;

impl WorkItem {
    /// The item as one of half 0 or half 1 of the film.
    pub fn in_half(self, half: usize) -> Self {
        let bit = if half == 1 { SECOND_HALF } else { 0 };
        Self {
            block: self.block | bit,
            first_sample: self.first_sample | bit,
            ..self
        }
    }

    /// The half of the film that the item belongs to; 0 of a whole film.
    pub fn half(&self) -> usize {
        usize::from(self.block & SECOND_HALF != 0)
    }

    /// Pixels in the tile.
    pub fn pixels(&self) -> u32 {
        self.width * self.height
    }

    /// Paths: path p is sample `p % samples` of the tile's pixel `p / samples`, so that the lanes
    /// of a vector look through the same pixel or its neighbours.
    pub fn paths(&self) -> u32 {
        self.pixels() * self.samples
    }

    /// (x, y) in the image and the sample's number in the block, for each path.
    #[inline(always)]
    pub fn locate(&self, path: U32s) -> (U32s, U32s, U32s) {
        let pixel = divide(path, self.samples);
        let row = divide(pixel, self.width);
        let column = pixel - row * U32s::splat(self.width);
        let sample = path - pixel * U32s::splat(self.samples);
        (
            U32s::splat(self.x) + column,
            U32s::splat(self.y) + row,
            sample,
        )
    }

    /// Index in the image of the tile's pixel `pixel`.
    pub fn image_index(&self, pixel: u32) -> usize {
        let (x, y) = (self.x + pixel % self.width, self.y + pixel / self.width);
        y as usize * self.image_width as usize + x as usize
    }
}

/// `n / d` rounded down, exact for n < 2^21: (n + ½)/d is at least ½/d away from an integer, and
/// its relative error in f32 is below 2^-22.
#[inline(always)]
fn divide(n: U32s, d: u32) -> U32s {
    to_u32((to_f32(n) + F32s::splat(0.5)) * F32s::splat(1.0 / d as f32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::lanes::{LANES, iota};

    #[test]
    fn division_by_multiplication_is_exact_over_its_range() {
        for d in (1..70).chain([255, 256, 257, 1000]) {
            for n in (0..1 << 21).step_by(LANES * 7) {
                let got = divide(U32s::splat(n) + iota(), d).to_array();
                for (lane, q) in got.into_iter().enumerate() {
                    assert_eq!(q, (n + lane as u32) / d);
                }
            }
        }
    }

    #[test]
    fn paths_cover_every_sample_of_every_pixel_once() {
        let item = WorkItem {
            x: 32,
            y: 48,
            width: 13,
            height: 5,
            image_width: 45,
            block: 2,
            first_sample: 14,
            samples: 7,
        };
        let mut seen = std::collections::HashSet::new();
        for path in 0..item.paths() {
            let (x, y, s) = item.locate(U32s::splat(path));
            let (x, y, s) = (x.to_array()[0], y.to_array()[0], s.to_array()[0]);
            assert!((32..45).contains(&x) && (48..53).contains(&y) && s < 7);
            assert!(seen.insert((x, y, s)));
            assert_eq!(item.image_index(path / 7), (y * 45 + x) as usize);
        }
        assert_eq!(seen.len(), item.paths() as usize);
    }
}
