//! A part of a path, traced anew: it meets other points, and does there what the path did.

use super::{View, direction_onward, onward};
use crate::emitter::Start;
use crate::manifold::Link;
use crate::math::Walk;
use crate::paths::{Course, Node, VertexKind};
use crate::scene::{Origin, Scene, Surface};
use glam::DVec3;

/// Walks from `origin`, which belongs to x_`from`, along `direction` through a chain that does what `old` does there, to the
/// next free vertex, and leaves what it met in `new`: the number of that vertex. `None` where it meets something else.
pub(super) fn retrace(
    view: &View<'_>,
    old: &Course,
    new: &mut Course,
    from: usize,
    (mut origin, mut direction): (Origin, DVec3),
    walk: Walk,
) -> Option<usize> {
    let scene = view.scene;
    let mut at = from;
    loop {
        let next = onward(old, at, walk)?;
        let met = if at == old.edges() { scene.see(origin, direction) } else { scene.intersect(origin, direction) };
        let was = &old.nodes[next];
        if next == 0 {
            (new.nodes[0], new.lit) = light(scene, was, met, direction)?;
            return Some(0);
        }
        let surface = met?;
        let node = Node { linked: was.linked, ..Node::on(surface, was.delta) };
        // What is no delta vertex must be as glossy as before, or as little, and light must scatter there at all.
        if !was.delta {
            let wi = surface.frame.to_local(-direction);
            let connects = !scene.bsdf(surface.bsdf).is_delta(scene.met(&surface, wi));
            if !connects || next == old.edges() || view.is_glossy(&node, -direction) != was.linked {
                return None;
            }
        }
        new.nodes[next] = node;
        if !was.linked {
            return Some(next);
        }
        let then = pass(scene, old, at, next, walk, &surface, -direction)?;
        (origin, direction, at) = (surface.leave(then), then, next);
    }
}

/// Where light goes on that meets `surface` in place of x_`here`, coming from `from`, when it does the same there.
fn pass(
    scene: &Scene,
    old: &Course,
    before: usize,
    here: usize,
    walk: Walk,
    surface: &Surface,
    from: DVec3,
) -> Option<DVec3> {
    let node = &old.nodes[here];
    let old_surface = node.surface()?;
    let (back, onward) = (-direction_onward(scene, old, before, walk)?, direction_onward(scene, old, here, walk)?);
    if node.delta && back.distance_squared(-onward) < STRAIGHT {
        return Some(-from);
    }
    // A relief may do anything.
    if old_surface.up.z < 1.0 || surface.up.z < 1.0 {
        return None;
    }
    let position = old_surface.position;
    let link = Link::new(scene, position + back, (old_surface, node.delta), position + onward).ok()?;
    link.onward(scene, surface, from)
}

/// Square of the angle below which light goes straight on.
const STRAIGHT: f64 = 1e-18;

/// The light that a walk from the camera has met, where the path had `was`.
fn light(scene: &Scene, was: &Node, met: Option<Surface>, direction: DVec3) -> Option<(Node, Option<Surface>)> {
    match (met, was.kind) {
        (Some(surface), VertexKind::Light(_, Start::Surface { .. })) => {
            Some((Node::light(surface.emitter?, surface.start()), Some(surface)))
        }
        (None, VertexKind::Light(_, Start::Infinite { .. })) => {
            Some((Node::light(scene.environment()?, Start::Infinite { towards: direction }), None))
        }
        _ => None,
    }
}
