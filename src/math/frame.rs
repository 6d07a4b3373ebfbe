//! Orthonormal frames about a normal.

use super::lanes::{F32s, U32s, from_bits, to_bits};
use super::vec3::Vec3s;

/// A right-handed orthonormal frame per lane: tangent × bitangent = normal.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// x axis, unit length.
    pub tangent: Vec3s,
    /// y axis, unit length.
    pub bitangent: Vec3s,
    /// z axis, unit length.
    pub normal: Vec3s,
}

impl Frame {
    /// A frame with z along `normal`, which must be of unit length.
    ///
    /// Without a singular direction: the sign of the normal's z picks the pole that is far away
    /// (Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017, listing 3).
    #[inline(always)]
    pub fn from_normal(normal: Vec3s) -> Self {
        let sign_bit = to_bits(normal.z) & U32s::splat(0x8000_0000);
        let with_sign = |v: F32s| from_bits(to_bits(v) ^ sign_bit);
        let one = F32s::splat(1.0);
        let sign = with_sign(one);
        let a = F32s::splat(-1.0) / (sign + normal.z);
        let b = normal.x * normal.y * a;
        Self {
            tangent: Vec3s::new(
                with_sign(normal.x * normal.x * a) + one,
                with_sign(b),
                -with_sign(normal.x),
            ),
            bitangent: Vec3s::new(b, (normal.y * normal.y).mul_add(a, sign), -normal.y),
            normal,
        }
    }

    /// Components of the world vector `v` along the axes.
    #[inline(always)]
    pub fn to_local(&self, v: Vec3s) -> Vec3s {
        Vec3s::new(
            v.dot(self.tangent),
            v.dot(self.bitangent),
            v.dot(self.normal),
        )
    }

    /// The world vector with components `v` along the axes.
    #[inline(always)]
    pub fn to_world(&self, v: Vec3s) -> Vec3s {
        (self.tangent * v.x)
            .add_scaled(self.bitangent, v.y)
            .add_scaled(self.normal, v.z)
    }
}

/// `v`, of almost unit length, one Newton step nearer to unit length: an error of e becomes 3e²/2.
///
/// Specular chains map one direction to the next; without this, the rounding of their lengths adds up.
#[inline(always)]
pub fn renormalize(v: Vec3s) -> Vec3s {
    v * v
        .length_squared()
        .mul_neg_add(F32s::splat(0.5), F32s::splat(1.5))
}

#[cfg(test)]
mod tests {
    use super::super::lanes::LANES;
    use super::super::testing::{Uniform, direction};
    use super::*;

    /// Normals over the sphere, half of them within 1e-8 to 0.1 of −z, and the hard ones of Duff et al.
    fn normals() -> Vec<[f64; 3]> {
        let mut random = Uniform::new(1);
        let mut normals: Vec<[f64; 3]> = (0..100_000)
            .map(|i| {
                let phi = std::f64::consts::TAU * random.next();
                if i % 2 == 0 {
                    direction(random.next() * 2.0 - 1.0, phi)
                } else {
                    let sin = 10f64.powf(-1.0 - 7.0 * random.next());
                    [sin * phi.cos(), sin * phi.sin(), -(1.0 - sin * sin).sqrt()]
                }
            })
            .collect();
        normals.extend([
            [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
            [-0.0, 0.0, -1.0],
            [1.0, 0.0, 0.0],
            [0.0, -1.0, -0.0],
            [0.00038527316, 0.00038460016, -0.99999988079],
            [-0.00019813581, -0.00008946839, -0.99999988079],
        ]);
        normals
    }

    #[test]
    fn axes_are_orthonormal_and_right_handed_for_every_normal() {
        for chunk in normals().chunks(LANES) {
            let mut padded = chunk.to_vec();
            padded.resize(LANES, [0.0, 0.0, 1.0]);
            let frame = Frame::from_normal(Vec3s::from_lanes(&padded));
            let [t, b, n] = [frame.tangent, frame.bitangent, frame.normal].map(Vec3s::to_lanes);
            for lane in 0..LANES {
                let dot = |u: [f64; 3], v: [f64; 3]| u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
                let (t, b, n) = (t[lane], b[lane], n[lane]);
                let cross = [
                    t[1] * b[2] - t[2] * b[1],
                    t[2] * b[0] - t[0] * b[2],
                    t[0] * b[1] - t[1] * b[0],
                ];
                let errors = [
                    dot(t, b),
                    dot(b, n),
                    dot(t, n),
                    dot(t, t) - 1.0,
                    dot(b, b) - 1.0,
                    dot(cross, n) - 1.0,
                ];
                assert!(errors.iter().all(|e| e.abs() < 5e-7), "{n:?}: {errors:?}");
            }
        }
    }

    #[test]
    fn local_and_world_are_inverse() {
        let mut random = Uniform::new(2);
        for _ in 0..1000 {
            let mut directions = || -> Vec<[f64; 3]> {
                (0..LANES)
                    .map(|_| direction(random.next() * 2.0 - 1.0, 6.0 * random.next()))
                    .collect()
            };
            let frame = Frame::from_normal(Vec3s::from_lanes(&directions()));
            let v = directions();
            let back = frame
                .to_world(frame.to_local(Vec3s::from_lanes(&v)))
                .to_lanes();
            for (v, back) in v.iter().zip(back) {
                assert!(
                    (0..3).all(|k| (v[k] - back[k]).abs() < 1e-6),
                    "{v:?} came back as {back:?}"
                );
            }
        }
    }

    #[test]
    fn renormalizing_keeps_the_length_of_a_million_bounces() {
        let mut v = Vec3s::splat([0.6, 0.0, 0.8]);
        let frame = Frame::from_normal(Vec3s::splat([0.36, 0.48, -0.8]));
        for _ in 0..1_000_000 {
            v = renormalize(frame.to_world(v));
        }
        let length = v.to_lanes()[0].iter().map(|x| x * x).sum::<f64>().sqrt();
        assert!((length - 1.0).abs() < 3e-7, "{length}");
    }
}
