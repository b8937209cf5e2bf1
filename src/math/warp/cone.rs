//! Directions within an angle around +z, uniformly.

use crate::math::SolidAnglePdf;
use glam::DVec3;
use std::f64::consts::TAU;

/// Density of directions whose angle to +z has a cosine of at least 1 − `height`. The height of the cap stands for the
/// cosine, because for the sun almost nothing is left of one minus the other.
#[inline]
pub fn pdf(height: f64) -> SolidAnglePdf {
    SolidAnglePdf(1.0 / (TAU * height))
}

/// Maps [0, 1)² to unit vectors in the cap of `height`.
#[inline]
pub fn sample(u: [f64; 2], height: f64) -> DVec3 {
    let depth = u[0] * height;
    let radius = (depth * (2.0 - depth)).max(0.0).sqrt();
    let (sin, cos) = (TAU * u[1]).sin_cos();
    DVec3::new(radius * cos, radius * sin, 1.0 - depth)
}

/// The inverse of [`sample`].
#[inline]
pub fn invert(direction: DVec3, height: f64) -> [f64; 2] {
    let turn = direction.y.atan2(direction.x) / TAU;
    [depth(direction) / height, if turn < 0.0 { turn + 1.0 } else { turn }]
}

/// One minus the cosine of the angle to +z, also where the cosine is close to one.
#[inline]
pub fn depth(direction: DVec3) -> f64 {
    let radius_squared = direction.truncate().length_squared();
    if direction.z > 0.0 { radius_squared / (1.0 + direction.z) } else { 1.0 - direction.z }
}
