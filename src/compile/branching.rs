//! How many rays leave a hit.

use crate::compile::Features;
use crate::scene::RenderSettings;

/// Splits at glass along a path of Whitted's method, after which one branch is chosen at random instead.
pub const WHITTED_SPLITS: u32 = 4;

/// How many rays leave a hit, where it may be more than one of each kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Branching {
    /// Light samples per hit, ≥ 1.
    pub light_samples: u32,
    /// Splits at glass along one path.
    pub splits: u32,
}

impl Branching {
    /// What `settings` ask for, as far as there is something to sample or to split at.
    pub fn new(features: Features, settings: &RenderSettings) -> Self {
        let splits = if features.contains(Features::GLASS_SPLITS) {
            settings.glass_splits
        } else if features.contains(Features::WHITTED | Features::DIELECTRIC) {
            WHITTED_SPLITS
        } else {
            0
        };
        Self {
            light_samples: if features.contains(Features::LIGHT_SAMPLES) {
                settings.light_samples
            } else {
                1
            },
            splits,
        }
    }

    /// Next rays per ray: glass makes room for both branches before it is known whether there are two.
    pub fn next_per_ray(&self) -> usize {
        if self.splits > 0 { 2 } else { 1 }
    }
}
