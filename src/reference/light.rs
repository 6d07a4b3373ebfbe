//! Sampling of lights: one of them by its power, then a direction towards it.
//!
//! Every density is per solid angle at the lit point and includes the choice of the light.
//! Rectangles and triangles are sampled by solid angle, which bounds the variance also where a light
//! touches a surface.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::primitives::{Hit, PatchId};
use super::random::Random;
use super::rectangle::SphericalRectangle;
use super::triangle::SphericalTriangle;
use super::warp::{
    Frame, cosine_hemisphere, cosine_hemisphere_pdf, uniform_sphere, uniform_triangle,
};
use crate::scene::EmissionDescription;

/// Solid angle in sr below which a rectangle or a triangle is sampled by area: by then the rounding of the solid
/// angle, some units of 2⁻⁵², is 10⁻⁸ of it, and the two ways hardly differ unless the light is seen edge-on.
const LEAST_SOLID_ANGLE: f64 = 1e-7;

/// A point on a surface as seen by light.
#[derive(Debug, Clone, Copy)]
pub(super) struct Vertex {
    /// Just outside of the surface's rounding error, on the side from where the path came.
    pub(super) point: DVec3,
    /// Unit shading normal on the side from where the path came.
    pub(super) normal: DVec3,
    /// Unit geometric normal on that side.
    pub(super) face: DVec3,
    /// The patch that it lies on.
    pub(super) patch: PatchId,
}

/// Something that sends light.
#[derive(Debug, Clone, Copy)]
pub(super) enum Light {
    /// An emissive primitive.
    Area(AreaLight),
    /// Position and radiant intensity.
    Point(DVec3, DVec3),
    /// Radiance of everything beyond the scene, and the radius of the scene.
    Background(DVec3, f64),
}

/// An emissive primitive.
#[derive(Debug, Clone, Copy)]
pub(super) struct AreaLight {
    pub(super) shape: LightShape,
    pub(super) emission: EmissionDescription,
    pub(super) patch: PatchId,
    /// Bound of the distance between a computed point of the primitive and its surface.
    pub(super) position_error: f64,
    /// Total area in scene units².
    pub(super) area: f64,
}

/// Where an emissive primitive lies.
#[derive(Debug, Clone, Copy)]
pub(super) enum LightShape {
    /// A corner and the edges from it.
    Triangle(DVec3, [DVec3; 2]),
    /// A corner and the edges from it, at right angles.
    Rectangle(DVec3, [DVec3; 2]),
    /// Centre and radius.
    Sphere(DVec3, f64),
}

/// A direction from which light may arrive, if nothing is in the way.
#[derive(Debug, Clone, Copy)]
pub(super) struct LightSample {
    /// Unit vector to the light.
    pub(super) direction: DVec3,
    /// Distance of the light, infinite for the background.
    pub(super) distance: f64,
    /// Radiance (of a point light: irradiance on a surface that faces it).
    pub(super) radiance: DVec3,
    /// Density per solid angle (of a point light: probability).
    pub(super) pdf: f64,
    /// Whether no other ray can find this light.
    pub(super) is_delta: bool,
}

/// Radiance that leaves a surface with unit geometric `normal` against `direction`.
pub(super) fn emitted(emission: &EmissionDescription, normal: DVec3, direction: DVec3) -> DVec3 {
    if emission.two_sided || direction.dot(normal) < 0.0 {
        emission.radiance
    } else {
        DVec3::ZERO
    }
}

impl Light {
    /// Emitted power in watts, mean of the channels.
    fn power(&self) -> f64 {
        let mean = |rgb: &DVec3| rgb.element_sum() / 3.0;
        match self {
            Self::Area(light) => {
                let sides = if light.emission.two_sided { 2.0 } else { 1.0 };
                PI * light.area * mean(&light.emission.radiance) * sides
            }
            Self::Point(_, intensity) => 4.0 * PI * mean(intensity),
            Self::Background(radiance, scene_radius) => {
                PI * scene_radius * scene_radius * PI * mean(radiance)
            }
        }
    }
}

impl AreaLight {
    pub(super) fn triangle(
        [a, b, c]: [DVec3; 3],
        emission: EmissionDescription,
        patch: PatchId,
        position_error: f64,
    ) -> Self {
        let [ab, ac] = [b - a, c - a];
        let area = 0.5 * ab.cross(ac).length();
        Self {
            shape: LightShape::Triangle(a, [ab, ac]),
            emission,
            patch,
            position_error,
            area,
        }
    }

    pub(super) fn rectangle(
        corner: DVec3,
        edges: [DVec3; 2],
        emission: EmissionDescription,
        patch: PatchId,
        position_error: f64,
    ) -> Self {
        let area = edges[0].cross(edges[1]).length();
        Self {
            shape: LightShape::Rectangle(corner, edges),
            emission,
            patch,
            position_error,
            area,
        }
    }

    pub(super) fn sphere(
        center: DVec3,
        radius: f64,
        emission: EmissionDescription,
        patch: PatchId,
        position_error: f64,
    ) -> Self {
        let area = 4.0 * PI * radius * radius;
        Self {
            shape: LightShape::Sphere(center, radius),
            emission,
            patch,
            position_error,
            area,
        }
    }

    fn sample(&self, vertex: &Vertex, random: &mut Random) -> Option<LightSample> {
        let u = random.next_2d();
        let (position, normal) = match self.shape {
            // What is flat does not light itself.
            LightShape::Triangle(..) | LightShape::Rectangle(..) if vertex.patch == self.patch => {
                return None;
            }
            LightShape::Triangle(a, [ab, ac]) => {
                let normal = ab.cross(ac).normalize();
                let view = SphericalTriangle::new(a, [ab, ac], vertex.point);
                let position = if view.solid_angle >= LEAST_SOLID_ANGLE {
                    let direction = view.sample(u);
                    let height = (a - vertex.point).dot(normal);
                    vertex.point + direction * (height / direction.dot(normal))
                } else {
                    let [b, c] = uniform_triangle(u);
                    a + ab * b + ac * c
                };
                (position, normal)
            }
            LightShape::Rectangle(corner, [ex, ey]) => {
                let view = SphericalRectangle::new(corner, [ex, ey], vertex.point);
                let [a, b] = if view.solid_angle >= LEAST_SOLID_ANGLE {
                    view.sample(u)
                } else {
                    u
                };
                (corner + ex * a + ey * b, ex.cross(ey).normalize())
            }
            LightShape::Sphere(center, radius) => {
                let normal = match SphereCone::new(vertex.point, center, radius) {
                    None => uniform_sphere(u),
                    // The outside of a sphere does not light itself.
                    Some(_) if vertex.patch == self.patch => return None,
                    Some(cone) => cone.sample_normal(u),
                };
                (center + normal * radius, normal)
            }
        };
        // End just outside of the light, as the ray starts just outside of its surface: neither
        // the light itself nor what lies in its plane hides it.
        let side = (vertex.point - position).dot(normal).signum();
        let to_light = position + normal * (side * self.position_error) - vertex.point;
        let distance = to_light.length();
        let direction = to_light / distance;
        let radiance = emitted(&self.emission, normal, direction);
        let pdf = self.pdf(vertex, direction, distance, normal);
        (pdf.is_finite() && radiance != DVec3::ZERO).then_some(LightSample {
            direction,
            distance,
            radiance,
            pdf,
            is_delta: false,
        })
    }

    /// Density of the direction of [`Self::sample`] per solid angle, where `direction` meets the
    /// light at this distance and this unit geometric normal.
    fn pdf(&self, vertex: &Vertex, direction: DVec3, distance: f64, normal: DVec3) -> f64 {
        if let LightShape::Sphere(center, radius) = self.shape
            && let Some(cone) = SphereCone::new(vertex.point, center, radius)
        {
            return 1.0 / (TAU * cone.one_minus_cos);
        }
        if let LightShape::Rectangle(corner, edges) = self.shape {
            let view = SphericalRectangle::new(corner, edges, vertex.point);
            if view.solid_angle >= LEAST_SOLID_ANGLE {
                return 1.0 / view.solid_angle;
            }
        }
        if let LightShape::Triangle(corner, edges) = self.shape {
            let view = SphericalTriangle::new(corner, edges, vertex.point);
            if view.solid_angle >= LEAST_SOLID_ANGLE {
                return 1.0 / view.solid_angle;
            }
        }
        distance * distance / (direction.dot(normal).abs() * self.area)
    }
}

/// The cone under which a sphere is seen from outside.
struct SphereCone {
    /// Unit vector to the centre.
    axis: DVec3,
    /// Radius over the distance of the centre.
    sin: f64,
    /// 1 − cos of the half-angle.
    one_minus_cos: f64,
}

impl SphereCone {
    /// `None` from inside of the sphere.
    fn new(from: DVec3, center: DVec3, radius: f64) -> Option<Self> {
        let to_center = center - from;
        let distance = to_center.length();
        if distance <= radius {
            return None;
        }
        let sin = radius / distance;
        let cos = ((distance - radius) * (distance + radius)).sqrt() / distance;
        // Not taken as a difference, which cancels for small spheres.
        Some(Self {
            axis: to_center / distance,
            sin,
            one_minus_cos: sin * sin / (1.0 + cos),
        })
    }

    /// Outward unit normal of the sphere at the near end of a direction uniform in the cone.
    fn sample_normal(&self, u: [f64; 2]) -> DVec3 {
        let one_minus_cos = u[0] * self.one_minus_cos;
        let cos_theta = 1.0 - one_minus_cos;
        let sin2_theta = one_minus_cos * (2.0 - one_minus_cos);
        let direction = Frame::about(self.axis).direction(cos_theta, sin2_theta.sqrt(), TAU * u[1]);
        // In units of the distance of the centre.
        let half_chord = (self.sin * self.sin - sin2_theta).max(0.0).sqrt();
        (direction * (cos_theta - half_chord) - self.axis).normalize()
    }
}

/// The lights of a scene that shadow rays look for.
#[derive(Debug)]
pub(super) struct Lights {
    lights: Vec<Light>,
    /// Power of each light over that of all.
    probabilities: Vec<f64>,
    /// Sum of the powers up to and including each light.
    cumulative: Vec<f64>,
}

impl Lights {
    /// A table of lights that are not black; they keep their indices.
    pub(super) fn new(lights: Vec<Light>) -> Self {
        let mut total = 0.0;
        let cumulative: Vec<f64> = lights
            .iter()
            .map(|light| {
                total += light.power();
                total
            })
            .collect();
        let probabilities = lights.iter().map(|light| light.power() / total).collect();
        Self {
            lights,
            probabilities,
            cumulative,
        }
    }

    /// Light that may arrive at `vertex` from its side of the surface; `None` if there is none.
    pub(super) fn sample(&self, vertex: &Vertex, random: &mut Random) -> Option<LightSample> {
        let threshold = random.next() * self.cumulative.last()?;
        let last = self.lights.len() - 1;
        let chosen = self
            .cumulative
            .partition_point(|&sum| sum <= threshold)
            .min(last);
        let sample = match &self.lights[chosen] {
            Light::Area(light) => light.sample(vertex, random)?,
            &Light::Point(position, intensity) => {
                let to_light = position - vertex.point;
                let distance = to_light.length();
                LightSample {
                    direction: to_light / distance,
                    distance,
                    radiance: intensity / (distance * distance),
                    pdf: 1.0,
                    is_delta: true,
                }
            }
            &Light::Background(radiance, _) => {
                let direction = cosine_hemisphere(vertex.normal, random.next_2d());
                LightSample {
                    direction,
                    distance: f64::INFINITY,
                    radiance,
                    pdf: cosine_hemisphere_pdf(vertex.normal.dot(direction)),
                    is_delta: false,
                }
            }
        };
        Some(LightSample {
            pdf: sample.pdf * self.probabilities[chosen],
            ..sample
        })
    }

    /// Density with which [`Self::sample`] finds `light` in a direction that ends at `hit`, or
    /// leaves the scene.
    pub(super) fn pdf(
        &self,
        light: usize,
        vertex: &Vertex,
        direction: DVec3,
        hit: Option<&Hit>,
    ) -> f64 {
        let pdf = match (&self.lights[light], hit) {
            (Light::Area(light), Some(hit)) => light.pdf(vertex, direction, hit.t, hit.normal),
            (Light::Background(..), None) => cosine_hemisphere_pdf(vertex.normal.dot(direction)),
            // No ray hits a point light.
            _ => 0.0,
        };
        pdf * self.probabilities[light]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::primitives::{Primitives, Ray};

    const EMISSION: EmissionDescription = EmissionDescription {
        radiance: DVec3::ONE,
        two_sided: true,
    };

    /// A vertex in mid-air that faces up.
    fn vertex(point: DVec3) -> Vertex {
        Vertex {
            point,
            normal: DVec3::Z,
            face: DVec3::Z,
            patch: PatchId::NONE,
        }
    }

    /// The patch of something other than [`vertex`].
    fn patch() -> PatchId {
        let mut primitives = Primitives::default();
        primitives.add_sphere(DVec3::ZERO, 1.0);
        primitives.patch(0)
    }

    /// The solid angle of a light by light sampling, ∫ 1 dω = E[1/pdf], and the moment ∫ ω_z dω,
    /// each with its standard error.
    fn moments(lights: &Lights, vertex: &Vertex) -> [[f64; 2]; 2] {
        let mut random = Random::new(7, 0, 0, 0);
        let n = 20_000;
        let mut sums = [[0.0; 2]; 2];
        for _ in 0..n {
            let values = lights
                .sample(vertex, &mut random)
                .map_or([0.0; 2], |light| {
                    [1.0 / light.pdf, light.direction.z / light.pdf]
                });
            for (sum, value) in sums.iter_mut().zip(values) {
                sum[0] += value;
                sum[1] += value * value;
            }
        }
        sums.map(|[sum, square]| {
            let mean = sum / f64::from(n);
            let variance = square / f64::from(n) - mean * mean;
            [mean, (variance.max(0.0) / f64::from(n)).sqrt()]
        })
    }

    fn assert_close([value, error]: [f64; 2], expected: f64) {
        let tolerance = 4.0 * error + 1e-12 * expected.abs();
        assert!(
            (value - expected).abs() <= tolerance,
            "{value} ± {error}, not {expected}"
        );
    }

    #[test]
    fn one_over_the_pdf_integrates_to_the_solid_angle_of_the_light() {
        // Under the corner of a unit square at height 1: π/6 for the square, half for each half.
        let square = |b, c| AreaLight::triangle([DVec3::Z, b, c], EMISSION, patch(), 0.0);
        let (x, y, xy) = (
            DVec3::new(1.0, 0.0, 1.0),
            DVec3::new(0.0, 1.0, 1.0),
            DVec3::new(1.0, 1.0, 1.0),
        );
        let lights = Lights::new(vec![Light::Area(square(x, xy)), Light::Area(square(xy, y))]);
        let [solid_angle, _] = moments(&lights, &vertex(DVec3::ZERO));
        assert_close(solid_angle, PI / 6.0);

        for radius in [0.9, 0.1, 1e-5] {
            let sphere = AreaLight::sphere(DVec3::Z, radius, EMISSION, patch(), 0.0);
            let [solid_angle, moment] = moments(
                &Lights::new(vec![Light::Area(sphere)]),
                &vertex(DVec3::ZERO),
            );
            let cos = (1.0 - radius * radius).sqrt();
            assert_close(solid_angle, TAU * radius * radius / (1.0 + cos));
            assert_close(moment, PI * radius * radius);
        }

        let around = AreaLight::sphere(DVec3::Z * 0.3, 0.7, EMISSION, patch(), 0.0);
        let [solid_angle, moment] = moments(
            &Lights::new(vec![Light::Area(around)]),
            &vertex(DVec3::ZERO),
        );
        assert_close(solid_angle, 4.0 * PI);
        assert_close(moment, 0.0);

        let background = Lights::new(vec![Light::Background(DVec3::ONE, 1.0)]);
        let [_, moment] = moments(&background, &vertex(DVec3::ZERO));
        assert_close(moment, PI);
    }

    #[test]
    fn a_ray_towards_a_sample_finds_the_same_density_at_its_hit() {
        let center = DVec3::new(0.2, 0.1, 2.0);
        let corners = [
            DVec3::Z,
            DVec3::new(1.0, 0.0, 1.5),
            DVec3::new(0.0, 1.0, 2.0),
        ];
        let mut primitives = Primitives::default();
        primitives.add_triangle(corners);
        primitives.add_sphere(center, 0.5);
        let triangle = AreaLight::triangle(corners, EMISSION, primitives.patch(0), 0.0);
        let sphere = AreaLight::sphere(center, 0.5, EMISSION, primitives.patch(1), 0.0);
        let lights = Lights::new(vec![Light::Area(triangle), Light::Area(sphere)]);
        let mut random = Random::new(3, 0, 0, 0);
        let mut found = [0; 2];
        for point in [DVec3::new(0.3, 0.2, -1.0), center + DVec3::X * 0.2] {
            for _ in 0..1000 {
                let vertex = vertex(point);
                let light = lights
                    .sample(&vertex, &mut random)
                    .expect("both lights emit");
                let ray = Ray {
                    origin: point,
                    direction: light.direction,
                    t_min: 0.0,
                    start: PatchId::NONE,
                };
                let hit = primitives
                    .closest(&ray)
                    .expect("the sample lies on a light");
                if (hit.t - light.distance).abs() < 1e-6 {
                    let pdf = lights.pdf(hit.primitive, &vertex, light.direction, Some(&hit));
                    assert!(
                        (pdf / light.pdf - 1.0).abs() < 1e-6,
                        "{pdf}, not {}",
                        light.pdf
                    );
                    found[hit.primitive] += 1;
                }
            }
        }
        assert!(found.iter().all(|&count| count > 100), "{found:?}");
    }

    #[test]
    fn lights_are_chosen_by_power_and_black_ones_never() {
        let point = |intensity| Light::Point(DVec3::Z, DVec3::splat(intensity));
        let lights = Lights::new(vec![point(1.0), point(0.0), point(3.0)]);
        let mut random = Random::new(1, 0, 0, 0);
        let n = 40_000;
        let mut bright = 0;
        for _ in 0..n {
            let light = lights
                .sample(&vertex(DVec3::ZERO), &mut random)
                .expect("there are lights");
            assert_eq!(light.pdf, light.radiance.x / 4.0);
            assert!(light.radiance.x > 0.0);
            bright += i32::from(light.radiance.x == 3.0);
        }
        let z = (f64::from(bright) / f64::from(n) - 0.75) / (0.75 * 0.25 / f64::from(n)).sqrt();
        assert!(z.abs() < 4.0, "z = {z}");
        assert!(
            Lights::new(Vec::new())
                .sample(&vertex(DVec3::ZERO), &mut random)
                .is_none()
        );
    }

    #[test]
    fn the_outside_of_a_sphere_does_not_light_itself_but_the_inside_does() {
        let patch = patch();
        let sphere = AreaLight::sphere(DVec3::ZERO, 1.0, EMISSION, patch, 0.0);
        let lights = Lights::new(vec![Light::Area(sphere)]);
        let mut random = Random::new(1, 0, 0, 0);
        let outside = Vertex {
            point: DVec3::Z * (1.0 + 1e-14),
            normal: DVec3::Z,
            face: DVec3::Z,
            patch,
        };
        let inside = Vertex {
            point: DVec3::Z * (1.0 - 1e-14),
            normal: -DVec3::Z,
            face: -DVec3::Z,
            patch,
        };
        assert!(lights.sample(&outside, &mut random).is_none());
        assert!(lights.sample(&inside, &mut random).is_some());
    }
}
