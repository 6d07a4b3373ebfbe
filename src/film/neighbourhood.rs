//! Pixel means with the help of neighbours, for where a pixel's own mean cannot be relied on.

use super::Film;

/// Neighbours whose means differ by more than so many standard errors show something else, and are left out.
/// Block means are skewed: with 2 instead, the interval of [`Film::error_estimate`] held the true error of the
/// hexagonal room in 84 of 100 renders of 1024 samples per pixel, with 2.5 in 91, with 3 in 98; and told
/// errors of the Cornell box at 256 samples are 1.04, 1.08 and 1.16 times the true ones.
const GATE: f64 = 2.5;

/// Mean of a pixel, and the variance of that mean.
type Pixel = ([f64; 3], [f64; 3]);

/// Calls `visit` with each pixel's index, the variance of its mean, its mean, and its mean as its neighbours and
/// itself tell it. `None` unless every pixel has two blocks; `visit` may then have been called for some.
///
/// The neighbours are the eight around the pixel, channel by channel, as far as their means agree with the
/// pixel's. They count alike; the pixel itself counts less where its variance is above theirs. So a rare
/// bright sample, which raises a pixel's mean as much as its standard error, hardly raises this mean,
/// and edges between pixels that are well known stay as they are.
pub(super) fn visit(
    film: &Film,
    mut visit: impl FnMut(usize, [f64; 3], [[f64; 3]; 2]),
) -> Option<()> {
    let (width, height) = (film.width as usize, film.height as usize);
    let row = |y: usize| -> Option<Vec<Pixel>> {
        let pixels = y * width..(y + 1) * width;
        pixels
            .map(|pixel| Some((film.mean(pixel), film.variance(pixel)?)))
            .collect()
    };
    let mut above: Option<Vec<Pixel>> = None;
    let mut middle = (height > 0).then(|| row(0)).flatten();
    for y in 0..height {
        let below = match y + 1 < height {
            true => Some(row(y + 1)?),
            false => None,
        };
        let centre = middle?;
        let rows = [above.as_deref(), Some(&centre[..]), below.as_deref()];
        for (x, &(mean, variance)) in centre.iter().enumerate() {
            let columns = x.saturating_sub(1)..(x + 2).min(width);
            let around = rows.map(|row| row.map_or(&[][..], |row| &row[columns.clone()]));
            let supported = supported((mean, variance), around);
            visit(y * width + x, variance, [mean, supported]);
        }
        (above, middle) = (Some(centre), below);
    }
    Some(())
}

/// The mean of a pixel, by itself and those `around` it, which it is among.
fn supported((mean, variance): Pixel, around: [&[Pixel]; 3]) -> [f64; 3] {
    std::array::from_fn(|k| {
        let (own, noise) = (mean[k], variance[k]);
        // The pixel agrees with itself, and is taken out again.
        let (mut count, mut sum, mut noises) = (-1.0, -own, -noise);
        for (mean, variance) in around.into_iter().flatten() {
            let difference = mean[k] - own;
            let agrees = difference * difference <= GATE * GATE * (noise + variance[k]);
            let weight = f64::from(u8::from(agrees));
            count += weight;
            sum += weight * mean[k];
            noises += weight * variance[k];
        }
        if count < 0.5 {
            return own;
        }
        let usual = (noises / count).max(0.0);
        let weight = if noise > usual { usual / noise } else { 1.0 };
        (weight * own + sum) / (weight + count)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Means of the first channel, of a film of blocks of one sample.
    fn means(width: u32, pixels: &[&[f64]]) -> Vec<f64> {
        let mut film = Film::new(width, pixels.len() as u32 / width, false);
        for (pixel, blocks) in pixels.iter().enumerate() {
            for &value in *blocks {
                film.add_block(pixel, 1, [value; 3]);
            }
        }
        let mut means = Vec::new();
        visit(&film, |pixel, variance, [own, mean]| {
            assert_eq!((pixel, Some(variance)), (means.len(), film.variance(pixel)));
            assert_eq!(own, film.mean(pixel));
            means.push(mean[0]);
        })
        .unwrap();
        means
    }

    #[test]
    fn noiseless_edges_stay_and_a_pixel_alone_has_its_own_mean() {
        assert_eq!(means(2, &[&[1.0, 1.0], &[3.0, 3.0]]), [1.0, 3.0]);
        assert_eq!(means(1, &[&[1.0, 4.0]]), [2.5]);
        let checks: Vec<&[f64]> = (0..12)
            .map(|i| [&[2.0; 2], &[5.0; 2]][i % 2] as &[f64])
            .collect();
        let shown: Vec<f64> = checks.iter().map(|blocks| blocks[0]).collect();
        assert_eq!(means(3, &checks), shown);
    }

    #[test]
    fn equal_noise_is_averaged_over_the_window() {
        let blocks: [&[f64]; 2] = [&[0.0, 2.0], &[1.0, 3.0]];
        let pixels: Vec<&[f64]> = (0..9).map(|i| blocks[i % 2]).collect();
        // The middle sees five means of 1 and four of 2, a corner two of each.
        let means = means(3, &pixels);
        assert!((means[4] - 13.0 / 9.0).abs() < 1e-12, "{means:?}");
        assert!((means[0] - 1.5).abs() < 1e-12, "{means:?}");
    }

    #[test]
    fn a_rare_bright_sample_is_told_by_its_neighbours() {
        let dark: &[f64] = &[0.9, 1.1, 1.0, 1.0];
        let mut pixels = vec![dark; 9];
        pixels[4] = &[0.9, 1.1, 1.0, 1e6];
        let means = means(3, &pixels);
        assert!((means[4] - 1.0).abs() < 1e-3, "{means:?}");
    }
}
