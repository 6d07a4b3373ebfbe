//! Who takes part: the structures of this program and those of others, by name, and their builds.

use rayon::ThreadPool;
use serde::{Deserialize, Serialize};

use super::memory::peak_growth;
use crate::accel::foreign::{EMBREE, EmbreeBuild, EmbreeCalls, ObvhsBvh2, ObvhsCwBvh, embree_name};
use crate::accel::{self, Accel, BuildOptions, BuildQuality, Structure};
use crate::error::{Error, Result};
use crate::geometry::Geometry;
use crate::report::{Span, Stopwatch};

/// Stands for every kind of Embree's builds and calls.
const ALL_EMBREE: &str = "embree";

/// A structure that can take part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Contestant {
    /// One of this program's, built at the quality of the run.
    Own(Structure),
    /// The 8-wide tree built at best quality, whatever that of the run.
    Best(Structure),
    /// [`ObvhsBvh2`].
    ObvhsBvh2,
    /// [`ObvhsCwBvh`].
    ObvhsCwBvh,
    /// Embree 4.
    Embree(EmbreeBuild, EmbreeCalls),
}

impl Contestant {
    /// Every contestant, this program's first.
    pub fn all() -> impl Iterator<Item = Self> {
        let best = [Structure::Bvh8, Structure::Packet].map(Self::Best);
        let own = Structure::ALL.into_iter().map(Self::Own).chain(best);
        let embree = EMBREE.into_iter();
        own.chain([Self::ObvhsBvh2, Self::ObvhsCwBvh])
            .chain(embree.map(|(build, calls)| Self::Embree(build, calls)))
    }

    /// Name as on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Own(structure) => structure.name(),
            Self::Best(Structure::Packet) => "packet-best",
            Self::Best(_) => "bvh8-best",
            Self::ObvhsBvh2 => "obvhs-bvh2",
            Self::ObvhsCwBvh => "obvhs-cwbvh",
            Self::Embree(build, calls) => embree_name(build, calls),
        }
    }

    /// Whether it is one of this program's.
    pub fn is_own(self) -> bool {
        matches!(self, Self::Own(_) | Self::Best(_))
    }

    /// Whether it tests every primitive for every ray, and so has time for few rays of a large scene.
    pub fn is_scan(self) -> bool {
        self == Self::Own(Structure::Linear)
    }

    /// The contestants of these names, each once; `embree` stands for all of Embree's. Everyone, if
    /// there are no names.
    ///
    /// # Errors
    /// If a name is unknown.
    pub fn named(names: &[String]) -> Result<Vec<Self>> {
        if names.is_empty() {
            return Ok(Self::all().collect());
        }
        let mut chosen = Vec::new();
        for name in names {
            let matching: Vec<Self> = Self::all()
                .filter(|contestant| match contestant {
                    Self::Embree(..) if name == ALL_EMBREE => true,
                    _ => contestant.name() == name,
                })
                .collect();
            if matching.is_empty() {
                let known: Vec<&str> = Self::all().map(Self::name).collect();
                return Err(Error::usage(format!(
                    "there is no structure \"{name}\"; there are {ALL_EMBREE}, {}",
                    known.join(", ")
                )));
            }
            for contestant in matching {
                if !chosen.contains(&contestant) {
                    chosen.push(contestant);
                }
            }
        }
        Ok(chosen)
    }
}

/// What a build took.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BuildFigures {
    /// Time on the threads of the run.
    pub time: Span,
    /// Bytes that the structure holds, primitives included.
    pub bytes: u64,
    /// Most bytes by which the process grew during the build.
    pub peak_bytes: Option<u64>,
    /// Most bytes that the structure's own memory monitor saw, if it has one.
    pub monitored_peak_bytes: Option<u64>,
}

/// A contestant that is ready to be queried.
#[derive(Debug)]
pub struct Built {
    /// Who.
    pub contestant: Contestant,
    /// The structure.
    pub accel: Box<dyn Accel>,
    /// What its build took; kinds of calls of one Embree build share it.
    pub figures: BuildFigures,
}

/// Builds contestants over one scene.
#[derive(Debug)]
pub struct Builder<'a> {
    geometry: &'a Geometry,
    pool: &'a ThreadPool,
    quality: BuildQuality,
    #[cfg(feature = "embree")]
    embree: embree::Scenes,
}

impl<'a> Builder<'a> {
    /// A builder that uses the threads of the pool; `quality` is that of this program's structures.
    pub fn new(geometry: &'a Geometry, pool: &'a ThreadPool, quality: BuildQuality) -> Self {
        Self {
            geometry,
            pool,
            quality,
            #[cfg(feature = "embree")]
            embree: embree::Scenes::default(),
        }
    }

    /// Builds a contestant.
    ///
    /// # Errors
    /// If it cannot hold this scene, or is not there.
    pub fn build(&mut self, contestant: Contestant) -> Result<Built> {
        let geometry = self.geometry;
        if !contestant.is_own() && !geometry.spheres.is_empty() {
            return Err(Error::usage(
                "it holds triangles only, and there are spheres",
            ));
        }
        let (accel, figures): (Box<dyn Accel>, _) = match contestant {
            Contestant::Own(structure) => self.own(structure, self.quality)?,
            Contestant::Best(structure) => self.own(structure, BuildQuality::Best)?,
            Contestant::ObvhsBvh2 => {
                self.measure(|| Ok(Box::new(ObvhsBvh2::new(geometry)?) as _))?
            }
            Contestant::ObvhsCwBvh => {
                self.measure(|| Ok(Box::new(ObvhsCwBvh::new(geometry)?) as _))?
            }
            Contestant::Embree(build, calls) => self.embree(build, calls)?,
        };
        Ok(Built {
            contestant,
            accel,
            figures,
        })
    }

    fn own(
        &self,
        structure: Structure,
        quality: BuildQuality,
    ) -> Result<(Box<dyn Accel>, BuildFigures)> {
        self.measure(|| {
            let options = BuildOptions {
                quality,
                ..BuildOptions::default()
            };
            accel::build_with(structure, self.geometry, &options)
        })
    }

    /// Builds on the pool's threads.
    fn measure(
        &self,
        build: impl FnOnce() -> Result<Box<dyn Accel>> + Send,
    ) -> Result<(Box<dyn Accel>, BuildFigures)> {
        let ((accel, time), peak_bytes) = measured(|| self.pool.install(build));
        let accel = accel?;
        let figures = BuildFigures {
            time,
            bytes: accel.bytes() as u64,
            peak_bytes,
            monitored_peak_bytes: None,
        };
        Ok((accel, figures))
    }

    #[cfg(feature = "embree")]
    fn embree(
        &mut self,
        build: EmbreeBuild,
        calls: EmbreeCalls,
    ) -> Result<(Box<dyn Accel>, BuildFigures)> {
        let threads = self.pool.current_num_threads();
        self.embree
            .get(&self.geometry.triangles, build, calls, threads)
    }

    #[cfg(not(feature = "embree"))]
    #[expect(clippy::unused_self, reason = "the signature of builds with Embree")]
    fn embree(&mut self, _: EmbreeBuild, _: EmbreeCalls) -> Result<(Box<dyn Accel>, BuildFigures)> {
        Err(Error::usage(
            "this program was built without the cargo feature `embree`",
        ))
    }
}

/// Result, time and memory of a build.
fn measured<R>(build: impl FnOnce() -> R) -> ((R, Span), Option<u64>) {
    peak_growth(|| {
        let watch = Stopwatch::start();
        let result = build();
        (result, watch.span())
    })
}

#[cfg(feature = "embree")]
mod embree {
    //! Embree's scenes, each built once for all kinds of calls.

    use std::collections::HashMap;
    use std::sync::Arc;

    use super::{BuildFigures, measured};
    use crate::accel::Accel;
    use crate::accel::foreign::embree::{Embree, EmbreeMesh, EmbreeScene};
    use crate::accel::foreign::{EmbreeBuild, EmbreeCalls};
    use crate::error::Result;
    use crate::geometry::Triangle;

    #[derive(Debug, Default)]
    pub(super) struct Scenes {
        mesh: Option<EmbreeMesh>,
        built: HashMap<EmbreeBuild, (Arc<EmbreeScene>, BuildFigures)>,
    }

    impl Scenes {
        /// The triangles built in this way, queried by these calls. Finding shared vertices is not
        /// part of the build.
        pub(super) fn get(
            &mut self,
            triangles: &[Triangle],
            build: EmbreeBuild,
            calls: EmbreeCalls,
            threads: usize,
        ) -> Result<(Box<dyn Accel>, BuildFigures)> {
            if let Some((scene, figures)) = self.built.get(&build) {
                return Ok((Box::new(Embree::new(scene, calls)), *figures));
            }
            let mesh = self.mesh.get_or_insert_with(|| EmbreeMesh::new(triangles));
            let ((scene, time), peak_bytes) = measured(|| EmbreeScene::new(mesh, build, threads));
            let scene = Arc::new(scene?);
            let accel = Embree::new(&scene, calls);
            let figures = BuildFigures {
                time,
                bytes: accel.bytes() as u64,
                peak_bytes,
                monitored_peak_bytes: Some(scene.peak_bytes() as u64),
            };
            self.built.insert(build, (scene, figures));
            Ok((Box::new(accel), figures))
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    fn named(names: &[&str]) -> Result<Vec<Contestant>> {
        let names: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
        Contestant::named(&names)
    }

    #[test]
    fn every_name_is_its_own_and_finds_its_contestant() {
        let names: HashSet<&str> = Contestant::all().map(Contestant::name).collect();
        assert_eq!(names.len(), Contestant::all().count());
        for contestant in Contestant::all() {
            assert_eq!(named(&[contestant.name()]).unwrap(), [contestant]);
        }
        assert_eq!(named(&[]).unwrap().len(), names.len());
    }

    #[test]
    fn embree_stands_for_all_of_its_kinds_and_nobody_comes_twice() {
        let chosen = named(&["bvh8", "embree-high", "embree", "bvh8"]).unwrap();
        assert_eq!(chosen.len(), 1 + EMBREE.len());
        assert_eq!(chosen[1].name(), "embree-high");
    }

    #[test]
    fn an_unknown_name_is_refused_with_the_known_ones() {
        let message = named(&["bvh9"]).unwrap_err().message;
        assert!(
            message.contains("\"bvh9\"") && message.contains("bvh8"),
            "{message}"
        );
    }

    #[test]
    fn names_of_structures_are_those_that_they_give_themselves() {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .unwrap();
        let mut rng = crate::geometry::testing::Rng(3);
        let geometry = Geometry {
            triangles: crate::geometry::testing::lat_long_sphere(8, 8, 0.1, &mut rng).triangles(),
            ..Geometry::default()
        };
        let mut builder = Builder::new(&geometry, &pool, BuildQuality::Medium);
        for contestant in Contestant::all() {
            // Embree may not be there.
            if let Ok(built) = builder.build(contestant) {
                let name = contestant.name();
                assert_eq!(
                    built.accel.name(),
                    name.strip_suffix("-best").unwrap_or(name)
                );
                assert!(built.figures.bytes > 0);
            } else {
                assert!(matches!(contestant, Contestant::Embree(..)));
            }
        }
    }

    #[test]
    fn own_structures_are_built_at_the_wanted_quality() {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .unwrap();
        let mut rng = crate::geometry::testing::Rng(4);
        // A few triangles that are large against the others, and askew.
        let large = crate::geometry::testing::torus(12, 6, 0.4).turned(rng.rotation());
        let small = crate::geometry::testing::lat_long_sphere(120, 240, 0.2, &mut rng)
            .placed(0.01, [0.0; 3]);
        let geometry = Geometry {
            triangles: [large.triangles(), small.triangles()].concat(),
            ..Geometry::default()
        };
        let [medium, best] = [BuildQuality::Medium, BuildQuality::Best].map(|quality| {
            let mut builder = Builder::new(&geometry, &pool, quality);
            let built = builder.build(Contestant::Own(Structure::Bvh2)).unwrap();
            built.figures.bytes
        });
        assert_ne!(medium, best, "the trees differ");
    }

    #[test]
    fn others_refuse_spheres() {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .unwrap();
        let geometry = Geometry {
            spheres: vec![crate::geometry::Sphere {
                center: [0.0; 3],
                radius: 1.0,
            }],
            ..Geometry::default()
        };
        let mut builder = Builder::new(&geometry, &pool, BuildQuality::Medium);
        for contestant in Contestant::all() {
            assert_eq!(builder.build(contestant).is_ok(), contestant.is_own());
        }
    }
}
