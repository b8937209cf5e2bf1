//! Lambertian reflection.

use super::{Evaluation, Letter, Scatter};
use crate::math::{Row, warp::hemisphere};
use crate::texture::{Colour, Site};
use glam::DVec3;
use std::f64::consts::FRAC_1_PI;

/// Reflects `reflectance` (0 to 1) of the light evenly into all directions on the side of the normal.
#[derive(Clone, Debug, PartialEq)]
pub struct Diffuse {
    /// Reflected share of the light.
    pub reflectance: Colour,
}

impl Diffuse {
    #[inline]
    pub(super) fn evaluate(&self, site: &Site, wi: DVec3, wo: DVec3) -> Option<Evaluation> {
        (wi.z > 0.0 && wo.z > 0.0).then(|| Evaluation {
            value: self.reflectance.at(site) * FRAC_1_PI,
            pdf: hemisphere::pdf(wo),
            pdf_reverse: hemisphere::pdf(wi),
            letter: Letter::D,
        })
    }

    #[inline]
    pub(super) fn sample(&self, site: &Site, wi: DVec3, row: Row) -> Option<Scatter> {
        let direction = hemisphere::sample([row[1], row[2]]);
        (wi.z > 0.0 && direction.z > 0.0).then(|| Scatter {
            direction,
            weight: self.reflectance.at(site),
            pdf: hemisphere::pdf(direction),
            pdf_reverse: hemisphere::pdf(wi),
            delta: false,
            letter: Letter::D,
            eta: 1.0,
        })
    }

    pub(super) fn invert(&self, wi: DVec3, wo: DVec3, gamma: Row) -> Option<Row> {
        let [u, v] = hemisphere::invert(wo);
        (wi.z > 0.0 && wo.z > 0.0).then_some([gamma[0], u, v, gamma[3]])
    }
}
