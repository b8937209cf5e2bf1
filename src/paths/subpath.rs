//! Subpaths and their vertices.

use crate::emitter::Start;
use crate::film::Word;
use crate::math::AreaPdf;
use crate::scene::{EmitterId, Surface};
use crate::spectrum::Spectrum;
use glam::{DVec2, DVec3};

/// What a vertex lies on.
#[derive(Clone, Copy, Debug)]
pub enum VertexKind {
    /// The lens of the camera.
    Camera,
    /// Where light starts.
    Light(EmitterId, Start),
    /// A surface that scatters.
    Surface(Surface),
    /// The environment, met by a walk from the camera.
    Environment(EmitterId),
}

/// A vertex of a subpath.
#[derive(Clone, Copy, Debug)]
pub struct Vertex {
    /// What it lies on.
    pub kind: VertexKind,
    /// Its position; of no meaning for a vertex at infinity.
    pub position: DVec3,
    /// Unit direction back to the previous vertex of the walk; for a light that starts the walk, unused.
    pub back: DVec3,
    /// Contribution over density of the subpath up to here, before scattering.
    pub throughput: Spectrum,
    /// Density of the vertex, given its predecessors in this walk.
    pub forward: AreaPdf,
    /// Density of the vertex in a walk from the other side, given the two vertices that follow it in this walk. Known
    /// once the walk is two vertices further on.
    pub reverse: AreaPdf,
    /// Whether a connection can be made here: the model has more than delta lobes.
    pub connects: bool,
    /// Whether the walk went on from here by a delta lobe; `false` where it ended.
    pub delta: bool,
    /// Letters of the vertices before this one.
    pub word: Word,
    /// For the first vertex of a walk from a light, once the second is known: how much more often its light is chosen
    /// for direct light there than for walks ([`crate::scene::Caster::preference`]). 1 for all others.
    pub preference: f64,
}

impl Vertex {
    /// The surface of a vertex that lies on one.
    #[inline]
    pub fn surface(&self) -> Option<&Surface> {
        match &self.kind {
            VertexKind::Surface(surface) => Some(surface),
            _ => None,
        }
    }
}

/// A walk from the camera or from a light. Reused from path to path, so that none allocates.
#[derive(Clone, Debug, Default)]
pub struct Subpath {
    /// The vertices, the one on the camera or the light first.
    pub vertices: Vec<Vertex>,
    /// Film position of a walk from the camera.
    pub film: DVec2,
}
