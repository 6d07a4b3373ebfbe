//! The binary tree behind both hierarchies. obvhs builds it (PLOC by Meister and Bittner, 2018, and
//! parallel reinsertion, 2018, by the same); nothing of obvhs traverses it.

use std::collections::HashMap;

use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2 as ObvhsTree;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

use crate::geometry::Geometry;
use crate::geometry::slab::Bounds;

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
    /// Every node comes before its children; empty without primitives.
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

/// Share of nodes that each reinsertion pass looks at.
const REINSERTION_SHARE: f32 = 0.15;

/// What a node is made from.
enum Source<'a> {
    /// A node of the tree that obvhs built.
    Node(u32),
    /// Primitives that share one centroid.
    Same(&'a [u32]),
}

/// Boxes of all primitives, exact for triangles.
fn primitive_bounds(geometry: &Geometry) -> Vec<Bounds> {
    let spheres = geometry.spheres.iter().map(|sphere| {
        // Rounded outward, so that no point of the sphere is outside.
        let side = |sign: f32| sphere.center.map(|c| c + sign * sphere.radius);
        Bounds {
            corners: [side(-1.0).map(f32::next_down), side(1.0).map(f32::next_up)],
        }
    });
    geometry
        .triangles
        .iter()
        .map(|triangle| Bounds::of(&triangle.corners))
        .chain(spheres)
        .collect()
}

impl BinaryTree {
    /// Builds over all primitives.
    pub(super) fn new(geometry: &Geometry) -> Self {
        let bounds = primitive_bounds(geometry);
        if bounds.is_empty() {
            return Self {
                nodes: Vec::new(),
                order: Vec::new(),
            };
        }
        let groups = same_centroid(&bounds);
        let group_bounds: Vec<Aabb> = groups
            .iter()
            .map(|group| {
                let union = group
                    .iter()
                    .fold(Bounds::EMPTY, |all, &id| all.union(&bounds[id as usize]));
                Aabb::new(union.corners[0].into(), union.corners[1].into())
            })
            .collect();
        let built = build(&group_bounds);
        convert(&built, &groups, &bounds)
    }
}

/// Primitives by centroid, in order of their first member. PLOC's time is quadratic in the number of
/// equal centroids, so that each group is built as one primitive and halved by index afterwards.
fn same_centroid(bounds: &[Bounds]) -> Vec<Vec<u32>> {
    let mut index = HashMap::new();
    let mut groups: Vec<Vec<u32>> = Vec::new();
    for (id, bounds) in (0u32..).zip(bounds) {
        let [low, high] = &bounds.corners;
        let centroid = [0, 1, 2].map(|k| (0.5 * low[k] + 0.5 * high[k] + 0.0).to_bits());
        let group = *index.entry(centroid).or_insert_with(|| {
            groups.push(Vec::new());
            groups.len() - 1
        });
        groups[group].push(id);
    }
    groups
}

fn build(bounds: &[Aabb]) -> ObvhsTree {
    let indices = (0..bounds.len() as u32).collect();
    let mut tree = PlocBuilder::with_capacity(bounds.len()).build(
        PlocSearchDistance::Medium,
        bounds,
        indices,
        SortPrecision::U64,
        2,
    );
    ReinsertionOptimizer::default().run(&mut tree, REINSERTION_SHARE, None);
    tree
}

/// Copies in depth-first order, without recursion: trees of bad scenes are as deep as they are large.
fn convert(built: &ObvhsTree, groups: &[Vec<u32>], bounds: &[Bounds]) -> BinaryTree {
    let mut nodes: Vec<BinaryNode> = Vec::with_capacity(2 * bounds.len() - 1);
    let mut order: Vec<u32> = Vec::with_capacity(bounds.len());
    // What is to be made, with the parent and the side on which it hangs.
    let mut work: Vec<(Source<'_>, Option<(u32, usize)>)> = vec![(Source::Node(0), None)];
    while let Some((source, parent)) = work.pop() {
        let at = nodes.len() as u32;
        if let Some((parent, side)) = parent
            && let Some(children) = &mut nodes[parent as usize].children
        {
            children[side] = at;
        }
        let halves = match source {
            Source::Node(index) => {
                let node = &built.nodes[index as usize];
                if node.is_leaf() {
                    // The builder puts one primitive, here a group, into each leaf.
                    let group = built.primitive_indices[node.first_index as usize] as usize;
                    halve(&groups[group])
                } else {
                    Ok([
                        Source::Node(node.first_index),
                        Source::Node(node.first_index + 1),
                    ])
                }
            }
            Source::Same(group) => halve(group),
        };
        let mut node = BinaryNode {
            bounds: Bounds::EMPTY,
            first: order.len() as u32,
            count: 1,
            children: None,
        };
        match halves {
            Ok([left, right]) => {
                node.children = Some([0; 2]);
                work.push((right, Some((at, 1))));
                work.push((left, Some((at, 0))));
            }
            Err(primitive) => {
                node.bounds = bounds[primitive as usize];
                order.push(primitive);
            }
        }
        nodes.push(node);
    }
    // Children come after their parents, so that a sweep from the back sees them finished.
    for at in (0..nodes.len()).rev() {
        if let Some([left, right]) = nodes[at].children {
            let (left, right) = (nodes[left as usize], nodes[right as usize]);
            nodes[at].bounds = left.bounds.union(&right.bounds);
            nodes[at].count = left.count + right.count;
        }
    }
    BinaryTree { nodes, order }
}

/// Two halves, or the only member.
fn halve(group: &[u32]) -> Result<[Source<'_>; 2], u32> {
    let (left, right) = group.split_at(group.len() / 2);
    if left.is_empty() {
        Err(right[0])
    } else {
        Ok([Source::Same(left), Source::Same(right)])
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
        let bounds = primitive_bounds(geometry);
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
