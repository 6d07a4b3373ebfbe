//! Choice of a light in proportion to its power.
//!
//! An alias table in whole numbers. A uniform f32 in [0, 1) has 24 bits, so a probability that is no
//! multiple of 2⁻²⁴ cannot be met; here every probability is rounded to such a multiple when the
//! table is made, and the stated probability of each light is exactly the share of the uniform
//! numbers that choose it. Lights of any power get at least one such unit, lights without power none.
//!
//! Source: M. D. Vose, "A Linear Algorithm for Generating Random Numbers with a Given
//! Distribution", IEEE Trans. Software Engineering 17(9), 1991.

use crate::error::{Error, Result};
use crate::math::lanes::{gather_u32, to_u32};
use crate::math::{Compare, F32s, U32s};

/// Bits of a uniform number.
const BITS: u32 = 24;
/// All uniform numbers.
const UNITS: u32 = 1 << BITS;

/// Alias table over the lights of a scene.
#[derive(Debug, Clone, Default)]
pub(super) struct LightChoice {
    /// Bits of a uniform number that remain within one of the table's 2^(24 − `shift`) buckets.
    shift: u32,
    /// Units of each bucket that choose the light with the bucket's own number.
    own: Vec<u32>,
    /// The light that the other units of the bucket choose.
    alias: Vec<u32>,
}

/// Splits [`UNITS`] over the items in proportion to `power`: whole numbers, at least one where the
/// power is positive, none where it is zero.
fn units(power: &[f64]) -> Vec<u32> {
    let positive = power.iter().filter(|&&p| p > 0.0).count() as u32;
    let total: f64 = power.iter().sum();
    let free = f64::from(UNITS - positive);
    let (mut sum, mut given) = (0.0, 0);
    // Rounding the running sum, not each share, makes the units add up.
    let last = power.iter().rposition(|&p| p > 0.0);
    let mut units = vec![0; power.len()];
    for (i, &p) in power.iter().enumerate().filter(|(_, p)| **p > 0.0) {
        sum += p;
        let end = if Some(i) == last {
            UNITS - positive
        } else {
            (sum / total * free) as u32
        };
        units[i] = 1 + end.saturating_sub(given);
        given = given.max(end);
    }
    units
}

impl LightChoice {
    /// The table for lights of these powers (finite, ≥ 0, in any one unit), and the probability of
    /// each. With no power at all the table is empty and must not be asked.
    ///
    /// # Errors
    /// If there are more lights than uniform numbers can tell apart.
    pub(super) fn new(power: &[f64]) -> Result<(Self, Vec<f32>)> {
        if power.len() > UNITS as usize {
            return Err(Error::limit(format!(
                "{} lights; at most {UNITS} can be told apart",
                power.len()
            )));
        }
        // Powers from 1e-300 to 1e300 may meet: scale before they are added.
        let largest = power.iter().copied().fold(0.0, f64::max);
        if largest == 0.0 {
            return Ok((Self::default(), vec![0.0; power.len()]));
        }
        let scaled = |p: f64| {
            if p > 0.0 {
                (p / largest).max(f64::MIN_POSITIVE)
            } else {
                0.0
            }
        };
        let units = units(&power.iter().map(|&p| scaled(p)).collect::<Vec<_>>());
        let probabilities = units.iter().map(|&u| u as f32 / UNITS as f32).collect();

        let buckets = power.len().next_power_of_two();
        let shift = BITS - buckets.trailing_zeros();
        let capacity = 1u32 << shift;
        let mut left = units;
        left.resize(buckets, 0);
        let mut own = vec![capacity; buckets];
        let mut alias: Vec<u32> = (0..buckets as u32).collect();
        let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..buckets)
            .filter(|&i| left[i] != capacity)
            .partition(|&i| left[i] < capacity);
        // In whole numbers nothing is lost: as long as a bucket lacks units, another has too many.
        while let (Some(poor), Some(&rich)) = (small.pop(), large.last()) {
            own[poor] = left[poor];
            alias[poor] = rich as u32;
            left[rich] -= capacity - left[poor];
            if left[rich] <= capacity {
                large.pop();
                if left[rich] < capacity {
                    small.push(rich);
                }
            }
        }
        Ok((Self { shift, own, alias }, probabilities))
    }

    /// The light chosen by a uniform number in [0, 1).
    #[inline(always)]
    pub(super) fn choose(&self, u: F32s) -> U32s {
        let unit = to_u32(u * F32s::splat(UNITS as f32));
        let bucket = unit >> self.shift;
        let within = unit & U32s::splat((1 << self.shift) - 1);
        let own = within.lt(gather_u32(&self.own, bucket));
        own.select_u32(bucket, gather_u32(&self.alias, bucket))
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        (self.own.len() + self.alias.len()) * size_of::<u32>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::LANES;
    use crate::math::testing::Uniform;

    /// Units that choose each light, by asking the table for every uniform number there is.
    fn census(choice: &LightChoice, lights: usize) -> Vec<u32> {
        let mut counts = vec![0; lights];
        for start in (0..UNITS).step_by(LANES) {
            let u = F32s::from(std::array::from_fn::<f32, LANES, _>(|lane| {
                (start + lane as u32) as f32 / UNITS as f32
            }));
            for light in choice.choose(u).to_array() {
                counts[light as usize] += 1;
            }
        }
        counts
    }

    fn check(power: &[f64]) {
        let (choice, probabilities) = LightChoice::new(power).unwrap();
        let counts = census(&choice, power.len());
        let total: f64 = power.iter().sum();
        for ((count, &stated), &p) in counts.iter().zip(&probabilities).zip(power) {
            assert_eq!(f64::from(*count) / f64::from(UNITS), f64::from(stated));
            assert_eq!(*count > 0, p > 0.0, "power {p}");
            let units_off = (f64::from(stated) - p / total).abs() * f64::from(UNITS);
            assert!(
                units_off <= 2.0 + power.len() as f64 * p / total,
                "{units_off} units off for power {p}"
            );
        }
        assert_eq!(
            probabilities.iter().map(|&p| f64::from(p)).sum::<f64>(),
            1.0
        );
    }

    #[test]
    fn stated_probabilities_are_the_shares_of_all_uniform_numbers() {
        check(&[3.0]);
        check(&[1.0, 1.0]);
        check(&[1.0, 2.0, 0.0, 4.0, 0.5]);
        check(&[1e-20, 1e20, 1.0, 0.0]);
        check(&[0.0, 1e300, 1e300, 1e-300]);
        let mut random = Uniform::new(31);
        let many: Vec<f64> = (0..1000)
            .map(|i| {
                if i % 7 == 0 {
                    0.0
                } else {
                    random.next().powi(4)
                }
            })
            .collect();
        check(&many);
    }

    #[test]
    fn one_light_has_probability_one_and_no_power_gives_no_table() {
        assert_eq!(LightChoice::new(&[0.2]).unwrap().1, [1.0]);
        assert_eq!(LightChoice::new(&[0.0, 0.2]).unwrap().1, [0.0, 1.0]);
        assert_eq!(LightChoice::new(&[0.0, 0.0]).unwrap().1, [0.0, 0.0]);
        assert!(LightChoice::new(&[]).unwrap().1.is_empty());
    }

    #[test]
    fn a_million_lights_keep_their_exact_sum() {
        let power: Vec<f64> = (0..1_000_000).map(|i| 1.0 + f64::from(i % 10)).collect();
        let (choice, probabilities) = LightChoice::new(&power).unwrap();
        assert_eq!(
            probabilities.iter().map(|&p| f64::from(p)).sum::<f64>(),
            1.0
        );
        let mut random = Uniform::new(32);
        let chosen = choice.choose(random.lanes()).to_array();
        assert!(
            chosen
                .iter()
                .all(|&light| probabilities[light as usize] > 0.0)
        );
    }
}
