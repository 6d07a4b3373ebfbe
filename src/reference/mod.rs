//! The yardstick: the same pictures by the plainest means.
//!
//! One ray at a time, against every object one after the other, in f64; materials and lights are
//! written for this module alone and share nothing with the kernels of the wavefront. What is
//! computed, and what the wavefront computes as well:
//!
//! - A path has segments; the camera ray is segment 1. At a hit of segment n light is sampled and
//!   the path goes on, both as segment n + 1, while that is within the depth limit.
//! - Surfaces scatter on both sides. The geometric normal matters for glass, which it points out
//!   of, and for one-sided emission.
//! - Shading normals, between those of a triangle's corners, turn the frame of the BSDF alone. What
//!   would be scattered to one side of the surface and to the other of its shading normal is absorbed.
//! - With the opacity as its probability light meets a surface; else the path goes straight on as if
//!   there were none, and counts a segment. Emission is not reduced. Shadow rays are blocked by what
//!   is not fully opaque, which is why light found straight on counts in full.
//! - Radiance that crosses into glass is scaled by the squared ratio of the refraction indices.
//! - Until it meets anything but mirrors and glass, a path may split at glass as often as is set. Of several
//!   light samples at a hit the mean counts.
//! - Russian roulette ends paths from a chosen depth on, whatever scatters.
//! - With transparent shadows a shadow ray goes straight through glass and loses at each crossing
//!   what would be reflected there. Light found by refraction alone after a surface that sampled
//!   this light would be counted twice, and is dropped; what came through glass is in turn
//!   found by shadow rays alone and gets their full weight. The result is biased.
//!
//! Random numbers are independent for every sample, also where the settings ask for strata, and
//! independent from those of the wavefront: the expectation of the picture is the same, and two
//! pictures can be compared by statistics.

mod appearance;
mod bsdf;
mod closed_form;
mod direct;
mod flatten;
mod light;
mod path;
mod primitives;
mod random;
mod rectangle;
mod specular;
mod triangle;
mod warp;
mod whitted;

use glam::DVec3;

use self::appearance::Appearance;
pub use self::closed_form::closed_form_image;
use self::flatten::{Surface, Tables};
use self::light::{Lights, Vertex};
use self::primitives::{Hit, POSITION_ERROR, PatchId, Primitives, Ray};
use self::random::Random;
use crate::error::{Error, Result};
use crate::scene::{
    IntegratorKind, RenderSettings, SceneDescription, Strategy, TextureDescription,
};
use crate::wave::Rejections;

/// Largest survival probability of roulette: even between perfect mirrors a path ends some time.
const MAX_SURVIVAL: f64 = 0.99;

/// A scene ready to be rendered from one camera; read-only.
#[derive(Debug)]
pub struct Reference {
    /// Eye, top left corner, right and down edge of the image plane.
    camera: [DVec3; 4],
    resolution: [u32; 2],
    primitives: Primitives,
    /// One per primitive.
    surfaces: Vec<Surface>,
    textures: Vec<TextureDescription>,
    background: DVec3,
    lights: Lights,
    /// The light that is the background, if shadow rays look for it.
    background_light: Option<usize>,
    whitted: bool,
    supersamples: bool,
    strategy: Strategy,
    seed: u64,
    max_depth: u32,
    roulette_depth: u32,
    light_samples: u32,
    glass_splits: u32,
    transparent_shadows: bool,
    /// Replaces the error bound of points that rays leave.
    shadow_bias: Option<f64>,
}

/// Rays traced, paths cut short, and what was left out.
#[derive(Default, Clone, Copy, Debug, PartialEq, Eq)]
pub struct RayCounts {
    /// Rays from the camera.
    pub camera: u64,
    /// Closest-hit rays after the first of each path.
    pub bounce: u64,
    /// Rays towards lights.
    pub shadow: u64,
    /// Paths that the depth limit ended at a surface that would have scattered.
    pub truncated: u64,
    /// What was not finite or negative, by the stage of the wavefront that does the same.
    pub rejected: Rejections,
}

impl Reference {
    /// Prepares `scene` as seen by `scene.cameras[camera]` on a film of this size.
    ///
    /// [`IntegratorKind::Whitted`] renders Whitted's method, every other kind path tracing.
    ///
    /// # Errors
    /// If the camera does not exist, the film is empty, an index in the scene is out of range, or
    /// there are 2³² primitives.
    pub fn new(
        scene: &SceneDescription,
        camera: usize,
        width: u32,
        height: u32,
        settings: &RenderSettings,
    ) -> Result<Self> {
        let camera = scene
            .cameras
            .get(camera)
            .ok_or_else(|| Error::usage(format!("the scene has no camera number {camera}")))?;
        if width == 0 || height == 0 {
            return Err(Error::usage("the film has no pixels"));
        }
        let whitted = settings.integrator == IntegratorKind::Whitted;
        // Direction sampling finds all lights but those without a surface.
        let samples_surfaces = whitted || settings.strategy != Strategy::Bsdf;

        let Tables {
            primitives,
            surfaces,
            lights,
            background_light,
        } = flatten::flatten(scene, samples_surfaces)?;
        Ok(Self {
            camera: camera.projection.plane(width, height),
            resolution: [width, height],
            primitives,
            surfaces,
            textures: scene.textures.clone(),
            background: scene.background,
            lights,
            background_light,
            whitted,
            supersamples: settings.supersamples(),
            strategy: settings.strategy,
            seed: settings.seed,
            max_depth: settings.max_depth.unwrap_or(u32::MAX),
            roulette_depth: settings.roulette_depth,
            light_samples: settings.light_samples,
            glass_splits: settings.glass_splits,
            transparent_shadows: settings.transparent_shadows,
            shadow_bias: settings.shadow_bias,
        })
    }

    /// Radiance of one camera sample, W·sr⁻¹·m⁻², linear RGB; the pixel's value is the mean over
    /// samples (box filter, or its centre without supersampling). Depends on nothing but the seed, the
    /// pixel and the sample. Adds the rays traced to `counts`.
    pub fn sample(&self, pixel_x: u32, pixel_y: u32, sample: u64, counts: &mut RayCounts) -> DVec3 {
        let mut random = Random::new(self.seed, pixel_x, pixel_y, sample);
        let jitter = if self.supersamples {
            random.next_2d()
        } else {
            [0.5; 2]
        };
        let ray = self.camera_ray([
            f64::from(pixel_x) + jitter[0],
            f64::from(pixel_y) + jitter[1],
        ]);
        if self.whitted {
            self.whitted_radiance(ray, &mut random, counts)
        } else {
            self.path_radiance(ray, &mut random, counts)
        }
    }

    /// The ray through a point of the image in pixels from its top left corner.
    fn camera_ray(&self, pixel: [f64; 2]) -> Ray {
        let [eye, top_left, right, down] = self.camera;
        let s = pixel[0] / f64::from(self.resolution[0]);
        let t = pixel[1] / f64::from(self.resolution[1]);
        let direction = (top_left + right * s + down * t - eye).normalize();
        // A surface through the eye itself is not seen.
        let t_min = POSITION_ERROR * eye.abs().max_element();
        Ray {
            origin: eye,
            direction,
            t_min,
            start: PatchId::NONE,
        }
    }

    /// The closest hit of the ray that is segment `depth` of its path.
    fn trace(&self, ray: &Ray, depth: u32, counts: &mut RayCounts) -> Option<Hit> {
        if depth == 1 {
            counts.camera += 1;
        } else {
            counts.bounce += 1;
        }
        self.primitives.closest(ray)
    }

    /// How a ray of this direction sees what it hits.
    fn appearance(&self, hit: &Hit, direction: DVec3) -> Appearance {
        Appearance::new(
            &self.surfaces[hit.primitive],
            &self.textures,
            hit,
            direction,
        )
    }

    /// A hit as seen by light.
    fn vertex(&self, hit: &Hit, appearance: &Appearance) -> Vertex {
        Vertex {
            point: hit.position + appearance.face * self.offset(hit),
            normal: appearance.normal,
            face: appearance.face,
            patch: hit.patch,
        }
    }

    /// The ray that leaves a hit to either side, outside of the surface's rounding error.
    fn spawn(&self, hit: &Hit, direction: DVec3) -> Ray {
        let side = hit.normal * direction.dot(hit.normal).signum();
        Ray {
            origin: hit.position + side * self.offset(hit),
            direction,
            t_min: 0.0,
            start: self.left_behind(hit.patch),
        }
    }

    /// How far off the surface rays leave a hit: the bound of the surface's rounding error, or the fixed
    /// bias that the settings ask for.
    fn offset(&self, hit: &Hit) -> f64 {
        self.shadow_bias
            .unwrap_or(self.surfaces[hit.primitive].position_error)
    }

    /// What rays that leave `patch` cannot hit: itself, or with a fixed bias nothing.
    fn left_behind(&self, patch: PatchId) -> PatchId {
        match self.shadow_bias {
            Some(_) => PatchId::NONE,
            None => patch,
        }
    }

    /// `radiance`, or a path's weight, if it is finite and not negative, else 0; the latter is counted. Debug
    /// builds assert that there is no such thing.
    fn keep_sound(radiance: DVec3, rejected: &mut u64) -> DVec3 {
        let is_sound = radiance.is_finite() && radiance.min_element() >= 0.0;
        debug_assert!(is_sound, "unsound contribution {radiance}");
        if is_sound {
            return radiance;
        }
        *rejected += 1;
        DVec3::ZERO
    }

    /// What a path's weight is multiplied with after `depth` segments: 0 if roulette ends the path.
    /// `eta_scale` is the product of the refraction indices' ratios along the path; what radiance
    /// lost by entering glass it wins back on leaving, and is no reason to end.
    fn roulette(&self, throughput: DVec3, eta_scale: f64, depth: u32, random: &mut Random) -> f64 {
        if depth < self.roulette_depth {
            return 1.0;
        }
        let survival = (throughput.max_element() * eta_scale * eta_scale).min(MAX_SURVIVAL);
        if random.next() < survival {
            1.0 / survival
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::scene::{
        BsdfDescription, CameraDescription, FilmDescription, MaterialDescription, MaterialId, Mesh,
        Projection, RenderDefaults, ShapeDescription, ShapeGeometry,
    };

    #[test]
    fn unsound_radiance_is_asserted_against_in_debug_builds_and_else_counted() {
        for unsound in [DVec3::new(1.0, f64::NAN, 1.0), -DVec3::X, DVec3::INFINITY] {
            let kept = std::panic::catch_unwind(|| {
                let mut rejected = 0;
                (Reference::keep_sound(unsound, &mut rejected), rejected)
            });
            if cfg!(debug_assertions) {
                assert!(kept.is_err());
            } else {
                assert_eq!(kept.expect("no panic"), (DVec3::ZERO, 1));
            }
        }
        let mut rejected = 0;
        assert_eq!(Reference::keep_sound(DVec3::X, &mut rejected), DVec3::X);
        assert_eq!(rejected, 0);
    }

    #[test]
    fn rays_spawned_to_either_side_miss_the_neighbour_in_the_same_plane() {
        // A square of two triangles that share the diagonal, somewhere skew in space.
        let turn = glam::DQuat::from_scaled_axis(DVec3::new(0.3, 1.1, -0.7));
        let place = |x: f64, y: f64| DVec3::new(30.0, -7.0, 2.0) + turn * DVec3::new(x, y, 0.0);
        let mesh = Mesh {
            positions: vec![
                place(0.0, 0.0),
                place(1.0, 0.0),
                place(1.0, 1.0),
                place(0.0, 1.0),
            ],
            faces: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        };
        let eye = place(0.5, 0.5) + turn * DVec3::Z;
        let camera = Projection::Plane {
            eye,
            top_left: place(0.1, 0.1),
            right: DVec3::ZERO,
            down: place(0.9, 0.9) - place(0.1, 0.1),
        };
        let scene = SceneDescription {
            source: PathBuf::new(),
            film: FilmDescription {
                width: 1,
                height: 1000,
                exposure: 0.0,
            },
            cameras: vec![CameraDescription {
                name: String::new(),
                projection: camera,
            }],
            materials: vec![MaterialDescription::new("", BsdfDescription::Black)],
            textures: Vec::new(),
            shapes: vec![ShapeDescription {
                name: String::new(),
                geometry: ShapeGeometry::Mesh(mesh),
                material: MaterialId(0),
            }],
            point_lights: Vec::new(),
            background: DVec3::ZERO,
            closed_form: None,
            render: RenderDefaults::default(),
            mesh_files: Vec::new(),
            warnings: Vec::new(),
        };
        let reference = Reference::new(&scene, 0, 1, 1000, &RenderSettings::default())
            .expect("the scene is sound");
        for row in 0..1000 {
            let ray = reference.camera_ray([0.5, f64::from(row) + 0.5]);
            let hit = reference
                .primitives
                .closest(&ray)
                .expect("aimed at the diagonal");
            for height in [1.0, 0.01, -0.01, -1.0] {
                for across in [DVec3::new(1.0, -1.0, height), DVec3::new(-1.0, 1.0, height)] {
                    let spawned = reference.spawn(&hit, (turn * across).normalize());
                    assert!(
                        reference.primitives.closest(&spawned).is_none(),
                        "row {row}"
                    );
                }
            }
        }
    }
}
