//! Order along a Morton curve, in which neighbours are mostly near each other in space.

use rayon::prelude::*;

use super::tree::Node;

/// Bits of each coordinate in a Morton code.
const BITS: u32 = 21;

/// The boxes in the order of the Morton codes of their centres; equal codes in the order given.
pub(super) fn sorted(boxes: &[Node]) -> Vec<Node> {
    let everything = boxes
        .par_iter()
        .map(|node| *node.aabb())
        .reduce(obvhs::aabb::Aabb::empty, |a, b| a.union(&b));
    let low = everything.min.as_dvec3();
    // Cells are cubes. In f64, so that no extent overflows.
    let extent = (everything.max.as_dvec3() - low).max_element();
    let scale = f64::from((1 << BITS) - 1) / if extent > 0.0 { extent } else { 1.0 };
    let code = |node: &Node| {
        let bounds = node.aabb();
        let center = 0.5 * (bounds.min.as_dvec3() + bounds.max.as_dvec3());
        let cell = (center - low) * scale;
        spread(cell.x as u32) | spread(cell.y as u32) << 1 | spread(cell.z as u32) << 2
    };
    let mut keys: Vec<(u64, u32)> = (boxes.par_iter().enumerate())
        .map(|(index, node)| (code(node), index as u32))
        .collect();
    keys.par_sort_unstable();
    (keys.par_iter().map(|&(_, index)| boxes[index as usize])).collect()
}

/// Two zero bits between each two of the lowest 21.
fn spread(x: u32) -> u64 {
    let mut x = u64::from(x) & 0x1f_ffff;
    x = (x | x << 32) & 0x001f_0000_0000_ffff;
    x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreading_puts_each_bit_at_three_times_its_place() {
        for bit in 0..BITS {
            assert_eq!(spread(1 << bit), 1 << (3 * bit));
        }
        assert_eq!(spread(1 << BITS), 0, "higher bits are left out");
    }
}
