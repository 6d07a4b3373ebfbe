//! Hairs: thin closed tubes along random curves that start on a small sphere.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use super::random::Random;
use super::sink::MeshSink;

/// Vertices around a tube.
const RING: usize = 4;
/// Faces of a segment of a tube, and of both its ends together.
const SEGMENT_FACES: u32 = 8;
const END_FACES: u32 = 4;

/// Fewest segments of a hair: less looks like a broken stick.
const MIN_SEGMENTS: f64 = 8.0;

/// Radius of the sphere on which hairs start. They end at radius [`REACH`], inside of the unit sphere.
const ROOT_RADIUS: f64 = 0.1;
const REACH: f64 = 0.98;
/// Share of that sphere's area that the roots of all hairs take.
const ROOT_SHARE: f64 = 0.05;

/// How far, as a tangent, a hair may have wandered sideways at its tip, in each of two directions.
const WANDER: f64 = 0.5;
/// Most waves along a hair.
const MAX_WAVES: f64 = 1.0;

/// How many hairs there are, and how many segments they have together.
fn layout(triangles: u32) -> (u32, u32) {
    // Twice as many faces per hair for eight times as many faces.
    let segments = (f64::from(triangles).cbrt() / 2.0).max(MIN_SEGMENTS) as u32;
    let hairs = triangles / (segments * SEGMENT_FACES + END_FACES);
    (hairs, (triangles - hairs * END_FACES) / SEGMENT_FACES)
}

/// How many faces [`make`] makes.
pub(super) fn faces(triangles: u32) -> u32 {
    let (hairs, segments) = layout(triangles);
    hairs * END_FACES + segments * SEGMENT_FACES
}

/// Makes up to `triangles` faces, at least 1000.
pub(super) fn make<S: MeshSink>(triangles: u32, seed: u64, sink: &mut S) -> Result<(), S::Error> {
    let (hairs, segments) = layout(triangles);
    let sphere_area = 4.0 * PI * ROOT_RADIUS * ROOT_RADIUS;
    let tube_radius = (ROOT_SHARE * sphere_area / (PI * f64::from(hairs))).sqrt();
    let mut random = Random::new(seed);
    for hair in 0..hairs {
        let longer = u32::from(hair < segments % hairs);
        let curve = Curve::random(&mut random);
        make_tube(&curve, segments / hairs + longer, tube_radius, sink)?;
    }
    Ok(())
}

/// A curve from the root sphere outward, with waves in two directions across it.
#[derive(Debug)]
struct Curve {
    root: DVec3,
    waves: [Wave; 2],
}

/// A displacement along `across` that begins with 0.
#[derive(Debug)]
struct Wave {
    across: DVec3,
    /// Radians from root to tip.
    frequency: f64,
    phase: f64,
}

impl Curve {
    fn random(random: &mut Random) -> Self {
        let root = random.direction();
        let (u, v) = root.any_orthonormal_pair();
        let waves = [u, v].map(|across| Wave {
            across,
            frequency: TAU * MAX_WAVES * random.uniform(),
            phase: TAU * random.uniform(),
        });
        Self { root, waves }
    }

    /// The point at `t` from 0, the root, to 1, the tip. Its distance from the centre grows linearly.
    fn point(&self, t: f64) -> DVec3 {
        let wandered = self.waves.iter().fold(self.root, |point, wave| {
            point + wave.across * (WANDER * t * (wave.frequency * t + wave.phase).sin())
        });
        wandered.normalize() * (ROOT_RADIUS + (REACH - ROOT_RADIUS) * t)
    }

    /// The unit tangent at `t`, from central differences.
    fn tangent(&self, t: f64) -> DVec3 {
        const STEP: f64 = 1e-5;
        (self.point(t + STEP) - self.point(t - STEP)).normalize()
    }
}

fn make_tube<S: MeshSink>(
    curve: &Curve,
    segments: u32,
    radius: f64,
    sink: &mut S,
) -> Result<(), S::Error> {
    let mut normal = curve.tangent(0.0).any_orthonormal_vector();
    let mut ring_at = |step: u32, sink: &mut S| {
        let t = f64::from(step) / f64::from(segments);
        let tangent = curve.tangent(t);
        // Carried along without a twist: the last normal without its part along the new tangent.
        normal = normal.reject_from_normalized(tangent).normalize();
        let axes = [normal, tangent.cross(normal)];
        make_ring(curve.point(t), axes, radius, sink)
    };
    let mut ring = ring_at(0, sink)?;
    let [a, b, c, d] = ring;
    sink.quad([d, c, b, a])?;
    for step in 1..=segments {
        let next = ring_at(step, sink)?;
        for side in 0..RING {
            let other = (side + 1) % RING;
            sink.quad([ring[side], ring[other], next[other], next[side]])?;
        }
        ring = next;
    }
    sink.quad(ring)
}

/// The vertices around a point of a tube, counter-clockwise from its tip.
fn make_ring<S: MeshSink>(
    center: DVec3,
    [x, y]: [DVec3; 2],
    radius: f64,
    sink: &mut S,
) -> Result<[u32; RING], S::Error> {
    let mut ring = [0; RING];
    for (side, index) in ring.iter_mut().enumerate() {
        let around = DVec2::from_angle(TAU * side as f64 / RING as f64) * radius;
        let position = center + x * around.x + y * around.y;
        *index = sink.vertex(position.as_vec3().to_array())?;
    }
    Ok(ring)
}
