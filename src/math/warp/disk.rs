//! The unit disk, by the concentric map of Shirley and Chiu (1997).

use glam::DVec2;
use std::f64::consts::{FRAC_1_PI, FRAC_PI_2, FRAC_PI_4};

/// Density on the disk, per unit area.
pub const PDF: f64 = FRAC_1_PI;

/// Maps [0, 1)² to the unit disk.
#[inline]
pub fn sample(u: [f64; 2]) -> DVec2 {
    let (a, b) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    if a == 0.0 && b == 0.0 {
        return DVec2::ZERO;
    }
    let (radius, angle) =
        if a.abs() > b.abs() { (a, FRAC_PI_4 * (b / a)) } else { (b, FRAC_PI_2 - FRAC_PI_4 * (a / b)) };
    let (sin, cos) = angle.sin_cos();
    DVec2::new(radius * cos, radius * sin)
}

/// The inverse of [`sample`].
#[inline]
pub fn invert(point: DVec2) -> [f64; 2] {
    let radius = point.length();
    let (a, b) = if point.x.abs() > point.y.abs() {
        let a = radius.copysign(point.x);
        (a, a * (point.y / point.x).atan() / FRAC_PI_4)
    } else if radius > 0.0 {
        let b = radius.copysign(point.y);
        (b * (point.x / point.y).atan() / FRAC_PI_4, b)
    } else {
        (0.0, 0.0)
    };
    [0.5 * (a + 1.0), 0.5 * (b + 1.0)]
}
