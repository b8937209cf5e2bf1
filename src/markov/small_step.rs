//! Small steps: each number moves a little, around the circle.

use super::settings::Scales;
use crate::math::{Row, Stream};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// How far a number moves.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SmallStep {
    /// By a normal distribution of this standard deviation.
    Gaussian {
        /// Standard deviation.
        deviation: f64,
    },
    /// By a length between two bounds, whose logarithm is uniform, to either side (Kelemen et al. 2002, section 3.1).
    Kelemen {
        /// Least length.
        least: f64,
        /// Greatest length.
        most: f64,
    },
}

/// So many steps by Kelemen's distribution leave nothing of where they began: with its usual bounds their deviation is
/// two turns.
const FORGETS: u64 = 100_000;

/// The number on the circle of length 1.
#[inline]
fn wrap(number: f64) -> f64 {
    let number = number - number.floor();
    if number < 1.0 { number } else { 0.0 }
}

impl SmallStep {
    /// Kelemen's distribution with his bounds.
    pub const KELEMEN: Self = Self::Kelemen { least: 1.0 / 1024.0, most: 1.0 / 64.0 };

    /// The deviation, or the upper bound.
    pub fn size(&self) -> f64 {
        match *self {
            Self::Gaussian { deviation } => deviation,
            Self::Kelemen { most, .. } => most,
        }
    }

    /// `number` after `steps` steps, each `scale` times as far.
    #[inline]
    pub fn moved(&self, number: f64, scale: f64, steps: u64, stream: &mut Stream) -> f64 {
        match *self {
            Self::Gaussian { deviation } => {
                let spread = if steps == 1 { 1.0 } else { (steps as f64).sqrt() };
                wrap(number + deviation * scale * spread * stream.normal())
            }
            Self::Kelemen { .. } if steps > FORGETS => stream.number(),
            Self::Kelemen { least, most } => {
                let ratio = (least / most).ln();
                let mut number = number;
                for _ in 0..steps {
                    let u = stream.number();
                    let (side, u) = if u < 0.5 { (scale, 2.0 * u) } else { (-scale, 2.0 * u - 1.0) };
                    number = wrap(number + side * most * (ratio * u).exp());
                }
                number
            }
        }
    }

    /// `row` after `steps` steps, in which each number moves as far as its scale says.
    #[inline]
    pub fn moved_row(&self, row: Row, scales: &Scales, steps: u64, stream: &mut Stream) -> Row {
        let mut moved = |i: usize| if scales[i] > 0.0 { self.moved(row[i], scales[i], steps, stream) } else { row[i] };
        [moved(0), moved(1), moved(2), moved(3)]
    }

    /// Density with which one step leads from `a` to `b`.
    pub fn density(&self, a: f64, b: f64, scale: f64) -> f64 {
        let way = wrap(b - a);
        match *self {
            Self::Gaussian { deviation } => {
                let deviation = deviation * scale;
                let normal = |x: f64| (-0.5 * (x / deviation).powi(2)).exp() / (deviation * TAU.sqrt());
                // Beyond two turns nothing is left for deviations that are steps at all.
                (-2..=1).map(|turns| normal(way + f64::from(turns))).sum()
            }
            Self::Kelemen { least, most } => {
                let (least, most) = (least * scale, most * scale);
                let length = |x: f64| if x >= least && x <= most { 0.5 / (x * (most / least).ln()) } else { 0.0 };
                length(way) + length(1.0 - way)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEPS: [SmallStep; 3] =
        [SmallStep::Gaussian { deviation: 0.05 }, SmallStep::Gaussian { deviation: 0.3 }, SmallStep::KELEMEN];

    /// Steps have the density that they say, across the seam too, and are as likely back as forth.
    #[test]
    fn steps_follow_their_density() {
        const BINS: usize = 200;
        for step in STEPS {
            let (mut stream, mut counts, samples) = (Stream::new(1, &[]), [0.0f64; BINS], 200_000);
            for _ in 0..samples {
                counts[(step.moved(0.99, 1.5, 1, &mut stream) * BINS as f64) as usize] += 1.0;
            }
            let mut sum = 0.0;
            for (bin, count) in counts.iter().enumerate() {
                let fine = |i: usize| (bin as f64 + (i as f64 + 0.5) / 500.0) / BINS as f64;
                let share = (0..500).map(|i| step.density(0.99, fine(i), 1.5)).sum::<f64>() / (500 * BINS) as f64;
                let (mean, there) = (share * f64::from(samples), (bin as f64 + 0.5) / BINS as f64);
                sum += share;
                assert!((count - mean).abs() < 5.0 * (mean + 1e-3 * mean * mean).sqrt() + 5.0, "{step:?} {there}");
                let ways = [step.density(0.99, there, 1.5), step.density(there, 0.99, 1.5)];
                assert!((ways[0] - ways[1]).abs() < 1e-9 * (1.0 + ways[0]), "{step:?} {ways:?}");
            }
            assert!((sum - 1.0).abs() < 5e-3, "{step:?}: {sum}");
        }
    }

    /// Many steps at once spread like many steps.
    #[test]
    fn sleeping_numbers_catch_up() {
        let steps = [SmallStep::Gaussian { deviation: 0.01 }, SmallStep::KELEMEN];
        // E[x²] of a length with uniform logarithm.
        let [least, most] = [1.0 / 1024.0, 1.0f64 / 64.0];
        let variances = [1e-4, (most * most - least * least) / (2.0 * (most / least).ln())];
        for (step, variance) in steps.into_iter().zip(variances) {
            let (mut stream, trials, n) = (Stream::new(3, &[]), 4000, 25);
            let square = |_| (step.moved(0.5, 1.0, n, &mut stream) - 0.5).powi(2);
            let found = (0..trials).map(square).sum::<f64>() / f64::from(trials) / n as f64;
            // The standard error of a variance is √(2/n) of it.
            assert!((found / variance - 1.0).abs() < 4.5 * (2.0 / f64::from(trials)).sqrt(), "{found} {variance}");
        }
    }
}
