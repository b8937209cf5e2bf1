//! Refinement: leaf values from rows that did not grow the tree (Otsu thesis, section 5.4.3, eq. 5.15).

use super::Rows;
use super::tree::{LEAF, Tree};

/// Replaces each leaf's value by the weighted mean target of the rows in `indices` that fall into it, kept within [0, 1].
///
/// A leaf that no such row (of positive weight) reaches keeps the value it was grown with: that is the mean over the rows
/// that made it, overfitted perhaps but the only evidence there is.
pub(super) fn refine(tree: &mut Tree, rows: &Rows, indices: &[u32]) {
    let mut sums = vec![(0.0f64, 0.0f64); tree.nodes.len()];
    for &i in indices {
        let row = i as usize;
        let weight = f64::from(rows.weights()[row]);
        let (sum, total) = &mut sums[tree.leaf_of(|f| rows.value(row, f))];
        *sum += weight * f64::from(rows.targets()[row]);
        *total += weight;
    }
    for (node, (sum, total)) in tree.nodes.iter_mut().zip(sums) {
        if node.feature == LEAF && total > 0.0 {
            node.value = (sum / total).clamp(0.0, 1.0) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::super::tree::Node;
    use super::*;

    #[test]
    fn leaves_become_weighted_means_and_unreached_ones_stay() {
        let mut rows = Rows::new();
        let x = rows.feature("x").unwrap();
        for (value, target, weight) in [(0.1, 0.2, 1.0), (0.2, 0.8, 3.0), (0.7, 0.9, 0.0), (0.6, 1.0, 5.0)] {
            rows.push(&[(x, value)], target, weight, 0).unwrap();
        }
        let leaf = |value| Node { feature: LEAF, value, above: 0 };
        let split = |value, above| Node { feature: 0, value, above };
        let mut tree = Tree { nodes: vec![split(0.5, 2), leaf(0.0), split(0.9, 4), leaf(0.3), leaf(0.4)] };
        refine(&mut tree, &rows, &[0, 1, 2]);
        let values: Vec<f32> = tree.nodes.iter().map(|n| n.value).collect();
        // (1·0.2 + 3·0.8) / 4 = 0.65; the row at 0.7 weighs nothing, the one at 0.6 was not given.
        for (found, expected) in values.into_iter().zip([0.5, 0.65, 0.9, 0.3, 0.4]) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
    }
}
