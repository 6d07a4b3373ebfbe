//! The choice among lights of any number and power.

use super::trial::{Figure, Trial};
use crate::error::Result;
use crate::geometry::PrimitiveId;
use crate::light::{Light, LightTable, PointLight, Receiver, kinds, sample};
use crate::math::{F32s, LANES, U32s, Vec3s};

/// All uniform numbers that there are.
const UNITS: u32 = 1 << 24;

/// Lights of these powers, by their intensity; all at one place.
fn points(powers: impl Iterator<Item = f32>) -> Result<LightTable> {
    let lights: Vec<Light> = powers
        .map(|power| {
            Light::Point(PointLight {
                position: [0.0, 0.0, 1.0],
                intensity: [power; 3],
            })
        })
        .collect();
    LightTable::new(&lights)
}

pub(super) fn light_choice(trial: &mut Trial<'_>) -> Result<()> {
    const KINDS: u32 = kinds::POINT | kinds::MANY;
    let at = Receiver {
        p: Vec3s::zero(),
        n: Vec3s::splat([0.0, 0.0, 1.0]),
        primitive: U32s::splat(PrimitiveId::NONE),
    };
    for (count, spread) in [
        (2, 0),
        (1_000, 0),
        (1_000, 20),
        (1_000_000, 0),
        (1_000_000, 20),
    ] {
        // One without power among powers from 10^−spread to 10^spread.
        let power = |i: i32| match i {
            1 => 0.0,
            _ => 10f32.powi(i.rem_euclid(2 * spread + 1) - spread),
        };
        let lights = points((0..count).map(power))?;
        let mut inverse = 0.0f64;
        let mut dark = 0;
        for first in (0..UNITS).step_by(LANES) {
            let u =
                std::array::from_fn::<f32, LANES, _>(|i| (first + i as u32) as f32 / UNITS as f32);
            let s = sample::<KINDS>(
                &lights,
                &at,
                [F32s::from(u), F32s::splat(0.5), F32s::splat(0.5)],
            );
            let (pdf, radiance) = (s.pdf.to_array(), s.radiance.x.to_array());
            for lane in 0..LANES {
                inverse += 1.0 / f64::from(pdf[lane]);
                dark += u64::from(radiance[lane].is_nan() || radiance[lane] <= 0.0);
            }
        }
        // Every light that can be chosen, chosen with its probability p, adds p·1/p.
        let lit = f64::from(count - 1);
        let off = (inverse / f64::from(UNITS) / lit - 1.0).abs();
        let label = format!("{count} lights, powers 1e-{spread} to 1e{spread}");
        trial.note(
            &*label,
            "probabilities are those stated",
            Figure::relative(off, 1e-6, UNITS.into()),
        );
        trial.note(
            &*label,
            "dark ones are not chosen",
            Figure::none_of(dark, UNITS.into()),
        );
    }
    Ok(())
}
