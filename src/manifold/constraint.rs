//! The law of a specular vertex, and its derivatives.
//!
//! Between unit vectors a back and b onward the half-vector is H = a + η b, with η = 1 for reflection; ĥ is its direction
//! on the side of the normal n. What it is off the normal, c = ĥ − (ĥ·n) n, is zero on the manifold of delta vertices; a
//! glossy vertex keeps its c, in the frame [`Frame::around`] the normal, which follows it (Jakob 2013, section 5.4.4).

use super::Turn;
use crate::math::Frame;
use crate::scene::Patch;
use glam::{DMat2, DVec2, DVec3};

/// Derivatives of what a vertex is off its law, by moves along the tangents of itself and its neighbours: columns by
/// tangent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Derivatives {
    /// By moves of the vertex before.
    pub before: DMat2,
    /// By its own.
    pub here: DMat2,
    /// By those of the vertex after.
    pub after: DMat2,
}

/// Half-vectors below this length have no direction to speak of: light that passes a boundary between equal media.
const LEAST: f64 = 1e-9;

/// How far the half-vector between `before` and `after` is off the normal, a vector at right angles to it.
pub fn offset(before: DVec3, (here, turn): (&Patch, Turn), after: DVec3) -> Option<DVec3> {
    let (half, _) = half((before - here.position).normalize(), turn, (after - here.position).normalize())?;
    let along = half.dot(here.normal);
    Some((half - here.normal * along) * 1f64.copysign(along))
}

/// Density of offsets by directions: how much [`offset`] moves, as an area in the frame around `normal`, when the unit vector
/// `onward` does by a solid angle.
pub fn offset_density(back: DVec3, (normal, turn): (DVec3, Turn), onward: DVec3) -> Option<f64> {
    let (half, length) = half(back, turn, onward)?;
    Some((turn.weight() / length).powi(2) * onward.dot(half).abs() * half.dot(normal).abs())
}

/// The half-vector's direction and its length.
fn half(back: DVec3, turn: Turn, onward: DVec3) -> Option<(DVec3, f64)> {
    let half = back + onward * turn.weight();
    let length = half.length();
    // NaN is none either.
    (length > LEAST).then(|| (half / length, length))
}

/// The derivatives of [`offset`] in the frame around the normal; `None` where the half-vector has no direction.
pub fn derivatives(before: &Patch, (here, turn): (&Patch, Turn), after: &Patch) -> Option<Derivatives> {
    let (to_before, to_after) = (before.position - here.position, after.position - here.position);
    let (back, onward) = (to_before.normalize(), to_after.normalize());
    let (half, length) = half(back, turn, onward)?;
    let along = half.dot(here.normal);
    let Frame { tangent, bitangent, .. } = Frame::around(here.normal);
    let project = |v: DVec3| DVec2::new(tangent.dot(v), bitangent.dot(v));
    // Of the half-vector's direction, by a change of the half-vector.
    let turned = |change: DVec3| (change - half * half.dot(change)) * (1f64.copysign(along) / length);
    // Of the vectors back and onward, by moves of the far ends.
    let back_by = |step: DVec3| (step - back * back.dot(step)) / to_before.length();
    let onward_by = |step: DVec3| (step - onward * onward.dot(step)) * (turn.weight() / to_after.length());
    let by_neighbour = |[s, t]: [DVec3; 2], by: &dyn Fn(DVec3) -> DVec3| {
        DMat2::from_cols(project(turned(by(s))), project(turned(by(t))))
    };
    let own = |axis: usize| {
        let step = here.tangents[axis];
        // The half-vector changes, and so does the frame.
        let frame =
            Frame::turning(here.normal, here.turning[axis]).map(|change| change.dot(half) * 1f64.copysign(along));
        project(turned(-back_by(step) - onward_by(step))) + DVec2::from(frame)
    };
    Some(Derivatives {
        before: by_neighbour(before.tangents, &back_by),
        here: DMat2::from_cols(own(0), own(1)),
        after: by_neighbour(after.tangents, &onward_by),
    })
}

/// How the first specular vertex of a chain moves with the far end, where the near end stays: d x_1 / d x_{m+1}, in the
/// tangents of both. By elimination from the near end; `None` where a vertex has no place to go.
pub fn transfer(links: impl Iterator<Item = Option<Derivatives>>) -> Option<DMat2> {
    let mut whole = DMat2::IDENTITY;
    // d x_{i-1} / d x_i; the near end does not move.
    let mut previous = DMat2::ZERO;
    for link in links {
        let Derivatives { before, here, after } = link?;
        let here = here + before * previous;
        let scale = here.to_cols_array().iter().fold(0.0, |most, x| f64::max(most, x.abs()));
        // NaN is not regular either.
        let regular = here.determinant().abs() > 1e-12 * scale * scale;
        previous = regular.then(|| -(here.inverse() * after))?;
        whole *= previous;
    }
    Some(whole)
}
