//! Spheres that are far, small or huge, and rays that leave them.

use glam::DVec3;

use super::closed_meshes::Random;
use super::rays::{narrow, wide};
use super::renders::max_or_nan;
use super::trial::{Figure, Trial};
use crate::error::Result;
use crate::geometry::sphere::sphere_distance;
use crate::geometry::sphere_point;
use crate::math::float::gamma;
use crate::math::{F32s, LANES, Mask, Vec3s};

/// A ray and what it meets.
struct Shot {
    origin: [f32; 3],
    direction: [f32; 3],
}

/// Calls `look` with each shot, its distance by the lane code and the lane's point on the sphere.
fn shoot(
    center: [f32; 3],
    radius: f32,
    leaving: bool,
    count: u64,
    mut shot: impl FnMut() -> Shot,
    mut look: impl FnMut(&Shot, f64, DVec3),
) {
    let leaving = if leaving { Mask::ALL } else { Mask::NONE };
    let (center, radius) = (Vec3s::splat(center), F32s::splat(radius));
    for _ in 0..count.div_ceil(LANES as u64) {
        let shots: [Shot; LANES] = std::array::from_fn(|_| shot());
        let lanes = |v: &dyn Fn(&Shot) -> [f32; 3]| {
            Vec3s::from_lanes(&shots.each_ref().map(|shot| v(shot).map(f64::from)))
        };
        let (origin, direction) = (lanes(&|s| s.origin), lanes(&|s| s.direction));
        let t = sphere_distance(center, radius, origin, direction, leaving);
        let points = sphere_point(origin, direction, t, center, radius)
            .p
            .to_lanes();
        for (lane, shot) in shots.iter().enumerate() {
            look(
                shot,
                t.to_array()[lane].into(),
                DVec3::from_array(points[lane]),
            );
        }
    }
}

/// The squared half chord over r² and the nearest distance > 0, in f64 for the same f32 numbers.
fn oracle(center: [f32; 3], radius: f32, shot: &Shot) -> (f64, f64) {
    let (f, d) = (wide(center) - wide(shot.origin), wide(shot.direction));
    let (middle, r) = (f.dot(d) / d.length_squared(), f64::from(radius));
    let inside = 1.0 - (f - middle * d).length_squared() / (r * r);
    let half_chord = inside.max(0.0).sqrt() * r / d.length();
    let near = middle - half_chord;
    let t = if near > 0.0 {
        near
    } else {
        middle + half_chord
    };
    (
        inside,
        if inside >= 0.0 && t > 0.0 {
            t
        } else {
            f64::INFINITY
        },
    )
}

pub(super) fn far_spheres(trial: &mut Trial<'_>) -> Result<()> {
    let count = trial.count(200_000);
    for ratio in [2f32, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6] {
        let mut random = Random(19);
        let (radius, center) = (0.7, [0.0; 3]);
        let eye = narrow(random.direction() * f64::from(ratio * radius));
        let (mut wrong, mut unexplained, mut off_sphere) = (0, 0, 0.0);
        // The distance of the centre from the ray is known to γ(8)·D: nearer to the rim nothing is.
        let slack = 2.0 * f64::from(gamma(8)) * f64::from(ratio);
        let shot = || {
            let aside = 1.05 * f64::from(radius) * random.uniform() * random.direction();
            Shot {
                origin: eye,
                direction: narrow((aside - wide(eye)).normalize()),
            }
        };
        shoot(center, radius, false, count, shot, |shot, t, point| {
            let (inside, expected) = oracle(center, radius, shot);
            if t.is_finite() != expected.is_finite() {
                wrong += 1;
                unexplained += u64::from(inside.abs() > slack);
            } else if t.is_finite() {
                let off = point.length() / f64::from(radius) - 1.0;
                off_sphere = max_or_nan(off_sphere, off.abs());
            }
        });
        let label = format!("distance {ratio:e} radii");
        // In f32 the rim is known to γ(8)·D. The best known formulas reach the first of these at 10⁴ radii, and 1.5e-3
        // at 10⁵; what is wrong grows with the distance in all of them.
        let tolerance = match ratio {
            r if r <= 1e3 => 0.0,
            r if r <= 1e5 => 2e-4,
            _ => 5e-4,
        };
        trial.note(
            &*label,
            if tolerance == 0.0 {
                "f64: hit or miss"
            } else {
                "f64: hit or miss; f32 knows the rim to γ(8)·D"
            },
            Figure::share(wrong, count, tolerance),
        );
        trial.note(
            &*label,
            "f64, but for a rim of γ(8)·D",
            Figure::none_of(unexplained, count),
        );
        trial.note(
            &*label,
            "hit points at radius r",
            Figure::relative(off_sphere, 3e-7, count),
        );
    }
    Ok(())
}

pub(super) fn leaving_spheres(trial: &mut Trial<'_>) -> Result<()> {
    let count = trial.count(100_000);
    for (radius, offset) in [
        (1e-6, 0.0),
        (1e-3, 0.0),
        (1.0, 0.0),
        (1e3, 0.0),
        (1e7, 0.0),
        (1.0, 1e6),
    ] {
        let mut random = Random(21);
        let center = narrow(DVec3::new(3.0, -1.0, 0.5) * f64::from(radius) + DVec3::splat(offset));
        let shot = || {
            let p = wide(center) + f64::from(radius) * random.direction();
            Shot {
                origin: narrow(p),
                direction: narrow(random.direction()),
            }
        };
        let (mut wrong, mut chord_error) = (0, 0.0);
        shoot(center, radius, true, count, shot, |shot, t, _| {
            let arm = wide(shot.origin) - wide(center);
            let cosine = arm.dot(wide(shot.direction)) / arm.length();
            if cosine.abs() < 1e-6 {
                return;
            }
            wrong += u64::from(t.is_finite() != (cosine < 0.0));
            if cosine < 0.0 && t.is_finite() {
                let chord = -2.0 * arm.dot(wide(shot.direction));
                chord_error = max_or_nan(chord_error, (t - chord).abs() / f64::from(radius));
            }
        });
        let label = format!("radius {radius:e} at {offset:e}");
        trial.note(
            &*label,
            "outward misses, inward hits",
            Figure::none_of(wrong, count),
        );
        trial.note(
            &*label,
            "chord −2(n·d)r",
            Figure::relative(chord_error, 1e-6, count),
        );
    }
    Ok(())
}

pub(super) fn ground_sphere(trial: &mut Trial<'_>) -> Result<()> {
    let count = trial.count(100_000);
    // A planet seen from a metre above it, and a pellet seen from ten metres.
    for (radius, distance) in [(1e5f32, 1e5 + 1.0), (1e7, 1e7 + 2.0), (1e-4, 10.0)] {
        let mut random = Random(22);
        // The eye is at the origin of the one, the middle of the other.
        let (center, eye) = if radius > 1.0 {
            ([0.0, 0.0, -distance], [0.0; 3])
        } else {
            ([0.0; 3], [0.0, 0.0, distance])
        };
        let reach = f64::from(radius.min(2.0));
        let target = if radius > 1.0 {
            DVec3::new(0.0, 0.0, f64::from(radius - distance))
        } else {
            -wide(eye)
        };
        let shot = || Shot {
            origin: eye,
            direction: narrow(
                (target + reach * 0.9 * random.uniform() * random.direction()).normalize(),
            ),
        };
        let (mut wrong, mut error) = (0, 0.0);
        shoot(center, radius, false, count, shot, |shot, t, point| {
            let (inside, expected) = oracle(center, radius, shot);
            let slack = 2.0 * f64::from(gamma(8)) * f64::from(distance / radius);
            if inside.abs() <= slack {
                return;
            }
            wrong += u64::from(t.is_finite() != expected.is_finite());
            if t.is_finite() && expected.is_finite() {
                let off = (point - wide(center)).length() / f64::from(radius) - 1.0;
                error = max_or_nan(error, off.abs());
            }
        });
        let label = format!("radius {radius:e} from {distance:e}");
        trial.note(&*label, "f64: hit or miss", Figure::none_of(wrong, count));
        trial.note(
            &*label,
            "hit points at radius r",
            Figure::relative(error, 2e-7, count),
        );
    }
    Ok(())
}
