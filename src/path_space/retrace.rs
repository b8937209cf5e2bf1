//! A part of a path, traced anew: it meets other points, and does there what the path did.

use super::onward;
use crate::emitter::Start;
use crate::manifold::Turn;
use crate::math::Walk;
use crate::paths::{Course, Node, VertexKind};
use crate::scene::{Caster, Origin, Scene, Surface};
use glam::DVec3;

/// What a delta lobe does with light.
#[derive(Clone, Copy)]
enum Passage {
    /// Nothing: it goes straight on.
    Straight,
    /// It is bent.
    Turned(Turn),
}

impl Passage {
    /// Between the unit vectors `from`, back to where a walk comes from, and `onward`.
    fn at(scene: &Scene, surface: &Surface, from: DVec3, onward: DVec3) -> Option<Self> {
        if from.distance_squared(-onward) < 1e-18 {
            return Some(Self::Straight);
        }
        Turn::at(scene, surface, from, onward).map(Self::Turned)
    }

    /// Where light goes on that comes from the unit vector `from`. A relief may do anything.
    fn onward(self, scene: &Scene, old: &Surface, surface: &Surface, from: DVec3) -> Option<DVec3> {
        match self {
            Self::Straight => Some(-from),
            Self::Turned(_) if old.up.z < 1.0 || surface.up.z < 1.0 => None,
            Self::Turned(turn) => {
                let onward = turn.onward(surface, from)?;
                // The same turn: into the medium that it was, and on the right side of the true surface.
                let passes = from.dot(surface.geometric) * onward.dot(surface.geometric) < 0.0;
                let same = Turn::at(scene, surface, from, onward) == Some(turn);
                (same && passes == (turn != Turn::Reflected)).then_some(onward)
            }
        }
    }
}

/// Walks from `origin`, which belongs to x_`from`, along `direction` through delta vertices as `old` has them, to the next
/// free vertex, and leaves what it met in `new`: the number of that vertex. `None` where it meets something else.
pub(super) fn retrace(
    scene: &Caster<'_>,
    old: &Course,
    new: &mut Course,
    from: usize,
    (mut origin, mut direction): (Origin, DVec3),
    walk: Walk,
) -> Option<usize> {
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
        if !was.delta {
            let wi = surface.frame.to_local(-direction);
            let connects = !scene.bsdf(surface.bsdf).is_delta(scene.met(&surface, wi));
            new.nodes[next] = Node::on(surface, false);
            return (connects && next < old.edges()).then_some(next);
        }
        let old_surface = was.surface()?;
        let back = -super::direction_onward(scene, old, at, walk)?;
        let passage = Passage::at(scene, old_surface, back, super::direction_onward(scene, old, next, walk)?)?;
        let then = passage.onward(scene, old_surface, &surface, -direction)?;
        new.nodes[next] = Node::on(surface, true);
        (origin, direction, at) = (surface.leave(then), then, next);
    }
}

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
