//! How much the plain geometric terms of a chain are off the generalised one.

use super::onward;
use crate::manifold::{Chain, Goal, MOST_LINKS, Rejection};
use crate::math::{Frame, Walk};
use crate::paths::{Course, Node};
use crate::scene::{Caster, Surface};
use arrayvec::ArrayVec;

/// Γ(a → b) of the chain between two free vertices, the head of [`super`] says what that is.
///
/// # Errors
/// Where the chain's derivatives are not known, or it is singular.
pub(super) fn gamma(scene: &Caster<'_>, course: &Course, from: usize, walk: Walk) -> Result<f64, Rejection> {
    let end = super::next_free(course, from, walk).ok_or(Rejection::Unsuitable)?;
    let (chain, goal) = (chain(scene, course, from, end, walk)?, goal(&course.nodes[end])?);
    let mut plain = 1.0;
    let mut at = from;
    while at != end {
        let next = onward(course, at, walk).ok_or(Rejection::Unsuitable)?;
        plain *= hop(&course.nodes[at], &course.nodes[next]);
        at = next;
    }
    Ok(chain.spread(scene, &course.nodes[from], &goal)? / plain)
}

/// The chain between two free vertices, as a walk passes it.
pub(super) fn chain(
    scene: &Caster<'_>,
    course: &Course,
    from: usize,
    end: usize,
    walk: Walk,
) -> Result<Chain, Rejection> {
    let mut surfaces: ArrayVec<Surface, MOST_LINKS> = ArrayVec::new();
    let mut at = onward(course, from, walk).ok_or(Rejection::Unsuitable)?;
    while at != end {
        surfaces.try_push(*course.nodes[at].surface().ok_or(Rejection::Unsuitable)?).map_err(|_| Rejection::TooLong)?;
        at = onward(course, at, walk).ok_or(Rejection::Unsuitable)?;
    }
    Chain::new(scene, course.nodes[from].position, &surfaces, course.nodes[end].position)
}

/// A vertex as the goal of a chain, with the plane in which it lies.
pub(super) fn goal(node: &Node) -> Result<Goal, Rejection> {
    let Frame { tangent, bitangent, .. } = Frame::around(node.normal().ok_or(Rejection::Unsuitable)?);
    Ok(Goal::new(node.position, [tangent, bitangent]))
}

/// cos θ / d² of an edge between two points, where it arrives.
pub(super) fn hop(from: &Node, to: &Node) -> f64 {
    let edge = to.position - from.position;
    to.cos(edge.normalize()) / edge.length_squared()
}
