//! Parallel light from infinitely far away, from one direction alone: no ray can hit it.

use super::{Reach, Start};
use crate::math::{AreaPdf, Row};
use crate::spectrum::Spectrum;
use glam::DVec3;

/// Parallel light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Directional {
    /// Unit vector from the scene towards the source.
    pub towards: DVec3,
    /// Irradiance of a surface that faces the source, in W/m².
    pub irradiance: Spectrum,
    /// The sphere around the scene.
    pub reach: Reach,
}

impl Directional {
    #[inline]
    pub(super) fn start(&self) -> (Start, AreaPdf) {
        (Start::Distant { towards: self.towards }, AreaPdf(1.0))
    }

    #[inline]
    pub(super) fn emit(&self, row: Row) -> (DVec3, DVec3, Spectrum) {
        (self.reach.origin(self.towards, row), -self.towards, self.irradiance / self.reach.beam_pdf())
    }

    pub(super) fn power(&self) -> f64 {
        self.irradiance.luminance() * self.reach.shadow()
    }
}
