//! Lights: one table for a scene, and kernels on lanes of reference points that sample it.
//!
//! A light is chosen in proportion to its power, then a direction towards it. All densities are per
//! steradian seen from the reference point and contain the probability of the choice; a point
//! light's is that probability alone (a delta). Directions are of unit length and point from the
//! reference point to the light. Lanes that hold nothing may hold anything, NaN included; their
//! results mean nothing.
//!
//! The kernels are compiled for a set of [`kinds`]: what a scene does not have costs it nothing. An
//! instance for more kinds than the scene has gives the same numbers to the last bit. Bits of a set
//! beyond [`kinds::ALL`] are ignored.

mod background;
mod choice;
mod flat;
mod point;
mod rectangle;
mod sphere;
#[cfg(test)]
mod tests;
mod triangle;

pub use background::pdf_background;
pub use flat::pdf_flat;
pub use sphere::pdf_sphere;

use choice::LightChoice;

use crate::error::Result;
use crate::geometry::PrimitiveId;
use crate::math::table::Entry;
use crate::math::{Compare, F32s, Mask, Table, U32s, Vec3s};

/// Bits of the sets of light kinds that kernels are compiled for.
pub mod kinds {
    /// Triangles and parallelograms.
    pub const FLAT: u32 = 1;
    /// Spheres.
    pub const SPHERE: u32 = 2;
    /// Points.
    pub const POINT: u32 = 4;
    /// Constant background.
    pub const BACKGROUND: u32 = 8;
    /// There is more than one light: one must be chosen and looked up.
    pub const MANY: u32 = 16;
    /// Everything.
    pub const ALL: u32 = FLAT | SPHERE | POINT | BACKGROUND | MANY;
}

/// A light as it is put into the table, in traced coordinates. Radiances in W·sr⁻¹·m⁻², linear RGB,
/// finite, ≥ 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Light {
    /// A triangle or a parallelogram.
    Flat(FlatLight),
    /// A sphere.
    Sphere(SphereLight),
    /// A point.
    Point(PointLight),
    /// Everything that no surface hides.
    Background(BackgroundLight),
}

/// A triangle (corner, corner + edge 1, corner + edge 2) or a parallelogram that emits the same
/// radiance everywhere. Its front is the side of edge 1 × edge 2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlatLight {
    /// First corner.
    pub corner: [f32; 3],
    /// The two edges that leave it.
    pub edges: [[f32; 3]; 2],
    /// A triangle, or else a parallelogram.
    pub is_triangle: bool,
    /// Radiance.
    pub radiance: [f32; 3],
    /// Whether the back emits too.
    pub two_sided: bool,
    /// The primitives it is made of: of a parallelogram the triangle (corner, + edge 1, + both edges)
    /// and the triangle (corner, + both edges, + edge 2); of a triangle the first entry alone.
    pub primitives: [u32; 2],
}

/// A sphere that emits the same radiance everywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SphereLight {
    /// Centre.
    pub center: [f32; 3],
    /// Radius, > 0.
    pub radius: f32,
    /// Radiance.
    pub radiance: [f32; 3],
    /// Whether the inside emits too.
    pub two_sided: bool,
    /// Its primitive.
    pub primitive: u32,
}

/// An isotropic point light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointLight {
    /// Where.
    pub position: [f32; 3],
    /// Radiant intensity, W·sr⁻¹, linear RGB, finite, ≥ 0.
    pub intensity: [f32; 3],
}

/// The same radiance from every direction. A scene has at most one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BackgroundLight {
    /// Radiance.
    pub radiance: [f32; 3],
    /// Radius of a sphere around the scene: decides how often the background is chosen among other
    /// lights, nothing else.
    pub scene_radius: f32,
}

impl Light {
    /// Its bit in [`kinds`].
    pub const fn kind(&self) -> u32 {
        match self {
            Self::Flat(_) => kinds::FLAT,
            Self::Sphere(_) => kinds::SPHERE,
            Self::Point(_) => kinds::POINT,
            Self::Background(_) => kinds::BACKGROUND,
        }
    }

    /// Emitted power in W, the mean of the three channels. Of the background, what enters the scene's
    /// sphere.
    fn power(&self) -> f64 {
        let mean = |rgb: [f32; 3]| rgb.into_iter().map(f64::from).sum::<f64>() / 3.0;
        let sides = |two_sided: bool| if two_sided { 2.0 } else { 1.0 };
        let pi = std::f64::consts::PI;
        match self {
            Self::Flat(l) => pi * flat::area(l) * sides(l.two_sided) * mean(l.radiance),
            Self::Sphere(l) => {
                4.0 * pi * pi * f64::from(l.radius).powi(2) * sides(l.two_sided) * mean(l.radiance)
            }
            Self::Point(l) => 4.0 * pi * mean(l.intensity),
            Self::Background(l) => {
                4.0 * pi * pi * f64::from(l.scene_radius).powi(2) * mean(l.radiance)
            }
        }
    }
}

/// All lights of a scene in columns indexed by light, and the table that chooses among them.
#[derive(Debug, Clone, Default)]
pub struct LightTable {
    /// Bits of the lights in the table, with [`kinds::MANY`]; 0 if none has any power.
    kinds: u32,
    choice: LightChoice,
    background: Option<u32>,
    /// Bit of the light in [`kinds`].
    kind: Table<u32>,
    /// Radiance, or intensity of a point.
    radiance: [Table<f32>; 3],
    /// What the back emits of what the front does: 0 or 1.
    back: Table<f32>,
    /// Probability of the choice times the constant part of the kind's density.
    density: Table<f32>,
    /// Corner, centre or point.
    position: [Table<f32>; 3],
    /// Flat: first edge.
    edge1: [Table<f32>; 3],
    /// Flat: second edge.
    edge2: [Table<f32>; 3],
    /// Flat: unit normal.
    normal: [Table<f32>; 3],
    /// Flat: lengths of a rectangle's edges, 0 of other lights.
    sides: [Table<f32>; 2],
    /// Whether there is a rectangle.
    has_rectangles: bool,
    /// Flat: twice the area of a triangle that is sampled by solid angle, 0 of other lights.
    twice_area: Table<f32>,
    /// Whether there is such a triangle.
    has_triangles: bool,
    /// Flat: 1/2 for a triangle, 0 for a parallelogram (see [`crate::math::warp::triangle_or_square`]).
    fold: Table<f32>,
    /// Sphere: radius.
    radius: Table<f32>,
    /// First and second primitive; equal where there is one, `NONE` where there is none.
    primitives: [Table<u32>; 2],
}

/// One light's entries in the columns; what its kind does not have stays zero.
#[derive(Default)]
struct Row {
    radiance: [f32; 3],
    two_sided: bool,
    /// Density of the kind for a choice with probability 1.
    density: f64,
    position: [f32; 3],
    edges: [[f32; 3]; 2],
    normal: [f32; 3],
    sides: [f32; 2],
    twice_area: f32,
    fold: f32,
    radius: f32,
    primitives: [u32; 2],
}

impl LightTable {
    /// The table of these lights; light `i` has index `i`. Rectangles and triangles are sampled by solid
    /// angle.
    ///
    /// # Errors
    /// If there are more than 2²⁴ lights.
    pub fn new(lights: &[Light]) -> Result<Self> {
        Self::build(lights, flat::row)
    }

    /// As [`Self::new`], but all flat lights are sampled by area: for where direction
    /// sampling is combined with it. On the hexagonal room that halves the time of shading, 13.1 instead
    /// of 29.4 ns per hit.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn by_area(lights: &[Light]) -> Result<Self> {
        Self::build(lights, flat::row_by_area)
    }

    fn build(lights: &[Light], flat_row: fn(&FlatLight) -> Row) -> Result<Self> {
        let power: Vec<f64> = lights.iter().map(Light::power).collect();
        let (choice, probabilities) = LightChoice::new(&power)?;
        let mut table = Self {
            choice,
            ..Self::default()
        };
        for (light, probability) in lights.iter().zip(probabilities) {
            table.kinds |= light.kind();
            let row = match light {
                Light::Flat(light) => flat_row(light),
                Light::Sphere(light) => sphere::row(light),
                Light::Point(light) => point::row(light),
                Light::Background(light) => {
                    table.background = Some(table.kind.len() as u32);
                    background::row(light)
                }
            };
            table.push(light.kind(), probability, &row);
        }
        if lights.len() > 1 {
            table.kinds |= kinds::MANY;
        }
        if power.iter().all(|&power| power == 0.0) {
            table.kinds = 0;
        }
        Ok(table)
    }

    fn push(&mut self, kind: u32, probability: f32, row: &Row) {
        fn extend(columns: &mut [Table<f32>; 3], values: [f32; 3]) {
            for (column, value) in columns.iter_mut().zip(values) {
                column.push(value);
            }
        }
        self.kind.push(kind);
        extend(&mut self.radiance, row.radiance);
        self.back.push(if row.two_sided { 1.0 } else { 0.0 });
        self.density
            .push((f64::from(probability) * row.density) as f32);
        extend(&mut self.position, row.position);
        extend(&mut self.edge1, row.edges[0]);
        extend(&mut self.edge2, row.edges[1]);
        extend(&mut self.normal, row.normal);
        for (column, side) in self.sides.iter_mut().zip(row.sides) {
            column.push(side);
        }
        self.has_rectangles |= row.sides[0] > 0.0;
        self.twice_area.push(row.twice_area);
        self.has_triangles |= row.twice_area > 0.0;
        self.fold.push(row.fold);
        self.radius.push(row.radius);
        for (column, primitive) in self.primitives.iter_mut().zip(row.primitives) {
            column.push(primitive);
        }
    }

    /// The set of [`kinds`] that sampling meets; 0 if there is no light with any power, and then
    /// nothing may be sampled.
    pub fn kinds(&self) -> u32 {
        self.kinds
    }

    /// Number of lights.
    pub fn len(&self) -> usize {
        self.kind.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.kind.is_empty()
    }

    /// Index of the background among the lights.
    pub fn background(&self) -> Option<u32> {
        self.background
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        // Of each light: kind, two primitives, and 22 numbers.
        self.choice.bytes() + self.len() * (3 * size_of::<u32>() + 22 * size_of::<f32>())
    }

    /// What `column` has for each light; without [`kinds::MANY`] there is one light only.
    #[inline(always)]
    fn get<const KINDS: u32, T: Entry>(&self, column: &Table<T>, light: U32s) -> T::Lanes {
        if KINDS & kinds::MANY == 0 {
            T::splat(column[0])
        } else {
            column.get(light)
        }
    }

    #[inline(always)]
    fn get3<const KINDS: u32>(&self, [x, y, z]: &[Table<f32>; 3], light: U32s) -> Vec3s {
        Vec3s::new(
            self.get::<KINDS, f32>(x, light),
            self.get::<KINDS, f32>(y, light),
            self.get::<KINDS, f32>(z, light),
        )
    }
}

/// A direction towards a light, per lane.
#[derive(Debug, Clone, Copy)]
pub struct LightSample {
    /// From the reference point to the light, of unit length.
    pub direction: Vec3s,
    /// To the point on the light, ≥ 0; infinite for the background.
    pub distance: F32s,
    /// Radiance that arrives if nothing is in the way; of a point light, intensity / distance².
    pub radiance: Vec3s,
    /// Density of `direction`, with the probability of the choice; of a point light, that probability.
    pub pdf: F32s,
    /// Point lights, which no ray can hit.
    pub delta: Mask,
    /// The primitive the point lies on, or [`PrimitiveId::NONE`].
    pub primitive: U32s,
    /// Where light can arrive at all: elsewhere the light faces away.
    pub valid: Mask,
}

impl LightSample {
    /// `yes` where set, else `no`.
    #[inline(always)]
    fn select(mask: Mask, yes: Self, no: Self) -> Self {
        Self {
            direction: Vec3s::select(mask, yes.direction, no.direction),
            distance: mask.select(yes.distance, no.distance),
            radiance: Vec3s::select(mask, yes.radiance, no.radiance),
            pdf: mask.select(yes.pdf, no.pdf),
            delta: (mask & yes.delta) | (!mask & no.delta),
            primitive: mask.select_u32(yes.primitive, no.primitive),
            valid: (mask & yes.valid) | (!mask & no.valid),
        }
    }

    /// No light.
    #[inline(always)]
    fn none() -> Self {
        let zero = F32s::splat(0.0);
        Self {
            direction: Vec3s::zero(),
            distance: zero,
            radiance: Vec3s::zero(),
            pdf: zero,
            delta: Mask::NONE,
            primitive: U32s::splat(PrimitiveId::NONE),
            valid: Mask::NONE,
        }
    }
}

/// A point that light is wanted at, per lane.
#[derive(Debug, Clone, Copy)]
pub struct Receiver {
    /// The point.
    pub p: Vec3s,
    /// Unit shading normal on the side that light is wanted from; only the background uses it.
    pub n: Vec3s,
    /// The primitive that the point lies on, or [`PrimitiveId::NONE`]: rounding moves a point of an
    /// emitter to either side of it, but its own sphere can light it from within alone, and its own rectangle
    /// or triangle not at all.
    pub primitive: U32s,
}

/// A direction from the receivers towards some light, from three uniform numbers in [0, 1): the
/// first for the choice of the light (unused if there is one light only), two for the direction.
///
/// `KINDS` must contain [`LightTable::kinds`].
#[inline(always)]
pub fn sample<const KINDS: u32>(lights: &LightTable, at: &Receiver, u: [F32s; 3]) -> LightSample {
    let light = if KINDS & kinds::MANY == 0 {
        U32s::splat(0)
    } else {
        lights.choice.choose(u[0])
    };
    let [_, u1, u2] = u;
    match KINDS & kinds::ALL & !kinds::MANY {
        kinds::FLAT => flat::sample::<KINDS>(lights, light, at, u1, u2),
        kinds::SPHERE => sphere::sample::<KINDS>(lights, light, at, u1, u2),
        kinds::POINT => point::sample::<KINDS>(lights, light, at.p),
        kinds::BACKGROUND => background::sample::<KINDS>(lights, light, at.n, u1, u2),
        _ => {
            let kind = lights.get::<KINDS, u32>(&lights.kind, light);
            let is = |bit: u32| {
                if KINDS & bit == 0 {
                    Mask::NONE
                } else {
                    kind.eq(U32s::splat(bit))
                }
            };
            let mut found = LightSample::none();
            let flat = is(kinds::FLAT);
            if flat.any() {
                found = LightSample::select(
                    flat,
                    flat::sample::<KINDS>(lights, light, at, u1, u2),
                    found,
                );
            }
            let sphere = is(kinds::SPHERE);
            if sphere.any() {
                found = LightSample::select(
                    sphere,
                    sphere::sample::<KINDS>(lights, light, at, u1, u2),
                    found,
                );
            }
            let point = is(kinds::POINT);
            if point.any() {
                found =
                    LightSample::select(point, point::sample::<KINDS>(lights, light, at.p), found);
            }
            let background = is(kinds::BACKGROUND);
            if background.any() {
                let sampled = background::sample::<KINDS>(lights, light, at.n, u1, u2);
                found = LightSample::select(background, sampled, found);
            }
            found
        }
    }
}

/// Density with which [`sample`] finds, from the receivers, the point `hit` of `light`, `distance` along the unit
/// vector `direction`; 0 for point lights. For the background, `hit` and `distance` are not read.
#[inline(always)]
pub fn pdf<const KINDS: u32>(
    lights: &LightTable,
    light: U32s,
    at: &Receiver,
    hit: Vec3s,
    direction: Vec3s,
    distance: F32s,
) -> F32s {
    let zero = F32s::splat(0.0);
    match KINDS & kinds::ALL & !kinds::MANY {
        kinds::FLAT => pdf_flat::<KINDS>(lights, light, at, direction, distance),
        kinds::SPHERE => pdf_sphere::<KINDS>(lights, light, at, hit, direction, distance),
        kinds::POINT => zero,
        kinds::BACKGROUND => pdf_background::<KINDS>(lights, light, at.n.dot(direction)),
        _ => {
            let kind = lights.get::<KINDS, u32>(&lights.kind, light);
            let is = |bit: u32| {
                if KINDS & bit == 0 {
                    Mask::NONE
                } else {
                    kind.eq(U32s::splat(bit))
                }
            };
            let mut density = zero;
            let flat = is(kinds::FLAT);
            if flat.any() {
                density = flat.select(
                    pdf_flat::<KINDS>(lights, light, at, direction, distance),
                    density,
                );
            }
            let sphere = is(kinds::SPHERE);
            if sphere.any() {
                let pdf = pdf_sphere::<KINDS>(lights, light, at, hit, direction, distance);
                density = sphere.select(pdf, density);
            }
            let background = is(kinds::BACKGROUND);
            if background.any() {
                density = background.select(
                    pdf_background::<KINDS>(lights, light, at.n.dot(direction)),
                    density,
                );
            }
            density
        }
    }
}

/// Radiance that `light` sends along a ray that hits it, where `cos` is the cosine between its
/// geometric normal and the direction back along the ray. Of the background, give 1.
#[inline(always)]
pub fn emitted<const KINDS: u32>(lights: &LightTable, light: U32s, cos: F32s) -> Vec3s {
    let back = lights.get::<KINDS, f32>(&lights.back, light);
    let side = cos.gt(F32s::splat(0.0)).select(F32s::splat(1.0), back);
    lights.get3::<KINDS>(&lights.radiance, light) * side
}
