//! Analytic shapes, all in `f64`.
//!
//! To add a shape, add a variant: the compiler then lists what it needs.

use glam::DVec3;

use super::offset::OFFSET;
use super::{Bounds, Ray};

/// A shape with a closed-form intersection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solid {
    /// A sphere, hit from both sides.
    Sphere {
        /// Centre, in scene units.
        center: DVec3,
        /// Radius > 0, in scene units.
        radius: f64,
    },
    /// A flat disk, hit from both sides.
    Disk {
        /// Centre, in scene units.
        center: DVec3,
        /// Unit normal.
        normal: DVec3,
        /// Radius > 0, in scene units.
        radius: f64,
    },
}

/// A point brought onto a surface, with what is needed to start a ray there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The point, on the surface up to `error`.
    pub position: DVec3,
    /// Outward unit normal (the given normal for a disk).
    pub normal: DVec3,
    /// Bound on the distance of `position` to the true surface, in scene units.
    pub error: f64,
    /// Distance along the normal, to either side, by which a ray's origin must be moved so that the ray never meets the
    /// surface that it leaves, in scene units.
    pub offset: f64,
}

impl Solid {
    /// True if all numbers are finite, the radius is positive and the normal has unit length.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let (center, radius, axis) = match *self {
            Self::Sphere { center, radius } => (center, radius, DVec3::Z),
            Self::Disk { center, normal, radius } => (center, radius, normal),
        };
        center.is_finite() && radius.is_finite() && radius > 0.0 && axis.is_normalized()
    }

    /// The smallest axis-aligned box, up to rounding.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        let (center, half) = match *self {
            Self::Sphere { center, radius } => (center, DVec3::splat(radius)),
            Self::Disk { center, normal, radius } => {
                // The extent along an axis is the radius times the sine of the angle between it and the normal.
                (center, (DVec3::ONE - normal * normal).max(DVec3::ZERO).map(f64::sqrt) * radius)
            }
        };
        Bounds { min: center - half, max: center + half }
    }

    /// Surface area, in squared scene units; one side of a disk.
    #[must_use]
    pub fn area(&self) -> f64 {
        match *self {
            Self::Sphere { radius, .. } => 4.0 * std::f64::consts::PI * radius * radius,
            Self::Disk { radius, .. } => std::f64::consts::PI * radius * radius,
        }
    }

    /// The distance of the nearest hit with `0 < t < tmax` (strict).
    #[must_use]
    pub fn intersect(&self, ray: &Ray) -> Option<f64> {
        let inside = |t: &f64| *t > 0.0 && *t < ray.tmax;
        match *self {
            Self::Sphere { center, radius } => sphere_roots(center, radius, ray)?.into_iter().find(inside),
            Self::Disk { center, normal, radius } => {
                let t = normal.dot(center - ray.origin) / normal.dot(ray.direction);
                Some(t).filter(inside).filter(|t| (ray.at(*t) - center).length_squared() <= radius * radius)
            }
        }
    }

    /// Brings a point near the surface (a ray's point at the hit distance) onto it.
    #[must_use]
    pub fn surface_point(&self, near: DVec3) -> SurfacePoint {
        let scale = self.bounds().max_abs();
        let (position, normal) = match *self {
            Self::Sphere { center, radius } => {
                let normal = (near - center).try_normalize().unwrap_or(DVec3::Z);
                (center + radius * normal, normal)
            }
            Self::Disk { center, normal, .. } => (near - normal.dot(near - center) * normal, normal),
        };
        // Four roundings of at most 2^-53 of the largest coordinate in each of three components, doubled.
        SurfacePoint { position, normal, error: 16.0 * f64::EPSILON * scale, offset: OFFSET * scale }
    }
}

/// Both roots in ascending order. The discriminant comes from the distance of the centre to the ray, and the root with
/// cancellation from the other one (Haines, Günther, Akenine-Möller 2019, "Precision improvements for ray/sphere
/// intersection", Ray Tracing Gems, equations 5 to 10).
fn sphere_roots(center: DVec3, radius: f64, ray: &Ray) -> Option<[f64; 2]> {
    let to_origin = ray.origin - center;
    // The direction's length is one only up to rounding: a relative error of the roots, but not of their signs.
    let b = -to_origin.dot(ray.direction);
    let nearest = to_origin + b * ray.direction;
    let discriminant = radius * radius - nearest.length_squared();
    // One that is not a number gives roots that are not, which no interval contains.
    if discriminant < 0.0 {
        return None;
    }
    let distance = to_origin.length();
    let c = (distance - radius) * (distance + radius);
    let q = b + discriminant.sqrt().copysign(b);
    // q = 0 only where the ray touches the sphere at its own origin: no hit ahead.
    let other = if q == 0.0 { 0.0 } else { c / q };
    Some(if q < other { [q, other] } else { [other, q] })
}
