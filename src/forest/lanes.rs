//! The fast path for images: several points walk down a tree side by side.
//!
//! One point's way down is a chain of loads that wait for each other; many at once keep the processor busy. Leaves lead to
//! themselves, so that all points take the same number of steps and little needs to be decided on the way. In the first
//! levels there are so few nodes that it is faster to ask all of them of all points, without any look-up.

use super::tree::{Forest, LEAF, MAX_NODES, Node, Tree};

/// Points that walk together.
pub(crate) const LANES: usize = 16;

/// Steps between two looks at whether all points have arrived; each look costs about as much as a step.
const STRETCH: usize = 3;

/// Levels of a tree at which all nodes are asked.
const LEVELS: usize = 5;

/// Nodes in these levels: the children of node k are 2 k + 1 and 2 k + 2.
const CROWN: usize = (1 << LEVELS) - 1;

/// A node, as it is walked: to step `below` if the feature's value is below `threshold`, else to the one after it.
#[derive(Debug, Clone, Copy, Default)]
struct Step {
    threshold: f32,
    /// Number of the feature's plane.
    plane: u16,
    below: u16,
}

/// A tree without the nodes at which features that have no plane decide: an image has few of the classes that a model
/// knows.
#[derive(Debug)]
struct Walk {
    /// One for each `u16`, so that no look-up has to be checked.
    steps: Box<[Step; MAX_NODES + 1]>,
    /// By step, what its leaf predicts; 0 for others.
    values: Vec<f32>,
    /// Number of steps, without those that no node needs.
    used: usize,
    depth: usize,
    /// Numbers of the steps that the crown's nodes stand for, and of those that it leads to.
    crown: [u16; 2 * CROWN + 1],
}

/// A forest made ready for points whose features lie in planes.
#[derive(Debug)]
pub(crate) struct Lanes {
    trees: Vec<Walk>,
    /// In groups of points.
    stride: usize,
}

impl Lanes {
    /// `planes` gives each feature's plane, by column; features without one are 0. A plane takes `stride` groups of
    /// [`LANES`] points.
    pub(crate) fn new(forest: &Forest, planes: &[Option<usize>], stride: usize) -> Self {
        let walk = |tree: &Tree| {
            let steps = Box::new([Step::default(); MAX_NODES + 1]);
            let values = vec![0.0; tree.nodes.len() + 1];
            let mut walk = Walk { steps, values, used: 1, depth: 0, crown: [0; _] };
            walk.copy(tree, 0, 0, 0, &|feature| planes[usize::from(feature)].map(|p| p as u16));
            for k in 0..CROWN {
                let below = walk.steps[usize::from(walk.crown[k])].below;
                (walk.crown[2 * k + 1], walk.crown[2 * k + 2]) = (below, below.wrapping_add(1));
            }
            walk
        };
        Self { trees: forest.trees().iter().map(walk).collect(), stride }
    }

    /// Predictions in [0, 1] for points 0 .. `out.len()` ≤ LANES · stride; the feature in plane p of point LANES g + i is
    /// `values[p * stride + g][i]`.
    pub(crate) fn predict(&self, values: &[[f32; LANES]], out: &mut [f32]) {
        let count = self.trees.len() as f32;
        // What the points of a group need lies side by side. One plane at least: leaves read the first.
        let mut near = vec![[0.0; LANES]; values.len().div_ceil(self.stride).max(1)];
        for (group, out) in out.chunks_mut(LANES).enumerate() {
            let planes = values.get(group..).unwrap_or_default().iter().step_by(self.stride);
            near.iter_mut().zip(planes).for_each(|(near, plane)| *near = *plane);
            let mut sums = [0.0; LANES];
            for tree in &self.trees {
                let leaves = tree.walk(&near);
                sums.iter_mut().zip(leaves).for_each(|(sum, leaf)| *sum += tree.values[usize::from(leaf as u16)]);
            }
            out.iter_mut().zip(sums).for_each(|(out, sum)| *out = (sum / count).clamp(0.0, 1.0));
        }
    }
}

impl Walk {
    /// Puts what is left of the tree below `node`, `depth` steps from the root, to `here`.
    fn copy(&mut self, tree: &Tree, mut node: usize, here: usize, depth: usize, plane: &impl Fn(u16) -> Option<u16>) {
        self.depth = self.depth.max(depth);
        loop {
            let Node { feature, value, above } = tree.nodes[node];
            if feature == LEAF {
                // Leads to itself whatever is read.
                self.steps[here] = Step { plane: 0, threshold: f32::NAN, below: (here as u16).wrapping_sub(1) };
                self.values[here] = value;
                return;
            }
            let Some(plane_number) = plane(feature) else {
                node = if value <= 0.0 { above as usize } else { node + 1 };
                continue;
            };
            let below = self.used;
            self.used += 2;
            self.steps[here] = Step { plane: plane_number, threshold: value, below: below as u16 };
            self.copy(tree, node + 1, below, depth + 1, plane);
            return self.copy(tree, above as usize, below + 1, depth + 1, plane);
        }
    }

    /// Leaves that points fall into; the feature in plane p of point i is `values[p][i]`.
    #[inline]
    fn walk(&self, values: &[[f32; LANES]]) -> [u32; LANES] {
        let mut node = [0; LANES];
        for k in 0..CROWN {
            let here = self.steps[usize::from(self.crown[k])];
            for (node, value) in node.iter_mut().zip(values[usize::from(here.plane)]) {
                let next = 2 * k as u32 + 2 - u32::from(value < here.threshold);
                *node = if *node == k as u32 { next } else { *node };
            }
        }
        let mut at = node.map(|node| u32::from(self.crown[node as usize]));
        for _ in 0..self.depth.saturating_sub(LEVELS).div_ceil(STRETCH) {
            let before = at;
            for _ in 0..STRETCH {
                at = self.step(at, values);
            }
            if at == before {
                break;
            }
        }
        at
    }

    #[inline]
    fn step(&self, at: [u32; LANES], values: &[[f32; LANES]]) -> [u32; LANES] {
        std::array::from_fn(|lane| {
            let here = self.steps[usize::from(at[lane] as u16)];
            let value = values[usize::from(here.plane)][lane];
            // What does not compare lies above: so do the leaves, whose threshold is not a number.
            u32::from(here.below) + 1 - u32::from(value < here.threshold)
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
            Lanes::new(&forest, &planes, stride / LANES).predict(values.as_chunks().0, &mut out);
            for (i, out) in out.into_iter().enumerate() {
                let single = forest.predict_with(|f| planes[usize::from(f)].map_or(0.0, |p| values[p * stride + i]));
                assert_eq!(out, single);
            }
        }
        let mut out = [0.0; 3];
        Lanes::new(&forest, &[None; 5], 1).predict(&[], &mut out);
        assert_eq!(out, [forest.predict_with(|_| 0.0); 3]);
    }
}
