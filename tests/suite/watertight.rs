//! No ray from inside of a real closed mesh escapes, however it is aimed. Meshes made by formula are a case of
//! `wavepath stability`; any number of rays is in the bench `watertight`.

use wavepath::accel::{Structure, build};
use wavepath::report::stability::closed_meshes::{Aim, BLOCK, ClosedMesh};

use crate::mesh_scenes::folder;

/// Ray–triangle tests for which the scan has time: it gets fewer rays.
const SCAN_TESTS: u64 = 100_000_000;
/// Rays of the others.
const RAYS: u64 = 350_000;

#[test]
#[allow(
    clippy::print_stderr,
    reason = "tells the developer that the test did nothing"
)]
fn no_ray_from_inside_a_real_closed_mesh_escapes() {
    let Some(folder) = folder() else {
        eprintln!("skipped: set WAVEPATH_MESHES to a folder of OBJ files");
        return;
    };
    for file in ["small/armadillo.obj.zst", "small/skull.obj.zst"] {
        let mesh = ClosedMesh::read(&folder, file, 30).expect("readable");
        for structure in Structure::ALL {
            let rays = match structure {
                Structure::Linear => SCAN_TESTS / mesh.geometry.len() as u64,
                _ => RAYS,
            };
            let accel = build(structure, &mesh.geometry).expect("few triangles");
            let escapes = mesh.escapes(&*accel, &Aim::ALL, rays.div_ceil(BLOCK as u64));
            assert_eq!(escapes, 0, "{structure:?}, {file}");
        }
    }
}
