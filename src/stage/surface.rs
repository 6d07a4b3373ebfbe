//! What the shading stages know of a hit: point, error bound and geometric normal.

use crate::compile::{CompiledScene, Features};
use crate::geometry::{SurfacePoint, sphere_point, triangle_point};
use crate::math::lanes::{F32s, Mask, U32s, gather};
use crate::math::{Compare, Table, Vec3s};
use crate::wave::RayQueue;

/// Three columns at `index`.
#[inline(always)]
pub(super) fn gather3(columns: [&[f32]; 3], index: U32s) -> Vec3s {
    Vec3s::new(
        gather(columns[0], index),
        gather(columns[1], index),
        gather(columns[2], index),
    )
}

/// Three tables at `index`.
#[inline(always)]
fn look_up3([x, y, z]: &[Table<f32>; 3], index: U32s) -> Vec3s {
    Vec3s::new(x.get(index), y.get(index), z.get(index))
}

/// Origin and direction of the rays at `ray`.
#[inline(always)]
pub(super) fn gather_rays(rays: &RayQueue, ray: U32s) -> (Vec3s, Vec3s) {
    (
        gather3([&rays.origin_x, &rays.origin_y, &rays.origin_z], ray),
        gather3(
            [&rays.direction_x, &rays.direction_y, &rays.direction_z],
            ray,
        ),
    )
}

/// Throughput of the rays at `ray`.
#[inline(always)]
pub(super) fn gather_throughput(rays: &RayQueue, ray: U32s) -> Vec3s {
    gather3(
        [&rays.throughput_r, &rays.throughput_g, &rays.throughput_b],
        ray,
    )
}

/// Point with error bound, and unit geometric normal (outward for spheres), of hits of `primitive`
/// by rays known to hit.
#[inline(always)]
pub(crate) fn surface<const F: u32>(
    scene: &CompiledScene,
    primitive: U32s,
    origin: Vec3s,
    direction: Vec3s,
    t: F32s,
) -> (SurfacePoint, Vec3s) {
    let surfaces = &scene.surfaces;
    let is_sphere = if scene.on::<F>(Features::SPHERES) {
        primitive.ge(U32s::splat(surfaces.first_sphere))
    } else {
        Mask::NONE
    };
    let triangle = || {
        let [a, b, c] = &surfaces.corners;
        let corners = [a, b, c].map(|corner| look_up3(corner, primitive));
        (
            triangle_point(origin, direction, corners),
            look_up3(&surfaces.normal, primitive),
        )
    };
    let sphere = || {
        let index = primitive - U32s::splat(surfaces.first_sphere);
        let center = look_up3(&surfaces.center, index);
        let radius = surfaces.radius.get(index);
        let point = sphere_point(origin, direction, t, center, radius);
        let normal = (point.p - center).normalize();
        (point, normal)
    };
    if is_sphere.none() && scene.on::<F>(Features::TRIANGLES) {
        return triangle();
    }
    if is_sphere == Mask::ALL || !scene.on::<F>(Features::TRIANGLES) {
        return sphere();
    }
    let ((tp, tn), (sp, sn)) = (triangle(), sphere());
    let point = SurfacePoint {
        p: Vec3s::select(is_sphere, sp.p, tp.p),
        error: Vec3s::select(is_sphere, sp.error, tp.error),
    };
    (point, Vec3s::select(is_sphere, sn, tn))
}

/// Material of the primitives.
#[inline(always)]
pub(super) fn material(scene: &CompiledScene, primitive: U32s) -> U32s {
    scene.surfaces.material.get(primitive)
}
