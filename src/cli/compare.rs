//! `wavepath compare`: how much an image differs from a reference, and whether noise explains it.

use crate::error::{Error, Result};
use crate::film::{Comparison, ImageFormat, check_writable, compare, read_exr, write_difference};

use super::args::CompareArgs;
use super::{Status, note, print};

pub(super) fn run(args: &CompareArgs) -> Result<Status> {
    if let Some(limit) = args.max_relmse
        && !(limit.is_finite() && limit >= 0.0)
    {
        return Err(Error::usage(format!(
            "--max-relmse must be a number ≥ 0, not {limit}"
        )));
    }
    if let Some(path) = &args.diff {
        if ImageFormat::from_path(path) != Ok(ImageFormat::Png) {
            let path = path.display();
            return Err(Error::usage(format!(
                "{path}: a difference image is a .png"
            )));
        }
        check_writable(path)?;
    }
    let (a, b) = (read_exr(&args.a)?, read_exr(&args.b)?);
    let comparison = compare(&a, &b)?;
    let mut text = format!(
        "A {}\nB {} (reference)\n{} × {} pixels\n{}",
        args.a.display(),
        args.b.display(),
        a.width,
        a.height,
        describe(&comparison)
    );
    if let Some(path) = &args.diff {
        write_difference(path, &a, &b)?;
        text += &format!("wrote {}\n", path.display());
    }
    print(&text)?;
    match args.max_relmse.and_then(|limit| excess(&comparison, limit)) {
        Some(excess) => {
            note(&excess);
            Ok(Status::Exceeded)
        }
        None => Ok(Status::Done),
    }
}

/// In what the images differ too much, if they do.
fn excess(comparison: &Comparison, limit: f64) -> Option<String> {
    if comparison.non_finite > 0 {
        Some(format!("{} pixels are not finite", comparison.non_finite))
    } else if comparison.relmse > limit {
        Some(format!(
            "relMSE {:.6e} exceeds {limit:e}",
            comparison.relmse
        ))
    } else {
        None
    }
}

fn describe(comparison: &Comparison) -> String {
    let (column, row) = comparison.max_at;
    let mut text = String::new();
    let mut line = |label: &str, values: &str, note: &str| {
        text += format!("{label:<16}{values}  {note}").trim_end();
        text.push('\n');
    };
    line("MSE", &number(comparison.mse), "");
    if let Some(noise) = comparison.noise {
        line(
            "MSE by noise",
            &number(noise),
            "what the variance layers of both explain",
        );
    }
    line("RMSE", &number(comparison.rmse), "");
    line("relMSE", &number(comparison.relmse), "");
    let place = format!("at column {column}, row {row}");
    line(
        "largest |A − B|",
        &number(comparison.max_difference),
        &place,
    );
    if comparison.non_finite > 0 {
        line(
            "left out",
            &format!("{:>14}", comparison.non_finite),
            "pixels that are not finite",
        );
    }
    line(
        "",
        &["R", "G", "B"].map(|name| format!("{name:>14}")).concat(),
        "",
    );
    line("mean of A", &numbers(comparison.mean_a), "");
    line("mean of B", &numbers(comparison.mean_b), "");
    line("mean of A − B", &numbers(comparison.mean_difference), "");
    if let Some(error) = comparison.standard_error {
        line("standard error", &numbers(error), "of the mean of A − B");
    }
    if let Some(z) = comparison.z() {
        line(
            "z",
            &z.map(|z| format!("{z:>14.2}")).concat(),
            "their quotient; beyond ±4 is hardly chance",
        );
    }
    text
}

fn number(value: f64) -> String {
    format!("{value:>14.6e}")
}

fn numbers(values: [f64; 3]) -> String {
    values.map(number).concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::ExrImage;

    fn image(value: f32, variance: Option<f32>) -> ExrImage {
        ExrImage {
            width: 2,
            height: 2,
            mean: vec![[value; 3]; 4],
            variance: variance.map(|variance| vec![[variance; 3]; 4]),
            samples: None,
        }
    }

    /// The text with single spaces between words.
    fn squeezed(text: &str) -> String {
        text.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn text_has_every_figure_and_none_that_is_unknown() {
        let noisy = compare(&image(1.25, Some(0.02)), &image(1.0, Some(0.02))).unwrap();
        let text = squeezed(&describe(&noisy));
        for part in [
            "MSE 6.250000e-2",
            "MSE by noise 4.000000e-2",
            "RMSE 2.500000e-1",
            "relMSE 6.249375e-2",
            "largest |A − B| 2.500000e-1 at column 0, row 0",
            "mean of A 1.250000e0 1.250000e0 1.250000e0",
            "mean of B 1.000000e0 1.000000e0 1.000000e0",
            "mean of A − B 2.500000e-1 2.500000e-1 2.500000e-1",
            "standard error 1.000000e-1 1.000000e-1 1.000000e-1",
            "z 2.50 2.50 2.50",
        ] {
            assert!(text.contains(part), "{part:?} is missing in\n{text}");
        }
        let exact = describe(&compare(&image(1.25, None), &image(1.0, None)).unwrap());
        assert!(
            !exact.contains("noise") && !exact.contains("standard error"),
            "{exact}"
        );
    }

    #[test]
    fn limit_is_exceeded_by_a_larger_error_or_a_value_that_is_not_finite() {
        let mut comparison = compare(&image(1.25, None), &image(1.0, None)).unwrap();
        assert_eq!(excess(&comparison, comparison.relmse), None);
        assert!(
            excess(&comparison, 0.99 * comparison.relmse)
                .unwrap()
                .contains("exceeds")
        );
        comparison.non_finite = 1;
        assert!(excess(&comparison, 1e9).unwrap().contains("not finite"));
    }
}
