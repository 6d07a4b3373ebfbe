//! The binary and the compressed 8-wide tree of obvhs with its own traversals and triangle test.
//! Built as its preset `medium_build` says, which aims at the build time of Embree.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2 as Tree2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::cwbvh::CwBvh as Tree8;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::{Ray, RayHit};
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle as ObvhsTriangle;

use crate::accel::{Accel, AccelCounters, HitBatch, RayBatch, ShadowBatch};
use crate::error::{Error, Result};
use crate::geometry::{Geometry, PrimitiveId};

/// A tree of obvhs, which finds primitives by their places in its leaves.
trait Tree: Send + Sync {
    const NAME: &'static str;

    fn build(triangles: &[ObvhsTriangle]) -> Self;

    /// Primitive by place.
    fn order(&self) -> &[u32];

    /// Bytes of nodes and order.
    fn bytes(&self) -> usize;

    fn closest(&self, ray: Ray, hit: &mut RayHit, test: impl FnMut(&Ray, usize) -> f32);

    fn free(&self, ray: Ray, test: impl FnMut(&Ray, usize) -> f32) -> bool;
}

impl Tree for Tree2 {
    const NAME: &'static str = "obvhs-bvh2";

    fn build(triangles: &[ObvhsTriangle]) -> Self {
        build_bvh2_from_tris(
            triangles,
            BvhBuildParams::medium_build(),
            &mut Duration::default(),
        )
    }

    fn order(&self) -> &[u32] {
        &self.primitive_indices
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.primitive_indices)
    }

    #[inline(always)]
    fn closest(&self, ray: Ray, hit: &mut RayHit, test: impl FnMut(&Ray, usize) -> f32) {
        self.ray_traverse(ray, hit, test);
    }

    #[inline(always)]
    fn free(&self, ray: Ray, test: impl FnMut(&Ray, usize) -> f32) -> bool {
        self.ray_traverse_miss(ray, test)
    }
}

impl Tree for Tree8 {
    const NAME: &'static str = "obvhs-cwbvh";

    fn build(triangles: &[ObvhsTriangle]) -> Self {
        build_cwbvh_from_tris(
            triangles,
            BvhBuildParams::medium_build(),
            &mut Duration::default(),
        )
    }

    fn order(&self) -> &[u32] {
        &self.primitive_indices
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.primitive_indices)
    }

    #[inline(always)]
    fn closest(&self, ray: Ray, hit: &mut RayHit, test: impl FnMut(&Ray, usize) -> f32) {
        self.ray_traverse(ray, hit, test);
    }

    #[inline(always)]
    fn free(&self, ray: Ray, test: impl FnMut(&Ray, usize) -> f32) -> bool {
        self.ray_traverse_miss(ray, test)
    }
}

/// A tree with its triangles, which lie as the leaves name them.
struct Ordered<T> {
    tree: T,
    triangles: Vec<RtTriangle>,
}

impl<T: Tree> Ordered<T> {
    fn new(geometry: &Geometry) -> Result<Self> {
        if !geometry.spheres.is_empty() {
            return Err(Error::usage(format!("{} holds triangles only", T::NAME)));
        }
        let triangles: Vec<ObvhsTriangle> = geometry
            .triangles
            .iter()
            .map(|triangle| {
                let [v0, v1, v2] = triangle.corners.map(Vec3A::from_array);
                ObvhsTriangle { v0, v1, v2 }
            })
            .collect();
        // It asserts what it expects of its input.
        let tree = catch_unwind(AssertUnwindSafe(|| T::build(&triangles)))
            .map_err(|_| Error::limit(format!("{} failed to build", T::NAME)))?;
        let triangles = tree
            .order()
            .iter()
            .map(|&id| RtTriangle::from(&triangles[id as usize]))
            .collect();
        Ok(Self { tree, triangles })
    }

    fn bytes(&self) -> usize {
        self.tree.bytes() + size_of_val(&*self.triangles)
    }

    fn closest(&self, rays: RayBatch<'_>, hits: HitBatch<'_>) {
        for at in 0..rays.len {
            let mut hit = RayHit::none();
            if let Some(ray) = ray(&rays, at, f32::INFINITY) {
                self.tree.closest(ray, &mut hit, |ray, place| {
                    self.triangles[place].intersect(ray)
                });
            }
            let place = hit.primitive_id as usize;
            (hits.t[at], hits.primitive[at]) = match self.tree.order().get(place) {
                Some(&id) => (hit.t, id),
                None => (f32::INFINITY, PrimitiveId::NONE),
            };
        }
    }

    fn occluded(&self, rays: ShadowBatch<'_>, occluded: &mut [u32]) {
        for (at, occluded) in occluded[..rays.rays.len].iter_mut().enumerate() {
            let free = ray(&rays.rays, at, rays.t_max[at]).is_none_or(|ray| {
                self.tree
                    .free(ray, |ray, place| self.triangles[place].intersect(ray))
            });
            *occluded = u32::from(!free);
        }
    }
}

/// The ray as obvhs has it, hits at t > 0; `None` if it is not finite, which obvhs does not expect.
#[inline(always)]
fn ray(rays: &RayBatch<'_>, at: usize, t_max: f32) -> Option<Ray> {
    let [origin, direction] =
        [rays.origin, rays.direction].map(|columns| Vec3A::from_array(columns.map(|c| c[at])));
    (origin.is_finite() && direction.is_finite())
        .then(|| Ray::new(origin, direction, f32::MIN_POSITIVE, t_max))
}

macro_rules! contestant {
    ($(#[$doc:meta])* $name:ident($tree:ty)) => {
        $(#[$doc])*
        pub struct $name(Ordered<$tree>);

        impl $name {
            /// Builds over the triangles.
            ///
            /// # Errors
            /// If there are spheres, or if obvhs does not take the input.
            pub fn new(geometry: &Geometry) -> Result<Self> {
                Ordered::new(geometry).map(Self)
            }
        }

        impl std::fmt::Debug for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.debug_struct(stringify!($name))
                    .field("triangles", &self.0.triangles.len())
                    .finish_non_exhaustive()
            }
        }

        impl Accel for $name {
            fn name(&self) -> &'static str {
                <$tree>::NAME
            }

            fn bytes(&self) -> usize {
                self.0.bytes()
            }

            fn closest(&self, rays: RayBatch<'_>, hits: HitBatch<'_>, _: &mut AccelCounters) {
                self.0.closest(rays, hits);
            }

            fn occluded(&self, rays: ShadowBatch<'_>, out: &mut [u32], _: &mut AccelCounters) {
                self.0.occluded(rays, out);
            }
        }
    };
}

contestant! {
    /// The binary tree.
    ObvhsBvh2(Tree2)
}
contestant! {
    /// The compressed 8-wide tree (Ylitie, Karras, Laine, "Efficient Incoherent Ray Traversal on GPUs
    /// Through Compressed Wide BVHs", HPG 2017).
    ObvhsCwBvh(Tree8)
}
