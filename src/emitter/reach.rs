//! The sphere around the scene: where light from infinity starts its walk.

use crate::math::{Frame, Row, warp};
use glam::DVec3;
use std::f64::consts::PI;

/// A sphere around the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// Its centre.
    pub center: DVec3,
    /// Its radius, positive.
    pub radius: f64,
}

impl Reach {
    /// Density per area of the points that parallel rays pass.
    #[inline]
    pub(super) fn beam_pdf(&self) -> f64 {
        warp::disk::PDF / (self.radius * self.radius)
    }

    /// Area of the sphere's shadow in m².
    pub(super) fn shadow(&self) -> f64 {
        PI * self.radius * self.radius
    }

    /// Where a ray starts that comes from the unit vector `towards`: on a disk that covers the scene.
    #[inline]
    pub(super) fn origin(&self, towards: DVec3, row: Row) -> DVec3 {
        let frame = Frame::around(towards);
        let at = warp::disk::sample([row[1], row[2]]);
        self.center + (frame.tangent * at.x + frame.bitangent * at.y + towards) * self.radius
    }

    /// A row that [`Reach::origin`] maps to the origin of the ray from `towards` that passes `point`.
    pub(super) fn invert_origin(&self, towards: DVec3, point: DVec3, gamma: Row) -> Row {
        let local = Frame::around(towards).to_local(point - self.center) / self.radius;
        let [u, v] = warp::disk::invert(local.truncate());
        [gamma[0], u, v, gamma[3]]
    }
}
