//! An environment of one radiance. Light subpaths start with a direction, then a point on a disk that covers the scene
//! as seen along it.

use super::Start;
use crate::math::{AreaPdf, Frame, Row, warp};
use crate::spectrum::Spectrum;
use glam::DVec3;
use std::f64::consts::PI;

/// The environment and the sphere around the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constant {
    /// Radiance from everywhere, in W/(m² sr).
    pub radiance: Spectrum,
    /// Centre of a sphere around the scene.
    pub center: DVec3,
    /// Its radius, positive.
    pub radius: f64,
}

impl Constant {
    #[inline]
    pub(super) fn start(&self, row: Row) -> (Start, AreaPdf) {
        (Start::Infinite { towards: warp::sphere::sample([row[1], row[2]]) }, self.start_pdf())
    }

    #[inline]
    pub(super) fn start_pdf(&self) -> AreaPdf {
        AreaPdf(warp::sphere::PDF.0)
    }

    /// Density per area of the points that parallel rays pass.
    #[inline]
    pub(super) fn beam_pdf(&self) -> f64 {
        warp::disk::PDF / (self.radius * self.radius)
    }

    #[inline]
    pub(super) fn emit(&self, towards: DVec3, row: Row) -> (DVec3, DVec3, Spectrum) {
        let frame = Frame::around(towards);
        let at = warp::disk::sample([row[1], row[2]]);
        let origin = self.center + (frame.tangent * at.x + frame.bitangent * at.y + towards) * self.radius;
        (origin, -towards, self.radiance / self.beam_pdf())
    }

    pub(super) fn power(&self) -> f64 {
        self.radiance.luminance() * 4.0 * PI * PI * self.radius * self.radius
    }
}
