//! Both renderers behind one call, so that a property is stated once and shown of each.

use wavepath::reference::{RayCounts, Reference};
pub(crate) use wavepath::report::stability::renders::{
    STRATEGIES, STRUCTURES, endless, path, whitted,
};
use wavepath::scene::{Budget, RenderSettings, SceneDescription};

use crate::support::{estimate, picture};
use crate::ztest::ImageEstimate;

/// Who makes the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Renderer {
    Reference,
    Wavefront,
}

impl Renderer {
    /// Relative error that is put down to rounding: of f64, or of f32 along some tens of segments.
    pub(crate) fn rounding(self) -> f64 {
        match self {
            Self::Reference => 1e-12,
            Self::Wavefront => 1e-5,
        }
    }

    /// Those of these distances that two surfaces of a scene of some hundred metres can have without
    /// being one surface: positions are f64 in the reference, f32 about the middle in the wavefront.
    pub(crate) fn resolved(self, distances: &[f64]) -> impl Iterator<Item = f64> {
        let least = match self {
            Self::Reference => 0.0,
            Self::Wavefront => 1e-5,
        };
        distances.iter().copied().filter(move |&d| d >= least)
    }

    /// The picture of camera 0 by this many samples per pixel, at least 2, and what it took.
    pub(crate) fn image(
        self,
        scene: &SceneDescription,
        settings: &RenderSettings,
        size: [u32; 2],
        samples: u64,
    ) -> (ImageEstimate, RayCounts) {
        match self {
            Self::Reference => {
                let [width, height] = size;
                let reference =
                    Reference::new(scene, 0, width, height, settings).expect("the scene is sound");
                let mut counts = RayCounts::default();
                let size = size.map(|n| n as usize);
                let image = ImageEstimate::from_samples(size, samples, |x, y, sample| {
                    reference
                        .sample(x as u32, y as u32, sample, &mut counts)
                        .to_array()
                });
                (image, counts)
            }
            Self::Wavefront => {
                let settings = RenderSettings {
                    budget: Budget::Samples(samples),
                    block: samples.div_ceil(32).min(64) as u32,
                    ..settings.clone()
                };
                let outcome = picture(scene, 0, size, &settings);
                let counts = RayCounts {
                    camera: outcome.stats.camera_rays,
                    bounce: outcome.stats.bounce_rays,
                    shadow: outcome.stats.shadow_rays,
                    truncated: outcome.stats.truncated,
                    rejected: outcome.stats.rejected_by_stage,
                };
                (estimate(&outcome.film), counts)
            }
        }
    }

    /// The mean of camera 0's whole picture by this many samples, an even number and in thousands
    /// from two thousand on.
    pub(crate) fn measure(
        self,
        scene: &SceneDescription,
        settings: &RenderSettings,
        samples: u64,
    ) -> Measured {
        let (size, per_pixel) = match self {
            Self::Reference => ([1, 1], samples),
            // Many pixels and few samples in each: a work item is a block of samples of a tile.
            Self::Wavefront if samples >= 2000 => ([40, 25], samples / 1000),
            Self::Wavefront => ([samples as u32 / 2, 1], 2),
        };
        let (image, counts) = self.image(scene, settings, size, per_pixel);
        let taken = u64::from(size[0] * size[1]) * per_pixel;
        assert_eq!([counts.camera, samples], [taken; 2], "samples taken");
        let n = image.mean.len() as f64;
        let means = || image.mean.iter().map(|pixel| pixel[0]);
        let variance: f64 = image.variance_of_mean.iter().map(|pixel| pixel[0]).sum();
        Measured {
            by: self,
            mean: means().sum::<f64>() / n,
            error: variance.sqrt() / n,
            least: means().fold(f64::INFINITY, f64::min),
            most: means().fold(f64::NEG_INFINITY, f64::max),
            counts,
        }
    }
}

/// Mean of a picture in the first channel, and its standard error.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Measured {
    by: Renderer,
    pub(crate) mean: f64,
    pub(crate) error: f64,
    /// The darkest pixel.
    least: f64,
    /// The brightest pixel.
    most: f64,
    pub(crate) counts: RayCounts,
}

impl Measured {
    /// Within four standard errors, or rounding where there is no noise.
    #[track_caller]
    pub(crate) fn assert_is(self, expected: f64) {
        self.assert_is_within(expected, 0.0);
    }

    /// As [`Self::assert_is`] where the expectation itself is known to this error alone.
    #[track_caller]
    pub(crate) fn assert_is_within(self, expected: f64, uncertainty: f64) {
        let tolerance = 4.0 * self.error + self.by.rounding() * expected.abs() + uncertainty;
        assert!(
            (self.mean - expected).abs() <= tolerance,
            "{self:?} is not {expected}"
        );
    }

    /// The same in every sample and pixel, but for rounding.
    #[track_caller]
    pub(crate) fn assert_is_exactly(self, expected: f64) {
        let rounding = self.by.rounding() * expected.abs();
        assert!(self.error <= rounding, "{self:?} has noise");
        for value in [self.least, self.most] {
            assert!(
                (value - expected).abs() <= rounding,
                "{self:?} is not {expected}"
            );
        }
    }
}

/// Makes a test per renderer of each of these functions of a renderer.
macro_rules! shown_by_both {
    ($($property:ident),* $(,)?) => {
        mod reference {
            use crate::renderer::Renderer::Reference;
            $(#[test] fn $property() { super::$property(Reference); })*
        }
        mod wavefront {
            use crate::renderer::Renderer::Wavefront;
            $(#[test] fn $property() { super::$property(Wavefront); })*
        }
    };
}
pub(crate) use shown_by_both;
