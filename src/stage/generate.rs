//! work item → rays: camera rays with jitter inside the pixel.

use crate::compile::{CompiledScene, Features, WorkItem};
use crate::geometry::PrimitiveId;
use crate::math::Vec3s;
use crate::math::lanes::{F32s, LANES, U32s, iota, store, store_u32, to_f32};
use crate::sampler::{CAMERA_DIMENSIONS, Pcg32s, Strata};
use crate::wave::{Wave, state};

/// Starts paths of `item` until the wave is full or the item has no more.
///
/// With splitting (Whitted's transport) paths start only in an empty wave, as many as have room
/// to split.
pub(super) fn generate<const F: u32>(scene: &CompiledScene, item: &WorkItem, wave: &mut Wave) {
    let whitted = scene.on::<F>(Features::WHITTED);
    let room = match (whitted, wave.rays.len) {
        (false, len) => wave.capacity - len,
        (true, 0) => (wave.capacity >> state::MOST_SPLITS).max(1),
        (true, _) => 0,
    };
    let count = room.min((item.paths() - wave.next_path) as usize);
    let rays = &mut wave.rays;
    for start in (0..count).step_by(LANES) {
        let at = rays.len + start;
        let path = U32s::splat(wave.next_path + start as u32) + iota();
        let (x, y, sample) = item.locate(path);
        let pixel = y * U32s::splat(item.image_width) + x;
        let mut random = Pcg32s::for_paths(scene.seed, pixel, item.first_sample, sample);
        let jitter = if scene.on::<F>(Features::PIXEL_CENTRES) {
            [F32s::splat(0.5); 2]
        } else {
            let jitter = {
                let mut r = random;
                [r.next_f32(), r.next_f32()]
            };
            if scene.on::<F>(Features::STRATIFIED) {
                Strata::new(scene.seed, pixel, item.block, item.samples, sample)
                    .pair(U32s::splat(0), jitter)
            } else {
                jitter
            }
        };
        random = random.skip::<CAMERA_DIMENSIONS>();
        let direction = scene
            .camera
            .directions(to_f32(x) + jitter[0], to_f32(y) + jitter[1]);
        rays.set_ray(
            at,
            Vec3s::splat(scene.camera.eye),
            direction,
            U32s::splat(PrimitiveId::NONE),
        );
        rays.set_throughput(at, Vec3s::splat([1.0; 3]));
        store_u32(&mut rays.path, at, path);
        store_u32(&mut rays.state, at, U32s::splat(1 | state::SPECULAR));
        rays.random[at..at + LANES].copy_from_slice(&random.states());
        if scene.on::<F>(Features::MIS) {
            store(&mut rays.pdf, at, F32s::splat(0.0));
        }
        if scene.on::<F>(Features::DIELECTRIC) {
            store(&mut rays.eta, at, F32s::splat(1.0));
        }
    }
    rays.len += count;
    wave.next_path += count as u32;
}
