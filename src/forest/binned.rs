//! Features as small integers: at most [`BINS`] quantile bins per feature, zero in a bin of its own.
//!
//! Splits are searched over histograms of bins, so one pass over the non-zero entries of a node's rows finds its best
//! split (Ke et al. 2017, LightGBM, section 2.1; Chen and Guestrin 2016, XGBoost, section 3.3).

use rayon::prelude::*;

use super::Rows;

/// Most bins per feature.
pub(super) const BINS: usize = 64;

/// The rows' features as histogram slots, and what the slots mean.
#[derive(Debug)]
pub(super) struct Binned {
    /// Per feature the thresholds θ between bins, ascending: a value lies in bin (number of θ ≤ value).
    pub(super) cuts: Vec<Vec<f32>>,
    /// Per feature the bin that zero, and so every absent entry, falls into.
    pub(super) zero: Vec<u8>,
    /// End of each row's entries in `slots`.
    ends: Vec<usize>,
    /// feature · [`BINS`] + bin of each non-zero entry, ascending within a row.
    slots: Vec<u32>,
}

impl Binned {
    /// Bins the features of `rows`; cuts are chosen from the entries of the rows with positive weight. Of more than
    /// `max_features` features, those with the smallest weighted mean get no cuts.
    pub(super) fn of(rows: &Rows, max_features: usize) -> Self {
        let mut values: Vec<Vec<f32>> = vec![Vec::new(); rows.features().len()];
        let mut sums = vec![0.0f64; values.len()];
        for row in (0..rows.len()).filter(|&r| rows.weights()[r] > 0.0) {
            let (columns, numbers) = rows.entries(row);
            for (&c, &v) in columns.iter().zip(numbers) {
                values[usize::from(c)].push(v);
                sums[usize::from(c)] += f64::from(rows.weights()[row]) * f64::from(v.abs());
            }
        }
        let mut order: Vec<usize> = (0..sums.len()).collect();
        order.sort_by(|&x, &y| sums[y].total_cmp(&sums[x]));
        order.into_iter().skip(max_features).for_each(|feature| values[feature].clear());
        let cuts: Vec<Vec<f32>> = values.into_par_iter().map(cuts).collect();
        let zero = cuts.iter().map(|c| bin(c, 0.0)).collect();
        let (mut ends, mut slots) = (Vec::with_capacity(rows.len()), Vec::new());
        for row in 0..rows.len() {
            let (columns, numbers) = rows.entries(row);
            let slot = |(&c, &v): (&u16, &f32)| u32::from(c) * BINS as u32 + u32::from(bin(&cuts[usize::from(c)], v));
            slots.extend(columns.iter().zip(numbers).map(slot));
            ends.push(slots.len());
        }
        Self { cuts, zero, ends, slots }
    }

    /// Slots of a row's non-zero entries.
    #[inline]
    pub(super) fn slots(&self, row: u32) -> &[u32] {
        let row = row as usize;
        let start = if row == 0 { 0 } else { self.ends[row - 1] };
        &self.slots[start..self.ends[row]]
    }

    /// Bin of one feature of one row.
    #[inline]
    pub(super) fn bin(&self, row: u32, feature: u16) -> u8 {
        let first = u32::from(feature) * BINS as u32;
        let slots = self.slots(row);
        match slots.get(slots.partition_point(|&s| s < first)) {
            Some(&slot) if slot < first + BINS as u32 => (slot - first) as u8,
            _ => self.zero[usize::from(feature)],
        }
    }
}

/// Bin of a value: the number of cuts at or below it.
fn bin(cuts: &[f32], value: f32) -> u8 {
    cuts.partition_point(|&c| c <= value) as u8
}

/// Thresholds for the non-zero `values` of a feature: its quantiles, and one on either side of zero where needed.
fn cuts(mut values: Vec<f32>) -> Vec<f32> {
    values.sort_unstable_by(f32::total_cmp);
    let mut cuts = Vec::with_capacity(BINS);
    let negative = values.partition_point(|&v| v < 0.0);
    if negative > 0 {
        cuts.push(short(values[negative - 1] / 2.0));
    }
    if let Some(&positive) = values.get(negative) {
        let half = short(positive / 2.0);
        cuts.push(if half > 0.0 { half } else { positive });
    }
    // Two bins are kept for zero and its neighbour, so the quantiles get the rest.
    let quantiles = BINS - 3;
    for q in 1..quantiles {
        let below = values[..].get((values.len() * q / quantiles).saturating_sub(1)).copied().unwrap_or(0.0);
        let next = values.partition_point(|&v| v <= below);
        if let Some(&above) = values.get(next).filter(|_| next != negative) {
            cuts.push(short(below + (above - below) / 2.0));
        }
    }
    cuts.retain(|c| c.is_finite());
    cuts.sort_unstable_by(f32::total_cmp);
    cuts.dedup();
    cuts
}

/// The number with four significant decimal digits: thresholds go into the model file as text, and the trees must be
/// grown with the very numbers that the file will hold.
fn short(value: f32) -> f32 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn few_distinct_values_each_get_a_bin() {
        let values: Vec<f32> = (0..3000).map(|i| (i % 10) as f32 / 10.0 - 0.45).collect();
        let cuts = cuts(values.clone());
        let mut bins: Vec<u8> = values.iter().map(|&v| bin(&cuts, v)).collect();
        bins.push(bin(&cuts, 0.0));
        bins.sort_unstable();
        bins.dedup();
        assert_eq!(bins.len(), 11);
    }

    proptest! {
        #[test]
        fn bins_keep_order_and_zero_is_alone(values in prop::collection::vec(
            prop_oneof![-1e30f32..1e30, -1f32..1.0, Just(1e-45f32), Just(f32::MAX), Just(f32::MIN)], 1..300)) {
            let values: Vec<f32> = values.into_iter().filter(|v| *v != 0.0).collect();
            let cuts = cuts(values.clone());
            prop_assert!(cuts.len() < BINS);
            prop_assert!(cuts.windows(2).all(|w| w[0] < w[1]));
            for &v in &values {
                prop_assert!((bin(&cuts, v) > bin(&cuts, 0.0)) == (v > 0.0));
                prop_assert!((bin(&cuts, v) < bin(&cuts, 0.0)) == (v < 0.0));
            }
        }

        #[test]
        fn sparse_lookup_finds_every_bin(table in prop::collection::vec(prop::collection::vec(-2i8..3, 4), 1..50)) {
            let mut rows = Rows::new();
            for name in ["a", "b", "c", "d"] { rows.feature(name).unwrap(); }
            for line in &table {
                let entries: Vec<(u16, f32)> = line.iter().enumerate().map(|(c, &v)| (c as u16, f32::from(v))).collect();
                rows.push(&entries, 0.5, 1.0, 0).unwrap();
            }
            let binned = Binned::of(&rows, 100);
            for (r, line) in table.iter().enumerate() {
                for (c, &v) in line.iter().enumerate() {
                    prop_assert_eq!(binned.bin(r as u32, c as u16), bin(&binned.cuts[c], f32::from(v)));
                }
            }
        }
    }
}
