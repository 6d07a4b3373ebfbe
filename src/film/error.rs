//! How far the image is from its expectation, from the image alone.

use super::{Film, Parts, RELATIVE_EPSILON, neighbourhood, relative_variance};

/// The 97.5 % quantile of the normal distribution.
const QUANTILE: f64 = 1.959_964;

/// Estimated relative error of an image, as fractions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorEstimate {
    /// The estimate, [`Film::relative_error`].
    pub estimate: f64,
    /// Within these two the error that the image has is with a probability of about 95 %.
    pub interval: [f64; 2],
}

impl Film {
    /// Estimated relative error of the image, as a fraction: the square root of the mean, over
    /// pixels and channels, of variance / (mean² + ε²), with ε = [`RELATIVE_EPSILON`] × the image's
    /// mean. It needs no reference, falls as 1/√samples, and does not depend on exposure. `None`
    /// unless every pixel has two blocks.
    ///
    /// The mean in the denominator is that of the pixel and of those neighbours that agree with it, the pixel
    /// itself counting less the noisier it is beside them. With the pixel's own mean alone, a pixel in
    /// which one block was far brighter than all others would count as variance ≈ mean², whatever its
    /// expectation: errors of the hexagonal room were told at half their size.
    pub fn relative_error(&self) -> Option<f64> {
        self.error_estimate().map(|error| error.estimate)
    }

    /// [`Self::relative_error`] with an interval for the true relative error of this image, which is the
    /// root of the mean of (mean − expectation)² / (expectation² + ε²).
    ///
    /// With q the term of a pixel, averaged over its channels, the squared estimate is the mean of q over P
    /// pixels. It and the true squared error have the same expectation. Their difference is, pixel by pixel, the
    /// U-statistic Σ x_i x_j / (B(B − 1)) over the pairs of the B = n + 1 block means' deviations, and so has the
    /// variance 2(1 + 1/n)·E(q)² whatever the distribution of block means (if channels go together, the least
    /// favourable case). For normal ones the unbiased estimate of E(q)² is q² over 1 + 2/n, for others with
    /// heavier tails that is too large, and the interval wide. The interval is that of a log-normal ratio with this
    /// relative variance; as the denominators are not certain either, its ends are those of the wider one of two, with
    /// the neighbours' help and with each pixel's own mean alone. Of two replicates n is 1, and as the
    /// points of one are spread evenly their means may have lighter tails than normal ones: E(q²) is at least
    /// 2·E(q)², which two equally likely values have. Where the blocks of a part without replicates are spread more
    /// evenly than independent ones, as those of stratified samples, the error may be below the interval.
    pub fn error_estimate(&self) -> Option<ErrorEstimate> {
        if self.is_empty() {
            return None;
        }
        let epsilon = RELATIVE_EPSILON * self.image_mean();
        let mut terms = [Terms::default(); 2];
        neighbourhood::visit(self, |pixel, variance, means| {
            let freedom = self.degrees_of_freedom(pixel) as f64;
            let squares = match self.parts() {
                Parts::Replicates => 2.0,
                Parts::Whole | Parts::Halves => 1.0 + 2.0 / freedom,
            };
            for (terms, mean) in terms.iter_mut().zip(means) {
                let term = relative_variance(mean, variance, epsilon);
                terms.add(term, 2.0 * (1.0 + 1.0 / freedom) / squares);
            }
        })?;
        let [(_, own), (estimate, supported)] = terms.map(|terms| terms.estimate(self.len()));
        Some(ErrorEstimate {
            estimate,
            interval: [own[0].min(supported[0]), own[1].max(supported[1])],
        })
    }
}

/// Sums over pixels of what an estimate is made of.
#[derive(Debug, Clone, Copy, Default)]
struct Terms {
    /// Σ q, over channels too.
    sum: f64,
    /// The variance of what it is off.
    spread: f64,
}

impl Terms {
    /// Adds a pixel whose channels have the sum `term`, which is off by a variance of `spread` times its square.
    fn add(&mut self, term: f64, spread: f64) {
        self.sum += term;
        if term > 0.0 {
            self.spread += spread * term * term;
        }
    }

    /// The estimate and its interval.
    fn estimate(self, pixels: usize) -> (f64, [f64; 2]) {
        let estimate = (self.sum / (3 * pixels) as f64).sqrt();
        let relative_variance = if self.spread > 0.0 {
            self.spread / (self.sum * self.sum)
        } else {
            0.0
        };
        let factor = (0.5 * QUANTILE * relative_variance.ln_1p().sqrt()).exp();
        (estimate, [estimate / factor, estimate * factor])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::testing::split_mix_64;

    /// The n-th uniform number in [0, 1) of a fixed generator.
    fn uniform(n: u64) -> f64 {
        let mut state = n.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        (split_mix_64(&mut state) >> 11) as f64 / (1u64 << 53) as f64
    }

    #[test]
    fn intervals_hold_the_true_error_as_often_as_they_say() {
        // 1000 films of 60 pixels of different noise; block sums of 4 uniform samples about a mean of 1.
        let films = 1000;
        let [pixels, blocks, samples] = [60, 6, 4];
        let mut held = 0;
        let mut draw = 0;
        for _ in 0..films {
            let mut film = Film::new(pixels, 1, false);
            for pixel in 0..pixels as usize {
                let noise = 1.0 / (1.0 + pixel as f64 / 10.0);
                for _ in 0..blocks {
                    let sum: f64 = (0..samples)
                        .map(|_| {
                            draw += 1;
                            1.0 + noise * (2.0 * uniform(draw) - 1.0)
                        })
                        .sum();
                    film.add_block(pixel, samples, [sum; 3]);
                }
            }
            let squares = (0..film.len()).map(|p| (film.mean(p)[0] - 1.0).powi(2));
            let expected = 1.0 + RELATIVE_EPSILON * RELATIVE_EPSILON;
            let truth = (squares.sum::<f64>() / film.len() as f64 / expected).sqrt();
            let [low, high] = film.error_estimate().unwrap().interval;
            held += u32::from((low..=high).contains(&truth));
        }
        // 950 expected, standard deviation 6.9; the approximations cost or gain a percent.
        assert!((920..=980).contains(&held), "{held} of {films}");
    }

    #[test]
    fn an_image_without_noise_has_an_interval_without_width() {
        let mut film = Film::new(2, 1, false);
        for pixel in [0, 1, 0, 1] {
            film.add_block(pixel, 2, [2.0; 3]);
        }
        let error = film.error_estimate().unwrap();
        assert_eq!((error.estimate, error.interval), (0.0, [0.0; 2]));
    }
}
