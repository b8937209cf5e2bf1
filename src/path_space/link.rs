//! The end of a perturbation: the free vertex that has moved is linked with the next one, which stays, by an edge or by the
//! chain that lies between them.

use super::gamma::Part;
use super::{View, next_free, onward, reverse};
use crate::manifold::{Chain, Rejection};
use crate::math::Walk;
use crate::paths::{Course, Node};

/// A chain that walks back ends up where it was if it is no further away than this, relative to the distance of its ends.
const RETURNED: f64 = 1e-8;

/// Links x_`moved` of `new`: what is left of the density where a chain has walked.
pub(super) fn link(
    view: &View<'_>,
    old: &Course,
    moved: usize,
    walk: Walk,
    new: &mut Course,
) -> Result<f64, Rejection> {
    // The light itself has moved.
    let Some(next) = onward(old, moved, walk) else { return Ok(1.0) };
    let end = next_free(old, moved, walk).ok_or(Rejection::Unsuitable)?;
    let ratio = if next == end { 1.0 } else { follow(view, old, (end, moved), reverse(walk), new)? };
    if end == new.edges() {
        new.look(view.scene).ok_or(Rejection::Dark)?;
    }
    new.sees(view.scene, moved.min(next)).then_some(ratio).ok_or(Rejection::Dark)
}

/// Has the chain that `walk` passes from the vertex `end` to `moved` follow, up to its last edge.
fn follow(
    view: &View<'_>,
    old: &Course,
    (end, moved): (usize, usize),
    walk: Walk,
    new: &mut Course,
) -> Result<f64, Rejection> {
    let scene = view.scene;
    let start = &old.nodes[end];
    let was = part(old, end, moved, walk).chain(scene)?;
    let goals = [part(new, end, moved, walk).goal()?, part(old, end, moved, walk).goal()?];
    let (found, _) = was.walk(scene, start, &goals[0])?;
    let (returned, _) = found.walk(scene, start, &goals[1]).map_err(|_| Rejection::OneWay)?;
    let apart = |a: &Chain, b: &Chain| {
        let distances = a.surfaces().zip(b.surfaces()).map(|(a, b)| a.position.distance(b.position));
        distances.fold(0.0, f64::max)
    };
    if apart(&returned, &was) > RETURNED * start.position.distance(old.nodes[moved].position) {
        return Err(Rejection::OneWay);
    }
    let mut at = end;
    for link in found.links() {
        at = onward(old, at, walk).ok_or(Rejection::Unsuitable)?;
        new.nodes[at] = Node { linked: true, ..Node::on(link.surface, old.nodes[at].delta) };
    }
    // Roughness may change along a surface.
    let still = |m: usize| {
        let node = &new.nodes[m];
        node.delta || new.direction(scene, m).is_some_and(|back| view.is_glossy(node, back))
    };
    if !(end.min(moved) + 1..end.max(moved)).all(still) {
        return Err(Rejection::Unsuitable);
    }
    let measure = |course: &Course, chain: &Chain| -> Result<f64, Rejection> {
        let part = part(course, end, moved, walk);
        Ok(part.gamma_of(scene, chain)? * part.turned(view)?)
    };
    Ok(measure(new, &found)? / measure(old, &was)?)
}

const fn part(course: &Course, from: usize, to: usize, walk: Walk) -> Part<'_> {
    Part { course, from, to, walk }
}
