//! What statistical tests and the stability cases share: uniform numbers, lanes as f64, quadrature over directions and
//! the chi-squared test that samples follow their stated density.

use rand_core::Rng;
use rand_pcg::Pcg64Mcg;

use super::lanes::{F32s, LANES, Mask};
use super::vec3::Vec3s;

/// The next number of SplitMix64 (Steele, Lea and Flood, "Fast Splittable Pseudorandom Number Generators",
/// 2014).
pub(crate) fn split_mix_64(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let z = (*state ^ (*state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Uniform numbers with 24 bits, as the renderer's samplers give them.
pub(crate) struct Uniform(Pcg64Mcg);

impl Uniform {
    pub(crate) fn new(seed: u64) -> Self {
        Self(Pcg64Mcg::new(
            (u128::from(seed) << 64) | 0x9e37_79b9_7f4a_7c15,
        ))
    }

    /// In [0, 1).
    pub(crate) fn next(&mut self) -> f64 {
        f64::from(self.0.next_u32() >> 8) / 16_777_216.0
    }

    /// In [0, 1), one per lane.
    pub(crate) fn lanes(&mut self) -> F32s {
        F32s::from(std::array::from_fn::<f32, LANES, _>(|_| self.next() as f32))
    }
}

impl Vec3s {
    /// The vectors of the lanes, in f64.
    pub(crate) fn to_lanes(self) -> [[f64; 3]; LANES] {
        let [x, y, z] = [self.x, self.y, self.z].map(F32s::to_array);
        std::array::from_fn(|lane| [x[lane], y[lane], z[lane]].map(f64::from))
    }

    /// Lanes from `LANES` vectors.
    pub(crate) fn from_lanes(v: &[[f64; 3]]) -> Self {
        let column = |k: usize| {
            F32s::from(std::array::from_fn::<f32, LANES, _>(|lane| {
                v[lane][k] as f32
            }))
        };
        Self::new(column(0), column(1), column(2))
    }
}

/// The unit vector with the given z and azimuth.
pub(crate) fn direction(z: f64, phi: f64) -> [f64; 3] {
    let r = (1.0 - z * z).max(0.0).sqrt();
    [r * phi.cos(), r * phi.sin(), z]
}

/// The unit vector at `degrees` from z, at an azimuth of 1 radian: an outgoing direction for tests.
pub(crate) fn outgoing(degrees: f64) -> [f64; 3] {
    direction(degrees.to_radians().cos(), 1.0)
}

/// The number in the first lane.
pub(crate) fn first(lanes: F32s) -> f64 {
    f64::from(lanes.to_array()[0])
}

/// The same f32 vector in every lane.
pub(crate) fn splat(v: [f64; 3]) -> Vec3s {
    Vec3s::splat(v.map(|x| x as f32))
}

/// Bins of equal solid angle within a cone: 24 rings by 32 sectors.
pub(crate) struct DirectionBins {
    /// Tangent, bitangent and axis, of unit length.
    axes: [[f64; 3]; 3],
    /// 1 − cos of the half angle.
    width: f64,
    /// How often quadrature halves every bin, whatever the integrand.
    splits: u32,
}

impl DirectionBins {
    const RINGS: usize = 24;
    const SECTORS: usize = 32;
    const BINS: usize = Self::RINGS * Self::SECTORS;

    /// Bins over the directions with 1 − cos to `axis` (unit length) of at most `width` (≤ 2).
    pub(crate) fn new(axis: [f64; 3], width: f64) -> Self {
        let [x, y, z] = axis;
        let helper = if z.abs() < 0.9 {
            [0.0, 0.0, 1.0]
        } else {
            [1.0, 0.0, 0.0]
        };
        let cross = |a: [f64; 3], b: [f64; 3]| {
            [
                a[1] * b[2] - a[2] * b[1],
                a[2] * b[0] - a[0] * b[2],
                a[0] * b[1] - a[1] * b[0],
            ]
        };
        let tangent = cross(helper, [x, y, z]);
        let length = tangent.iter().map(|x| x * x).sum::<f64>().sqrt();
        let tangent = tangent.map(|x| x / length);
        Self {
            axes: [tangent, cross(axis, tangent), axis],
            width,
            splits: 0,
        }
    }

    /// For densities whose support has corners, which may poke into a bin between all points that
    /// quadrature looks at.
    #[cfg(test)]
    pub(crate) fn with_corners(self) -> Self {
        Self { splits: 3, ..self }
    }

    /// The direction at the given fractions of the cone's height and of the turn.
    fn direction(&self, height: f64, turn: f64) -> [f64; 3] {
        let height = height * self.width;
        let r = (height * (2.0 - height)).max(0.0).sqrt();
        let (sin, cos) = (std::f64::consts::TAU * turn).sin_cos();
        let [t, b, n] = self.axes;
        std::array::from_fn(|k| r * cos * t[k] + r * sin * b[k] + (1.0 - height) * n[k])
    }

    /// The bin that holds `v`. A direction beyond the rim by less than 3e-7 radians is inside but for
    /// its rounding.
    fn bin(&self, v: [f64; 3]) -> Option<usize> {
        let [t, b, n] = self.axes;
        let dot = |a: [f64; 3]| a[0] * v[0] + a[1] * v[1] + a[2] * v[2];
        // From the difference of the vectors: 1 − cos would lose narrow lobes.
        let height = (0..3).map(|k| (v[k] - n[k]).powi(2)).sum::<f64>() * 0.5 / self.width;
        let turn = dot(b).atan2(dot(t)) / std::f64::consts::TAU;
        let ring = (height.min(1.0) * Self::RINGS as f64) as usize;
        let sector = (turn.rem_euclid(1.0) * Self::SECTORS as f64) as usize;
        // d height / dθ = sin θ / width ≤ √(2/width).
        let rim = 1.0 + 3e-7 * (2.0 / self.width).sqrt();
        (height <= rim)
            .then(|| ring.min(Self::RINGS - 1) * Self::SECTORS + sector.min(Self::SECTORS - 1))
    }

    /// ∫ f dω over each bin, in f64 over the values of the lane code.
    fn integrate(&self, f: &impl Fn(Vec3s) -> F32s) -> Vec<f64> {
        let cell = |size: usize, i: usize| [i as f64 / size as f64, (i + 1) as f64 / size as f64];
        (0..Self::BINS)
            .map(|bin| {
                let heights = cell(Self::RINGS, bin / Self::SECTORS);
                let turns = cell(Self::SECTORS, bin % Self::SECTORS);
                self.mean(f, heights, turns, 0) * std::f64::consts::TAU * self.width
                    / Self::BINS as f64
            })
            .collect()
    }

    /// ∫ f dω over all bins.
    pub(crate) fn total(&self, f: &impl Fn(Vec3s) -> F32s) -> f64 {
        self.integrate(f).iter().sum()
    }

    /// Mean of `f` over a cell: Gauss–Legendre with 4 × 4 points where it is smooth; a cell that an
    /// edge of the support crosses is split.
    fn mean(
        &self,
        f: &impl Fn(Vec3s) -> F32s,
        heights: [f64; 2],
        turns: [f64; 2],
        depth: u32,
    ) -> f64 {
        const NODES: [f64; 4] = [
            0.069_431_844_202_973_71,
            0.330_009_478_207_571_87,
            0.669_990_521_792_428_1,
            0.930_568_155_797_026_3,
        ];
        const WEIGHTS: [f64; 4] = [
            0.173_927_422_568_726_93,
            0.326_072_577_431_273_07,
            0.326_072_577_431_273_07,
            0.173_927_422_568_726_93,
        ];
        let at = |[a, b]: [f64; 2], i: usize| a + (b - a) * NODES[i];
        let points: [[f64; 3]; 16] =
            std::array::from_fn(|i| self.direction(at(heights, i / 4), at(turns, i % 4)));
        let values: Vec<f64> = points
            .chunks(LANES)
            .flat_map(|p| f(Vec3s::from_lanes(p)).to_array())
            .map(f64::from)
            .collect();
        // An edge may pass between the nodes and the corners.
        let near = |[a, b]: [f64; 2], end: usize| {
            if end == 0 {
                a + 1e-3 * (b - a)
            } else {
                b - 1e-3 * (b - a)
            }
        };
        let corners: [[f64; 3]; LANES] =
            std::array::from_fn(|i| self.direction(near(heights, i / 2 % 2), near(turns, i % 2)));
        let positive = values.iter().filter(|&&v| v > 0.0).count();
        let corners = f(Vec3s::from_lanes(&corners))
            .to_array()
            .into_iter()
            .filter(|&v| v > 0.0)
            .count();
        let uniform = positive + corners == 0 || positive + corners == 16 + LANES;
        if uniform && depth >= self.splits || depth == 6 {
            return (0..16)
                .map(|i| WEIGHTS[i / 4] * WEIGHTS[i % 4] * values[i])
                .sum();
        }
        let halves = |[a, b]: [f64; 2]| [[a, 0.5 * (a + b)], [0.5 * (a + b), b]];
        halves(heights)
            .into_iter()
            .flat_map(|h| halves(turns).map(|t| self.mean(f, h, t, depth + 1)))
            .sum::<f64>()
            * 0.25
    }
}

/// Counts of sampled directions, to be compared with a density.
pub(crate) struct ChiSquared<'a> {
    bins: &'a DirectionBins,
    counts: Vec<u32>,
    outside: u32,
    invalid: u32,
    total: u32,
}

impl<'a> ChiSquared<'a> {
    pub(crate) fn new(bins: &'a DirectionBins) -> Self {
        Self {
            bins,
            counts: vec![0; DirectionBins::BINS],
            outside: 0,
            invalid: 0,
            total: 0,
        }
    }

    /// Counts the sampled directions of all lanes.
    pub(crate) fn add(&mut self, v: Vec3s, valid: Mask) {
        for (lane, v) in v.to_lanes().into_iter().enumerate() {
            self.total += 1;
            match self.bins.bin(v).filter(|_| valid.test(lane)) {
                Some(bin) => self.counts[bin] += 1,
                None if valid.test(lane) => self.outside += 1,
                None => self.invalid += 1,
            }
        }
    }

    /// How well the counts follow `pdf` (per steradian; what it lacks of 1 are invalid samples).
    ///
    /// Bins are pooled to at least 5 expected samples.
    pub(crate) fn verdict(&self, pdf: &impl Fn(Vec3s) -> F32s) -> ChiSquaredVerdict {
        let probabilities = self.bins.integrate(pdf);
        let integral: f64 = probabilities.iter().sum();
        let total = f64::from(self.total);
        let mut bins: Vec<(f64, f64)> = probabilities
            .iter()
            .zip(&self.counts)
            .map(|(p, &n)| (p * total, f64::from(n)))
            .collect();
        bins.push(((1.0 - integral).max(0.0) * total, f64::from(self.invalid)));
        bins.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut chi2, mut cells) = (0.0, 0u32);
        let mut pool = (0.0, 0.0);
        for (expected, count) in bins {
            pool = (pool.0 + expected, pool.1 + count);
            if pool.0 >= 5.0 {
                chi2 += (pool.1 - pool.0).powi(2) / pool.0;
                cells += 1;
                pool = (0.0, 0.0);
            }
        }
        ChiSquaredVerdict {
            standard_errors: normal_of_chi_squared(chi2, cells.saturating_sub(1)),
            integral,
            outside: self.outside,
        }
    }

    /// Asserts that the counts follow `pdf` and returns its integral over the bins. The limit of 4
    /// standard errors is a false alarm of 3e-5 per test.
    #[cfg(test)]
    pub(crate) fn check(&self, pdf: &impl Fn(Vec3s) -> F32s, what: &str) -> f64 {
        assert_eq!(self.outside, 0, "{what}: samples where the density is zero");
        let verdict = self.verdict(pdf);
        let z = verdict.standard_errors;
        assert!(z < 4.0, "{what}: chi² is {z:.1} standard errors too large");
        verdict.integral
    }
}

/// What [`ChiSquared`] says of a density.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ChiSquaredVerdict {
    /// By how many standard errors χ² is too large; NaN if there was too little to test.
    pub(crate) standard_errors: f64,
    /// Integral of the density over the bins.
    pub(crate) integral: f64,
    /// Samples outside of all bins.
    pub(crate) outside: u32,
}

/// χ² with these degrees of freedom as a standard normal number (Wilson and Hilferty 1931); NaN for none.
pub(crate) fn normal_of_chi_squared(chi2: f64, freedom: u32) -> f64 {
    let freedom = f64::from(freedom);
    let spread = 2.0 / (9.0 * freedom);
    ((chi2 / freedom).cbrt() - (1.0 - spread)) / spread.sqrt()
}

/// Mean and standard error of a stream of numbers.
#[derive(Default)]
pub(crate) struct Mean {
    n: f64,
    sum: f64,
    squares: f64,
}

impl Mean {
    pub(crate) fn add(&mut self, x: f64) {
        self.n += 1.0;
        self.sum += x;
        self.squares += x * x;
    }

    pub(crate) fn mean(&self) -> f64 {
        self.sum / self.n
    }

    /// Standard error of the mean.
    pub(crate) fn standard_error(&self) -> f64 {
        let mean = self.mean();
        ((self.squares / self.n - mean * mean).max(0.0) / self.n).sqrt()
    }

    /// Asserts that the mean is `exact` to 4 standard errors plus 1e-5 relative (of f32 samples).
    #[cfg(test)]
    pub(crate) fn check(&self, exact: f64, what: &str) {
        let (mean, error) = (self.mean(), self.standard_error());
        let difference = (mean - exact).abs();
        assert!(
            difference <= 4.0 * error + 1e-5 * exact.abs(),
            "{what}: {mean} ± {error}, exact {exact}"
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chi_squared_rejects_a_density_that_is_wrong_by_a_few_percent() {
        let bins = DirectionBins::new([0.0, 0.0, 1.0], 1.0);
        let mut counts = ChiSquared::new(&bins);
        let mut random = Uniform::new(5);
        for _ in 0..100_000 {
            let z = F32s::from(random.lanes().to_array().map(|u| u.powf(0.95)));
            let (r, turn) = (
                (F32s::splat(1.0) - z * z).sqrt(),
                random.lanes() * F32s::splat(std::f32::consts::TAU),
            );
            let (sin, cos) = turn.sin_cos();
            counts.add(Vec3s::new(r * cos, r * sin, z), Mask::ALL);
        }
        let uniform = |_: Vec3s| F32s::splat(0.5 / std::f32::consts::PI);
        let verdict = std::panic::catch_unwind(|| counts.check(&uniform, "uniform"));
        assert!(verdict.is_err());
    }
}
