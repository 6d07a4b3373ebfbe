//! The one declaration form of queue items: fields once, as structure-of-arrays columns.

use bytemuck::Pod;

use crate::math::lanes::{F32s, LANES, Mask, U32s, compress, compress_u32, compress_u64, padded};

/// A column of a queue: cache-line aligned, padded with one spare vector of lanes so that whole
/// vectors may be read and written at any item. A column whose feature is absent is empty.
#[derive(Debug, Default)]
pub struct Column<T> {
    storage: Vec<F32s>,
    items: std::marker::PhantomData<T>,
}

/// What a column can hold.
pub trait Item: Pod {
    /// Appends the lanes of `mask` of `from[source ..]` at `to[target ..]`.
    fn compress(from: &[Self], source: usize, to: &mut [Self], target: usize, mask: Mask);
}

impl Item for f32 {
    #[inline(always)]
    fn compress(from: &[Self], source: usize, to: &mut [Self], target: usize, mask: Mask) {
        compress(to, target, mask, crate::math::lanes::load(from, source));
    }
}

impl Item for u32 {
    #[inline(always)]
    fn compress(from: &[Self], source: usize, to: &mut [Self], target: usize, mask: Mask) {
        compress_u32(to, target, mask, crate::math::lanes::load_u32(from, source));
    }
}

impl Item for u64 {
    #[inline(always)]
    fn compress(from: &[Self], source: usize, to: &mut [Self], target: usize, mask: Mask) {
        let lanes = from[source..source + LANES].try_into();
        compress_u64(to, target, mask, lanes.expect("slice has LANES items"));
    }
}

impl<T: Item> Column<T> {
    /// A column for `capacity` items, or an empty one.
    pub fn new(capacity: usize, present: bool) -> Self {
        let bytes = if present {
            (padded(capacity) + LANES) * size_of::<T>()
        } else {
            0
        };
        Self {
            storage: vec![F32s::splat(0.0); bytes / size_of::<F32s>()],
            items: std::marker::PhantomData,
        }
    }

    /// Whether the feature that needs the column is absent.
    #[inline(always)]
    pub fn is_absent(&self) -> bool {
        self.storage.is_empty()
    }

    /// Moves the lanes of `mask` of `from[source ..]` to `self[target ..]`, closing gaps.
    #[inline(always)]
    pub fn compress_from(&mut self, target: usize, from: &Self, source: usize, mask: Mask) {
        if !self.is_absent() {
            T::compress(from, source, self, target, mask);
        }
    }
}

impl<T: Item> std::ops::Deref for Column<T> {
    type Target = [T];
    #[inline(always)]
    fn deref(&self) -> &[T] {
        bytemuck::cast_slice(&self.storage)
    }
}

impl<T: Item> std::ops::DerefMut for Column<T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [T] {
        bytemuck::cast_slice_mut(&mut self.storage)
    }
}

const _: () = assert!(size_of::<F32s>() == 4 * LANES && size_of::<U32s>() == 4 * LANES);

/// Name, bytes and needed feature of a column, as a queue's declaration gives them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ColumnInfo {
    /// Field name.
    pub name: &'static str,
    /// Bytes per item.
    pub bytes: usize,
    /// Features of which at least one must be present (all bits set: always needed).
    pub needs: crate::compile::Features,
}

/// Declares a queue: a struct of [`Column`]s and a length, its allocation by features, stable
/// compaction of one chunk, and the list of its columns with their bytes.
macro_rules! soa {
    ($(#[$meta:meta])* pub struct $name:ident {
        $($(#[$field_meta:meta])* $field:ident : $item:ty $(, if $needs:expr)?;)*
    }) => {
        $(#[$meta])*
        #[derive(Debug)]
        pub struct $name {
            /// Items in the queue.
            pub len: usize,
            $($(#[$field_meta])* pub $field: $crate::wave::soa::Column<$item>,)*
        }

        impl $name {
            /// Every column with its bytes per item and the features that need it.
            pub const COLUMNS: &'static [$crate::wave::soa::ColumnInfo] = &[$(
                $crate::wave::soa::ColumnInfo {
                    name: stringify!($field),
                    bytes: size_of::<$item>(),
                    needs: soa!(@needs $($needs)?),
                },
            )*];

            /// An empty queue for `capacity` items with the columns that `features` need.
            pub fn new(capacity: usize, features: $crate::compile::Features) -> Self {
                Self {
                    len: 0,
                    $($field: $crate::wave::soa::Column::new(
                        capacity,
                        features.require(soa!(@needs $($needs)?)),
                    ),)*
                }
            }

            /// Bytes per item with these features.
            pub fn bytes_per_item(features: $crate::compile::Features) -> usize {
                Self::COLUMNS.iter().filter(|c| features.require(c.needs)).map(|c| c.bytes).sum()
            }

            /// Appends the lanes of `mask` of `from`'s items `source ..` in order, without gaps.
            #[allow(dead_code, reason = "not every queue is compacted from another")]
            #[inline(always)]
            pub fn append_lanes(&mut self, from: &Self, source: usize, mask: $crate::math::Mask) {
                $(self.$field.compress_from(self.len, &from.$field, source, mask);)*
                self.len += mask.count();
            }
        }
    };
    (@needs) => { $crate::compile::Features::all() };
    (@needs $needs:expr) => { $needs };
}
pub(crate) use soa;

#[cfg(test)]
#[allow(unreachable_pub, reason = "the macro declares public queues")]
mod tests {
    use super::*;
    use crate::compile::Features;

    soa! {
        /// A queue for this test.
        pub struct Sample {
            /// Always there.
            always: f32;
            /// With MIS only.
            sometimes: u32, if Features::MIS;
            /// Wide.
            long: u64;
        }
    }

    #[test]
    fn absent_columns_take_no_bytes_and_survivors_keep_their_order() {
        let lean = Features::TRIANGLES;
        let full = Features::TRIANGLES | Features::MIS;
        assert_eq!(Sample::bytes_per_item(lean), 12);
        assert_eq!(Sample::bytes_per_item(full), 16);
        assert!(Sample::new(100, lean).sometimes.is_absent());
        // A scene that needs nothing still has rays.
        assert_eq!(Sample::bytes_per_item(Features::default()), 12);
        assert!(!Sample::new(100, Features::default()).always.is_absent());
        let mut from = Sample::new(100, full);
        for i in 0..100 {
            from.always[i] = i as f32;
            from.sometimes[i] = i as u32;
            from.long[i] = (i as u64) << 40;
        }
        let mut to = Sample::new(100, full);
        let mask = Mask(0b1010_0101);
        to.append_lanes(&from, 16, mask);
        to.append_lanes(&from, 32, mask);
        assert_eq!(to.len, 8);
        assert_eq!(
            to.always[..8],
            [16.0, 18.0, 21.0, 23.0, 32.0, 34.0, 37.0, 39.0]
        );
        assert_eq!(to.sometimes[4..8], [32, 34, 37, 39]);
        assert_eq!(to.long[7], 39 << 40);
    }
}
