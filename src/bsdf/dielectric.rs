//! Smooth boundary between two transparent media.

use super::lobes::unchoose;
use super::{Letter, Scatter, fresnel};
use crate::math::{Row, SolidAnglePdf, Walk};
use crate::spectrum::Spectrum;
use glam::DVec3;

/// Reflects and refracts; the normal points to the outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dielectric {
    /// Refractive index inside over outside.
    pub eta: f64,
    /// Factor on the reflection, 1 in nature.
    pub specular_reflectance: Spectrum,
    /// Factor on the refraction, 1 in nature.
    pub specular_transmittance: Spectrum,
}

impl Dielectric {
    /// Index of the far side over that of the near side, for light from `wi`.
    #[inline]
    fn relative_eta(&self, wi: DVec3) -> f64 {
        if wi.z > 0.0 { self.eta } else { 1.0 / self.eta }
    }

    #[inline]
    pub(super) fn sample(&self, wi: DVec3, row: Row, walk: Walk) -> Option<Scatter> {
        if wi.z == 0.0 {
            return None;
        }
        let eta = self.relative_eta(wi);
        let cos_i = wi.z.abs();
        let (reflectance, cos_t) = fresnel::dielectric(cos_i, eta);
        let (direction, weight, probability, jacobian, eta) = match cos_t {
            Some(cos_t) if row[0] >= reflectance => {
                let direction = DVec3::new(-wi.x / eta, -wi.y / eta, -cos_t.copysign(wi.z));
                // Radiance is squeezed into a narrower cone, power is not (Veach 1997, section 5.2).
                let squeeze = if walk == Walk::FromCamera { 1.0 / (eta * eta) } else { 1.0 };
                // Snell: η_i² cos θ_i dω_i = η_t² cos θ_t dω_t.
                let jacobian = cos_i / (eta * eta * cos_t);
                (direction, self.specular_transmittance * squeeze, 1.0 - reflectance, jacobian, eta)
            }
            _ => (DVec3::new(-wi.x, -wi.y, wi.z), self.specular_reflectance, reflectance, 1.0, 1.0),
        };
        Some(Scatter {
            direction,
            weight,
            pdf: SolidAnglePdf(probability),
            pdf_reverse: SolidAnglePdf(probability * jacobian),
            delta: true,
            letter: Letter::S,
            eta,
        })
    }

    pub(super) fn invert(&self, wi: DVec3, wo: DVec3, gamma: Row) -> Option<Row> {
        let (reflectance, _) = fresnel::dielectric(wi.z.abs(), self.relative_eta(wi));
        let reflects = wi.z * wo.z > 0.0;
        let lobe = unchoose((reflects, gamma[0]), reflectance);
        (reflects || reflectance < 1.0).then_some([lobe, gamma[1], gamma[2], gamma[3]])
    }
}
