//! What perturbations have in common: a vertex is left in another direction, some free vertices move, and the last of them
//! is linked with what stays.

use super::gamma::{gamma, hop};
use super::link::link;
use super::retrace::retrace;
use super::{Plan, Radii, direction_onward, next_free, onward, reverse};
use crate::manifold::Rejection;
use crate::math::{Stream, Walk};
use crate::paths::{Course, Node, VertexKind};
use crate::scene::{Caster, Origin};
use glam::DVec3;

/// Moves `old`, which the technique with `s` light vertices has found, as `plan` says: T(y → x) / T(x → y).
pub(super) fn propose(
    scene: &Caster<'_>,
    old: &Course,
    s: usize,
    plan: &Plan,
    angles: Radii,
    stream: &mut Stream,
    new: &mut Course,
) -> Result<f64, Rejection> {
    new.clone_from(old);
    let mut ratio = 1.0;
    let mut at = plan.from;
    for _ in 0..plan.stops {
        let ray = depart(scene, old, new, at, plan.walk, angles, stream).ok_or(Rejection::Dark)?;
        let next = retrace(scene, old, new, at, ray, plan.walk).ok_or(Rejection::Dark)?;
        ratio *= traced(scene, old, at, s, plan.walk)? / traced(scene, new, at, s, plan.walk)?;
        at = next;
    }
    Ok(ratio * link(scene, old, s, at, plan.walk, new)?)
}

/// The ray that leaves x_`at` in place of the old one.
fn depart(
    scene: &Caster<'_>,
    old: &Course,
    new: &mut Course,
    at: usize,
    walk: Walk,
    angles: Radii,
    stream: &mut Stream,
) -> Option<(Origin, DVec3)> {
    let node = new.nodes[at];
    if let VertexKind::Camera = node.kind {
        let [width, height] = scene.camera.size.map(|pixels| pixels as f64);
        let film = old.film + Radii::on_film(scene.camera.size).step(stream);
        if !(film.x >= 0.0 && film.y >= 0.0 && film.x < width && film.y < height) {
            return None;
        }
        let row = scene.camera.invert(old.film, node.position, [0.5; 4]);
        let (lens, direction) = scene.camera.ray(film, row);
        (new.film, new.nodes[at]) = (film, Node::lens(lens));
        return Some((lens.into(), direction));
    }
    let direction = direction_onward(scene, old, at, walk)?;
    if let VertexKind::Light(id, start) = node.kind
        && node.infinite().is_some()
    {
        // Parallel light moves sideways.
        let first = old.nodes[1].position;
        let emitter = scene.emitter(id);
        let row = emitter.invert_emission(&start, direction, first, [0.5; 4])?;
        let (origin, ..) = emitter.emit(&start, row)?;
        let size = scene.radius();
        let step = Radii { least: 1e-4 * size, most: 0.05 * size }.step(stream);
        let frame = crate::math::Frame::around(direction);
        return Some(((origin + frame.tangent * step.x + frame.bitangent * step.y).into(), direction));
    }
    let direction = angles.turn(direction, stream);
    Some((node.leave(direction), direction))
}

/// Density with which a walk from x_`from` finds the next free vertex, for a step that is as likely both ways; in units of
/// what the technique with `s` light vertices has of it.
fn traced(scene: &Caster<'_>, course: &Course, from: usize, s: usize, walk: Walk) -> Result<f64, Rejection> {
    let end = next_free(course, from, walk).ok_or(Rejection::Unsuitable)?;
    let first = onward(course, from, walk).ok_or(Rejection::Unsuitable)?;
    let direction = direction_onward(scene, course, from, walk).ok_or(Rejection::Unsuitable)?;
    let (node, next) = (&course.nodes[from], &course.nodes[first]);
    let mut density = match node.kind {
        VertexKind::Camera => {
            let cos = next.normal().map_or(1.0, |normal| normal.dot(direction));
            let squared = if next.infinite().is_some() { 1.0 } else { node.position.distance_squared(next.position) };
            scene.camera.arrival_pdf(direction, cos, squared).0
        }
        _ if node.infinite().is_some() => next.cos(direction),
        _ => hop_to(node, next),
    };
    let mut at = first;
    while at != end {
        let next = onward(course, at, walk).ok_or(Rejection::Unsuitable)?;
        density *= hop_to(&course.nodes[at], &course.nodes[next]);
        at = next;
    }
    if first != end && passes(s, from, end) != walk {
        density *= gamma(scene, course, from, walk)? / gamma(scene, course, end, reverse(walk))?;
    }
    Ok(density)
}

/// [`hop`], or 1 to light from infinity, whose measure is solid angle.
fn hop_to(from: &Node, to: &Node) -> f64 {
    if to.infinite().is_some() { 1.0 } else { hop(from, to) }
}

/// The walk in which the technique with `s` light vertices passes the chain between two free vertices.
pub(super) fn passes(s: usize, one: usize, other: usize) -> Walk {
    if s > one.max(other) { Walk::FromLight } else { Walk::FromCamera }
}
