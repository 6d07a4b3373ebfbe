//! The watertight ray–triangle test of Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection"
//! (Journal of Computer Graphics Techniques 2(1), 2013), for one ray against one triangle and against a
//! pack of [`LANES`] triangles. Both give the same bits.
//!
//! The ray is sheared to the z axis of a frame in which its largest component is z; a vertex shared by
//! two triangles gets the same image in both, so the sign of an edge function is consistent between them.
//! Images are made by fused operations, edge functions by plain products, never fused ones: the rounded
//! product is a monotone function of the exact one, so that an edge value has the right sign or is zero, and
//! zeros are decided in f64, where products of two f32 are exact.

use super::{PrimitiveId, Triangle};
use crate::math::lanes::{Compare, F32s, FloatLanes, LANES, Mask, U32s};
use crate::math::vec3::Vec3s;

/// A ray prepared for triangle tests.
#[derive(Debug, Clone, Copy)]
pub struct ShearRay {
    /// Axes taken as x, y and z; z is the direction's largest component.
    axes: [Axis; 3],
    ray: FramedRay,
}

/// A ray in a frame in which z is the largest component of its direction.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct FramedRay {
    /// Where it starts.
    pub origin: [f32; 3],
    /// x and y of the direction per z.
    pub shear: [f32; 2],
    /// −1/z of the direction.
    pub back: f32,
}

/// An axis of space: a type, so that indexing by it needs no check.
#[derive(Debug, Clone, Copy)]
#[repr(u32)]
enum Axis {
    X,
    Y,
    Z,
}

impl Axis {
    /// The axes in the order of a frame whose z axis is this one.
    const FRAMES: [[Self; 3]; 3] = [
        [Self::Y, Self::Z, Self::X],
        [Self::Z, Self::X, Self::Y],
        [Self::X, Self::Y, Self::Z],
    ];
}

/// The axes of space taken as x, y and z where z is this one, which is less than 3.
pub const fn frame_axes(z: usize) -> [usize; 3] {
    let [x, y, z] = Axis::FRAMES[z];
    [x as usize, y as usize, z as usize]
}

impl ShearRay {
    /// Prepares the ray. A direction of zero or with NaN gives a ray that hits nothing.
    #[inline]
    pub fn new(origin: [f32; 3], direction: [f32; 3]) -> Self {
        let size = direction.map(f32::abs);
        let z = if size[0] > size[1] {
            if size[0] > size[2] { 0 } else { 2 }
        } else if size[1] > size[2] {
            1
        } else {
            2
        };
        let axes = Axis::FRAMES[z];
        let [x, y, z] = axes.map(|axis| direction[axis as usize]);
        let along = 1.0 / z;
        let ray = FramedRay {
            origin: axes.map(|axis| origin[axis as usize]),
            shear: [x * along, y * along],
            back: -along,
        };
        Self { axes, ray }
    }

    /// Distance, > 0, at which the ray meets the triangle from either side.
    #[inline]
    pub fn intersect(&self, triangle: &Triangle) -> Option<f32> {
        let back = self.ray.back;
        let [a, b, c] = triangle.corners.map(|corner| self.project(corner));
        let u = b[0] * c[1] - b[1] * c[0];
        let v = c[0] * a[1] - c[1] * a[0];
        let w = a[0] * b[1] - a[1] * b[0];
        let sign = (u * v).min(v * w);
        if sign < 0.0 {
            return None;
        }
        let along = mul_add(w, c[2], mul_add(v, b[2], u * a[2])) * back;
        let t = along / (u + v + w);
        let size = t.abs();
        if !(sign > 0.0 && along.abs() > LEAST_ALONG && size > 0.0 && size < f32::INFINITY) {
            return intersect_projected_f64([a, b, c], back);
        }
        (t > 0.0).then_some(t)
    }

    /// Image of a point: x and y across the ray, z along its axis.
    #[inline]
    fn project(&self, point: [f32; 3]) -> [f32; 3] {
        let FramedRay { origin, shear, .. } = self.ray;
        let [kx, ky, kz] = self.axes.map(|axis| axis as usize);
        let z = origin[2] - point[kz];
        [
            mul_add(-shear[0], z, origin[0] - point[kx]),
            mul_add(-shear[1], z, origin[1] - point[ky]),
            z,
        ]
    }

    /// Lanes of the pack that the ray hits, and their distances, > 0 (undefined in other lanes).
    #[inline]
    pub fn intersect_pack(&self, pack: &TrianglePack) -> (Mask, F32s) {
        let row = |k: usize, corner: usize| pack.corners[corner][self.axes[k] as usize];
        self.ray.intersect(row, Mask::ALL)
    }
}

impl FramedRay {
    /// Lanes of `valid` whose triangles the ray hits, and their distances, > 0 (undefined in other
    /// lanes). `row(k, corner)` is a coordinate of all the triangles along axis k of the frame.
    #[inline(always)]
    pub fn intersect<V: FloatLanes>(
        &self,
        row: impl Fn(usize, usize) -> V + Copy,
        valid: Mask,
    ) -> (Mask, V) {
        // Copies for the closure: borrowed ones would have to lie in memory for every test.
        let ray = *self;
        let project = move || ray.project(&row);
        hits_of_projected(project(), V::splat(ray.back), valid, project)
    }

    /// Lanes of `valid` whose triangles the ray may hit: all that [`Self::intersect`] gives at distances that,
    /// times [`FAR_PADDING`], are no more than `end`. Without branches and divisions, for where most triangles are
    /// missed. Distances times areas must not be too large for f32, unless `end` is NaN: then all distances count.
    ///
    /// [`FAR_PADDING`]: super::slab::FAR_PADDING
    #[inline(always)]
    pub fn may_hit<V: FloatLanes>(
        &self,
        row: impl Fn(usize, usize) -> V,
        valid: Mask,
        end: f32,
    ) -> Mask {
        let corners = self.project(&row);
        let (sign, edges) = edges(corners);
        let (along, area) = distance(corners, edges, V::splat(self.back));
        // The product has the sign of t (end − t): no matter what the area's is.
        let before = V::splat(end).mul_sub(area, along);
        !sign.negative_or_with(along * before) & valid
    }

    /// Images of the corners of many triangles: x and y across the ray, z along its axis. From the corners to
    /// the origin, so that x and y have the other sign, which no edge function sees.
    #[inline(always)]
    fn project<V: FloatLanes>(&self, row: &impl Fn(usize, usize) -> V) -> [[V; 3]; 3] {
        [0, 1, 2].map(|corner| {
            let offset = |k: usize| V::splat(self.origin[k]) - row(k, corner);
            let z = offset(2);
            [
                z.mul_neg_add(V::splat(self.shear[0]), offset(0)),
                z.mul_neg_add(V::splat(self.shear[1]), offset(1)),
                z,
            ]
        })
    }
}

/// [`LANES`] rays whose directions have the same largest component, prepared for triangle tests. Axes are
/// those of [`ShearRay`]: z is the largest component, then come x and y.
#[derive(Debug, Clone, Copy, Default)]
pub struct ShearRays {
    /// Origins.
    pub origin: [F32s; 3],
    /// As from [`shear_lanes`].
    pub shear: [F32s; 3],
}

impl ShearRays {
    /// Lanes of `valid` whose rays hit the triangle, and their distances, > 0 (undefined in other lanes):
    /// for each ray the bits that [`ShearRay::intersect`] gives. `corners[axis][corner]` along the rays' axes.
    #[inline(always)]
    pub fn intersect(&self, corners: &[[f32; 3]; 3], valid: Mask) -> (Mask, F32s) {
        // Copies, as in `FramedRay::intersect`.
        let (rays, corners) = (*self, *corners);
        let project = move || [0, 1, 2].map(|corner| rays.project(&corners, corner));
        hits_of_projected(project(), rays.shear[2], valid, project)
    }

    /// Images of a corner for all rays.
    #[inline(always)]
    fn project(&self, corners: &[[f32; 3]; 3], corner: usize) -> [F32s; 3] {
        let at = |k: usize| F32s::splat(corners[k][corner]) - self.origin[k];
        let z = at(2);
        [
            z.mul_neg_add(self.shear[0], at(0)),
            z.mul_neg_add(self.shear[1], at(1)),
            z,
        ]
    }
}

/// Per lane of directions which axis is the largest, one mask per axis, and the shear that
/// [`ShearRay::new`] makes: x and y per z, and 1/z. `reciprocal` are 1/x, 1/y and 1/z of the directions.
#[inline(always)]
pub fn shear_lanes(direction: Vec3s, reciprocal: [F32s; 3]) -> ([Mask; 3], [F32s; 3]) {
    let Vec3s { x, y, z } = direction;
    let (size_x, size_y, size_z) = (x.abs(), y.abs(), z.abs());
    let x_first = size_x.gt(size_y);
    let is_x = x_first & size_x.gt(size_z);
    let is_y = !x_first & size_y.gt(size_z);
    let is_z = !is_x & !is_y;
    let pick = |[a, b, c]: [F32s; 3]| is_x.select(a, is_y.select(b, c));
    let along = pick(reciprocal);
    let shear = [pick([y, z, x]) * along, pick([z, x, y]) * along, along];
    ([is_x, is_y, is_z], shear)
}

/// The three edge functions at the z axis, and a number that is positive where all have one sign and negative only where
/// some have different ones; zero or NaN where f64 decides.
#[inline(always)]
fn edges<V: FloatLanes>([a, b, c]: [[V; 3]; 3]) -> (V, [V; 3]) {
    let u = b[0] * c[1] - b[1] * c[0];
    let v = c[0] * a[1] - c[1] * a[0];
    let w = a[0] * b[1] - a[1] * b[0];
    ((u * v).fast_min(v * w), [u, v, w])
}

/// Sums of products that make a distance may have lost terms too small for f32 if they are below this in size.
const LEAST_ALONG: f32 = 1e-30;

/// Where rays meet the planes of triangles, by their projected corners and edge functions: the distance is the first
/// number over the second, an area. `back` makes distances of coordinates along z.
#[inline(always)]
fn distance<V: FloatLanes>([a, b, c]: [[V; 3]; 3], [u, v, w]: [V; 3], back: V) -> (V, V) {
    let along = w.mul_add(c[2], v.mul_add(b[2], u * a[2]));
    (along * back, u + v + w)
}

/// Lanes of `valid` in which the z axis meets the triangle of projected corners, and its distance along
/// the ray. `again` gives the corners once more where f64 decides: keeping them for that costs every test.
#[inline(always)]
fn hits_of_projected<V: FloatLanes>(
    [a, b, c]: [[V; 3]; 3],
    back: V,
    valid: Mask,
    again: impl FnOnce() -> [[V; 3]; 3],
) -> (Mask, V) {
    let (sign, [u, v, w]) = edges([a, b, c]);
    let zero = V::splat(0.0);
    let candidates = !sign.lt(zero) & valid;
    if candidates.none() {
        return (Mask::NONE, zero);
    }
    let (along, area) = distance([a, b, c], [u, v, w], back);
    let t = along / area;
    let size = t.abs();
    let decided = sign.gt(zero)
        & along.abs().gt(V::splat(LEAST_ALONG))
        & size.gt(zero)
        & size.lt(V::splat(f32::INFINITY));
    let hit = candidates & t.gt(zero);
    let undecided = candidates & !decided;
    if undecided.none() {
        return (hit, t);
    }
    // The answer comes back through memory of its own: `t` stays in a register.
    let mut distances = t;
    let hit = decide_in_f64(
        hit,
        bytemuck::cast_slice_mut(std::slice::from_mut(&mut distances)),
        undecided,
        back,
        again,
    );
    (hit, distances)
}

/// The lanes hit, with the answer of the undecided ones replaced.
#[cold]
#[inline(never)]
fn decide_in_f64<V: FloatLanes>(
    mut hit: Mask,
    distances: &mut [f32],
    undecided: Mask,
    back: V,
    again: impl FnOnce() -> [[V; 3]; 3],
) -> Mask {
    let corners = again();
    for lane in undecided.lanes() {
        let bit = Mask(1 << lane);
        let component = |v: &V| bytemuck::cast_slice::<V, f32>(std::slice::from_ref(v))[lane];
        let corners = corners
            .each_ref()
            .map(|corner| corner.each_ref().map(component));
        match intersect_projected_f64(corners, component(&back)) {
            Some(distance) => {
                distances[lane] = distance;
                hit = hit | bit;
            }
            None => hit = hit & !bit,
        }
    }
    hit
}

/// As [`FloatLanes::mul_add`].
#[inline(always)]
fn mul_add(a: f32, b: f32, c: f32) -> f32 {
    if cfg!(target_feature = "fma") {
        a.mul_add(b, c)
    } else {
        a * b + c
    }
}

/// The test with edge functions of exact sign; points exactly on an edge are inside. `back` as of [`distance`].
#[cold]
fn intersect_projected_f64(corners: [[f32; 3]; 3], back: f32) -> Option<f32> {
    let [a, b, c] = corners.map(|[x, y, z]| [x, y, back * z].map(f64::from));
    let u = b[0] * c[1] - b[1] * c[0];
    let v = c[0] * a[1] - c[1] * a[0];
    let w = a[0] * b[1] - a[1] * b[0];
    let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    let determinant = u + v + w;
    if !inside || determinant == 0.0 {
        return None;
    }
    let t = ((u * a[2] + v * b[2] + w * c[2]) / determinant) as f32;
    (t > 0.0 && t < f32::INFINITY).then_some(t)
}

/// [`LANES`] triangles, corner by corner and axis by axis, so that a ray permutes axes by choosing arrays.
#[derive(Debug, Clone, Copy)]
pub struct TrianglePack {
    /// `corners[corner][axis]`; NaN in lanes without a triangle, which are never hit.
    pub corners: [[F32s; 3]; 3],
    /// Primitive ids, [`PrimitiveId::NONE`] in lanes without a triangle.
    pub ids: U32s,
}

impl TrianglePack {
    /// Packs up to [`LANES`] triangles with their ids.
    ///
    /// # Panics
    /// If there are more.
    pub fn new(triangles: impl IntoIterator<Item = (u32, Triangle)>) -> Self {
        let mut corners = [[[f32::NAN; LANES]; 3]; 3];
        let mut ids = [PrimitiveId::NONE; LANES];
        for (lane, (id, triangle)) in triangles.into_iter().enumerate() {
            ids[lane] = id;
            for (corner, columns) in corners.iter_mut().enumerate() {
                for (axis, column) in columns.iter_mut().enumerate() {
                    column[lane] = triangle.corners[corner][axis];
                }
            }
        }
        Self {
            corners: corners.map(|corner| corner.map(F32s::from)),
            ids: U32s::from(ids),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::slab::FAR_PADDING;
    use crate::geometry::testing::Rng;

    /// A point of a cube; in even rounds of a small integer grid, which meets edges and corners exactly.
    fn point(rng: &mut Rng, round: usize, scale: f32) -> [f32; 3] {
        [0; 3].map(|_| {
            let x = (rng.uniform() - 0.5) * scale;
            if round.is_multiple_of(2) {
                (x * 2.0).round()
            } else {
                x
            }
        })
    }

    #[test]
    fn the_pack_gives_the_same_bits_as_the_single_test() {
        let mut rng = Rng(1);
        let mut hits = 0;
        for round in 0..20_000 {
            let mut point = |scale| point(&mut rng, round, scale);
            let triangles: Vec<Triangle> = (0..LANES - 1)
                .map(|_| Triangle {
                    corners: [point(8.0), point(8.0), point(8.0)],
                })
                .collect();
            let ray = ShearRay::new(point(6.0), point(2.0));
            let pack = TrianglePack::new(triangles.iter().enumerate().map(|(i, t)| (i as u32, *t)));
            let (mask, t) = ray.intersect_pack(&pack);
            for (lane, triangle) in triangles.iter().enumerate() {
                let single = ray.intersect(triangle);
                assert_eq!(single.is_some(), mask.test(lane));
                if let Some(single) = single {
                    assert_eq!(single.to_bits(), t.to_array()[lane].to_bits());
                    hits += 1;
                }
            }
            assert!(
                !mask.test(LANES - 1),
                "the lane without a triangle is never hit"
            );
        }
        assert!(hits > 5_000, "{hits} hits are too few to compare");
    }

    #[test]
    fn triangles_of_all_sizes_are_hit_alike() {
        let mut rng = Rng(5);
        let mut hits = 0;
        for _ in 0..2_000 {
            let [a, b, c, o, d] = [0; 5].map(|_| [0; 3].map(|_| rng.uniform() - 0.5));
            let at = |size: f32| {
                let [a, b, c, o] = [a, b, c, o].map(|p| p.map(|x| x * size));
                let triangle = Triangle { corners: [a, b, c] };
                ShearRay::new(o, d).intersect(&triangle)
            };
            let unit = at(1.0);
            hits += usize::from(unit.is_some());
            // Powers of two: all numbers are the same but for their exponents.
            for size in [-70, -60, -40, -20, 20, 40, 60].map(|exponent| 2f32.powi(exponent)) {
                let error = match (unit, at(size)) {
                    (Some(unit), Some(t)) => (t / size / unit - 1.0).abs(),
                    (None, None) => 0.0,
                    _ => panic!("{unit:?} but {:?} at size {size}", at(size)),
                };
                // Where f64 decides, distances are rounded once.
                assert!(error < 1e-5, "{error} at size {size}");
            }
        }
        assert!(hits > 50, "{hits} hits are too few");
    }

    #[test]
    fn what_may_be_hit_holds_all_hits_before_the_end_and_little_else() {
        let mut rng = Rng(2);
        let (mut hits, mut may, mut all) = (0, 0, 0);
        for round in 0..20_000 {
            let mut point = |scale| point(&mut rng, round, scale);
            let pack = TrianglePack::new((0..LANES as u32).map(|id| {
                let corners = [point(8.0), point(8.0), point(8.0)];
                (id, Triangle { corners })
            }));
            let ray = ShearRay::new(point(6.0), point(2.0));
            let end = [f32::INFINITY, 2.0, 0.5][round % 3];
            let (mask, t) = ray.intersect_pack(&pack);
            let near = mask & t.le(F32s::splat(end));
            let row = |k: usize, corner: usize| pack.corners[corner][ray.axes[k] as usize];
            let maybe = ray.ray.may_hit(row, Mask::ALL, end * FAR_PADDING);
            assert_eq!(maybe & near, near, "round {round}");
            hits += near.count();
            may += maybe.count();
            all += LANES;
        }
        assert!(hits > all / 50, "{hits} hits are too few");
        assert!(may < 4 * hits, "{may} for {hits} hits of {all}");
    }

    #[test]
    fn a_unit_triangle_is_hit_from_both_sides_at_the_right_distance() {
        let triangle = Triangle {
            corners: [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        };
        assert_eq!(
            ShearRay::new([0.25, 0.25, 3.0], [0.0, 0.0, -1.0]).intersect(&triangle),
            Some(3.0)
        );
        assert_eq!(
            ShearRay::new([0.25, 0.25, -2.0], [-0.0, 0.0, 1.0]).intersect(&triangle),
            Some(2.0)
        );
        assert_eq!(
            ShearRay::new([0.25, 0.25, -2.0], [0.0, 0.0, -1.0]).intersect(&triangle),
            None
        );
        assert_eq!(
            ShearRay::new([0.75, 0.75, 3.0], [0.0, 0.0, -1.0]).intersect(&triangle),
            None
        );
        assert_eq!(
            ShearRay::new([0.5, 0.0, 3.0], [0.0, 0.0, -1.0]).intersect(&triangle),
            Some(3.0),
            "on an edge"
        );
        assert_eq!(
            ShearRay::new([0.25, 0.25, 0.0], [0.0, 0.0, -1.0]).intersect(&triangle),
            None,
            "starts on it"
        );
    }

    #[test]
    fn rays_and_triangles_with_nan_or_infinity_miss() {
        let triangle = Triangle {
            corners: [[-9.0, -9.0, 0.0], [9.0, -9.0, 0.0], [0.0, 9.0, 0.0]],
        };
        let good = ([0.0, 0.0, 3.0], [0.0, 0.0, -1.0]);
        assert!(ShearRay::new(good.0, good.1).intersect(&triangle).is_some());
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for axis in 0..3 {
                let mut origin = good.0;
                origin[axis] = bad;
                assert_eq!(ShearRay::new(origin, good.1).intersect(&triangle), None);
                let mut direction = good.1;
                direction[axis] = bad;
                assert_eq!(ShearRay::new(good.0, direction).intersect(&triangle), None);
                let mut broken = triangle;
                broken.corners[1][axis] = bad;
                assert_eq!(ShearRay::new(good.0, good.1).intersect(&broken), None);
            }
        }
        assert_eq!(ShearRay::new(good.0, [0.0; 3]).intersect(&triangle), None);
    }

    /// Needles seen under grazing angles from far away, against f64 on the same f32 inputs.
    #[test]
    fn needles_at_grazing_angles_are_never_hit_beside_themselves() {
        let mut rng = Rng(23);
        let mut worst = 0f32;
        let mut hits = 0;
        for aspect in [1.0f32, 1e3, 1e5] {
            for angle in [30f32, 0.5, 0.01] {
                for _ in 0..5_000 {
                    let turn = rng.rotation();
                    let place =
                        |p: [f32; 3]| turn.map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2]);
                    let corners = [
                        place([0.0, 0.0, 0.0]),
                        place([10.0, 0.0, 0.0]),
                        place([5.0, 10.0 / aspect, 0.0]),
                    ];
                    let (b1, b2) = rng.barycentrics();
                    let target = [0, 1, 2].map(|k| {
                        corners[0][k] * (1.0 - b1 - b2) + corners[1][k] * b1 + corners[2][k] * b2
                    });
                    let (sin, cos) = angle.to_radians().sin_cos();
                    let azimuth = rng.uniform() * std::f32::consts::TAU;
                    let d = place([azimuth.cos() * cos, azimuth.sin() * cos, sin]);
                    let origin = [0, 1, 2].map(|k| target[k] - 100.0 * d[k]);
                    if let Some(t) = ShearRay::new(origin, d).intersect(&Triangle { corners }) {
                        hits += 1;
                        worst = worst.max((t - 100.0).abs());
                    }
                }
            }
        }
        assert!(hits > 20_000);
        assert!(
            worst <= 10.0,
            "a hit lies {worst} from its point on a triangle of size 10"
        );
    }
}
