//! A bounding volume hierarchy, eight children wide, over packets of up to eight triangles and analytic solids.
//!
//! The walk: [`build`] drops what cannot be hit, puts equal boxes together ([`groups`]) and lets obvhs build a binary hierarchy, [`collapse`] turns it into wide
//! nodes ([`wide`]) and packets ([`packet`]) in large pages ([`pages`]), [`traverse`] carries a ray's constants ([`query`]) through them.
//!
//! A handful of primitives gets no nodes at all: a flat list of packets is faster.
//!
//! All of it works in the hierarchy's own [`frame`]: relative to a centre, scaled by a power of two, both chosen so that
//! no vertex is rounded.

mod build;
mod collapse;
mod frame;
mod groups;
mod packet;
mod pages;
mod query;
mod traverse;
mod wide;

use glam::Vec3;

use super::{Bounds, Hit, Ray, Solid};
use frame::Frame;
use packet::Packet;
use pages::Pages;
use wide::Node;

/// The index of no triangle: for rays that start on something else.
pub const NO_TRIANGLE: u32 = u32::MAX;

/// Triangles and solids that a hierarchy left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dropped {
    /// Coordinates that are not finite or beyond 1e15, indices beyond the vertices, a radius that is not positive, a
    /// normal that is not a unit vector.
    pub invalid: usize,
    /// Triangles without area, which no ray can hit.
    pub degenerate: usize,
}

/// How the primitives are kept.
#[derive(Debug)]
enum Form {
    /// All are tested: at most [`traverse::FLAT_PACKETS`] packets, [levelled](Packet::level), and solids by their indices.
    Flat { packets: Vec<Packet>, solids: Vec<u32> },
    /// The first node is the root.
    Tree { nodes: Pages<Node>, packets: Pages<Packet> },
}

/// The hierarchy; holds its own copy of the geometry. Immutable and shared between threads.
#[derive(Debug)]
pub struct Bvh {
    frame: Frame,
    bounds: Bounds,
    dropped: Dropped,
    form: Form,
    solids: Vec<Solid>,
}

impl Bvh {
    /// Builds the hierarchy. `vertices` are in scene units and taken as exact; a triangle names three of them. What
    /// cannot be hit is left out and counted ([`Bvh::dropped`]); indices in hits refer to the slices given here.
    #[must_use]
    pub fn build(vertices: &[Vec3], triangles: &[[u32; 3]], solids: &[Solid]) -> Self {
        build::build(vertices, triangles, solids)
    }

    /// The closest hit with `0 < t < tmax`.
    #[must_use]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.intersect_from(ray, NO_TRIANGLE)
    }

    /// Whether anything lies at `0 < t < tmax`: the same answer as `intersect(ray).is_some()`, sooner.
    #[must_use]
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.occluded_from(ray, NO_TRIANGLE)
    }

    /// As [`Bvh::intersect`], for a ray that starts on the triangle `leaving` and so cannot meet it again: it is not
    /// looked at, which saves the exact test that most rays from a surface would otherwise fail.
    #[must_use]
    pub fn intersect_from(&self, ray: &Ray, leaving: u32) -> Option<Hit> {
        let best = self.dispatch::<false>(ray, leaving)?;
        best.primitive.map(|primitive| Hit { t: best.t * self.frame.inverse, primitive })
    }

    /// As [`Bvh::occluded`], for a ray that starts on the triangle `leaving`.
    #[must_use]
    pub fn occluded_from(&self, ray: &Ray, leaving: u32) -> bool {
        self.dispatch::<true>(ray, leaving).is_some_and(|best| best.primitive.is_some())
    }

    /// The box around all that was not dropped; empty for an empty scene.
    #[must_use]
    pub const fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// What was left out of the hierarchy.
    #[must_use]
    pub const fn dropped(&self) -> Dropped {
        self.dropped
    }
}
