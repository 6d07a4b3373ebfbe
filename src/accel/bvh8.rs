//! A tree of eight children per node, collapsed from the binary tree by surface area (Wald, Benthin and
//! Boulos, "Getting Rid of Packets", 2008), traversed one ray at a time with eight boxes per step.

use super::leaf::{LEAF_SIZE, Leaves, TreeRay};
use super::stack::Entry;
use super::tree::{BinaryTree, Pending};
use super::walk::Tree;
use crate::geometry::Geometry;
use crate::geometry::slab::{Bounds, Bounds8};

const WIDTH: usize = 8;

/// Up to eight children with their boxes; unused slots have empty boxes, which no ray enters.
#[derive(Debug, Clone, Copy)]
struct Node {
    bounds: Bounds8,
    children: [Entry; WIDTH],
}

/// An 8-wide tree over triangles and spheres.
#[derive(Debug)]
pub struct Bvh8 {
    nodes: Vec<Node>,
    leaves: Leaves,
    /// `None` without primitives.
    root: Option<Entry>,
    /// Entries that a traversal may have to remember.
    stack_bound: usize,
}

impl Bvh8 {
    /// Builds over the primitives.
    pub fn new(geometry: &Geometry) -> Self {
        let tree = BinaryTree::new(geometry);
        let mut bvh = Self {
            nodes: Vec::new(),
            leaves: Leaves::default(),
            root: None,
            stack_bound: WIDTH,
        };
        if tree.nodes.is_empty() {
            return bvh;
        }
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
            let entry = if is_leaf(&tree, source) {
                Entry::leaf(bvh.leaves.push(geometry, &tree, source))
            } else {
                let children = widen(&tree, source);
                let at = bvh.nodes.len();
                let bounds: Vec<Bounds> = children
                    .iter()
                    .map(|&child| tree.nodes[child as usize].bounds)
                    .collect();
                bvh.nodes.push(Node {
                    bounds: Bounds8::new(&bounds),
                    children: [Entry::default(); WIDTH],
                });
                for (slot, &child) in children.iter().enumerate().rev() {
                    work.push(Pending {
                        source: child,
                        parent: Some((at, slot)),
                        depth: depth + 1,
                    });
                }
                // Each level leaves at most all but one of its children behind.
                bvh.stack_bound = bvh.stack_bound.max(depth * (WIDTH - 1) + 1);
                Entry::node(at as u32)
            };
            match parent {
                Some((parent, slot)) => bvh.nodes[parent].children[slot] = entry,
                None => bvh.root = Some(entry),
            }
        }
        bvh
    }
}

impl Tree for Bvh8 {
    const NAME: &'static str = "bvh8";

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
        let Some(root) = self.root else { return };
        stack[0] = root;
        let mut size = 1;
        while size > 0 {
            size -= 1;
            let current = stack[size];
            // The limit may have come down since the entry was put aside.
            if current.t > limit {
                continue;
            }
            if let Some(leaf) = current.as_leaf() {
                if visit(leaf, &mut limit) {
                    return;
                }
                continue;
            }
            *nodes += 1;
            let node = &self.nodes[current.index()];
            let (mut entered, t) = ray.slab.enters8(&node.bounds, limit);
            let t = t.as_array();
            let base = size;
            while entered != 0 {
                let slot = entered.trailing_zeros() as usize;
                entered &= entered - 1;
                // Inserted so that the nearest comes to lie on top.
                let entry = node.children[slot].entered_at(t[slot]);
                let mut place = size;
                while place > base && stack[place - 1].t < entry.t {
                    stack[place] = stack[place - 1];
                    place -= 1;
                }
                stack[place] = entry;
                size += 1;
            }
        }
    }
}

fn is_leaf(tree: &BinaryTree, node: u32) -> bool {
    tree.nodes[node as usize].count <= LEAF_SIZE
}

/// Up to eight descendants that stand for the node: the largest inner node is opened until eight are reached.
fn widen(tree: &BinaryTree, node: u32) -> Vec<u32> {
    let mut open = vec![node];
    while open.len() < WIDTH {
        let inner = open
            .iter()
            .enumerate()
            .filter(|&(_, &child)| !is_leaf(tree, child));
        let area = |child: u32| tree.nodes[child as usize].bounds.half_area();
        let Some((at, _)) = inner.max_by(|a, b| area(*a.1).total_cmp(&area(*b.1))) else {
            break;
        };
        let Some(children) = tree.nodes[open[at] as usize].children else {
            break;
        };
        open.splice(at..=at, children);
    }
    open
}
