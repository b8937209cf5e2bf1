//! Barycentric coordinates, uniformly over a triangle. The density per area is 1 / area.

use glam::DVec2;

/// Maps [0, 1)² to the barycentric coordinates of the second and third vertex.
#[inline]
pub fn sample(u: [f64; 2]) -> DVec2 {
    let root = (1.0 - u[0]).sqrt();
    DVec2::new(1.0 - root, u[1] * root)
}

/// The inverse of [`sample`].
#[inline]
pub fn invert(barycentric: DVec2) -> [f64; 2] {
    let root = 1.0 - barycentric.x;
    [1.0 - root * root, if root > 0.0 { barycentric.y / root } else { 0.0 }]
}
