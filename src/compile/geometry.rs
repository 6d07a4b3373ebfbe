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
        // As `compile` decides, here and below: faces with attributes are not merged, each is a group (lights are
        // merged here also where it keeps them apart, which changes no hit).
        let materials = scene.materials.len() as u32;
        let groups = (0u32..)
            .zip(&surfaces.material[..first_sphere])
            .map(|(id, &material)| {
                let primitive = id as usize;
                let alone = surfaces.shading_normals.is_present(primitive)
                    || surfaces.uvs.is_present(primitive);
                if alone { materials + id } else { material }
            })
            .collect();
        // Shadow rays to the background leave the scene.
        let segment_ends = (scene.background.max_element() <= 0.0).then(|| {
            let points = scene.point_lights.iter();
            points
                .map(|light| (light.position - self.center).as_vec3().to_array())
                .collect()
        });
        Geometry {
            triangles,
            spheres,
            groups,
            segment_ends,
        }
    }
}
