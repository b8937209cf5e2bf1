//! A thin pane: reflections back and forth between its two faces added up, with no shift of what passes.

use super::lobes::{mirrored, unchoose};
use super::{Scatter, fresnel};
use crate::math::Row;
use crate::spectrum::Spectrum;
use glam::DVec3;

/// Reflects, and lets the rest pass straight on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinDielectric {
    /// Refractive index of the pane over that around it.
    pub eta: f64,
    /// Factor on the reflection, 1 in nature.
    pub specular_reflectance: Spectrum,
    /// Factor on what passes, 1 in nature.
    pub specular_transmittance: Spectrum,
}

impl ThinDielectric {
    /// With R the reflectance of one face, R + (1 − R)² R (1 + R² + R⁴ + …) = 2R / (1 + R).
    #[inline]
    fn reflectance(&self, wi: DVec3) -> f64 {
        let (face, _) = fresnel::dielectric(wi.z.abs(), self.eta);
        2.0 * face / (1.0 + face)
    }

    #[inline]
    pub(super) fn sample(&self, wi: DVec3, row: Row) -> Option<Scatter> {
        if wi.z == 0.0 {
            return None;
        }
        let reflectance = self.reflectance(wi);
        Some(if row[0] < reflectance {
            Scatter::delta(mirrored(wi), self.specular_reflectance, reflectance, reflectance)
        } else {
            Scatter::delta(-wi, self.specular_transmittance, 1.0 - reflectance, 1.0 - reflectance)
        })
    }

    pub(super) fn invert(&self, wi: DVec3, wo: DVec3, gamma: Row) -> Option<Row> {
        let (reflectance, back) = (self.reflectance(wi), wi.z * wo.z > 0.0);
        let lobe = unchoose((back, gamma[0]), reflectance);
        (back || reflectance < 1.0).then_some([lobe, gamma[1], gamma[2], gamma[3]])
    }
}
