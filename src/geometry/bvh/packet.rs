//! Up to eight triangles, one per SIMD lane: a filter in `f32` that never rejects a hit, and the exact test in `f64`.
//!
//! Source: Woop, Benthin, Wald 2013, "Watertight Ray/Triangle Intersection", JCGT 2(1). There `f32` decides, with a
//! fallback to `f64` on edges; here `f64` decides always, on the few triangles that the filter leaves, so that a ray
//! leaving a surface next to an edge does not meet the neighbour by rounding.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use wide::f32x8;

use super::query::Query;
use crate::geometry::offset::cross;

/// Eight triangles at most, in local units.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Packet {
    /// `vertices[vertex][axis]`; lanes without a triangle are NaN, which no comparison accepts.
    vertices: [[f32x8; 3]; 3],
    /// The caller's index of each triangle.
    pub ids: [u32; 8],
    /// Not below the largest absolute coordinate.
    magnitude: f32,
    /// Not below the longest edge.
    edge: f32,
    /// To the next multiple of the alignment.
    rest: [u32; 6],
}

/// Distance (local units) and barycentric coordinates of vertices 1 and 2.
#[derive(Clone, Copy, Debug)]
pub struct Refined {
    pub t: f64,
    pub u: f64,
    pub v: f64,
}

/// Bounds on the rounding errors of a packet's filter for one ray.
#[derive(Clone, Copy, Debug)]
pub struct Tolerance {
    /// Of edge functions.
    edge: f32,
    /// Of distances times determinants, where that does not grow with the determinant.
    volume: f32,
    /// Of distances.
    distance: f32,
}

impl Packet {
    /// Up to eight triangles with their indices; further ones are ignored.
    pub fn new(triangles: &[(u32, [Vec3; 3])]) -> Self {
        let mut lanes = [[[f32::NAN; 8]; 3]; 3];
        let (mut ids, mut magnitude, mut edge) = ([0; 8], 0f32, 0f32);
        for (lane, (id, triangle)) in triangles.iter().enumerate().take(8) {
            ids[lane] = *id;
            for (vertex, point) in triangle.iter().enumerate() {
                for axis in 0..3 {
                    lanes[vertex][axis][lane] = point[axis];
                }
                magnitude = magnitude.max(point.abs().max_element());
                edge = edge.max(point.distance(triangle[(vertex + 1) % 3]));
            }
        }
        Self { vertices: lanes.map(|v| v.map(f32x8::new)), ids, magnitude, edge, rest: [0; 6] }
    }

    /// Makes packets take the tolerance of the largest among them, so that it is found once for all.
    pub fn level(packets: &mut [Self]) {
        let most = |of: fn(&Self) -> f32| packets.iter().map(of).fold(0.0, f32::max);
        let (magnitude, edge) = (most(|packet| packet.magnitude), most(|packet| packet.edge));
        packets.iter_mut().for_each(|packet| (packet.magnitude, packet.edge) = (magnitude, edge));
    }

    /// What rounding can do to a ray's [`Packet::filter`].
    ///
    /// With u = 2^-24 and m the largest coordinate of packet and origin together, a sheared x or y is off by at most
    /// 6 m u < δ = 8 m u. If the ray meets the triangle, then its sheared vertices are no farther from the ray than
    /// √2 L (L the longest edge), and an edge function is off by less than 12 δ (L + δ) = e. In the distance times
    /// determinant, weights off by e act on the spread of z, below √3 L, and all else is relative to the determinant.
    #[inline(always)]
    pub fn tolerance(&self, query: &Query) -> Tolerance {
        const ROUNDOFF: f32 = 8.0 / (1u32 << 24) as f32;
        let delta = ROUNDOFF * (self.magnitude + query.magnitude);
        let edge = 12.0 * delta * (self.edge + delta);
        Tolerance { edge, volume: edge * (6.0 * self.edge + 16.0 * delta), distance: 4.0 * delta }
    }

    /// The lanes (bit mask) that may be hit at a distance of at most `limit` from the query's `f32` origin: all that
    /// [`Packet::refine`] accepts, and few others. `off` is the packet's [`Packet::tolerance`].
    #[inline(always)]
    pub fn filter(&self, query: &Query, off: &Tolerance, limit: f32) -> u32 {
        let volume_error = f32x8::splat(off.volume);
        let [sx, sy, sz] = query.shear32;
        let [sx, sy, sz] = [f32x8::splat(sx), f32x8::splat(sy), f32x8::splat(sz)];
        let [ox, oy, oz] = query.origin32;
        let [ox, oy, oz] = [f32x8::splat(ox), f32x8::splat(oy), f32x8::splat(oz)];
        let [kx, ky, kz] = query.axes;
        let sheared = |v: &[f32x8; 3]| {
            let (x, y, z) = (v[kx], v[ky], v[kz]);
            (z.mul_neg_add(sx, x) - ox, z.mul_neg_add(sy, y) - oy, (z - oz) * sz)
        };
        let [a, b, c] = &self.vertices;
        let ((ax, ay, az), (bx, by, bz), (cx, cy, cz)) = (sheared(a), sheared(b), sheared(c));
        let u = cx.mul_sub(by, cy * bx);
        let v = ax.mul_sub(cy, ay * cx);
        let w = bx.mul_sub(ay, by * ax);
        let tolerance = f32x8::splat(off.edge);
        let one_side = u.fast_min(v).fast_min(w).simd_ge(-tolerance) | u.fast_max(v).fast_max(w).simd_le(tolerance);
        let determinant = u + v + w;
        let sign = determinant & f32x8::splat(-0.0);
        let size = determinant ^ sign;
        let volume = u.mul_add(az, v.mul_add(bz, w * cz)) ^ sign;
        let latest = size.mul_add(f32x8::splat(limit + off.distance), volume_error);
        let earliest = size.mul_add(f32x8::splat(off.distance), volume_error);
        (one_side & volume.simd_le(latest) & (-volume).simd_le(earliest)).to_bitmask()
    }

    /// The hit of one lane with `0 < t < limit`, decided and computed in `f64` from the exact vertices.
    ///
    /// Edge functions without contraction have exactly opposite values on the two sides of an edge, and zero counts
    /// as inside: no ray passes between neighbours. The distance comes from the plane, whose side test is accurate
    /// next to the surface (see [`crate::geometry::offset`]).
    #[inline(always)]
    pub fn refine(&self, lane: usize, query: &Query, limit: f64) -> Option<Refined> {
        let corners = self.corners(lane, query);
        let relative = |p: [f64; 3]| minus(p, query.origin);
        let [ra, rb, rc] = [relative(corners[0]), relative(corners[1]), relative(corners[2])];
        let [za, zb, zc] = [ra[2] * query.shear[2], rb[2] * query.shear[2], rc[2] * query.shear[2]];
        let (least, most) = (lesser(za, lesser(zb, zc)), greater(za, greater(zb, zc)));
        if least >= limit {
            return None;
        }
        // First the plane: most candidates that fail are the surface that the ray leaves.
        let normal = cross(minus(corners[1], corners[0]), minus(corners[2], corners[0]));
        let (height, slope) = (dot(normal, ra), dot(normal, query.direction));
        if least <= 0.0 && height * slope.signum() <= 0.0 {
            return None;
        }
        let sheared = |r: [f64; 3]| [r[0] - query.shear[0] * r[2], r[1] - query.shear[1] * r[2]];
        let [a, b, c] = [sheared(ra), sheared(rb), sheared(rc)];
        let u = c[0] * b[1] - c[1] * b[0];
        let v = a[0] * c[1] - a[1] * c[0];
        let w = b[0] * a[1] - b[1] * a[0];
        let (low, high) = (lesser(u, lesser(v, w)), greater(u, greater(v, w)));
        let determinant = u + v + w;
        if (low < 0.0 && high > 0.0) || determinant == 0.0 {
            return None;
        }
        // Within the corners' distances, since for a triangle seen on edge the quotient says nothing; 0 / 0 gives
        // the least of them.
        let t = lesser(greater(height / slope, least), most);
        let inverse = 1.0 / determinant;
        (t > 0.0 && t < limit).then_some(Refined { t, u: v * inverse, v: w * inverse })
    }

    /// The corners of one triangle, axes permuted as the query's.
    #[inline(always)]
    fn corners(&self, lane: usize, query: &Query) -> [[f64; 3]; 3] {
        let [kx, ky, kz] = query.axes;
        let at = |v: &[f32x8; 3], axis: usize| f64::from(v[axis].as_array()[lane & 7]);
        let corner = |v: &[f32x8; 3]| [at(v, kx), at(v, ky), at(v, kz)];
        let [a, b, c] = &self.vertices;
        [corner(a), corner(b), corner(c)]
    }
}

/// The smaller number, and the second of two that do not compare: one instruction, which `f64::min` is not.
#[inline(always)]
const fn lesser(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The larger number, and the second of two that do not compare.
#[inline(always)]
const fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[inline(always)]
fn minus(p: [f64; 3], q: [f64; 3]) -> [f64; 3] {
    [p[0] - q[0], p[1] - q[1], p[2] - q[2]]
}

#[inline(always)]
fn dot(p: [f64; 3], q: [f64; 3]) -> f64 {
    p[0].mul_add(q[0], p[1].mul_add(q[1], p[2] * q[2]))
}
