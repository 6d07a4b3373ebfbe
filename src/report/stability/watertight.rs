//! Rays from inside of closed meshes, aimed at vertices, edges and along axes: none may escape.

use glam::DVec3;

use super::Effort;
use super::closed_meshes::{Aim, BLOCK, ClosedMesh, Random};
use super::rays::{Rays, flushed};
use super::trial::{Figure, Trial};
use crate::accel::{self, Structure};
use crate::error::Result;
use crate::geometry::triangle::ShearRay;
use crate::geometry::{Geometry, PrimitiveId, Triangle};

/// Points inside of each mesh that rays start from.
const POINTS: usize = 40;
/// Ray–triangle tests for which the scan has time: it gets fewer rays.
const SCAN_TESTS: u64 = 100_000_000;
/// Centre in the watertightness test of Embree.
const EMBREE_CENTER: DVec3 = DVec3::new(148_376.0, 1_234.0, -223_423.0);

/// Rays of a mesh on a structure, in whole blocks.
fn blocks(trial: &Trial<'_>, mesh: &ClosedMesh, structure: Structure, rays: u64) -> u64 {
    let rays = match structure {
        Structure::Linear => trial
            .count(SCAN_TESTS / mesh.geometry.len() as u64)
            .min(rays),
        _ => rays,
    };
    rays.div_ceil(BLOCK as u64)
}

fn escapes(
    trial: &mut Trial<'_>,
    label: String,
    mesh: &ClosedMesh,
    aims: &[Aim],
    rays: u64,
) -> Result<()> {
    trial.on_structures(label, "closed mesh", |trial, structure| {
        let accel = accel::build(structure, &mesh.geometry)?;
        let blocks = blocks(trial, mesh, structure, rays);
        let escapes = trial.install(|| mesh.escapes(&*accel, aims, blocks));
        Ok(Figure::none_of(escapes, blocks * BLOCK as u64))
    })
}

/// Spheres of needles and quads at any place and of any size.
fn spheres(effort: Effort) -> impl Iterator<Item = (String, ClosedMesh)> {
    let rows = if effort == Effort::Full { 100 } else { 40 };
    let far = DVec3::new(1e6, -0.3e6, 0.7e6);
    [
        (2.0, 0.0, DVec3::ZERO, "at the origin"),
        (2.0, 0.3, DVec3::ZERO, "at the origin"),
        (2e-6, 0.3, DVec3::ZERO, "at the origin"),
        (2e7, 0.3, DVec3::ZERO, "at the origin"),
        (2.0, 0.3, EMBREE_CENTER, "at 2.7e5"),
        (200.0, 0.3, far, "at 1.3e6"),
    ]
    .into_iter()
    .map(move |(radius, jitter, center, place)| {
        let label = format!("radius {radius:e} {place}, jitter {jitter}");
        let mesh = ClosedMesh::placed_sphere(rows, jitter, radius, center, POINTS);
        (label, mesh)
    })
}

pub(super) fn vertices(trial: &mut Trial<'_>) -> Result<()> {
    let by_effort = match trial.effort() {
        // Ten million over all meshes and trees.
        Effort::Test => 320_000,
        Effort::Quick | Effort::Full => trial.count(1_000_000),
    };
    let rays = trial.leak_rays().unwrap_or(by_effort);
    let aims = [Aim::Random, Aim::Vertex, Aim::Edge];
    for (label, mesh) in spheres(trial.effort()) {
        escapes(trial, label, &mesh, &aims, rays)?;
    }
    for mesh in [
        ClosedMesh::torus(32, POINTS),
        ClosedMesh::sponge(2_112, POINTS),
    ] {
        escapes(trial, mesh.name.clone(), &mesh, &aims, rays)?;
    }
    Ok(())
}

pub(super) fn needle_fan(trial: &mut Trial<'_>) -> Result<()> {
    let mesh = ClosedMesh::double_cone(2_000, POINTS);
    let rays = trial.count(20_000);
    let aims = [Aim::Random, Aim::Vertex, Aim::Edge];
    escapes(
        trial,
        "4000 needles at two tips".to_owned(),
        &mesh,
        &aims,
        rays,
    )
}

pub(super) fn axes(trial: &mut Trial<'_>) -> Result<()> {
    let rays = trial.count(200_000);
    let aims = [Aim::Axis, Aim::AxisThroughVertex, Aim::LevelWithVertex];
    for (label, mesh) in spheres(trial.effort()) {
        escapes(trial, format!("sphere, {label}"), &mesh, &aims, rays)?;
    }
    let sponge = ClosedMesh::sponge(2_112, POINTS);
    escapes(trial, "sponge".to_owned(), &sponge, &aims, rays)?;
    flat_grid(trial)
}

/// Cells per side of the flat grid.
const CELLS: usize = 64;

/// Squares of two triangles with whole coordinates, at z = 0.
fn grid() -> Geometry {
    let triangles = (0..CELLS * CELLS)
        .flat_map(|cell| {
            let corner =
                |i: usize, j: usize| [(cell % CELLS + i) as f32, (cell / CELLS + j) as f32, 0.0];
            let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
            [[a, b, c], [a, c, d]]
        })
        .map(|corners| Triangle { corners })
        .collect();
    Geometry {
        triangles,
        ..Geometry::default()
    }
}

/// Rays down to the grid: across it, the other components ±0 or ever smaller, from points over
/// vertices, edges, diagonals and faces, and some from the planes of box faces.
fn rays_to_grid(count: u64) -> Rays {
    let mut random = Random(2);
    let mut rays = Rays::default();
    for _ in 0..count {
        let mut place = || {
            let whole = (1 + random.below(CELLS - 1)) as f32;
            match random.below(3) {
                0 => whole,
                1 => whole + 0.5,
                _ => whole + random.uniform() as f32 * 0.5,
            }
        };
        let (x, mut y) = (place(), place());
        if random.below(4) == 0 {
            y = x;
        }
        let mut aside = || match random.below(3) {
            0 => 0.0,
            1 => -0.0,
            _ => random.either(1.0, -1.0) * 10f32.powi(-7 - random.below(38) as i32),
        };
        let direction = [aside(), aside(), -1.0];
        let height = 10f32.powi(random.below(4) as i32 - 2);
        rays.push([x, y, height], direction, PrimitiveId::NONE);
    }
    rays
}

/// Nearest hits by the scalar test of every triangle that may be near.
fn plain_loop(geometry: &Geometry, rays: &Rays) -> Vec<f32> {
    (0..rays.len())
        .map(|i| {
            let [origin, direction] = rays.ray(i);
            let ray = ShearRay::new(origin, direction);
            let near = |t: &&Triangle| {
                let [x, y, _] = t.corners[0];
                (x - origin[0]).abs() <= 2.0 && (y - origin[1]).abs() <= 2.0
            };
            let hits = geometry.triangles.iter().filter(near);
            let hits = hits.filter_map(|triangle| ray.intersect(triangle));
            hits.fold(f32::INFINITY, f32::min)
        })
        .collect()
}

fn flat_grid(trial: &mut Trial<'_>) -> Result<()> {
    let geometry = grid();
    let rays = rays_to_grid(trial.count(40_000));
    let expected = flushed(|| plain_loop(&geometry, &rays));
    let samples = rays.len() as u64;
    trial.on_structures(
        "flat grid, components ±0 to 1e-44",
        "scalar test of all",
        |_, structure| {
            let accel = accel::build(structure, &geometry)?;
            let hits = rays.closest(&*accel);
            let wrong = hits.iter().zip(&expected).filter(|(hit, t)| {
                // The scan has a test of its own, of which the distance may differ by a rounding.
                let apart = (hit.0 - **t).abs();
                hit.1 == PrimitiveId::NONE || apart.is_nan() || apart > f32::EPSILON * **t
            });
            Ok(Figure::none_of(wrong.count() as u64, samples))
        },
    )
}
