//! An environment of one radiance. Light subpaths start with a direction, then a point on a disk that covers the scene
//! as seen along it.

use super::{Reach, Start};
use crate::math::{AreaPdf, Row, warp};
use crate::spectrum::Spectrum;
use glam::DVec3;
use std::f64::consts::PI;

/// The environment and the sphere around the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constant {
    /// Radiance from everywhere, in W/(m² sr).
    pub radiance: Spectrum,
    /// The sphere around the scene.
    pub reach: Reach,
}

impl Constant {
    #[inline]
    pub(super) fn start(&self, row: Row) -> (Start, AreaPdf) {
        (Start::Infinite { towards: warp::sphere::sample([row[1], row[2]]) }, self.start_pdf())
    }

    pub(super) fn invert_start(&self, towards: DVec3, gamma: Row) -> Row {
        let [u, v] = warp::sphere::invert(towards);
        [gamma[0], u, v, gamma[3]]
    }

    #[inline]
    pub(super) fn start_pdf(&self) -> AreaPdf {
        AreaPdf(warp::sphere::PDF.0)
    }

    #[inline]
    pub(super) fn emit(&self, towards: DVec3, row: Row) -> (DVec3, DVec3, Spectrum) {
        (self.reach.origin(towards, row), -towards, self.radiance / self.reach.beam_pdf())
    }

    pub(super) fn power(&self) -> f64 {
        self.radiance.luminance() * 4.0 * PI * self.reach.shadow()
    }
}
