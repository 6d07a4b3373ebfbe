//! Read-only columns that lanes look numbers up in.

use wide::ShuffleExt;

use super::lanes::{F32s, LANES, U32s, gather, gather_u32};

/// Entries that fit the two registers of a permutation.
const MOST_IN_REGISTERS: usize = 2 * LANES;

/// A column of f32 or u32. Up to twice [`LANES`] entries are looked up by permuting two registers,
/// a tenth of the time of a gather from memory; tiny scenes have few enough of everything.
#[derive(Debug, Clone)]
pub struct Table<T: Entry> {
    values: Vec<T>,
    registers: [T::Lanes; 2],
}

/// What a [`Table`] can hold.
pub trait Entry: bytemuck::Pod + Default {
    /// [`LANES`] entries.
    type Lanes: bytemuck::Pod + std::fmt::Debug;

    /// Permutation of two registers; what an index past their end gives is unspecified.
    fn permute(registers: [Self::Lanes; 2], index: U32s) -> Self::Lanes;

    /// Gather from memory; an index past the end gives the last entry.
    fn gather(values: &[Self], index: U32s) -> Self::Lanes;
}

impl Entry for f32 {
    type Lanes = F32s;

    #[inline(always)]
    fn permute(registers: [F32s; 2], index: U32s) -> F32s {
        registers.shuffle(index)
    }

    #[inline(always)]
    fn gather(values: &[Self], index: U32s) -> F32s {
        gather(values, index)
    }
}

impl Entry for u32 {
    type Lanes = U32s;

    #[inline(always)]
    fn permute(registers: [U32s; 2], index: U32s) -> U32s {
        registers.shuffle(index)
    }

    #[inline(always)]
    fn gather(values: &[Self], index: U32s) -> U32s {
        gather_u32(values, index)
    }
}

impl<T: Entry> Table<T> {
    /// Appends an entry.
    pub fn push(&mut self, value: T) {
        let at = self.values.len();
        if at < MOST_IN_REGISTERS {
            bytemuck::cast_slice_mut::<T::Lanes, T>(&mut self.registers)[at] = value;
        }
        self.values.push(value);
    }

    /// The entries at `index`; an index past the end gives any number.
    ///
    /// # Panics
    /// If the table is empty.
    #[inline(always)]
    pub fn get(&self, index: U32s) -> T::Lanes {
        if self.values.len() <= MOST_IN_REGISTERS {
            T::permute(self.registers, index)
        } else {
            T::gather(&self.values, index)
        }
    }
}

impl<T: Entry> Default for Table<T> {
    fn default() -> Self {
        Self {
            values: Vec::new(),
            registers: bytemuck::Zeroable::zeroed(),
        }
    }
}

impl<T: Entry> std::ops::Deref for Table<T> {
    type Target = [T];
    fn deref(&self) -> &[T] {
        &self.values
    }
}

impl<T: Entry> FromIterator<T> for Table<T> {
    fn from_iter<I: IntoIterator<Item = T>>(values: I) -> Self {
        let mut table = Self::default();
        values.into_iter().for_each(|value| table.push(value));
        table
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::lanes::iota;

    #[test]
    fn lookups_equal_the_slice_at_every_size_around_the_registers() {
        for size in [
            1,
            LANES - 1,
            LANES,
            LANES + 1,
            2 * LANES,
            2 * LANES + 1,
            100,
        ] {
            let numbers: Table<f32> = (0..size).map(|i| 10.0 + i as f32).collect();
            let bits: Table<u32> = (0..size).map(|i| 1000 * i as u32).collect();
            for start in 0..size as u32 {
                let index = U32s::from(
                    (iota() * U32s::splat(7) + U32s::splat(start))
                        .to_array()
                        .map(|i| i % size as u32),
                );
                let (a, b) = (numbers.get(index).to_array(), bits.get(index).to_array());
                for (lane, i) in index.to_array().into_iter().enumerate() {
                    assert_eq!(a[lane], numbers[i as usize]);
                    assert_eq!(b[lane], bits[i as usize]);
                }
            }
        }
    }
}
