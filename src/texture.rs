//! Textures: every picture of a scene in one table of texels, looked up by lanes.
//!
//! A texel is three bytes with the sRGB curve. Lookups are bilinear between the centres of texels, in
//! linear RGB, and repeat in both directions.

use crate::error::{Error, Result};
use crate::math::lanes::{F32s, Mask, U32s, gather_u32, to_f32, to_u32};
use crate::math::{Compare, Table, Vec3s};

/// Most texels of a scene: lanes index them with 31 bits.
const MOST_TEXELS: usize = 1 << 31;

/// Most texels across or down: the whole numbers that f32 counts without gaps.
const MOST_SIDE: u32 = 1 << 24;

/// The textures of a scene, by index.
#[derive(Debug, Clone)]
pub struct TextureTable {
    /// Of all textures, rows from the top: red, green and blue from the lowest byte up.
    texels: Vec<u32>,
    /// First texel per texture.
    first: Table<u32>,
    /// Texels across.
    width: Table<u32>,
    /// Texels down.
    height: Table<u32>,
    /// Linear value of each byte.
    linear: Table<f32>,
}

impl Default for TextureTable {
    fn default() -> Self {
        Self {
            texels: Vec::new(),
            first: Table::default(),
            width: Table::default(),
            height: Table::default(),
            linear: (0..=255).map(|byte| linear(byte) as f32).collect(),
        }
    }
}

/// The linear value of an sRGB byte, in [0, 1] (IEC 61966-2-1).
fn linear(byte: u8) -> f64 {
    let encoded = f64::from(byte) / 255.0;
    if encoded <= 0.04045 {
        encoded / 12.92
    } else {
        ((encoded + 0.055) / 1.055).powf(2.4)
    }
}

impl TextureTable {
    /// No texture, where an index is expected.
    pub const NONE: u32 = u32::MAX;

    /// Adds a picture of `width` × `height` texels, rows from the top, sRGB; returns its index.
    ///
    /// # Errors
    /// If all textures together have too many texels.
    ///
    /// # Panics
    /// If there are not `width`·`height` > 0 texels.
    pub fn push(&mut self, width: u32, height: u32, texels: &[[u8; 3]]) -> Result<u32> {
        assert!(!texels.is_empty() && texels.len() as u64 == u64::from(width) * u64::from(height));
        if self.texels.len() + texels.len() > MOST_TEXELS || width.max(height) > MOST_SIDE {
            return Err(Error::limit(
                "the textures of a scene may have at most 2^31 texels, and 2^24 a side",
            ));
        }
        let index = self.first.len() as u32;
        self.first.push(self.texels.len() as u32);
        self.width.push(width);
        self.height.push(height);
        let packed = texels
            .iter()
            .map(|&[r, g, b]| u32::from_le_bytes([r, g, b, 0]));
        self.texels.extend(packed);
        Ok(index)
    }

    /// Number of textures.
    pub fn len(&self) -> usize {
        self.first.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes held by the texels.
    pub fn bytes(&self) -> usize {
        self.texels.len() * size_of::<u32>()
    }

    /// Linear RGB in [0, 1] at finite coordinates, u to the right and v up, one unit per repetition;
    /// white in the lanes that are not in `mask`.
    #[inline(always)]
    pub fn look_up(&self, texture: U32s, [u, v]: [F32s; 2], mask: Mask) -> Vec3s {
        let white = Vec3s::splat([1.0; 3]);
        if mask.none() {
            return white;
        }
        let (columns, x) = texel_pair(u, self.width.get(texture));
        // Rows are counted down.
        let (rows, y) = texel_pair(-v, self.height.get(texture));
        let first = self.first.get(texture);
        let width = self.width.get(texture);
        let [top, bottom] = rows.map(|row| {
            let row = first + row * width;
            let [left, right] = columns.map(|column| self.texel(row + column));
            left.add_scaled(right - left, x)
        });
        Vec3s::select(mask, top.add_scaled(bottom - top, y), white)
    }

    #[inline(always)]
    fn texel(&self, index: U32s) -> Vec3s {
        let texel = gather_u32(&self.texels, index);
        let channel = |shift: u32| self.linear.get((texel >> shift) & U32s::splat(255));
        Vec3s::new(channel(0), channel(8), channel(16))
    }
}

/// The texels before and after coordinate `u` along a side of `size` texels, and how far `u` is from
/// the centre of the one to that of the other, in [0, 1).
#[inline(always)]
fn texel_pair(u: F32s, size: U32s) -> ([U32s; 2], F32s) {
    let one = U32s::splat(1);
    // In [0, 1]; rounding reaches 1 from below 0, which the second repetition's first texel continues.
    let within = u - u.floor();
    // Centres lie at half texels; one more keeps the number positive.
    let shifted = within.mul_add(to_f32(size), F32s::splat(0.5));
    let after = to_u32(shifted);
    let share = shifted - to_f32(after);
    let last = size - one;
    let before = after.eq(U32s::splat(0)).select_u32(last, after - one);
    let after = after.lt(size).select_u32(after, U32s::splat(0));
    ([before.min(last), after], share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::testing::Uniform;

    fn at(table: &TextureTable, texture: u32, u: f32, v: f32) -> [f64; 3] {
        let coordinates = [u, v].map(F32s::splat);
        table
            .look_up(U32s::splat(texture), coordinates, Mask::ALL)
            .to_lanes()[0]
    }

    /// A random picture after one of another size.
    fn table(width: u32, height: u32) -> (TextureTable, Vec<[u8; 3]>) {
        let mut random = Uniform::new(u64::from(width * 31 + height));
        let texels: Vec<[u8; 3]> = (0..width * height)
            .map(|_| [(); 3].map(|()| (random.next() * 256.0) as u8))
            .collect();
        let mut table = TextureTable::default();
        table.push(1, 2, &[[9, 80, 200]; 2]).expect("few texels");
        assert_eq!(table.push(width, height, &texels).expect("few texels"), 1);
        (table, texels)
    }

    #[test]
    fn centres_of_texels_show_their_linear_values_in_every_repetition() {
        for (width, height) in [(1, 1), (2, 3), (5, 4), (300, 7)] {
            let (table, texels) = table(width, height);
            for (i, texel) in texels.iter().enumerate() {
                let (x, y) = (i as u32 % width, i as u32 / width);
                let u = (f64::from(x) + 0.5) / f64::from(width);
                let v = 1.0 - (f64::from(y) + 0.5) / f64::from(height);
                for (shift_u, shift_v) in [(0.0, 0.0), (1.0, -2.0), (-3.0, 5.0)] {
                    let got = at(&table, 1, (u + shift_u) as f32, (v + shift_v) as f32);
                    for (got, &byte) in got.into_iter().zip(texel) {
                        // Coordinates of a few units are off by some 1e-7, hence by that many texels.
                        let tolerance = 1e-6 * f64::from(width.max(height)) + 1e-6;
                        assert!((got - linear(byte)).abs() < tolerance, "{got} for {byte}");
                    }
                }
            }
        }
    }

    #[test]
    fn between_centres_values_are_bilinear_and_wrap_around_the_edges() {
        let (width, height) = (4, 3);
        let (table, texels) = table(width, height);
        let mut random = Uniform::new(5);
        for _ in 0..2000 {
            let (u, v) = (random.next() * 4.0 - 2.0, random.next() * 4.0 - 2.0);
            let x = (u as f32 as f64) * f64::from(width) - 0.5;
            let y = -(v as f32 as f64) * f64::from(height) - 0.5;
            let texel = |dx: f64, dy: f64| {
                let column = (x.floor() + dx).rem_euclid(f64::from(width)) as usize;
                let row = (y.floor() + dy).rem_euclid(f64::from(height)) as usize;
                texels[row * width as usize + column].map(linear)
            };
            let (fx, fy) = (x - x.floor(), y - y.floor());
            let got = at(&table, 1, u as f32, v as f32);
            for (channel, got) in got.into_iter().enumerate() {
                let mix = |dy| texel(0.0, dy)[channel] * (1.0 - fx) + texel(1.0, dy)[channel] * fx;
                let exact = mix(0.0) * (1.0 - fy) + mix(1.0) * fy;
                assert!((got - exact).abs() < 5e-6, "({u}, {v}): {got}, not {exact}");
            }
        }
    }

    #[test]
    fn any_finite_coordinate_stays_in_its_picture() {
        let mut table = TextureTable::default();
        table.push(3, 2, &[[255; 3]; 6]).expect("few texels");
        table.push(2, 2, &[[0; 3]; 4]).expect("few texels");
        for u in [
            0.0,
            -0.0,
            1.0,
            -1e-10,
            1.0 - 6e-8,
            0.5,
            1e7,
            -1e7,
            3e38,
            -3e38,
            1e-45,
        ] {
            for v in [0.0, 1.0, -1e-10, 1.0 - 6e-8, 1e30] {
                assert_eq!(at(&table, 0, u, v), [1.0; 3], "({u}, {v})");
                assert_eq!(at(&table, 0, v, u), [1.0; 3], "({v}, {u})");
            }
        }
        // Lanes without a texture are white, whatever else they hold.
        let nowhere = [f32::NAN, 1.0].map(F32s::splat);
        let value = table.look_up(
            U32s::splat(TextureTable::NONE),
            nowhere,
            Mask(1) & !Mask::ALL,
        );
        assert_eq!(value.to_lanes()[0], [1.0; 3]);
    }

    #[test]
    fn more_texels_than_lanes_can_index_are_an_error() {
        let mut table = TextureTable::default();
        assert!(
            table
                .push(MOST_SIDE + 1, 1, &vec![[0; 3]; MOST_SIDE as usize + 1])
                .is_err()
        );
    }
}
