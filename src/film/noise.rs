//! How noisy the mean over passes is, from the passes themselves: the method of batch means.
//!
//! Passes are grouped into consecutive batches. With S_k the sum of a pixel over the L_k passes of batch k, n = Σ L_k,
//! m = Σ S_k / n and Λ = Σ L_k²:
//!
//! D = Σ (S_k − L_k m)² = Σ S_k² − 2 m Σ L_k S_k + m² Λ
//!
//! For independent passes of variance σ² the terms have the expectations σ² (L_k − L_k² / n), so that E D = σ² (n − Λ / n)
//! and the variance of the mean, σ² / n, has the unbiased estimate D / (n² − Λ). Any lengths will do: what has been
//! rendered of the last batch is a shorter batch.
//!
//! A batch takes one sixteenth of the passes before it. So batches grow, and neighbours have less and less to do with each
//! other: with many passes the expectation is right for Markov chains too. While a batch is shorter than a chain remembers,
//! the estimate is too small. Terms are not divided by L_k: each batch counts by its length, so that the short ones of the
//! beginning do not speak for chains, nor for photons whose radii were larger then. The number of batches that count stays
//! bounded (Λ tends to n² / 33), hence so does the precision at one pixel (Glynn and Whitt, "Estimating the asymptotic
//! variance with batch means", 1991): that of 33 equal batches, a quarter of the variance. Over an image it is far better.
//!
//! The second estimate compares two halves of the same passes, the even and the odd batches. With their means a and b over
//! n_a and n_b passes, E (a − b)² = σ² (1 / n_a + 1 / n_b), so that (a − b)² n_a n_b / n² is the variance of the mean again,
//! unbiased but of one degree of freedom: useless for a pixel, fine for an image. It shares no formula with the first, so
//! that each tells on the other, and costs no second film.

use super::{Band, Film};
use crate::image::metrics::Expected;
use ndarray::Array3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Passes before a batch for each pass in it.
const GROWTH: u64 = 16;

/// Name of the layer with the variance of the mean per pixel and channel, in W² / (m⁴ sr²).
pub const VARIANCE_LAYER: &str = "variance";

/// The batches of a film, without what is in them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Batches {
    /// Passes so far.
    pub passes: u64,
    /// Passes before the batch that is not full yet.
    before: u64,
    /// Batches that are full.
    count: u64,
    /// Passes in the even ones, the first among them.
    even: u64,
    /// Λ, the sum of their squared lengths.
    squares: u128,
}

/// A batch that has ended.
#[derive(Clone, Copy)]
pub(super) struct Batch {
    passes: u64,
    even: bool,
}

impl Batches {
    /// Counts a pass; the batch that ends with it, if one does.
    fn end_pass(&mut self) -> Option<Batch> {
        self.passes += 1;
        if self.passes - self.before < (self.before / GROWTH).max(1) { None } else { self.close() }
    }

    /// Ends the last batch, full or not; `None` where it has no passes.
    fn close(&mut self) -> Option<Batch> {
        let batch = Batch { passes: self.passes - self.before, even: self.count.is_multiple_of(2) };
        if batch.passes == 0 {
            return None;
        }
        self.before = self.passes;
        self.count += 1;
        self.even += if batch.even { batch.passes } else { 0 };
        self.squares += u128::from(batch.passes).pow(2);
        Some(batch)
    }
}

/// What is kept of the batches at one pixel, per channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Moments {
    /// The pixel's sum when the last batch began.
    before: [f64; 3],
    /// Σ S_k².
    squares: [f64; 3],
    /// Σ L_k S_k.
    weighted: [f64; 3],
    /// Σ S_k over the even batches.
    even: [f64; 3],
}

impl Moments {
    /// Takes note of a batch after which the pixel's sum over all passes is `sum`.
    #[inline]
    pub fn add(&mut self, batch: Batch, sum: [f64; 3]) {
        for (c, sum) in sum.into_iter().enumerate() {
            let s = sum - self.before[c];
            self.before[c] = sum;
            self.squares[c] += s * s;
            self.weighted[c] += batch.passes as f64 * s;
            self.even[c] += if batch.even { s } else { 0.0 };
        }
    }

    /// Variance of the mean: D / (n² − Λ).
    fn variance(&self, batches: &Batches) -> [f64; 3] {
        let (n, squares) = (batches.passes as f64, batches.squares as f64);
        [0, 1, 2].map(|c| {
            let m = self.before[c] / n;
            let d = self.squares[c] - 2.0 * m * self.weighted[c] + m * m * squares;
            // Rounding may leave less than nothing of a pixel without noise.
            (d / (n * n - squares)).max(0.0)
        })
    }

    /// Variance of the mean by the halves: (a − b)² n_a n_b / n².
    fn halves(&self, batches: &Batches) -> [f64; 3] {
        let (n, even) = (batches.passes as f64, batches.even as f64);
        let odd = n - even;
        [0, 1, 2].map(|c| {
            let difference = self.even[c] / even - (self.before[c] - self.even[c]) / odd;
            difference * difference * even * odd / (n * n)
        })
    }
}

/// How far an image is expected to be from what its method converges to. All are shares, as the roots of `relmse` and
/// `relmse_trimmed` of `compare` are; what a method's bias adds is not in them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NoiseEstimate {
    /// Root of the mean of σ² / (I² + ε), σ² being the variance of the mean by batches.
    pub relative: f64,
    /// The same without the 0.1 % worst pixels.
    pub relative_trimmed: f64,
    /// As `relative`, by the difference of the two halves.
    pub halves: f64,
}

impl NoiseEstimate {
    /// The larger of both estimates for the whole image.
    pub fn larger(&self) -> f64 {
        self.relative.max(self.halves)
    }
}

impl Film {
    /// Passes so far.
    pub fn passes(&self) -> u64 {
        self.sums.batches.passes
    }

    /// Says that a pass is complete; whether a batch ended with it. Each batch costs one sweep over the film.
    pub fn end_pass(&mut self) -> bool {
        let Some(batch) = self.sums.batches.end_pass() else { return false };
        self.sums.bands.par_iter_mut().for_each(|band| band.end_batch(batch));
        true
    }

    /// Whether a batch ended with the last pass.
    pub fn is_between_batches(&self) -> bool {
        self.sums.batches.before == self.sums.batches.passes
    }

    /// Variance of the mean per pixel and channel; `None` before the second batch.
    pub fn variance(&self) -> Option<Array3<f32>> {
        self.by_batches(Moments::variance)
    }

    /// The expected error of the image; `None` before the second batch.
    pub fn noise(&self) -> Option<NoiseEstimate> {
        let (colour, variance, halves) =
            (self.colour(), self.by_batches(Moments::variance)?, self.by_batches(Moments::halves)?);
        let expected = |variance: &Array3<f32>| Expected::of(colour.view(), variance.view());
        let (batches, halves) = rayon::join(|| expected(&variance), || expected(&halves));
        let Expected { relative, relative_trimmed } = batches?;
        Some(NoiseEstimate { relative, relative_trimmed, halves: halves?.relative })
    }

    fn by_batches(&self, value: fn(&Moments, &Batches) -> [f64; 3]) -> Option<Array3<f32>> {
        let mut batches = self.sums.batches;
        let last = batches.close();
        (batches.count >= 2).then(|| self.picture(|band: &Band, at| value(&band.moments(at, last), &batches)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Stream;

    /// Batches and moments of a sequence of passes at one pixel.
    fn gather(passes: impl Iterator<Item = f64>) -> (Moments, Batches) {
        let (mut moments, mut batches, mut sum) = (Moments::default(), Batches::default(), 0.0);
        for value in passes {
            sum += value;
            if let Some(batch) = batches.end_pass() {
                moments.add(batch, [sum; 3]);
            }
        }
        if let Some(last) = batches.close() {
            moments.add(last, [sum; 3]);
        }
        (moments, batches)
    }

    #[test]
    fn few_passes_by_hand() {
        // Batches of one pass: the sample variance over n.
        let (moments, batches) = gather([1.0, 2.0, 6.0].into_iter());
        assert!((moments.variance(&batches)[0] - (4.0 + 1.0 + 9.0) / 2.0 / 3.0).abs() < 1e-12);
        assert!((moments.halves(&batches)[1] - (3.5f64 - 2.0).powi(2) * 2.0 / 9.0).abs() < 1e-12);
        assert_eq!(gather([1.0].into_iter()).1.count, 1, "one batch has no spread");
    }

    #[test]
    fn batches_hold_all_passes_and_the_last_may_be_short() {
        for n in [2, 31, 32, 33, 35, 100, 1000, 12_345] {
            let (moments, batches) = gather((0..n).map(f64::from));
            assert_eq!((batches.before, batches.passes), (u64::from(n as u32), u64::from(n as u32)));
            assert_eq!(moments.before[0], f64::from(n) * f64::from(n - 1) / 2.0);
            assert!(batches.even > 0 && batches.even < batches.passes);
        }
        let (_, batches) = gather((0..100_000).map(f64::from));
        let equal = (batches.passes as f64).powi(2) / batches.squares as f64;
        assert!((28.0..36.0).contains(&equal), "as good as {equal} equal batches");
        assert!(batches.count < 200, "{} sweeps", batches.count);
    }

    #[test]
    fn a_pixel_without_noise_has_none() {
        let (moments, batches) = gather((0..5000).map(|_| 0.1));
        assert!(moments.variance(&batches)[0] < 1e-15 && moments.halves(&batches)[0] < 1e-15);
    }

    /// Mean over many sequences of both estimates against the known variance of the mean, for lengths that end within a
    /// batch: by 5.5 standard errors, which a correct program exceeds once in 2·10⁷ (normal; 4000 sequences).
    fn agrees(passes: u32, truth: f64, granted: f64, make: impl Fn(&mut Stream) -> Box<dyn FnMut() -> f64>) {
        let count = 4000u32;
        for estimate in [Moments::variance, Moments::halves] {
            let (mut sum, mut squares) = (0.0, 0.0);
            for sequence in 0..count {
                let mut stream = Stream::new(u64::from(sequence), &[u64::from(passes)]);
                let mut next = make(&mut stream);
                let (moments, batches) = gather((0..passes).map(|_| next()));
                let found = estimate(&moments, &batches)[0] / truth;
                sum += found;
                squares += found * found;
            }
            let mean = sum / f64::from(count);
            let error = ((squares / f64::from(count) - mean * mean) / f64::from(count)).sqrt();
            assert!((mean - 1.0).abs() < 5.5 * error + granted, "{passes} passes: {mean} ± {error} of the truth");
        }
    }

    #[test]
    fn independent_passes_are_judged_without_bias() {
        for passes in [2, 7, 40, 333] {
            agrees(passes, 1.0 / 12.0 / f64::from(passes), 0.0, |stream| {
                let mut stream = stream.clone();
                Box::new(move || stream.number())
            });
        }
    }

    /// An autoregressive chain, x' = ρ x + u: in the long run the variance of its mean is σ_u² / (1 − ρ)² / n. Granted: 5 %.
    /// Neighbours share 2 ρ / (1 − ρ²) = 4.4 times σ_u² / (1 − ρ)² at each of some 130 borders between batches, or 3 %.
    #[test]
    fn chains_are_judged_once_batches_outlast_their_memory() {
        let (rho, passes) = (0.8, 20_000);
        let truth = 1.0 / 12.0 / (1.0 - rho) / (1.0 - rho) / f64::from(passes);
        agrees(passes, truth, 0.05, |stream| {
            let (mut stream, mut x) = (stream.clone(), 0.0);
            Box::new(move || {
                x = rho * x + stream.number() - 0.5;
                x
            })
        });
    }
}
