//! One chain, and what it counts.

use crate::markov::ChainState;
use crate::math::Stream;
use crate::path_space::Kind;
use crate::paths::{Found, FullPath};
use std::collections::BTreeMap;

/// The mutations in primary sample space; those in path space come after them.
pub(super) const PRIMARY: [&str; 3] = ["large_step", "small_step", "technique_change"];
pub(super) const LARGE: usize = 0;
pub(super) const SMALL: usize = 1;
pub(super) const CHANGE: usize = 2;
/// How many kinds of mutations there are.
pub(super) const KINDS: usize = PRIMARY.len() + Kind::ALL.len();

/// Names of all kinds, in the order of their tallies.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    PRIMARY.into_iter().chain(Kind::ALL.map(Kind::name))
}

/// One chain.
#[derive(Clone)]
pub(super) struct Chain {
    pub state: ChainState,
    pub stream: Stream,
    pub current: Found,
    /// How often the current path has been counted and not yet been splatted.
    pub weight: f64,
    /// The path of `current`, as the technique that it came by has found it.
    pub path: FullPath,
    /// What the path would be worth if it were drawn as independent ones are, by their ways, once that has been asked: its
    /// rounds are a part of the chain's state.
    pub drawn: [Option<f64>; 2],
    /// By kind, proposals and accepted ones. Technique changes of `mmlt` are among its small steps too.
    pub tallies: [[u64; 2]; KINDS],
    /// Jumps for which no rows could be found.
    pub failed: u64,
    /// Mutations in path space that came to nothing, by cause.
    pub rejections: BTreeMap<&'static str, u64>,
}

impl Chain {
    pub(super) fn new(state: ChainState, stream: Stream, current: Found, path: FullPath) -> Self {
        let (tallies, rejections) = (Default::default(), BTreeMap::new());
        Self { state, stream, current, weight: 0.0, path, drawn: [None; 2], tallies, failed: 0, rejections }
    }

    /// Counts a mutation in path space that came to nothing.
    pub(super) fn reject(&mut self, cause: &'static str) {
        *self.rejections.entry(cause).or_default() += 1;
    }

    pub(super) fn tally(&mut self, kind: usize, accepted: bool) {
        let [proposals, successes] = &mut self.tallies[kind];
        *proposals += 1;
        *successes += u64::from(accepted);
    }
}
