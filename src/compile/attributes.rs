//! Vertex attributes of triangles, for shading: three indices per triangle into shared values.

use crate::math::{Compare, F32s, Mask, Table, U32s};
use crate::scene::Mesh;

/// What the corners of triangles have, `N` numbers each. Without any such triangle there is no column.
#[derive(Debug, Clone)]
pub struct CornerAttributes<const N: usize> {
    /// Per corner, the entry of each primitive; [`Mesh::ABSENT`] where the primitive has none.
    corners: [Table<u32>; 3],
    /// The entries' numbers.
    values: [Table<f32>; N],
}

impl<const N: usize> Default for CornerAttributes<N> {
    fn default() -> Self {
        Self {
            corners: Default::default(),
            values: std::array::from_fn(|_| Table::default()),
        }
    }
}

impl<const N: usize> CornerAttributes<N> {
    /// Adds an entry and returns its index.
    pub(super) fn push_value(&mut self, value: [f32; N]) -> u32 {
        let index = self.len() as u32;
        for (column, value) in self.values.iter_mut().zip(value) {
            column.push(value);
        }
        index
    }

    /// Adds the entries of the next primitive's corners.
    pub(super) fn push_primitive(&mut self, entries: Option<[u32; 3]>) {
        let entries = entries.unwrap_or([Mesh::ABSENT; 3]);
        for (column, entry) in self.corners.iter_mut().zip(entries) {
            column.push(entry);
        }
    }

    /// Number of entries.
    pub fn len(&self) -> usize {
        self.values[0].len()
    }

    /// Whether no primitive has the attribute.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        3 * self.corners[0].len() * size_of::<u32>() + N * self.len() * size_of::<f32>()
    }

    /// Where the primitives have the attribute.
    #[inline(always)]
    pub fn present(&self, primitive: U32s) -> Mask {
        if self.is_empty() {
            return Mask::NONE;
        }
        !self.corners[0].get(primitive).eq(U32s::splat(Mesh::ABSENT))
    }

    /// As [`Self::present`], for one primitive.
    pub(super) fn is_present(&self, primitive: usize) -> bool {
        !self.is_empty() && self.corners[0][primitive] != Mesh::ABSENT
    }

    /// The numbers of one corner of the primitives; any where [`Self::present`] is not set.
    ///
    /// # Panics
    /// If no primitive has the attribute.
    #[inline(always)]
    pub fn corner(&self, corner: usize, primitive: U32s) -> [F32s; N] {
        let entry = self.corners[corner].get(primitive);
        std::array::from_fn(|k| self.values[k].get(entry))
    }
}

/// `normal` at unit length, or `None` if it is zero or not finite.
pub(super) fn unit(normal: [f32; 3]) -> Option<[f32; 3]> {
    // In f64, which has room for the square of every f32.
    let normal = glam::Vec3::from_array(normal).as_dvec3().try_normalize()?;
    Some(normal.as_vec3().to_array())
}

/// Finite texture coordinates: those beyond 2^24, where f32 has no fractions left, mean nothing and
/// become 0, as what is not a number does.
pub(super) fn sound_uv(uv: [f32; 2]) -> [f32; 2] {
    const MOST: f32 = 16_777_216.0;
    uv.map(|x| if x.abs() <= MOST { x } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_find_their_entries_and_primitives_without_have_none() {
        let mut attributes = CornerAttributes::<2>::default();
        assert_eq!(
            (attributes.bytes(), attributes.present(U32s::splat(0))),
            (0, Mask::NONE)
        );
        assert!(!attributes.is_present(0));
        for i in 0..100 {
            attributes.push_value([i as f32, 0.5 * i as f32]);
        }
        for i in 0..50 {
            attributes.push_primitive((i % 3 != 0).then_some([i, 2 * i, 99 - i]));
        }
        assert_eq!(attributes.bytes(), 50 * 12 + 100 * 8);
        for i in 0..50 {
            let primitive = U32s::splat(i);
            let present = attributes.present(primitive);
            assert_eq!(attributes.is_present(i as usize), !present.none());
            assert_eq!(present, if i % 3 == 0 { Mask::NONE } else { Mask::ALL });
            if i % 3 != 0 {
                let numbers = [0, 1, 2].map(|c| attributes.corner(c, primitive)[0].to_array()[0]);
                assert_eq!(numbers, [i, 2 * i, 99 - i].map(|x| x as f32));
            }
        }
    }

    #[test]
    fn unusable_values_are_told_apart() {
        assert_eq!(unit([0.0, 3e-45, 0.0]), Some([0.0, 1.0, 0.0]));
        assert_eq!(unit([0.0, 0.0, -3e38]), Some([0.0, 0.0, -1.0]));
        for bad in [[0.0; 3], [f32::NAN, 0.0, 1.0], [f32::INFINITY, 0.0, 0.0]] {
            assert_eq!(unit(bad), None);
        }
        assert_eq!(sound_uv([f32::NAN, f32::NEG_INFINITY]), [0.0; 2]);
        assert_eq!(sound_uv([-7.5, 1e30]), [-7.5, 0.0]);
    }
}
