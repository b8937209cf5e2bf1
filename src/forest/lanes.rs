//! The fast path for images: several points walk down a tree side by side.
//!
//! One point's way down is a chain of loads that wait for each other; many at once keep the processor busy. Leaves lead to
//! themselves, so that all points take the same number of steps and little needs to be decided on the way.

use super::tree::{Forest, LEAF, Node, Tree};

/// Points that walk together; a multiple of 8.
const LANES: usize = 32;

/// Steps between two looks at whether all points have arrived; each look costs about as much as a step.
const STRETCH: usize = 3;

/// A node, as it is walked: to the next node if the feature's value is below `threshold`, else to `above`.
#[derive(Debug, Clone, Copy, Default)]
struct Step {
    /// Start of the feature's plane.
    plane: u32,
    threshold: f32,
    below: u32,
}

/// A tree without the nodes at which features that have no plane decide: an image has few of the classes that a model
/// knows.
#[derive(Debug, Default)]
struct Walk {
    steps: Vec<Step>,
    /// By node, what its leaf predicts; 0 for others.
    values: Vec<f32>,
    depth: usize,
}

/// A forest made ready for points whose features lie in planes.
#[derive(Debug)]
pub(crate) struct Lanes {
    trees: Vec<Walk>,
}

impl Lanes {
    /// `planes` gives each feature's plane, by column; features without one are 0. Plane p begins at p · `stride`.
    pub(crate) fn new(forest: &Forest, planes: &[Option<usize>], stride: usize) -> Self {
        let walk = |tree: &Tree| {
            let mut walk = Walk { steps: vec![Step::default()], values: vec![0.0], depth: 0 };
            walk.copy(tree, 0, 0, 0, &|feature| planes[usize::from(feature)].map(|p| (p * stride) as u32));
            walk
        };
        Self { trees: forest.trees().iter().map(walk).collect() }
    }

    /// Predictions in [0, 1] for points 0 .. `out.len()` ≤ stride; the feature in plane p of point i is
    /// `values[p * stride + i]`.
    pub(crate) fn predict(&self, values: &[f32], out: &mut [f32]) {
        out.fill(0.0);
        for tree in &self.trees {
            for (group, out) in out.chunks_mut(LANES).enumerate() {
                let leaves = tree.walk(values.get(group * LANES..).unwrap_or_default());
                let leaves = leaves.as_flattened();
                out.iter_mut().zip(leaves).for_each(|(out, &leaf)| *out += tree.values[leaf as usize]);
            }
        }
        let count = self.trees.len() as f32;
        out.iter_mut().for_each(|out| *out = (*out / count).clamp(0.0, 1.0));
    }
}

impl Walk {
    /// Puts what is left of the tree below `node`, `depth` steps from the root, to `here`.
    fn copy(&mut self, tree: &Tree, mut node: usize, here: usize, depth: usize, plane: &impl Fn(u16) -> Option<u32>) {
        self.depth = self.depth.max(depth);
        loop {
            let Node { feature, value, above } = tree.nodes[node];
            if feature == LEAF {
                // Leads to itself whatever is read.
                self.steps[here] = Step { plane: 0, threshold: f32::NAN, below: (here as u32).wrapping_sub(1) };
                self.values[here] = value;
                return;
            }
            let Some(plane_start) = plane(feature) else {
                node = if value <= 0.0 { above as usize } else { node + 1 };
                continue;
            };
            let below = self.steps.len();
            self.steps[here] = Step { plane: plane_start, threshold: value, below: below as u32 };
            self.steps.resize(below + 2, Step::default());
            self.values.resize(below + 2, 0.0);
            self.copy(tree, node + 1, below, depth + 1, plane);
            return self.copy(tree, above as usize, below + 1, depth + 1, plane);
        }
    }

    /// Leaves that the points whose features begin `values`, plane by plane, fall into.
    #[inline]
    fn walk(&self, values: &[f32]) -> [[u32; 8]; LANES / 8] {
        let mut at = [[0u32; 8]; LANES / 8];
        for _ in 0..self.depth.div_ceil(STRETCH) {
            let before = at;
            for _ in 0..STRETCH {
                for (group, at) in at.iter_mut().enumerate() {
                    *at = self.step(*at, values.get(8 * group..).unwrap_or_default());
                }
            }
            if at == before {
                break;
            }
        }
        at
    }

    #[inline]
    fn step(&self, at: [u32; 8], values: &[f32]) -> [u32; 8] {
        std::array::from_fn(|lane| {
            let here = self.steps[at[lane] as usize];
            let value = values.get(here.plane as usize + lane).copied().unwrap_or(0.0);
            // What does not compare lies above: so do the leaves, whose threshold is not a number.
            here.below.wrapping_add(1 - u32::from(value < here.threshold))
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::super::{Rows, Settings, train};
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn lanes_agree_with_one_at_a_time() {
        let mut random = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(1);
        let mut rows = Rows::new();
        let columns: Vec<u16> = (0..5).map(|i| rows.feature(&format!("f{i}")).unwrap()).collect();
        for _ in 0..3000 {
            let entries: Vec<(u16, f32)> = columns.iter().map(|&c| (c, random.random::<f32>() - 0.3)).collect();
            rows.push(&entries, random.random(), 1.0, 0).unwrap();
        }
        let forest = train(&rows, &Settings { min_rows: 2, min_weight: 0.0, ..Settings::default() }).unwrap();
        let planes = [Some(2), None, Some(0), Some(1), None];
        for count in [1, 7, 8, 61] {
            let stride = 64;
            let values: Vec<f32> = (0..3 * stride).map(|_| random.random::<f32>() - 0.3).collect();
            let mut out = vec![9.0; count];
            Lanes::new(&forest, &planes, stride).predict(&values, &mut out);
            for (i, out) in out.into_iter().enumerate() {
                let single = forest.predict_with(|f| planes[usize::from(f)].map_or(0.0, |p| values[p * stride + i]));
                assert_eq!(out, single);
            }
        }
        let mut out = [0.0; 3];
        Lanes::new(&forest, &[None; 5], 3).predict(&[], &mut out);
        assert_eq!(out, [forest.predict_with(|_| 0.0); 3]);
    }
}
