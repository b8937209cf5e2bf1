//! Axis-aligned boxes in scene units.

use glam::DVec3;

/// An axis-aligned box; empty while `min > max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest coordinates.
    pub min: DVec3,
    /// Largest coordinates.
    pub max: DVec3,
}

impl Bounds {
    /// The box of no points.
    pub const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// True for the box of no points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// The smallest box around this one and `point`.
    #[must_use]
    pub fn including(self, point: DVec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// The smallest box around this one and `other`.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The middle of the box; not a number if it is empty.
    #[must_use]
    pub fn centre(&self) -> DVec3 {
        0.5 * self.min + 0.5 * self.max
    }

    /// The centre and the radius of the sphere through the corners; a radius of 0 for the empty box.
    #[must_use]
    pub fn bounding_sphere(&self) -> (DVec3, f64) {
        if self.is_empty() { (DVec3::ZERO, 0.0) } else { (self.centre(), 0.5 * (self.max - self.min).length()) }
    }

    /// The largest absolute coordinate of any of its points; 0 if it is empty.
    #[must_use]
    pub fn max_abs(&self) -> f64 {
        if self.is_empty() { 0.0 } else { self.min.abs().max(self.max.abs()).max_element() }
    }
}
