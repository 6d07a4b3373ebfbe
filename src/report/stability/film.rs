//! Sums of very many samples.

use super::trial::{Figure, Trial};
use crate::error::Result;
use crate::film::Film;
use crate::math::testing::Uniform;

/// Samples of a block.
const BLOCK: u32 = 16;

/// Relative error of the film's mean of `count` samples that are given with their exact sum.
fn error_of_mean(count: u64, mut sample: impl FnMut(u64) -> f32) -> f64 {
    let mut film = Film::new(1, 1, false);
    // All samples are multiples of 2⁻²⁷: a sum in whole numbers is exact.
    let unit = 2f64.powi(-27);
    let mut exact = 0u128;
    let mut done = 0;
    while done < count {
        let samples = u64::from(BLOCK).min(count - done);
        let mut sum = 0.0;
        for i in done..done + samples {
            // As the wave's slots have it, and then the film: f32 into f64.
            let value = f64::from(sample(i));
            exact += (value / unit) as u128;
            sum += value;
        }
        film.add_block(0, samples as u32, [sum; 3]);
        done += samples;
    }
    let exact = exact as f64 * unit / count as f64;
    (film.mean(0)[0] / exact - 1.0).abs()
}

pub(super) fn film_sums(trial: &mut Trial<'_>) -> Result<()> {
    let largest = trial.count(100_000_000).min(100_000_000);
    for count in [1_000_000, 17_000_000.min(largest), largest] {
        let constant = error_of_mean(count, |_| 0.1);
        trial.note(
            format!("{count:e} samples of 0.1"),
            "sum in whole numbers",
            Figure::relative(constant, 1e-6, count),
        );
        let mut random = Uniform::new(12);
        let uniform = error_of_mean(count, |_| random.next() as f32);
        trial.note(
            format!("{count:e} uniform samples"),
            "sum in whole numbers",
            Figure::relative(uniform, 1e-6, count),
        );
    }
    let after = error_of_mean(1_000_001, |i| if i == 0 { 1e10 } else { 0.5 });
    trial.note(
        "1e10 once, then 1e6 of 0.5",
        "sum in whole numbers",
        // What the small ones add is 5e-5 of it: none of it may be lost.
        Figure::relative(after, 1e-12, 1_000_001),
    );
    Ok(())
}
