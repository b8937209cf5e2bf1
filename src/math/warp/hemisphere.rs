//! The upper hemisphere, with density proportional to the cosine (Malley's method on the concentric disk).

use super::disk;
use crate::math::SolidAnglePdf;
use glam::DVec3;
use std::f64::consts::FRAC_1_PI;

/// Maps [0, 1)² to unit vectors with z ≥ 0.
#[inline]
pub fn sample(u: [f64; 2]) -> DVec3 {
    let p = disk::sample(u);
    DVec3::new(p.x, p.y, (1.0 - p.length_squared()).max(0.0).sqrt())
}

/// Density of `direction`: cos θ / π, zero below the horizon.
#[inline]
pub fn pdf(direction: DVec3) -> SolidAnglePdf {
    SolidAnglePdf(direction.z.max(0.0) * FRAC_1_PI)
}

/// The inverse of [`sample`].
#[inline]
pub fn invert(direction: DVec3) -> [f64; 2] {
    disk::invert(direction.truncate())
}
