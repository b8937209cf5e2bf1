//! What methods with chains share.

use crate::math::{Discrete, Stream};
use crate::path_space::Ways;
use crate::scene::{Caster, Scene};
use rayon::prelude::*;
use std::ops::RangeInclusive;

/// Lanes of chains. Each owns its chains, their random streams and its splats, so that the image does not depend on the
/// number of threads.
pub(super) const LANES: usize = 16;

/// What lane number `lane` makes in a pass of `mutations` by all lanes. What does not divide evenly goes round the lanes
/// from pass to pass.
pub(super) fn share(mutations: u64, lane: usize, pass: u64) -> u64 {
    let lanes = LANES as u64;
    mutations / lanes + u64::from((lane as u64 + pass) % lanes < mutations % lanes)
}

/// Independent samples before the chains begin: ten per pixel, within these bounds. Large steps refine what they find.
const FIRST_SAMPLES: RangeInclusive<usize> = 20_000..=100_000;

/// Independent samples in the batch with this number, for a film of `size`. Where the first finds no light, each pass draws
/// another, which takes as long as mutations would.
pub(super) fn batch_samples(size: [usize; 2], batch: u64) -> usize {
    let pixels = size[0] * size[1];
    if batch == 0 { (10 * pixels).clamp(*FIRST_SAMPLES.start(), *FIRST_SAMPLES.end()) } else { pixels }
}

/// Independent samples of a target: what tells b_k.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Mean {
    pub sum: f64,
    squares: f64,
    samples: u64,
}

impl Mean {
    pub(super) fn add(&mut self, target: f64) {
        self.sum += target;
        self.squares += target * target;
        self.samples += 1;
    }

    pub(super) fn merge(&mut self, other: &Self) {
        self.sum += other.sum;
        self.squares += other.squares;
        self.samples += other.samples;
    }

    pub(super) fn mean(&self) -> f64 {
        if self.samples == 0 { 0.0 } else { self.sum / self.samples as f64 }
    }

    /// Variance of one sample.
    fn variance(&self) -> f64 {
        let mean = self.mean();
        (self.squares / self.samples.max(1) as f64 - mean * mean).max(0.0)
    }

    /// Standard error of the mean.
    pub(super) fn error(&self) -> f64 {
        (self.variance() / self.samples.max(1) as f64).sqrt()
    }
}

/// Independent samples of a target, of which hidden paths are judged by themselves: draws that do not seek them find them
/// so seldom that a mean over these would be told by single samples.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Light {
    open: Mean,
    hidden: Mean,
}

impl Light {
    /// A sample that has been drawn in these ways: what it is worth, and whether its light is hidden.
    pub(super) fn add(&mut self, (target, hidden): (f64, bool), ways: Ways) {
        self.open.add(if hidden { 0.0 } else { target });
        if ways == Ways::All {
            self.hidden.add(if hidden { target } else { 0.0 });
        }
    }

    pub(super) fn merge(&mut self, other: &Self) {
        self.open.merge(&other.open);
        self.hidden.merge(&other.hidden);
    }

    pub(super) fn mean(&self) -> f64 {
        self.open.mean() + self.hidden.mean()
    }

    /// How many mutations are due to this light beside others: the geometric mean of its mean and of the root of its mean
    /// square. As many as the latter would be best for independent samples of it (Neyman's allocation); but that is told by
    /// few of them where they vary most.
    pub(super) fn due(&self) -> f64 {
        let mean = self.mean();
        (mean * (mean * mean + self.open.variance() + self.hidden.variance()).sqrt()).sqrt()
    }

    /// Standard error of the mean.
    pub(super) fn error(&self) -> f64 {
        self.open.error().hypot(self.hidden.error())
    }
}

/// What passes are worth, of a mean that becomes known better from pass to pass: so much that all together have the latest
/// mean, those before it was known included.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Worth {
    given: f64,
    passes: f64,
}

impl Worth {
    /// The most that a pass is worth, in means: what is due beyond that is left to later ones.
    const MOST: f64 = 3.0;

    /// What the next pass is worth, none less than nothing.
    pub(super) fn next(&mut self, mean: f64) -> f64 {
        self.passes += 1.0;
        let worth = (self.passes * mean - self.given).clamp(0.0, Self::MOST * mean);
        self.given += worth;
        worth
    }
}

/// Targets of `samples` independent samples, in parallel. `memory` is what one thread needs, `one` gives the target of a
/// sample by its number.
pub(super) fn independent<M, T: Clone + Send>(
    scene: &Scene,
    samples: usize,
    memory: impl Fn() -> M + Sync,
    one: impl Fn(&Caster<'_>, &mut M, usize) -> T + Sync,
) -> Vec<T> {
    const CHUNK: usize = 256;
    let chunks: Vec<Vec<T>> = (0..samples.div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            let (caster, mut memory) = (Caster::new(scene), memory());
            (chunk * CHUNK..samples.min((chunk + 1) * CHUNK)).map(|i| one(&caster, &mut memory, i)).collect()
        })
        .collect();
    chunks.concat()
}

/// How often a lane's chain tries to begin.
const ATTEMPTS: usize = 16;

/// Has the chain of each lane begin at a sample drawn in proportion to its `targets`, so that chains have their distribution
/// from the first step on. `begin` takes the lane, the number of the sample and the chain's own random numbers, which differ by
/// `family`; where it cannot begin there, another sample is drawn. Nothing begins where no sample has found light.
pub(super) fn start(
    targets: &[f64],
    seed: u64,
    family: u64,
    mut begin: impl FnMut(usize, usize, Stream) -> Option<()>,
) {
    let Some(choice) = Discrete::new(targets) else { return };
    for lane in 0..LANES {
        let mut stream = Stream::new(seed, &[3, family, lane as u64]);
        let mut attempt = || {
            let (chosen, _) = choice.sample(stream.number());
            begin(lane, chosen, stream.clone())
        };
        (0..ATTEMPTS).find_map(|_| attempt());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_that_cannot_begin_tries_another_sample() {
        let mut begun = [0; LANES];
        start(&[1.0, 0.0, 1.0], 1, 0, |lane, chosen, _| {
            assert_ne!(chosen, 1);
            (chosen == 2).then(|| begun[lane] += 1)
        });
        assert_eq!(begun, [1; LANES]);
        let mut attempts = 0;
        start(&[1.0], 1, 0, |_, _, _| {
            attempts += 1;
            None
        });
        assert_eq!(attempts, LANES * ATTEMPTS);
        start(&[0.0], 1, 0, |_, _, _| unreachable!("nothing shines"));
    }

    #[test]
    fn passes_add_up_to_the_latest_mean() {
        let means = [0.0, 0.0, 4.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0];
        let mut worth = Worth::default();
        let given = means.map(|mean| worth.next(mean));
        assert_eq!(given[..4], [0.0, 0.0, 12.0, 0.0]);
        assert!((given.iter().sum::<f64>() - 12.0 * 2.0).abs() < 1e-12, "{given:?}");
    }
}
