//! What a traversal needs to know about a ray, computed once.

use glam::DVec3;
use wide::f32x8;

use super::frame::Frame;
use crate::geometry::Ray;

/// Local coordinates of everything in a [`Frame`] lie within \[-1, 1\]; origins beyond this are first moved to the box.
const NEAR: f64 = 2.0;
/// Smallest magnitude of a direction component for the box test, so that its inverse stays finite.
const LEAST_DIRECTION: f64 = 1.0 / (1u64 << 50) as f64;
/// Absolute part of the box test's tolerance; with the bound above it spans more than the scene, so that a ray within
/// the plane of a box's face stays inside. Far above the rounding of the exact test (about 2^-50).
const LEAST_PAD: f64 = 1.0 / (1u64 << 46) as f64;
/// Relative part of the box test's tolerance: rounding the origin to `f32` and the product with the inverse direction.
const PAD: f64 = 1.0 / (1u64 << 22) as f64;

/// The constants of one ray, in the hierarchy's frame.
pub struct Query {
    /// Permutation of the axes: the last one is the direction's largest component.
    pub axes: [usize; 3],
    /// Origin, axes permuted.
    pub origin: [f64; 3],
    /// Direction, axes permuted.
    pub direction: [f64; 3],
    /// `x' = x - shear[0] z`, `y' = y - shear[1] z`, `z' = shear[2] z` brings the direction to (0, 0, 1)
    /// (Woop, Benthin, Wald 2013, equation 1).
    pub shear: [f64; 3],
    /// Distance limit, in local units.
    pub tmax: f64,
    /// How far along the ray the origin of the `f32` part lies, in local units.
    pub start: f64,
    /// Largest absolute coordinate of that origin, for the error bounds.
    pub magnitude: f32,
    /// The shear in `f32`.
    pub shear32: [f32x8; 3],
    /// The sheared origin in `f32`.
    pub origin32: [f32x8; 3],
    /// Which of a node's six planes come first along the ray; the others are these XOR 1.
    pub near: [usize; 3],
    /// Inverse direction.
    pub inverse: [f32x8; 3],
    /// `inverse * origin`, tolerance included, for the near planes.
    pub near_origin: [f32x8; 3],
    /// `inverse * origin`, tolerance included, for the far planes.
    pub far_origin: [f32x8; 3],
}

impl Query {
    /// `None` if the ray cannot hit anything: it is not a ray (see [`Ray`]), or misses the frame's box.
    #[inline]
    pub fn new(ray: &Ray, frame: &Frame) -> Option<Self> {
        let origin = frame.to_local(ray.origin);
        let length = ray.direction.length_squared();
        let tmax = ray.tmax * frame.scale;
        // Written so that NaN fails.
        if !(length > 0.25 && length < 4.0 && tmax > 0.0) {
            return None;
        }
        let (start, clipped, slack) = if origin.abs().max_element() <= NEAR && origin.is_finite() {
            (0.0, origin, 0.0)
        } else {
            clip(origin, ray.direction, tmax)?
        };
        Some(Self::with_start(origin, ray.direction, tmax, start, clipped, slack))
    }

    #[inline]
    fn with_start(origin: DVec3, direction: DVec3, tmax: f64, start: f64, clipped: DVec3, slack: f64) -> Self {
        let (o, d, c) = (origin.to_array(), direction.to_array(), clipped.to_array());
        let size = direction.abs();
        let last = if size.x > size.y {
            if size.x > size.z { 0 } else { 2 }
        } else if size.y > size.z {
            1
        } else {
            2
        };
        let axes = [[1, 2, 0], [2, 0, 1], [0, 1, 2]][last];
        let permute = |v: [f64; 3]| axes.map(|axis| v[axis]);
        let (dp, cp) = (permute(d), permute(c));
        let unit = 1.0 / dp[2];
        let shear = [dp[0] * unit, dp[1] * unit, unit];
        let splat = |v: f64| f32x8::splat(v as f32);
        let bounded = d.map(|d| if d.abs() < LEAST_DIRECTION { LEAST_DIRECTION.copysign(d) } else { d });
        let inverse = bounded.map(|d| 1.0 / d as f32);
        // The tolerance moves near planes nearer and far planes farther, whichever way the ray goes.
        let pad = |i: usize| ((PAD * (c[i].abs() + slack) + LEAST_PAD) as f32).copysign(inverse[i]);
        let folded = |sign: f32| [0, 1, 2].map(|i| f32x8::splat(inverse[i] * (c[i] as f32 + sign * pad(i))));
        Self {
            axes,
            origin: permute(o),
            direction: dp,
            shear,
            tmax,
            start,
            magnitude: (clipped.abs().max_element() + slack) as f32,
            shear32: shear.map(splat),
            origin32: [splat(cp[0] - shear[0] * cp[2]), splat(cp[1] - shear[1] * cp[2]), splat(cp[2])],
            near: [0, 1, 2].map(|i| 2 * i + usize::from(inverse[i] < 0.0)),
            inverse: inverse.map(f32x8::splat),
            near_origin: folded(1.0),
            far_origin: folded(-1.0),
        }
    }
}

/// Moves a far origin to where the ray enters the frame's box: the distance, the point, and a bound on its rounding
/// in the units of `f32`'s own (so that it adds to the coordinate's magnitude). `None` if the ray misses the box.
#[cold]
fn clip(origin: DVec3, direction: DVec3, tmax: f64) -> Option<(f64, DVec3, f64)> {
    if !origin.is_finite() {
        return None;
    }
    // Slightly larger than the box, relative to the origin's distance, so that rounding loses nothing.
    let distance = origin.abs().max_element();
    let half = 1.0 + 8.0 * f64::EPSILON * distance;
    let inverse = direction.map(|d| 1.0 / if d.abs() < 1e-300 { 1e-300f64.copysign(d) } else { d });
    let (a, b) = ((-half - origin) * inverse, (half - origin) * inverse);
    let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
    if !(enter <= leave * (1.0 + 4.0 * f64::EPSILON) && leave > 0.0 && enter < tmax) {
        return None;
    }
    let start = enter.max(0.0);
    let ratio = f64::EPSILON / f64::from(f32::EPSILON);
    Some((start, origin + start * direction, 4.0 * ratio * distance))
}
