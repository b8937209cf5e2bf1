//! A diffuse base under a rough dielectric coat.

use super::lobes::{choose, guess, letter, mean, share, unchoose};
use super::{Evaluation, Letter, RoughCoat, Scatter, Substrate};
use crate::math::{Row, warp::hemisphere};
use crate::spectrum::Spectrum;
use crate::texture::{Colour, Site};
use glam::DVec3;

/// Reflects at the facets of the coat, and diffusely at the base, on the side of the normal.
#[derive(Clone, Debug, PartialEq)]
pub struct RoughPlastic {
    /// The diffuse base.
    pub base: Substrate,
    /// The coat.
    pub coat: RoughCoat,
    /// Factor on the reflection by the coat, 1 in nature.
    pub specular_reflectance: Colour,
}

impl RoughPlastic {
    /// A coat over a base that reflects `diffuse_reflectance`.
    pub fn new(coat: RoughCoat, diffuse_reflectance: Colour, specular_reflectance: Colour, nonlinear: bool) -> Self {
        let (internal, eta) = (coat.internal_reflectance(), coat.eta);
        let base = Substrate { reflectance: diffuse_reflectance, nonlinear, internal, eta };
        Self { base, coat, specular_reflectance }
    }

    /// What the coat lets pass for `w`, and the probability of choosing its reflection.
    #[inline]
    fn pass(&self, site: &Site, w: DVec3) -> (f64, f64) {
        let pass = self.coat.transmittance(w.z);
        let specular = (1.0 - pass) * mean(self.specular_reflectance.at(site));
        (pass, share(specular, pass * mean(self.base.reflectance.at(site))))
    }

    /// Coat and base with their shares of the density.
    #[inline]
    fn parts(&self, site: &Site, wi: DVec3, wo: DVec3) -> Option<[Evaluation; 2]> {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return None;
        }
        let ((pass_i, coat_i), (pass_o, coat_o)) = (self.pass(site, wi), self.pass(site, wo));
        let base = Evaluation {
            value: self.base.value(site, pass_i, pass_o),
            pdf: hemisphere::pdf(wo),
            pdf_reverse: hemisphere::pdf(wi),
            letter: Letter::D,
        };
        let coat = self.coat.evaluate(wi, wo).scaled(self.specular_reflectance.at(site), coat_i, coat_o);
        Some([coat, base.scaled(Spectrum::ONE, 1.0 - coat_i, 1.0 - coat_o)])
    }

    #[inline]
    pub(super) fn evaluate(&self, site: &Site, wi: DVec3, wo: DVec3) -> Option<Evaluation> {
        let [coat, base] = self.parts(site, wi, wo)?;
        let name = if coat.letter == Letter::D { Letter::D } else { letter(coat.value, base.value) };
        Some(Evaluation { letter: name, ..coat.sum(base) })
    }

    #[inline]
    pub(super) fn sample(&self, site: &Site, wi: DVec3, row: Row) -> Option<Scatter> {
        if wi.z <= 0.0 {
            return None;
        }
        let u = [row[1], row[2]];
        let coat = choose(row[0], self.pass(site, wi).1).0;
        let direction = if coat { self.coat.sample(wi, u) } else { hemisphere::sample(u) };
        Scatter::of(direction, &self.evaluate(site, wi, direction)?, 1.0)
    }

    pub(super) fn invert(&self, site: &Site, wi: DVec3, wo: DVec3, gamma: Row) -> Option<Row> {
        let [coat, base] = self.parts(site, wi, wo)?;
        let (is_coat, rest) = guess(gamma[0], coat.pdf.0, base.pdf.0);
        let [u, v] = if is_coat { self.coat.invert(wi, wo) } else { hemisphere::invert(wo) };
        Some([unchoose((is_coat, rest), self.pass(site, wi).1), u, v, gamma[3]])
    }
}
