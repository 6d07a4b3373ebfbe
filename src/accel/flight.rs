//! Rays in flight through the 8-wide tree, each one cache line, made of vectors of rays by transposition.

use wide::f32x8;

use super::blocks::{Leaf, Node};
use super::collapse::WIDTH;
use super::octant::OCTANTS;
use crate::geometry::slab::FAR_PADDING;
use crate::geometry::triangle::FramedRay;
use crate::math::lanes::{F32s, LANES, Mask, U32s};

/// A ray in flight. Axes are those of [`FramedRay`].
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
pub(super) struct Flight {
    pub(super) framed: FramedRay,
    /// −1/d along x and y; the frame's ray has that along z.
    pub(super) reciprocal: [f32; 2],
    /// Closest hit so far, or the end of the ray.
    pub(super) t: f32,
    pub(super) primitive: u32,
    /// Number of the ray in its batch.
    pub(super) ray: u32,
    pub(super) frame: Frame,
    /// NaN where numbers of the ray are too large for [`FramedRay::may_hit`] to tell distances, else zero.
    doubt: f32,
    /// See [`Self::end_at_t`].
    pub(super) end: f32,
    /// Place in the stacks after the last entry.
    pub(super) top: u32,
}

impl Flight {
    /// Lets nothing count that lies beyond its `t` times [`FAR_PADDING`], which is given back.
    #[inline(always)]
    pub(super) fn end_at_t(&mut self) -> f32 {
        let padded = self.t * FAR_PADDING;
        self.end = padded + self.doubt;
        padded
    }
}

/// How a flight reads nodes and leaves. Axes are those of [`FramedRay`].
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct Frame {
    /// Per axis where in a node the near planes are, in bytes.
    pub(super) near: [u8; 3],
    /// Per axis the first row of a leaf.
    rows: [u8; 3],
    /// Where the orders begin in [`super::octant::ORDER`] in which it visits children.
    pub(super) orders: u16,
}

impl Frame {
    /// A coordinate of the corners of a leaf's triangles along axis k.
    #[expect(
        unsafe_code,
        reason = "checks of nine rows take as long as their reading"
    )]
    #[inline(always)]
    pub(super) fn row(&self, leaf: &Leaf<'_>, k: usize, corner: usize) -> f32x8 {
        assert!(corner < 3);
        // SAFETY: these are rows of axes, by `Row::flights`.
        unsafe { leaf.row_at(usize::from(self.rows[k]), corner) }
    }
}

/// A flight as the vectors by which it is written. Narrower or wider copies of what was just written would wait
/// for memory.
pub(super) type Halves = [f32x8; 2];

/// A vector of rays about to take off.
#[derive(Clone, Copy)]
pub(super) struct Row {
    /// Along which axis directions are largest.
    pub(super) largest: [Mask; 3],
    pub(super) origin: [F32s; 3],
    /// 1/d.
    pub(super) reciprocal: [F32s; 3],
    /// x and y of the directions per z, in the frames of [`FramedRay`].
    pub(super) shear: [F32s; 2],
    pub(super) t: F32s,
    pub(super) primitive: U32s,
    pub(super) ray: U32s,
    /// Octants of the directions.
    pub(super) octant: U32s,
    pub(super) top: U32s,
}

impl Row {
    /// Gives `store` the flight of each lane, for a tree with coordinates up to `farthest` in size.
    ///
    /// Flights that `end` with any hit look from their far end on: surfaces next to where a ray starts are met at grazing
    /// angles, cost visits and seldom stop it. In shadow rays per CPU second: dragon 1.04 (7 % fewer nodes), Suzanne
    /// 1.04, Sponza 1.02, bunny, hairball and teapot 1.01.
    #[inline(always)]
    pub(super) fn flights(self, end: bool, farthest: f32, mut store: impl FnMut(usize, Halves)) {
        let [is_x, is_y, _] = self.largest;
        let framed = |[x, y, z]: [F32s; 3]| {
            let pick = |[a, b, c]: [F32s; 3]| is_x.select(a, is_y.select(b, c));
            [pick([y, z, x]), pick([z, x, y]), pick([x, y, z])]
        };
        let framed_u32 = |[x, y, z]: [U32s; 3]| {
            let pick = |[a, b, c]: [U32s; 3]| is_x.select_u32(a, is_y.select_u32(b, c));
            [pick([y, z, x]), pick([z, x, y]), pick([x, y, z])]
        };
        let [ox, oy, oz] = framed(self.origin);
        let [rx, ry, rz] = framed(self.reciprocal).map(|r| -r);
        let [sx, sy] = self.shear;
        let near = [0, 1, 2].map(|axis| {
            let side = self.octant >> axis as u32 & U32s::splat(1);
            (side << Node::SIDE.trailing_zeros()) + U32s::splat(Node::NEAR[0][axis])
        });
        let [near_x, near_y, near_z] = framed_u32(near);
        let rows = [0, 1, 2].map(|axis| U32s::splat(Leaf::first_row(axis) as u32));
        let [row_x, row_y, row_z] = framed_u32(rows);
        let order = self.octant ^ U32s::splat(if end { OCTANTS as u32 - 1 } else { 0 });
        // The bytes of a frame.
        let low = near_x | near_y << 8 | near_z << 16 | row_x << 24;
        let high = row_y | row_z << 8 | order << (16 + WIDTH as u32);
        let [primitive, ray, low, high, top] =
            [self.primitive, self.ray, low, high, self.top].map(bytemuck::cast::<U32s, F32s>);
        let [x, y, z] = self.origin.map(|o| o.abs());
        let reach = x.fast_max(y).fast_max(z) + F32s::splat(farthest);
        // More than an area can be, or a distance times one, by 24 products of offsets up to twice as large.
        let one = F32s::splat(1.0);
        let most = (reach * reach * F32s::splat(64.0)) * (one + reach * (one + rz.abs()));
        let doubt = most * F32s::splat(0.0);
        let end_padded = self.t * F32s::splat(FAR_PADDING) + doubt;
        // The fields of a flight.
        let columns: [F32s; 16] = [
            ox, oy, oz, sx, sy, rz, rx, ry, self.t, primitive, ray, low, high, doubt, end_padded,
            top,
        ];
        const PARTS: usize = LANES / 8;
        let columns: [[f32x8; PARTS]; 16] = bytemuck::cast(columns);
        for (part, lane) in (0..LANES).step_by(8).enumerate() {
            let [low, high] = [0, 8].map(|first| {
                f32x8::transpose([0, 1, 2, 3, 4, 5, 6, 7].map(|k| columns[first + k][part]))
            });
            for k in 0..8 {
                store(lane + k, [low[k], high[k]]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::testing::Rng;
    use crate::geometry::triangle::{frame_axes, shear_lanes};
    use crate::math::lanes::iota;
    use crate::math::vec3::Vec3s;

    #[test]
    fn flights_with_numbers_too_large_for_f32_hold_no_distance_for_too_far() {
        let one = F32s::splat(1.0);
        for size in [1.0, 1e3, 1e6, 1e9, 1e11, 1e13, 1e15, 1e18, 1e30] {
            let mut row = Row {
                largest: [Mask::ALL, Mask::NONE, Mask::NONE],
                origin: [one, -one, one],
                reciprocal: [one; 3],
                shear: [one; 2],
                t: one,
                primitive: iota(),
                ray: iota(),
                octant: U32s::splat(0),
                top: iota(),
            };
            let (mut far, mut large) = (0, 0);
            let count = |count: &mut usize, halves: Halves| {
                let mut flight: Flight = bytemuck::cast(halves);
                let before = flight.end;
                assert_eq!(flight.end_at_t(), FAR_PADDING);
                assert_eq!(before.to_bits(), flight.end.to_bits());
                *count += usize::from(before.is_nan());
            };
            row.flights(false, size, |_, halves| count(&mut large, halves));
            row.origin[2] = F32s::splat(-size);
            row.flights(true, 1.0, |_, halves| count(&mut far, halves));
            let expected = if size > 1e12 { LANES } else { 0 };
            assert_eq!((far, large), (expected, expected), "{size}");
        }
    }

    #[test]
    fn flights_hold_what_their_rays_say_in_the_frames_of_their_largest_axes() {
        let mut rng = Rng(9);
        for end in [false, true] {
            let mut lanes = || std::array::from_fn(|_| rng.uniform() - 0.5);
            let mut columns = || [0, 1, 2].map(|_: u8| lanes());
            let [origin, direction]: [[[f32; LANES]; 3]; 2] = [columns(), columns()];
            let [x, y, z] = direction.map(F32s::from);
            let reciprocal = [x, y, z].map(|d| F32s::splat(1.0) / d);
            let (largest, [u, v, _]) = shear_lanes(Vec3s { x, y, z }, reciprocal);
            let octants: [u32; LANES] = std::array::from_fn(|lane| {
                let side = |axis: usize| u32::from(direction[axis][lane] < 0.0) << axis;
                side(0) | side(1) | side(2)
            });
            let mut flights: [Halves; LANES] = [[f32x8::splat(0.0); 2]; LANES];
            let row = Row {
                largest,
                origin: origin.map(F32s::from),
                reciprocal,
                shear: [u, v],
                t: F32s::splat(3.0),
                primitive: iota() + U32s::splat(100),
                ray: iota() + U32s::splat(200),
                octant: U32s::from(octants),
                top: iota() + U32s::splat(300),
            };
            row.flights(end, 1.0, |k, halves| flights[k] = halves);
            for (lane, &flight) in flights.iter().enumerate() {
                let flight: Flight = bytemuck::cast(flight);
                let d = [0, 1, 2].map(|axis| direction[axis][lane]);
                let largest = (0..3)
                    .max_by(|&a, &b| d[a].abs().total_cmp(&d[b].abs()))
                    .unwrap();
                let axes = frame_axes(largest);
                let octant = octants[lane] as usize;
                assert_eq!(flight.framed.origin, axes.map(|axis| origin[axis][lane]));
                let z = d[largest];
                assert_eq!(
                    flight.framed.shear,
                    [d[axes[0]] * (1.0 / z), d[axes[1]] * (1.0 / z)]
                );
                assert_eq!(flight.framed.back, -1.0 / z);
                assert_eq!(flight.reciprocal, [-1.0 / d[axes[0]], -1.0 / d[axes[1]]]);
                assert_eq!((flight.t, flight.primitive), (3.0, 100 + lane as u32));
                assert_eq!((flight.end, flight.doubt), (3.0 * FAR_PADDING, 0.0));
                assert_eq!(
                    (flight.ray, flight.top),
                    (200 + lane as u32, 300 + lane as u32)
                );
                let near = axes.map(|axis| Node::NEAR[octant][axis] as u8);
                assert_eq!(flight.frame.near, near);
                let rows = axes.map(|axis| Leaf::first_row(axis) as u8);
                assert_eq!(flight.frame.rows, rows);
                let order = if end { OCTANTS - 1 - octant } else { octant };
                assert_eq!(usize::from(flight.frame.orders), order << WIDTH);
            }
        }
    }
}
