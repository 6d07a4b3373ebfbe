//! Meshes of any size, for measuring how cost grows with the number of triangles.

use super::sink::MeshSink;
use super::{hairball, soup, sponge, terrain};
use crate::error::{Error, Result};
use crate::scene::Mesh;

/// What kind of mesh. Each lies within [−1, 1]³.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, clap::ValueEnum)]
pub enum ScalableKind {
    /// Thin curved tubes that grow from a small sphere
    Hairball,
    /// Fractal heightfield over a square, z up
    Terrain,
    /// Menger sponge, exposed faces alone: 144, 2112, 36096, 672768 or 13062144 triangles
    Sponge,
    /// Random triangles of random size in a cube
    Soup,
}

impl ScalableKind {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::Hairball, Self::Terrain, Self::Sponge, Self::Soup];

    /// Name as on the command line and in scene files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hairball => "hairball",
            Self::Terrain => "terrain",
            Self::Sponge => "sponge",
            Self::Soup => "soup",
        }
    }
}

/// A mesh of a wanted size that is not made yet.
///
/// The same kind, size and seed give the same mesh, to the last bit. It has at most as many
/// triangles as wanted: fewer by less than a tube segment for a hairball, by less than a row of the
/// grid for a terrain; a sponge is the largest one that is not larger, and a soup is exact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ScalableMesh {
    kind: ScalableKind,
    triangles: u32,
    seed: u64,
}

impl ScalableMesh {
    /// Fewest triangles that may be wanted.
    pub const MIN_TRIANGLES: u32 = 1_000;
    /// Most triangles that may be wanted.
    pub const MAX_TRIANGLES: u32 = 30_000_000;

    /// A mesh of `triangles` triangles. A sponge does not depend on the seed.
    ///
    /// # Errors
    /// [`crate::ErrorKind::Usage`] unless `triangles` is within [`Self::MIN_TRIANGLES`] ..=
    /// [`Self::MAX_TRIANGLES`].
    pub fn new(kind: ScalableKind, triangles: u32, seed: u64) -> Result<Self> {
        let (min, max) = (Self::MIN_TRIANGLES, Self::MAX_TRIANGLES);
        if !(min..=max).contains(&triangles) {
            return Err(Error::usage(format!(
                "the number of triangles must be between {min} and {max}, got {triangles}"
            )));
        }
        Ok(Self {
            kind,
            triangles,
            seed,
        })
    }

    /// How many triangles it has.
    pub fn faces(&self) -> u32 {
        match self.kind {
            ScalableKind::Hairball => hairball::faces(self.triangles),
            ScalableKind::Terrain => terrain::faces(self.triangles),
            ScalableKind::Sponge => sponge::faces(self.triangles),
            ScalableKind::Soup => self.triangles,
        }
    }

    /// Makes the mesh and gives it to `sink`. Beside the sink's, this takes no more than some MB.
    ///
    /// # Errors
    /// The first that the sink returns.
    pub fn make<S: MeshSink>(&self, sink: &mut S) -> std::result::Result<(), S::Error> {
        match self.kind {
            ScalableKind::Hairball => hairball::make(self.triangles, self.seed, sink),
            ScalableKind::Terrain => terrain::make(self.triangles, self.seed, sink),
            ScalableKind::Sponge => sponge::make(self.triangles, sink),
            ScalableKind::Soup => soup::make(self.triangles, self.seed, sink),
        }
    }

    /// The mesh in memory.
    pub fn to_mesh(&self) -> Mesh {
        let mut mesh = Mesh {
            faces: Vec::with_capacity(self.faces() as usize),
            ..Mesh::default()
        };
        let Ok(()) = self.make(&mut mesh);
        mesh
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{corners, is_closed, volume};
    use super::*;
    use crate::error::ErrorKind;
    use crate::scene::mesh::{self, is_degenerate};

    fn made(kind: ScalableKind, triangles: u32, seed: u64) -> Mesh {
        ScalableMesh::new(kind, triangles, seed).unwrap().to_mesh()
    }

    #[test]
    fn sizes_are_as_announced_and_no_larger_than_wanted() {
        for kind in ScalableKind::ALL {
            for wanted in [1_000, 1_001, 4_999, 20_000, 33_333] {
                let mesh = ScalableMesh::new(kind, wanted, 1).unwrap();
                let made = mesh.to_mesh().faces.len() as u32;
                assert_eq!(made, mesh.faces(), "{kind:?} {wanted}");
                let missing = wanted - made;
                match kind {
                    ScalableKind::Hairball => assert!(missing < 8, "{missing}"),
                    // A row of a square has √(wanted/2) cells of two triangles.
                    ScalableKind::Terrain => {
                        let row = f64::from(2 * wanted).sqrt();
                        assert!(f64::from(missing) < row + 2.0, "{missing}");
                    }
                    ScalableKind::Sponge => assert!([144, 2_112].contains(&made)),
                    ScalableKind::Soup => assert_eq!(missing, 0),
                }
            }
        }
    }

    #[test]
    fn the_largest_sizes_can_be_counted() {
        let most = ScalableMesh::MAX_TRIANGLES;
        let faces = |kind| ScalableMesh::new(kind, most, 0).unwrap().faces();
        assert!(most - faces(ScalableKind::Hairball) < 8);
        assert!(most - faces(ScalableKind::Terrain) < 7_800);
        assert_eq!(faces(ScalableKind::Sponge), 13_062_144);
        assert_eq!(faces(ScalableKind::Soup), most);
    }

    #[test]
    fn sizes_beyond_the_limits_are_refused() {
        for triangles in [0, 999, 30_000_001, u32::MAX] {
            let error = ScalableMesh::new(ScalableKind::Soup, triangles, 0).unwrap_err();
            assert_eq!(error.kind, ErrorKind::Usage);
            assert!(error.message.contains(&triangles.to_string()), "{error}");
        }
    }

    #[test]
    fn a_mesh_depends_on_its_seed_and_on_nothing_else() {
        for kind in ScalableKind::ALL {
            let [first, again, other] = [1, 1, 2].map(|seed| made(kind, 3_000, seed));
            assert_eq!(first.positions, again.positions, "{kind:?}");
            assert_eq!(first.faces, again.faces, "{kind:?}");
            let seeded = kind != ScalableKind::Sponge;
            assert_eq!(first.positions != other.positions, seeded, "{kind:?}");
        }
    }

    #[test]
    fn every_face_can_be_traced_and_lies_in_the_cube() {
        for kind in ScalableKind::ALL {
            for wanted in [1_000, 100_000] {
                let mut mesh = made(kind, wanted, 3);
                let inside = mesh.positions.iter().all(|p| p.abs().max_element() <= 1.0);
                assert!(inside, "{kind:?} {wanted}");
                assert!(!corners(&mesh).any(is_degenerate), "{kind:?} {wanted}");
                let vertices = mesh.positions.len();
                assert_eq!(mesh::clean(&mut mesh), mesh::Removed::default());
                assert_eq!(mesh.positions.len(), vertices, "every vertex is used");
            }
        }
    }

    #[test]
    fn tubes_and_sponges_are_closed_and_face_outward() {
        for kind in [ScalableKind::Hairball, ScalableKind::Sponge] {
            for wanted in [1_000, 40_000] {
                let mesh = made(kind, wanted, 4);
                assert!(is_closed(&mesh), "{kind:?} {wanted}");
                assert!(volume(&mesh) > 0.0, "{kind:?} {wanted}");
            }
        }
    }
}
