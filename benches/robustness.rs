//! What robustness costs: the watertight triangle test against Möller and Trumbore's, and origins of
//! secondary rays by error bounds against a fixed bias, in rays per second. The plain versions are here
//! alone; neither is used by the renderer, whose `--shadow-bias` is for looking at.
//!
//! Both run in turn, in rounds, by the CPU time of the thread: printed are the medians in million rays per second,
//! and median, least and most of the ratio of the two times over the rounds.
#![allow(clippy::print_stdout, reason = "its output is the figures")]

use std::hint::black_box;

use rand_core::Rng;
use rand_pcg::Pcg64Mcg;
use wavepath::geometry::triangle::{ShearRay, TrianglePack};
use wavepath::geometry::{Triangle, biased_origin, spawn_origin, triangle_hit};
use wavepath::integrator::clock::thread_cpu_seconds;
use wavepath::math::{Compare, F32s, LANES, Mask, Vec3s};

/// Rounds, and CPU seconds that either takes in one: enough for the clock, and short enough that what disturbs one
/// disturbs the other.
const ROUNDS: usize = 31;
const SECONDS: f64 = 0.05;

/// Times `robust` and `plain`, each of which handles [`RAYS`] rays, and prints what it found.
fn compare(what: &str, is_test: bool, robust: (&str, &dyn Fn()), plain: (&str, &dyn Fn())) {
    let seconds = |work: &dyn Fn(), calls: u32| {
        let start = thread_cpu_seconds();
        (0..calls).for_each(|_| work());
        (thread_cpu_seconds() - start) / f64::from(calls)
    };
    // Warm, then as many calls as fill the time of a round.
    let calls = |work: &dyn Fn()| (SECONDS / seconds(work, 20)).ceil() as u32;
    let (rounds, calls) = if is_test {
        (1, [1; 2])
    } else {
        (ROUNDS, [calls(robust.1), calls(plain.1)])
    };
    let times: Vec<[f64; 2]> = (0..rounds)
        .map(|_| [seconds(robust.1, calls[0]), seconds(plain.1, calls[1])])
        .collect();
    let sorted = |value: &dyn Fn(&[f64; 2]) -> f64| {
        let mut values: Vec<f64> = times.iter().map(value).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    println!("{what}, {LANES} lanes, {rounds} rounds");
    for (i, name) in [robust.0, plain.0].into_iter().enumerate() {
        let median = sorted(&|time| time[i])[rounds / 2];
        println!("  {name:<16} {:8.2} Mrays/s", RAYS as f64 / median / 1e6);
    }
    let ratio = sorted(&|time| time[0] / time[1]);
    println!(
        "  time over plain  {:8.3} ({:.3} to {:.3})",
        ratio[rounds / 2],
        ratio[0],
        ratio[rounds - 1]
    );
}

/// Rays per measurement.
const RAYS: usize = 4096;
/// Packs of triangles that each ray is tested against: the data stay in the first cache.
const PACKS: usize = 8;

/// Numbers in [−1, 1).
struct Random(Pcg64Mcg);

impl Random {
    fn next(&mut self) -> f32 {
        (self.0.next_u32() >> 8) as f32 / 8_388_608.0 - 1.0
    }

    fn vector(&mut self) -> [f32; 3] {
        [(); 3].map(|()| self.next())
    }

    fn direction(&mut self) -> [f32; 3] {
        loop {
            let v = self.vector();
            let length = v.iter().map(|x| x * x).sum::<f32>().sqrt();
            if (0.1..1.0).contains(&length) {
                return v.map(|x| x / length);
            }
        }
    }

    fn lanes(&mut self, next: impl Fn(&mut Self) -> [f32; 3]) -> Vec3s {
        let vectors = [(); LANES].map(|()| next(self));
        let column = |axis: usize| F32s::from(vectors.map(|v| v[axis]));
        Vec3s::new(column(0), column(1), column(2))
    }
}

/// [`LANES`] triangles as Möller and Trumbore have them: a corner and the edges from it.
struct PlainPack {
    corner: Vec3s,
    edges: [Vec3s; 2],
}

impl PlainPack {
    fn new(triangles: &[Triangle]) -> Self {
        let corner = |index: usize| {
            let column = |axis: usize| {
                F32s::from(std::array::from_fn::<f32, LANES, _>(|lane| {
                    triangles[lane].corners[index][axis]
                }))
            };
            Vec3s::new(column(0), column(1), column(2))
        };
        let [a, b, c] = [0, 1, 2].map(corner);
        Self {
            corner: a,
            edges: [b - a, c - a],
        }
    }

    /// Lanes that the ray hits, and their distances.
    #[inline(always)]
    fn intersect(&self, origin: Vec3s, direction: Vec3s) -> (Mask, F32s) {
        let (zero, one) = (F32s::splat(0.0), F32s::splat(1.0));
        let [ab, ac] = self.edges;
        let p = direction.cross(ac);
        let inverse = one / ab.dot(p);
        let from_corner = origin - self.corner;
        let u = from_corner.dot(p) * inverse;
        let q = from_corner.cross(ab);
        let v = direction.dot(q) * inverse;
        let t = ac.dot(q) * inverse;
        let inside = u.ge(zero) & v.ge(zero) & (u + v).le(one);
        (inside & t.gt(zero), t)
    }
}

fn triangle_test(is_test: bool) {
    let mut random = Random(Pcg64Mcg::new(1));
    let triangles: Vec<Triangle> = (0..PACKS * LANES)
        .map(|_| Triangle {
            corners: [(); 3].map(|()| random.vector()),
        })
        .collect();
    let rays: Vec<[[f32; 3]; 2]> = (0..RAYS)
        .map(|_| [random.vector(), random.direction()])
        .collect();
    let watertight: Vec<TrianglePack> = triangles
        .chunks(LANES)
        .map(|pack| TrianglePack::new((0..).zip(pack.iter().copied())))
        .collect();
    let plain: Vec<PlainPack> = triangles.chunks(LANES).map(PlainPack::new).collect();
    let hits_watertight = || -> usize {
        let hits = rays.iter().map(|&[origin, direction]| {
            let ray = ShearRay::new(origin, direction);
            let hits = watertight
                .iter()
                .map(|pack| ray.intersect_pack(pack).0.count());
            hits.sum::<usize>()
        });
        hits.sum()
    };
    let hits_plain = || -> usize {
        let hits = rays.iter().map(|&[origin, direction]| {
            let (origin, direction) = (Vec3s::splat(origin), Vec3s::splat(direction));
            let hits = plain
                .iter()
                .map(|pack| pack.intersect(origin, direction).0.count());
            hits.sum::<usize>()
        });
        hits.sum()
    };
    // Random rays do not tell the two apart: they seldom meet an edge.
    assert_eq!(hits_watertight(), hits_plain());
    assert!(hits_plain() > RAYS);

    compare(
        &format!("rays against {} triangles", triangles.len()),
        is_test,
        ("watertight", &|| {
            black_box(hits_watertight());
        }),
        ("moller-trumbore", &|| {
            black_box(hits_plain());
        }),
    );
}

/// A hit that a ray is to leave.
struct Departure {
    origin: Vec3s,
    direction: Vec3s,
    t: F32s,
    corners: [Vec3s; 3],
    normal: Vec3s,
    onward: Vec3s,
}

fn offset(is_test: bool) {
    let mut random = Random(Pcg64Mcg::new(2));
    let departures: Vec<Departure> = (0..RAYS / LANES)
        .map(|_| {
            let corners = [(); 3].map(|()| random.lanes(Random::vector));
            let [a, b, c] = corners;
            // Towards the middle of the triangle.
            let third = F32s::splat(1.0 / 3.0);
            let middle = (a + b + c) * third;
            let origin = random.lanes(Random::vector);
            let direction = (middle - origin).normalize();
            Departure {
                origin,
                direction,
                t: (middle - origin).length_squared().sqrt(),
                corners,
                normal: (b - a).cross(c - a).normalize(),
                onward: random.lanes(Random::direction),
            }
        })
        .collect();
    let bounded = |d: &Departure| {
        let (point, _) = triangle_hit(d.origin, d.direction, d.corners);
        spawn_origin(&point, d.normal, d.onward)
    };
    let plain = |d: &Departure| {
        let p = d.origin.add_scaled(d.direction, d.t);
        biased_origin(p, d.normal, d.onward, 1e-4)
    };
    for departure in &departures {
        let apart = bounded(departure) - plain(departure);
        assert_eq!(apart.length_squared().lt(F32s::splat(1e-6)), Mask::ALL);
    }

    compare(
        "origins of secondary rays",
        is_test,
        ("error bound", &|| {
            departures.iter().for_each(|d| {
                black_box(bounded(d));
            });
        }),
        ("fixed bias", &|| {
            departures.iter().for_each(|d| {
                black_box(plain(d));
            });
        }),
    );
}

fn main() {
    let is_test = std::env::args().any(|argument| argument == "--test");
    triangle_test(is_test);
    offset(is_test);
}
