//! The connection over a manifold: the light's end of a path is left out, and a vertex that stays is linked with a new point
//! of a light through smooth boundaries, by a walk on the manifold (Hanika, Droske and Fascione 2015, "Manifold Next Event
//! Estimation"). So a chain comes upon caustics that walks hardly ever find.
//!
//! x_0 … x_{d-1} are replaced by as many vertices. With probability 1/2 they are a point of a light, drawn as for direct
//! light, and the chain to which a seed walks: the straight way there, bent where it meets boundaries. Else they are sampled
//! anew as by [`super::bidirectional`]. Both ways are one density,
//!
//! ```text
//! T(x → y) ∝ p_A(y_0) [y has the chain to which the seed walks] + 1/(d + 1) Σ_{s ≤ d} p_s(y) / (what stays has of it),
//! ```
//!
//! so that a chain leaves a caustic by the one as it came to it by the other. The seed depends on nothing but the ends.

use super::bidirectional::{Range, resample};
use super::gamma::Part;
use super::{Draft, View};
use crate::emitter::Start;
use crate::manifold::{Chain, Goal, MOST_LINKS, Rejection, Turn};
use crate::math::{Frame, Stream, Walk};
use crate::paths::{Course, FullPath, Node, VertexKind};
use crate::scene::{Caster, Surface};
use arrayvec::ArrayVec;

/// Two chains are the same if their vertices are no further apart, relative to the distance of their ends.
const SAME: f64 = 1e-7;

/// Whether some vertex could be linked.
pub(super) fn suits(scene: &Caster<'_>, course: &Course) -> bool {
    scene.refracts() && (2..course.edges()).any(|d| is_free(course, d))
}

/// The first free vertex from the light on, if there are smooth boundaries before it: the one that the connection would have
/// linked.
pub(super) fn joint(course: &Course) -> Option<usize> {
    let d = 1 + course.nodes[1..].iter().take_while(|node| node.delta).count();
    (d > 1 && d < course.edges() && is_free(course, d)).then_some(d)
}

fn is_free(course: &Course, d: usize) -> bool {
    let node = &course.nodes[d];
    node.surface().is_some() && !node.delta
}

/// Replaces the light's end of `old`.
pub(super) fn propose(
    view: &View<'_>,
    old: &Course,
    stream: &mut Stream,
    new: &mut Course,
) -> Result<Draft, Rejection> {
    let edges = old.edges();
    // Of all vertices, whether they suit or not: for both ways with the same probability.
    let d = 2 + (stream.number() * edges.saturating_sub(2) as f64) as usize;
    if d >= edges || !is_free(old, d) {
        return Err(Rejection::Unsuitable);
    }
    let part = Range::new(0, d, edges);
    let technique = if stream.number() < 0.5 {
        connect(view.scene, old, d, stream, new)?;
        0
    } else {
        resample(view.scene, old, part, d, stream, new).ok_or(Rejection::Dark)?
    };
    if !is_free(new, d) {
        return Err(Rejection::Dark);
    }
    Ok(Draft { technique, ratio: 1.0, ranges: Some([part, part]), linked: Some(d) })
}

/// Links x_d with a light.
pub(super) fn connect(
    scene: &Caster<'_>,
    old: &Course,
    d: usize,
    stream: &mut Stream,
    new: &mut Course,
) -> Result<(), Rejection> {
    let (id, start, _) = scene.sample_start(stream.row()).ok_or(Rejection::Unsuitable)?;
    let light = Node::light(id, start);
    let from = &old.nodes[d];
    let chain = seeded(scene, from, &light, d - 1)?;
    new.clone_from(old);
    for (link, node) in chain.links().iter().zip(new.nodes[1..d].iter_mut().rev()) {
        *node = Node::on(link.surface, true);
    }
    // What a walk from the camera meets there is the light as such a walk has it.
    (new.nodes[0], new.lit) = (light, None);
    new.light_up(scene).ok_or(Rejection::Dark)?;
    new.nodes[0] = Node::light(id, new.lit.ok_or(Rejection::Dark)?.start());
    Ok(())
}

/// The chain of `count` smooth boundaries from `from` to a point of a light to which the seed walks.
fn seeded(scene: &Caster<'_>, from: &Node, light: &Node, count: usize) -> Result<Chain, Rejection> {
    let VertexKind::Light(_, Start::Surface { .. }) = light.kind else { return Err(Rejection::Unsuitable) };
    let mut direction = (light.position - from.position).try_normalize().ok_or(Rejection::Singular)?;
    let Frame { tangent, bitangent, .. } = Frame::around(direction);
    let goal = Goal::new(light.position, [tangent, bitangent]);
    let mut origin = from.leave(direction);
    let mut surfaces: ArrayVec<(Surface, bool), MOST_LINKS> = ArrayVec::new();
    for _ in 0..count {
        let surface = scene.intersect(origin, direction).ok_or(Rejection::Unsuitable)?;
        let met = surface.frame.to_local(-direction);
        if surface.up.z < 1.0 || !scene.bsdf(surface.bsdf).is_delta(met) {
            return Err(Rejection::Unsuitable);
        }
        let turn = Turn::at(scene, &surface, -direction, direction).ok_or(Rejection::Unsuitable)?;
        direction = turn.onward(surface.frame.normal, -direction).ok_or(Rejection::Unsuitable)?;
        surfaces.try_push((surface, true)).map_err(|_| Rejection::TooLong)?;
        origin = surface.leave(direction);
    }
    let (last, _) = surfaces.last().ok_or(Rejection::Unsuitable)?;
    let end = last.position + direction * last.position.distance(light.position);
    Ok(Chain::new(scene, from.position, &surfaces, end)?.walk(scene, from, &goal)?.0)
}

/// How likely the connection is, relative to the walk from the camera, to make of x_d the light's end that `course` has.
pub(super) fn share(view: &View<'_>, course: &mut Course, d: usize, memory: &mut FullPath) -> f64 {
    density(view, course, d, memory).unwrap_or(0.0)
}

fn density(view: &View<'_>, course: &mut Course, d: usize, memory: &mut FullPath) -> Option<f64> {
    let (scene, light, from) = (view.scene, &course.nodes[0], &course.nodes[d]);
    if !course.nodes[1..d].iter().all(|node| node.delta) {
        return None;
    }
    let VertexKind::Light(id, start) = light.kind else { return None };
    let chain = seeded(scene, from, light, d - 1).ok()?;
    let close = SAME * from.position.distance(light.position);
    let same = |(link, node): (&Surface, &Node)| link.position.distance(node.position) <= close;
    if !chain.surfaces().zip(course.nodes[1..d].iter().rev()).all(same) {
        return None;
    }
    course.light_up(scene)?;
    memory.assemble(scene, course, 0)?;
    let walked: f64 = (0..d).map(|m| memory.camera.vertices[course.edges() - m].forward.0).product();
    let gamma = Part { course, from: d, to: 0, walk: Walk::FromCamera }.gamma(scene).ok()?;
    Some(scene.start_pdf(id, &start).0 / (walked * gamma))
}
