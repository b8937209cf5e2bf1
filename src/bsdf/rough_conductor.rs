//! Microfacet reflection by a metal (Walter et al. 2007, with the separable shadowing term).

use super::{Conductor, Evaluation, GLOSSY_ALPHA, Letter, Microfacet, Scatter};
use crate::math::{Row, SolidAnglePdf};
use glam::DVec3;

/// A rough metal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoughConductor {
    /// The metal that the facets are made of.
    pub metal: Conductor,
    /// The distribution of the facets.
    pub microfacet: Microfacet,
}

impl RoughConductor {
    /// The letter depends on the roughness alone.
    #[inline]
    pub(super) fn letter(&self) -> Letter {
        if self.microfacet.alpha < GLOSSY_ALPHA { Letter::S } else { Letter::D }
    }

    /// Walter et al. 2007, eq. 20.
    #[inline]
    pub(super) fn evaluate(&self, wi: DVec3, wo: DVec3) -> Option<Evaluation> {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return None;
        }
        let h = (wi + wo).normalize();
        let density = self.microfacet.density(h);
        if density == 0.0 {
            return None;
        }
        let cos = wi.dot(h);
        let shadowing = self.microfacet.shadowing(wi) * self.microfacet.shadowing(wo);
        Some(Evaluation {
            value: self.metal.reflectance(cos) * (density * shadowing / (4.0 * wi.z * wo.z)),
            pdf: SolidAnglePdf(self.microfacet.pdf(wi, h) / (4.0 * cos)),
            pdf_reverse: SolidAnglePdf(self.microfacet.pdf(wo, h) / (4.0 * cos)),
            letter: self.letter(),
        })
    }

    #[inline]
    pub(super) fn sample(&self, wi: DVec3, row: Row) -> Option<Scatter> {
        if wi.z <= 0.0 {
            return None;
        }
        let h = self.microfacet.sample(wi, [row[1], row[2]]);
        let direction = h * (2.0 * wi.dot(h)) - wi;
        let evaluation = self.evaluate(wi, direction)?;
        (evaluation.pdf.0 > 0.0).then(|| Scatter {
            direction,
            weight: evaluation.value * (direction.z / evaluation.pdf.0),
            pdf: evaluation.pdf,
            pdf_reverse: evaluation.pdf_reverse,
            delta: false,
            letter: evaluation.letter,
            eta: 1.0,
        })
    }

    pub(super) fn invert(&self, wi: DVec3, wo: DVec3, gamma: Row) -> Option<Row> {
        let [u, v] = self.microfacet.invert(wi, (wi + wo).normalize());
        (wi.z > 0.0 && wo.z > 0.0).then_some([gamma[0], u, v, gamma[3]])
    }
}
