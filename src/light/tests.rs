//! Statistical tests of all lights, and closed forms of the irradiance they cause.

use std::f64::consts::PI;

use super::*;
use crate::math::LANES;
use crate::math::testing::{ChiSquared, DirectionBins, Mean, Uniform, direction, splat};

const UP: [f64; 3] = [0.0, 0.0, 1.0];

fn table(lights: &[Light]) -> LightTable {
    LightTable::new(lights).unwrap()
}

fn parallelogram(corner: [f32; 3], edge1: [f32; 3], edge2: [f32; 3]) -> FlatLight {
    FlatLight {
        corner,
        edges: [edge1, edge2],
        is_triangle: false,
        radiance: [1.0; 3],
        two_sided: false,
        primitives: [4, 5],
    }
}

fn sphere(center: [f32; 3], radius: f32) -> SphereLight {
    SphereLight {
        center,
        radius,
        radiance: [1.0; 3],
        two_sided: false,
        primitive: 9,
    }
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn unit(a: [f64; 3]) -> [f64; 3] {
    a.map(|x| x / dot(a, a).sqrt())
}

/// A receiver in the open.
fn receiver(p: Vec3s, n: Vec3s) -> Receiver {
    Receiver {
        p,
        n,
        primitive: U32s::splat(PrimitiveId::NONE),
    }
}

/// Estimated irradiance (first channel) at `p` with normal `n`, by light sampling alone; checks that
/// each sample is well formed and that `pdf` states the density that `sample` used.
fn irradiance<const KINDS: u32>(
    lights: &LightTable,
    p: [f64; 3],
    n: [f64; 3],
    samples: usize,
) -> Mean {
    let mut random = Uniform::new(41);
    let mut mean = Mean::default();
    let (p, n) = (splat(p), splat(n));
    for _ in 0..samples / LANES {
        let u = [random.lanes(), random.lanes(), random.lanes()];
        let s = sample::<KINDS>(lights, &receiver(p, n), u);
        let chosen = if KINDS & kinds::MANY == 0 {
            U32s::splat(0)
        } else {
            lights.choice.choose(u[0])
        };
        let hit = p.add_scaled(s.direction, s.distance);
        let stated = pdf::<KINDS>(
            lights,
            chosen,
            &receiver(p, n),
            hit,
            s.direction,
            s.distance,
        )
        .to_array();
        let directions = s.direction.to_lanes();
        for lane in 0..LANES {
            let at = |x: F32s| f64::from(x.to_array()[lane]);
            if !s.valid.test(lane) {
                mean.add(0.0);
                continue;
            }
            assert!((dot(directions[lane], directions[lane]) - 1.0).abs() < 2e-6);
            assert!(at(s.pdf) > 0.0 && at(s.distance) >= 0.0);
            let stated = f64::from(stated[lane]);
            if s.delta.test(lane) {
                assert_eq!(stated, 0.0);
            } else {
                assert!(
                    (stated / at(s.pdf) - 1.0).abs() < 1e-5,
                    "{stated} stated, {} sampled",
                    at(s.pdf)
                );
            }
            let cos = dot(directions[lane], n.to_lanes()[0]).max(0.0);
            mean.add(at(s.radiance.x) * cos / at(s.pdf));
        }
    }
    mean
}

/// Irradiance from a polygon of radiance 1 that lies above the horizon: Lambert's formula.
fn lambert_polygon(corners: &[[f64; 3]], p: [f64; 3], n: [f64; 3]) -> f64 {
    let v: Vec<[f64; 3]> = corners
        .iter()
        .map(|&corner| unit(minus(corner, p)))
        .collect();
    let sum: f64 = (0..v.len())
        .map(|i| {
            let (a, b) = (v[i], v[(i + 1) % v.len()]);
            let c = cross(a, b);
            let length = dot(c, c).sqrt();
            length.atan2(dot(a, b)) * dot(c, n) / length
        })
        .sum();
    0.5 * sum.abs()
}

#[test]
fn irradiance_from_rectangles_is_lamberts() {
    // Facing down over the floor, the point under a corner or under the centre; a wall.
    let over = |x: f32, y: f32, h: f32| parallelogram([x, y, h], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]);
    let wall = parallelogram([0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    for (light, exact) in [
        (over(0.0, 0.0, 1.0), 0.435209875684),
        (over(-0.5, -0.5, 1.0), 0.752274688454),
        (over(-0.5, -0.5, 0.01), 3.140564683433),
        (wall, 0.175094143857),
    ] {
        let lights = table(&[Light::Flat(light)]);
        assert_eq!(lights.kinds(), kinds::FLAT);
        let e = irradiance::<{ kinds::FLAT }>(&lights, [0.0; 3], UP, 200_000);
        e.check(exact, &format!("{light:?}"));
    }
}

#[test]
fn irradiance_from_tilted_parallelograms_and_triangles_is_lamberts() {
    let (corner, e1, e2) = ([0.4, -0.3, 1.2], [0.3, 1.1, 0.2], [1.0, -0.2, 0.4]);
    let [c, a, b] = [corner, e1, e2].map(|v: [f32; 3]| v.map(f64::from));
    let plus = |u: [f64; 3], v: [f64; 3]| -> [f64; 3] { std::array::from_fn(|k| u[k] + v[k]) };
    let n = unit([0.1, 0.2, 1.0]);
    let p = [0.1, 0.2, -0.1];
    let mut light = parallelogram(corner, e1, e2);
    let quad = [c, plus(c, a), plus(plus(c, a), b), plus(c, b)];
    irradiance::<{ kinds::FLAT }>(&table(&[Light::Flat(light)]), p, n, 200_000)
        .check(lambert_polygon(&quad, p, n), "parallelogram");
    light.is_triangle = true;
    let triangle = [c, plus(c, a), plus(c, b)];
    irradiance::<{ kinds::FLAT }>(&table(&[Light::Flat(light)]), p, n, 200_000)
        .check(lambert_polygon(&triangle, p, n), "triangle");
    // Tiny: area times both cosines over the squared distance.
    for size in [1e-3f32, 1e-5, 1e-7] {
        let tiny = parallelogram([0.0, 0.0, 1.0], [0.0, size, 0.0], [size, 0.0, 0.0]);
        let triangle = FlatLight {
            is_triangle: true,
            ..tiny
        };
        let area = f64::from(size).powi(2);
        for (light, exact) in [(tiny, area), (triangle, 0.5 * area)] {
            let lights = table(&[Light::Flat(light)]);
            let e = irradiance::<{ kinds::FLAT }>(&lights, [0.0; 3], UP, 10_000);
            assert!((e.mean() / exact - 1.0).abs() < 2.0 * f64::from(size).powi(2) + 1e-6);
        }
    }
}

#[test]
fn lights_that_touch_a_surface_give_it_bounded_samples() {
    // Walls on the floor: by area a sample at the foot brings up to A·cos·cos/d², here the solid angle times
    // the cosine at most. A triangle on its side, and one on its corner.
    let wall = |corner: [f32; 3], edge1: [f32; 3], edge2: [f32; 3]| FlatLight {
        two_sided: true,
        ..parallelogram(corner, edge1, edge2)
    };
    let rectangle = wall([-0.5, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    let on_side = FlatLight {
        is_triangle: true,
        ..rectangle
    };
    let on_corner = FlatLight {
        is_triangle: true,
        ..wall([0.125, 0.0, 0.0], [0.5, 0.0, 0.75], [-0.5, 0.0, 1.0])
    };
    let mut random = Uniform::new(48);
    for light in [rectangle, on_side, on_corner] {
        let lights = table(&[Light::Flat(light)]);
        let [corner, e1, e2] = [light.corner, light.edges[0], light.edges[1]];
        let end = |edges: &[[f32; 3]]| -> [f64; 3] {
            std::array::from_fn(|k| f64::from(corner[k] + edges.iter().map(|e| e[k]).sum::<f32>()))
        };
        let corners: &[[f64; 3]] = if light.is_triangle {
            &[end(&[]), end(&[e1]), end(&[e2])]
        } else {
            &[end(&[]), end(&[e1]), end(&[e1, e2]), end(&[e2])]
        };
        for c in [1e-1, 1e-3, 1e-6] {
            let p = [0.125, c, 0.0];
            let at = receiver(splat(p), splat(UP));
            let mut mean = Mean::default();
            for _ in 0..100_000 / LANES {
                let u = [random.lanes(), random.lanes(), random.lanes()];
                let s = sample::<{ kinds::FLAT }>(&lights, &at, u);
                for lane in 0..LANES {
                    if !s.valid.test(lane) {
                        // Rounding may put a sample into the plane that the point is in, if it is as near.
                        assert!(c < 1e-3, "{light:?} from {c}");
                        continue;
                    }
                    let pdf = f64::from(s.pdf.to_array()[lane]);
                    assert!(pdf.recip() <= PI * (1.0 + 1e-6), "{pdf}");
                    mean.add(s.direction.to_lanes()[lane][2].max(0.0) / pdf);
                }
            }
            let exact = lambert_polygon(corners, p.map(|x| f64::from(x as f32)), UP);
            mean.check(exact, &format!("{light:?} from {c}"));
        }
    }
}

#[test]
fn flat_lights_do_not_light_themselves_whatever_side_rounding_put_their_points_on() {
    for is_triangle in [false, true] {
        let light = FlatLight {
            two_sided: true,
            is_triangle,
            ..parallelogram([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
        };
        let lights = table(&[Light::Flat(light)]);
        for off in [-1e-7, 0.0, 1e-7] {
            let open = receiver(splat([0.3, 0.4, off]), splat(UP));
            for &primitive in &light.primitives[..if is_triangle { 1 } else { 2 }] {
                let own = Receiver {
                    primitive: U32s::splat(primitive),
                    ..open
                };
                let s = sample::<{ kinds::FLAT }>(&lights, &own, [F32s::splat(0.6); 3]);
                assert_eq!(s.valid, Mask::NONE);
            }
        }
    }
}

#[test]
fn irradiance_from_spheres_is_that_of_the_closed_form() {
    // Distance, radius, cosine of the centre, radiance, irradiance: also cut by the horizon.
    for (d, r, cos, radiance, exact) in [
        (2.0, 1.0, 1.0, 1.0, PI * 0.25),
        (2.0, 1.0, 0.0, 1.0, 0.090586073706),
        (2.0, 1.0, -0.3, 1.0, 0.011672369894608),
        (1.05, 1.0, 0.3, 1.0, 1.424717343),
        (1.0, 1e-4, 1.0, 1e10, 314.1592654),
        (0.1, 1e-4, 1.0, 1e10, 31_415.926_54),
        (0.01, 1e-4, 1.0, 1e10, 3_141_592.654),
        (1.0, 1e-3, 0.5, 1.0, PI * 1e-6 * 0.5),
        (1.0, 1e-6, 1.0, 1.0, PI * 1e-12),
        (1e4, 1.0, 0.7, 1.0, PI * 1e-8 * 0.7),
    ] {
        let center = direction(cos, 2.0).map(|x| (x * d) as f32);
        let light = SphereLight {
            radiance: [radiance; 3],
            ..sphere(center, r)
        };
        let lights = table(&[Light::Sphere(light)]);
        assert_eq!(lights.kinds(), kinds::SPHERE);
        let e = irradiance::<{ kinds::SPHERE }>(&lights, [0.0; 3], UP, 400_000);
        e.check(exact, &format!("d = {d}, r = {r}, cos = {cos}"));
    }
}

#[test]
fn irradiance_inside_a_two_sided_sphere_is_pi() {
    let light = SphereLight {
        two_sided: true,
        ..sphere([0.2, -0.1, 0.3], 1.0)
    };
    for p in [[0.0, 0.0, 0.0], [0.2, -0.1, 0.3], [0.2, 0.6, 0.5]] {
        let lights = table(&[Light::Sphere(light)]);
        let e = irradiance::<{ kinds::SPHERE }>(&lights, p, unit([0.3, -0.4, 0.5]), 400_000);
        e.check(PI, &format!("inside at {p:?}"));
    }
    let one_sided = table(&[Light::Sphere(sphere([0.0; 3], 1.0))]);
    let s = sample::<{ kinds::SPHERE }>(
        &one_sided,
        &receiver(Vec3s::zero(), splat(UP)),
        [F32s::splat(0.4); 3],
    );
    assert_eq!(s.valid, Mask::NONE);
}

#[test]
fn a_sphere_lights_its_own_points_from_within_whatever_side_rounding_put_them_on() {
    let light = SphereLight {
        two_sided: true,
        ..sphere([0.2, -0.1, 0.3], 1.0)
    };
    let lights = table(&[Light::Sphere(light)]);
    let mut random = Uniform::new(47);
    let inward = unit([-0.3, 0.4, -0.5]);
    for off in [-1e-6, 0.0, 1e-6] {
        let p: [f64; 3] = std::array::from_fn(|i| [0.2, -0.1, 0.3][i] - (1.0 + off) * inward[i]);
        let at = Receiver {
            primitive: U32s::splat(light.primitive),
            ..receiver(splat(p), splat(inward))
        };
        for _ in 0..1000 / LANES {
            let u = [random.lanes(), random.lanes(), random.lanes()];
            let s = sample::<{ kinds::SPHERE }>(&lights, &at, u);
            // Area sampling of a sphere from a point on it: 1/(4πR²)·d²/cos = d/(2·4π·R/2·R).
            let hit = at.p.add_scaled(s.direction, s.distance);
            let stated = pdf::<{ kinds::SPHERE }>(
                &lights,
                U32s::splat(0),
                &at,
                hit,
                s.direction,
                s.distance,
            );
            for lane in 0..LANES {
                let [d, pdf, stated] =
                    [s.distance, s.pdf, stated].map(|x| f64::from(x.to_array()[lane]));
                let expected = d / (2.0 * PI);
                // Rounding matters where the point sampled is the point itself.
                let tolerance = expected * (1e-4 + 1e-5 / (d * d));
                assert!((pdf - expected).abs() < tolerance, "{pdf} at {d}");
                assert!((stated - expected).abs() < tolerance, "{stated} at {d}");
            }
        }
    }
}

#[test]
fn point_light_gives_inverse_square_irradiance_as_a_delta() {
    let lights = table(&[Light::Point(PointLight {
        position: [3.0, 0.0, 4.0],
        intensity: [50.0, 25.0, 0.0],
    })]);
    assert_eq!(lights.kinds(), kinds::POINT);
    irradiance::<{ kinds::POINT }>(&lights, [0.0; 3], UP, LANES).check(50.0 / 25.0 * 0.8, "point");
    let s = sample::<{ kinds::POINT }>(
        &lights,
        &receiver(Vec3s::zero(), splat(UP)),
        [F32s::splat(0.0); 3],
    );
    assert_eq!(
        (s.delta, s.primitive.to_array()[0]),
        (Mask::ALL, PrimitiveId::NONE)
    );
    assert_eq!((s.pdf.to_array()[0], s.distance.to_array()[0]), (1.0, 5.0));
    let at = sample::<{ kinds::POINT }>(
        &lights,
        &receiver(splat([3.0, 0.0, 4.0]), splat(UP)),
        [F32s::splat(0.0); 3],
    );
    assert_eq!(at.valid, Mask::NONE);
}

#[test]
fn background_has_no_variance_at_an_open_plane() {
    let lights = table(&[Light::Background(BackgroundLight {
        radiance: [2.0; 3],
        scene_radius: 3.0,
    })]);
    assert_eq!(
        (lights.kinds(), lights.background()),
        (kinds::BACKGROUND, Some(0))
    );
    for n in [UP, [0.0, 0.0, -1.0], unit([1.0, -2.0, 0.5])] {
        let e = irradiance::<{ kinds::BACKGROUND }>(&lights, [5.0, 6.0, 7.0], n, 10_000);
        assert!((e.mean() / (2.0 * PI) - 1.0).abs() < 1e-6);
    }
}

/// Chi-squared test of the directions from `p` against `pdf` of what a ray in a direction would hit:
/// its distance, or none.
fn check_directions<const KINDS: u32>(
    lights: &LightTable,
    p: [f64; 3],
    bins: &DirectionBins,
    hit: impl Fn([f64; 3]) -> Option<f64>,
    what: &str,
) {
    let (point, n) = (splat(p), splat(UP));
    let mut random = Uniform::new(42);
    let mut counts = ChiSquared::new(bins);
    for _ in 0..300_000 / LANES {
        let s = sample::<KINDS>(
            lights,
            &receiver(point, n),
            [random.lanes(), random.lanes(), random.lanes()],
        );
        counts.add(s.direction, s.valid);
    }
    let density = |d: Vec3s| {
        let distances = d.to_lanes().map(|d| hit(d).map_or(-1.0, |t| t as f32));
        let distance = F32s::from(distances);
        let at = point.add_scaled(d, distance);
        let pdf = pdf::<KINDS>(lights, U32s::splat(0), &receiver(point, n), at, d, distance);
        distance.gt(F32s::splat(0.0)).select(pdf, F32s::splat(0.0))
    };
    let integral = counts.check(&density, what);
    assert!(
        (integral - 1.0).abs() < 2e-4,
        "{what}: density integrates to {integral}"
    );
}

#[test]
fn directions_to_flat_lights_follow_the_density() {
    let skew = parallelogram([-0.5, -0.4, 1.0], [0.1, 1.0, 0.1], [1.2, 0.2, -0.2]);
    let rectangle = parallelogram([-0.5, -0.4, 1.0], [0.0, 1.0, 0.1], [1.2, 0.01, -0.1]);
    let triangle = FlatLight {
        is_triangle: true,
        ..skew
    };
    for light in [skew, triangle, rectangle] {
        let lights = [Light::Flat(light)];
        let (alone, combined) = (table(&lights), LightTable::by_area(&lights).unwrap());
        let by_solid_angle = |lights: &LightTable| lights.has_rectangles || lights.has_triangles;
        assert_eq!(by_solid_angle(&alone), light != skew);
        assert!(!by_solid_angle(&combined));
        let [c, a, b] = [light.corner, light.edges[0], light.edges[1]].map(|v| v.map(f64::from));
        let normal = cross(a, b);
        let is_triangle = light.is_triangle;
        for p in [[0.0, 0.0, 0.0], [2.0, 1.0, 0.3], [0.0, 0.0, 0.8]] {
            let hit = |d: [f64; 3]| {
                let t = dot(minus(c, p), normal) / dot(d, normal);
                let at: [f64; 3] = std::array::from_fn(|k| p[k] + t * d[k] - c[k]);
                let u = dot(cross(at, b), normal) / dot(normal, normal);
                let v = dot(cross(a, at), normal) / dot(normal, normal);
                let inside = u >= 0.0
                    && v >= 0.0
                    && if is_triangle {
                        u + v <= 1.0
                    } else {
                        u.max(v) <= 1.0
                    };
                (t > 0.0 && inside).then_some(t)
            };
            // A cone about the middle that holds every corner.
            let ends = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]
                .map(|(u, v)| unit(std::array::from_fn(|k| c[k] + u * a[k] + v * b[k] - p[k])));
            let ends = &ends[..if is_triangle { 3 } else { 4 }];
            let axis = unit(std::array::from_fn(|k| ends.iter().map(|end| end[k]).sum()));
            let width = ends
                .iter()
                .map(|&end| 1.0 - dot(end, axis))
                .fold(0.0, f64::max)
                * 1.02;
            let bins = DirectionBins::new(axis, width).with_corners();
            for (lights, how) in [(&alone, "alone"), (&combined, "by area")] {
                let what = format!("{light:?} from {p:?}, {how}");
                check_directions::<{ kinds::FLAT }>(lights, p, &bins, hit, &what);
            }
        }
    }
}

#[test]
fn directions_to_spheres_follow_the_density_outside_and_inside() {
    for (d, r) in [
        (2.0, 1.0),
        (1.001, 1.0),
        (1.0, 1e-3),
        (1.0, 1e-4),
        (0.5, 1.0),
        (0.0, 2.0),
    ] {
        let axis = unit([0.3, -0.5, 0.6]);
        let center = axis.map(|x| (x * d) as f32);
        let light = SphereLight {
            two_sided: true,
            ..sphere(center, r)
        };
        let r = f64::from(r);
        let c = center.map(f64::from);
        let hit = |v: [f64; 3]| {
            let along = dot(v, c);
            let off = minus(c, v.map(|x| x * along));
            let half_chord = (r * r - dot(off, off)).max(0.0).sqrt();
            // The rim itself counts as hit, so that rounding does not open it.
            Some(if d > r {
                along - half_chord
            } else {
                along + half_chord
            })
        };
        let s2 = (r * r / dot(c, c).max(1e-30)).min(1.0);
        let width = if d > r {
            s2 / (1.0 + (1.0 - s2).sqrt())
        } else {
            2.0
        };
        let axis = if d > r { unit(c) } else { UP };
        let what = format!("sphere, d = {d}, r = {r}");
        let bins = DirectionBins::new(axis, width);
        let lights = table(&[Light::Sphere(light)]);
        check_directions::<{ kinds::SPHERE }>(&lights, [0.0; 3], &bins, hit, &what);
    }
}

#[test]
fn directions_to_the_background_follow_the_density() {
    let lights = table(&[Light::Background(BackgroundLight {
        radiance: [1.0; 3],
        scene_radius: 1.0,
    })]);
    let bins = DirectionBins::new(UP, 1.0);
    check_directions::<{ kinds::BACKGROUND }>(
        &lights,
        [0.0; 3],
        &bins,
        |_| Some(1e9),
        "background",
    );
}

/// One light of each kind, and one that gives no light.
fn mixed() -> Vec<Light> {
    vec![
        Light::Flat(parallelogram(
            [-0.5, -0.5, 2.0],
            [0.0, 1.0, 0.0],
            [1.0, 0.0, 0.0],
        )),
        Light::Sphere(SphereLight {
            radiance: [0.0; 3],
            ..sphere([0.0, 3.0, 1.0], 1.0)
        }),
        Light::Sphere(SphereLight {
            radiance: [2.0, 1.0, 0.5],
            ..sphere([2.0, 0.0, 1.0], 0.5)
        }),
        Light::Point(PointLight {
            position: [0.0, -1.0, 1.5],
            intensity: [3.0, 1.0, 2.0],
        }),
        Light::Background(BackgroundLight {
            radiance: [0.1, 0.2, 0.3],
            scene_radius: 4.0,
        }),
        Light::Flat(FlatLight {
            is_triangle: true,
            ..parallelogram([3.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 0.0, 0.5])
        }),
    ]
}

#[test]
fn irradiance_from_many_lights_is_the_sum_of_each() {
    let lights = mixed();
    let (p, n) = ([0.1, 0.2, 0.0], unit([0.1, 0.0, 1.0]));
    let sum: f64 = lights
        .iter()
        .filter(|light| light.power() > 0.0)
        .map(|&light| {
            irradiance::<{ kinds::ALL & !kinds::MANY }>(&table(&[light]), p, n, 400_000).mean()
        })
        .sum();
    let all = table(&lights);
    assert_eq!(all.kinds(), kinds::ALL);
    let e = irradiance::<{ kinds::ALL }>(&all, p, n, 1_600_000);
    assert!(
        (e.mean() / sum - 1.0).abs() < 5e-3,
        "{} against the sum {sum}",
        e.mean()
    );
    e.check(sum, "all lights");
}

#[test]
fn lights_are_chosen_by_power_and_never_without() {
    let lights = mixed();
    let all = table(&lights);
    let power: Vec<f64> = lights.iter().map(Light::power).collect();
    let total: f64 = power.iter().sum();
    let mut counts = vec![0.0; lights.len()];
    let mut random = Uniform::new(43);
    let n = 400_000 / LANES * LANES;
    for _ in 0..n / LANES {
        for light in all.choice.choose(random.lanes()).to_array() {
            counts[light as usize] += 1.0;
        }
    }
    for (count, power) in counts.into_iter().zip(power) {
        let expected = n as f64 * power / total;
        assert!(
            (count - expected).abs() <= 4.0 * expected.sqrt(),
            "{count}, expected {expected}"
        );
    }
}

/// Bits of everything in a sample.
fn bits(s: &LightSample) -> impl PartialEq + std::fmt::Debug {
    let f = |x: F32s| x.to_array().map(f32::to_bits);
    let v = |x: Vec3s| [f(x.x), f(x.y), f(x.z)];
    (
        v(s.direction),
        f(s.distance),
        v(s.radiance),
        f(s.pdf),
        s.delta,
        s.primitive.to_array(),
        s.valid,
    )
}

#[test]
fn kernels_for_more_kinds_give_the_same_bits() {
    fn check<const KINDS: u32>(light: Light) {
        let lights = table(&[light]);
        assert_eq!(lights.kinds(), KINDS);
        let mut random = Uniform::new(44);
        for _ in 0..1000 {
            let u = [random.lanes(), random.lanes(), random.lanes()];
            let p = Vec3s::new(random.lanes(), random.lanes(), random.lanes());
            let (one, all) = (
                sample::<KINDS>(&lights, &receiver(p, splat(UP)), u),
                sample::<{ kinds::ALL }>(&lights, &receiver(p, splat(UP)), u),
            );
            assert_eq!(bits(&one), bits(&all));
            let hit = p.add_scaled(one.direction, one.distance);
            let pdfs = [
                pdf::<KINDS>(
                    &lights,
                    U32s::splat(0),
                    &receiver(p, splat(UP)),
                    hit,
                    one.direction,
                    one.distance,
                ),
                pdf::<{ kinds::ALL }>(
                    &lights,
                    U32s::splat(0),
                    &receiver(p, splat(UP)),
                    hit,
                    one.direction,
                    one.distance,
                ),
            ];
            assert_eq!(
                pdfs[0].to_array().map(f32::to_bits),
                pdfs[1].to_array().map(f32::to_bits)
            );
        }
    }
    let lights = mixed();
    check::<{ kinds::FLAT }>(lights[0]);
    check::<{ kinds::SPHERE }>(lights[2]);
    check::<{ kinds::POINT }>(lights[3]);
    check::<{ kinds::BACKGROUND }>(lights[4]);
    check::<{ kinds::FLAT }>(lights[5]);
}

#[test]
fn no_power_means_nothing_to_sample() {
    assert_eq!(table(&[]).kinds(), 0);
    let dark = SphereLight {
        radiance: [0.0; 3],
        ..sphere([0.0; 3], 1.0)
    };
    let flat = parallelogram([0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]);
    let lights = table(&[Light::Sphere(dark), Light::Flat(flat)]);
    assert_eq!((lights.kinds(), lights.len()), (0, 2));
}

#[test]
fn samples_name_the_triangle_that_holds_them() {
    let light = parallelogram([0.0, 0.0, 2.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]);
    let lights = table(&[Light::Flat(light)]);
    let mut random = Uniform::new(45);
    let s = sample::<{ kinds::FLAT }>(
        &lights,
        &receiver(Vec3s::zero(), splat(UP)),
        [random.lanes(), random.lanes(), random.lanes()],
    );
    let hits = Vec3s::zero().add_scaled(s.direction, s.distance).to_lanes();
    for (hit, primitive) in hits.into_iter().zip(s.primitive.to_array()) {
        // Edge 1 is along y: the first triangle is the half with y > x.
        assert_eq!(primitive, if hit[1] > hit[0] { 4 } else { 5 }, "{hit:?}");
    }
    let triangle = table(&[Light::Flat(FlatLight {
        is_triangle: true,
        ..light
    })]);
    let s = sample::<{ kinds::FLAT }>(
        &triangle,
        &receiver(Vec3s::zero(), splat(UP)),
        [random.lanes(), random.lanes(), random.lanes()],
    );
    assert_eq!(s.primitive.to_array(), [4; LANES]);
}

#[test]
fn one_sided_lights_are_dark_behind() {
    let mut flat = parallelogram([0.0, 0.0, 2.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    let u = [F32s::splat(0.3); 3];
    let valid = |flat: FlatLight| {
        let lights = table(&[Light::Flat(flat)]);
        let emitted = |cos: f32| {
            emitted::<{ kinds::FLAT }>(&lights, U32s::splat(0), F32s::splat(cos)).to_lanes()[0]
        };
        assert_eq!(emitted(0.5), [1.0; 3]);
        assert_eq!(emitted(-0.5), [if flat.two_sided { 1.0 } else { 0.0 }; 3]);
        sample::<{ kinds::FLAT }>(&lights, &receiver(Vec3s::zero(), splat(UP)), u).valid
    };
    assert_eq!(valid(flat), Mask::NONE);
    flat.two_sided = true;
    assert_eq!(valid(flat), Mask::ALL);
}

#[test]
fn samples_are_sound_at_the_ends_of_the_unit_interval() {
    const ENDS: [f32; 4] = [0.0, 1.0 / 16_777_216.0, 0.5, 1.0 - 1.0 / 16_777_216.0];
    let all = table(&mixed());
    for i in 0..64 {
        let u = [ENDS[i % 4], ENDS[i / 4 % 4], ENDS[i / 16]].map(F32s::splat);
        let s = sample::<{ kinds::ALL }>(&all, &receiver(splat([0.1, 0.2, 0.0]), splat(UP)), u);
        let direction = s.direction.to_lanes()[0];
        assert!(
            (dot(direction, direction) - 1.0).abs() < 2e-6,
            "{u:?}: {direction:?}"
        );
        let pdf = s.pdf.to_array()[0];
        assert!(
            pdf > 0.0 && pdf.is_finite() && s.distance.to_array()[0] > 0.0,
            "{u:?}"
        );
    }
}
