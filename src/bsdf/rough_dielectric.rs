//! Microfacet boundary between two transparent media (Walter et al. 2007, *Microfacet Models for Refraction through
//! Rough Surfaces*).

use super::{Evaluation, Microfacet, Roughness, Scatter, flip, fresnel, lobes};
use crate::math::{Row, SolidAnglePdf, Walk};
use crate::spectrum::Spectrum;
use crate::texture::Site;
use glam::DVec3;

/// Reflects and refracts; the normal points to the outside.
#[derive(Clone, Debug, PartialEq)]
pub struct RoughDielectric {
    /// Refractive index inside over outside; not 1.
    pub eta: f64,
    /// The distribution of the facets.
    pub roughness: Roughness,
    /// Factor on the reflection, 1 in nature.
    pub specular_reflectance: Spectrum,
    /// Factor on the refraction, 1 in nature.
    pub specular_transmittance: Spectrum,
}

/// A pair of directions as seen from the side of the incident one.
struct Seen {
    wi: DVec3,
    wo: DVec3,
    /// Index of the far side over that of the near side.
    eta: f64,
    /// The facet that takes one to the other.
    h: DVec3,
}

impl RoughDielectric {
    /// Index of the far side over that of the near side, for light from `wi`.
    #[inline]
    fn relative_eta(&self, wi: DVec3) -> f64 {
        if wi.z > 0.0 { self.eta } else { 1.0 / self.eta }
    }

    /// Walter et al. 2007, eqs. 13 and 16; `None` where no facet takes one to the other.
    #[inline]
    fn see(&self, wi: DVec3, wo: DVec3) -> Option<Seen> {
        let eta = self.relative_eta(wi);
        let (wi, wo) = if wi.z > 0.0 { (wi, wo) } else { (flip(wi), flip(wo)) };
        let h = (wi + if wo.z > 0.0 { wo } else { wo * eta }).try_normalize()?;
        let h = if h.z < 0.0 { -h } else { h };
        let faces = wi.z > 0.0 && wo.z != 0.0 && wi.dot(h) > 0.0 && wo.dot(h) * wo.z > 0.0;
        faces.then_some(Seen { wi, wo, eta, h })
    }

    pub(super) fn evaluate(&self, site: &Site, wi: DVec3, wo: DVec3, walk: Walk) -> Option<Evaluation> {
        let microfacet = self.roughness.at(site);
        let seen = self.see(wi, wo)?;
        let (reflectance, _) = fresnel::dielectric(seen.wi.dot(seen.h), seen.eta);
        let evaluation = if seen.wo.z > 0.0 {
            self.reflected(&microfacet, &seen, reflectance)
        } else {
            self.refracted(&microfacet, &seen, 1.0 - reflectance, walk)
        };
        (evaluation.pdf.0 > 0.0).then_some(evaluation)
    }

    /// Walter et al. 2007, eqs. 14 and 20.
    #[inline]
    fn reflected(&self, microfacet: &Microfacet, seen: &Seen, share: f64) -> Evaluation {
        let Seen { wi, wo, h, .. } = *seen;
        let jacobian = share / (4.0 * wi.dot(h));
        let shadowing = microfacet.shadowing(wi, h) * microfacet.shadowing(wo, h);
        let value = microfacet.density(h) * shadowing * share / (4.0 * wi.z * wo.z);
        Evaluation {
            value: self.specular_reflectance * value,
            pdf: SolidAnglePdf(microfacet.pdf(wi, h) * jacobian),
            pdf_reverse: SolidAnglePdf(microfacet.pdf(wo, h) * jacobian),
            letter: microfacet.letter(),
        }
    }

    /// Walter et al. 2007, eqs. 17 and 21. There `i` is where light comes from: its index is squared in the numerator of
    /// the value for power, that of the other side for radiance.
    #[inline]
    fn refracted(&self, microfacet: &Microfacet, seen: &Seen, share: f64, walk: Walk) -> Evaluation {
        let Seen { wi, wo, eta, h } = *seen;
        let (cos_i, cos_o) = (wi.dot(h), wo.dot(h).abs());
        let squeeze = if walk == Walk::FromCamera { 1.0 } else { eta * eta };
        let spread = share / (cos_i - eta * cos_o).powi(2);
        let shadowing = microfacet.shadowing(wi, h) * microfacet.shadowing(wo, h);
        let value = microfacet.density(h) * shadowing * spread * squeeze * cos_i * cos_o / (wi.z * wo.z.abs());
        Evaluation {
            value: self.specular_transmittance * value,
            pdf: SolidAnglePdf(microfacet.pdf(wi, h) * spread * eta * eta * cos_o),
            // From the other side the facet faces the other way, and the index is 1 / η.
            pdf_reverse: SolidAnglePdf(microfacet.pdf(-wo, h) * spread * cos_i),
            letter: microfacet.letter(),
        }
    }

    pub(super) fn sample(&self, site: &Site, wi: DVec3, row: Row, walk: Walk) -> Option<Scatter> {
        if wi.z == 0.0 {
            return None;
        }
        let upper = if wi.z > 0.0 { wi } else { flip(wi) };
        let h = self.roughness.at(site).sample(upper, [row[1], row[2]]);
        let (cos_i, eta) = (upper.dot(h), self.relative_eta(wi));
        if cos_i <= 0.0 {
            return None;
        }
        let (reflectance, cos_t) = fresnel::dielectric(cos_i, eta);
        let (direction, passed) = match cos_t {
            Some(cos_t) if row[0] >= reflectance => (h * (cos_i / eta - cos_t) - upper / eta, true),
            _ => (h * (2.0 * cos_i) - upper, false),
        };
        if (direction.z < 0.0) != passed {
            return None;
        }
        let direction = if wi.z > 0.0 { direction } else { flip(direction) };
        let evaluation = self.evaluate(site, wi, direction, walk)?;
        Scatter::of(direction, &evaluation, if passed { eta } else { 1.0 })
    }

    pub(super) fn invert(&self, site: &Site, wi: DVec3, wo: DVec3, gamma: Row) -> Option<Row> {
        let seen = self.see(wi, wo)?;
        let (reflectance, _) = fresnel::dielectric(seen.wi.dot(seen.h), seen.eta);
        if seen.wo.z < 0.0 && reflectance == 1.0 {
            return None;
        }
        let [u, v] = self.roughness.at(site).invert(seen.wi, seen.h);
        Some([lobes::unchoose((seen.wo.z > 0.0, gamma[0]), reflectance), u, v, gamma[3]])
    }
}
