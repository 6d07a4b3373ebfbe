//! Triangles and parallelograms. Where light sampling stands alone, triangles and rectangles are
//! sampled uniformly in solid angle, with the density 1/Ω (see [`super::triangle`] and
//! [`super::rectangle`]); otherwise, as skew parallelograms always are, uniformly by area.
//!
//! With the area A and the cosine at the light, the density of the latter per steradian is
//! d²/(A·|cos|). Next to the light it has no finite variance on its own: combine it with direction
//! sampling.
//!
//! Source: Shirley, Wang, Zimmerman, "Monte Carlo Techniques for Direct Lighting Calculations", ACM
//! TOG 15(1), 1996, section 3.2.

use super::rectangle::{Side, SphericalRectangle};
use super::triangle::SphericalTriangle;
use super::{FlatLight, LightSample, LightTable, Receiver, Row};
use crate::math::warp::triangle_or_square;
use crate::math::{Compare, F32s, Mask, U32s, Vec3s};

/// Largest cosine between the edges of a parallelogram that counts as a rectangle. Corners rounded to
/// f32 turn the edges by 6·10⁻⁸ of their coordinates over the edges' lengths; points of so slight a
/// skew follow the density to the same relative accuracy.
const MOST_SKEW: f64 = 1e-5;

/// edge 1 × edge 2, in f64.
fn area_vector(light: &FlatLight) -> [f64; 3] {
    let [a, b] = light.edges.map(|edge| edge.map(f64::from));
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Area.
pub(super) fn area(light: &FlatLight) -> f64 {
    let parallelogram = area_vector(light).iter().map(|x| x * x).sum::<f64>().sqrt();
    if light.is_triangle {
        0.5 * parallelogram
    } else {
        parallelogram
    }
}

/// The lengths of the edges of a rectangle; 0 of anything else.
fn sides(light: &FlatLight) -> [f64; 2] {
    let [a, b] = light.edges.map(|edge| edge.map(f64::from));
    let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| a[k] * b[k]).sum::<f64>();
    let lengths = [a, b].map(|edge| dot(edge, edge).sqrt());
    let is_rectangle = dot(a, b).abs() <= MOST_SKEW * lengths[0] * lengths[1];
    if is_rectangle && !light.is_triangle {
        lengths
    } else {
        [0.0; 2]
    }
}

/// The columns' entries.
pub(super) fn row(light: &FlatLight) -> Row {
    let sides = sides(light);
    let twice_area = if light.is_triangle {
        2.0 * area(light)
    } else {
        0.0
    };
    let by_area = row_by_area(light);
    let by_solid_angle = twice_area > 0.0 || (sides[0] > 0.0 && by_area.density > 0.0);
    Row {
        density: if by_solid_angle { 1.0 } else { by_area.density },
        sides: sides.map(|side| side as f32),
        twice_area: twice_area as f32,
        ..by_area
    }
}

/// As [`row`], of a light that is sampled by area.
pub(super) fn row_by_area(light: &FlatLight) -> Row {
    let normal = area_vector(light);
    let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
    let area = area(light);
    Row {
        radiance: light.radiance,
        two_sided: light.two_sided,
        // A light without area has no power and is never chosen.
        density: if area > 0.0 { 1.0 / area } else { 0.0 },
        position: light.corner,
        edges: light.edges,
        normal: if length > 0.0 {
            normal.map(|x| (x / length) as f32)
        } else {
            [0.0; 3]
        },
        fold: if light.is_triangle { 0.5 } else { 0.0 },
        primitives: if light.is_triangle {
            [light.primitives[0]; 2]
        } else {
            light.primitives
        },
        ..Row::default()
    }
}

/// The density per steradian that belongs to `density` per area.
#[inline(always)]
fn per_steradian(density: F32s, cos: F32s, distance: F32s) -> F32s {
    density * (distance * distance) / cos.abs()
}

/// A flat light as it is seen from a point, where it is sampled by solid angle.
struct View {
    /// The lights that are rectangles; `None` if none is.
    rectangle: Option<(Mask, SphericalRectangle)>,
    /// The lights that are triangles; `None` if none is.
    triangle: Option<(Mask, SphericalTriangle)>,
}

impl View {
    /// From the point, the lights' first corners are at `to_corner`.
    #[inline(always)]
    fn new<const KINDS: u32>(lights: &LightTable, light: U32s, to_corner: Vec3s) -> Self {
        let zero = F32s::splat(0.0);
        let mut view = Self {
            rectangle: None,
            triangle: None,
        };
        if !lights.has_rectangles && !lights.has_triangles {
            return view;
        }
        let height = to_corner.dot(lights.get3::<KINDS>(&lights.normal, light));
        let edges = [&lights.edge1, &lights.edge2].map(|edge| lights.get3::<KINDS>(edge, light));
        if lights.has_rectangles {
            let lengths = lights
                .sides
                .each_ref()
                .map(|side| lights.get::<KINDS, f32>(side, light));
            let are = lengths[0].gt(zero);
            if are.any() {
                let side = |i: usize| Side {
                    from: to_corner.dot(edges[i]) / lengths[i],
                    length: lengths[i],
                };
                view.rectangle =
                    Some((are, SphericalRectangle::new(side(0), side(1), height.abs())));
            }
        }
        if lights.has_triangles {
            let twice_area = lights.get::<KINDS, f32>(&lights.twice_area, light);
            let are = twice_area.gt(zero);
            if are.any() {
                let seen = SphericalTriangle::new(to_corner, edges, twice_area, height);
                view.triangle = Some((are, seen));
            }
        }
        view
    }

    /// Where the light is sampled by solid angle, and that in sr.
    #[inline(always)]
    fn solid_angle(&self) -> (Mask, F32s) {
        let (mut all, mut solid_angle) = (Mask::NONE, F32s::splat(0.0));
        if let Some((are, view)) = &self.rectangle {
            (all, solid_angle) = (*are, view.solid_angle());
        }
        if let Some((are, view)) = &self.triangle {
            all = all | *are;
            solid_angle = are.select(view.solid_angle(), solid_angle);
        }
        (all, solid_angle)
    }
}

/// A point on the light and the direction to it.
#[inline(always)]
pub(super) fn sample<const KINDS: u32>(
    lights: &LightTable,
    light: U32s,
    at: &Receiver,
    u1: F32s,
    u2: F32s,
) -> LightSample {
    let zero = F32s::splat(0.0);
    let to_corner = lights.get3::<KINDS>(&lights.position, light) - at.p;
    let view = View::new::<KINDS>(lights, light, to_corner);
    let (mut b1, mut b2) =
        triangle_or_square(lights.get::<KINDS, f32>(&lights.fold, light), u1, u2);
    if let Some((are, view)) = &view.rectangle {
        let (s1, s2) = view.sample(u1, u2);
        (b1, b2) = (are.select(s1, b1), are.select(s2, b2));
    }
    let to_light = to_corner
        .add_scaled(lights.get3::<KINDS>(&lights.edge1, light), b1)
        .add_scaled(lights.get3::<KINDS>(&lights.edge2, light), b2);
    let mut distance = to_light.length_squared().sqrt();
    let mut direction = to_light * (F32s::splat(1.0) / distance);
    let normal = lights.get3::<KINDS>(&lights.normal, light);
    if let Some((are, view)) = &view.triangle {
        direction = Vec3s::select(*are, view.sample(u1, u2), direction);
        // Along a ray that grazes the plane rounding takes its place from it, but no farther than the triangle is.
        let along = to_corner.dot(normal).abs() / direction.dot(normal).abs();
        distance = are.select(along.fast_min(view.reach()), distance);
    }
    let cos = -direction.dot(normal);
    let two_sided = lights.get::<KINDS, f32>(&lights.back, light).gt(zero);
    // Of a triangle both are the same.
    let first = b1.ge(b2);
    let density = lights.get::<KINDS, f32>(&lights.density, light);
    let pdf = per_steradian(density, cos, distance);
    let primitives = lights
        .primitives
        .each_ref()
        .map(|primitive| lights.get::<KINDS, u32>(primitive, light));
    let (by_solid_angle, solid_angle) = view.solid_angle();
    // From its own plane nothing is seen of it; but rounding moves its points to either side, from where
    // it would fill half of all directions.
    let own = at.primitive.eq(primitives[0]) | at.primitive.eq(primitives[1]);
    LightSample {
        direction,
        distance,
        radiance: lights.get3::<KINDS>(&lights.radiance, light),
        pdf: by_solid_angle.select(density / solid_angle, pdf),
        delta: Mask::NONE,
        primitive: first.select_u32(primitives[0], primitives[1]),
        valid: (cos.gt(zero) | (two_sided & cos.lt(zero)))
            & (!by_solid_angle | (solid_angle.gt(zero) & !own)),
    }
}

/// Density per steradian with which [`super::sample`] finds, from the receivers, a point of a flat
/// light at `distance` along the unit vector `direction`, from either side.
#[inline(always)]
pub fn pdf_flat<const KINDS: u32>(
    lights: &LightTable,
    light: U32s,
    at: &Receiver,
    direction: Vec3s,
    distance: F32s,
) -> F32s {
    let density = lights.get::<KINDS, f32>(&lights.density, light);
    let cos = -direction.dot(lights.get3::<KINDS>(&lights.normal, light));
    let by_area = per_steradian(density, cos, distance);
    let to_corner = lights.get3::<KINDS>(&lights.position, light) - at.p;
    let (by_solid_angle, solid_angle) = View::new::<KINDS>(lights, light, to_corner).solid_angle();
    by_solid_angle.select(density / solid_angle, by_area)
}
