//! A mixture of two models.

use super::lobes::{SAME, choose, guess, unchoose};
use super::{Bsdf, Evaluation, Scatter};
use crate::math::{Row, Walk};
use crate::spectrum::Spectrum;
use crate::texture::{Number, Site};
use glam::DVec3;

/// Scatters as the second model with the share `weight`, else as the first.
#[derive(Clone, Debug, PartialEq)]
pub struct Blend {
    /// Share of the second model, cut to 0 to 1.
    pub weight: Number,
    /// The models.
    pub nested: Box<[Bsdf; 2]>,
}

impl Blend {
    /// Shares of the two models.
    #[inline]
    fn shares(&self, site: &Site) -> [f64; 2] {
        let weight = self.weight.at(site).clamp(0.0, 1.0);
        [1.0 - weight, weight]
    }

    #[inline]
    fn parts(&self, site: &Site, wi: DVec3, wo: DVec3, walk: Walk) -> [Option<Evaluation>; 2] {
        let shares = self.shares(site);
        [0, 1].map(|i| {
            let part = self.nested[i].evaluate(site, wi, wo, walk).filter(|_| shares[i] > 0.0)?;
            Some(part.scaled(Spectrum::grey(shares[i]), shares[i], shares[i]))
        })
    }

    #[inline]
    pub(super) fn evaluate(&self, site: &Site, wi: DVec3, wo: DVec3, walk: Walk) -> Option<Evaluation> {
        match self.parts(site, wi, wo, walk) {
            [Some(a), Some(b)] => Some(a.sum(b)),
            [a, b] => a.or(b),
        }
    }

    #[inline]
    pub(super) fn sample(&self, site: &Site, wi: DVec3, row: Row, walk: Walk) -> Option<Scatter> {
        let shares = self.shares(site);
        let (first, rest) = choose(row[0], shares[0]);
        let index = usize::from(!first);
        let scatter = self.nested[index].sample(site, wi, [rest, row[1], row[2], row[3]], walk)?;
        if scatter.delta {
            return Some(scatter.chosen(shares[index], shares[index]));
        }
        Scatter::of(scatter.direction, &self.evaluate(site, wi, scatter.direction, walk)?, scatter.eta)
    }

    /// Of several delta lobes that lead to `wo` one is drawn by the shares of the models, of other lobes by their
    /// densities.
    pub(super) fn invert(&self, site: &Site, wi: DVec3, wo: DVec3, delta: bool, gamma: Row) -> Option<Row> {
        let shares = self.shares(site);
        let densities = if delta {
            let misses =
                [0, 1].map(|i| if shares[i] > 0.0 { self.miss(i, site, wi, wo, gamma) } else { f64::INFINITY });
            let nearest = misses[0].min(misses[1]);
            [0, 1].map(|i| if misses[i] < nearest + SAME { shares[i] } else { 0.0 })
        } else {
            self.parts(site, wi, wo, Walk::FromCamera).map(|part| part.map_or(0.0, |part| part.pdf.0))
        };
        if densities == [0.0; 2] {
            return None;
        }
        let (first, rest) = guess(gamma[0], densities[0], densities[1]);
        let nested = &self.nested[usize::from(!first)];
        let [lobe, u, v, w] = nested.invert(site, wi, wo, delta, [rest, gamma[1], gamma[2], gamma[3]])?;
        Some([unchoose((first, lobe), shares[0]), u, v, w])
    }

    /// Square of the distance by which the delta lobes of a model miss `wo`.
    fn miss(&self, index: usize, site: &Site, wi: DVec3, wo: DVec3, gamma: Row) -> f64 {
        let nested = &self.nested[index];
        let row = nested.invert(site, wi, wo, true, gamma);
        let scatter = row.and_then(|row| nested.sample(site, wi, row, Walk::FromCamera));
        scatter.map_or(f64::INFINITY, |scatter| scatter.direction.distance_squared(wo))
    }
}
