//! The slab test of a ray against axis-aligned boxes: planes chosen by the sign bit of the reciprocal
//! direction, NaN (0·∞) dropped, the far side padded so that no box is missed by rounding (Ize, "Robust
//! BVH Ray Traversal", Journal of Computer Graphics Techniques 2(2), 2013).

use wide::f32x8;

use crate::math::float::gamma;
use crate::math::lanes::FloatLanes;

/// Factor on the far distance that covers the three roundings of each of two plane distances.
pub const FAR_PADDING: f32 = 1.0 + 2.0 * gamma(3);

/// An axis-aligned box: lower and upper corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Lower corner, then upper corner.
    pub corners: [[f32; 3]; 2],
}

impl Bounds {
    /// Contains nothing; the identity of [`Self::union`].
    pub const EMPTY: Self = Self {
        corners: [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]],
    };

    /// The smallest box around both.
    pub fn union(&self, other: &Self) -> Self {
        let [a, b] = [&self.corners, &other.corners];
        Self {
            corners: [
                [0, 1, 2].map(|k| a[0][k].min(b[0][k])),
                [0, 1, 2].map(|k| a[1][k].max(b[1][k])),
            ],
        }
    }

    /// The smallest box around points.
    pub fn of(points: &[[f32; 3]]) -> Self {
        points.iter().fold(Self::EMPTY, |bounds, &p| {
            bounds.union(&Self { corners: [p, p] })
        })
    }

    /// Length of the longest side.
    pub fn longest_side(&self) -> f32 {
        let sides = [0, 1, 2].map(|k| self.corners[1][k] - self.corners[0][k]);
        sides.into_iter().fold(0.0, f32::max)
    }

    /// Half of the surface area.
    pub fn half_area(&self) -> f32 {
        let [x, y, z] = [0, 1, 2].map(|k| self.corners[1][k] - self.corners[0][k]);
        x * y + y * z + z * x
    }
}

/// Eight boxes: `planes[side][axis]` with side 0 the lower planes. Unused slots hold NaN-free empty boxes.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(32))]
pub struct Bounds8 {
    /// Lower planes of the three axes, then upper planes.
    pub planes: [[[f32; 8]; 3]; 2],
}

impl Bounds8 {
    /// Up to eight boxes; the rest are empty and never hit.
    pub fn new(boxes: &[Bounds]) -> Self {
        let mut planes = [[[f32::INFINITY; 8]; 3], [[f32::NEG_INFINITY; 8]; 3]];
        for (slot, bounds) in boxes.iter().enumerate() {
            for (side, axes) in planes.iter_mut().enumerate() {
                for (axis, column) in axes.iter_mut().enumerate() {
                    column[slot] = bounds.corners[side][axis];
                }
            }
        }
        Self { planes }
    }
}

/// A ray prepared for slab tests.
#[derive(Debug, Clone, Copy)]
pub struct SlabRay {
    origin: [f32; 3],
    /// IEEE reciprocals, ±∞ for ±0.
    reciprocal: [f32; 3],
    /// 1 where the reciprocal's sign bit is set: the side on which the ray enters.
    enter: [usize; 3],
}

impl SlabRay {
    /// Prepares the ray.
    #[inline]
    pub fn new(origin: [f32; 3], direction: [f32; 3]) -> Self {
        let reciprocal = direction.map(|d| 1.0 / d);
        Self {
            origin,
            reciprocal,
            enter: reciprocal.map(|r| usize::from(r.is_sign_negative())),
        }
    }

    /// Distance at which the ray enters the box, ≥ 0, if it does so no later than at `t_max`.
    #[inline]
    pub fn enters(&self, bounds: &Bounds, t_max: f32) -> Option<f32> {
        let (mut t0, mut t1) = (0.0, t_max);
        for axis in 0..3 {
            let side = self.enter[axis];
            let near = (bounds.corners[side][axis] - self.origin[axis]) * self.reciprocal[axis];
            let far = (bounds.corners[1 - side][axis] - self.origin[axis])
                * self.reciprocal[axis]
                * FAR_PADDING;
            // Written so that NaN keeps the accumulator.
            t0 = if near > t0 { near } else { t0 };
            t1 = if far < t1 { far } else { t1 };
        }
        (t0 <= t1).then_some(t0)
    }

    /// [`Self::enters`] for eight boxes: one bit per box entered, and the distances.
    #[inline]
    pub fn enters8(&self, bounds: &Bounds8, t_max: f32) -> (u32, f32x8) {
        let (mut t0, mut t1) = (f32x8::splat(0.0), f32x8::splat(t_max));
        for axis in 0..3 {
            let side = self.enter[axis];
            let origin = f32x8::splat(self.origin[axis]);
            let reciprocal = f32x8::splat(self.reciprocal[axis]);
            let near = (f32x8::from(bounds.planes[side][axis]) - origin) * reciprocal;
            let far = (f32x8::from(bounds.planes[1 - side][axis]) - origin)
                * reciprocal
                * f32x8::splat(FAR_PADDING);
            t0 = near.keep_max(t0);
            t1 = far.keep_min(t1);
        }
        (t0.simd_le(t1).to_bitmask(), t0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::testing::Rng;

    #[test]
    fn eight_boxes_at_once_answer_as_one_at_a_time() {
        let mut rng = Rng(7);
        let specials = [0.0f32, -0.0, 1e-44, -1e-7, 1.0, f32::MIN_POSITIVE];
        let mut hits = 0;
        for _ in 0..20_000 {
            let mut coordinate = || ((rng.uniform() - 0.5) * 8.0).round();
            let boxes: Vec<Bounds> = (0..7)
                .map(|_| {
                    let corner = |f: &mut dyn FnMut() -> f32| [f(), f(), f()];
                    Bounds::of(&[corner(&mut coordinate), corner(&mut coordinate)])
                })
                .collect();
            let origin = [coordinate(), coordinate(), coordinate()];
            let direction = [0, 1, 2].map(|_| match rng.uniform() {
                u if u < 0.5 => specials[(u * 2.0 * specials.len() as f32) as usize],
                u => u * 4.0 - 3.0,
            });
            let ray = SlabRay::new(origin, direction);
            let t_max = rng.uniform() * 10.0;
            let (mask, t) = ray.enters8(&Bounds8::new(&boxes), t_max);
            for (slot, bounds) in boxes.iter().enumerate() {
                let single = ray.enters(bounds, t_max);
                assert_eq!(single.is_some(), mask >> slot & 1 != 0);
                if let Some(single) = single {
                    assert_eq!(single, t.to_array()[slot]);
                    hits += 1;
                }
            }
            assert_eq!(mask >> 7, 0, "the empty slot is never entered");
        }
        assert!(hits > 1_000);
    }

    #[test]
    fn rays_within_a_face_of_a_flat_box_enter_it_whatever_the_sign_of_zero() {
        let flat = Bounds {
            corners: [[-1.0, -1.0, 2.0], [1.0, 1.0, 2.0]],
        };
        for zero in [0.0f32, -0.0] {
            for other in [0.0f32, -0.0] {
                assert_eq!(
                    SlabRay::new([1.0, -1.0, 0.0], [zero, other, 1.0]).enters(&flat, 9.0),
                    Some(2.0)
                );
                assert_eq!(
                    SlabRay::new([1.0, -1.0, 4.0], [zero, other, -1.0]).enters(&flat, 9.0),
                    Some(2.0)
                );
                assert_eq!(
                    SlabRay::new([-3.0, 1.0, 2.0], [1.0, zero, other]).enters(&flat, 9.0),
                    Some(2.0)
                );
                assert_eq!(
                    SlabRay::new([-3.0, 1.5, 2.0], [1.0, zero, other]).enters(&flat, 9.0),
                    None
                );
            }
        }
    }
}
