//! Discrete distributions by their cumulative sums.

/// A distribution over `0..n` with given non-negative weights.
#[derive(Clone, Debug, PartialEq)]
pub struct Discrete {
    /// `cumulative[i]` = probability of an index below `i`; one more entry than there are outcomes.
    cumulative: Vec<f64>,
}

impl Discrete {
    /// Normalises `weights`. `None` when they are empty, negative, not finite or sum to zero.
    pub fn new(weights: &[f64]) -> Option<Self> {
        let total: f64 = weights.iter().sum();
        if !(total > 0.0 && total.is_finite() && weights.iter().all(|w| *w >= 0.0)) {
            return None;
        }
        let mut cumulative = Vec::with_capacity(weights.len() + 1);
        let mut sum = 0.0;
        cumulative.push(0.0);
        for weight in weights {
            sum += weight;
            cumulative.push(sum / total);
        }
        Some(Self { cumulative })
    }

    /// Number of outcomes.
    pub fn len(&self) -> usize {
        self.cumulative.len() - 1
    }

    /// Whether there are no outcomes; never the case for a distribution from [`Discrete::new`].
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Index chosen by `u` in [0, 1), with what is left of `u` after the choice, again uniform in [0, 1).
    #[inline]
    pub fn sample(&self, u: f64) -> (usize, f64) {
        // Where one outcome ends and the next begins; for a few of them counting is faster than bisection.
        let bounds = &self.cumulative[1..self.len()];
        let mut index = match bounds.len() {
            0 => return (0, u),
            1..=8 => bounds.iter().map(|bound| usize::from(*bound <= u)).sum(),
            _ => bounds.partition_point(|bound| *bound <= u),
        };
        while index > 0 && self.pdf(index) == 0.0 {
            index -= 1; // u beyond the last outcome that can occur, by rounding
        }
        let rest = (u - self.cumulative[index]) / self.pdf(index);
        (index, rest.clamp(0.0, 1.0 - f64::EPSILON))
    }

    /// Probability of `index`.
    #[inline]
    pub fn pdf(&self, index: usize) -> f64 {
        self.cumulative[index + 1] - self.cumulative[index]
    }

    /// The `u` that [`Discrete::sample`] maps to (`index`, `rest`).
    #[inline]
    pub fn invert(&self, index: usize, rest: f64) -> f64 {
        self.cumulative[index] + rest * self.pdf(index)
    }
}

/// The place of one of `weights`, drawn by `u` in [0, 1) in proportion to them; `None` where rounding leads beyond the last.
/// For weights that are used once, so that nothing is kept of them.
#[inline]
pub fn pick(weights: impl Iterator<Item = f64> + Clone, u: f64) -> Option<usize> {
    let mut rest = u * weights.clone().sum::<f64>();
    let mut weights = weights;
    weights.position(|weight| {
        rest -= weight;
        rest < 0.0
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used)]
    use super::*;

    #[test]
    fn samples_follow_the_weights_and_invert() {
        let weights = [0.0, 3.0, 0.0, 1.0, 0.0];
        let distribution = Discrete::new(&weights).expect("valid weights");
        let n = 40_000;
        let mut counts = [0usize; 5];
        for i in 0..n {
            let u = (i as f64 + 0.5) / n as f64;
            let (index, rest) = distribution.sample(u);
            counts[index] += 1;
            assert!((distribution.invert(index, rest) - u).abs() < 1e-12);
        }
        assert_eq!(counts, [0, 30_000, 0, 10_000, 0]);
    }

    #[test]
    fn picks_follow_the_weights() {
        let weights = [0.0, 3.0, 0.0, 1.0];
        let counts = (0..4000).fold([0; 4], |mut counts, i| {
            counts[pick(weights.into_iter(), (f64::from(i) + 0.5) / 4000.0).expect("within the weights")] += 1;
            counts
        });
        assert_eq!(counts, [0, 3000, 0, 1000]);
        assert_eq!(pick([0.0, 0.0].into_iter(), 0.5), None);
    }

    #[test]
    fn bad_weights_are_refused() {
        for weights in [&[][..], &[0.0, 0.0], &[1.0, -1.0], &[f64::NAN], &[f64::INFINITY]] {
            assert!(Discrete::new(weights).is_none(), "{weights:?}");
        }
    }
}
