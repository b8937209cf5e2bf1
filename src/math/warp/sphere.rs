//! The unit sphere, uniformly.

use crate::math::SolidAnglePdf;
use glam::DVec3;
use std::f64::consts::{FRAC_1_PI, TAU};

/// Density on the sphere.
pub const PDF: SolidAnglePdf = SolidAnglePdf(0.25 * FRAC_1_PI);

/// Maps [0, 1)² to unit vectors (z is uniform after Archimedes).
#[inline]
pub fn sample(u: [f64; 2]) -> DVec3 {
    let z = 1.0 - 2.0 * u[0];
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (TAU * u[1]).sin_cos();
    DVec3::new(radius * cos, radius * sin, z)
}

/// The inverse of [`sample`].
#[inline]
pub fn invert(direction: DVec3) -> [f64; 2] {
    let turn = direction.y.atan2(direction.x) / TAU;
    [0.5 * (1.0 - direction.z), if turn < 0.0 { turn + 1.0 } else { turn }]
}
