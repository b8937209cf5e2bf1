//! A diffuse base under a smooth dielectric coat.

use super::lobes::{mean, mirrored, share, unchoose};
use super::{Evaluation, Letter, Scatter, Substrate, fresnel};
use crate::math::{Row, warp::hemisphere};
use crate::texture::{Colour, Site};
use glam::DVec3;

/// Reflects at the coat as a mirror, and diffusely at the base, on the side of the normal.
#[derive(Clone, Debug, PartialEq)]
pub struct Plastic {
    /// The diffuse base.
    pub base: Substrate,
    /// Factor on the reflection by the coat, 1 in nature.
    pub specular_reflectance: Colour,
}

impl Plastic {
    /// With `eta` inside over outside.
    pub fn new(eta: f64, diffuse_reflectance: Colour, specular_reflectance: Colour, nonlinear: bool) -> Self {
        let internal = fresnel::diffuse_reflectance(1.0 / eta);
        Self { base: Substrate { reflectance: diffuse_reflectance, nonlinear, internal, eta }, specular_reflectance }
    }

    /// Reflectance of the coat for `w`, and the probability of choosing it.
    #[inline]
    fn coat(&self, site: &Site, w: DVec3) -> (f64, f64) {
        let (reflectance, _) = fresnel::dielectric(w.z, self.base.eta);
        let specular = reflectance * mean(self.specular_reflectance.at(site));
        (reflectance, share(specular, (1.0 - reflectance) * mean(self.base.reflectance.at(site))))
    }

    #[inline]
    pub(super) fn evaluate(&self, site: &Site, wi: DVec3, wo: DVec3) -> Option<Evaluation> {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return None;
        }
        let ((reflectance_i, coat_i), (reflectance_o, coat_o)) = (self.coat(site, wi), self.coat(site, wo));
        let evaluation = Evaluation {
            value: self.base.value(site, 1.0 - reflectance_i, 1.0 - reflectance_o),
            pdf: hemisphere::pdf(wo),
            pdf_reverse: hemisphere::pdf(wi),
            letter: Letter::D,
        };
        Some(evaluation.scaled(crate::spectrum::Spectrum::ONE, 1.0 - coat_i, 1.0 - coat_o))
    }

    #[inline]
    pub(super) fn sample(&self, site: &Site, wi: DVec3, row: Row) -> Option<Scatter> {
        if wi.z <= 0.0 {
            return None;
        }
        let (reflectance, coat) = self.coat(site, wi);
        if row[0] < coat {
            let weight = self.specular_reflectance.at(site) * (reflectance / coat);
            return Some(Scatter::delta(mirrored(wi), weight, coat, coat));
        }
        let direction = hemisphere::sample([row[1], row[2]]);
        Scatter::of(direction, &self.evaluate(site, wi, direction)?, 1.0)
    }

    pub(super) fn invert(&self, site: &Site, wi: DVec3, wo: DVec3, delta: bool, gamma: Row) -> Option<Row> {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return None;
        }
        let (_, coat) = self.coat(site, wi);
        let lobe = unchoose((delta, gamma[0]), coat);
        let [u, v] = if delta { [gamma[1], gamma[2]] } else { hemisphere::invert(wo) };
        (coat != f64::from(u8::from(!delta))).then_some([lobe, u, v, gamma[3]])
    }
}
