//! Microfacet reflection by a metal (Walter et al. 2007, with the separable shadowing term).

use super::{Conductor, Evaluation, Roughness, Scatter};
use crate::math::{Row, SolidAnglePdf};
use crate::texture::Site;
use glam::DVec3;

/// A rough metal.
#[derive(Clone, Debug, PartialEq)]
pub struct RoughConductor {
    /// The metal that the facets are made of.
    pub metal: Conductor,
    /// The distribution of the facets.
    pub roughness: Roughness,
}

impl RoughConductor {
    /// Walter et al. 2007, eq. 20.
    #[inline]
    pub(super) fn evaluate(&self, site: &Site, wi: DVec3, wo: DVec3) -> Option<Evaluation> {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return None;
        }
        let microfacet = self.roughness.at(site);
        let h = (wi + wo).normalize();
        let density = microfacet.density(h);
        if density == 0.0 {
            return None;
        }
        let cos = wi.dot(h);
        let shadowing = microfacet.shadowing(wi, h) * microfacet.shadowing(wo, h);
        Some(Evaluation {
            value: self.metal.reflectance(site, cos) * (density * shadowing / (4.0 * wi.z * wo.z)),
            pdf: SolidAnglePdf(microfacet.pdf(wi, h) / (4.0 * cos)),
            pdf_reverse: SolidAnglePdf(microfacet.pdf(wo, h) / (4.0 * cos)),
            letter: microfacet.letter(),
        })
    }

    #[inline]
    pub(super) fn sample(&self, site: &Site, wi: DVec3, row: Row) -> Option<Scatter> {
        if wi.z <= 0.0 {
            return None;
        }
        let h = self.roughness.at(site).sample(wi, [row[1], row[2]]);
        let direction = h * (2.0 * wi.dot(h)) - wi;
        Scatter::of(direction, &self.evaluate(site, wi, direction)?, 1.0)
    }

    pub(super) fn invert(&self, site: &Site, wi: DVec3, wo: DVec3, gamma: Row) -> Option<Row> {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return None;
        }
        let [u, v] = self.roughness.at(site).invert(wi, (wi + wo).normalize());
        Some([gamma[0], u, v, gamma[3]])
    }
}
