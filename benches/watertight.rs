//! Rays from inside of closed meshes, of which none may escape: prints how many did, per mesh and structure, and
//! ends with an error if any. With `WATERTIGHT_RAYS` rays of each structure in each mesh, 10⁶ unless it is set:
//!
//! ```sh
//! WATERTIGHT_RAYS=100000000 WAVEPATH_MESHES=meshes cargo bench --bench watertight -- bvh8
//! ```
//!
//! A word after `--` restricts it to meshes and structures with that word in `MESH/STRUCTURE`.
#![allow(clippy::print_stdout, reason = "its output is the figures")]

use std::process::ExitCode;
use std::time::Instant;

use wavepath::accel::{Structure, build};
use wavepath::report::stability::closed_meshes::{Aim, BLOCK, ClosedMesh};

/// Points inside of each mesh.
const POINTS: usize = 200;

fn meshes(is_test: bool) -> Vec<ClosedMesh> {
    if is_test {
        return vec![ClosedMesh::torus(8, 10)];
    }
    let mut meshes = vec![
        ClosedMesh::sphere(100, POINTS),
        ClosedMesh::torus(100, POINTS),
        ClosedMesh::sponge(36_096, POINTS),
    ];
    match std::env::var_os("WAVEPATH_MESHES") {
        Some(folder) => meshes.extend(
            [
                "small/armadillo.obj.zst",
                "small/skull.obj.zst",
                "medium/stanford-dragon.obj.zst",
            ]
            .map(|file| ClosedMesh::read(folder.as_ref(), file, POINTS).expect("readable")),
        ),
        None => println!("real meshes skipped: WAVEPATH_MESHES names no folder"),
    }
    meshes
}

fn main() -> ExitCode {
    let is_test = std::env::args().any(|argument| argument == "--test");
    let rays: u64 = std::env::var("WATERTIGHT_RAYS")
        .ok()
        .and_then(|value| value.parse().ok())
        .unwrap_or(if is_test { 10_000 } else { 1_000_000 });
    let word = std::env::args().skip(1).find(|word| !word.starts_with('-'));
    let word = word.unwrap_or_default();
    let mut total = 0;
    for mesh in meshes(is_test) {
        for structure in Structure::ALL {
            let name = format!("{}/{}", mesh.name, structure.name());
            if structure == Structure::Linear || !name.contains(&word) {
                continue;
            }
            let accel = build(structure, &mesh.geometry).expect("few triangles");
            let start = Instant::now();
            let blocks = rays.div_ceil(BLOCK as u64);
            let escapes = mesh.escapes(&*accel, &Aim::ALL, blocks);
            println!(
                "{name}, {} triangles: {escapes} of {} rays escaped, {:.1} s",
                mesh.geometry.triangles.len(),
                blocks * BLOCK as u64,
                start.elapsed().as_secs_f64()
            );
            total += escapes;
        }
    }
    if total == 0 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}
