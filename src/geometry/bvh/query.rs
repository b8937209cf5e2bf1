//! What a traversal needs to know about a ray, computed once.

use glam::{DVec3, Vec3};
use std::hint::select_unpredictable as select;

use super::frame::Frame;
use crate::geometry::Ray;

/// Local coordinates of everything in a [`Frame`] lie within \[-1, 1\]; origins beyond this are first moved to the box.
const NEAR: f64 = 2.0;
/// Smallest magnitude of a direction component for the box test, so that its inverse stays finite.
const LEAST_DIRECTION: f32 = 1.0 / (1u64 << 50) as f32;
/// Absolute part of the box test's tolerance; with the bound above it spans more than the scene, so that a ray within
/// the plane of a box's face stays inside. Far above the rounding of the exact test (about 2^-50).
const LEAST_PAD: f32 = 1.0 / (1u64 << 46) as f32;
/// Relative part of the box test's tolerance: rounding the origin to `f32` and the product with the inverse direction.
const PAD: f32 = 1.0 / (1u64 << 22) as f32;

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
    /// That origin.
    point: DVec3,
    /// Bound on its rounding, as [`Clipped::slack`].
    slack: f64,
    /// Its largest absolute coordinate, for the error bounds.
    pub magnitude: f32,
    /// The shear in `f32`.
    pub shear32: [f32; 3],
    /// The origin in `f32`, x and y sheared.
    pub origin32: [f32; 3],
    /// The triangle that the ray starts from, which it cannot meet again; [`crate::geometry::NO_TRIANGLE`] for none.
    pub leaving: u32,
}

impl Query {
    /// `None` if the ray cannot hit anything: it is not a ray (see [`Ray`]), or misses the frame's box.
    #[inline(always)]
    pub fn new(ray: &Ray, leaving: u32, frame: &Frame) -> Option<Self> {
        let origin = frame.to_local(ray.origin);
        let length = ray.direction.length_squared();
        let tmax = ray.tmax * frame.scale;
        // Written so that NaN fails.
        if !(length > 0.25 && length < 4.0 && tmax > 0.0) {
            return None;
        }
        let Clipped { start, point, slack } = if origin.abs().max_element() <= NEAR {
            Clipped { start: 0.0, point: origin, slack: 0.0 }
        } else {
            clip(origin, ray.direction, tmax)?
        };
        let size = ray.direction.abs();
        // Which axis is the largest cannot be foreseen: chosen without branches.
        let first = size.x > size.y && size.x > size.z;
        let second = !first && size.y > size.z;
        let last = select(first, 0, select(second, 1, 2));
        let next = select(first, 1, select(second, 2, 0));
        let axes = [next, 3 - next - last, last];
        let permute = |v: DVec3| {
            [
                select(first, v.y, select(second, v.z, v.x)),
                select(first, v.z, select(second, v.x, v.y)),
                select(first, v.x, select(second, v.y, v.z)),
            ]
        };
        let (direction, place) = (permute(ray.direction), permute(point));
        let unit = 1.0 / direction[2];
        let shear = [direction[0] * unit, direction[1] * unit, unit];
        Some(Self {
            leaving,
            axes,
            origin: permute(origin),
            direction,
            shear,
            tmax,
            start,
            point,
            slack,
            magnitude: (point.abs().max_element() + slack) as f32,
            shear32: [shear[0] as f32, shear[1] as f32, shear[2] as f32],
            origin32: [
                (place[0] - shear[0] * place[2]) as f32,
                (place[1] - shear[1] * place[2]) as f32,
                place[2] as f32,
            ],
        })
    }
}

/// The constants of the box test for one ray, per axis.
pub struct Slabs {
    /// Which of the two planes of a box comes first along the ray: 0 for the lower, 1 for the upper.
    pub near: [usize; 3],
    /// Inverse direction.
    pub inverse: Vec3,
    /// `inverse * origin`, tolerance included, for the near planes.
    pub near_origin: Vec3,
    /// `inverse * origin`, tolerance included, for the far planes.
    pub far_origin: Vec3,
}

impl Slabs {
    /// `query` is that of `ray`.
    #[inline(always)]
    pub fn new(ray: &Ray, query: &Query) -> Self {
        let (d, o) = (ray.direction.as_vec3(), query.point.as_vec3());
        let inverse = d.abs().max(Vec3::splat(LEAST_DIRECTION)).copysign(d).recip();
        // The tolerance moves near planes nearer and far planes farther, whichever way the ray goes.
        let pad = (PAD * (o.abs() + query.slack as f32) + LEAST_PAD).copysign(d);
        Self {
            // By the sign of the inverse, which a direction of -0 has too.
            near: [
                usize::from(d.x.is_sign_negative()),
                usize::from(d.y.is_sign_negative()),
                usize::from(d.z.is_sign_negative()),
            ],
            inverse,
            near_origin: inverse * (o + pad),
            far_origin: inverse * (o - pad),
        }
    }
}

/// Where the `f32` part of a query starts.
struct Clipped {
    /// Distance from the ray's origin.
    start: f64,
    /// The point there.
    point: DVec3,
    /// Bound on that point's rounding, as the coordinate whose rounding in `f32` would be as large.
    slack: f64,
}

/// Moves a far origin to where the ray enters the frame's box; `None` if the ray misses the box.
#[cold]
fn clip(origin: DVec3, direction: DVec3, tmax: f64) -> Option<Clipped> {
    if !origin.is_finite() {
        return None;
    }
    // Slightly larger than the box, relative to the origin's distance, so that rounding loses nothing.
    let distance = origin.abs().max_element();
    let half = DVec3::splat(1.0 + 8.0 * f64::EPSILON * distance);
    let inverse = direction.abs().max(DVec3::splat(1e-300)).copysign(direction).recip();
    let (a, b) = ((-half - origin) * inverse, (half - origin) * inverse);
    let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
    if !(enter <= leave * (1.0 + 4.0 * f64::EPSILON) && leave > 0.0 && enter < tmax) {
        return None;
    }
    let start = enter.max(0.0);
    let ratio = f64::EPSILON / f64::from(f32::EPSILON);
    Some(Clipped { start, point: origin + start * direction, slack: 4.0 * ratio * distance })
}
