//! Direct light at a point, by densities per solid angle: next event estimation for walks that keep no vertices.

use super::trace::light_offset;
use crate::emitter::Start;
use crate::math::{AreaPdf, Row, SolidAnglePdf};
use crate::scene::{Caster, EmitterId, Origin};
use crate::spectrum::Spectrum;
use glam::DVec3;

/// Light that arrives at a point from a sampled direction, if nothing is in the way.
#[derive(Clone, Copy, Debug)]
pub struct Direct {
    /// Unit direction towards the light.
    pub direction: DVec3,
    /// Radiance over density.
    pub radiance: Spectrum,
    /// Density of the direction; `None` for lights that no ray can hit.
    pub pdf: Option<SolidAnglePdf>,
    /// Where the light is; `None` at infinity.
    target: Option<DVec3>,
}

impl Direct {
    /// Whether the light reaches `origin`.
    #[inline]
    pub fn arrives(&self, scene: &Caster<'_>, origin: Origin) -> bool {
        match self.target {
            Some(target) => scene.visible(origin, target),
            None => scene.escapes(origin, self.direction),
        }
    }
}

/// Samples light that may arrive at `position`.
#[inline]
pub fn sample_direct(scene: &Caster<'_>, position: DVec3, row: Row) -> Option<Direct> {
    let (id, start, pdf, _) = scene.sample_start_for(position, row)?;
    let emitter = scene.emitter(id);
    let (direction, target, pdf, weight) = match start {
        Start::Infinite { towards } => (towards, None, Some(SolidAnglePdf(pdf.0)), 1.0 / pdf.0),
        Start::Distant { towards } => (towards, None, None, 1.0 / pdf.0),
        Start::Point { position: at } => {
            let offset = at - position;
            (offset.normalize(), Some(at), None, 1.0 / (pdf.0 * offset.length_squared()))
        }
        Start::Surface { position: at, normal, .. } => {
            let offset = at - position;
            let distance_squared = offset.length_squared();
            let direction = offset / distance_squared.sqrt();
            let solid = pdf.to_solid_angle(normal.dot(direction), distance_squared);
            (direction, Some(at + normal * light_offset(at)), Some(solid), 1.0 / solid.0)
        }
    };
    let radiance = emitter.radiance(&start, -direction) * weight;
    (!radiance.is_black()).then_some(Direct { direction, radiance, pdf, target })
}

/// Density with which [`sample_direct`] finds, for a point at `from`, the `start` of the emitter `id` that a walk has hit
/// from there along `direction`.
#[inline]
pub fn direct_pdf(scene: &Caster<'_>, from: DVec3, id: EmitterId, start: &Start, direction: DVec3) -> SolidAnglePdf {
    let pdf = AreaPdf(scene.start_pdf(id, start).0 * scene.preference(id, from));
    match start {
        Start::Surface { position, normal, .. } => {
            pdf.to_solid_angle(normal.dot(direction), position.distance_squared(from))
        }
        Start::Infinite { .. } | Start::Point { .. } | Start::Distant { .. } => SolidAnglePdf(pdf.0),
    }
}
