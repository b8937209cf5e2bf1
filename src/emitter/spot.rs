//! An isolated point that shines into a cone. The intensity falls linearly with the angle from the edge of the beam to
//! the cutoff, as in Mitsuba.

use super::Start;
use crate::math::{AreaPdf, Frame, Row, SolidAnglePdf, warp};
use crate::spectrum::Spectrum;
use glam::DVec3;
use std::f64::consts::TAU;

/// A spot light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Where it is.
    pub position: DVec3,
    /// Unit vector along the middle of the cone.
    pub axis: DVec3,
    /// Radiant intensity within the beam, in W/sr.
    pub intensity: Spectrum,
    /// Angle to the axis where there is no more light, in (0, π].
    pub cutoff: f64,
    /// Angle to the axis up to which the intensity is full, at most the cutoff.
    pub beam: f64,
}

impl Spot {
    #[inline]
    pub(super) fn start(&self) -> (Start, AreaPdf) {
        (Start::Point { position: self.position }, AreaPdf(1.0))
    }

    /// Intensity along the unit vector `direction`.
    #[inline]
    pub(super) fn intensity(&self, direction: DVec3) -> Spectrum {
        let angle = self.axis.angle_between(direction);
        if angle <= self.beam {
            self.intensity
        } else if angle < self.cutoff {
            self.intensity * ((self.cutoff - angle) / (self.cutoff - self.beam))
        } else {
            Spectrum::BLACK
        }
    }

    /// Height of the cap that the cone cuts from the unit sphere.
    #[inline]
    fn cap(&self) -> f64 {
        let half = (0.5 * self.cutoff).sin();
        2.0 * half * half
    }

    #[inline]
    pub(super) fn emit(&self, position: DVec3, row: Row) -> (DVec3, DVec3, Spectrum) {
        let local = warp::cone::sample([row[1], row[2]], self.cap());
        let direction = Frame::around(self.axis).to_world(local);
        (position, direction, self.intensity(direction) / warp::cone::pdf(self.cap()).0)
    }

    /// A row that [`Spot::emit`] maps to `direction`; `None` outside the cone.
    pub(super) fn invert_emission(&self, direction: DVec3, gamma: Row) -> Option<Row> {
        let [u, v] = warp::cone::invert(Frame::around(self.axis).to_local(direction), self.cap());
        (u < 1.0).then_some([gamma[0], u, v, gamma[3]])
    }

    #[inline]
    pub(super) fn direction_pdf(&self, direction: DVec3) -> SolidAnglePdf {
        if self.axis.angle_between(direction) < self.cutoff { warp::cone::pdf(self.cap()) } else { SolidAnglePdf(0.0) }
    }

    /// The integral of the intensity: of cosines over the beam, by parts over the edge.
    pub(super) fn power(&self) -> f64 {
        let edge = self.cutoff - self.beam;
        let mean = if edge > 0.0 { (self.cutoff.sin() - self.beam.sin()) / edge } else { self.cutoff.cos() };
        self.intensity.luminance() * TAU * (1.0 - mean)
    }
}
