//! Mirrors and smooth boundaries of glass: scattering into one or two directions.

use glam::DVec3;

use super::bsdf::Bsdf;
use super::random::Random;
use crate::scene::Fresnel;

/// A perfectly smooth surface.
#[derive(Debug, Clone, Copy)]
pub(super) enum Specular {
    /// Reflectance.
    Mirror(DVec3),
    /// The boundary of glass.
    Dielectric(Dielectric),
}

/// Glass as the scene describes it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Dielectric {
    /// Index of refraction inside over outside.
    pub(super) ior: f64,
    /// Reflectance formula.
    pub(super) formula: Fresnel,
}

/// What becomes of a ray at a smooth surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Split {
    /// Share of the reflected branch, in [0, 1]; that of the refracted one is the rest.
    pub(super) reflectance: f64,
    pub(super) reflected: Branch,
    /// `None` at a mirror and in total internal reflection, where the reflectance is 1.
    pub(super) refracted: Option<Branch>,
}

/// A ray that goes on from a smooth surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Branch {
    /// Unit length.
    pub(super) direction: DVec3,
    /// What radiance from there is multiplied with, beside the branch's share.
    pub(super) weight: DVec3,
    /// Index of refraction of the side that the ray goes to over the side that it comes from.
    pub(super) eta: f64,
    pub(super) is_refracted: bool,
}

impl Specular {
    /// Splits a ray of unit `direction` at a point with unit shading `normal`, on the
    /// geometric normal's side.
    pub(super) fn split(&self, direction: DVec3, normal: DVec3) -> Split {
        match self {
            Self::Mirror(reflectance) => Split {
                reflectance: 1.0,
                reflected: Branch {
                    weight: *reflectance,
                    ..reflected(direction, normal)
                },
                refracted: None,
            },
            Self::Dielectric(dielectric) => dielectric.split(direction, normal),
        }
    }
}

impl Bsdf {
    /// The ray itself, where it meets a point with unit `normal` as if there were no surface; it keeps
    /// the scale of radiance on either side of the boundary of glass.
    pub(super) fn straight(bsdf: Option<&Self>, direction: DVec3, normal: DVec3) -> Branch {
        let eta = match bsdf {
            Some(Self::Specular(Specular::Dielectric(glass))) if direction.dot(normal) < 0.0 => {
                glass.ior
            }
            Some(Self::Specular(Specular::Dielectric(glass))) => 1.0 / glass.ior,
            _ => 1.0,
        };
        Branch {
            direction,
            weight: DVec3::splat(1.0 / (eta * eta)),
            eta,
            is_refracted: false,
        }
    }
}

impl Branch {
    /// The branch with its share in its weight.
    pub(super) fn with_share(self, share: f64) -> Self {
        Self {
            weight: self.weight * share,
            ..self
        }
    }
}

impl Split {
    /// One branch with its share as its probability.
    pub(super) fn choose(&self, random: &mut Random) -> Branch {
        match self.refracted {
            Some(refracted) if random.next() >= self.reflectance => refracted,
            _ => self.reflected,
        }
    }
}

impl Dielectric {
    /// Splits a ray of unit `direction` at a point with unit `normal` out of the glass.
    pub(super) fn split(&self, direction: DVec3, normal: DVec3) -> Split {
        let entering = direction.dot(normal) < 0.0;
        let (facing, eta) = if entering {
            (normal, self.ior)
        } else {
            (-normal, 1.0 / self.ior)
        };
        let reflected = reflected(direction, normal);
        let cos_i = -direction.dot(facing);
        // Snell's law for the tangential part; its length is the sine.
        let tangential = (direction + facing * cos_i) / eta;
        let sin2_t = tangential.length_squared();
        if sin2_t >= 1.0 {
            return Split {
                reflectance: 1.0,
                reflected,
                refracted: None,
            };
        }
        let cos_t = (1.0 - sin2_t).sqrt();
        let reflectance = match self.formula {
            Fresnel::Schlick => schlick(self.ior, if eta > 1.0 { cos_i } else { cos_t }),
            Fresnel::Exact => exact(eta, cos_i, cos_t),
        };
        let refracted = Branch {
            direction: (tangential - facing * cos_t).normalize(),
            // Radiance over the squared index is what a boundary transmits (Veach 1997, 5.2).
            weight: DVec3::splat(1.0 / (eta * eta)),
            eta,
            is_refracted: true,
        };
        Split {
            reflectance,
            reflected,
            refracted: Some(refracted),
        }
    }
}

/// The mirrored ray, with weight 1.
fn reflected(direction: DVec3, normal: DVec3) -> Branch {
    let direction = direction - normal * (2.0 * direction.dot(normal));
    Branch {
        direction,
        weight: DVec3::ONE,
        eta: 1.0,
        is_refracted: false,
    }
}

/// Schlick's approximation (1994) with the cosine on the optically thin side.
fn schlick(ior: f64, cos_thin: f64) -> f64 {
    let r0 = ((ior - 1.0) / (ior + 1.0)).powi(2);
    r0 + (1.0 - r0) * (1.0 - cos_thin).powi(5)
}

/// Reflectance of unpolarised light by Fresnel's equations; `eta` is n_t/n_i.
fn exact(eta: f64, cos_i: f64, cos_t: f64) -> f64 {
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    0.5 * (perpendicular * perpendicular + parallel * parallel)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ray_at(degrees: f64) -> DVec3 {
        let (sin, cos) = degrees.to_radians().sin_cos();
        DVec3::new(sin, 0.0, -cos)
    }

    #[test]
    fn reflectances_match_the_published_table() {
        // Degrees, then exact and Schlick for n = 1.5 and n = 1.75.
        let table = [
            (0.0, [0.040000, 0.040000, 0.074380, 0.074380]),
            (30.0, [0.041523, 0.040041, 0.076222, 0.074420]),
            (45.0, [0.050240, 0.042069, 0.086214, 0.076375]),
            (60.0, [0.089187, 0.070000, 0.127579, 0.103306]),
            (80.0, [0.387704, 0.409910, 0.415530, 0.431043]),
            (89.0, [0.904185, 0.919102, 0.907095, 0.921999]),
        ];
        for (degrees, row) in table {
            let glasses = [
                (1.5, Fresnel::Exact),
                (1.5, Fresnel::Schlick),
                (1.75, Fresnel::Exact),
                (1.75, Fresnel::Schlick),
            ];
            for ((ior, formula), expected) in glasses.into_iter().zip(row) {
                let got = Dielectric { ior, formula }
                    .split(ray_at(degrees), DVec3::Z)
                    .reflectance;
                // The table has six digits.
                assert!(
                    (got - expected).abs() <= 5.1e-7,
                    "{ior} {formula:?} at {degrees}°: {got}"
                );
            }
        }
    }

    #[test]
    fn a_refracted_ray_traced_back_meets_the_same_reflectance() {
        for ior in [1.5, 2.4, 0.7] {
            for formula in [Fresnel::Exact, Fresnel::Schlick] {
                let glass = Dielectric { ior, formula };
                for degrees in [0.0, 10.0, 30.0, 44.0] {
                    let there = glass.split(ray_at(degrees), DVec3::Z);
                    let inside = there.refracted.expect("below the critical angle");
                    let back = glass.split(-inside.direction, DVec3::Z);
                    assert!((there.reflectance - back.reflectance).abs() < 1e-13);
                    let outside = back.refracted.expect("the way back is open");
                    assert!((outside.direction + ray_at(degrees)).length() < 1e-13);
                    assert!((inside.weight * outside.weight - 1.0).length() < 1e-13);
                    assert!(
                        (inside.eta - ior).abs() < 1e-15 && (outside.eta * ior - 1.0).abs() < 1e-15
                    );
                }
            }
        }
    }

    #[test]
    fn snell_holds_and_reflection_is_total_beyond_the_critical_angle() {
        let glass = Dielectric {
            ior: 1.5,
            formula: Fresnel::Exact,
        };
        let refracted = glass
            .split(ray_at(60.0), DVec3::Z)
            .refracted
            .expect("entering glass");
        assert!((refracted.direction.x * 1.5 - 60f64.to_radians().sin()).abs() < 1e-15);
        // The critical angle of n = 1.5 is 41.8103°; the ray leaves through the other side.
        assert!(glass.split(ray_at(41.81), -DVec3::Z).refracted.is_some());
        let total = glass.split(ray_at(41.811), -DVec3::Z);
        assert!(total.refracted.is_none() && total.reflectance == 1.0);
    }

    #[test]
    fn equal_indices_change_nothing() {
        let nothing = Dielectric {
            ior: 1.0,
            formula: Fresnel::Exact,
        };
        let split = nothing.split(ray_at(70.0), DVec3::Z);
        assert!(split.reflectance < 1e-30);
        let refracted = split.refracted.expect("no boundary");
        assert!((refracted.direction - ray_at(70.0)).length() < 1e-15);
        assert_eq!(refracted.weight, DVec3::ONE);
    }

    #[test]
    fn mirrors_reflect_on_both_sides() {
        let mirror = Specular::Mirror(DVec3::new(0.9, 0.5, 0.1));
        for normal in [DVec3::Z, -DVec3::Z] {
            let split = mirror.split(ray_at(30.0), normal);
            let upward = ray_at(30.0) * DVec3::new(1.0, 1.0, -1.0);
            assert!((split.reflected.direction - upward).length() < 1e-15);
            assert_eq!(split.reflected.weight, DVec3::new(0.9, 0.5, 0.1));
            assert!(split.refracted.is_none() && split.reflectance == 1.0);
        }
    }
}
