//! Up to eight triangles, one per SIMD lane: a filter in `f32` that never rejects a hit, and the exact test in `f64`.
//!
//! Source: Woop, Benthin, Wald 2013, "Watertight Ray/Triangle Intersection", JCGT 2(1). There `f32` decides, with a
//! fallback to `f64` on edges; here `f64` decides always, on the few triangles that the filter leaves, so that a ray
//! leaving a surface next to an edge does not meet the neighbour by rounding.

use glam::Vec3;
use wide::f32x8;

use super::query::Query;
use crate::geometry::offset::cross;

/// Eight triangles at most, in local units.
#[derive(Clone, Debug)]
pub struct Packet {
    /// `vertices[vertex][axis]`; lanes without a triangle are NaN, which no comparison accepts.
    vertices: [[f32x8; 3]; 3],
    /// The caller's index of each triangle.
    pub ids: [u32; 8],
    /// Largest absolute coordinate.
    magnitude: f32,
    /// Longest edge.
    edge: f32,
}

/// Distance (local units) and barycentric coordinates of vertices 1 and 2.
#[derive(Clone, Copy, Debug)]
pub struct Refined {
    pub t: f64,
    pub u: f64,
    pub v: f64,
}

impl Packet {
    /// Up to eight triangles with their indices; further ones are ignored.
    pub fn new<'a>(triangles: impl Iterator<Item = (u32, &'a [Vec3; 3])>) -> Self {
        let mut lanes = [[[f32::NAN; 8]; 3]; 3];
        let (mut ids, mut magnitude, mut edge) = ([0; 8], 0f32, 0f32);
        for (lane, (id, triangle)) in triangles.enumerate().take(8) {
            ids[lane] = id;
            for (vertex, point) in triangle.iter().enumerate() {
                for axis in 0..3 {
                    lanes[vertex][axis][lane] = point[axis];
                }
                magnitude = magnitude.max(point.abs().max_element());
                edge = edge.max(point.distance(triangle[(vertex + 1) % 3]));
            }
        }
        Self { vertices: lanes.map(|v| v.map(f32x8::new)), ids, magnitude, edge }
    }

    /// The lanes (bit mask) that may be hit at a distance of at most `limit` from the query's `f32` origin: all that
    /// [`Packet::refine`] accepts, and few others.
    ///
    /// With u = 2^-24 and m the largest coordinate of packet and origin together, a sheared x or y is off by at most
    /// 6 m u < δ = 8 m u. If the ray meets the triangle, then its sheared vertices are no farther from the ray than
    /// √2 L (L the longest edge), and an edge function is off by less than 12 δ (L + δ) = e. In the distance times
    /// determinant, weights off by e act on the spread of z, below √3 L, and all else is relative to the determinant.
    #[inline(always)]
    pub fn filter(&self, query: &Query, limit: f32) -> u32 {
        const ROUNDOFF: f32 = 8.0 / (1u32 << 24) as f32;
        let delta = ROUNDOFF * (self.magnitude + query.magnitude);
        let edge_error = 12.0 * delta * (self.edge + delta);
        let volume_error = f32x8::splat(edge_error * (6.0 * self.edge + 16.0 * delta));
        let [sx, sy, sz] = query.shear32;
        let [ox, oy, oz] = query.origin32;
        let [kx, ky, kz] = query.axes;
        let sheared = |v: &[f32x8; 3]| {
            let (x, y, z) = (v[kx], v[ky], v[kz]);
            (z.mul_neg_add(sx, x) - ox, z.mul_neg_add(sy, y) - oy, (z - oz) * sz)
        };
        let [(ax, ay, az), (bx, by, bz), (cx, cy, cz)] = self.vertices.each_ref().map(sheared);
        let u = cx.mul_sub(by, cy * bx);
        let v = ax.mul_sub(cy, ay * cx);
        let w = bx.mul_sub(ay, by * ax);
        let tolerance = f32x8::splat(edge_error);
        let one_side = u.fast_min(v).fast_min(w).simd_ge(-tolerance) | u.fast_max(v).fast_max(w).simd_le(tolerance);
        let determinant = u + v + w;
        let sign = determinant & f32x8::splat(-0.0);
        let size = determinant ^ sign;
        let volume = u.mul_add(az, v.mul_add(bz, w * cz)) ^ sign;
        let latest = size.mul_add(f32x8::splat(limit + 4.0 * delta), volume_error);
        let earliest = size.mul_add(f32x8::splat(4.0 * delta), volume_error);
        (one_side & volume.simd_le(latest) & (-volume).simd_le(earliest)).to_bitmask()
    }

    /// The hit of one lane with `0 < t < limit`, decided and computed in `f64` from the exact vertices.
    ///
    /// Edge functions without contraction have exactly opposite values on the two sides of an edge, and zero counts
    /// as inside: no ray passes between neighbours. The distance comes from the plane, whose side test is accurate
    /// next to the surface (see [`crate::geometry::offset`]).
    #[inline(always)]
    pub fn refine(&self, lane: usize, query: &Query, limit: f64) -> Option<Refined> {
        let relative = self.vertices.each_ref().map(|v| {
            let at = |i: usize| f64::from(v[query.axes[i]].as_array()[lane & 7]) - query.origin[i];
            [at(0), at(1), at(2)]
        });
        let [a, b, c] = relative.map(|r| [r[0] - query.shear[0] * r[2], r[1] - query.shear[1] * r[2]]);
        let u = c[0] * b[1] - c[1] * b[0];
        let v = a[0] * c[1] - a[1] * c[0];
        let w = b[0] * a[1] - b[1] * a[0];
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let determinant = u + v + w;
        if determinant == 0.0 {
            return None;
        }
        let t = self.plane_distance(lane, query, &relative);
        (t > 0.0 && t < limit).then(|| {
            let inverse = 1.0 / determinant;
            Refined { t, u: v * inverse, v: w * inverse }
        })
    }

    /// Distance to the plane, kept within the triangle's own range of distances: for a triangle seen on edge the
    /// quotient says nothing.
    #[inline(always)]
    fn plane_distance(&self, lane: usize, query: &Query, relative: &[[f64; 3]; 3]) -> f64 {
        let [a, b, c] = self.vertices.each_ref().map(|v| query.axes.map(|k| f64::from(v[k].as_array()[lane & 7])));
        let minus = |p: [f64; 3], q: [f64; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
        let dot = |p: [f64; 3], q: [f64; 3]| p[0].mul_add(q[0], p[1].mul_add(q[1], p[2] * q[2]));
        let normal = cross(minus(b, a), minus(c, a));
        let [za, zb, zc] = relative.map(|r| r[2] * query.shear[2]);
        let t = dot(normal, relative[0]) / dot(normal, query.direction);
        // `max` takes the other operand where 0 / 0 gave NaN.
        t.max(za.min(zb).min(zc)).min(za.max(zb).max(zc))
    }
}
