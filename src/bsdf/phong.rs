//! The modified Phong model (Lafortune and Willems 1994, *Using the Modified Phong Reflectance Model for Physically
//! Based Rendering*).

use super::lobes::{choose, guess, letter, mean, mirrored, share, unchoose};
use super::{Evaluation, GLOSSY_ALPHA, Letter, Scatter};
use crate::math::{Frame, Row, SolidAnglePdf, warp::hemisphere};
use crate::texture::{Colour, Number, Site};
use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_1_PI, TAU};

/// A diffuse lobe and one around the mirror direction, on the side of the normal.
#[derive(Clone, Debug, PartialEq)]
pub struct Phong {
    /// Exponent of the cosine with the mirror direction.
    pub exponent: Number,
    /// Share reflected by the lobe around the mirror direction.
    pub specular_reflectance: Colour,
    /// Share reflected diffusely.
    pub diffuse_reflectance: Colour,
}

impl Phong {
    #[inline]
    fn exponent(&self, site: &Site) -> f64 {
        self.exponent.at(site).max(0.0)
    }

    /// The letter of the lobe, by the roughness of a Beckmann surface with a highlight of the same width: n = 2/α² − 2
    /// (Walter et al. 2007).
    #[inline]
    fn lobe_letter(exponent: f64) -> Letter {
        if 2.0 < GLOSSY_ALPHA * GLOSSY_ALPHA * (exponent + 2.0) { Letter::S } else { Letter::D }
    }

    /// Probability of the lobe around the mirror direction, the same for all directions.
    #[inline]
    fn glossy(&self, site: &Site) -> f64 {
        share(mean(self.specular_reflectance.at(site)), mean(self.diffuse_reflectance.at(site)))
    }

    /// Density of the lobe around the mirror direction, symmetric.
    #[inline]
    fn lobe_pdf(exponent: f64, wi: DVec3, wo: DVec3) -> f64 {
        (exponent + 1.0) / TAU * mirrored(wi).dot(wo).max(0.0).powf(exponent)
    }

    #[inline]
    pub(super) fn evaluate(&self, site: &Site, wi: DVec3, wo: DVec3) -> Option<Evaluation> {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return None;
        }
        let (exponent, glossy) = (self.exponent(site), self.glossy(site));
        let lobe = Self::lobe_pdf(exponent, wi, wo);
        // Lafortune and Willems 1994, eq. 8: at normal incidence (n + 2) / 2π loses no energy.
        let specular = self.specular_reflectance.at(site) * (lobe * (exponent + 2.0) / (exponent + 1.0));
        let diffuse = self.diffuse_reflectance.at(site) * FRAC_1_PI;
        let pdf = |cosine: SolidAnglePdf| SolidAnglePdf(glossy * lobe + (1.0 - glossy) * cosine.0);
        Some(Evaluation {
            value: specular + diffuse,
            pdf: pdf(hemisphere::pdf(wo)),
            pdf_reverse: pdf(hemisphere::pdf(wi)),
            letter: if Self::lobe_letter(exponent) == Letter::D { Letter::D } else { letter(specular, diffuse) },
        })
    }

    #[inline]
    pub(super) fn sample(&self, site: &Site, wi: DVec3, row: Row) -> Option<Scatter> {
        if wi.z <= 0.0 {
            return None;
        }
        let direction = if choose(row[0], self.glossy(site)).0 {
            let cos = (1.0 - row[1]).powf(1.0 / (self.exponent(site) + 1.0));
            let around = DVec2::from_angle(TAU * row[2]) * (1.0 - cos * cos).max(0.0).sqrt();
            Frame::around(mirrored(wi)).to_world(around.extend(cos))
        } else {
            hemisphere::sample([row[1], row[2]])
        };
        Scatter::of(direction, &self.evaluate(site, wi, direction)?, 1.0)
    }

    pub(super) fn invert(&self, site: &Site, wi: DVec3, wo: DVec3, gamma: Row) -> Option<Row> {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return None;
        }
        let (exponent, glossy) = (self.exponent(site), self.glossy(site));
        let lobe = glossy * Self::lobe_pdf(exponent, wi, wo);
        let (is_lobe, rest) = guess(gamma[0], lobe, (1.0 - glossy) * hemisphere::pdf(wo).0);
        let [u, v] = if is_lobe {
            let local = Frame::around(mirrored(wi)).to_local(wo);
            let turn = local.y.atan2(local.x) / TAU;
            // The logarithm of the cosine, by the sine: near the axis the cosine has no digits left.
            let log = 0.5 * (-local.truncate().length_squared().min(1.0)).ln_1p();
            [-((exponent + 1.0) * log).exp_m1(), if turn < 0.0 { turn + 1.0 } else { turn }]
        } else {
            hemisphere::invert(wo)
        };
        Some([unchoose((is_lobe, rest), glossy), u, v, gamma[3]])
    }
}
