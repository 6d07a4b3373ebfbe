//! The film: what a render accumulates per pixel, its error estimate, and the images made from it.
//!
//! Samples arrive in blocks. A block contributes the sum of its samples' radiance; the spread of the
//! block means is the source of the error estimate, so it holds for stratified samples too. Where blocks are not
//! independent either, it is the difference of two halves that are.

pub mod checkpoint;
pub mod compare;
pub mod error;
pub(crate) mod memory;
mod neighbourhood;
pub mod openexr;
pub mod output;
mod png;

pub use checkpoint::{Checkpoint, read_checkpoint, write_checkpoint};
pub(crate) use compare::difference_rgb8;
pub use compare::{Comparison, compare, write_difference};
pub use error::ErrorEstimate;
pub use memory::check_memory;
pub use openexr::{ExrImage, read_exr};
pub(crate) use png::{display_rgb8, encode_rgb8, grey_rgb8};

pub use output::{ImageFormat, Provenance, check_writable, write_atomically, write_image};

/// Share of the image's mean that is added, squared, to a pixel's squared mean where an error is
/// divided by it, so that black pixels do not decide a relative error.
pub const RELATIVE_EPSILON: f64 = 0.01;

/// Sums over the blocks of one pixel, one cache line.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct PixelSums {
    /// Σ S_b, S_b the sum of radiance over block b.
    sum: [f64; 3],
    /// Σ S_b² / n_b, n_b the samples of block b.
    squares: [f64; 3],
    /// N = Σ n_b.
    pub(crate) samples: u64,
    /// B.
    pub(crate) blocks: u64,
}

impl PixelSums {
    /// Mean radiance; zero without samples.
    #[inline]
    pub(crate) fn mean(&self) -> [f64; 3] {
        let scale = if self.samples == 0 {
            0.0
        } else {
            1.0 / self.samples as f64
        };
        self.sum.map(|sum| sum * scale)
    }

    /// Variance of the mean, see [`Film::variance`].
    #[inline]
    pub(crate) fn variance(&self) -> Option<[f64; 3]> {
        if self.blocks < 2 {
            return None;
        }
        let samples = self.samples as f64;
        let scale = 1.0 / ((self.blocks - 1) as f64 * samples);
        Some(std::array::from_fn(|channel| {
            let spread = self.squares[channel] - self.sum[channel] * self.sum[channel] / samples;
            // Rounding makes it slightly negative where all blocks are equal.
            spread.max(0.0) * scale
        }))
    }
}

/// Sums of the first hit's attributes at one pixel.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct AuxSums {
    albedo: [f64; 3],
    normal: [f64; 3],
    depth: f64,
    samples: u64,
}

impl AuxSums {
    /// Means; zeros without samples.
    fn means(&self) -> AuxMeans {
        let scale = if self.samples == 0 {
            0.0
        } else {
            1.0 / self.samples as f64
        };
        AuxMeans {
            albedo: self.albedo.map(|sum| sum * scale),
            normal: self.normal.map(|sum| sum * scale),
            depth: self.depth * scale,
        }
    }
}

/// Means of the first hit's attributes at one pixel; a sample that hit nothing counts as zeros.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct AuxMeans {
    /// Albedo, linear RGB, in [0, 1].
    pub albedo: [f64; 3],
    /// Shading normal in world space; shorter than unit length where it varies within the pixel.
    pub normal: [f64; 3],
    /// Distance from the eye along the ray, in scene units.
    pub depth: f64,
}

impl AuxMeans {
    /// The mean of both.
    fn between(a: &Self, b: &Self) -> Self {
        let mean = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|axis| 0.5 * (a[axis] + b[axis]));
        Self {
            albedo: mean(a.albedo, b.albedo),
            normal: mean(a.normal, b.normal),
            depth: 0.5 * (a.depth + b.depth),
        }
    }
}

/// How many parts a film has, and what tells its error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parts {
    /// One; the spread of its blocks tells the error.
    Whole,
    /// Two halves that count the same whatever number of samples each has at a pixel: means are the mean of
    /// both halves' means. So the number of samples in one half may depend on what the other has seen, and
    /// the image is still unbiased. The spread of the blocks of each tells the error.
    Halves,
    /// Two halves as above, whose samples are independent of each other while the blocks of a half are
    /// not: how far they are apart tells the error.
    Replicates,
}

impl Parts {
    /// How many there are.
    pub fn count(self) -> usize {
        match self {
            Self::Whole => 1,
            Self::Halves | Self::Replicates => 2,
        }
    }
}

/// Per-pixel sums in f64. Pixel index is `y·width + x`, row 0 on top.
#[derive(Debug, Clone, PartialEq)]
pub struct Film {
    width: u32,
    height: u32,
    pixels: Vec<PixelSums>,
    aux: Vec<AuxSums>,
    /// Of a film in two halves, the second.
    second: Option<Box<Film>>,
    /// Whether the difference of the halves tells the error.
    replicated: bool,
}

impl Film {
    /// An empty film; `aux` makes room for albedo, normal and depth. Call [`check_memory`] first
    /// where the size comes from a user.
    pub fn new(width: u32, height: u32, aux: bool) -> Self {
        let count = width as usize * height as usize;
        Self {
            width,
            height,
            pixels: vec![PixelSums::default(); count],
            aux: vec![AuxSums::default(); if aux { count } else { 0 }],
            second: None,
            replicated: false,
        }
    }

    /// As [`Self::new`], in parts.
    pub fn in_parts(width: u32, height: u32, aux: bool, parts: Parts) -> Self {
        let part = || Self::new(width, height, aux);
        Self {
            second: (parts.count() == 2).then(|| Box::new(part())),
            replicated: parts == Parts::Replicates,
            ..part()
        }
    }

    /// The same sums, of two halves whose spread or whose difference tells the error, as `parts` says.
    pub(crate) fn told_by(self, parts: Parts) -> Self {
        Self {
            replicated: parts == Parts::Replicates,
            ..self
        }
    }

    /// The parts it is in.
    pub fn parts(&self) -> Parts {
        match (&self.second, self.replicated) {
            (None, _) => Parts::Whole,
            (Some(_), false) => Parts::Halves,
            (Some(_), true) => Parts::Replicates,
        }
    }

    /// Half 0, or half 1 of a film that has one, to add samples to. What is added to the whole film is
    /// added to half 0.
    pub fn half_mut(&mut self, half: usize) -> &mut Self {
        if half == 0 || self.second.is_none() {
            return self;
        }
        self.second.as_mut().expect("there is a second half")
    }

    /// Sums of all pixels of a half that the film has.
    pub(crate) fn half(&self, half: usize) -> &[PixelSums] {
        match (half, &self.second) {
            (1, Some(second)) => &second.pixels,
            _ => &self.pixels,
        }
    }

    /// Sums of the halves at a pixel that have samples there; both if none has.
    fn sums(&self, pixel: usize) -> [Option<&PixelSums>; 2] {
        let first = &self.pixels[pixel];
        match self.second.as_ref().map(|second| &second.pixels[pixel]) {
            None => [Some(first), None],
            Some(second) if second.blocks == 0 => [Some(first), None],
            Some(second) if first.blocks == 0 => [Some(second), None],
            second => [Some(first), second],
        }
    }

    /// Bytes that each half of a film of this size occupies.
    pub fn bytes(width: u32, height: u32, aux: bool) -> u64 {
        let per_pixel = size_of::<PixelSums>() + if aux { size_of::<AuxSums>() } else { 0 };
        u64::from(width) * u64::from(height) * per_pixel as u64
    }

    /// Pixels across.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Pixels down.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.pixels.len()
    }

    /// Whether the film has no pixel.
    pub fn is_empty(&self) -> bool {
        self.pixels.is_empty()
    }

    /// Whether albedo, normal and depth are accumulated.
    pub fn has_aux(&self) -> bool {
        !self.aux.is_empty()
    }

    /// Adds one block of `samples` > 0 samples whose radiance sums to `sum`. Blocks of a pixel must
    /// arrive in the same order for bit-equal results; the order of pixels does not matter.
    #[inline]
    pub fn add_block(&mut self, pixel: usize, samples: u32, sum: [f64; 3]) {
        debug_assert!(samples > 0, "a block has samples");
        let sums = &mut self.pixels[pixel];
        let per_sample = 1.0 / f64::from(samples);
        for (channel, value) in sum.into_iter().enumerate() {
            sums.sum[channel] += value;
            sums.squares[channel] += value * value * per_sample;
        }
        sums.samples += u64::from(samples);
        sums.blocks += 1;
    }

    /// Adds the first hits of `samples` samples: sums of albedo, normal and depth, to which a sample
    /// that hit nothing adds zeros. The film must have been made with `aux`.
    #[inline]
    pub fn add_aux(
        &mut self,
        pixel: usize,
        samples: u32,
        albedo: [f64; 3],
        normal: [f64; 3],
        depth: f64,
    ) {
        let sums = &mut self.aux[pixel];
        for channel in 0..3 {
            sums.albedo[channel] += albedo[channel];
            sums.normal[channel] += normal[channel];
        }
        sums.depth += depth;
        sums.samples += u64::from(samples);
    }

    /// Samples at a pixel.
    pub fn samples(&self, pixel: usize) -> u64 {
        let halves = self.sums(pixel).into_iter().flatten();
        halves.map(|sums| sums.samples).sum()
    }

    /// Samples of each pixel.
    fn all_samples(&self) -> impl Iterator<Item = u64> {
        (0..self.len()).map(|pixel| self.samples(pixel))
    }

    /// Blocks at a pixel.
    pub fn blocks(&self, pixel: usize) -> u64 {
        let halves = self.sums(pixel).into_iter().flatten();
        halves.map(|sums| sums.blocks).sum()
    }

    /// Samples over the whole film.
    pub fn total_samples(&self) -> u64 {
        self.all_samples().sum()
    }

    /// Fewest samples at any pixel.
    pub fn min_samples(&self) -> u64 {
        self.all_samples().min().unwrap_or(0)
    }

    /// Most samples at any pixel.
    pub fn max_samples(&self) -> u64 {
        self.all_samples().max().unwrap_or(0)
    }

    /// Degrees of freedom of [`Self::variance`]: blocks of a pixel beyond the first of each half, 1 for
    /// [`Parts::Replicates`].
    pub fn degrees_of_freedom(&self, pixel: usize) -> u64 {
        if self.replicated {
            return 1;
        }
        let halves = self.sums(pixel).into_iter().flatten();
        halves.map(|sums| sums.blocks.saturating_sub(1)).sum()
    }

    /// Mean radiance of a pixel, linear RGB, W·sr⁻¹·m⁻²; zero where there is no sample.
    #[inline]
    pub fn mean(&self, pixel: usize) -> [f64; 3] {
        match self.sums(pixel) {
            [Some(first), Some(second)] => {
                let [a, b] = [first.mean(), second.mean()];
                std::array::from_fn(|channel| 0.5 * (a[channel] + b[channel]))
            }
            [first, second] => first.or(second).map_or([0.0; 3], PixelSums::mean),
        }
    }

    /// Variance of a pixel's mean, estimated from the B block sums S_b of n_b samples each as
    /// ((Σ S_b²/n_b) − (ΣS_b)²/N) / (B − 1) / N, N = Σ n_b: the unbiased estimate for independent
    /// blocks, whatever the samples within a block have to do with each other. Of two halves, a quarter of
    /// the sum of both; `None` below 2 blocks in a half. Of two replicates a quarter of the square of
    /// their difference, `None` below a block in each.
    #[inline]
    pub fn variance(&self, pixel: usize) -> Option<[f64; 3]> {
        match self.sums(pixel) {
            [Some(first), Some(second)] if self.replicated => {
                let [a, b] = [first.mean(), second.mean()];
                Some(std::array::from_fn(|channel| {
                    0.25 * (a[channel] - b[channel]).powi(2)
                }))
            }
            _ if self.replicated => None,
            [Some(first), Some(second)] => {
                let [a, b] = [first.variance()?, second.variance()?];
                Some(std::array::from_fn(|channel| {
                    0.25 * (a[channel] + b[channel])
                }))
            }
            [first, second] => first.or(second)?.variance(),
        }
    }

    /// Mean attributes of a pixel's first hits. `None` unless the film was made with `aux`.
    pub fn aux(&self, pixel: usize) -> Option<AuxMeans> {
        let first = self.aux.get(pixel)?;
        let second = self.second.as_ref().and_then(|half| half.aux.get(pixel));
        match second {
            Some(second) if second.samples > 0 && first.samples > 0 => {
                Some(AuxMeans::between(&first.means(), &second.means()))
            }
            Some(second) if second.samples > 0 => Some(second.means()),
            _ => Some(first.means()),
        }
    }

    /// Mean over pixels and the three channels.
    pub fn image_mean(&self) -> f64 {
        let sum: f64 = (0..self.len())
            .map(|pixel| self.mean(pixel).iter().sum::<f64>())
            .sum();
        sum / (3 * self.len()).max(1) as f64
    }
}

/// Sum over the channels of variance / (mean² + `epsilon`²).
pub(crate) fn relative_variance(mean: [f64; 3], variance: [f64; 3], epsilon: f64) -> f64 {
    let channels = variance.into_iter().zip(mean);
    channels
        .map(|(variance, mean)| relative_square(variance, mean, epsilon))
        .sum()
}

/// square / (reference² + ε²); 0 where nothing differs from an all-black reference, else infinite there.
fn relative_square(square: f64, reference: f64, epsilon: f64) -> f64 {
    if square == 0.0 {
        0.0
    } else {
        square / (reference * reference + epsilon * epsilon)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A small fixed generator (Knuth's MMIX constants), uniform in [0, 1).
    struct Uniform(u64);

    impl Uniform {
        fn next(&mut self) -> f64 {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1u64 << 53) as f64
        }
    }

    #[test]
    fn mean_is_the_sum_over_all_samples() {
        let mut film = Film::new(2, 1, false);
        film.add_block(1, 4, [4.0, 8.0, 0.0]);
        film.add_block(1, 1, [6.0, 2.0, 5.0]);
        assert_eq!(film.mean(1), [2.0, 2.0, 1.0]);
        assert_eq!(film.mean(0), [0.0; 3]);
        assert_eq!(
            (film.samples(1), film.min_samples(), film.max_samples()),
            (5, 0, 5)
        );
        assert_eq!(film.total_samples(), 5);
    }

    #[test]
    fn variance_of_single_sample_blocks_is_the_textbook_one() {
        let values = [1.0, 4.0, 4.0, 7.0];
        let mut film = Film::new(1, 1, false);
        for (count, value) in values.into_iter().enumerate() {
            assert_eq!(film.variance(0).is_some(), count >= 2);
            film.add_block(0, 1, [value, 2.0 * value, 3.0]);
        }
        // Sample variance 18/3 = 6, of the mean 6/4.
        let variance = film.variance(0).unwrap();
        assert!((variance[0] - 1.5).abs() < 1e-15);
        assert!((variance[1] - 6.0).abs() < 1e-14);
        assert_eq!(variance[2], 0.0);
    }

    #[test]
    fn variance_is_unbiased_for_unequal_blocks() {
        // Uniform samples: variance 1/12 each. Blocks of 1, 3 and 16 samples, N = 20.
        let expected = 1.0 / 12.0 / 20.0;
        let mut random = Uniform(1);
        let films = 20_000;
        let mut film = Film::new(films, 1, false);
        for pixel in 0..films as usize {
            for samples in [1u32, 3, 16] {
                let sum: f64 = (0..samples).map(|_| random.next()).sum();
                film.add_block(pixel, samples, [sum; 3]);
            }
        }
        let estimates: Vec<f64> = (0..films as usize)
            .map(|pixel| film.variance(pixel).unwrap()[0])
            .collect();
        let count = f64::from(films);
        let mean = estimates.iter().sum::<f64>() / count;
        let spread = estimates.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / (count - 1.0);
        let z = (mean - expected) / (spread / count).sqrt();
        assert!(z.abs() < 4.0, "z = {z}");
    }

    #[test]
    fn relative_error_of_known_noise_is_its_closed_form() {
        // Blocks 1 ± d: relative standard error of the mean of 2 is d; ε adds 1e-4 to the square.
        let d = 0.3;
        let mut film = Film::new(8, 8, false);
        for pixel in 0..film.len() {
            film.add_block(pixel, 1, [1.0 - d; 3]);
            film.add_block(pixel, 1, [1.0 + d; 3]);
        }
        let expected = d / (1.0f64 + RELATIVE_EPSILON * RELATIVE_EPSILON).sqrt();
        assert!((film.relative_error().unwrap() - expected).abs() < 1e-14);
    }

    #[test]
    fn relative_error_does_not_depend_on_exposure() {
        let error = |scale: f64| {
            let mut random = Uniform(7);
            let mut film = Film::new(16, 16, false);
            for pixel in 0..film.len() {
                for _ in 0..3 {
                    film.add_block(pixel, 4, std::array::from_fn(|_| scale * random.next()));
                }
            }
            film.relative_error().unwrap()
        };
        assert!((error(1e-6) / error(1e6) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn relative_error_needs_two_blocks_at_every_pixel() {
        let mut film = Film::new(2, 1, false);
        film.add_block(0, 1, [1.0; 3]);
        film.add_block(0, 1, [1.0; 3]);
        film.add_block(1, 1, [1.0; 3]);
        assert_eq!(film.relative_error(), None);
        film.add_block(1, 1, [1.0; 3]);
        assert_eq!(film.relative_error(), Some(0.0));
    }

    #[test]
    fn black_film_has_no_error() {
        let mut film = Film::new(1, 1, false);
        film.add_block(0, 1, [0.0; 3]);
        film.add_block(0, 1, [0.0; 3]);
        assert_eq!(film.relative_error(), Some(0.0));
    }

    #[test]
    fn sums_keep_small_samples_after_a_huge_one() {
        let mut film = Film::new(1, 1, false);
        film.add_block(0, 1, [1e10; 3]);
        for _ in 0..62_500 {
            film.add_block(0, 16, [8.0; 3]);
        }
        let expected = (1e10 + 500_000.0) / 1_000_001.0;
        assert!((film.mean(0)[0] / expected - 1.0).abs() < 1e-12);
    }

    #[test]
    fn halves_count_the_same_however_many_samples_they_have() {
        let mut film = Film::in_parts(2, 1, true, Parts::Halves);
        assert_eq!(film.parts(), Parts::Halves);
        for (half, samples, value) in [(0, 1, 4.0), (0, 1, 6.0), (1, 4, 1.0), (1, 4, 3.0)] {
            let sum = f64::from(samples) * value;
            film.half_mut(half).add_block(0, samples, [sum; 3]);
            film.half_mut(half)
                .add_aux(0, samples, [sum; 3], [0.0; 3], sum);
        }
        // Means 5 and 2; variances of these means 1 and 1.
        assert_eq!(film.mean(0), [3.5; 3]);
        assert_eq!(film.variance(0), Some([0.5; 3]));
        assert_eq!((film.samples(0), film.degrees_of_freedom(0)), (10, 2));
        assert_eq!(film.aux(0).unwrap().depth, 3.5);
        // A half that has nothing is left out.
        film.half_mut(1).add_block(1, 2, [6.0; 3]);
        assert_eq!((film.mean(1), film.variance(1)), ([3.0; 3], None));
        assert_eq!((film.min_samples(), film.max_samples()), (2, 10));
    }

    #[test]
    fn replicates_tell_their_error_by_how_far_they_are_apart() {
        let mut film = Film::in_parts(2, 1, false, Parts::Replicates);
        film.half_mut(0).add_block(0, 4, [4.0, 8.0, 0.0]);
        assert_eq!(film.variance(0), None);
        // However many blocks there are, and however far they are apart.
        film.half_mut(1).add_block(0, 1, [9.0, 0.0, 1.0]);
        film.half_mut(1).add_block(0, 1, [1.0, 0.0, 1.0]);
        assert_eq!(film.mean(0), [3.0, 1.0, 0.5]);
        assert_eq!(film.variance(0), Some([4.0, 1.0, 0.25]));
        assert_eq!((film.samples(0), film.degrees_of_freedom(0)), (6, 1));
        // Independent uniform numbers: the variance of the mean of six is 1/72.
        let mut random = Uniform(3);
        let films = 20_000;
        let mut film = Film::in_parts(films, 1, false, Parts::Replicates);
        let mut sum = 0.0;
        for pixel in 0..films as usize {
            for half in 0..2 {
                let samples: f64 = (0..3).map(|_| random.next()).sum();
                film.half_mut(half).add_block(pixel, 3, [samples; 3]);
            }
            sum += film.variance(pixel).unwrap()[0];
        }
        // One degree of freedom: its standard deviation is √2 of it, and less for uniform numbers.
        let off = sum / f64::from(films) * 72.0 - 1.0;
        assert!(off.abs() < 4.0 * (2.0 / f64::from(films)).sqrt(), "{off}");
    }

    #[test]
    fn aux_is_averaged_over_its_samples_and_absent_unless_asked_for() {
        let mut film = Film::new(1, 1, true);
        film.add_aux(0, 4, [2.0, 4.0, 0.0], [0.0, 0.0, 4.0], 10.0);
        let aux = film.aux(0).unwrap();
        assert_eq!(
            aux,
            AuxMeans {
                albedo: [0.5, 1.0, 0.0],
                normal: [0.0, 0.0, 1.0],
                depth: 2.5
            }
        );
        assert_eq!(Film::new(1, 1, false).aux(0), None);
    }

    #[test]
    fn bytes_count_what_is_allocated() {
        for aux in [false, true] {
            let film = Film::new(5, 7, aux);
            let held = size_of_val(film.pixels.as_slice()) + size_of_val(film.aux.as_slice());
            assert_eq!(Film::bytes(5, 7, aux), held as u64);
        }
    }
}
