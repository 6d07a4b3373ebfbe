//! Intervals over a handful of repeats, and straight lines.

use statrs::distribution::{ContinuousCDF, StudentsT};
use statrs::function::beta::beta_reg;

use super::results::Estimate;

/// Probability that an interval contains the true value.
const CONFIDENCE: f64 = 0.95;

/// Student's distribution with these degrees of freedom, > 0.
fn student(freedom: f64) -> StudentsT {
    StudentsT::new(0.0, 1.0, freedom).expect("degrees of freedom are positive")
}

/// Probability that Student's t with these degrees of freedom, > 0, is beyond ±`t`.
pub(super) fn two_sided_p(t: f64, freedom: f64) -> f64 {
    // As a beta function, which keeps its digits far out where 1 − CDF has none left.
    beta_reg(0.5 * freedom, 0.5, freedom / (freedom + t * t))
}

/// Mean, and standard deviation of one value (0 for a single one). There is at least one value.
pub(super) fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / (count - 1.0).max(1.0)).sqrt())
}

/// The mean with Student's interval; without one for a single value. There is at least one value.
pub(super) fn mean(values: &[f64]) -> Estimate {
    let (value, deviation) = mean_and_deviation(values);
    let half = (values.len() > 1).then(|| {
        let quantile = student((values.len() - 1) as f64).inverse_cdf(0.5 + 0.5 * CONFIDENCE);
        quantile * deviation / (values.len() as f64).sqrt()
    });
    Estimate {
        value,
        low: half.map(|half| value - half),
        high: half.map(|half| value + half),
    }
}

/// The geometric mean with the interval of the logarithms; the plain mean if a value is not positive.
pub(super) fn geometric_mean(values: &[f64]) -> Estimate {
    if values.iter().any(|&value| value <= 0.0) {
        return mean(values);
    }
    let logarithms: Vec<f64> = values.iter().map(|value| value.ln()).collect();
    map(mean(&logarithms), f64::exp)
}

/// An estimate under a rising function.
pub(super) fn map(estimate: Estimate, function: impl Fn(f64) -> f64) -> Estimate {
    Estimate {
        value: function(estimate.value),
        low: estimate.low.map(&function),
        high: estimate.high.map(&function),
    }
}

/// Intercept and slope of the line of least squares. `None` unless two abscissas differ.
pub(super) fn line(points: &[(f64, f64)]) -> Option<(f64, f64)> {
    let count = points.len() as f64;
    let (x, y) = points
        .iter()
        .fold((0.0, 0.0), |sum, point| (sum.0 + point.0, sum.1 + point.1));
    let (x, y) = (x / count, y / count);
    let spread: f64 = points.iter().map(|point| (point.0 - x).powi(2)).sum();
    let slope = points
        .iter()
        .map(|point| (point.0 - x) * (point.1 - y))
        .sum::<f64>()
        / spread;
    slope.is_finite().then_some((y - slope * x, slope))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interval_of_a_mean_has_the_tabled_quantiles() {
        // Student's 97.5 % quantiles: 12.706 for 1 degree of freedom, 2.262 for 9.
        let estimate = mean(&[1.0, 3.0]);
        assert_eq!(estimate.value, 2.0);
        // Deviation √2, over √2.
        assert!((estimate.high.unwrap() - 2.0 - 12.7062).abs() < 1e-3);
        let values: Vec<f64> = (0..10).map(f64::from).collect();
        let estimate = mean(&values);
        let expected = 2.26216 * (55.0f64 / 6.0).sqrt() / 10f64.sqrt();
        assert!((4.5 - estimate.low.unwrap() - expected).abs() < 1e-4);
        assert_eq!((mean(&[7.0]).low, mean(&[7.0]).high), (None, None));
    }

    #[test]
    fn probability_far_out_keeps_its_digits() {
        // With 1 degree of freedom 1 − (2/π)·atan t ≈ 2/(π t); with 2, 1 − t/√(2 + t²) ≈ 1/t².
        let cauchy = two_sided_p(1e9, 1.0) * std::f64::consts::PI * 1e9 / 2.0;
        assert!((cauchy - 1.0).abs() < 1e-6, "{cauchy}");
        let two = two_sided_p(1e6, 2.0) * 1e12;
        assert!((two - 1.0).abs() < 1e-6, "{two}");
        assert!((two_sided_p(1.959_964, 1e9) - 0.05).abs() < 1e-6);
        assert_eq!(two_sided_p(0.0, 5.0), 1.0);
    }

    #[test]
    fn geometric_mean_of_ratios_is_symmetric_and_survives_negative_values() {
        let estimate = geometric_mean(&[0.5, 2.0]);
        assert!((estimate.value - 1.0).abs() < 1e-15);
        assert!((estimate.low.unwrap() * estimate.high.unwrap() - 1.0).abs() < 1e-9);
        assert_eq!(geometric_mean(&[-1.0, 2.0]).value, 0.5);
    }

    #[test]
    fn line_through_points_on_a_line_is_that_line() {
        let points: Vec<(f64, f64)> = (0..5)
            .map(|i| (f64::from(i), 3.0 - 0.5 * f64::from(i)))
            .collect();
        let (intercept, slope) = line(&points).unwrap();
        assert!((intercept - 3.0).abs() < 1e-14 && (slope + 0.5).abs() < 1e-14);
        assert_eq!(line(&points[..1]), None);
    }
}
