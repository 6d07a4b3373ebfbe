//! What a curve of error against time says: slopes, times to an error, ratios of two curves.

use super::results::{Estimate, Fit, Found, TimeToError};
use super::statistics::{geometric_mean, line, mean};

/// Checkpoints that a slope needs.
const FITTED_POINTS: usize = 5;

/// How far beyond the last checkpoint a time is still told, as a factor.
const EXTRAPOLATION: f64 = 2.0;

/// Errors of one repeat by abscissa, samples or seconds: both positive, the abscissa ascending.
#[derive(Debug, Clone, Default)]
pub(super) struct Curve(Vec<(f64, f64)>);

impl Curve {
    /// Of points (abscissa, squared error), those of which the squared error is not positive left out.
    pub(super) fn of_squares(points: impl Iterator<Item = (f64, f64)>) -> Self {
        Self(
            points
                .filter(|&(x, square)| x > 0.0 && square > 0.0)
                .map(|(x, square)| (x, square.sqrt()))
                .collect(),
        )
    }

    /// Intercept and slope of ln error on ln abscissa. `None` below five points.
    fn line(&self) -> Option<(f64, f64)> {
        if self.0.len() < FITTED_POINTS {
            return None;
        }
        let logarithms: Vec<(f64, f64)> = self.0.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
        line(&logarithms)
    }

    /// The last abscissa.
    pub(super) fn end(&self) -> Option<f64> {
        self.0.last().map(|&(x, _)| x)
    }

    /// The last error.
    pub(super) fn last(&self) -> Option<f64> {
        self.0.last().map(|&(_, y)| y)
    }

    /// The error at an abscissa between the first and the last.
    pub(super) fn at(&self, x: f64) -> Option<f64> {
        if let [(only, error)] = self.0[..] {
            return (only == x).then_some(error);
        }
        let pair = self
            .0
            .windows(2)
            .find(|pair| (pair[0].0..=pair[1].0).contains(&x))?;
        let share = (x / pair[0].0).ln() / (pair[1].0 / pair[0].0).ln();
        Some(pair[0].1 * (pair[1].1 / pair[0].1).powf(share))
    }

    /// The abscissa at which the error is first reached.
    pub(super) fn reach(&self, error: f64) -> (Option<f64>, Found) {
        let (Some(&first), Some(&last)) = (self.0.first(), self.0.last()) else {
            return (None, Found::NotReached);
        };
        if first.1 <= error {
            return (Some(first.0), Found::AtMost);
        }
        let crossing = self.0.windows(2).find(|pair| pair[1].1 <= error);
        if let Some(pair) = crossing {
            let share = (error / pair[0].1).ln() / (pair[1].1 / pair[0].1).ln();
            let x = pair[0].0 * (pair[1].0 / pair[0].0).powf(share);
            return (Some(x), Found::Interpolated);
        }
        let factor = (last.1 / error).powi(2);
        if factor <= EXTRAPOLATION {
            (Some(last.0 * factor), Found::Extrapolated)
        } else {
            (None, Found::NotReached)
        }
    }
}

/// The slope over the repeats. `None` unless each has five points.
pub(super) fn fit(curves: &[Curve]) -> Option<Fit> {
    let lines: Vec<(f64, f64)> = curves.iter().map(Curve::line).collect::<Option<_>>()?;
    let points = curves.first()?.0.len() as u32;
    let slopes: Vec<f64> = lines.iter().map(|&(_, slope)| slope).collect();
    let intercepts: Vec<f64> = lines.iter().map(|&(intercept, _)| intercept).collect();
    Some(Fit {
        slope: mean(&slopes),
        intercept: mean(&intercepts).value,
        points,
    })
}

/// Time to an error over the repeats, told as the repeat that tells least.
pub(super) fn time_to(error: f64, curves: &[Curve]) -> TimeToError {
    let reached: Vec<(Option<f64>, Found)> =
        curves.iter().map(|curve| curve.reach(error)).collect();
    let found = [Found::NotReached, Found::Extrapolated, Found::AtMost]
        .into_iter()
        .find(|found| reached.iter().any(|(_, other)| other == found))
        .unwrap_or(if curves.is_empty() {
            Found::NotReached
        } else {
            Found::Interpolated
        });
    let seconds: Option<Vec<f64>> = reached.into_iter().map(|(seconds, _)| seconds).collect();
    TimeToError {
        error,
        seconds: seconds
            .filter(|seconds| !seconds.is_empty())
            .map(|seconds| geometric_mean(&seconds)),
        found,
    }
}

/// Ratio of b to a over the repeats, in pairs. `None` if a repeat has none, or there is no repeat.
pub(super) fn ratio(pairs: impl Iterator<Item = Option<(f64, f64)>>) -> Option<Estimate> {
    let ratios: Vec<f64> = pairs
        .map(|pair| {
            pair.filter(|&(a, b)| a > 0.0 && b > 0.0)
                .map(|(a, b)| b / a)
        })
        .collect::<Option<_>>()?;
    (!ratios.is_empty()).then(|| geometric_mean(&ratios))
}

/// Errors of b and a at the same abscissa, the last that both have.
pub(super) fn at_equal_abscissa(a: &Curve, b: &Curve) -> Option<(f64, f64)> {
    let x = a.end()?.min(b.end()?);
    Some((a.at(x)?, b.at(x)?))
}

/// Abscissas of b and a at the same error, the smallest that both reach.
pub(super) fn at_equal_error(a: &Curve, b: &Curve) -> Option<(f64, f64)> {
    let error = a.last()?.max(b.last()?);
    let between = |curve: &Curve| match curve.reach(error) {
        (x, Found::Interpolated) => x,
        // The curve that ends there.
        _ if curve.last() == Some(error) => curve.end(),
        _ => None,
    };
    Some((between(a)?, between(b)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Error 0.8/√x at the powers of two up to `last`.
    fn ideal(last: u32) -> Curve {
        Curve::of_squares((0..=last).map(|k| {
            let x = f64::from(1 << k);
            (x, 0.64 / x)
        }))
    }

    #[test]
    fn line_of_an_ideal_curve_has_its_slope_and_needs_five_points() {
        let fit = fit(&[ideal(4), ideal(4)]).unwrap();
        assert!((fit.slope.value + 0.5).abs() < 1e-12);
        assert!((fit.intercept - 0.8f64.ln()).abs() < 1e-12);
        assert_eq!(fit.points, 5);
        assert_eq!(super::fit(&[ideal(4), ideal(3)]), None);
        assert_eq!(super::fit(&[]), None);
    }

    #[test]
    fn time_is_interpolated_extrapolated_bounded_or_not_reached() {
        let curve = ideal(4);
        // 0.8/√10 lies between the checkpoints 8 and 16, 0.8/√30 within twice the last.
        let at = |x: f64| 0.8 / x.sqrt();
        let close = |found: Option<f64>, expected: f64| {
            assert!((found.unwrap() / expected - 1.0).abs() < 1e-12, "{found:?}");
        };
        let (x, found) = curve.reach(at(10.0));
        close(x, 10.0);
        assert_eq!(found, Found::Interpolated);
        let (x, found) = curve.reach(at(30.0));
        close(x, 30.0);
        assert_eq!(found, Found::Extrapolated);
        assert_eq!(curve.reach(1.0), (Some(1.0), Found::AtMost));
        assert_eq!(curve.reach(at(40.0)), (None, Found::NotReached));
        assert_eq!(Curve::default().reach(1.0), (None, Found::NotReached));
        let time = time_to(at(10.0), &[curve.clone(), Curve::default()]);
        assert_eq!((time.seconds, time.found), (None, Found::NotReached));
        close(curve.at(3.0), at(3.0));
        assert_eq!(curve.at(17.0), None);
    }

    #[test]
    fn curves_are_compared_at_equal_abscissa_and_at_equal_error() {
        // Half the error at every abscissa: a quarter of the time to the same error.
        let slow = ideal(5);
        let fast = Curve(ideal(4).0.into_iter().map(|(x, y)| (x, 0.5 * y)).collect());
        let (a, b) = at_equal_abscissa(&slow, &fast).unwrap();
        assert!((b / a - 0.5).abs() < 1e-12);
        let (a, b) = at_equal_error(&slow, &fast).unwrap();
        assert!((b / a - 0.25).abs() < 1e-12, "{a} {b}");
        let ratio = ratio([Some((1.0, 2.0)), Some((2.0, 4.0))].into_iter()).unwrap();
        assert!((ratio.value - 2.0).abs() < 1e-15);
    }
}
