//! How far perturbations go: by a radius whose logarithm is uniform, in any direction (Veach and Guibas 1997, section
//! 5.3.1). The density depends on the distance alone, so that both ways are as likely.

use crate::math::{Frame, Stream};
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// The smallest and the largest radius.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Radii {
    /// The smallest.
    pub least: f64,
    /// The largest.
    pub most: f64,
}

impl Radii {
    /// On a film of `size`, in pixels: from a tenth of one up to a disk that covers a twentieth of the film.
    pub(super) fn on_film([width, height]: [usize; 2]) -> Self {
        let most = (0.05 * (width * height) as f64 / PI).sqrt();
        Self { least: f64::min(0.1, 0.1 * most), most }
    }

    /// A step in a plane.
    pub(super) fn step(self, stream: &mut Stream) -> DVec2 {
        let radius = self.least * (self.most / self.least).powf(stream.number());
        DVec2::from_angle(TAU * stream.number()) * radius
    }

    /// A unit vector that makes an angle of one of the radii with `direction`.
    pub(super) fn turn(self, direction: DVec3, stream: &mut Stream) -> DVec3 {
        let step = self.step(stream);
        let angle = step.length();
        let Frame { tangent, bitangent, normal } = Frame::around(direction);
        let sideways = (tangent * step.x + bitangent * step.y) / angle;
        normal * angle.cos() + sideways * angle.sin()
    }
}
