//! Growing one regression tree (Otsu thesis, section 5.4.1).
//!
//! The thesis prints V = Var(T) − Var(T_L) − Var(T_R) without saying that the variances are to be scaled by the size of
//! their set; taken literally it would favour splits that make both sides tiny. What is meant, and computed here, is the
//! usual weighted impurity decrease (Breiman et al. 1984): with W = Σ w and S = Σ w y of a set,
//! gain = S_L²/W_L + S_R²/W_R − S²/W, which is the decrease of Σ w (y − mean)².
//!
//! Growth is best first: the leaf whose split gains most is split next, until the tree has its leaves. A file of limited
//! size so holds the splits that matter most.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use rand::RngExt;
use rand_xoshiro::Xoshiro256PlusPlus;

use super::binned::{BINS, Binned};
use super::tree::{LEAF, Node, Tree};
use super::{Rows, Settings};

/// Count, weight and weighted target of a set of rows.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    rows: u64,
    weight: f64,
    target: f64,
}

impl Sums {
    fn add(&mut self, other: Sums) {
        self.rows += other.rows;
        self.weight += other.weight;
        self.target += other.target;
    }

    fn minus(self, other: Sums) -> Sums {
        let rows = self.rows - other.rows.min(self.rows);
        Sums { rows, weight: self.weight - other.weight, target: self.target - other.target }
    }

    fn mean(self) -> f64 {
        if self.weight > 0.0 { self.target / self.weight } else { 0.5 }
    }
}

/// One row of a tree's (possibly resampled) training set.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    /// Index of the row.
    pub row: u32,
    /// How often it was drawn, ≥ 1.
    pub times: u32,
}

/// The best way to split a leaf.
#[derive(Debug, Clone, Copy)]
struct Split {
    gain: f64,
    feature: u16,
    /// Bins up to this one go below.
    bin: u8,
}

/// A leaf that could be split, ordered by gain; equal gains by age, so that the order is total.
#[derive(Debug)]
struct Candidate {
    split: Split,
    node: usize,
    range: std::ops::Range<usize>,
    depth: usize,
}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        self.split.gain.total_cmp(&other.split.gain).then(other.node.cmp(&self.node))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Candidate {}

/// A node while its tree is still growing, in order of creation.
#[derive(Debug)]
struct Draft {
    mean: f64,
    /// Split feature, threshold and the indices of the children below and above.
    split: Option<(u16, f32, usize, usize)>,
}

/// Grows one tree; `random` chooses the features that each split may use.
pub(super) fn grow(
    rows: &Rows,
    binned: &Binned,
    mut samples: Vec<Sample>,
    settings: &Settings,
    random: &mut Xoshiro256PlusPlus,
) -> Tree {
    let mut grower = Grower::new(rows, binned, &samples, settings, random);
    let mut scratch = Vec::with_capacity(samples.len());
    let mut heap = BinaryHeap::new();
    let (mean, root) = grower.consider(&samples, 0, 0..samples.len(), 0);
    let mut drafts = vec![Draft { mean, split: None }];
    heap.extend(root);
    let mut leaves = 1;
    while leaves < settings.max_leaves {
        let Some(best) = heap.pop() else { break };
        let Split { feature, bin, .. } = best.split;
        let below = partition(&mut samples[best.range.clone()], &mut scratch, |s| binned.bin(s.row, feature) <= bin);
        let middle = best.range.start + below;
        let first = drafts.len();
        for (node, range) in [(first, best.range.start..middle), (first + 1, middle..best.range.end)] {
            let (mean, candidate) = grower.consider(&samples, node, range, best.depth + 1);
            drafts.push(Draft { mean, split: None });
            heap.extend(candidate);
        }
        let threshold = binned.cuts[usize::from(feature)][usize::from(bin)];
        drafts[best.node].split = Some((feature, threshold, first, first + 1));
        leaves += 1;
    }
    preorder(&drafts)
}

/// What is needed to judge a node's splits.
struct Grower<'a> {
    rows: &'a Rows,
    binned: &'a Binned,
    settings: &'a Settings,
    random: &'a mut Xoshiro256PlusPlus,
    /// Features that have anything to split on.
    features: Vec<u16>,
    min_weight: f64,
    histogram: Vec<Sums>,
}

impl<'a> Grower<'a> {
    fn new(
        rows: &'a Rows,
        binned: &'a Binned,
        samples: &[Sample],
        settings: &'a Settings,
        random: &'a mut Xoshiro256PlusPlus,
    ) -> Self {
        let features = (0..binned.cuts.len()).filter(|&f| !binned.cuts[f].is_empty()).map(|f| f as u16).collect();
        let weight = |s: &Sample| f64::from(rows.weights()[s.row as usize]) * f64::from(s.times);
        let min_weight = samples.iter().map(weight).sum::<f64>() * settings.min_weight;
        let histogram = vec![Sums::default(); binned.cuts.len() * BINS];
        Self { rows, binned, settings, random, features, min_weight, histogram }
    }

    /// Mean target of the node over `samples[range]`, and its best split if it may be split at all.
    fn consider(
        &mut self,
        samples: &[Sample],
        node: usize,
        range: std::ops::Range<usize>,
        depth: usize,
    ) -> (f64, Option<Candidate>) {
        let total = self.fill(&samples[range.clone()]);
        let enough = total.rows >= 2 * self.settings.min_rows as u64 && depth < self.settings.max_depth;
        let split = if enough { self.best(total) } else { None };
        (total.mean(), split.map(|split| Candidate { split, node, range, depth }))
    }

    /// Fills the histogram with the non-zero entries of `samples`; returns the totals.
    fn fill(&mut self, samples: &[Sample]) -> Sums {
        self.histogram.fill(Sums::default());
        let mut total = Sums::default();
        for sample in samples {
            let row = sample.row as usize;
            let weight = f64::from(self.rows.weights()[row]) * f64::from(sample.times);
            let target = weight * f64::from(self.rows.targets()[row]);
            let sums = Sums { rows: u64::from(sample.times), weight, target };
            total.add(sums);
            for &slot in self.binned.slots(sample.row) {
                self.histogram[slot as usize].add(sums);
            }
        }
        total
    }

    /// Best split of the node whose histogram was filled last.
    fn best(&mut self, total: Sums) -> Option<Split> {
        let share = self.settings.features_per_split;
        let tried = ((self.features.len() as f64 * share).ceil() as usize).min(self.features.len());
        if tried < self.features.len() {
            // The front of a partial Fisher-Yates shuffle is a uniform choice without repetition.
            for i in 0..tried {
                let j = self.random.random_range(i..self.features.len());
                self.features.swap(i, j);
            }
        }
        let splits = self.features[..tried].iter().filter_map(|&f| self.best_of(f, total));
        splits.max_by(|a, b| a.gain.total_cmp(&b.gain).then(b.feature.cmp(&a.feature)))
    }

    /// Best split on one feature.
    fn best_of(&self, feature: u16, total: Sums) -> Option<Split> {
        let f = usize::from(feature);
        let bins = &self.histogram[f * BINS..(f + 1) * BINS];
        let mut present = Sums::default();
        bins.iter().for_each(|&b| present.add(b));
        if present.rows == 0 {
            return None;
        }
        let (least, rows) = (self.min_weight.max(f64::MIN_POSITIVE), self.settings.min_rows as u64);
        let whole = total.target * total.target / total.weight;
        // Differences below the rounding of the sums are no gain.
        let mut best = Split { gain: 1e-12 * whole.abs(), feature, bin: 0 };
        let (mut below, mut found) = (Sums::default(), false);
        for bin in 0..self.binned.cuts[f].len() as u8 {
            below.add(bins[usize::from(bin)]);
            if bin == self.binned.zero[f] {
                below.add(total.minus(present));
            }
            let above = total.minus(below);
            if below.rows < rows || above.rows < rows || below.weight < least || above.weight < least {
                continue;
            }
            let parts = below.target * below.target / below.weight + above.target * above.target / above.weight;
            if parts - whole > best.gain {
                best = Split { gain: parts - whole, feature, bin };
                found = true;
            }
        }
        found.then_some(best)
    }
}

/// Moves the samples that satisfy `first` to the front, keeping the order within both parts; returns their number.
fn partition(samples: &mut [Sample], scratch: &mut Vec<Sample>, first: impl Fn(&Sample) -> bool) -> usize {
    scratch.clear();
    let mut kept = 0;
    for i in 0..samples.len() {
        let sample = samples[i];
        if first(&sample) {
            samples[kept] = sample;
            kept += 1;
        } else {
            scratch.push(sample);
        }
    }
    samples[kept..].copy_from_slice(scratch);
    kept
}

/// The finished tree, renumbered so that a split's lower child follows it.
fn preorder(drafts: &[Draft]) -> Tree {
    let mut nodes: Vec<Node> = Vec::with_capacity(drafts.len());
    // (draft, split whose upper child it is)
    let mut stack = vec![(0, None)];
    while let Some((draft, parent)) = stack.pop() {
        let here = nodes.len();
        if let Some(parent) = parent {
            let parent: usize = parent;
            nodes[parent].above = here as u32;
        }
        match drafts[draft].split {
            Some((feature, value, below, above)) => {
                nodes.push(Node { feature, value, above: 0 });
                stack.push((above, Some(here)));
                stack.push((below, None));
            }
            None => {
                let value = drafts[draft].mean.clamp(0.0, 1.0) as f32;
                nodes.push(Node { feature: LEAF, value, above: 0 });
            }
        }
    }
    Tree { nodes }
}
