//! The hierarchy's own coordinates.

use glam::DVec3;

use crate::geometry::Bounds;

/// `local = (scene - centre) * scale`, where no `f32` vertex is rounded: the scale is a power of two, and along each
/// axis the centre is either zero or so far out that every vertex `v` has `centre / 2 <= v <= 2 centre`, which makes the
/// difference exact (Sterbenz 1974). The local coordinates lie within \[-1, 1\], and a scene loses no more than a
/// factor of about three in resolution against the true centre.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// Scene position of the local origin.
    pub centre: DVec3,
    /// Local units per scene unit.
    pub scale: f64,
    /// Scene units per local unit.
    pub inverse: f64,
}

impl Frame {
    /// The frame for all of `bounds`, centred on `vertices`, the part of it that consists of `f32` vertices (or of
    /// solids, where there are none).
    pub fn new(vertices: Bounds, bounds: Bounds) -> Self {
        if bounds.is_empty() {
            return Self { centre: DVec3::ZERO, scale: 1.0, inverse: 1.0 };
        }
        let core = if vertices.is_empty() { bounds } else { vertices };
        let (middle, half) = (core.centre(), 0.5 * (core.max - core.min));
        // 2.01: the factor of two of Sterbenz's condition, and room to round the centre to f32.
        let centre = DVec3::select(middle.abs().cmpge(2.01 * half), middle.as_vec3().as_dvec3(), DVec3::ZERO);
        let extent = Bounds { min: bounds.min - centre, max: bounds.max - centre }.max_abs();
        // A single point has no extent; the exponent is bounded so that neither factor leaves f64.
        let exponent = if extent > 0.0 { extent.log2().floor() as i32 + 1 } else { 0 };
        let scale = 2f64.powi(-exponent.clamp(-200, 200));
        Self { centre, scale, inverse: scale.recip() }
    }

    /// Scene to local position.
    #[inline]
    pub fn to_local(self, point: DVec3) -> DVec3 {
        (point - self.centre) * self.scale
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;
    use glam::Vec3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn vertices_are_never_rounded(
            shift in prop::array::uniform3(-1e6f32..1e6),
            exponent in -40i32..40,
            points in prop::collection::vec(prop::array::uniform3(-1f32..1.0), 1..20),
        ) {
            let size = 2f32.powi(exponent);
            let points: Vec<Vec3> = points.iter().map(|p| Vec3::from(*p) * size + Vec3::from(shift)).collect();
            let bounds = points.iter().fold(Bounds::EMPTY, |b, p| b.including(p.as_dvec3()));
            let frame = Frame::new(bounds, bounds);
            for p in points {
                let local = frame.to_local(p.as_dvec3());
                prop_assert!(local.abs().max_element() <= 1.0);
                prop_assert_eq!(local.as_vec3().as_dvec3(), local);
                prop_assert_eq!(local * frame.inverse + frame.centre, p.as_dvec3());
            }
        }
    }
}
