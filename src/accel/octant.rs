//! Rays by the octant of their direction, and the order in which a ray of each octant meets the
//! children of a node.

/// Octants of directions: bit k is set where component k has its sign bit set.
pub(super) const OCTANTS: usize = 8;

/// `ORDER[octant][mask]`: the set bits of `mask`, farthest first for a ray of that octant, where child
/// `slot` lies towards the corner of the node whose bit k is set on the upper side of axis k. What
/// follows the last is 0.
pub(super) static ORDER: [[[u8; 8]; 256]; OCTANTS] = order();

const fn order() -> [[[u8; 8]; 256]; OCTANTS] {
    let mut table = [[[0; 8]; 256]; OCTANTS];
    let mut octant = 0;
    while octant < OCTANTS {
        let mut mask = 0;
        while mask < 256 {
            let mut count = 0;
            let total = (mask as u32).count_ones() as usize;
            let mut rank = OCTANTS;
            while rank > 0 {
                rank -= 1;
                // The child of rank 0 is the nearest: it lies where the ray comes from.
                let slot = rank ^ octant;
                if mask >> slot & 1 != 0 {
                    count += 1;
                    table[octant][mask][if count == total { 7 } else { count - 1 }] = slot as u8;
                }
            }
            mask += 1;
        }
        octant += 1;
    }
    table
}
