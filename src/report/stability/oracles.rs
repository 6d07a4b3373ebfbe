//! Closed forms that renderers are checked against. Grey light throughout.

use std::f64::consts::PI;

use glam::DVec3;

/// Irradiance at `point` with unit `normal` from a uniform polygon of radiance 1 that emits towards
/// it, corners in order (Lambert 1760; Baum et al. 1989). What is below the horizon is cut off.
pub fn polygon_irradiance(point: DVec3, normal: DVec3, corners: &[DVec3]) -> f64 {
    let height = |corner: DVec3| (corner - point).dot(normal);
    let edges = |corners: &[DVec3]| -> Vec<[DVec3; 2]> {
        (0..corners.len())
            .map(|i| [corners[i], corners[(i + 1) % corners.len()]])
            .collect()
    };
    let mut above = Vec::new();
    for [a, b] in edges(corners) {
        let (height_a, height_b) = (height(a), height(b));
        if height_a >= 0.0 {
            above.push(a);
        }
        if (height_a >= 0.0) != (height_b >= 0.0) {
            above.push(a.lerp(b, height_a / (height_a - height_b)));
        }
    }
    let sum: f64 = edges(&above)
        .into_iter()
        .map(|[a, b]| {
            let (a, b) = ((a - point).normalize(), (b - point).normalize());
            let cross = a.cross(b);
            let sin = cross.length();
            if sin > 0.0 {
                sin.atan2(a.dot(b)) * cross.dot(normal) / sin
            } else {
                0.0
            }
        })
        .sum();
    0.5 * sum.abs()
}

/// Irradiance from a sphere of radiance 1 whose centre is at this distance in a direction with this
/// cosine to the normal. Also where the horizon cuts the sphere (Snyder 1996).
pub fn sphere_irradiance(distance: f64, radius: f64, cos: f64) -> f64 {
    let sin_size = radius / distance;
    let cos_size = (1.0 - sin_size * sin_size).sqrt();
    let sin = (1.0 - cos * cos).sqrt();
    if cos >= sin_size {
        PI * sin_size * sin_size * cos
    } else if cos <= -sin_size {
        0.0
    } else {
        let root = (sin_size * sin_size - cos * cos).sqrt();
        cos * sin_size * sin_size * (-cos_size * cos / (sin_size * sin)).acos() - cos_size * root
            + root.atan2(cos_size)
    }
}

/// Radiance everywhere in a closed room of any shape whose walls emit 1 and have this albedo,
/// after so many bounces.
pub fn furnace(albedo: f64, bounces: u32) -> f64 {
    (0..=bounces).map(|k| albedo.powi(k as i32)).sum()
}

/// Radiance of the k-th bounce, k ≥ 1, at every point of a Lambertian sphere from which a plane
/// cuts a black cap of this share of the area that emits 1.
pub fn integrating_sphere_bounce(cap_share: f64, albedo: f64, k: u32) -> f64 {
    cap_share * albedo * (albedo * (1.0 - cap_share)).powi(k as i32 - 1)
}

/// Irradiance of the k-th bounce, k ≥ 1, at every point inside a Lambertian sphere with a point
/// light of intensity 1 anywhere in it.
pub fn point_in_sphere_bounce(radius: f64, albedo: f64, k: u32) -> f64 {
    albedo.powi(k as i32) / (radius * radius)
}

/// Irradiance on the inside of a Lambertian sphere around a concentric black one of radiance 1.
pub fn concentric_spheres_irradiance(inner: f64, outer: f64, albedo: f64) -> f64 {
    let share = (inner / outer).powi(2);
    PI * share / (1.0 - albedo * (1.0 - share))
}

/// Directional albedo of the Oren–Nayar A/B model with facets of albedo 1.
pub fn oren_nayar_albedo(sigma: f64, theta: f64) -> f64 {
    let (a, b) = if sigma.is_infinite() {
        (0.5, 0.45)
    } else {
        let s2 = sigma * sigma;
        (1.0 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09))
    };
    let (s, c) = theta.sin_cos();
    let bracket = s * (theta - s * c) / 2.0 + s * c * (1.0 + s + s * s) / (3.0 * (1.0 + s));
    a + 2.0 * b / PI * bracket
}

/// Directional albedo of the modified Phong model (n + 2)/2π·cosⁿα with reflectance 1, α from the mirror direction:
/// by quadrature, to 10⁻⁵.
pub fn phong_albedo(exponent: f64, theta: f64) -> f64 {
    let (sin_o, cos_o) = theta.sin_cos();
    // About the mirror direction, cosines to the normal are cos θ·cos α + sin θ·sin α·cos φ; over φ, those above the
    // horizon have a closed form. With x = cosⁿ⁺¹α what remains is a mean over x.
    let around = |x: f64| {
        let cos = x.powf(1.0 / (exponent + 1.0));
        let sin = ((1.0 - cos) * (1.0 + cos)).sqrt();
        let (a, b) = (cos_o * cos, sin_o * sin);
        if a >= b {
            return 2.0 * PI * a;
        }
        let end = (-a / b).acos();
        2.0 * (a * end + b * end.sin())
    };
    const STEPS: usize = 4000;
    let mean = (0..STEPS)
        .map(|i| around((i as f64 + 0.5) / STEPS as f64))
        .sum::<f64>()
        / STEPS as f64;
    (exponent + 2.0) / (2.0 * PI * (exponent + 1.0)) * mean
}

/// Reflectance of unpolarised light at a smooth boundary; `eta` is n_t/n_i.
pub fn fresnel(eta: f64, cos_i: f64) -> f64 {
    let sin2_t = (1.0 - cos_i * cos_i) / (eta * eta);
    if sin2_t >= 1.0 {
        return 1.0;
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let s = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    let p = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    (s * s + p * p) / 2.0
}

/// Share of the light that a clear plate lets through, all inner reflections included, where each
/// of its faces reflects this share.
pub fn slab_transmittance(face: f64) -> f64 {
    (1.0 - face) / (1.0 + face)
}

/// Reflections between the mirrors z = 0 and z = `gap` of a ray that starts at height `z` and
/// climbs by `slope` per metre, on its way to the end wall at this distance.
pub fn mirror_hall_bounces(z: f64, slope: f64, distance: f64, gap: f64) -> i32 {
    ((z + slope * distance) / gap).floor().abs() as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(value: f64, expected: f64, tolerance: f64) {
        assert!(
            (value - expected).abs() <= tolerance,
            "{value} is not {expected}"
        );
    }

    #[test]
    fn polygon_irradiance_matches_the_corner_and_wall_formulas() {
        let square = |x: f64, y: f64, a: f64, h: f64| {
            [[x, y], [x + a, y], [x + a, y + a], [x, y + a]].map(|[x, y]| DVec3::new(x, y, h))
        };
        let on_floor = |corners: &[DVec3]| polygon_irradiance(DVec3::ZERO, DVec3::Z, corners);
        close(on_floor(&square(0.0, 0.0, 1.0, 1.0)), 0.435209875684, 1e-12);
        close(
            on_floor(&square(-0.5, -0.5, 1.0, 1.0)),
            0.752274688454,
            1e-12,
        );
        close(
            on_floor(&square(-0.5, -0.5, 1.0, 0.01)),
            3.140564683433,
            1e-12,
        );
        // A wall that also reaches 1 m below the floor counts as if it ended there.
        let wall = |low: f64| {
            [[0.0, low], [1.0, low], [1.0, 1.0], [0.0, 1.0]].map(|[y, z]| DVec3::new(1.0, y, z))
        };
        close(on_floor(&wall(0.0)), 0.175094143857, 1e-12);
        close(on_floor(&wall(-1.0)), 0.175094143857, 1e-12);
        close(on_floor(&square(0.0, 0.0, 1.0, -1.0)), 0.0, 0.0);
    }

    #[test]
    fn sphere_irradiance_matches_quadrature_and_is_continuous_at_the_horizon() {
        close(sphere_irradiance(2.0, 1.0, 0.0), 0.090586073706, 1e-12);
        close(sphere_irradiance(2.0, 1.0, -0.3), 0.011672369894608, 1e-12);
        close(sphere_irradiance(1.05, 1.0, 0.3), 1.424717343, 1e-9);
        for cos in [-0.5, 0.5] {
            let [below, above] = [-1e-9, 1e-9].map(|d| sphere_irradiance(2.0, 1.0, cos + d));
            close(below, above, 1e-8);
        }
    }

    #[test]
    fn oren_nayar_albedo_matches_its_table() {
        for (sigma, degrees, expected) in [
            (0.0, 60f64, 1.0),
            (0.3, 0.0, 0.892857),
            (0.5, 45.0, 0.851128),
            (0.7, 85.0, 0.880082),
            (f64::INFINITY, 90.0, 0.725),
        ] {
            close(
                oren_nayar_albedo(sigma, degrees.to_radians()),
                expected,
                5e-7,
            );
        }
    }

    #[test]
    fn phong_albedo_matches_its_table() {
        for (exponent, degrees, expected) in [
            (0.0, 0f64, 1.0),
            (1.0, 0.0, 1.0),
            (1.0, 30.0, 0.880843),
            (1.0, 90.0, std::f64::consts::FRAC_1_PI),
            (10.0, 75.0, 0.291901),
            (100.0, 85.0, 0.097613),
            (1000.0, 60.0, 0.5),
            (1000.0, 90.0, 0.012613),
        ] {
            close(phong_albedo(exponent, degrees.to_radians()), expected, 1e-5);
        }
    }

    #[test]
    fn series_match_their_limits() {
        close(furnace(0.5, 60), 2.0, 1e-15);
        close(furnace(1.0, 3), 4.0, 0.0);
        let cap: f64 = (1..300)
            .map(|k| integrating_sphere_bounce(0.2, 0.8, k))
            .sum();
        close(cap, 0.2 * 0.8 / (1.0 - 0.8 * 0.8), 1e-14);
        close(slab_transmittance(fresnel(1.5, 1.0)), 0.923077, 5e-7);
        close(
            slab_transmittance(fresnel(1.5, 80f64.to_radians().cos())),
            0.441229,
            5e-7,
        );
        close(
            concentric_spheres_irradiance(0.5, 1.0, 0.7) * 2.0,
            3.306940,
            5e-7,
        );
        assert_eq!(mirror_hall_bounces(0.5, 0.4, 1.0, 1.0), 0);
        assert_eq!(mirror_hall_bounces(0.5, 0.6, 1.0, 1.0), 1);
        assert_eq!(mirror_hall_bounces(0.5, -0.6, 1.0, 1.0), 1);
    }
}
