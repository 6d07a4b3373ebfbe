//! The binary tree behind all hierarchies: clusters merged along a Morton curve, or at best quality splits of
//! objects and of space from the top, then improved by reinsertion.

use glam::Vec3A;
use obvhs::aabb::Aabb;
use rayon::prelude::*;

use super::build_options::{BuildOptions, BuildPhase};
use super::{huge_pages, morton, ploc, reinsertion, sbvh};
use crate::geometry::slab::Bounds;
use crate::geometry::{Geometry, Sphere, Triangle};

/// A node of a binary tree: children `first_index` and the next one, or (`is_leaf`) the box of the
/// primitive `first_index`.
pub(super) type Node = obvhs::bvh2::node::Bvh2Node;

/// Most leaves of a tree: nodes have 32-bit indices, of which users may want a bit.
pub(super) const MOST_LEAVES: usize = (1 << 31) - 1;

/// The binary tree over all primitives, up to [`MOST_LEAVES`], one in each leaf: the root is node 0, siblings are
/// neighbours. At best quality, a triangle may be in several leaves, whose boxes together cover it. Empty
/// without primitives.
pub(super) fn build(geometry: &Geometry, options: &BuildOptions<'_>) -> Vec<Node> {
    let preset = options.quality.preset();
    options.report(BuildPhase::Sort, 0.0);
    let tree = if let Some(window) = preset.window {
        let mut scratch = huge_pages::zeroed(geometry.len());
        let leaves = morton::sorted(geometry.len(), &mut scratch, |id| {
            primitive_box(geometry, id)
        });
        options.report(BuildPhase::Sort, 1.0);
        ploc::cluster(leaves, scratch, window, |share| {
            options.report(BuildPhase::Cluster, share);
        })
    } else {
        let leaves = (0..geometry.len() as u32)
            .into_par_iter()
            .map(|id| primitive_box(geometry, id))
            .collect();
        options.report(BuildPhase::Sort, 1.0);
        sbvh::build(geometry, leaves, MOST_LEAVES, |share| {
            options.report(BuildPhase::Cluster, share);
        })
    };
    reinsertion::optimize(tree, preset.reinsertion, |share| {
        options.report(BuildPhase::Optimize, share);
    })
}

/// The leaf of a primitive.
pub(super) fn primitive_box(geometry: &Geometry, id: u32) -> Node {
    let bounds = match geometry.triangles.get(id as usize) {
        Some(triangle) => triangle_box(triangle),
        None => sphere_box(&geometry.spheres[id as usize - geometry.triangles.len()]),
    };
    Node::new(bounds, 1, id)
}

fn triangle_box(triangle: &Triangle) -> Aabb {
    let [a, b, c] = triangle.corners.map(Vec3A::from);
    Aabb::new(a.min(b).min(c), a.max(b).max(c))
}

/// Rounded outward, so that no point of the sphere is outside.
fn sphere_box(sphere: &Sphere) -> Aabb {
    let side = |sign: f32| sphere.center.map(|c| c + sign * sphere.radius);
    Aabb::new(
        side(-1.0).map(f32::next_down).into(),
        side(1.0).map(f32::next_up).into(),
    )
}

/// The box of a node.
pub(super) fn node_bounds(node: &Node) -> Bounds {
    let bounds = node.aabb();
    Bounds {
        corners: [bounds.min.to_array(), bounds.max.to_array()],
    }
}

/// A node over a run of [`BinaryTree::order`].
#[derive(Debug, Clone, Copy)]
pub(super) struct BinaryNode {
    pub(super) bounds: Bounds,
    /// First place in the order.
    pub(super) first: u32,
    /// Primitives below.
    pub(super) count: u32,
    /// Both children, if it is an inner node; nodes of one primitive are leaves.
    pub(super) children: Option<[u32; 2]>,
}

/// A binary tree with one primitive per leaf. The root is node 0.
#[derive(Debug)]
pub(super) struct BinaryTree {
    /// Depth first; empty without primitives.
    pub(super) nodes: Vec<BinaryNode>,
    /// Primitive ids, leaf by leaf from left to right.
    pub(super) order: Vec<u32>,
}

/// A node of the binary tree that waits for its place in a hierarchy made from it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pending {
    /// The binary node.
    pub(super) source: u32,
    /// Node and slot where it hangs; `None` for the root.
    pub(super) parent: Option<(usize, usize)>,
    /// Levels down to it, 1 for the root.
    pub(super) depth: usize,
}

impl BinaryTree {
    /// Builds over all primitives at medium quality.
    #[cfg(test)]
    pub(super) fn new(geometry: &Geometry) -> Self {
        Self::with_options(geometry, &BuildOptions::default())
    }

    /// Builds over all primitives.
    pub(super) fn with_options(geometry: &Geometry, options: &BuildOptions<'_>) -> Self {
        Self::depth_first(&build(geometry, options))
    }

    /// Copies in depth-first order, without recursion: trees of bad scenes are as deep as they are large.
    fn depth_first(built: &[Node]) -> Self {
        let mut nodes: Vec<BinaryNode> = Vec::with_capacity(built.len());
        let mut order = Vec::with_capacity(built.len().div_ceil(2));
        // What is to be copied, with the parent and the side on which it hangs.
        let mut work: Vec<(u32, Option<(u32, usize)>)> = Vec::new();
        work.extend((!built.is_empty()).then_some((0, None)));
        while let Some((source, parent)) = work.pop() {
            let at = nodes.len() as u32;
            if let Some((parent, side)) = parent
                && let Some(children) = &mut nodes[parent as usize].children
            {
                children[side] = at;
            }
            let node = &built[source as usize];
            let is_leaf = node.is_leaf();
            nodes.push(BinaryNode {
                bounds: node_bounds(node),
                first: order.len() as u32,
                count: 1,
                children: (!is_leaf).then_some([0; 2]),
            });
            if is_leaf {
                order.push(node.first_index);
            } else {
                work.push((node.first_index + 1, Some((at, 1))));
                work.push((node.first_index, Some((at, 0))));
            }
        }
        // Children come after their parents, so that a sweep from the back sees them finished.
        for at in (0..nodes.len()).rev() {
            if let Some([left, right]) = nodes[at].children {
                nodes[at].count = nodes[left as usize].count + nodes[right as usize].count;
            }
        }
        Self { nodes, order }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::testing::{Rng, lat_long_sphere};
    use crate::geometry::{Sphere, Triangle};

    fn check(geometry: &Geometry) -> usize {
        let tree = BinaryTree::new(geometry);
        let mut seen = tree.order.clone();
        seen.sort_unstable();
        assert!(
            seen.into_iter().eq(0..geometry.len() as u32),
            "every primitive is in one leaf"
        );
        let bounds: Vec<Bounds> = (0..geometry.len() as u32)
            .map(|id| node_bounds(&primitive_box(geometry, id)))
            .collect();
        let mut depth = vec![1; tree.nodes.len()];
        for (at, node) in tree.nodes.iter().enumerate() {
            let run = &tree.order[node.first as usize..(node.first + node.count) as usize];
            let union = run
                .iter()
                .fold(Bounds::EMPTY, |all, &id| all.union(&bounds[id as usize]));
            assert_eq!(node.bounds, union, "boxes are exact");
            assert_eq!(node.children.is_none(), node.count == 1);
            for child in node.children.into_iter().flatten() {
                assert!(child as usize > at);
                depth[child as usize] = depth[at] + 1;
            }
        }
        depth.into_iter().max().unwrap_or(0)
    }

    #[test]
    fn trees_hold_every_primitive_once_within_exact_boxes() {
        let mut rng = Rng(2);
        let mesh = lat_long_sphere(20, 40, 0.2, &mut rng);
        let spheres: Vec<Sphere> = (0..50)
            .map(|_| Sphere {
                center: rng.sphere(),
                radius: rng.uniform(),
            })
            .collect();
        check(&Geometry {
            triangles: mesh.triangles(),
            spheres: spheres.clone(),
            ..Geometry::default()
        });
        for n in 0..20 {
            let triangles = mesh.triangles()[..n].to_vec();
            check(&Geometry {
                triangles: triangles.clone(),
                ..Geometry::default()
            });
            check(&Geometry {
                spheres: spheres[..n].to_vec(),
                ..Geometry::default()
            });
            check(&Geometry {
                triangles,
                spheres: spheres[..n].to_vec(),
                ..Geometry::default()
            });
        }
    }

    #[test]
    fn identical_triangles_make_a_balanced_tree_quickly() {
        let triangle = Triangle {
            corners: [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        };
        let geometry = Geometry {
            triangles: vec![triangle; 100_000],
            ..Geometry::default()
        };
        assert_eq!(check(&geometry), 18);
    }

    #[test]
    fn shrinking_triangles_make_a_valid_tree_however_deep() {
        let triangles = (0..2_000)
            .map(|k| {
                let x = 2f32.powf(-(k as f32) / 16.0);
                Triangle {
                    corners: [[x, 0.0, 0.0], [x, x * 0.1, 0.0], [x, 0.0, x * 0.1]],
                }
            })
            .collect();
        check(&Geometry {
            triangles,
            ..Geometry::default()
        });
    }
}
