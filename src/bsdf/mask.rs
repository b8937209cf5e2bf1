//! Surfaces that are there only in part.

use super::lobes::{choose, same, unchoose};
use super::{Bsdf, Evaluation, Scatter};
use crate::math::{Row, Walk};
use crate::spectrum::Spectrum;
use crate::texture::{Number, Site};
use glam::DVec3;

/// Scatters as `nested` with the share `opacity`; what is left passes straight on.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    /// Share of the surface that is there, cut to 0 to 1.
    pub opacity: Number,
    /// The model of what is there.
    pub nested: Box<Bsdf>,
}

impl Mask {
    #[inline]
    fn gap(&self, site: &Site) -> f64 {
        1.0 - self.opacity.at(site).clamp(0.0, 1.0)
    }

    #[inline]
    pub(super) fn evaluate(&self, site: &Site, wi: DVec3, wo: DVec3, walk: Walk) -> Option<Evaluation> {
        let there = 1.0 - self.gap(site);
        let evaluation = self.nested.evaluate(site, wi, wo, walk).filter(|_| there > 0.0)?;
        Some(evaluation.scaled(Spectrum::grey(there), there, there))
    }

    #[inline]
    pub(super) fn sample(&self, site: &Site, wi: DVec3, row: Row, walk: Walk) -> Option<Scatter> {
        let gap = self.gap(site);
        let (passes, rest) = choose(row[0], gap);
        if passes {
            return Some(Scatter::delta(-wi, Spectrum::ONE, gap, gap));
        }
        let scatter = self.nested.sample(site, wi, [rest, row[1], row[2], row[3]], walk)?;
        Some(scatter.chosen(1.0 - gap, 1.0 - gap))
    }

    pub(super) fn invert(&self, site: &Site, wi: DVec3, wo: DVec3, delta: bool, gamma: Row) -> Option<Row> {
        let gap = self.gap(site);
        if delta && gap > 0.0 && same(wo, -wi) {
            return Some([unchoose((true, gamma[0]), gap), gamma[1], gamma[2], gamma[3]]);
        }
        let [rest, u, v, w] = self.nested.invert(site, wi, wo, delta, gamma).filter(|_| gap < 1.0)?;
        Some([unchoose((false, rest), gap), u, v, w])
    }
}
