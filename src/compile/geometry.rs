//! The primitives of a compiled scene, for building other structures over them.

use super::CompiledScene;
use crate::geometry::{Geometry, Sphere, Triangle};
use crate::scene::SceneDescription;

impl CompiledScene {
    /// The primitives that the scene's structure was built over, in the same order; `scene` is what
    /// it was compiled from.
    pub fn geometry(&self, scene: &SceneDescription) -> Geometry {
        let surfaces = &self.surfaces;
        let first_sphere = surfaces.first_sphere as usize;
        let triangles = (0..first_sphere)
            .map(|i| Triangle {
                corners: [0, 1, 2]
                    .map(|corner| [0, 1, 2].map(|axis| surfaces.corners[corner][axis][i])),
            })
            .collect();
        let spheres = (0..surfaces.radius.len())
            .map(|i| Sphere {
                center: [0, 1, 2].map(|axis| surfaces.center[axis][i]),
                radius: surfaces.radius[i],
            })
            .collect();
        // As `compile` decides: shadow rays to the background leave the scene.
        let segment_ends = (scene.background.max_element() <= 0.0).then(|| {
            let points = scene.point_lights.iter();
            points
                .map(|light| (light.position - self.center).as_vec3().to_array())
                .collect()
        });
        Geometry {
            triangles,
            spheres,
            groups: surfaces.material[..first_sphere].to_vec(),
            segment_ends,
        }
    }
}
