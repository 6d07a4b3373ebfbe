//! What all trees have in common: one ray at a time walks from leaf to leaf.

use std::fmt::Debug;

use super::leaf::{Closest, Leaves, TreeRay};
use super::stack::{Entry, with_stack};
use super::{Accel, AccelCounters, HitBatch, RayBatch, ShadowBatch};

/// A tree of boxes over [`Leaves`].
pub(super) trait Tree: Send + Sync + Debug {
    /// Name as on the command line.
    const NAME: &'static str;

    /// Bytes held beside the leaves.
    fn node_bytes(&self) -> usize;

    /// The primitives.
    fn leaves(&self) -> &Leaves;

    /// Most entries that a walk puts aside.
    fn stack_bound(&self) -> usize;

    /// Visits leaves that the ray enters no later than at `limit`, nearer children first. `visit` may
    /// lower the limit, and ends the walk by returning true.
    fn walk(
        &self,
        ray: &TreeRay,
        stack: &mut [Entry],
        limit: f32,
        nodes: &mut u64,
        visit: impl FnMut(u32, &mut f32) -> bool,
    );
}

impl<T: Tree> Accel for T {
    fn name(&self) -> &'static str {
        T::NAME
    }

    fn bytes(&self) -> usize {
        self.node_bytes() + self.leaves().bytes()
    }

    fn closest(&self, rays: RayBatch<'_>, hits: HitBatch<'_>, counters: &mut AccelCounters) {
        with_stack(self.stack_bound(), |stack| {
            for at in 0..rays.len {
                let mut closest = Closest::MISS;
                if let Some(ray) = TreeRay::new(&rays, at) {
                    let AccelCounters { nodes, tests } = &mut *counters;
                    self.walk(&ray, stack, closest.limit(), nodes, |leaf, limit| {
                        self.leaves().closest(leaf, &ray, &mut closest, tests);
                        *limit = closest.limit();
                        false
                    });
                }
                hits.t[at] = closest.t;
                hits.primitive[at] = closest.primitive;
            }
        });
    }

    fn occluded(&self, rays: ShadowBatch<'_>, occluded: &mut [u32], counters: &mut AccelCounters) {
        with_stack(self.stack_bound(), |stack| {
            for (at, answer) in occluded.iter_mut().enumerate().take(rays.rays.len) {
                let (t_max, target) = (rays.t_max[at], rays.target[at]);
                let mut blocked = false;
                if let Some(ray) = TreeRay::new(&rays.rays, at) {
                    let AccelCounters { nodes, tests } = &mut *counters;
                    self.walk(&ray, stack, t_max, nodes, |leaf, _| {
                        blocked = self.leaves().occluded(leaf, &ray, t_max, target, tests);
                        blocked
                    });
                }
                *answer = u32::from(blocked);
            }
        });
    }
}
