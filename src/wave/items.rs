//! Every queue item of the renderer, declared here and only here.

use super::soa::soa;
use crate::compile::Features;

/// Packed path state of a ray: its depth, what it came through, how often its path may be split.
pub mod state {
    /// Bits of the depth: segments traced when this ray is traced, camera rays have 1.
    pub const DEPTH: u32 = (1 << 24) - 1;
    /// The last scattering was a delta lobe (or this is a camera ray).
    pub const SPECULAR: u32 = 1 << 24;
    /// Since the last non-delta scattering, of which there was one, the path only went straight
    /// through glass boundaries (at least one).
    pub const THROUGH_GLASS: u32 = 1 << 25;
    /// There was a non-delta scattering and since then only transmissions or nothing.
    pub const UNREFLECTED: u32 = 1 << 26;
    /// One split at glass that the path may still make, as an addend.
    pub const SPLIT: u32 = 1 << 27;
    /// Bits of the number of those splits, the highest.
    pub const SPLITS: u32 = !(SPLIT - 1);

    /// Most rays that the path of a ray with this state may become, the ray included.
    #[inline(always)]
    pub const fn most_rays(state: u32) -> usize {
        1 << (state >> SPLIT.trailing_zeros())
    }
}

soa! {
    /// Rays to trace, with the state of their paths.
    pub struct RayQueue {
        /// Origin, scene units (re-centred).
        origin_x: f32;
        /// Origin.
        origin_y: f32;
        /// Origin.
        origin_z: f32;
        /// Direction, unit length.
        direction_x: f32;
        /// Direction.
        direction_y: f32;
        /// Direction.
        direction_z: f32;
        /// Primitive the ray starts on, or none.
        skip: u32;
        /// Throughput, red.
        throughput_r: f32;
        /// Throughput, green.
        throughput_g: f32;
        /// Throughput, blue.
        throughput_b: f32;
        /// Path number within the work item.
        path: u32;
        /// Depth and history, see [`state`].
        state: u32;
        /// Generator state at the first dimension of the next hit.
        random: u64;
        /// Solid-angle density with which the material sampled this direction (0: delta lobe).
        pdf: f32, if Features::MIS;
        /// Product of the relative indices crossed: undoes the radiance scaling for roulette.
        eta: f32, if Features::DIELECTRIC;
        /// Cosine between the ray and the normal where it starts: decides the background's density.
        cosine: f32, if Features::BACKGROUND;
    }
}

soa! {
    /// Closest hits, one for each ray in the same order.
    pub struct HitQueue {
        /// Distance, scene units; infinite for a miss.
        t: f32;
        /// Primitive, or none.
        primitive: u32;
    }
}

soa! {
    /// Shadow rays, with what arrives if nothing is in the way.
    pub struct ShadowQueue {
        /// Origin, scene units (re-centred).
        origin_x: f32;
        /// Origin.
        origin_y: f32;
        /// Origin.
        origin_z: f32;
        /// Direction, unit length.
        direction_x: f32;
        /// Direction.
        direction_y: f32;
        /// Direction.
        direction_z: f32;
        /// Primitive the ray starts on.
        skip: u32;
        /// End of the segment, scene units.
        t_max: f32;
        /// The light's primitive, or none.
        target: u32;
        /// Radiance carried to the camera, red.
        radiance_r: f32;
        /// Radiance, green.
        radiance_g: f32;
        /// Radiance, blue.
        radiance_b: f32;
        /// Path number within the work item.
        path: u32;
        /// Weight against direction sampling that `radiance` contains: undone for light through glass,
        /// which shadow rays alone may bring.
        weight: f32, if Features::TRANSPARENT_SHADOWS;
        /// 1 where something is in the way.
        occluded: u32;
    }
}

soa! {
    /// Positions in the ray queue that one stage has to look at.
    pub struct IndexQueue {
        /// Index into the ray and hit queues.
        index: u32;
    }
}
