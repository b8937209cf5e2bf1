//! The state of a chain: rows of primary samples.
//!
//! A state may have many more rows than its path reads. A row is brought up to date when it is read: the small steps that
//! it slept through are made at once, and a large step draws it anew.

use super::settings::Scales;
use super::small_step::SmallStep;
use crate::math::{Row, Stream};
use crate::paths::Rows;
use std::sync::Arc;

#[derive(Clone, Copy, Debug, Default)]
struct Slot {
    row: Row,
    /// Step at which the row was last brought up to date; 0 for one that is to be drawn.
    updated: u64,
}

/// A chain's state, and the proposal that is under way.
#[derive(Clone, Debug)]
pub struct ChainState {
    slots: Vec<Slot>,
    small_step: SmallStep,
    /// How far the numbers of each row move.
    scales: Arc<[Scales]>,
    /// Accepted steps, with the one under way.
    step: u64,
    /// The last accepted large step.
    last_large: u64,
    large: bool,
    /// Slots that the proposal has changed, as they were.
    changed: Vec<(usize, Slot)>,
}

impl ChainState {
    /// A state with a row for each of `scales`, none of which has been drawn: the first proposal is a large step.
    pub fn new(small_step: SmallStep, scales: Arc<[Scales]>) -> Self {
        let slots = vec![Slot::default(); scales.len()];
        Self { slots, small_step, scales, step: 1, last_large: 0, large: true, changed: Vec::new() }
    }

    /// Begins anew.
    pub fn reset(&mut self) {
        self.slots.fill(Slot::default());
        (self.step, self.last_large, self.large) = (1, 0, true);
        self.changed.clear();
    }

    /// Begins a proposal.
    #[inline]
    pub fn propose(&mut self, large: bool) {
        self.step += 1;
        self.large = large;
        self.changed.clear();
    }

    /// Makes the proposal the state.
    #[inline]
    pub fn accept(&mut self) {
        if self.large {
            self.last_large = self.step;
        }
        self.large = false;
        self.changed.clear();
    }

    /// Returns to the state before the proposal.
    #[inline]
    pub fn reject(&mut self) {
        for (index, slot) in self.changed.drain(..).rev() {
            self.slots[index] = slot;
        }
        self.large = false;
        self.step -= 1;
    }

    /// Row `index` of the proposal; of the state, while none is under way.
    #[inline]
    pub fn row(&mut self, index: usize, stream: &mut Stream) -> Row {
        let slot = &mut self.slots[index];
        if slot.updated == self.step {
            return slot.row;
        }
        self.changed.push((index, *slot));
        // Number by number: a copy of the whole waits until each part of it has left the processor's store buffer.
        let [a, b, c, d] = if self.large || slot.updated < self.last_large || slot.updated == 0 {
            stream.row()
        } else {
            self.small_step.moved_row(slot.row, &self.scales[index], self.step - slot.updated, stream)
        };
        *slot = Slot { row: [a, b, c, d], updated: self.step };
        [a, b, c, d]
    }

    /// Row `index` as it was last read or set.
    pub fn last(&self, index: usize) -> Row {
        self.slots[index].row
    }

    /// Makes `row` that of `index`, in the proposal if one is under way.
    pub fn set(&mut self, index: usize, row: Row) {
        self.changed.push((index, self.slots[index]));
        self.slots[index] = Slot { row, updated: self.step };
    }

    /// Has row `index` drawn anew when it is read.
    pub fn forget(&mut self, index: usize) {
        self.changed.push((index, self.slots[index]));
        self.slots[index].updated = 0;
    }

    /// How far numbers move.
    pub fn small_step(&self) -> SmallStep {
        self.small_step
    }

    /// The rows from `first` on, as a subpath reads them; `roulette` says whether its walk may end at random.
    #[inline]
    pub fn rows<'a>(&'a mut self, first: usize, roulette: bool, stream: &'a mut Stream) -> Proposal<'a> {
        Proposal { state: self, first, roulette, stream }
    }
}

/// The rows of a proposal, for one subpath.
pub struct Proposal<'a> {
    state: &'a mut ChainState,
    first: usize,
    roulette: bool,
    stream: &'a mut Stream,
}

impl Rows for Proposal<'_> {
    #[inline]
    fn row(&mut self, index: usize) -> Row {
        self.state.row(self.first + index, self.stream)
    }

    #[inline]
    fn roulette(&self) -> bool {
        self.roulette
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEVIATION: f64 = 0.01;

    fn state(rows: usize) -> ChainState {
        ChainState::new(SmallStep::Gaussian { deviation: DEVIATION }, vec![[1.0, 1.0, 0.0, 1.0]; rows].into())
    }

    #[test]
    fn a_rejected_proposal_leaves_no_trace() {
        let mut stream = Stream::new(1, &[]);
        let mut state = state(4);
        let before: Vec<Row> = (0..4).map(|i| state.row(i, &mut stream)).collect();
        state.accept();
        for large in [false, true, false] {
            state.propose(large);
            assert_ne!(state.row(2, &mut stream), before[2]);
            state.set(1, [0.5; 4]);
            state.forget(1);
            state.reject();
        }
        state.propose(false);
        for (i, row) in before.iter().enumerate() {
            let after = state.row(i, &mut stream);
            let distance = (after[0] - row[0]).abs();
            assert!(distance.min(1.0 - distance) < 6.0 * DEVIATION, "row {i} is more than one small step away");
            assert!(after[2] == row[2] && after[3] != row[3], "numbers move as far as they are told to");
        }
    }

    /// A row that slept through small steps catches up with them; one that slept through a large step, or that was
    /// forgotten, is drawn anew.
    #[test]
    fn sleeping_rows_catch_up() {
        let mut stream = Stream::new(3, &[]);
        let (mut squares, trials, n) = ([0.0; 3], 4000, 25);
        for _ in 0..trials {
            let mut state = state(4);
            let start = [0, 1, 2].map(|index| state.row(index, &mut stream)[1]);
            state.accept();
            for _ in 0..n {
                state.propose(false);
                state.row(3, &mut stream);
                state.accept();
            }
            state.forget(1);
            state.propose(false);
            let distance = |a: f64, b: f64| (a - b).abs().min(1.0 - (a - b).abs()).powi(2);
            squares[0] += distance(state.row(0, &mut stream)[1], start[0]);
            squares[1] += distance(state.row(1, &mut stream)[1], start[1]);
            state.reject();
            state.propose(true);
            state.accept();
            squares[2] += distance(state.row(2, &mut stream)[1], start[2]);
        }
        // Distances of independent numbers on a circle have a mean square of 1/12.
        let expected = [f64::from(n + 1) * DEVIATION * DEVIATION, 1.0 / 12.0, 1.0 / 12.0];
        for (sum, expected) in squares.into_iter().zip(expected) {
            let variance = sum / f64::from(trials);
            // The standard error of a variance is at most √(2/n) of it.
            assert!(
                (variance / expected - 1.0).abs() < 4.5 * (2.0 / f64::from(trials)).sqrt(),
                "{variance} {expected}"
            );
        }
    }
}
