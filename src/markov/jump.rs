//! The reversible jump: another technique for the same path (Bitterli et al. 2017, sections 4 to 6; Bitterli 2015, section
//! 5.2.1).
//!
//! From (i, u) to (j, v) with S_j(v) = S_i(u) = x. Technique j is drawn with the probability w_j(x), whatever i is. The
//! Jacobian of the jump is p_j / p_i, since rows are inverted with the density of their walk, and with C_i = w_i f / p_i
//! the acceptance is
//!
//! ```text
//! C_j w_i p_j / (C_i w_j p_i) = (w_j f / p_j) w_i p_j / ((w_i f / p_i) w_j p_i) = 1.
//! ```
//!
//! No ray is cast: the new target follows from the old one by the ratio of the densities. Rows of vertices that change
//! hands are inverted; what the path does not tell of them, lobes and unused numbers, is drawn. To take a fixed point of
//! its interval instead would be a mistake. Rows that are no longer read are forgotten: a jump back sets them before they
//! are read again, but large steps that try all techniques read them, and must find them free of the path.

use super::state::ChainState;
use super::tracer::Tracer;
use crate::math::{Row, Stream, pick};
use crate::paths::{Found, FullPath, Heuristic, TECHNIQUES};
use crate::scene::Scene;

/// How a jump has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Jump {
    /// The same technique was drawn.
    Stayed,
    /// The technique has changed.
    Moved,
    /// The new technique's rows could not be found, by rounding.
    Failed,
}

/// Has the state jump to a technique drawn by the weights. `found` is what `path` is now, `memory` is any.
pub fn jump(
    scene: &Scene,
    path: &FullPath,
    found: &mut Found,
    state: &mut ChainState,
    stream: &mut Stream,
    memory: &mut JumpMemory,
) -> Jump {
    let heuristic = TECHNIQUES.heuristic.unwrap_or(Heuristic::Power);
    let JumpMemory { densities, rows } = memory;
    path.densities(densities);
    let from = found.technique;
    let weights = densities.iter().map(|density| heuristic.apply(*density));
    let to = pick(weights, stream.number()).unwrap_or(from);
    if to == from {
        return Jump::Stayed;
    }
    rows.clear();
    if invert(scene, path, from, to, stream, rows).is_none() {
        return Jump::Failed;
    }
    forget(path, from, to, state, stream);
    rows.iter().for_each(|(index, row)| state.set(*index, *row));
    // What a technique contributes is its weight over its density.
    let share = |technique: usize| heuristic.apply(densities[technique]) / densities[technique];
    let factor = share(to) / share(from);
    *found = Found { value: found.value * factor, luminance: found.luminance * factor, technique: to, ..*found };
    Jump::Moved
}

/// Memory that jumps share.
#[derive(Debug, Default)]
pub struct JumpMemory {
    densities: Vec<f64>,
    rows: Vec<(usize, Row)>,
}

/// The rows that technique `to` reads and `from` does not.
fn invert(
    scene: &Scene,
    path: &FullPath,
    from: usize,
    to: usize,
    stream: &mut Stream,
    rows: &mut Vec<(usize, Row)>,
) -> Option<()> {
    let tracer = Tracer { edges: path.edges() };
    for m in from..to {
        rows.push((tracer.light_rows() + m, path.light_row(scene, m, stream.row())?));
    }
    // Camera vertex c is x_{k-c}; it is found by row c - 1.
    for m in to..from {
        let c = tracer.edges - m;
        rows.push((Tracer::CAMERA_ROWS + c - 1, path.camera_row(scene, c, stream.row())?));
    }
    Some(())
}

/// Has the state's proposal lead to `path` by the technique that has found it, where the state leads to the path `before` by
/// another, if it leads anywhere. Rows of vertices that are as they were stay. `None` where some row cannot be found.
pub fn retell(
    scene: &Scene,
    path: &FullPath,
    before: Option<(&FullPath, usize)>,
    state: &mut ChainState,
    stream: &mut Stream,
) -> Option<()> {
    let (tracer, s) = (Tracer { edges: path.edges() }, path.light.vertices.len());
    if let Some((_, from)) = before {
        forget(path, from, s, state, stream);
    }
    let stays = |m: usize, around: &[usize]| {
        before.is_some_and(|(before, from)| from == s && path.scatters_as(before, m, around))
    };
    for m in 0..s {
        let index = tracer.light_rows() + m;
        let [earlier, last] = [m.saturating_sub(2), m.saturating_sub(1)];
        let same = stays(last, &[earlier, last, m]);
        let row = if same { state.last(index) } else { path.light_row(scene, m, stream.row())? };
        state.set(index, row);
    }
    let first = path.camera_row(scene, 1, stream.row())?;
    let [x, y, ..] = stream.row();
    let seen = s < tracer.edges;
    // The technique that connects with the lens finds the film position by itself.
    state.set(Tracer::CAMERA_ROWS, if seen { first } else { [x, y, first[2], first[3]] });
    for c in 2..tracer.techniques() - s {
        let (index, m) = (Tracer::CAMERA_ROWS + c - 1, tracer.edges + 1 - c);
        let same = stays(m, &[m - 1, m, m + 1]);
        let row = if same { state.last(index) } else { path.camera_row(scene, c, stream.row())? };
        state.set(index, row);
    }
    Some(())
}

/// Forgets the rows that technique `from` reads and `to` does not.
fn forget(path: &FullPath, from: usize, to: usize, state: &mut ChainState, stream: &mut Stream) {
    let tracer = Tracer { edges: path.edges() };
    for m in to..from {
        state.forget(tracer.light_rows() + m);
    }
    for m in from..to {
        let row = Tracer::CAMERA_ROWS + tracer.edges - m - 1;
        if row > Tracer::CAMERA_ROWS {
            state.forget(row);
        } else {
            // The lens is still read.
            let [_, _, u, v] = state.row(row, stream);
            state.set(row, [stream.number(), stream.number(), u, v]);
        }
    }
}
