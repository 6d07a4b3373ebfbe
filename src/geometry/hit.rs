//! Points on surfaces with bounds of their rounding errors, and origins of secondary rays outside those
//! bounds (Pharr, Jakob and Humphreys, *Physically Based Rendering*, 4th edition, section 6.8).

use crate::math::float::{gamma, next_outward};
use crate::math::lanes::{Compare, F32s};
use crate::math::vec3::Vec3s;

/// A point on a surface and how far rounding may have moved it off that surface.
#[derive(Debug, Clone, Copy)]
pub struct SurfacePoint {
    /// The point.
    pub p: Vec3s,
    /// Where on the surface rays that leave it start: the point, or one as near to it as its error that is not at
    /// an edge.
    pub start: Vec3s,
    /// Bound of the absolute error per component, ≥ 0.
    pub error: Vec3s,
}

/// Two vectors perpendicular to a unit direction and to each other, the first without a z component.
/// The pair is unit length; a direction along z gets the x and y axes.
#[derive(Debug, Clone, Copy)]
pub struct RayFrame {
    ux: F32s,
    uy: F32s,
    w: Vec3s,
}

impl RayFrame {
    /// The frame of each direction.
    #[inline(always)]
    pub fn new(direction: Vec3s) -> Self {
        let one = F32s::splat(1.0);
        let squared = direction.x.mul_add(direction.x, direction.y * direction.y);
        // Below this the direction is along z to far less than its own rounding, and the square of the
        // horizontal part begins to lose bits.
        let tilted = squared.gt(F32s::splat(1e-30));
        let horizontal = squared.sqrt();
        let inverse = one / horizontal;
        let cosine = tilted.select(direction.x * inverse, one);
        let sine = tilted.select(direction.y * inverse, F32s::splat(0.0));
        let horizontal = tilted.select(horizontal, F32s::splat(0.0));
        Self {
            ux: sine,
            uy: -cosine,
            w: Vec3s::new(direction.z * cosine, direction.z * sine, -horizontal),
        }
    }

    /// Coordinates of `v` across the direction.
    #[inline(always)]
    pub fn project(&self, v: Vec3s) -> (F32s, F32s) {
        (self.ux.mul_add(v.x, self.uy * v.y), self.w.dot(v))
    }
}

/// How far inside of its triangle a ray starts, in error bounds, and as a share of the triangle's least height at
/// most.
const INSET: f32 = 8.0;
const MOST_INSET: f32 = 1.0 / 16_384.0;

/// The point of each lane's triangle (given by its corners) on each lane's ray, by barycentric
/// coordinates; the ray is known to hit. The error bound is γ(7)·Σ|bᵢ·pᵢ|, off the plane of the triangle.
///
/// The triangle may stand for a polygon that it is part of: where the ray meets the plane outside of the
/// triangle, so is the point. Where the triangle is seen exactly from its edge, the answer is its centroid.
///
/// Rays that leave a point nearer to an edge than eight error bounds start as far inwards: they
/// would else begin beyond a wall that meets this one in the edge, if the angle between them is small or rounding
/// is unfavourable.
#[inline(always)]
pub fn triangle_point(origin: Vec3s, direction: Vec3s, corners: [Vec3s; 3]) -> SurfacePoint {
    triangle_hit(origin, direction, corners).0
}

/// [`triangle_point`] with its barycentric coordinates, which add up to 1 but for rounding.
#[inline(always)]
pub fn triangle_hit(
    origin: Vec3s,
    direction: Vec3s,
    corners: [Vec3s; 3],
) -> (SurfacePoint, [F32s; 3]) {
    let frame = RayFrame::new(direction);
    let [(ax, ay), (bx, by), (cx, cy)] = corners.map(|corner| frame.project(corner - origin));
    let u = bx * cy - by * cx;
    let v = cx * ay - cy * ax;
    let w = ax * by - ay * bx;
    let determinant = u + v + w;
    let third = F32s::splat(1.0 / 3.0);
    let proper = Compare::ne(determinant, F32s::splat(0.0));
    let scale = F32s::splat(1.0) / determinant;
    let weights = [u, v, w].map(|e| proper.select(e * scale, third));

    let [a, b, c] = [0, 1, 2].map(|corner| corners[corner] * weights[corner]);
    let sum = a.abs() + b.abs() + c.abs();
    let p = a + b + c;
    let error = sum * F32s::splat(gamma(7));
    let start = start(p, error, corners, weights);
    (SurfacePoint { p, start, error }, weights)
}

/// Where rays that leave the point with these barycentric coordinates start.
#[inline(always)]
fn start(p: Vec3s, error: Vec3s, corners: [Vec3s; 3], weights: [F32s; 3]) -> Vec3s {
    let [u, v, w] = weights.map(|weight| weight.abs());
    let smallest = u.fast_min(v).fast_min(w);
    // Hardly ever is one of them that small.
    if smallest.lt(F32s::splat(MOST_INSET)).none() {
        return p;
    }
    let least = least_weight(corners, error);
    let at_edge = smallest.lt(least);
    let [u, v, w] = weights.map(|weight| weight.abs().lt(least).select(least, weight));
    let scale = F32s::splat(1.0) / (u + v + w);
    let [a, b, c] = corners;
    let inner = a * (u * scale) + b * (v * scale) + c * (w * scale);
    Vec3s::select(at_edge, inner, p)
}

/// The least barycentric coordinate of a point that is [`INSET`] error bounds away from the longest edge, and
/// so at least as far from the others.
#[inline(always)]
fn least_weight([a, b, c]: [Vec3s; 3], error: Vec3s) -> F32s {
    let [ab, ac, bc] = [b - a, c - a, c - b];
    let area = ab.cross(ac);
    let longest = ab.dot(ab).max(ac.dot(ac)).max(bc.dot(bc));
    // The least height: twice the area over the longest edge.
    let inset = F32s::splat(INSET) * (error.x + error.y + error.z);
    let share = inset * (longest / area.dot(area)).sqrt();
    // Also where the area is zero or has underflown, which makes the share infinite or no number.
    let most = F32s::splat(MOST_INSET);
    share.lt(most).select(share, most)
}

/// The point at distance `t` of each lane's ray, drawn onto each lane's sphere: p = c + r·(o + t·d − c)/|…|.
///
/// Its error off the sphere: the squared length has γ(3), its root half of that plus one rounding, the
/// reciprocal one, and the products with it and with r one each, so that r·n has at most γ(6) per
/// component; adding c rounds once more, by γ(1)·|p|. An error of t moves p along the sphere only.
#[inline(always)]
pub fn sphere_point(
    origin: Vec3s,
    direction: Vec3s,
    t: F32s,
    center: Vec3s,
    radius: F32s,
) -> SurfacePoint {
    let arm = (origin.add_scaled(direction, t) - center).normalize() * radius;
    let p = center + arm;
    SurfacePoint {
        p,
        start: p,
        error: arm.abs() * F32s::splat(gamma(6)) + p.abs() * F32s::splat(gamma(1)),
    }
}

/// Where a ray that leaves `point` along `direction` starts: outside of the error bound, on the side of
/// the surface to which the direction points. `normal` is the unit geometric normal, of either side.
#[inline(always)]
pub fn spawn_origin(point: &SurfacePoint, normal: Vec3s, direction: Vec3s) -> Vec3s {
    let distance = normal.abs().dot(point.error);
    let outward = direction.dot(normal).ge(F32s::splat(0.0));
    let offset = normal * outward.select(distance, -distance);
    let p = point.start + offset;
    Vec3s::new(
        next_outward(p.x, offset.x),
        next_outward(p.y, offset.y),
        next_outward(p.z, offset.z),
    )
}

/// What [`spawn_origin`] is to be compared with: the point itself, moved along the normal by the fixed
/// distance `bias` ≥ 0, in scene units, to the side to which the direction points. Too small a bias leaves
/// rays below their own surface, too large a one loses what is near it; none is right for every scene.
#[inline(always)]
pub fn biased_origin(p: Vec3s, normal: Vec3s, direction: Vec3s, bias: f32) -> Vec3s {
    let outward = direction.dot(normal).ge(F32s::splat(0.0));
    let bias = F32s::splat(bias);
    p.add_scaled(normal, outward.select(bias, -bias))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::testing::{Rng, column, lane};
    use crate::math::{Frame, LANES};

    fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
        (0..3).map(|k| a[k] * b[k]).sum()
    }

    #[test]
    fn frames_are_orthonormal_for_every_direction() {
        let mut rng = Rng(34);
        for round in 0..200_000 / LANES {
            let directions = [(); LANES].map(|()| {
                let mut d = rng.sphere();
                if round % 2 == 0 {
                    // Within 1e-8 .. 1e-1 of the z axis, where the horizontal part is small.
                    let tilt = 10f32.powf(-8.0 + 7.0 * rng.uniform());
                    d = [
                        d[0] * tilt,
                        d[1] * tilt,
                        if d[2] < 0.0 { -1.0 } else { 1.0 },
                    ];
                    let length = d.iter().map(|x| x * x).sum::<f32>().sqrt();
                    d = d.map(|x| x / length);
                }
                d
            });
            let d = column(&directions);
            let frame = RayFrame::new(d);
            let u = Vec3s::new(frame.ux, frame.uy, F32s::splat(0.0));
            for i in 0..LANES {
                let [u, w, d] = [u, frame.w, d].map(|v| lane(v, i).map(f64::from));
                for (a, b, expected) in [
                    (u, u, 1.0),
                    (w, w, 1.0),
                    (u, w, 0.0),
                    (u, d, 0.0),
                    (w, d, 0.0),
                ] {
                    assert!((dot(a, b) - expected).abs() < 5e-7, "{u:?} {w:?} {d:?}");
                }
            }
        }
        for axis in 0..3 {
            let mut d = [0.0; 3];
            d[axis] = -1.0;
            let (x, y) = RayFrame::new(Vec3s::splat(d)).project(Vec3s::splat(d));
            assert_eq!((x.to_array()[0], y.to_array()[0]), (0.0, 0.0));
        }
    }

    #[test]
    fn triangle_points_lie_on_the_plane_within_the_bound_and_on_the_ray() {
        let mut rng = Rng(3);
        for scale in [1e-6f32, 1.0, 1e7] {
            for _ in 0..50_000 / LANES {
                let mut vectors = |s: f32| [(); LANES].map(|()| rng.sphere().map(|x| x * s));
                let [a, b, c, origins] = [
                    vectors(scale),
                    vectors(scale),
                    vectors(scale),
                    vectors(3.0 * scale),
                ];
                let targets: [[f32; 3]; LANES] = std::array::from_fn(|i| {
                    let (s, t) = rng.barycentrics();
                    [0, 1, 2].map(|k| a[i][k] + s * (b[i][k] - a[i][k]) + t * (c[i][k] - a[i][k]))
                });
                let directions: [[f32; 3]; LANES] = std::array::from_fn(|i| {
                    let d = [0, 1, 2].map(|k| targets[i][k] - origins[i][k]);
                    let length = d
                        .iter()
                        .map(|x| x / scale * (x / scale))
                        .sum::<f32>()
                        .sqrt()
                        * scale;
                    d.map(|x| x / length)
                });
                let (origin, direction) = (column(&origins), column(&directions));
                let point = triangle_point(origin, direction, [column(&a), column(&b), column(&c)]);
                for i in 0..LANES {
                    let [a, b, c, o, d] =
                        [a[i], b[i], c[i], origins[i], directions[i]].map(|v| v.map(f64::from));
                    let sub = |p: [f64; 3], q: [f64; 3]| [0, 1, 2].map(|k| p[k] - q[k]);
                    let cross = |p: [f64; 3], q: [f64; 3]| {
                        [
                            p[1] * q[2] - p[2] * q[1],
                            p[2] * q[0] - p[0] * q[2],
                            p[0] * q[1] - p[1] * q[0],
                        ]
                    };
                    let n = cross(sub(b, a), sub(c, a));
                    let length = dot(n, n).sqrt();
                    let n = n.map(|x| x / length);
                    let p = lane(point.p, i).map(f64::from);
                    let error = lane(point.error, i).map(f64::from);
                    let off_plane = dot(n, sub(p, a)).abs();
                    assert!(
                        off_plane <= dot(n.map(f64::abs), error),
                        "{off_plane} off the plane at {scale}"
                    );
                    let cosine = dot(n, d).abs();
                    let off_ray = dot(cross(sub(p, o), d), cross(sub(p, o), d)).sqrt();
                    assert!(
                        off_ray <= 4e-6 * f64::from(scale) / cosine.max(1e-3),
                        "{off_ray} off the ray"
                    );
                }
            }
        }
    }

    #[test]
    fn rays_that_leave_a_wall_begin_before_the_wall_that_it_meets() {
        let mut rng = Rng(9);
        let (mut inside, mut count) = (0, 0);
        for scale in [1e-6f32, 1.0, 1e7] {
            for degrees in [20.0f32, 45.0, 90.0, 135.0] {
                for _ in 0..20_000 / LANES {
                    // Two walls with an edge ab, the second at this angle to the first: it faces what is between.
                    let (sin, cos) = degrees.to_radians().sin_cos();
                    let turn = Frame::from_normal(Vec3s::splat(rng.sphere()).normalize());
                    let place = |p: [f32; 3]| turn.to_world(Vec3s::splat(p.map(|x| x * scale)));
                    let (along, ahead) = (2.0 * rng.uniform() - 1.0, rng.uniform());
                    let [a, b, c] =
                        [[-1.5, -0.7, 0.3], [1.5, -0.7, 0.3], [along, 1.0, 0.3]].map(place);
                    let other = place([ahead, -0.7 + cos, 0.3 + sin]);
                    // Towards the edge, from between the walls.
                    let half = 0.5 * degrees.to_radians();
                    let from = |x: f32| [x, -0.7 + half.cos(), 0.3 + half.sin()];
                    let at: [f32; LANES] = std::array::from_fn(|_| 2.8 * rng.uniform() - 1.4);
                    let origin = place(from(0.2));
                    let onto = turn.to_world(Vec3s::new(
                        F32s::from(at.map(|x| x * scale)),
                        F32s::splat(-0.7 * scale),
                        F32s::splat(0.3 * scale),
                    ));
                    let direction = (onto - origin).normalize();
                    let point = triangle_point(origin, direction, [a, b, c]);
                    let normal = turn.to_world(Vec3s::splat([0.0, 0.0, 1.0]));
                    let spawned = spawn_origin(&point, normal, -direction);
                    for i in 0..LANES {
                        let [a, b, other, origin, p] = [a, b, other, origin, spawned]
                            .map(|v| glam::DVec3::from(lane(v, i).map(f64::from)));
                        // Which side of the wall through a, b and the other.
                        let normal = (other - a).cross(b - a);
                        let [between, side] = [origin, p].map(|p| normal.dot(p - a));
                        inside += usize::from(between * side > 0.0);
                        count += 1;
                    }
                }
            }
        }
        assert_eq!(inside, count);
    }

    #[test]
    fn a_triangle_seen_from_its_edge_gives_a_point_on_it() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Vec3s::splat);
        let point = triangle_point(
            Vec3s::splat([-1.0, 0.2, 0.0]),
            Vec3s::splat([1.0, 0.0, 0.0]),
            corners,
        );
        let p = lane(point.p, 0);
        assert!((p[0] - 1.0 / 3.0).abs() < 1e-6 && (p[1] - 1.0 / 3.0).abs() < 1e-6 && p[2] == 0.0);
    }

    #[test]
    fn sphere_points_lie_on_the_sphere_within_the_bound() {
        let mut rng = Rng(20);
        for (radius, offset) in [
            (1e-6f32, 0.0f32),
            (1.0, 0.0),
            (1.0, 1e3),
            (1e7, 0.0),
            (1.0, 1e6),
        ] {
            for _ in 0..50_000 / LANES {
                let center = rng.sphere().map(|x| x * offset);
                let origins = [(); LANES].map(|()| rng.sphere().map(|x| x * radius * 5.0));
                let origins = origins.map(|o| [0, 1, 2].map(|k| center[k] + o[k]));
                let directions = [(); LANES].map(|()| rng.sphere());
                // A distance with a large error still gives a point on the sphere.
                let t = F32s::splat(radius * 5.0 * rng.uniform());
                let (c, r) = (Vec3s::splat(center), F32s::splat(radius));
                let point = sphere_point(column(&origins), column(&directions), t, c, r);
                for i in 0..LANES {
                    let p = lane(point.p, i).map(f64::from);
                    let error = lane(point.error, i).map(f64::from);
                    let arm = [0, 1, 2].map(|k| p[k] - f64::from(center[k]));
                    let length = dot(arm, arm).sqrt();
                    let off = (length - f64::from(radius)).abs();
                    let bound = dot(arm.map(|x| x.abs() / length), error);
                    assert!(
                        off <= bound * (1.0 + 1e-6),
                        "{off} > {bound} at radius {radius}, offset {offset}"
                    );
                }
            }
        }
    }

    #[test]
    fn spawned_rays_start_on_the_side_of_their_direction() {
        let mut rng = Rng(4);
        for _ in 0..50_000 / LANES {
            let normals = [(); LANES].map(|()| rng.sphere());
            let points = [(); LANES].map(|()| rng.sphere().map(|x| x * 100.0));
            let directions = [(); LANES].map(|()| rng.sphere());
            let error = [(); LANES].map(|()| rng.sphere().map(|x| x.abs() * 1e-4));
            let point = SurfacePoint {
                p: column(&points),
                start: column(&points),
                error: column(&error),
            };
            let spawned = spawn_origin(&point, column(&normals), column(&directions));
            for i in 0..LANES {
                let n = normals[i].map(f64::from);
                let moved =
                    [0, 1, 2].map(|k| f64::from(lane(spawned, i)[k]) - f64::from(points[i][k]));
                let side = dot(directions[i].map(f64::from), n);
                assert!(
                    dot(moved, n) * side.signum()
                        >= dot(n.map(f64::abs), error[i].map(f64::from)) * (1.0 - 1e-6)
                );
            }
        }
    }
}
