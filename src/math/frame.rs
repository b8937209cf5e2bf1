//! Orthonormal frames.

use glam::DVec3;

/// An orthonormal basis; `normal` is the local z axis. Right-handed unless a camera asks for its mirror image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Local x axis in world space.
    pub tangent: DVec3,
    /// Local y axis in world space.
    pub bitangent: DVec3,
    /// Local z axis in world space.
    pub normal: DVec3,
}

impl Frame {
    /// Builds a frame around a unit `normal` (Duff et al. 2017, *Building an Orthonormal Basis, Revisited*).
    #[inline]
    pub fn around(normal: DVec3) -> Self {
        let sign = 1f64.copysign(normal.z);
        let a = -1.0 / (sign + normal.z);
        let b = normal.x * normal.y * a;
        Self {
            tangent: DVec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x),
            bitangent: DVec3::new(b, sign + normal.y * normal.y * a, -normal.y),
            normal,
        }
    }

    /// How tangent and bitangent of [`Frame::around`] change as `normal` does by `change`, at right angles to it.
    pub fn turning(normal: DVec3, change: DVec3) -> [DVec3; 2] {
        let sign = 1f64.copysign(normal.z);
        let a = -1.0 / (sign + normal.z);
        let a_change = a * a * change.z;
        let b_change = change.x * normal.y * a + normal.x * change.y * a + normal.x * normal.y * a_change;
        let square = |n: f64, by: f64| 2.0 * n * by * a + n * n * a_change;
        [
            DVec3::new(sign * square(normal.x, change.x), sign * b_change, -sign * change.x),
            DVec3::new(b_change, square(normal.y, change.y), -change.y),
        ]
    }

    /// Coordinates of the world vector `v` in this frame.
    #[inline]
    pub fn to_local(&self, v: DVec3) -> DVec3 {
        DVec3::new(v.dot(self.tangent), v.dot(self.bitangent), v.dot(self.normal))
    }

    /// World vector of the local coordinates `v`.
    #[inline]
    pub fn to_world(&self, v: DVec3) -> DVec3 {
        self.tangent * v.x + self.bitangent * v.y + self.normal * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_and_invert() {
        let mut stream = crate::math::Stream::new(1, &[0]);
        for _ in 0..10_000 {
            let n = crate::math::warp::sphere::sample([stream.number(), stream.number()]);
            let frame = Frame::around(n);
            assert!((frame.tangent.cross(frame.bitangent) - n).length() < 1e-12);
            let v = DVec3::new(stream.number(), stream.number(), stream.number());
            assert!((frame.to_world(frame.to_local(v)) - v).length() < 1e-12);
        }
    }

    #[test]
    fn frames_turn_with_their_normal() {
        let mut stream = crate::math::Stream::new(2, &[0]);
        for _ in 0..1000 {
            let mut direction = || crate::math::warp::sphere::sample([stream.number(), stream.number()]);
            let (n, change) = (direction(), direction());
            let change = change - n * n.dot(change);
            if n.z.abs() < 1e-3 {
                continue;
            }
            let at = |step: f64| Frame::around((n + change * step).normalize());
            let (a, b) = (at(1e-6), at(-1e-6));
            let [tangent, bitangent] = Frame::turning(n, change);
            assert!(((a.tangent - b.tangent) / 2e-6 - tangent).length() < 1e-7 * (1.0 + tangent.length()), "{n}");
            assert!(((a.bitangent - b.bitangent) / 2e-6 - bitangent).length() < 1e-7 * (1.0 + bitangent.length()));
        }
    }
}
