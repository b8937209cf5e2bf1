//! How far a ray's origin must be moved off the surface it starts from.
//!
//! With unit roundoff u = 2^-53 and M the largest absolute coordinate of the shape (translation included), the distance
//! of a point to the plane of its triangle is uncertain by: 4 u M per component for the point from its barycentrics,
//! u M for adding the offset, u M for moving the origin to the hierarchy's frame, and 4 u |p - o| for the plane's
//! side test, whose normal is exact to 2 u (see [`geometric_normal`]). Together that is below 20 u M = 2.3e-15 M, for
//! every shape of triangle and every direction. [`OFFSET`] is fifty times that.

use glam::DVec3;

/// Offset along the geometric normal, relative to the largest absolute coordinate of the shape's vertices, that
/// suffices for a ray to leave the surface: 2^-43 = 1.1e-13.
pub const OFFSET: f64 = 1.0 / (1u64 << 43) as f64;

/// The distance along [`geometric_normal`] by which to move a point, computed from its barycentrics in `f64`, to the
/// side that the ray leaves to. Less than it, a wall in front can be told from the surface itself.
#[must_use]
#[inline]
pub fn of_triangle(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    OFFSET * a.abs().max(b.abs()).max(c.abs()).max_element()
}

/// `a b - c d` with an error of 1.5 ulp, however much cancels (Kahan; Jeannerod, Louvet, Muller 2013, Algorithm 1).
#[must_use]
#[inline]
pub fn difference_of_products(a: f64, b: f64, c: f64, d: f64) -> f64 {
    let cd = c * d;
    let error = (-c).mul_add(d, cd);
    a.mul_add(b, -cd) + error
}

/// The cross product, each component accurate to 1.5 ulp.
#[must_use]
#[inline]
pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        difference_of_products(a[1], b[2], a[2], b[1]),
        difference_of_products(a[2], b[0], a[0], b[2]),
        difference_of_products(a[0], b[1], a[1], b[0]),
    ]
}

/// The unit normal of the triangle (counter-clockwise seen from its tip), accurate also for slivers; `None` if the
/// triangle has no area.
#[must_use]
pub fn geometric_normal(a: DVec3, b: DVec3, c: DVec3) -> Option<DVec3> {
    DVec3::from(cross((b - a).to_array(), (c - a).to_array())).try_normalize()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;

    #[test]
    fn difference_of_products_survives_cancellation() {
        // (2^27 + 1)^2 - (2^27) (2^27 + 2) = 1, lost by plain arithmetic since 2^54 + 2^28 + 1 needs 55 bits.
        let big = f64::from(1 << 27);
        assert_eq!(difference_of_products(big + 1.0, big + 1.0, big, big + 2.0), 1.0);
        assert_ne!((big + 1.0) * (big + 1.0) - big * (big + 2.0), 1.0);
    }

    #[test]
    fn normal_of_a_sliver_is_exact_and_a_line_has_none() {
        let (a, b) = (DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0));
        let c = DVec3::new(2.0, 2.0 + f64::from(f32::EPSILON), 0.0);
        assert_eq!(geometric_normal(a, b, c), Some(DVec3::Z));
        assert_eq!(geometric_normal(a, b, 2.0 * b), None);
        assert_eq!(geometric_normal(a, a, b), None);
    }
}
