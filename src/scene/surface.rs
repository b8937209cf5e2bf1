//! A point on a surface, with everything that scattering there needs.

use super::{BsdfId, EmitterId, Origin};
use crate::emitter::Start;
use crate::math::Frame;
use crate::texture::Site;
use glam::DVec3;

/// The bit of [`Surface::primitive`] that tells solids from triangles.
pub const SOLID: u32 = 1 << 31;

/// A point on a surface.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// The point.
    pub position: DVec3,
    /// Unit normal of the true surface, on the side where it shines.
    pub geometric: DVec3,
    /// Shading frame.
    pub frame: Frame,
    /// The shading normal before a relief tilted it, in the shading frame: +z where there is none.
    pub up: DVec3,
    /// Where its textures are looked up.
    pub site: Site,
    /// How it scatters.
    pub bsdf: BsdfId,
    /// Whether it shines.
    pub emitter: Option<EmitterId>,
    /// Distance by which rays are started off the surface.
    pub offset: f64,
    /// Index of the triangle that it lies on, or [`SOLID`] and that of the solid.
    pub primitive: u32,
}

impl Surface {
    /// Where light starts that a walk from the camera has met here.
    #[inline]
    pub fn start(&self) -> Start {
        let Self { position, geometric: normal, site, primitive, .. } = *self;
        Start::Surface { position, normal, uv: site.uv, triangle: primitive }
    }

    /// Where a ray starts that leaves towards `direction`: moved off the surface by more than the rounding errors of
    /// its position, on the side that the ray goes to.
    #[inline]
    pub fn leave(&self, direction: DVec3) -> Origin {
        let point = self.position + self.geometric * self.offset.copysign(self.geometric.dot(direction));
        Origin { point, triangle: self.primitive }
    }
}
