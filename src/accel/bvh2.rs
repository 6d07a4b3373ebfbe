//! A binary tree, traversed one ray at a time.

use super::build_options::BuildOptions;
use super::leaf::{LEAF_SIZE, Leaves, TreeRay};
use super::stack::Entry;
use super::tree::{BinaryTree, Pending};
use super::walk::Tree;
use crate::geometry::Geometry;
use crate::geometry::slab::Bounds;

/// Both children of an inner node, with their boxes.
#[derive(Debug, Clone, Copy)]
struct Node {
    bounds: [Bounds; 2],
    children: [Entry; 2],
}

/// A binary tree over triangles and spheres.
#[derive(Debug)]
pub struct Bvh2 {
    nodes: Vec<Node>,
    leaves: Leaves,
    /// Box of everything, and what is in it; `None` without primitives.
    root: Option<(Bounds, Entry)>,
    /// Entries that a traversal may have to remember.
    stack_bound: usize,
}

impl Bvh2 {
    /// Builds over the primitives at medium quality.
    pub fn new(geometry: &Geometry) -> Self {
        Self::with_options(geometry, &BuildOptions::default())
    }

    /// Builds over the primitives.
    pub fn with_options(geometry: &Geometry, options: &BuildOptions<'_>) -> Self {
        let tree = BinaryTree::with_options(geometry, options);
        let mut bvh = Self {
            nodes: Vec::new(),
            leaves: Leaves::default(),
            root: None,
            stack_bound: 1,
        };
        let Some(root) = tree.nodes.first() else {
            return bvh;
        };
        // Tree nodes that still need a place.
        let mut work = vec![Pending {
            source: 0,
            parent: None,
            depth: 1,
        }];
        while let Some(Pending {
            source,
            parent,
            depth,
        }) = work.pop()
        {
            let node = &tree.nodes[source as usize];
            let entry = match node.children {
                Some(children) if node.count > LEAF_SIZE => {
                    let at = bvh.nodes.len();
                    bvh.nodes.push(Node {
                        bounds: children.map(|child| tree.nodes[child as usize].bounds),
                        children: [Entry::default(); 2],
                    });
                    for side in [1, 0] {
                        work.push(Pending {
                            source: children[side],
                            parent: Some((at, side)),
                            depth: depth + 1,
                        });
                    }
                    Entry::node(at as u32)
                }
                _ => Entry::leaf(bvh.leaves.push(geometry, &tree, source)),
            };
            // One far child is remembered per level.
            bvh.stack_bound = bvh.stack_bound.max(depth);
            match parent {
                Some((parent, side)) => bvh.nodes[parent].children[side] = entry,
                None => bvh.root = Some((root.bounds, entry)),
            }
        }
        bvh
    }
}

impl Tree for Bvh2 {
    const NAME: &'static str = "bvh2";

    fn node_bytes(&self) -> usize {
        std::mem::size_of_val(&*self.nodes)
    }

    fn leaves(&self) -> &Leaves {
        &self.leaves
    }

    fn stack_bound(&self) -> usize {
        self.stack_bound
    }

    #[inline]
    fn walk(
        &self,
        ray: &TreeRay,
        stack: &mut [Entry],
        mut limit: f32,
        nodes: &mut u64,
        mut visit: impl FnMut(u32, &mut f32) -> bool,
    ) {
        let Some((bounds, root)) = &self.root else {
            return;
        };
        let Some(t) = ray.slab.enters(bounds, limit) else {
            return;
        };
        let mut size = 0;
        let mut current = root.entered_at(t);
        loop {
            if let Some(leaf) = current.as_leaf() {
                if visit(leaf, &mut limit) {
                    return;
                }
            } else {
                *nodes += 1;
                let node = &self.nodes[current.index()];
                let [a, b] = [0, 1].map(|side| {
                    ray.slab
                        .enters(&node.bounds[side], limit)
                        .map(|t| node.children[side].entered_at(t))
                });
                match (a, b) {
                    (Some(a), Some(b)) => {
                        let (near, far) = if b.t < a.t { (b, a) } else { (a, b) };
                        stack[size] = far;
                        size += 1;
                        current = near;
                        continue;
                    }
                    (Some(only), None) | (None, Some(only)) => {
                        current = only;
                        continue;
                    }
                    (None, None) => {}
                }
            }
            // The limit may have come down since an entry was put aside.
            loop {
                if size == 0 {
                    return;
                }
                size -= 1;
                if stack[size].t <= limit {
                    current = stack[size];
                    break;
                }
            }
        }
    }
}
