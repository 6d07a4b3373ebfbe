//! What the stages know of the place of a hit: point, error bound and geometric normal.

use crate::compile::{CompiledScene, Features};
use crate::geometry::{
    PrimitiveId, SurfacePoint, biased_origin, spawn_origin, sphere_point, triangle_hit,
};
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

/// The place of a hit.
#[derive(Clone, Copy)]
pub(crate) struct Surface {
    /// Point with its error bound.
    pub(crate) point: SurfacePoint,
    /// Unit geometric normal, outward for spheres.
    pub(crate) normal: Vec3s,
    /// Barycentric coordinates on triangles.
    pub(crate) weights: [F32s; 3],
}

/// The places of hits of `primitive` by rays known to hit.
#[inline(always)]
pub(crate) fn surface<const F: u32>(
    scene: &CompiledScene,
    primitive: U32s,
    origin: Vec3s,
    direction: Vec3s,
    t: F32s,
) -> Surface {
    let surfaces = &scene.surfaces;
    let is_sphere = if scene.on::<F>(Features::SPHERES) {
        primitive.ge(U32s::splat(surfaces.first_sphere))
    } else {
        Mask::NONE
    };
    let triangle = || {
        let [a, b, c] = &surfaces.corners;
        let corners = [a, b, c].map(|corner| look_up3(corner, primitive));
        let (point, weights) = triangle_hit(origin, direction, corners);
        Surface {
            point,
            normal: look_up3(&surfaces.normal, primitive),
            weights,
        }
    };
    let sphere = || {
        let index = primitive - U32s::splat(surfaces.first_sphere);
        let center = look_up3(&surfaces.center, index);
        let radius = surfaces.radius.get(index);
        let point = sphere_point(origin, direction, t, center, radius);
        Surface {
            point,
            normal: (point.p - center).normalize(),
            weights: [F32s::splat(0.0); 3],
        }
    };
    if is_sphere.none() && scene.on::<F>(Features::TRIANGLES) {
        return triangle();
    }
    if is_sphere == Mask::ALL || !scene.on::<F>(Features::TRIANGLES) {
        return sphere();
    }
    let (on_triangle, on_sphere) = (triangle(), sphere());
    let select = |a: Vec3s, b: Vec3s| Vec3s::select(is_sphere, a, b);
    Surface {
        point: SurfacePoint {
            p: select(on_sphere.point.p, on_triangle.point.p),
            start: select(on_sphere.point.start, on_triangle.point.start),
            error: select(on_sphere.point.error, on_triangle.point.error),
        },
        normal: select(on_sphere.normal, on_triangle.normal),
        weights: on_triangle.weights,
    }
}

/// Where a ray that leaves `point` along `direction` starts, on that side of the surface with unit geometric
/// `normal`: outside of the point's error bound, or off by the fixed bias that the settings ask for.
#[inline(always)]
pub(super) fn leave<const F: u32>(
    scene: &CompiledScene,
    point: &SurfacePoint,
    normal: Vec3s,
    direction: Vec3s,
) -> Vec3s {
    if scene.on::<F>(Features::SHADOW_BIAS) {
        biased_origin(point.p, normal, direction, scene.shadow_bias)
    } else {
        spawn_origin(point, normal, direction)
    }
}

/// What a ray that leaves `primitive` cannot hit: itself, or with a fixed bias nothing.
#[inline(always)]
pub(super) fn left_behind<const F: u32>(scene: &CompiledScene, primitive: U32s) -> U32s {
    if scene.on::<F>(Features::SHADOW_BIAS) {
        U32s::splat(PrimitiveId::NONE)
    } else {
        primitive
    }
}

/// Material of the primitives.
#[inline(always)]
pub(super) fn material(scene: &CompiledScene, primitive: U32s) -> U32s {
    scene.surfaces.material.get(primitive)
}
