//! Analytic shapes, all in `f64`.
//!
//! To add a shape, add a variant: the compiler then lists what it needs. Texture coordinates are those of Mitsuba.

use crate::math::Frame;
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

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
        /// Its texture turns around the third of these unit axes, from the first to the second.
        axes: Frame,
    },
    /// A flat disk, hit from both sides.
    Disk {
        /// Centre, in scene units.
        center: DVec3,
        /// Unit normal.
        normal: DVec3,
        /// Radius > 0, in scene units.
        radius: f64,
        /// Its texture turns from the first to the second of these unit axes in its plane.
        axes: [DVec3; 2],
    },
    /// The side of a cylinder, hit from both sides; without caps.
    Cylinder {
        /// Middle of the bottom, in scene units.
        bottom: DVec3,
        /// The third unit axis points to the top; the texture turns from the first to the second.
        axes: Frame,
        /// Length > 0, in scene units.
        length: f64,
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

/// Where a point lies on a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chart {
    /// Texture coordinates.
    pub uv: DVec2,
    /// Derivatives of the position by them; zero along u at the poles of a sphere.
    pub derivatives: [DVec3; 2],
}

impl Solid {
    /// A sphere whose texture turns around +z.
    #[must_use]
    pub fn sphere(center: DVec3, radius: f64) -> Self {
        let axes = Frame { tangent: DVec3::X, bitangent: DVec3::Y, normal: DVec3::Z };
        Self::Sphere { center, radius, axes }
    }

    /// A disk whose texture starts anywhere.
    #[must_use]
    pub fn disk(center: DVec3, normal: DVec3, radius: f64) -> Self {
        let Frame { tangent, bitangent, .. } = Frame::around(normal);
        Self::Disk { center, normal, radius, axes: [tangent, bitangent] }
    }

    /// The side of a cylinder from the middle of its bottom to that of its top, which must be apart; its texture starts
    /// anywhere.
    #[must_use]
    pub fn cylinder(bottom: DVec3, top: DVec3, radius: f64) -> Self {
        let length = (top - bottom).length();
        Self::Cylinder { bottom, axes: Frame::around((top - bottom) / length), length, radius }
    }

    /// True if all numbers are finite, lengths are positive and axes have unit length.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let (center, radius, length, axis) = match *self {
            Self::Sphere { center, radius, .. } => (center, radius, radius, DVec3::Z),
            Self::Disk { center, normal, radius, .. } => (center, radius, radius, normal),
            Self::Cylinder { bottom, axes, length, radius } => (bottom, radius, length, axes.normal),
        };
        let positive = |length: f64| length.is_finite() && length > 0.0;
        center.is_finite() && positive(radius) && positive(length) && axis.is_normalized()
    }

    /// The smallest axis-aligned box, up to rounding.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        match *self {
            Self::Sphere { center, radius, .. } => {
                let half = DVec3::splat(radius);
                Bounds { min: center - half, max: center + half }
            }
            Self::Disk { center, normal, radius, .. } => {
                let half = extent_of_circle(normal, radius);
                Bounds { min: center - half, max: center + half }
            }
            Self::Cylinder { bottom, axes, length, radius } => {
                let half = extent_of_circle(axes.normal, radius);
                let top = bottom + axes.normal * length;
                Bounds { min: bottom.min(top) - half, max: bottom.max(top) + half }
            }
        }
    }

    /// Surface area, in squared scene units; one side of a disk or of a cylinder.
    #[must_use]
    pub fn area(&self) -> f64 {
        match *self {
            Self::Sphere { radius, .. } => 4.0 * PI * radius * radius,
            Self::Disk { radius, .. } => PI * radius * radius,
            Self::Cylinder { length, radius, .. } => TAU * radius * length,
        }
    }

    /// The distance of the nearest hit with `0 < t < tmax` (strict).
    #[must_use]
    pub fn intersect(&self, ray: &Ray) -> Option<f64> {
        let inside = |t: &f64| *t > 0.0 && *t < ray.tmax;
        match *self {
            Self::Sphere { center, radius, .. } => {
                sphere_roots(ray.origin - center, ray.direction, radius)?.into_iter().find(inside)
            }
            Self::Disk { center, normal, radius, .. } => {
                let t = normal.dot(center - ray.origin) / normal.dot(ray.direction);
                Some(t).filter(inside).filter(|t| (ray.at(*t) - center).length_squared() <= radius * radius)
            }
            Self::Cylinder { bottom, axes, length, radius } => {
                let between = |t: &f64| (0.0..=length).contains(&axes.normal.dot(ray.at(*t) - bottom));
                cylinder_roots(ray.origin - bottom, ray.direction, axes.normal, radius)?
                    .into_iter()
                    .find(|t| inside(t) && between(t))
            }
        }
    }

    /// Brings a point near the surface (a ray's point at the hit distance) onto it.
    #[must_use]
    pub fn surface_point(&self, near: DVec3) -> SurfacePoint {
        let scale = self.bounds().max_abs();
        let (position, normal) = match *self {
            Self::Sphere { center, radius, .. } => {
                let normal = (near - center).try_normalize().unwrap_or(DVec3::Z);
                (center + radius * normal, normal)
            }
            Self::Disk { center, normal, .. } => (near - normal.dot(near - center) * normal, normal),
            Self::Cylinder { bottom, axes, length, radius } => {
                let height = axes.normal.dot(near - bottom).clamp(0.0, length);
                let foot = bottom + height * axes.normal;
                let away = near - foot;
                let normal = (away - axes.normal.dot(away) * axes.normal).try_normalize().unwrap_or(axes.tangent);
                (foot + radius * normal, normal)
            }
        };
        // Four roundings of at most 2^-53 of the largest coordinate in each of three components, doubled.
        SurfacePoint { position, normal, error: 16.0 * f64::EPSILON * scale, offset: OFFSET * scale }
    }

    /// Where a point of the surface lies on the shape's texture.
    #[must_use]
    pub fn chart(&self, position: DVec3) -> Chart {
        match *self {
            Self::Sphere { center, radius, axes } => {
                let local = axes.to_local(position - center);
                let v = (local.z / radius).clamp(-1.0, 1.0).acos() / PI;
                let around = TAU * (axes.bitangent * local.x - axes.tangent * local.y);
                let flat = DVec2::new(local.x, local.y);
                let outwards = flat.try_normalize().unwrap_or(DVec2::X) * local.z;
                let down = PI * axes.to_world(outwards.extend(-flat.length()));
                Chart { uv: DVec2::new(turn(local.x, local.y), v), derivatives: [around, down] }
            }
            Self::Disk { center, radius, axes, .. } => {
                let away = position - center;
                let (x, y) = (away.dot(axes[0]), away.dot(axes[1]));
                let outwards = DVec2::new(x, y).try_normalize().unwrap_or(DVec2::X);
                let along = radius * (axes[0] * outwards.x + axes[1] * outwards.y);
                let around = TAU * (axes[1] * x - axes[0] * y);
                Chart { uv: DVec2::new(x.hypot(y) / radius, turn(x, y)), derivatives: [along, around] }
            }
            Self::Cylinder { bottom, axes, length, .. } => {
                let local = axes.to_local(position - bottom);
                let around = TAU * (axes.bitangent * local.x - axes.tangent * local.y);
                let derivatives = [around, axes.normal * length];
                Chart { uv: DVec2::new(turn(local.x, local.y), local.z / length), derivatives }
            }
        }
    }
}

/// The angle of (x, y) from +x in whole turns, from 0 to 1.
fn turn(x: f64, y: f64) -> f64 {
    let turn = y.atan2(x) / TAU;
    if turn < 0.0 { turn + 1.0 } else { turn }
}

/// Half the extents of a circle along the coordinate axes: the radius times the sine of the angle between the axis and
/// the circle's normal.
fn extent_of_circle(normal: DVec3, radius: f64) -> DVec3 {
    (DVec3::ONE - normal * normal).max(DVec3::ZERO).map(f64::sqrt) * radius
}

/// Both distances at which a line meets the endless cylinder around `axis` through the origin, in ascending order: the
/// line is seen along the axis, where the cylinder is a circle.
fn cylinder_roots(origin: DVec3, direction: DVec3, axis: DVec3, radius: f64) -> Option<[f64; 2]> {
    let across = |v: DVec3| v - axis.dot(v) * axis;
    let flat = across(direction);
    let speed = flat.length();
    // A line along the axis never meets the side.
    if speed == 0.0 {
        return None;
    }
    Some(sphere_roots(across(origin), flat / speed, radius)?.map(|root| root / speed))
}

/// Both roots in ascending order, for a ray from `to_origin` as seen from the centre. The discriminant comes from the
/// distance of the centre to the ray, and the root with cancellation from the other one (Haines, Günther,
/// Akenine-Möller 2019, "Precision improvements for ray/sphere intersection", Ray Tracing Gems, equations 5 to 10).
fn sphere_roots(to_origin: DVec3, direction: DVec3, radius: f64) -> Option<[f64; 2]> {
    // The direction's length is one only up to rounding: a relative error of the roots, but not of their signs.
    let b = -to_origin.dot(direction);
    let nearest = to_origin + b * direction;
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

#[cfg(test)]
mod tests {
    use super::*;

    fn close(chart: Chart, uv: [f64; 2], dp_du: [f64; 3]) {
        assert!((chart.uv - DVec2::from(uv)).length() < 2e-4, "{chart:?} {uv:?}");
        assert!((chart.derivatives[0] - DVec3::from(dp_du)).length() < 1e-3, "{chart:?} {dp_du:?}");
    }

    /// What Mitsuba 3.9.1 answers at the same points.
    #[test]
    fn charts_are_mitsubas() {
        let sphere = Solid::sphere(DVec3::ZERO, 1.0);
        close(sphere.chart(DVec3::new(0.2843, 0.4696, 0.8359)), [0.1634, 0.1850], [-2.9503, 1.7861, 0.0]);
        close(sphere.chart(DVec3::new(-0.2843, -0.4696, 0.8359)), [0.6634, 0.1850], [2.9503, -1.7861, 0.0]);
        let disk = Solid::disk(DVec3::ZERO, DVec3::Z, 1.0);
        close(disk.chart(DVec3::new(0.2, -0.3, 0.0)), [0.3606, 0.8436], [0.5547, -0.8321, 0.0]);
        let can = Solid::cylinder(DVec3::ZERO, DVec3::Z, 1.0);
        close(can.chart(DVec3::new(0.6371, -0.7708, 0.3079)), [0.8599, 0.3079], [4.8428, 4.0032, 0.0]);
        let tilted = Solid::cylinder(DVec3::new(1.0, 0.0, 0.0), DVec3::new(3.0, 1.0, 1.0), 0.5);
        close(tilted.chart(DVec3::new(2.0, 0.9041, 0.9593)), [0.4452, 0.6439], [0.1417, -2.3563, 2.0730]);
    }
}
