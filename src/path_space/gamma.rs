//! The measure of chains: how much plain geometric terms are off the generalised ones.

use super::{View, next_fixed, onward};
use crate::manifold::{Chain, Goal, MOST_LINKS, Rejection, Turn, offset_density};
use crate::math::{Frame, Walk};
use crate::paths::{Course, Node};
use crate::scene::{Caster, Scene, Surface};
use arrayvec::ArrayVec;

/// A part of a course, from one vertex to another as a walk passes it.
#[derive(Clone, Copy)]
pub(super) struct Part<'a> {
    pub course: &'a Course,
    pub from: usize,
    pub to: usize,
    pub walk: Walk,
}

impl Part<'_> {
    /// The other way round.
    pub(super) fn reversed(self) -> Self {
        Self { from: self.to, to: self.from, walk: super::reverse(self.walk), ..self }
    }

    /// Its vertices after the first, with the one before each.
    fn steps(self) -> impl Iterator<Item = (usize, usize)> {
        let Self { course, from, to, walk } = self;
        let mut at = from;
        std::iter::from_fn(move || {
            let next = onward(course, at, walk).filter(|_| at != to)?;
            Some((std::mem::replace(&mut at, next), next))
        })
    }

    /// The chain between its ends.
    pub(super) fn chain(self, scene: &Caster<'_>) -> Result<Chain, Rejection> {
        let nodes = &self.course.nodes;
        let mut surfaces: ArrayVec<(Surface, bool), MOST_LINKS> = ArrayVec::new();
        for (_, m) in self.steps().filter(|(_, m)| *m != self.to) {
            let surface = *nodes[m].surface().ok_or(Rejection::Unsuitable)?;
            surfaces.try_push((surface, nodes[m].delta)).map_err(|_| Rejection::TooLong)?;
        }
        Chain::new(scene, nodes[self.from].position, &surfaces, nodes[self.to].position)
    }

    /// Its far end, with the plane in which that lies.
    pub(super) fn goal(self) -> Result<Goal, Rejection> {
        let node = &self.course.nodes[self.to];
        let Frame { tangent, bitangent, .. } = Frame::around(node.normal().ok_or(Rejection::Unsuitable)?);
        Ok(Goal::new(node.position, [tangent, bitangent]))
    }

    /// The product of cos θ / d² over its edges, without the first; and of the densities of offsets by directions over the
    /// vertices of a chain that are no delta vertices: the density of what a walk finds that keeps half-vectors.
    pub(super) fn traced(self, scene: &Scene) -> Result<f64, Rejection> {
        let nodes = &self.course.nodes;
        let mut density = 1.0;
        for ((before, here), (_, after)) in self.steps().zip(self.steps().skip(1)) {
            density *= hop(&nodes[here], &nodes[after]);
            if !nodes[here].delta {
                density *= kept(scene, &nodes[before], &nodes[here], &nodes[after])?;
            }
        }
        Ok(density)
    }

    /// Γ of the chain, with what is kept of half-vectors: the head of [`super`] says what that is.
    pub(super) fn gamma(self, scene: &Caster<'_>) -> Result<f64, Rejection> {
        self.gamma_of(scene, &self.chain(scene)?)
    }

    /// [`Part::gamma`], where the chain is known.
    pub(super) fn gamma_of(self, scene: &Caster<'_>, chain: &Chain) -> Result<f64, Rejection> {
        let nodes = &self.course.nodes;
        let first = onward(self.course, self.from, self.walk).ok_or(Rejection::Unsuitable)?;
        let plain = hop(&nodes[self.from], &nodes[first]) * self.traced(scene)?;
        Ok(chain.spread(scene, &nodes[self.from], &self.goal()?)? / plain)
    }

    /// The product of Γ of the technique's way over that of this way, of all chains of delta vertices that the technique
    /// passes the other way round.
    pub(super) fn turned(self, view: &View<'_>) -> Result<f64, Rejection> {
        let mut product = 1.0;
        let mut at = self.from;
        while at != self.to {
            let next = next_fixed(self.course, at, self.walk).ok_or(Rejection::Unsuitable)?;
            let part = Self { from: at, to: next, ..self };
            if next.abs_diff(at) > 1 && view.passes(at, next) != self.walk {
                product *= part.reversed().gamma(view.scene)? / part.gamma(view.scene)?;
            }
            at = next;
        }
        Ok(product)
    }
}

/// cos θ / d² of an edge between two points, where it arrives; 1 to light from infinity, whose measure is solid angle.
pub(super) fn hop(from: &Node, to: &Node) -> f64 {
    if to.infinite().is_some() {
        return 1.0;
    }
    let edge = to.position - from.position;
    to.cos(edge.normalize()) / edge.length_squared()
}

/// Density of the offset that a glossy vertex keeps, by directions.
fn kept(scene: &Scene, before: &Node, here: &Node, after: &Node) -> Result<f64, Rejection> {
    let surface = here.surface().ok_or(Rejection::Unsuitable)?;
    let towards = |node: &Node| node.infinite().unwrap_or_else(|| (node.position - here.position).normalize());
    let (back, onward) = (towards(before), towards(after));
    let normal = surface.frame.normal;
    let turn = Turn::at(scene, surface, back, onward).ok_or(Rejection::Unsuitable)?;
    offset_density(back, (normal, turn), onward).ok_or(Rejection::Singular)
}
