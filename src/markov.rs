//! The state of a Markov chain in primary sample space and its mutations: small steps and large steps (Kelemen et al.
//! 2002).
//!
//! A state has many more rows than any of its paths reads. A row is brought up to date when it is read: n small steps
//! that it slept through are one normal step with √n times the deviation, and a large step draws it anew.

use crate::math::{Row, Stream};
use crate::paths::Rows;
use std::f64::consts::TAU;

/// Standard deviation of a small step.
pub const SMALL_STEP: f64 = 0.01;

/// Probability of a large step.
pub const LARGE_STEP_PROBABILITY: f64 = 0.3;

#[derive(Clone, Copy, Debug, Default)]
struct Slot {
    row: Row,
    /// Step at which the row was last brought up to date.
    updated: u64,
}

/// A chain's state: rows of primary samples, and the proposal that is under way.
#[derive(Clone, Debug)]
pub struct ChainState {
    slots: Vec<Slot>,
    /// Accepted steps, with the one under way.
    step: u64,
    /// The last accepted large step.
    last_large: u64,
    large: bool,
    /// Slots that the proposal has changed, as they were.
    changed: Vec<(usize, Slot)>,
}

impl ChainState {
    /// A state of `rows` rows, none of which has been drawn: the first proposal is a large step.
    pub fn new(rows: usize) -> Self {
        Self { slots: vec![Slot::default(); rows], step: 1, last_large: 0, large: true, changed: Vec::new() }
    }

    /// Begins a proposal.
    pub fn propose(&mut self, large: bool) {
        self.step += 1;
        self.large = large;
        self.changed.clear();
    }

    /// Makes the proposal the state.
    pub fn accept(&mut self) {
        if self.large {
            self.last_large = self.step;
        }
        self.changed.clear();
    }

    /// Returns to the state before the proposal.
    pub fn reject(&mut self) {
        for (index, slot) in self.changed.drain(..) {
            self.slots[index] = slot;
        }
        self.step -= 1;
    }

    /// The proposal's row `index`.
    #[inline]
    pub fn row(&mut self, index: usize, stream: &mut Stream) -> Row {
        let slot = &mut self.slots[index];
        if slot.updated < self.step {
            self.changed.push((index, *slot));
            if self.large {
                slot.row = stream.row();
            } else {
                if slot.updated < self.last_large {
                    slot.row = stream.row();
                    slot.updated = self.last_large;
                }
                let deviation = SMALL_STEP * ((self.step - slot.updated) as f64).sqrt();
                slot.row = small_step(slot.row, deviation, stream);
            }
            slot.updated = self.step;
        }
        slot.row
    }

    /// The rows from `first` on, as a subpath reads them.
    pub fn rows<'a>(&'a mut self, first: usize, stream: &'a mut Stream) -> Proposal<'a> {
        Proposal { state: self, first, stream }
    }
}

/// Each number moved by a normal step, around the circle.
#[inline]
fn small_step(row: Row, deviation: f64, stream: &mut Stream) -> Row {
    let [a, b, c, d] = stream.row();
    let (x, y) = normal_pair(a, b);
    let (z, w) = normal_pair(c, d);
    let wrap = |v: f64| {
        let v = v - v.floor();
        if v < 1.0 { v } else { 0.0 }
    };
    [
        wrap(row[0] + deviation * x),
        wrap(row[1] + deviation * y),
        wrap(row[2] + deviation * z),
        wrap(row[3] + deviation * w),
    ]
}

/// Two independent standard normal numbers from two uniform ones (Box and Muller 1958).
#[inline]
fn normal_pair(a: f64, b: f64) -> (f64, f64) {
    let radius = (-2.0 * (1.0 - a).ln()).sqrt();
    let (sin, cos) = (TAU * b).sin_cos();
    (radius * cos, radius * sin)
}

/// The rows of a proposal, for one subpath.
pub struct Proposal<'a> {
    state: &'a mut ChainState,
    first: usize,
    stream: &'a mut Stream,
}

impl Rows for Proposal<'_> {
    #[inline]
    fn row(&mut self, index: usize) -> Row {
        self.state.row(self.first + index, self.stream)
    }

    #[inline]
    fn roulette(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rejected_proposal_leaves_no_trace() {
        let mut stream = Stream::new(1, &[]);
        let mut state = ChainState::new(4);
        let before: Vec<Row> = (0..4).map(|i| state.row(i, &mut stream)).collect();
        state.accept();
        for large in [false, true, false] {
            state.propose(large);
            assert_ne!(state.row(2, &mut stream), before[2]);
            state.reject();
        }
        state.propose(false);
        for (i, row) in before.iter().enumerate() {
            let distance = (state.row(i, &mut stream)[0] - row[0]).abs();
            assert!(distance.min(1.0 - distance) < 6.0 * SMALL_STEP, "row {i} is more than one small step away");
        }
    }

    /// The stationary distribution of the rows, with everything accepted, is uniform, and a row that slept through
    /// n small steps has moved with variance n σ².
    #[test]
    fn sleeping_rows_catch_up() {
        let mut stream = Stream::new(3, &[]);
        let (mut squares, trials, n) = (0.0, 4000, 25);
        for _ in 0..trials {
            let mut state = ChainState::new(2);
            let start = state.row(0, &mut stream)[1];
            state.accept();
            for _ in 0..n {
                state.propose(false);
                state.row(1, &mut stream);
                state.accept();
            }
            state.propose(false);
            let distance = (state.row(0, &mut stream)[1] - start).abs();
            squares += distance.min(1.0 - distance).powi(2);
        }
        let variance = squares / f64::from(trials);
        let expected = f64::from(n + 1) * SMALL_STEP * SMALL_STEP;
        // The standard error of a variance is √(2/n) of it.
        assert!((variance / expected - 1.0).abs() < 4.5 * (2.0 / f64::from(trials)).sqrt(), "{variance} {expected}");
    }
}
