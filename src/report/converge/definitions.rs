//! What each figure means.

use super::results::Definition;

/// Name, unit and definition. x is a rendered image of N samples per pixel, r the reference, r₁ and r₂
/// its halves; means run over pixels and the three channels, linear RGB before any display transform.
const DEFINITIONS: [(&str, &str, &str); 22] = [
    ("samples", "per pixel", "N"),
    (
        "cpu_seconds",
        "s",
        "CPU time of the worker threads in render passes (CLOCK_THREAD_CPUTIME_ID); loading, building, \
         scoring and writing are outside",
    ),
    (
        "wall_seconds",
        "s",
        "monotonic clock around the same passes",
    ),
    (
        "mse",
        "radiance²",
        "mean of (x − r₁)(x − r₂), the squared error against the true image, right on average however \
         noisy the reference; with a reference of one image, mean of (x − r)² − its variance",
    ),
    (
        "mse_error",
        "radiance²",
        "standard error of mse over the pixels",
    ),
    ("rmse", "radiance", "√mse"),
    (
        "relmse",
        "",
        "mean of (x − r₁)(x − r₂) / (r² + ε²), ε = 1 % of the mean of r: independent of exposure",
    ),
    ("relative_error", "", "√relmse"),
    (
        "relmse_trimmed",
        "",
        "relmse without the worst 0.1 % of the pixels, which hides rare bright ones: robust, to look at \
         and not to fit",
    ),
    ("smape", "", "mean of 2·|x − r| / (|x| + |r| + ε)"),
    (
        "estimated_variance",
        "radiance²",
        "mean variance that the renderer estimates from the spread of its blocks of samples, or with \
         the Sobol sampler from its two independent halves, without a reference",
    ),
    (
        "estimated_error",
        "",
        "root of the mean of estimated variance / (x² + ε²), ε = 1 % of the mean of x: what `render --error` goes by",
    ),
    (
        "calibration",
        "",
        "mse / estimated_variance: 1 if the estimate can be trusted; below 1 samples within a block are \
         stratified, above 1 there is bias or rare bright paths have not been seen",
    ),
    (
        "bias_z",
        "",
        "mean of x − r over its standard error from estimated variance and reference, in the channel where \
         it is largest; the variance is no less than that of as many of a rendered reference's samples, since few samples may \
         not have seen rare bright paths; an error that rounding to f32 explains (1e-5 of the mean) is taken off",
    ),
    (
        "block_p",
        "",
        "the same per block of 16 × 16 pixels as Student's t with Welch's degrees of freedom; the smallest \
         p, times the number of blocks and channels",
    ),
    (
        "bias",
        "",
        "the same test on all repeats together at their ends: biased if |z| > 4 or block_p < 0.001; untested below \
         two blocks, and below 16 samples per pixel where the reference has no samples",
    ),
    (
        "outliers",
        "pixels",
        "pixels whose squared error exceeds 400 times the median estimated variance of their block; \
         outlier_share is the share of the squared error that they carry",
    ),
    (
        "near_reference",
        "",
        "whether the rmse is within three times the reference's own, √(mean of (r₁ − r₂)²/4), or that of \
         rounding: such a checkpoint is not fitted",
    ),
    (
        "slope",
        "",
        "least squares of ln rmse on ln samples, or on ln cpu_seconds, over the fitted checkpoints of a \
         repeat, at least 5; mean over the repeats with Student's 95 % interval. −1/2 for independent samples \
         of finite variance",
    ),
    (
        "time_to_unit_variance",
        "s·radiance²",
        "mse × cpu_seconds at the last fitted checkpoint; its reciprocal is the efficiency",
    ),
    (
        "times_to_error",
        "s",
        "CPU time to a relative error, interpolated in logarithms between checkpoints",
    ),
    (
        "FLIP",
        "",
        "left out: the crate that computes it (nv-flip) binds C++ sources and has had no release since 2023",
    ),
];

/// All of them.
pub(super) fn definitions() -> Vec<Definition> {
    DEFINITIONS
        .iter()
        .map(|&(name, unit, text)| Definition {
            name: name.to_owned(),
            unit: unit.to_owned(),
            text: text.to_owned(),
        })
        .collect()
}
