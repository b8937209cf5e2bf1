//! Mirror reflection by a metal.

use super::{Letter, Scatter, fresnel};
use crate::math::{Row, SolidAnglePdf};
use crate::spectrum::Spectrum;
use glam::DVec3;

/// A smooth metal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conductor {
    /// Complex refractive index (η, k) relative to the outside; `None` reflects everything.
    pub index: Option<(Spectrum, Spectrum)>,
    /// Factor on the reflection.
    pub specular_reflectance: Spectrum,
}

impl Conductor {
    /// Reflected share at the positive cosine `cos_i`.
    #[inline]
    pub(super) fn reflectance(&self, cos_i: f64) -> Spectrum {
        match self.index {
            Some((eta, k)) => fresnel::conductor(cos_i, eta, k) * self.specular_reflectance,
            None => self.specular_reflectance,
        }
    }

    #[inline]
    pub(super) fn sample(&self, wi: DVec3) -> Option<Scatter> {
        (wi.z > 0.0).then(|| Scatter {
            direction: DVec3::new(-wi.x, -wi.y, wi.z),
            weight: self.reflectance(wi.z),
            pdf: SolidAnglePdf(1.0),
            pdf_reverse: SolidAnglePdf(1.0),
            delta: true,
            letter: Letter::S,
            eta: 1.0,
        })
    }

    pub(super) fn invert(&self, wi: DVec3, wo: DVec3, gamma: Row) -> Option<Row> {
        (wi.z > 0.0 && wo.z > 0.0).then_some(gamma)
    }
}
