//! What perturbations have in common: a vertex is left in another direction, some free vertices move, and the last of them
//! is linked with what stays.

use super::gamma::{Part, hop};
use super::link::link;
use super::retrace::retrace;
use super::{Plan, Radii, View, direction_onward, next_free, onward};
use crate::manifold::Rejection;
use crate::math::{Frame, Stream, Walk};
use crate::paths::{Course, Node, VertexKind};
use crate::scene::Origin;
use glam::DVec3;

/// Moves `old` as `plan` says: T(y → x) / T(x → y).
pub(super) fn propose(
    view: &View<'_>,
    old: &Course,
    plan: &Plan,
    stream: &mut Stream,
    new: &mut Course,
) -> Result<f64, Rejection> {
    let Plan { walk, .. } = *plan;
    new.clone_from(old);
    let mut ratio = 1.0;
    let mut at = plan.from;
    for _ in 0..plan.stops {
        let ray = depart(view, old, new, at, walk, stream).ok_or(Rejection::Dark)?;
        let next = retrace(view, old, new, at, ray, walk).ok_or(Rejection::Dark)?;
        ratio *= traced(view, old, at, walk)? / traced(view, new, at, walk)?;
        at = next;
    }
    Ok(ratio * link(view, old, at, walk, new)?)
}

/// The ray that leaves x_`at` in place of the old one.
fn depart(
    view: &View<'_>,
    old: &Course,
    new: &mut Course,
    at: usize,
    walk: Walk,
    stream: &mut Stream,
) -> Option<(Origin, DVec3)> {
    let scene = view.scene;
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
        let frame = Frame::around(direction);
        return Some(((origin + frame.tangent * step.x + frame.bitangent * step.y).into(), direction));
    }
    let direction = view.mutations.angles.turn(direction, stream);
    Some((node.leave(direction), direction))
}

/// Density with which a walk from x_`from` that keeps half-vectors finds what it meets up to the next free vertex, for a
/// step that is as likely both ways; in the measure that the contribution by the technique has.
fn traced(view: &View<'_>, course: &Course, from: usize, walk: Walk) -> Result<f64, Rejection> {
    let to = next_free(course, from, walk).ok_or(Rejection::Unsuitable)?;
    let first = onward(course, from, walk).ok_or(Rejection::Unsuitable)?;
    let direction = direction_onward(view.scene, course, from, walk).ok_or(Rejection::Unsuitable)?;
    let (node, next) = (&course.nodes[from], &course.nodes[first]);
    let density = match node.kind {
        VertexKind::Camera => {
            let cos = next.normal().map_or(1.0, |normal| normal.dot(direction));
            let squared = if next.infinite().is_some() { 1.0 } else { node.position.distance_squared(next.position) };
            view.scene.camera.arrival_pdf(direction, cos, squared).0
        }
        _ if node.infinite().is_some() => next.cos(direction),
        _ => hop(node, next),
    };
    let part = Part { course, from, to, walk };
    Ok(density * part.traced(view.scene)? / part.turned(view)?)
}
