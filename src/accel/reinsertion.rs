//! Reinsertion with obvhs: nodes of large boxes are taken out of the tree and put back where they enlarge
//! it least (Meister and Bittner, "Parallel Reinsertion for Bounding Volume Hierarchy Optimization", 2018).

use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use rayon::prelude::*;

use super::ploc::Clustered;
use super::tree::Node;

/// Passes; each looks at fewer nodes than the one before, and so nearer to the root.
const PASSES: usize = 16;

/// obvhs searches with a stack on the call stack up to this depth, which forgets what does not fit; the stack
/// that it takes for deeper trees panics instead.
const FORGIVING_DEPTH: usize = 96;

/// Improves the tree. The first pass looks at this `share` of the nodes, pass i at 1 / (2 i + 1) of that.
/// Afterwards a node may come before its parent. The tree does not depend on the number of threads.
pub(super) fn optimize(tree: Clustered, share: f32, progress: impl Fn(f64)) -> Vec<Node> {
    let count = tree.nodes.len();
    let mut tree = Bvh2 {
        nodes: tree.nodes,
        max_depth: tree.depth_bound,
        ..Bvh2::default()
    };
    let mut optimizer = ReinsertionOptimizer::default();
    for pass in 0..PASSES {
        let size = (count as f32 * share) as usize / (2 * pass + 1);
        if size == 0 {
            break;
        }
        if tree.max_depth > FORGIVING_DEPTH {
            tree.max_depth = depth(&tree.nodes).max(FORGIVING_DEPTH + 1);
        }
        let candidates = largest(&tree.nodes, size);
        optimizer.run_with_candidates(&mut tree, &candidates, 1);
        progress((pass + 1) as f64 / PASSES as f64);
    }
    tree.nodes
}

/// Those `size` nodes among the first 2 · `size`, which are mostly near the root, that have the largest boxes.
fn largest(nodes: &[Node], size: usize) -> Vec<u32> {
    let end = nodes.len().min(2 * size + 1);
    let mut candidates: Vec<(f32, u32)> = (1..end as u32)
        .into_par_iter()
        .map(|index| (nodes[index as usize].aabb().half_area(), index))
        .collect();
    if size < candidates.len() {
        candidates.select_nth_unstable_by(size, |a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        candidates.truncate(size);
    }
    candidates.into_iter().map(|(_, index)| index).collect()
}

/// Levels of the tree.
fn depth(nodes: &[Node]) -> usize {
    let mut deepest = 0;
    let mut work = vec![(0, 1)];
    while let Some((index, level)) = work.pop() {
        deepest = deepest.max(level);
        let node: &Node = &nodes[index as usize];
        if !node.is_leaf() {
            work.extend([node.first_index, node.first_index + 1].map(|child| (child, level + 1)));
        }
    }
    deepest
}
