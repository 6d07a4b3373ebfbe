//! A fractal heightfield: octaves of gradient noise, each twice as fine and half as high (K. Perlin,
//! "An Image Synthesizer", SIGGRAPH 1985; fractional Brownian motion with H = 1 in F. K. Musgrave's
//! chapter of Ebert et al., "Texturing and Modeling", 3rd ed. 2003).

use glam::{DVec2, DVec3};

use super::sink::MeshSink;

/// Cells of the coarsest octave along each side.
const COARSEST: u32 = 2;
/// Cells of the grid that one cell of the finest octave has along each side, at least.
const FINEST_CELLS: u32 = 2;
/// Factor on the coarsest octave. Noise is at most 1/√2, all octaves together less than twice the
/// first, so that heights stay below 1.
const HEIGHT: f64 = 0.5;

/// Columns and rows of the grid.
fn layout(triangles: u32) -> (u32, u32) {
    let cells = triangles / 2;
    let columns = cells.isqrt();
    (columns, cells / columns)
}

/// How many faces [`make`] makes.
pub(super) fn faces(triangles: u32) -> u32 {
    let (columns, rows) = layout(triangles);
    2 * columns * rows
}

/// Makes up to `triangles` faces, at least 2, over the square [−1, 1]², facing +z.
pub(super) fn make<S: MeshSink>(triangles: u32, seed: u64, sink: &mut S) -> Result<(), S::Error> {
    let (columns, rows) = layout(triangles);
    let octaves = octaves(columns, seed);
    let place = |step: u32, steps: u32| f64::from(step) / f64::from(steps);
    let mut previous: Vec<u32> = Vec::new();
    for row in 0..=rows {
        let mut current = Vec::with_capacity(columns as usize + 1);
        for column in 0..=columns {
            let at = DVec2::new(place(column, columns), place(row, rows));
            let height: f64 = octaves.iter().map(|octave| octave.height(at)).sum();
            let position: DVec3 = (2.0 * at - DVec2::ONE).extend(height);
            current.push(sink.vertex(position.as_vec3().to_array())?);
        }
        for (below, above) in previous.windows(2).zip(current.windows(2)) {
            sink.quad([below[0], below[1], above[1], above[0]])?;
        }
        previous = current;
    }
    Ok(())
}

/// Noise on a lattice.
#[derive(Debug)]
struct Octave {
    /// Cells along each side of the terrain.
    cells: f64,
    amplitude: f64,
    key: u64,
}

/// The octaves that a grid with so many columns can show.
fn octaves(columns: u32, seed: u64) -> Vec<Octave> {
    let mut octaves = Vec::new();
    let mut cells = COARSEST;
    while octaves.is_empty() || cells * FINEST_CELLS <= columns {
        octaves.push(Octave {
            cells: f64::from(cells),
            amplitude: HEIGHT * f64::from(COARSEST) / f64::from(cells),
            key: mix(seed ^ mix(cells.into())),
        });
        cells *= 2;
    }
    octaves
}

impl Octave {
    /// The octave's part of the height at a point of [0, 1]².
    fn height(&self, at: DVec2) -> f64 {
        let scaled = at * self.cells;
        let (cell, inside) = (scaled.floor(), scaled.fract());
        let [x, y] = [cell.x as u64, cell.y as u64];
        let slope = |i: u64, j: u64| {
            let offset = inside - DVec2::new(i as f64, j as f64);
            self.gradient(x + i, y + j).dot(offset)
        };
        // Perlin's quintic, whose first and second derivatives are 0 at the lattice ("Improving
        // Noise", SIGGRAPH 2002).
        let weight = |t: f64| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
        let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
        let [u, v] = [weight(inside.x), weight(inside.y)];
        self.amplitude
            * mix(
                mix(slope(0, 0), slope(1, 0), u),
                mix(slope(0, 1), slope(1, 1), u),
                v,
            )
    }

    /// One of eight unit vectors, by the lattice point.
    fn gradient(&self, x: u64, y: u64) -> DVec2 {
        const DIAGONAL: f64 = std::f64::consts::FRAC_1_SQRT_2;
        const GRADIENTS: [[f64; 2]; 8] = [
            [1.0, 0.0],
            [DIAGONAL, DIAGONAL],
            [0.0, 1.0],
            [-DIAGONAL, DIAGONAL],
            [-1.0, 0.0],
            [-DIAGONAL, -DIAGONAL],
            [0.0, -1.0],
            [DIAGONAL, -DIAGONAL],
        ];
        GRADIENTS[(mix(self.key ^ (x << 32 | y)) >> 61) as usize].into()
    }
}

/// A 64-bit finaliser with full avalanche (Stafford's variant 13 of the MurmurHash3 mixer).
fn mix(bits: u64) -> u64 {
    let bits = (bits ^ bits >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let bits = (bits ^ bits >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ bits >> 31
}

#[cfg(test)]
mod tests {
    use super::super::testing::corners;
    use super::*;
    use crate::scene::Mesh;

    #[test]
    fn a_terrain_covers_its_square_once_facing_up() {
        let mut mesh = Mesh::default();
        let Ok(()) = make(20_000, 5, &mut mesh);
        let areas = corners(&mesh).map(|[a, b, c]| (b - a).cross(c - a).z / 2.0);
        let (smallest, sum) = areas.fold((f64::MAX, 0.0), |(m, s), area| (m.min(area), s + area));
        assert!(smallest > 0.0);
        assert!((sum - 4.0).abs() < 1e-6, "{sum}");
    }

    #[test]
    fn a_finer_terrain_is_the_same_landscape_with_more_detail() {
        // 50 and 100 columns: every second vertex of the finer grid is one of the coarser.
        let [coarse, fine] = [5_000, 20_000].map(|triangles| {
            let mut mesh = Mesh::default();
            let Ok(()) = make(triangles, 6, &mut mesh);
            mesh.positions
        });
        assert_eq!((coarse.len(), fine.len()), (51 * 51, 101 * 101));
        let detail = (0..coarse.len())
            .map(|i| (coarse[i] - fine[2 * (i / 51) * 101 + 2 * (i % 51)]).length())
            .fold(0.0, f64::max);
        // The finer one has an octave more, of 32 cells.
        let octave = HEIGHT * f64::from(COARSEST) / 32.0;
        assert!(detail > 0.1 * octave && detail < octave, "{detail}");
    }
}
