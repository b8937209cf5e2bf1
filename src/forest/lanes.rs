//! The fast path for images: several points walk down a tree side by side.
//!
//! One point's way down is a chain of loads that wait for each other; eight at once keep the processor busy. Leaves lead
//! to themselves, so that the lanes need not agree on where they end.

use super::tree::{Forest, LEAF, Tree};

/// Points that walk together.
const LANES: usize = 8;

/// A node with both children spelt out.
#[derive(Debug, Clone, Copy)]
struct Step {
    /// Start of the feature's plane.
    plane: u32,
    threshold: f32,
    children: [u32; 2],
}

/// A forest made ready for points whose features lie in planes.
#[derive(Debug)]
pub(crate) struct Lanes<'a> {
    forest: &'a Forest,
    trees: Vec<Vec<Step>>,
    depths: Vec<usize>,
}

impl<'a> Lanes<'a> {
    /// `planes` gives each feature's plane, by column; features without one are 0. Plane p begins at p · `stride`.
    pub(crate) fn new(forest: &'a Forest, planes: &[Option<usize>], stride: usize) -> Self {
        let trees = forest.trees().iter().map(|t| steps(t, planes, stride)).collect();
        Self { forest, trees, depths: forest.trees().iter().map(Tree::depth).collect() }
    }

    /// Predictions in [0, 1] for points 0 .. `out.len()`; feature p of point i is `values[p * stride + i]`.
    pub(crate) fn predict(&self, values: &[f32], out: &mut [f32]) {
        out.fill(0.0);
        for ((steps, tree), &depth) in self.trees.iter().zip(self.forest.trees()).zip(&self.depths) {
            for (group, out) in out.chunks_mut(LANES).enumerate() {
                let leaves = walk(steps, depth, values, group * LANES, out.len());
                out.iter_mut().zip(leaves).for_each(|(out, leaf)| *out += tree.nodes[leaf as usize].value);
            }
        }
        let count = self.trees.len() as f32;
        out.iter_mut().for_each(|out| *out = (*out / count).clamp(0.0, 1.0));
    }
}

/// Leaves that the points `first` .. `first + count` fall into.
#[inline]
fn walk(steps: &[Step], depth: usize, values: &[f32], first: usize, count: usize) -> [u32; LANES] {
    let mut at = [0u32; LANES];
    // Lanes beyond the last point follow it, which costs nothing and needs no second loop.
    let points: [usize; LANES] = std::array::from_fn(|lane| first + lane.min(count - 1));
    for _ in 0..depth {
        let mut moved = false;
        for lane in 0..LANES {
            let step = steps[at[lane] as usize];
            let value = values.get(step.plane as usize + points[lane]).copied().unwrap_or(0.0);
            let next = step.children[usize::from(value >= step.threshold)];
            moved |= next != at[lane];
            at[lane] = next;
        }
        if !moved {
            break;
        }
    }
    at
}

fn steps(tree: &Tree, planes: &[Option<usize>], stride: usize) -> Vec<Step> {
    let step = |(i, node): (usize, &super::Node)| {
        let here = i as u32;
        if node.feature == LEAF {
            return Step { plane: 0, threshold: 0.0, children: [here; 2] };
        }
        let children = [here + 1, node.above];
        match planes[usize::from(node.feature)] {
            Some(plane) => Step { plane: (plane * stride) as u32, threshold: node.value, children },
            None => {
                let child = children[usize::from(0.0 >= node.value)];
                Step { plane: 0, threshold: 0.0, children: [child; 2] }
            }
        }
    };
    tree.nodes.iter().enumerate().map(step).collect()
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
