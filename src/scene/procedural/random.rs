//! Random numbers of the generators.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use rand_core::Rng;
use rand_pcg::Pcg32;

/// PCG's stream of the generators.
const STREAM: u64 = 0x5851_f42d_4c95_7f2d;

/// A sequence of numbers that depends on its seed alone.
#[derive(Debug)]
pub(super) struct Random(Pcg32);

impl Random {
    pub(super) fn new(seed: u64) -> Self {
        Self(Pcg32::new(seed, STREAM))
    }

    /// Uniform in [0, 1), 53 bits.
    pub(super) fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (f64::EPSILON / 2.0)
    }

    /// Uniform in [`low`, `high`).
    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// A uniformly distributed unit vector.
    pub(super) fn direction(&mut self) -> DVec3 {
        let z = self.between(-1.0, 1.0);
        let around = DVec2::from_angle(TAU * self.uniform());
        (around * (1.0 - z * z).sqrt()).extend(z)
    }
}
