//! Numbers as a reader wants them: three digits, with their interval.

use maud::{Markup, html};

use super::super::Estimate;

/// What stands where a figure does not exist.
pub(super) const NONE: &str = "–";

/// Three significant digits; by a power of ten what is far from 1.
pub(super) fn number(value: f64) -> String {
    let size = value.abs();
    match size {
        0.0 => "0".to_owned(),
        1e-3..1e5 => {
            let decimals = 2 - size.log10().floor() as i32;
            format!("{value:.*}", decimals.clamp(0, 5) as usize)
        }
        _ => format!("{value:.2e}"),
    }
}

/// A fraction in per cent.
pub(super) fn percent(fraction: f64) -> String {
    format!("{} %", number(100.0 * fraction))
}

/// A figure, or a dash.
pub(super) fn optional(value: Option<f64>, text: fn(f64) -> String) -> String {
    value.map_or(NONE.to_owned(), text)
}

/// A figure with its interval in words.
pub(super) fn estimate_text(estimate: &Estimate, text: fn(f64) -> String) -> String {
    let value = text(estimate.value);
    match interval(estimate, text) {
        Some(interval) => format!("{value} {interval}"),
        None => value,
    }
}

/// A figure with its interval below it, or a dash.
pub(super) fn estimate(estimate: Option<&Estimate>, text: fn(f64) -> String) -> Markup {
    html! {
        @match estimate {
            Some(estimate) => {
                (text(estimate.value))
                @if let Some(interval) = interval(estimate, text) { br; span.interval { (interval) } }
            }
            None => (NONE),
        }
    }
}

fn interval(estimate: &Estimate, text: fn(f64) -> String) -> Option<String> {
    let (low, high) = (estimate.low?, estimate.high?);
    Some(format!("[{}, {}]", text(low), text(high)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_three_digits() {
        for (value, text) in [
            (0.0, "0"),
            (1.0, "1.00"),
            (12.345, "12.3"),
            (-0.012_34, "-0.0123"),
            (99_999.0, "99999"),
            (1.5e6, "1.50e6"),
            (2.5e-4, "2.50e-4"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(number(value), text);
        }
        assert_eq!(percent(0.031), "3.10 %");
        assert_eq!(optional(None, number), "–");
    }

    #[test]
    fn interval_is_told_where_there_is_one() {
        let known = Estimate {
            value: 2.0,
            low: Some(1.5),
            high: Some(2.5),
        };
        let single = Estimate {
            low: None,
            high: None,
            ..known
        };
        assert_eq!(estimate_text(&known, number), "2.00 [1.50, 2.50]");
        assert_eq!(estimate_text(&single, number), "2.00");
        assert!(
            estimate(Some(&known), number)
                .into_string()
                .contains("[1.50, 2.50]")
        );
        assert_eq!(estimate(None, number).into_string(), "–");
    }
}
