//! Training rows: sparse features, a target, a weight and the group (scene) the row came from.
//!
//! Most path features of a pixel are zero, so rows are stored compressed (CSR): an absent feature is 0.

use std::collections::{BTreeMap, HashMap};

use super::ForestError;

/// Most features that rows can have (columns are `u16`, and one value is kept free to mark leaves).
pub const MAX_FEATURES: usize = u16::MAX as usize;

/// A table of training rows.
///
/// Features are interned by name with [`Rows::feature`]; a row that was pushed before a feature was known has the
/// value 0 for it, so tables may grow new features at any time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Rows {
    features: Vec<String>,
    index: HashMap<String, u16>,
    /// End of each row's entries in `columns` and `values`.
    ends: Vec<usize>,
    columns: Vec<u16>,
    values: Vec<f32>,
    targets: Vec<f32>,
    weights: Vec<f32>,
    groups: Vec<u32>,
}

/// How [`Rows::split`] draws the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SplitBy {
    /// Each row for itself.
    Rows,
    /// Whole groups stay together.
    Groups,
}

impl Rows {
    /// An empty table without features.
    pub fn new() -> Self {
        Self::default()
    }

    /// The column of the feature called `name`, added if it is new.
    ///
    /// # Errors
    /// [`ForestError::Feature`] if the name is empty or the table already has [`MAX_FEATURES`].
    pub fn feature(&mut self, name: &str) -> Result<u16, ForestError> {
        if let Some(&column) = self.index.get(name) {
            return Ok(column);
        }
        let wrong = |what| ForestError::Feature { name: name.to_owned(), what };
        if name.is_empty() {
            return Err(wrong("a feature needs a name"));
        }
        let column = u16::try_from(self.features.len()).ok().filter(|&c| c < u16::MAX);
        let column = column.ok_or_else(|| wrong("too many features (at most 65535)"))?;
        self.features.push(name.to_owned());
        self.index.insert(name.to_owned(), column);
        Ok(column)
    }

    /// Appends one row.
    ///
    /// `entries` are (column, value), in any order, each column at most once, values finite; zeros need not be given.
    /// `target` is the number to learn, finite; the forest's answer lies in [0, 1], targets may lie outside.
    /// `weight` ≥ 0 says how many rows this one counts for; rows of weight 0 are kept but teach nothing.
    ///
    /// # Errors
    /// [`ForestError::Row`] if any of this does not hold; the table is then unchanged.
    pub fn push(&mut self, entries: &[(u16, f32)], target: f32, weight: f32, group: u32) -> Result<(), ForestError> {
        let row = self.len();
        let wrong = |what: String, expected| Err(ForestError::Row { row, what, expected });
        if row >= u32::MAX as usize {
            return wrong("too many rows".into(), "fewer than 4294967295");
        }
        if !target.is_finite() {
            return wrong(format!("target {target}"), "a finite number");
        }
        if !(weight.is_finite() && weight >= 0.0) {
            return wrong(format!("weight {weight}"), "a finite number, 0 or more");
        }
        let mut sorted = entries.to_vec();
        sorted.sort_unstable_by_key(|e| e.0);
        for (i, &(column, value)) in sorted.iter().enumerate() {
            let Some(name) = self.features.get(usize::from(column)) else {
                return wrong(format!("column {column}"), "the column of a known feature");
            };
            if !value.is_finite() {
                return wrong(format!("feature {name} is {value}"), "a finite number");
            }
            if i > 0 && sorted[i - 1].0 == column {
                return wrong(format!("feature {name} twice"), "each feature once");
            }
        }
        sorted.retain(|e| e.1 != 0.0);
        let start = self.columns.len();
        self.columns.extend(sorted.iter().map(|e| e.0));
        self.values.extend(sorted.iter().map(|e| e.1));
        self.ends.push(start + sorted.len());
        self.targets.push(target);
        self.weights.push(weight);
        self.groups.push(group);
        Ok(())
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// Names of the features, by column.
    pub fn features(&self) -> &[String] {
        &self.features
    }

    /// The non-zero entries of a row: columns (ascending) and their values.
    pub fn entries(&self, row: usize) -> (&[u16], &[f32]) {
        let start = if row == 0 { 0 } else { self.ends[row - 1] };
        let range = start..self.ends[row];
        (&self.columns[range.clone()], &self.values[range])
    }

    /// Value of one feature of one row; 0 where none was given.
    pub fn value(&self, row: usize, column: u16) -> f32 {
        let (columns, values) = self.entries(row);
        columns.binary_search(&column).map_or(0.0, |i| values[i])
    }

    /// All targets, by row.
    pub fn targets(&self) -> &[f32] {
        &self.targets
    }

    /// All weights, by row.
    pub fn weights(&self) -> &[f32] {
        &self.weights
    }

    /// All groups, by row.
    pub fn groups(&self) -> &[u32] {
        &self.groups
    }

    /// The rows at `indices`, in that order, with the same features.
    pub fn select(&self, indices: &[u32]) -> Rows {
        let mut rows = Rows { features: self.features.clone(), index: self.index.clone(), ..Rows::default() };
        for &i in indices {
            let i = i as usize;
            let (columns, values) = self.entries(i);
            rows.columns.extend_from_slice(columns);
            rows.values.extend_from_slice(values);
            rows.ends.push(rows.columns.len());
            rows.targets.push(self.targets[i]);
            rows.weights.push(self.weights[i]);
            rows.groups.push(self.groups[i]);
        }
        rows
    }

    /// The rows whose group satisfies `keep`.
    pub fn subset(&self, keep: impl Fn(u32) -> bool) -> Rows {
        let indices: Vec<u32> = (0..self.len() as u32).filter(|&i| keep(self.groups[i as usize])).collect();
        self.select(&indices)
    }

    /// Two disjoint lists of row indices that together name every row; the first has about `fraction` of them.
    ///
    /// Which side a row (or group) falls on depends on `seed` and its number alone. With [`SplitBy::Groups`] and at
    /// least two groups, neither side is empty.
    pub fn split(&self, fraction: f64, by: SplitBy, seed: u64) -> (Vec<u32>, Vec<u32>) {
        let all = 0..self.len() as u32;
        match by {
            SplitBy::Rows => all.partition(|&i| uniform(seed, i) < fraction),
            SplitBy::Groups => {
                let mut groups: Vec<u32> = self.groups.clone();
                groups.sort_unstable();
                groups.dedup();
                let count = groups.len();
                groups.sort_by(|&a, &b| uniform(seed, a).total_cmp(&uniform(seed, b)));
                let wanted = (fraction * count as f64).round() as usize;
                groups.truncate(wanted.clamp(1, count.saturating_sub(1).max(1)));
                all.partition(|&i| groups.contains(&self.groups[i as usize]))
            }
        }
    }

    /// Replaces every (target, weight) by what `f` makes of it.
    ///
    /// # Errors
    /// [`ForestError::Row`] if `f` gives a target that is not finite or a weight that is not finite and ≥ 0.
    pub fn map_outcomes(mut self, f: impl Fn(f32, f32) -> (f32, f32)) -> Result<Rows, ForestError> {
        for row in 0..self.len() {
            let (target, weight) = f(self.targets[row], self.weights[row]);
            if !(target.is_finite() && weight.is_finite() && weight >= 0.0) {
                let what = format!("target {target}, weight {weight}");
                return Err(ForestError::Row { row, what, expected: "finite numbers, the weight 0 or more" });
            }
            self.targets[row] = target;
            self.weights[row] = weight;
        }
        Ok(self)
    }

    /// Scales the weights so that every group has the same total, and the mean weight is 1.
    ///
    /// Groups whose weights are all 0 stay so. Without this a scene with more pixels, brighter light or more
    /// noise would outvote the others, and the judge is an unseen scene.
    pub fn balance_groups(mut self) -> Rows {
        let mut totals: BTreeMap<u32, f64> = BTreeMap::new();
        for (&group, &weight) in self.groups.iter().zip(&self.weights) {
            *totals.entry(group).or_default() += f64::from(weight);
        }
        totals.retain(|_, total| *total > 0.0);
        let share = self.len() as f64 / totals.len().max(1) as f64;
        for (group, weight) in self.groups.iter().zip(&mut self.weights) {
            if let Some(total) = totals.get(group) {
                *weight = (f64::from(*weight) / total * share) as f32;
            }
        }
        self
    }

    /// BLAKE3 hash over everything in the table, in hexadecimal: equal tables, equal hash, on any machine.
    pub fn hash(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&(self.features.len() as u64).to_le_bytes());
        for name in &self.features {
            hasher.update(&(name.len() as u64).to_le_bytes());
            hasher.update(name.as_bytes());
        }
        for row in 0..self.len() {
            let (columns, values) = self.entries(row);
            hasher.update(&(columns.len() as u64).to_le_bytes());
            for (column, value) in columns.iter().zip(values) {
                hasher.update(&column.to_le_bytes());
                hasher.update(&value.to_le_bytes());
            }
            hasher.update(&self.targets[row].to_le_bytes());
            hasher.update(&self.weights[row].to_le_bytes());
            hasher.update(&self.groups[row].to_le_bytes());
        }
        hasher.finalize().to_hex().to_string()
    }
}

/// A number in [0, 1) that depends on `seed` and `key` alone (SplitMix64's finaliser; Steele et al. 2014).
fn uniform(seed: u64, key: u32) -> f64 {
    let mut z = seed ^ (u64::from(key) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^= z >> 31;
    (z >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;

    fn table(n: u32) -> Rows {
        let mut rows = Rows::new();
        let (x, y) = (rows.feature("x").unwrap(), rows.feature("y").unwrap());
        for i in 0..n {
            rows.push(&[(y, i as f32), (x, 1.0)], 0.5, 1.0 + i as f32, i % 3).unwrap();
        }
        rows
    }

    #[test]
    fn entries_come_back_sorted_and_without_zeros() {
        let rows = table(3);
        assert_eq!(rows.entries(0), (&[0u16][..], &[1.0f32][..]));
        assert_eq!(rows.entries(2), (&[0u16, 1][..], &[1.0f32, 2.0][..]));
        assert_eq!((rows.value(2, 1), rows.value(0, 1)), (2.0, 0.0));
    }

    #[test]
    fn bad_rows_are_refused_and_leave_no_trace() {
        let mut rows = table(2);
        let before = rows.clone();
        for (entries, target, weight) in [
            (&[(0u16, f32::NAN)][..], 0.5, 1.0),
            (&[(7, 1.0)][..], 0.5, 1.0),
            (&[(0, 1.0), (0, 2.0)][..], 0.5, 1.0),
            (&[][..], f32::INFINITY, 1.0),
            (&[][..], 0.5, -1.0),
            (&[][..], 0.5, f32::NAN),
        ] {
            assert!(rows.push(entries, target, weight, 0).is_err());
        }
        assert_eq!(rows, before);
        assert!(rows.feature("").is_err());
    }

    #[test]
    fn split_is_a_partition_that_the_seed_decides() {
        let rows = table(1000);
        for by in [SplitBy::Rows, SplitBy::Groups] {
            let (a, b) = rows.split(0.4, by, 7);
            assert_eq!((a.clone(), b.clone()), rows.split(0.4, by, 7));
            assert_ne!(a, rows.split(0.4, SplitBy::Rows, 8).0);
            let mut both = [a.clone(), b.clone()].concat();
            both.sort_unstable();
            assert_eq!(both, (0..1000).collect::<Vec<u32>>());
            assert!((250..550).contains(&a.len()), "{}", a.len());
        }
        let (a, b) = rows.split(0.4, SplitBy::Groups, 7);
        let group = |i: &u32| rows.groups()[*i as usize];
        assert!(a.iter().all(|i| b.iter().all(|j| group(i) != group(j))));
    }

    #[test]
    fn subset_and_balance() {
        let rows = table(30);
        let only = rows.subset(|g| g == 1);
        assert_eq!(only.len(), 10);
        assert!(only.groups().iter().all(|&g| g == 1));
        let even = rows.balance_groups();
        for group in 0..3 {
            let total: f32 = even.subset(|g| g == group).weights().iter().sum();
            assert!((total - 10.0).abs() < 1e-4, "{total}");
        }
    }

    #[test]
    fn the_hash_sees_every_change() {
        let rows = table(10);
        assert_eq!(rows.hash(), table(10).hash());
        let mut named = rows.clone();
        named.feature("z").unwrap();
        let weighted = rows.clone().map_outcomes(|t, w| (t, w + 1.0)).unwrap();
        let shorter = rows.select(&(0..9).collect::<Vec<_>>());
        let hashes = [rows.hash(), named.hash(), weighted.hash(), shorter.hash()];
        for i in 0..4 {
            for j in 0..i {
                assert_ne!(hashes[i], hashes[j]);
            }
        }
    }
}
