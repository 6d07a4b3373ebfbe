//! Triangles, sampled uniformly in the solid angle under which they are seen.
//!
//! The plan is that of Arvo ("Stratified Sampling of Spherical Triangles", SIGGRAPH 1995): one number
//! chooses the point d of the side bc that cuts its share off the spherical triangle, the other a point
//! on the arc from a to d by its share of 1 − cos. The formulas are others. His take angles from their
//! cosines and the solid angle from their sum less π, and in f32 lose it below 10⁻³ sr; these have no
//! difference of rounded numbers that are nearly equal in them, so that small, far and grazing triangles
//! need no other method below some threshold.
//!
//! With a, b, c of unit length, T = a·(b×c) and q = (b×c)·(b×a), the solid angle Ω is
//!
//! tan Ω/2 = T / ((1 + a·b)(1 + b·c) + q),
//!
//! which is Van Oosterom and Strackee's formula ("The Solid Angle of a Plane Triangle", IEEE TBME
//! 30(2), 1983) with c·a = (a·b)(b·c) + q. The side bc is the one that is seen under the largest angle,
//! so that the other two cosines are well above −1; where 1 + b·c is small it is |b×c|²/(1 − b·c).
//!
//! The same formula for the triangle abd, with d on bc at the angle φ from b, is a rational function of
//! tan φ/2, whose inverse is, for the solid angle δ and with S = sin δ/2, K = cos δ/2,
//!
//! tan φ/2 = (1 + a·b)·|b×c|·S / (T·K − q·S).
//!
//! δ is counted from b up to Ω/2, and beyond that from c. A spherical triangle lies in the lune of its
//! angle B at b, so Ω ≤ 2B, δ ≤ B, and as q/T = cot B, the subtrahend is at most half the minuend:
//! cot B·tan B/2 ≤ 1/2. The half of the arc from a to d follows by haversines, with g = tan of half the
//! angle from a to b, τ = tan φ/2, as the quotient of two sums of squares,
//!
//! tan² = ((g − τ)² + 4gτ·sin² B/2) / ((1 − gτ)² + 4gτ·cos² B/2),
//!
//! and the angle at a between b and d from the sum of the angles of abd,
//!
//! cot = (sin²(ab/2) − S·(K·cot B + S)) / (S·(K − S·cot B)),
//!
//! which keeps its precision also where d, as seen from the triangle's plane, is almost opposite to a.
//!
//! Cross products are those with the sides, which stay apart from the corners: b×c = b×(c − b). T is the
//! height over the plane times twice the area over the three distances.

use crate::math::elementary::sin_cos_turns;
use crate::math::{Compare, F32s, Mask, Vec3s};

/// Tangents of half angles end here, of angles that are 180° in f32: the squares of two, multiplied, are finite.
const MOST_TANGENT: f32 = 1e9;

/// A corner as it is seen from the reference point.
#[derive(Debug, Clone, Copy)]
struct Corner {
    /// Of unit length.
    direction: Vec3s,
    distance: F32s,
}

impl Corner {
    #[inline(always)]
    fn new(at: Vec3s) -> Self {
        let distance = at.length_squared().sqrt();
        Self {
            direction: at * (F32s::splat(1.0) / distance),
            distance,
        }
    }

    #[inline(always)]
    fn select(mask: Mask, yes: Self, no: Self) -> Self {
        Self {
            direction: Vec3s::select(mask, yes.direction, no.direction),
            distance: mask.select(yes.distance, no.distance),
        }
    }
}

/// Half of 1 + c and half of 1 − c for the cosine c of an angle with this sine: the squared cosine and sine of half
/// the angle.
#[inline(always)]
fn halves(sin: F32s, cos: F32s) -> [F32s; 2] {
    let (half, one) = (F32s::splat(0.5), F32s::splat(1.0));
    let larger = cos.abs().mul_add(half, half);
    let smaller = half * sin * sin / (one + cos.abs());
    let acute = cos.ge(F32s::splat(0.0));
    [acute.select(larger, smaller), acute.select(smaller, larger)]
}

/// The arc between two corners.
struct Arc {
    /// Cross product of the directions, and its length.
    cross: Vec3s,
    sin: F32s,
    /// Squared cosine and sine of half the angle.
    halves: [F32s; 2],
}

impl Arc {
    /// From one corner to another, and the vector between them.
    #[inline(always)]
    fn new(from: Corner, to: Corner, side: Vec3s) -> Self {
        let cross = from.direction.cross(side) * (F32s::splat(1.0) / to.distance);
        let sin = cross.length_squared().sqrt();
        Self {
            cross,
            sin,
            halves: halves(sin, from.direction.dot(to.direction)),
        }
    }
}

/// A triangle as it is seen from a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct SphericalTriangle {
    /// a, and b and c, the ends of the side that is seen under the largest angle.
    corners: [Corner; 3],
    /// From a to b, from b to c, and from c to a.
    sides: [Vec3s; 3],
    /// |a·(b×c)|, of the directions.
    triple: F32s,
    /// Where a·(b×c) is negative.
    turned: Mask,
    solid_angle: F32s,
}

/// A direction about a.
struct Polar {
    /// Where its azimuth is counted from c instead of b.
    from_c: Mask,
    /// Cosine and sine of the azimuth.
    azimuth: [F32s; 2],
    /// tan of half the angle to a.
    tan_half: F32s,
    /// Unit normal of the plane through a and where the azimuth begins.
    normal: Vec3s,
}

impl SphericalTriangle {
    /// The triangle whose first corner is at `corner` from the reference point, with the edges that
    /// leave that corner, twice its area, and the height of its plane over the point, positive in the direction of
    /// edge 1 × edge 2. With 0 or NaN its solid angle is 0, 2π or NaN, and nothing may be sampled.
    #[inline(always)]
    pub(super) fn new(corner: Vec3s, edges: [Vec3s; 2], twice_area: F32s, height: F32s) -> Self {
        let [first, second] = edges;
        let mut corners = [corner, corner + first, corner + second].map(Corner::new);
        let mut sides = [first, second - first, -second];
        // Corners turn where the side between the last two is not the longest to the eye: that has the least cosine.
        let cos = |i: usize, j: usize| corners[i].direction.dot(corners[j].direction);
        let (ab, bc, ca) = (cos(0, 1), cos(1, 2), cos(2, 0));
        for (turn, by) in [(ab.lt(bc) & ab.lt(ca), 2), (ca.lt(bc) & !ab.lt(ca), 1)] {
            if turn.any() {
                let (old_corners, old_sides) = (corners, sides);
                for i in 0..3 {
                    let from = (i + by) % 3;
                    corners[i] = Corner::select(turn, old_corners[from], old_corners[i]);
                    sides[i] = Vec3s::select(turn, old_sides[from], old_sides[i]);
                }
            }
        }
        let [a, b, c] = corners;
        let triple = (height.abs() / a.distance) * (twice_area / b.distance) / c.distance;
        let along = Arc::new(b, c, sides[1]);
        let spoke = Arc::new(b, a, -sides[0]);
        let product = F32s::splat(4.0) * along.halves[0] * spoke.halves[0];
        let cosines = product + along.cross.dot(spoke.cross);
        Self {
            corners,
            sides,
            triple,
            turned: height.lt(F32s::splat(0.0)),
            solid_angle: F32s::splat(2.0) * triple.atan2(cosines),
        }
    }

    /// In sr. Its relative error is below 10⁻⁶, but for what rounding of the corners makes of it: about 10⁻⁷ of
    /// their distance over the distance of the nearest edge, or of the plane.
    #[inline(always)]
    pub(super) fn solid_angle(&self) -> F32s {
        self.solid_angle
    }

    /// The distance of the farthest corner.
    #[inline(always)]
    pub(super) fn reach(&self) -> F32s {
        let [a, b, c] = self.corners.map(|corner| corner.distance);
        a.fast_max(b).fast_max(c)
    }

    /// Where the uniform numbers `u` and `v` fall.
    #[inline(always)]
    fn polar(&self, u: F32s, v: F32s) -> Polar {
        let (one, two, four) = (F32s::splat(1.0), F32s::splat(2.0), F32s::splat(4.0));
        let most = F32s::splat(MOST_TANGENT);
        let from_c = u.ge(F32s::splat(0.5));
        let [a, b, c] = self.corners;
        let [ab, bc, ca] = self.sides;
        // What is called b above is the one that the angle is counted from.
        let b_or_c = Corner::select(from_c, c, b);
        let other = Corner::select(from_c, b, c);
        let along = Arc::new(b_or_c, other, Vec3s::select(from_c, -bc, bc));
        let spoke = Arc::new(b_or_c, a, Vec3s::select(from_c, ca, -ab));
        let q = along.cross.dot(spoke.cross);

        // Half of δ, in turns: at most a quarter.
        let turns = from_c.select(one - u, u)
            * self.solid_angle
            * F32s::splat(0.25 * std::f32::consts::FRAC_1_PI);
        let (sin, cos) = sin_cos_turns(turns);
        let tau = two * spoke.halves[0] * along.sin * sin / (self.triple * cos - q * sin);
        let tau = tau.fast_min(most);
        let g = (spoke.halves[1] / spoke.halves[0]).sqrt().fast_min(most);
        let sines = along.sin * spoke.sin;
        let [sin_b, cos_b] = [self.triple / sines, q / sines];
        let angle = halves(sin_b, cos_b);
        let (apart, opposite) = (g - tau, one - g * tau);
        let product = four * g * tau;
        let whole = product.mul_add(angle[1], apart * apart)
            / product.mul_add(angle[0], opposite * opposite);

        // 1 − cos is twice the squared sine of the half: that has the share v of the whole's.
        let whole = whole.fast_min(most);
        let tan_half = (whole * v / (one - v).mul_add(whole, one)).sqrt();

        // Times sin B, which may be next to nothing.
        let (x, y) = (
            spoke.halves[1] * sin_b - sin * cos.mul_add(cos_b, sin * sin_b),
            sin * cos.mul_sub(sin_b, sin * cos_b),
        );
        // Scaled by what they are no larger than by far: squares of the smallest would be denormal.
        let scale = one / (spoke.halves[1] + sin);
        let (x, y) = (x * scale, y * scale);
        let length = x.mul_add(x, y * y).sqrt();
        let normal = -spoke.cross * (one / spoke.sin);
        Polar {
            from_c,
            azimuth: [x / length, y / length],
            tan_half,
            normal,
        }
    }

    /// The direction, of unit length, where the uniform numbers `u` and `v` fall.
    #[inline(always)]
    pub(super) fn sample(&self, u: F32s, v: F32s) -> Vec3s {
        let (one, two) = (F32s::splat(1.0), F32s::splat(2.0));
        let polar = self.polar(u, v);
        let a = self.corners[0].direction;
        let tangent = polar.normal.cross(a);
        let clockwise = Mask(polar.from_c.0 ^ self.turned.0);
        let [x, y] = polar.azimuth;
        let across = (tangent * x).add_scaled(polar.normal, clockwise.select(-y, y));
        let t = polar.tan_half;
        let scale = one / t.mul_add(t, one);
        (a * ((one - t) * (one + t) * scale)).add_scaled(across, two * t * scale)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::testing::Uniform;

    /// The first corner and the two edges from it, seen from the origin.
    type Triangle = [[f32; 3]; 3];

    fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|k| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3])
    }

    fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
        (0..3).map(|k| a[k] * b[k]).sum()
    }

    fn length(a: [f64; 3]) -> f64 {
        dot(a, a).sqrt()
    }

    fn add(a: [f64; 3], b: [f64; 3], scale: f64) -> [f64; 3] {
        std::array::from_fn(|k| a[k] + scale * b[k])
    }

    fn minus(a: [f64; 3]) -> [f64; 3] {
        a.map(|x| -x)
    }

    /// f64, of a corner and the edges from it.
    fn exact(corner: [f64; 3], edges: [[f64; 3]; 2]) -> f64 {
        let [a, b, c] = [
            corner,
            add(corner, edges[0], 1.0),
            add(corner, edges[1], 1.0),
        ];
        let [la, lb, lc] = [a, b, c].map(length);
        let triple = dot(a, cross(edges[0], edges[1])).abs();
        2.0 * triple.atan2(la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb)
    }

    fn view([corner, e1, e2]: Triangle) -> SphericalTriangle {
        let [a, b] = [e1, e2].map(|v| v.map(f64::from));
        let area = cross(a, b);
        let twice_area = length(area);
        let normal = area.map(|x| (x / twice_area) as f32);
        let corner = Vec3s::splat(corner);
        SphericalTriangle::new(
            corner,
            [e1, e2].map(Vec3s::splat),
            F32s::splat(twice_area as f32),
            corner.dot(Vec3s::splat(normal)),
        )
    }

    /// Triangles of about the size `size` in planes of constant z, which are about `z` away, and whose middle
    /// is up to about `aside` from the foot; or in planes of constant x or y.
    fn triangles(count: usize, size: f64, z: f64, aside: f64) -> impl Iterator<Item = Triangle> {
        let mut random = Uniform::new(51);
        (0..count).map(move |number| {
            let mut within = |low: f64, high: f64| low + (high - low) * random.next();
            let turn = within(0.0, std::f64::consts::TAU);
            let angle = within(0.1, 3.0) * if number % 2 == 0 { 1.0 } else { -1.0 };
            let at = |phi: f64, r: f64| [r * phi.cos(), r * phi.sin(), 0.0];
            let e1 = at(turn, size * within(0.3, 2.0));
            let e2 = at(turn + angle, size * within(0.3, 2.0));
            let mut corner = at(within(0.0, std::f64::consts::TAU), aside * within(0.0, 2.0));
            corner = add(add(corner, e1, -within(0.0, 0.6)), e2, -within(0.0, 0.6));
            corner[2] = z * within(0.1, 1.0);
            [corner, e1, e2].map(|v| std::array::from_fn(|k| v[(k + number) % 3] as f32))
        })
    }

    #[test]
    fn solid_angles_keep_their_precision_at_any_size_distance_and_angle() {
        for (size, z, aside, tolerance) in [
            (1.0, 1.0, 1.0, 2e-6),
            (1e-3, 1.0, 1.0, 1e-6),
            (1e-5, 1.0, 1.0, 1e-6),
            (1e-8, 1.0, 1.0, 1e-6),
            (1.0, 1e-3, 100.0, 4e-6),
            (1e-6, 1e-6, 1e-6, 2e-6),
            (1e7, 1e7, 1e7, 2e-6),
            (1e-7, 1e7, 1e7, 1e-6),
            // Corners are rounded to 6·10⁻⁸ of 1 m, or of 30 m, while planes and edges are this near.
            (1.0, 1e-2, 0.5, 4e-5),
            (1.0, 1e-3, 0.0, 2e-4),
            (1.0, 1e-4, 30.0, 2e-4),
            (1.0, 1e-6, 0.0, 1e-3),
        ] {
            for triangle in triangles(4000, size, z, aside) {
                let got = f64::from(view(triangle).solid_angle().to_array()[0]);
                let [c, a, b] = triangle.map(|v| v.map(f64::from));
                let exact = exact(c, [a, b]);
                assert!(
                    (got / exact - 1.0).abs() < tolerance,
                    "{triangle:?}: {got}, not {exact}"
                );
            }
        }
    }

    /// a, and the sides from a to b, from b to c and from c to a; in f64.
    fn turned(triangle: Triangle, view: &SphericalTriangle) -> ([f64; 3], [[f64; 3]; 3]) {
        let [c, e1, e2] = triangle.map(|v| v.map(f64::from));
        let corners = [c, add(c, e1, 1.0), add(c, e2, 1.0)];
        let sides = [e1, add(e2, e1, -1.0), minus(e2)];
        let first = view.sides[0].to_lanes()[0];
        let gap = |i: usize| length(add(first, sides[i], -1.0));
        let turn = (0..3)
            .min_by(|&i, &j| gap(i).total_cmp(&gap(j)))
            .expect("three");
        (
            corners[turn],
            std::array::from_fn(|i| sides[(i + turn) % 3]),
        )
    }

    /// Holds `samples` of 16 and more lanes against their shares of the solid angle and of the arc, and the directions
    /// against what they are made of, to within `tolerance`.
    fn check_shares(triangle: Triangle, random: &mut Uniform, samples: usize, tolerance: f64) {
        let view = view(triangle);
        let (a, sides) = turned(triangle, &view);
        let back = sides.map(minus);
        let whole = exact(a, [sides[0], back[2]]);
        let unit = |v: [f64; 3]| v.map(|x| x / length(v));
        let sign = if view.turned.test(0) { -1.0 } else { 1.0 };
        for _ in 0..samples {
            let (u, v) = (random.lanes(), random.lanes());
            let polar = view.polar(u, v);
            let directions = view.sample(u, v).to_lanes();
            for (lane, sampled) in directions.into_iter().enumerate() {
                let at = |n: F32s| f64::from(n.to_array()[lane]);
                let [x, y, t] = [polar.azimuth[0], polar.azimuth[1], polar.tan_half].map(at);
                let (spoke, side, u, sign) = if polar.from_c.test(lane) {
                    (back[2], back[1], 1.0 - at(u), -sign)
                } else {
                    (sides[0], sides[1], at(u), sign)
                };
                // The same in f64, from the angles on.
                let normal = unit(cross(a, spoke));
                let tangent = cross(normal, unit(a));
                let across = add(tangent.map(|c| c * x), normal, y * sign);
                let sin = 2.0 * t / (1.0 + t * t);
                let cos = (1.0 - t) * (1.0 + t) / (1.0 + t * t);
                let direction = add(unit(a).map(|c| c * cos), across, sin);
                let off = length(add(direction, sampled, -1.0));
                assert!(off < tolerance, "{triangle:?}: {off}");
                assert!((length(sampled) - 1.0).abs() < 1e-6);
                // Where the plane of a and the direction meets the side that begins at the end of the spoke.
                let plane = cross(a, across);
                let share = -dot(plane, spoke) / dot(plane, side);
                let to_d = add(spoke, side, share);
                let part = exact(a, [spoke, to_d]) / whole;
                assert!(
                    (part - u).abs() < tolerance,
                    "{triangle:?}: {part}, not {u}"
                );
                let half = 0.5 * length(cross(a, to_d)).atan2(dot(a, add(a, to_d, 1.0)));
                let part = t * t / (1.0 + t * t) / half.sin().powi(2);
                assert!(
                    (part - at(v)).abs() < tolerance,
                    "{triangle:?}: {part}, not {}",
                    at(v)
                );
            }
        }
    }

    #[test]
    fn samples_cut_off_their_shares_of_the_solid_angle_and_of_the_arc() {
        let mut random = Uniform::new(52);
        for (size, z, aside, tolerance) in [
            (1.0, 1.0, 1.0, 1e-5),
            (1e-3, 1.0, 1.0, 1e-5),
            (1e-5, 1.0, 1.0, 1e-5),
            (1e-8, 1.0, 1.0, 1e-5),
            (1e7, 1e7, 1e7, 1e-5),
            // As above.
            (1.0, 1e-1, 0.0, 1e-4),
            (1.0, 1e-2, 0.5, 1e-3),
        ] {
            for triangle in triangles(500, size, z, aside) {
                // Without fused multiplication products round once more.
                let roundings = if cfg!(target_feature = "fma") {
                    1.0
                } else {
                    2.0
                };
                check_shares(triangle, &mut random, 1, roundings * tolerance);
            }
        }
    }

    #[test]
    fn samples_keep_their_shares_next_to_the_plane_and_to_an_edge() {
        let mut random = Uniform::new(53);
        // In the middle before it, and before an edge, with coordinates that no rounding moves.
        for z in [1e-1, 1e-3, 1e-6, 1e-9] {
            for triangle in [
                [[-0.25, -0.25, z], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
                [[-0.5, z, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
                [[-0.5, z, -0.5], [0.0, 0.0, 1.0], [1.0, 0.0, 0.5]],
            ] {
                check_shares(triangle, &mut random, 100, 1e-4);
            }
        }
    }

    #[test]
    fn samples_are_sound_from_the_plane_of_the_triangle_its_edges_and_its_corners() {
        let ends = [0.0, 1.0 / 16_777_216.0, 0.5, 1.0 - 1.0 / 16_777_216.0];
        let edges = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Vec3s::splat);
        for z in [0.0, 1e-38, 1e-20, 1e-7, 1.0, -1.0, 1e10] {
            for x in [-1.0, -0.5, -0.25, 0.0, 1e-7, 2.0, 1e10] {
                for y in [-1.0, -0.5, -0.25, 0.0, 2.0] {
                    let (corner, z) = (Vec3s::splat([x, y, z]), F32s::splat(z));
                    let view = SphericalTriangle::new(corner, edges, F32s::splat(1.0), z);
                    let solid_angle = view.solid_angle().to_array()[0];
                    assert!(solid_angle.is_nan() || (0.0..6.3).contains(&solid_angle));
                    // What is not seen is not sampled. Nearer to an edge than 10⁻¹⁹ squares vanish: directions that
                    // are NaN are on no side of the light, and not valid.
                    if solid_angle.is_nan() || solid_angle < 1e-12 || z.to_array()[0] == 0.0 {
                        continue;
                    }
                    for (u, v) in ends.into_iter().flat_map(|u| ends.map(|v| (u, v))) {
                        let direction = view.sample(F32s::splat(u), F32s::splat(v));
                        let length = direction.length_squared().to_array()[0];
                        assert!(
                            (length - 1.0).abs() < 1e-5
                                || (length.is_nan() && z.to_array()[0] < 1e-19),
                            "{x} {y} {z:?} {u} {v}: {length}"
                        );
                    }
                }
            }
        }
    }
}
