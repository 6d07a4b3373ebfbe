//! No ray from inside of a closed mesh escapes, however it is aimed: about a million rays per structure
//! here, any number in the bench `watertight`.

use wavepath::accel::{Structure, build};

use crate::closed_meshes::{BLOCK, ClosedMesh};
use crate::mesh_scenes::folder;

/// Ray–triangle tests for which the scan has time: it gets fewer rays.
const SCAN_TESTS: u64 = 100_000_000;

fn assert_no_escapes(mesh: &ClosedMesh, rays: u64) {
    for structure in Structure::ALL {
        let rays = match structure {
            Structure::Linear => SCAN_TESTS / mesh.geometry.len() as u64,
            _ => rays,
        };
        let accel = build(structure, &mesh.geometry).expect("few triangles");
        let escapes = mesh.escapes(&*accel, rays.div_ceil(BLOCK as u64));
        assert_eq!(escapes, 0, "{structure:?}, {}", mesh.name);
    }
}

#[test]
fn no_ray_from_inside_a_sphere_of_needles_escapes() {
    assert_no_escapes(&ClosedMesh::sphere(40, 100), 350_000);
}

#[test]
fn no_ray_from_inside_a_torus_escapes() {
    assert_no_escapes(&ClosedMesh::torus(32, 100), 350_000);
}

#[test]
fn no_ray_from_inside_a_sponge_escapes() {
    assert_no_escapes(&ClosedMesh::sponge(2_112, 100), 350_000);
}

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
        assert_no_escapes(&ClosedMesh::read(&folder, file, 30), 350_000);
    }
}
