//! Three-vectors of lanes, also used for RGB.

use std::ops::{Add, Mul, Neg, Sub};

use super::lanes::{F32s, Mask, U32s, from_bits, to_bits};

/// A vector (or RGB triple) per lane.
#[derive(Debug, Clone, Copy)]
pub struct Vec3s {
    /// x, or red.
    pub x: F32s,
    /// y, or green.
    pub y: F32s,
    /// z, or blue.
    pub z: F32s,
}

impl Vec3s {
    /// Components per lane.
    #[inline(always)]
    pub fn new(x: F32s, y: F32s, z: F32s) -> Self {
        Self { x, y, z }
    }

    /// The same vector in every lane.
    #[inline(always)]
    pub fn splat(v: [f32; 3]) -> Self {
        Self::new(F32s::splat(v[0]), F32s::splat(v[1]), F32s::splat(v[2]))
    }

    /// Zero in every lane.
    #[inline(always)]
    pub fn zero() -> Self {
        Self::splat([0.0; 3])
    }

    /// Scalar product, with fused multiply-add where the machine has it.
    #[inline(always)]
    pub fn dot(self, rhs: Self) -> F32s {
        self.x.mul_add(rhs.x, self.y.mul_add(rhs.y, self.z * rhs.z))
    }

    /// Vector product.
    #[inline(always)]
    pub fn cross(self, rhs: Self) -> Self {
        Self::new(
            self.y.mul_sub(rhs.z, self.z * rhs.y),
            self.z.mul_sub(rhs.x, self.x * rhs.z),
            self.x.mul_sub(rhs.y, self.y * rhs.x),
        )
    }

    /// Squared length.
    #[inline(always)]
    pub fn length_squared(self) -> F32s {
        self.dot(self)
    }

    /// Scaled to unit length (NaN for zero).
    #[inline(always)]
    pub fn normalize(self) -> Self {
        self * (F32s::splat(1.0) / self.length_squared().sqrt())
    }

    /// `self + scale·v`, fused.
    #[inline(always)]
    pub fn add_scaled(self, v: Self, scale: F32s) -> Self {
        Self::new(
            v.x.mul_add(scale, self.x),
            v.y.mul_add(scale, self.y),
            v.z.mul_add(scale, self.z),
        )
    }

    /// [`Self::add_scaled`] where the two nearly cancel: the products are not rounded before they are added, without
    /// fused multiplication either (Dekker, "A Floating-Point Technique for Extending the Available
    /// Precision", 1971: halves of 12 bits, whose products are exact).
    #[inline(always)]
    pub fn add_scaled_exactly(self, v: Self, scale: F32s) -> Self {
        if cfg!(target_feature = "fma") {
            return self.add_scaled(v, scale);
        }
        let halves = |x: F32s| {
            let high = from_bits(to_bits(x) & U32s::splat(0xffff_f000));
            (high, x - high)
        };
        let (high, low) = halves(scale);
        let add = |a: F32s, x: F32s| {
            let (x_high, x_low) = halves(x);
            a + high * x_high + (high * x_low + low * x_high) + low * x_low
        };
        Self::new(add(self.x, v.x), add(self.y, v.y), add(self.z, v.z))
    }

    /// Component-wise product.
    #[inline(always)]
    pub fn mul_elem(self, rhs: Self) -> Self {
        Self::new(self.x * rhs.x, self.y * rhs.y, self.z * rhs.z)
    }

    /// Component-wise absolute value.
    #[inline(always)]
    pub fn abs(self) -> Self {
        Self::new(self.x.abs(), self.y.abs(), self.z.abs())
    }

    /// Largest component.
    #[inline(always)]
    pub fn max_elem(self) -> F32s {
        self.x.fast_max(self.y).fast_max(self.z)
    }

    /// `yes` where set, else `no`.
    #[inline(always)]
    pub fn select(mask: Mask, yes: Self, no: Self) -> Self {
        Self::new(
            mask.select(yes.x, no.x),
            mask.select(yes.y, no.y),
            mask.select(yes.z, no.z),
        )
    }
}

impl Add for Vec3s {
    type Output = Self;
    #[inline(always)]
    fn add(self, rhs: Self) -> Self {
        Self::new(self.x + rhs.x, self.y + rhs.y, self.z + rhs.z)
    }
}

impl Sub for Vec3s {
    type Output = Self;
    #[inline(always)]
    fn sub(self, rhs: Self) -> Self {
        Self::new(self.x - rhs.x, self.y - rhs.y, self.z - rhs.z)
    }
}

impl Mul<F32s> for Vec3s {
    type Output = Self;
    #[inline(always)]
    fn mul(self, rhs: F32s) -> Self {
        Self::new(self.x * rhs, self.y * rhs, self.z * rhs)
    }
}

impl Neg for Vec3s {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(-self.x, -self.y, -self.z)
    }
}
