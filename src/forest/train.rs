//! Training a forest: a part of the rows grows each tree, the rest gives its leaves their values.

use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::binned::Binned;
use super::grow::{Sample, grow};
use super::refine::refine;
use super::{Forest, ForestError, LEAF, MAX_DEPTH, MAX_NODES, Rows, SplitBy, Tree};

/// How a forest is grown. The defaults are the thesis's where it gives any (section 5.5): 5 trees, depth 15, 100 KB.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Number of trees, 1 to 1000.
    pub trees: usize,
    /// Most splits between root and leaf, up to [`MAX_DEPTH`] = 64.
    pub max_depth: usize,
    /// Most leaves per tree, 1 to 32 768. A leaf and its split take about 20 bytes in the file: 5 trees of 700 leaves stay
    /// below 100 KB.
    pub max_leaves: usize,
    /// Fewest rows per leaf, ≥ 1.
    pub min_rows: usize,
    /// Least weight per leaf as a share of the weight of all rows that grow the tree, in [0, 1].
    pub min_weight: f64,
    /// Most features that a forest may ask for, ≥ 1: those with the largest weighted mean over the rows. Each costs the
    /// reading of a layer of both images.
    pub max_features: usize,
    /// Share of the features that each split may choose from, in (0, 1]; 1 tries all.
    pub features_per_split: f64,
    /// Whether each tree grows on a bootstrap sample (bagging, Breiman 1996) of its rows.
    pub bootstrap: bool,
    /// Share of the rows that re-estimate the leaves instead of growing the tree, in [0, 1); 0 means no refinement.
    /// Each tree draws its own two parts, so that the forest as a whole learns from every row both ways.
    pub refinement: f64,
    /// Whether the two parts separate rows or whole groups.
    pub refine_by: SplitBy,
    /// Share by which leaf values are drawn towards 0.5, in [0, 1]: what the training scenes agree on may not hold on the
    /// next one, and an answer that is less sure of itself loses less where it is wrong than it gains where it is right.
    pub shrinkage: f64,
    /// Seed of everything random. Equal rows, settings and seed give the same forest, bit for bit, on any number of threads.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            trees: 5,
            max_depth: 15,
            max_leaves: 700,
            min_rows: 20,
            min_weight: 1e-4,
            max_features: usize::from(u16::MAX),
            features_per_split: 1.0,
            bootstrap: true,
            refinement: 0.5,
            refine_by: SplitBy::Rows,
            shrinkage: 0.0,
            seed: 1,
        }
    }
}

impl Settings {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`ForestError::Setting`] for the first that is out of its range.
    pub fn check(&self) -> Result<(), ForestError> {
        let wrong = |name, found: String, expected| Err(ForestError::Setting { name, found, expected });
        if !(1..=1000).contains(&self.trees) {
            return wrong("trees", self.trees.to_string(), "1 to 1000");
        }
        if self.max_depth > MAX_DEPTH {
            return wrong("max_depth", self.max_depth.to_string(), "0 to 64");
        }
        if !(1..=MAX_NODES.div_ceil(2)).contains(&self.max_leaves) {
            return wrong("max_leaves", self.max_leaves.to_string(), "1 to 32768");
        }
        if self.min_rows < 1 {
            return wrong("min_rows", self.min_rows.to_string(), "1 or more");
        }
        if !(0.0..=1.0).contains(&self.min_weight) {
            return wrong("min_weight", self.min_weight.to_string(), "0 to 1");
        }
        if self.max_features < 1 {
            return wrong("max_features", self.max_features.to_string(), "1 or more");
        }
        if !(self.features_per_split > 0.0 && self.features_per_split <= 1.0) {
            return wrong("features_per_split", self.features_per_split.to_string(), "more than 0, up to 1");
        }
        if !(0.0..1.0).contains(&self.refinement) {
            return wrong("refinement", self.refinement.to_string(), "0 or more, less than 1");
        }
        if !(0.0..=1.0).contains(&self.shrinkage) {
            return wrong("shrinkage", self.shrinkage.to_string(), "0 to 1");
        }
        Ok(())
    }
}

/// Learns the rows' targets from their features.
///
/// Every prediction lies in [0, 1], and within the range of the targets as far as that overlaps; leaf values are rounded to
/// four decimals, which is far below their noise and keeps the file small.
///
/// # Errors
/// [`ForestError::Setting`] for a setting out of range, [`ForestError::NoRows`] if no row has a positive weight.
pub fn train(rows: &Rows, settings: &Settings) -> Result<Forest, ForestError> {
    settings.check()?;
    if !rows.weights().iter().any(|&w| w > 0.0) {
        return Err(ForestError::NoRows { rows: rows.len() });
    }
    let binned = Binned::of(rows, settings.max_features);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(settings.seed);
    let streams: Vec<_> = (0..settings.trees)
        .map(|_| {
            random.jump();
            random.clone()
        })
        .collect();
    let trees = streams.into_par_iter().map(|stream| one_tree(rows, &binned, settings, stream)).collect();
    Ok(Forest { features: rows.features().to_vec(), trees })
}

fn one_tree(rows: &Rows, binned: &Binned, settings: &Settings, mut random: Xoshiro256PlusPlus) -> Tree {
    let useful =
        |list: Vec<u32>| -> Vec<u32> { list.into_iter().filter(|&i| rows.weights()[i as usize] > 0.0).collect() };
    let (refining, growing) = match settings.refinement {
        0.0 => (Vec::new(), (0..rows.len() as u32).collect()),
        share => rows.split(share, settings.refine_by, random.random()),
    };
    let (mut refining, mut growing) = (useful(refining), useful(growing));
    if growing.is_empty() {
        // So few rows, or groups, that all fell on the other side: better overfitted than ignorant.
        std::mem::swap(&mut refining, &mut growing);
    }
    let samples = if settings.bootstrap { bootstrap(&growing, &mut random) } else { once(&growing) };
    let mut tree = grow(rows, binned, samples, settings, &mut random);
    refine(&mut tree, rows, &refining);
    for leaf in tree.nodes.iter_mut().filter(|n| n.feature == LEAF) {
        let drawn = leaf.value + (0.5 - leaf.value) * settings.shrinkage as f32;
        leaf.value = (drawn * 1e4).round() / 1e4;
    }
    tree
}

fn once(indices: &[u32]) -> Vec<Sample> {
    indices.iter().map(|&row| Sample { row, times: 1 }).collect()
}

/// As many draws with replacement as there are rows.
fn bootstrap(indices: &[u32], random: &mut Xoshiro256PlusPlus) -> Vec<Sample> {
    let mut times = vec![0u32; indices.len()];
    for _ in 0..indices.len() {
        times[random.random_range(0..indices.len())] += 1;
    }
    let drawn = indices.iter().zip(times).filter(|(_, times)| *times > 0);
    drawn.map(|(&row, times)| Sample { row, times }).collect()
}
