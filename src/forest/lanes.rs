//! The fast path for images: several points walk down a tree side by side.
//!
//! One point's way down is a chain of loads that wait for each other; many at once keep the processor busy. Leaves lead to
//! themselves, so that all points take the same number of steps and nothing needs to be decided on the way.

use wide::f32x8;

use super::tree::{Forest, LEAF, Tree};

/// Points that walk together; a multiple of 8.
const LANES: usize = 32;

/// A node, as it is walked: to the next node if the feature's value is below `threshold`, else to `above`.
#[derive(Debug, Clone, Copy)]
struct Step {
    /// Start of the feature's plane.
    plane: u32,
    threshold: f32,
    /// Distance from the next node to `above`.
    skip: u32,
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

    /// Predictions in [0, 1] for points 0 .. `out.len()` ≤ stride; the feature in plane p of point i is
    /// `values[p * stride + i]`.
    pub(crate) fn predict(&self, values: &[f32], out: &mut [f32]) {
        out.fill(0.0);
        for ((steps, tree), &depth) in self.trees.iter().zip(self.forest.trees()).zip(&self.depths) {
            for (group, out) in out.chunks_mut(LANES).enumerate() {
                let leaves = walk(steps, depth, values.get(group * LANES..).unwrap_or_default());
                let leaves = leaves.as_flattened();
                out.iter_mut().zip(leaves).for_each(|(out, &leaf)| *out += tree.nodes[leaf as usize].value);
            }
        }
        let count = self.trees.len() as f32;
        out.iter_mut().for_each(|out| *out = (*out / count).clamp(0.0, 1.0));
    }
}

/// Leaves that the points whose features begin `values`, plane by plane, fall into.
#[inline]
fn walk(steps: &[Step], depth: usize, values: &[f32]) -> [[u32; 8]; LANES / 8] {
    let mut at = [[0u32; 8]; LANES / 8];
    // Always as many steps as the deepest leaf needs: asking at each whether all have arrived costs more.
    for _ in 0..depth {
        for (group, at) in at.iter_mut().enumerate() {
            let here = at.map(|at| steps[at as usize]);
            let value = |lane: usize| values.get(here[lane].plane as usize + 8 * group + lane).copied().unwrap_or(0.0);
            let value: [f32; 8] = std::array::from_fn(value);
            // As vectors, because the compiler makes a jump of a scalar comparison, and which way it goes cannot be foreseen.
            let below = f32x8::new(value).simd_lt(f32x8::new(here.map(|s| s.threshold)));
            let skip = (!below & f32x8::new(here.map(|s| f32::from_bits(s.skip)))).to_array();
            *at = std::array::from_fn(|lane| (at[lane] + 1).wrapping_add(skip[lane].to_bits()));
        }
    }
    at
}

fn steps(tree: &Tree, planes: &[Option<usize>], stride: usize) -> Vec<Step> {
    // Leads to one place whatever the value is.
    let always = |here: u32, to: u32| Step { plane: 0, threshold: f32::NEG_INFINITY, skip: to.wrapping_sub(here + 1) };
    let step = |(i, node): (usize, &super::Node)| {
        let here = i as u32;
        if node.feature == LEAF {
            return always(here, here);
        }
        match planes[usize::from(node.feature)] {
            Some(plane) => Step { plane: (plane * stride) as u32, threshold: node.value, skip: node.above - here - 1 },
            None if node.value <= 0.0 => always(here, node.above),
            None => always(here, here + 1),
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
