//! Menger's sponge: a cube is cut into 3³, of which the seven that touch neither an edge nor a corner are
//! taken out, and so on with the twenty that are left. Only faces between what is left and what is not
//! are made, with shared vertices, layer by layer.

use super::sink::MeshSink;

/// Most levels: the next sponge has 257 million faces.
const MAX_LEVEL: u32 = 5;

/// Faces of a sponge: 2·20ⁿ + 4·8ⁿ squares (the cube's 6 for n = 0; each step makes 20 cubes of one, and
/// what they hide of each other leaves 8 times the faces on the outside of the cube).
fn level_faces(level: u32) -> u32 {
    2 * (2 * 20_u32.pow(level) + 4 * 8_u32.pow(level))
}

/// Level of the largest sponge with no more faces than wanted.
fn level(triangles: u32) -> u32 {
    (1..=MAX_LEVEL)
        .take_while(|&level| level_faces(level) <= triangles)
        .last()
        .unwrap_or(0)
}

/// How many faces [`make`] makes.
pub(super) fn faces(triangles: u32) -> u32 {
    level_faces(level(triangles))
}

/// Makes the largest sponge of up to `triangles` faces, at least the 12 of a cube, in [−1, 1]³.
pub(super) fn make<S: MeshSink>(triangles: u32, sink: &mut S) -> Result<(), S::Error> {
    let cells = Cells::new(level(triangles));
    let mut vertices = Vertices::new(cells.side());
    for z in 0..=cells.side() {
        vertices.begin_layer(z);
        for y in 0..=cells.side() {
            for x in 0..=cells.side() {
                for axis in 0..3 {
                    let at = [x, y, z];
                    let mut before = at;
                    before[axis] = before[axis].wrapping_sub(1);
                    // Outward is from the cell that is left to the one that is not.
                    let outward_along_axis = match [before, at].map(|cell| cells.is_left(cell)) {
                        [true, false] => true,
                        [false, true] => false,
                        _ => continue,
                    };
                    let mut square = [0; 4];
                    for (index, corner) in square.iter_mut().zip(square_corners(at, axis)) {
                        *index = vertices.index(corner, sink)?;
                    }
                    if !outward_along_axis {
                        square.reverse();
                    }
                    sink.quad(square)?;
                }
            }
        }
    }
    Ok(())
}

/// Corners of the unit square across `axis` from its lowest one, counter-clockwise from where the axis
/// points to.
fn square_corners(lowest: [u32; 3], axis: usize) -> [[u32; 3]; 4] {
    [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[right, up]| {
        let mut corner = lowest;
        corner[(axis + 1) % 3] += right;
        corner[(axis + 2) % 3] += up;
        corner
    })
}

/// Which of the 3ⁿ cells along each side are left.
#[derive(Debug)]
struct Cells {
    /// Bit k is set where digit k of the coordinate in base 3 is 1.
    ones: Vec<u32>,
}

impl Cells {
    fn new(level: u32) -> Self {
        let ones = |coordinate: u32| {
            (0..level)
                .filter(|&k| coordinate / 3_u32.pow(k) % 3 == 1)
                .fold(0, |bits, k| bits | 1 << k)
        };
        Self {
            ones: (0..3_u32.pow(level)).map(ones).collect(),
        }
    }

    /// Cells along each side.
    fn side(&self) -> u32 {
        self.ones.len() as u32
    }

    /// Whether the cell is part of the sponge: at no level it is in the middle along two axes. Cells
    /// beyond the cube are not.
    fn is_left(&self, cell: [u32; 3]) -> bool {
        match cell.map(|coordinate| self.ones.get(coordinate as usize)) {
            [Some(x), Some(y), Some(z)] => (x & y) | (y & z) | (z & x) == 0,
            _ => false,
        }
    }
}

/// Indices of the vertices on the two lattice planes about the layer in work.
#[derive(Debug)]
struct Vertices {
    /// Cells along each side.
    side: u32,
    /// Planes of even and of odd z.
    planes: [Vec<Option<u32>>; 2],
}

impl Vertices {
    fn new(side: u32) -> Self {
        let plane = vec![None; (side as usize + 1).pow(2)];
        Self {
            side,
            planes: [plane.clone(), plane],
        }
    }

    /// Forgets the plane below `z` to make room for the one above.
    fn begin_layer(&mut self, z: u32) {
        self.planes[(z as usize + 1) % 2].fill(None);
    }

    /// The vertex at a lattice point, made at its first use.
    fn index<S: MeshSink>(&mut self, [x, y, z]: [u32; 3], sink: &mut S) -> Result<u32, S::Error> {
        let place = y as usize * (self.side as usize + 1) + x as usize;
        let known = &mut self.planes[z as usize % 2][place];
        match *known {
            Some(index) => Ok(index),
            None => {
                let coordinate = |step| 2.0 * f64::from(step) / f64::from(self.side) - 1.0;
                let index = sink.vertex([x, y, z].map(|step| coordinate(step) as f32))?;
                *known = Some(index);
                Ok(index)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::volume;
    use super::*;
    use crate::scene::Mesh;

    #[test]
    fn sponges_have_the_volume_and_the_faces_of_their_level() {
        for (wanted, level, count) in [
            (12, 0, 12),
            (143, 0, 12),
            (144, 1, 144),
            (2_112, 2, 2_112),
            (36_096, 3, 36_096),
        ] {
            let mut mesh = Mesh::default();
            let Ok(()) = make(wanted, &mut mesh);
            assert_eq!(mesh.faces.len(), count);
            assert_eq!(faces(wanted) as usize, count);
            // Of 27 cells 20 are left each time.
            let expected = 8.0 * (20.0_f64 / 27.0).powi(level);
            // Corners are rounded to f32.
            assert!((volume(&mesh) / expected - 1.0).abs() < 1e-5, "{level}");
        }
    }
}
