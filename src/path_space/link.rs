//! The end of a perturbation: the free vertex that has moved is linked with the next one, which stays, by an edge or by the
//! chain that lies between them.

use super::gamma::{chain, gamma, goal};
use super::perturb::passes;
use super::{next_free, onward, reverse};
use crate::manifold::Rejection;
use crate::math::Walk;
use crate::paths::{Course, Node};
use crate::scene::Caster;
use glam::DVec3;

/// A chain that walks back ends up where it was if it is no further away than this, relative to its longest edge.
const RETURNED: f64 = 1e-8;

/// Links x_`moved` of `new`: what is left of the density where a chain has walked.
pub(super) fn link(
    scene: &Caster<'_>,
    old: &Course,
    s: usize,
    moved: usize,
    walk: Walk,
    new: &mut Course,
) -> Result<f64, Rejection> {
    // The light itself has moved.
    let Some(next) = onward(old, moved, walk) else { return Ok(1.0) };
    let end = next_free(old, moved, walk).ok_or(Rejection::Unsuitable)?;
    let ratio = if next == end { 1.0 } else { follow(scene, old, s, (moved, end), walk, new)? };
    if end == new.edges() {
        new.look(scene).ok_or(Rejection::Dark)?;
    }
    new.sees(scene, moved.min(next)).then_some(ratio).ok_or(Rejection::Dark)
}

/// Has the chain between `moved` and `end` follow, up to its last edge.
fn follow(
    scene: &Caster<'_>,
    old: &Course,
    s: usize,
    (moved, end): (usize, usize),
    walk: Walk,
    new: &mut Course,
) -> Result<f64, Rejection> {
    let back = reverse(walk);
    let start = &old.nodes[end];
    let was = chain(scene, old, end, moved, back)?;
    let (found, _) = was.walk(scene, start, &goal(&new.nodes[moved])?)?;
    let (returned, _) = found.walk(scene, start, &goal(&old.nodes[moved])?).map_err(|_| Rejection::OneWay)?;
    let positions = |chain: &crate::manifold::Chain| -> arrayvec::ArrayVec<DVec3, { crate::manifold::MOST_LINKS }> {
        chain.surfaces().map(|surface| surface.position).collect()
    };
    let scale = start.position.distance(old.nodes[moved].position).max(f64::MIN_POSITIVE);
    let apart = positions(&returned).iter().zip(&positions(&was)).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    if apart > RETURNED * scale {
        return Err(Rejection::OneWay);
    }
    let mut at = end;
    for surface in found.surfaces() {
        at = onward(old, at, back).ok_or(Rejection::Unsuitable)?;
        new.nodes[at] = Node::on(*surface, true);
    }
    let (from, way) = if passes(s, moved, end) == walk { (moved, walk) } else { (end, back) };
    Ok(gamma(scene, new, from, way)? / gamma(scene, old, from, way)?)
}
