//! Order along a Morton curve, in which neighbours are mostly near each other in space.

use obvhs::aabb::Aabb;
use rayon::prelude::*;

use super::tree::Node;

/// Bits of each coordinate in a Morton code.
const BITS: u32 = 21;

/// The boxes number 0 .. `count`, asked for more than once, in the order of the Morton codes of their centres;
/// equal codes in the order of their numbers.
pub(super) fn sorted(count: usize, get: impl Fn(u32) -> Node + Sync) -> Vec<Node> {
    let all = || (0..count as u32).into_par_iter();
    let everything = all()
        .map(|index| *get(index).aabb())
        .reduce(Aabb::empty, |a, b| a.union(&b));
    let low = everything.min.as_dvec3();
    // Cells are cubes. In f64, so that no extent overflows.
    let extent = (everything.max.as_dvec3() - low).max_element();
    let scale = f64::from((1 << BITS) - 1) / if extent > 0.0 { extent } else { 1.0 };
    let code = |node: Node| {
        let center = 0.5 * (node.min.as_dvec3() + node.max.as_dvec3());
        let cell = (center - low) * scale;
        spread(cell.x as u32) | spread(cell.y as u32) << 1 | spread(cell.z as u32) << 2
    };
    // One number each, so that comparing takes no branches.
    let mut keys: Vec<u128> = all()
        .map(|index| u128::from(code(get(index))) << 32 | u128::from(index))
        .collect();
    keys.par_sort_unstable();
    keys.par_iter().map(|&key| get(key as u32)).collect()
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
