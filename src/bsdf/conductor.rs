//! Mirror reflection by a metal.

use super::lobes::mirrored;
use super::{Scatter, fresnel};
use crate::math::Row;
use crate::spectrum::Spectrum;
use crate::texture::{Colour, Site};
use glam::DVec3;

/// A smooth metal.
#[derive(Clone, Debug, PartialEq)]
pub struct Conductor {
    /// Complex refractive index (η, k) relative to the outside; `None` reflects everything.
    pub index: Option<(Spectrum, Spectrum)>,
    /// Factor on the reflection.
    pub specular_reflectance: Colour,
}

impl Conductor {
    /// Reflected share at the positive cosine `cos_i`.
    #[inline]
    pub(super) fn reflectance(&self, site: &Site, cos_i: f64) -> Spectrum {
        let factor = self.specular_reflectance.at(site);
        match self.index {
            Some((eta, k)) => fresnel::conductor(cos_i, eta, k) * factor,
            None => factor,
        }
    }

    #[inline]
    pub(super) fn sample(&self, site: &Site, wi: DVec3) -> Option<Scatter> {
        (wi.z > 0.0).then(|| Scatter::delta(mirrored(wi), self.reflectance(site, wi.z), 1.0, 1.0))
    }

    pub(super) fn invert(&self, wi: DVec3, wo: DVec3, gamma: Row) -> Option<Row> {
        (wi.z > 0.0 && wo.z > 0.0).then_some(gamma)
    }
}
