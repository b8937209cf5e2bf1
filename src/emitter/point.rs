//! An isolated point that shines evenly into all directions.

use super::Start;
use crate::math::{AreaPdf, Row, warp};
use crate::spectrum::Spectrum;
use glam::DVec3;
use std::f64::consts::PI;

/// A point light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Where it is.
    pub position: DVec3,
    /// Radiant intensity in W/sr.
    pub intensity: Spectrum,
}

impl Point {
    #[inline]
    pub(super) fn start(&self) -> (Start, AreaPdf) {
        (Start::Point { position: self.position }, AreaPdf(1.0))
    }

    #[inline]
    pub(super) fn emit(&self, position: DVec3, row: Row) -> (DVec3, DVec3, Spectrum) {
        (position, warp::sphere::sample([row[1], row[2]]), self.intensity / warp::sphere::PDF.0)
    }

    /// A row that [`Point::emit`] maps to `direction`.
    pub(super) fn invert_emission(direction: DVec3, gamma: Row) -> Row {
        let [u, v] = warp::sphere::invert(direction);
        [gamma[0], u, v, gamma[3]]
    }

    pub(super) fn power(&self) -> f64 {
        self.intensity.luminance() * 4.0 * PI
    }
}
