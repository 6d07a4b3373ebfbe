//! A data-oriented wavefront path tracer for CPUs, built as an instrument for performance research.
//!
//! Rays live in structure-of-arrays queues and pass through separate stages, each a kernel on SIMD
//! lanes of rays. One worker owns one set of queues, small enough for its L2 cache. Beside the
//! wavefront stands a plain recursive renderer in f64 ([`reference`](mod@reference)) that shares no
//! material, light or intersection code with it; tests compare the two on every scene.
//!
//! The program `wavepath` is this library behind a command line. The README has its commands, the
//! module [`scene`] the format of scene files.
//!
//! # Example
//!
//! Inside a closed room whose walls reflect the share ρ of the light and emit the radiance L, the
//! radiance is L + ρL + ρ²L + … = L/(1 − ρ) at every point and in every direction. Here L = 1 and
//! ρ = 1/2. With directions sampled in proportion to the cosine, without roulette and cut after 64
//! segments, every single sample is that sum, short of 2⁻⁶⁴ of it.
//!
//! ```
//! use std::ops::ControlFlow;
//! use std::path::Path;
//!
//! use wavepath::compile::compile;
//! use wavepath::integrator::render;
//! use wavepath::scene::{self, Budget, RenderSettings, Strategy};
//!
//! let text = r#"
//!     [film]
//!     width = 16
//!     height = 16
//!
//!     [cameras.inside]
//!     eye = [0.1, 0.2, 0.3]
//!     look_at = [1, 0, 0]
//!     up = [0, 0, 1]
//!     fov = 90
//!
//!     [materials.wall]
//!     type = "lambertian"
//!     reflectance = 0.5
//!     emission = 1
//!     two_sided = true        # a box faces outward, the camera is inside
//!
//!     [[shapes]]
//!     type = "mesh"
//!     mesh = "box"
//!     material = "wall"
//!     size = [2, 2, 2]
//! "#;
//! let scene = scene::parse(text, Path::new("room.toml"), &[])?;
//! let settings = RenderSettings {
//!     budget: Budget::Samples(4),
//!     strategy: Strategy::Bsdf,
//!     max_depth: Some(64),
//!     roulette_depth: 64,
//!     threads: 1,
//!     ..RenderSettings::default()
//! };
//! let camera = 0;
//! let compiled = compile(&scene, camera, scene.film.width, scene.film.height, &settings)?;
//! let outcome = render(&scene, &compiled, &settings, &|_| ControlFlow::Continue(()))?;
//! for pixel in 0..outcome.film.len() {
//!     for radiance in outcome.film.mean(pixel) {
//!         assert!((radiance - 2.0).abs() < 1e-5, "{radiance}");
//!     }
//! }
//! # Ok::<(), wavepath::Error>(())
//! ```
//!
//! # Flow of data
//!
//! One way; nothing points back up.
//!
//! ```text
//! scene file (TOML) + OBJ
//!     │  scene        read, check
//!     ▼
//! SceneDescription               as the user wrote it: plain data in f64
//!     │  compile      decide what is needed, flatten, build
//!     ▼
//! CompiledScene + Features       as it is traced: f32 about the scene's centre, read-only, shared
//!     │  integrator   hands out work items: one tile times one block of samples
//!     ▼
//! Wave: queues ⇄ stages          one per worker, nothing shared, nothing allocated while it runs
//!     │
//!     ▼
//! Film                           sums per pixel in f64, blocks added in a fixed order
//!     │
//!     ▼
//! PNG, EXR, checkpoint, report
//! ```
//!
//! A pass of the wave ([`integrator::wavefront::trace`]) runs these stages, and reports time by
//! these names ([`integrator::clock::Step`]):
//!
//! | stage | from → to |
//! | --- | --- |
//! | generate | work item → rays, in the slots that finished paths left free |
//! | intersect | rays → closest hits, a batch per call of [`accel::Accel`] |
//! | sort | hits → a queue per material in the scene, escaped rays, emitter hits |
//! | emission | escaped rays and emitter hits → radiance, weighted against light sampling |
//! | shade | one material's queue → shadow rays and next rays |
//! | connect | shadow rays → radiance |
//! | roulette | next rays → rays: survival, reweighting, compaction |
//! | film | radiance of a finished work item → sums per pixel |
//!
//! [`compile::Features`] is the set of what a scene and its settings need. What is not in it has no
//! queue, no column in a queue, no test in a kernel and no stage; `wavepath plan` lists it, and the
//! image is the same to the last bit with everything forced in.
//!
//! # Floors
//!
//! A module uses only what is on the floors above its own.
//!
//! | floor | modules |
//! | --- | --- |
//! | 1 | [`math`], [`error`] |
//! | 2 | [`sampler`], [`geometry`] |
//! | 3 | [`scene`], [`accel`], [`material`], [`texture`], [`light`]; none uses another |
//! | 4 | [`compile`](mod@compile) |
//! | 5 | [`wave`] |
//! | 6 | [`stage`]; no stage calls another |
//! | 7 | [`film`], [`reference`](mod@reference) |
//! | 8 | [`integrator`] |
//! | 9 | [`report`] |
//! | 10 | [`cli`], the only module that prints |
//!
//! # Units and conventions
//!
//! - Lengths are in metres, radiance in W·sr⁻¹·m⁻², radiant intensity in W·sr⁻¹, angles in radians
//!   unless a name says degrees. Light is linear RGB. A PNG is sRGB after 2^exposure; an EXR is
//!   linear.
//! - Axes are right-handed and none is "up". The geometric normal of a triangle (a, b, c) is along
//!   (b − a) × (c − a), that of a sphere points outward. Surfaces scatter on both sides; normals
//!   decide one-sided emission and where the inside of glass is. Interpolated normals turn the frame
//!   in which a surface scatters; on which side of it a ray is, the geometric normal alone decides.
//! - Directions are of unit length. In materials they are in the frame of the hit, z along the
//!   normal, and point away from the surface; from lights they point from the shaded point to the
//!   light. Values of a BSDF contain the cosine at the direction that is asked for or sampled.
//! - Densities are per steradian, in the sampling of lights too, where they contain the
//!   probability of having chosen the light. Delta lobes and point lights have no density and take
//!   no part in multiple importance sampling.
//! - Depth counts path segments from 1, the camera ray. A depth limit of 1 is emitted light alone, 2
//!   adds direct light. Roulette from depth n plays after n segments were traced.
//! - Pixels are counted from the top left; row-major in the film. The filter is a box of one pixel.
//! - Every random number is a function of (seed, pixel, sample, dimension). On one build the image is
//!   the same to the last bit for any number of threads, any wave size, after any resume from a checkpoint,
//!   and with any features forced in. Builds of different lane widths or compilers may round differently.
//! - Kernels calculate in f32 about the scene's centre, which was subtracted in f64; sums over blocks
//!   and everything in [`reference`](mod@reference) are in f64. Denormal numbers are flushed to zero
//!   on worker threads.
//!
//! # Limits
//!
//! - No rough glass or metal, no absorption in glass, no volumes, no spectra. Textures scale
//!   reflectance and opacity, are not filtered beyond bilinear interpolation, and lie on meshes alone.
//!   Cameras are pinholes. Nothing moves, and meshes are not instanced.
//! - Light sources are triangles, quads, spheres, points and a constant background. A light is
//!   chosen by its power alone, not by its distance.
//! - The path integrator is unidirectional. Light that comes to a diffuse surface by way of glass or
//!   a mirror is found only by directions sampled there: it is noisy where the light is small, and
//!   missing where the light is a point.
//! - Whitted's integrator and transparent shadows are biased by design, a depth limit, a clamp and a fixed
//!   shadow bias too; reports say so.
//! - Oren and Nayar's qualitative model reflects up to 1.5 % more than its facets' reflectance for
//!   σ below 0.33 rad at grazing angles; that is the model, and it is not corrected.
//! - Positions have f32 precision relative to the size of the whole scene. Detail below about 10⁻⁶ of
//!   it is not to be trusted.
//! - A scene may have up to 2³¹ − 1 primitives, an image up to 65 535 pixels a side.
//! - Developed and measured on Linux and x86-64 with AVX-512 (16 lanes). Other vector extensions run
//!   8 lanes through the crate `wide`; they are tested for correctness and not tuned. CPU clocks are
//!   POSIX.
//! - The error estimate comes from the spread of block means, for the Sobol sampler from two independent
//!   sequences ([`sampler::sobol`]). It is itself an estimate: with few blocks, or where rare bright paths
//!   have not been seen yet, it is too small.
//!
//! # Sources
//!
//! Each formula names its source where it is used. The books and papers behind the whole:
//!
//! - M. Pharr, W. Jakob, G. Humphreys, "Physically Based Rendering", 4th ed., MIT Press 2023: path
//!   tracing, rounding-error bounds of hit points, warps.
//! - E. Veach, "Robust Monte Carlo Methods for Light Transport Simulation", Stanford 1997: multiple
//!   importance sampling, radiance across refractive boundaries.
//! - J. T. Kajiya, "The Rendering Equation", SIGGRAPH 1986. T. Whitted, "An Improved Illumination
//!   Model for Shaded Display", CACM 23(6), 1980. J. Arvo, D. Kirk, "Particle Transport and Image
//!   Synthesis", SIGGRAPH 1990: Russian roulette.
//! - S. Laine, T. Karras, T. Aila, "Megakernels Considered Harmful: Wavefront Path Tracing on
//!   GPUs", HPG 2013: stages and queues per material.
//! - S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013. T. Ize,
//!   "Robust BVH Ray Traversal", JCGT 2(2), 2013.
//! - I. Wald, C. Benthin, S. Boulos, "Getting Rid of Packets", RT 2008: wide trees. D. Meister, J.
//!   Bittner, "Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy Construction", TVCG
//!   24(3), 2018, and "Parallel Reinsertion for Bounding Volume Hierarchy Optimization", CGF 37(2),
//!   2018: how they are built.
//! - P. Shirley, C. Wang, K. Zimmerman, "Monte Carlo Techniques for Direct Lighting Calculations",
//!   ACM TOG 15(1), 1996. M. D. Vose, "A Linear Algorithm for Generating Random Numbers with a Given
//!   Distribution", IEEE TSE 17(9), 1991.
//! - C. Ureña, M. Fajardo, A. King, "An Area-Preserving Parametrization for Spherical Rectangles",
//!   Computer Graphics Forum 32(4), 2013. J. Arvo, "Stratified Sampling of Spherical Triangles", SIGGRAPH
//!   1995. A. Van Oosterom, J. Strackee, "The Solid Angle of a Plane Triangle", IEEE TBME 30(2), 1983.
//! - M. Oren, S. K. Nayar, "Generalization of Lambert's Reflectance Model", SIGGRAPH 1994. C.
//!   Schlick, "An Inexpensive BRDF Model for Physically-based Rendering", Computer Graphics Forum
//!   13(3), 1994. E. Lafortune, Y. Willems, "Using the Modified Phong Reflectance Model for
//!   Physically Based Rendering", KU Leuven 1994.
//! - A. Keller et al., "The Iray Light Transport Simulation and Rendering System", arXiv:1705.01263,
//!   2017: interpolated normals that no reflection leaves downward.
//! - A. B. Owen, "Randomly Permuted (t,m,s)-Nets and (t,s)-Sequences", 1995. B. Burley, "Practical
//!   Hash-based Owen Scrambling", JCGT 9(4), 2020. J. Neyman, "On the Two Different Aspects of the
//!   Representative Method", 1934: samples in proportion to the deviation.
//! - T. Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017. M. E. O'Neill,
//!   "PCG: A Family of Simple Fast Space-Efficient Statistically Good Algorithms for Random Number
//!   Generation", Harvey Mudd College 2014.

pub mod accel;
pub mod cli;
pub mod compile;
pub mod error;
pub mod film;
pub mod geometry;
pub mod integrator;
pub mod light;
pub mod material;
pub mod math;
pub mod reference;
pub mod report;
pub mod sampler;
pub mod scene;
pub mod stage;
pub mod texture;
pub mod wave;

pub use error::{Error, ErrorKind, Result};
