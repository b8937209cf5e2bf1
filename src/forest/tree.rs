//! A regression tree, a forest of them, and prediction (Otsu thesis, section 5.4.2, eq. 5.14).

use rayon::prelude::*;

use super::Rows;

/// Most splits between a tree's root and any leaf, grown or loaded.
pub const MAX_DEPTH: usize = 64;

/// Most nodes of a tree, grown or loaded: half a megabyte, and what two bytes can number.
pub const MAX_NODES: usize = u16::MAX as usize;

/// `Node::feature` of a leaf.
pub const LEAF: u16 = u16::MAX;

/// One node of a [`Tree`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node {
    /// Column of the feature that is asked for; [`LEAF`] at a leaf.
    pub feature: u16,
    /// Threshold θ of a split, or the answer of a leaf.
    pub value: f32,
    /// Index of the child for feature ≥ θ (thesis eq. 5.12); the child for feature < θ is the next node.
    pub above: u32,
}

/// A binary regression tree in preorder: a split's first child follows it directly.
///
/// Invariant (kept by the constructors of this room): every split has both children further back in the list, every
/// node but the first is the child of exactly one split, leaf values lie in [0, 1].
#[derive(Debug, Clone, PartialEq)]
pub struct Tree {
    pub(super) nodes: Vec<Node>,
}

impl Tree {
    /// The nodes in preorder; at least one.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Number of leaves.
    pub fn leaves(&self) -> usize {
        self.nodes.iter().filter(|n| n.feature == LEAF).count()
    }

    /// Number of splits on the longest way down, at most [`MAX_DEPTH`]; 0 for a lone leaf.
    pub fn depth(&self) -> usize {
        let mut depths = vec![0usize; self.nodes.len()];
        for (i, node) in self.nodes.iter().enumerate().filter(|(_, n)| n.feature != LEAF) {
            depths[i + 1] = depths[i] + 1;
            depths[node.above as usize] = depths[i] + 1;
        }
        depths.into_iter().max().unwrap_or(0)
    }

    /// Index of the leaf that a row with these feature values falls into.
    #[inline]
    pub fn leaf_of(&self, value: impl Fn(u16) -> f32) -> usize {
        let mut i = 0;
        loop {
            let node = self.nodes[i];
            if node.feature == LEAF {
                return i;
            }
            i = if value(node.feature) < node.value { i + 1 } else { node.above as usize };
        }
    }
}

/// Trees whose mean answer is the prediction, with the names of the features they ask for.
#[derive(Debug, Clone, PartialEq)]
pub struct Forest {
    pub(super) features: Vec<String>,
    pub(super) trees: Vec<Tree>,
}

impl Forest {
    /// Names of the features, by column.
    pub fn features(&self) -> &[String] {
        &self.features
    }

    /// The trees; at least one.
    pub fn trees(&self) -> &[Tree] {
        &self.trees
    }

    /// Columns of the features that some split asks for, ascending.
    pub fn used_features(&self) -> Vec<u16> {
        let nodes = self.trees.iter().flat_map(|t| &t.nodes);
        let mut used: Vec<u16> = nodes.map(|n| n.feature).filter(|&f| f != LEAF).collect();
        used.sort_unstable();
        used.dedup();
        used
    }

    /// Mean answer of the trees, in [0, 1], for features given by column.
    #[inline]
    pub fn predict_with(&self, value: impl Fn(u16) -> f32) -> f32 {
        let sum: f32 = self.trees.iter().map(|t| t.nodes[t.leaf_of(&value)].value).sum();
        (sum / self.trees.len() as f32).clamp(0.0, 1.0)
    }

    /// Predictions for all rows, whose features are matched by name; features that the rows lack are 0.
    pub fn predict(&self, rows: &Rows) -> Vec<f32> {
        let column = |name| rows.features().iter().position(|f| f == name);
        let columns: Vec<Option<usize>> = self.features.iter().map(column).collect();
        let dense = |row: usize| {
            let mut values = vec![0.0f32; rows.features().len()];
            let (entries, numbers) = rows.entries(row);
            entries.iter().zip(numbers).for_each(|(&c, &v)| values[usize::from(c)] = v);
            values
        };
        let one = |row| {
            let values = dense(row);
            self.predict_with(|f| columns[usize::from(f)].map_or(0.0, |c| values[c]))
        };
        (0..rows.len()).into_par_iter().map(one).collect()
    }
}
