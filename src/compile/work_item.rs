//! The unit of everything: one tile of the image times one block of samples.

use std::ops::{BitAnd, BitOr, Shr};

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

    /// Paths: path p is sample `p % samples` of the tile's pixel `p / samples`. Pixels of a whole tile are numbered
    /// along Morton's curve, x in the even bits: paths that follow one another look through a small square. A tile
    /// that is cut off is numbered row by row.
    pub fn paths(&self) -> u32 {
        self.pixels() * self.samples
    }

    /// (x, y) in the image and the sample's number in the block, for each path.
    #[inline(always)]
    pub fn locate(&self, path: U32s) -> (U32s, U32s, U32s) {
        let pixel = divide(path, self.samples);
        let (column, row) = if self.is_whole() {
            [pixel, pixel >> 1]
                .map(|bits| even_bits(bits, U32s::splat))
                .into()
        } else {
            let row = divide(pixel, self.width);
            (pixel - row * U32s::splat(self.width), row)
        };
        let sample = path - pixel * U32s::splat(self.samples);
        (
            U32s::splat(self.x) + column,
            U32s::splat(self.y) + row,
            sample,
        )
    }

    /// (x, y) in the image of the tile's pixel `pixel`.
    #[inline]
    pub fn position(&self, pixel: u32) -> (u32, u32) {
        let (column, row) = if self.is_whole() {
            [pixel, pixel >> 1]
                .map(|bits| even_bits(bits, |x| x))
                .into()
        } else {
            (pixel % self.width, pixel / self.width)
        };
        (self.x + column, self.y + row)
    }

    /// Index in the image of the tile's pixel `pixel`.
    #[inline]
    pub fn image_index(&self, pixel: u32) -> usize {
        let (x, y) = self.position(pixel);
        y as usize * self.image_width as usize + x as usize
    }

    /// Whether the image's edge cuts nothing off the tile.
    #[inline(always)]
    fn is_whole(&self) -> bool {
        self.width == TILE && self.height == TILE
    }
}

/// The bits at even places of a pixel's number in a whole tile, put together. `splat` makes a constant.
#[inline(always)]
fn even_bits<T>(number: T, splat: impl Fn(u32) -> T) -> T
where
    T: Copy + BitAnd<Output = T> + BitOr<Output = T> + Shr<u32, Output = T>,
{
    // Every other bit, pair and four.
    [(1, 0x133), (2, 0x10f), (4, TILE - 1)]
        .into_iter()
        .fold(number & splat(0x155), |x, (by, keep)| {
            (x | (x >> by)) & splat(keep)
        })
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
            image_width: 100,
            block: 2,
            first_sample: 14,
            samples: 7,
        };
        let whole = WorkItem {
            width: TILE,
            height: TILE,
            ..item
        };
        for item in [item, whole] {
            let columns = 32..32 + item.width;
            let rows = 48..48 + item.height;
            let mut seen = std::collections::HashSet::new();
            for path in 0..item.paths() {
                let (x, y, s) = item.locate(U32s::splat(path));
                let (x, y, s) = (x.to_array()[0], y.to_array()[0], s.to_array()[0]);
                assert!(columns.contains(&x) && rows.contains(&y) && s < 7);
                assert!(seen.insert((x, y, s)));
                assert_eq!(item.position(path / 7), (x, y));
                assert_eq!(item.image_index(path / 7), (y * 100 + x) as usize);
            }
            assert_eq!(seen.len(), item.paths() as usize);
        }
    }

    #[test]
    fn pixels_that_follow_one_another_are_in_a_square() {
        let item = WorkItem {
            x: 0,
            y: 0,
            width: TILE,
            height: TILE,
            image_width: TILE,
            block: 0,
            first_sample: 0,
            samples: 1,
        };
        for first in (0..item.pixels()).step_by(64) {
            let (x, y) = item.position(first);
            assert!(x % 8 == 0 && y % 8 == 0);
            for pixel in first..first + 64 {
                let (column, row) = item.position(pixel);
                assert!((x..x + 8).contains(&column) && (y..y + 8).contains(&row));
            }
        }
    }
}
