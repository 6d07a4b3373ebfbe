//! work item → rays: camera rays with jitter inside the pixel.

use super::numbers::Numbers;
use crate::compile::{CompiledScene, Features, WorkItem};
use crate::geometry::PrimitiveId;
use crate::math::Vec3s;
use crate::math::lanes::{F32s, LANES, U32s, iota, store, store_u32, to_f32};
use crate::sampler::{CAMERA_DIMENSIONS, Pcg32s};
use crate::wave::{Wave, state};

/// Starts paths of `item` until the wave is full or the item has no more.
///
/// Where paths may split at glass, only as many start as have room for all their rays.
pub(super) fn generate<const F: u32>(scene: &CompiledScene, item: &WorkItem, wave: &mut Wave) {
    let splits = scene.branching.splits;
    let taken = if splits == 0 {
        wave.rays.len
    } else {
        let states = &wave.rays.state[..wave.rays.len];
        states.iter().map(|&s| state::most_rays(s)).sum()
    };
    let room = (wave.capacity - taken) >> splits;
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
            Numbers::of_camera::<F>(scene, item, random, pixel, sample).pair::<0>()
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
        let start = (1 | state::SPECULAR) + splits * state::SPLIT;
        store_u32(&mut rays.state, at, U32s::splat(start));
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
