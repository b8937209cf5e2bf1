//! The ray.

use glam::DVec3;

/// The half-line `origin + t direction` for `0 < t < tmax`, in scene units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where the ray starts.
    pub origin: DVec3,
    /// Unit vector. A direction that is not a number, zero, or far from unit length hits nothing.
    pub direction: DVec3,
    /// Hits at or beyond this distance do not count; may be infinite. Not a number: hits nothing.
    pub tmax: f64,
}

impl Ray {
    /// A ray without an end. `direction` is a unit vector.
    #[must_use]
    pub const fn new(origin: DVec3, direction: DVec3) -> Self {
        Self { origin, direction, tmax: f64::INFINITY }
    }

    /// The point at distance `t`. The error grows with the distance travelled: a surface's own parametrisation
    /// (barycentrics, [`super::Solid::surface_point`]) gives the better hit point.
    #[must_use]
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + t * self.direction
    }
}
