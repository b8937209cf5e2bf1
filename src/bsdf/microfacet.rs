//! Isotropic microfacet normal distributions (Walter et al. 2007; Heitz 2018 for visible normals).
//! Directions in the shading frame, `wi.z > 0`.

use crate::math::warp::disk;
use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_1_PI, TAU};

/// The family of distributions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distribution {
    /// Trowbridge and Reitz; its visible normals are sampled.
    Ggx,
    /// Beckmann; all its normals are sampled.
    Beckmann,
}

/// A distribution of microfacet normals with roughness `alpha`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Microfacet {
    /// The family.
    pub distribution: Distribution,
    /// Roughness α > 0: the root mean square slope for Beckmann.
    pub alpha: f64,
}

impl Microfacet {
    /// Density D(h) of normals per projected area.
    #[inline]
    pub fn density(&self, h: DVec3) -> f64 {
        if h.z <= 0.0 {
            return 0.0;
        }
        let a2 = self.alpha * self.alpha;
        let sin2 = h.x * h.x + h.y * h.y;
        match self.distribution {
            Distribution::Ggx => {
                let x = sin2 / a2 + h.z * h.z;
                FRAC_1_PI / (a2 * x * x)
            }
            Distribution::Beckmann => {
                let cos2 = h.z * h.z;
                (-sin2 / (cos2 * a2)).exp() * FRAC_1_PI / (a2 * cos2 * cos2)
            }
        }
    }

    /// Smith's shadowing of one direction.
    #[inline]
    pub fn shadowing(&self, w: DVec3) -> f64 {
        let tan2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
        let a2_tan2 = self.alpha * self.alpha * tan2;
        match self.distribution {
            Distribution::Ggx => 2.0 / (1.0 + (1.0 + a2_tan2).sqrt()),
            Distribution::Beckmann if a2_tan2 == 0.0 => 1.0,
            Distribution::Beckmann => {
                // Rational fit of Walter et al. 2007, eq. 27.
                let a = 1.0 / a2_tan2.sqrt();
                if a >= 1.6 { 1.0 } else { (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a) }
            }
        }
    }

    /// A microfacet normal as seen from `wi`.
    #[inline]
    pub fn sample(&self, wi: DVec3, u: [f64; 2]) -> DVec3 {
        match self.distribution {
            Distribution::Ggx => {
                let view = VisibleDisk::of(wi, self.alpha);
                let p = disk::sample(u);
                let bulge = (1.0 - p.x * p.x).max(0.0).sqrt();
                let y = (1.0 - view.share) * bulge + view.share * p.y;
                let z = (1.0 - p.x * p.x - y * y).max(0.0).sqrt();
                let n = view.tangent * p.x + view.bitangent * y + view.axis * z;
                DVec3::new(self.alpha * n.x, self.alpha * n.y, n.z.max(0.0)).normalize()
            }
            Distribution::Beckmann => {
                let tan2 = -self.alpha * self.alpha * (1.0 - u[0]).ln();
                let cos = 1.0 / (1.0 + tan2).sqrt();
                let sin = (1.0 - cos * cos).max(0.0).sqrt();
                let (sin_phi, cos_phi) = (TAU * u[1]).sin_cos();
                DVec3::new(sin * cos_phi, sin * sin_phi, cos)
            }
        }
    }

    /// Density of [`Microfacet::sample`] per solid angle of the normal.
    #[inline]
    pub fn pdf(&self, wi: DVec3, h: DVec3) -> f64 {
        match self.distribution {
            Distribution::Ggx => self.density(h) * self.shadowing(wi) * wi.dot(h).max(0.0) / wi.z,
            Distribution::Beckmann => self.density(h) * h.z,
        }
    }

    /// The inverse of [`Microfacet::sample`].
    pub fn invert(&self, wi: DVec3, h: DVec3) -> [f64; 2] {
        match self.distribution {
            Distribution::Ggx => {
                let view = VisibleDisk::of(wi, self.alpha);
                let n = DVec3::new(h.x / self.alpha, h.y / self.alpha, h.z).normalize();
                let x = n.dot(view.tangent);
                let bulge = (1.0 - x * x).max(0.0).sqrt();
                let y = (n.dot(view.bitangent) - (1.0 - view.share) * bulge) / view.share;
                disk::invert(DVec2::new(x, y))
            }
            Distribution::Beckmann => {
                let tan2 = (h.x * h.x + h.y * h.y) / (h.z * h.z);
                let turn = h.y.atan2(h.x) / TAU;
                [-(-tan2 / (self.alpha * self.alpha)).exp_m1(), if turn < 0.0 { turn + 1.0 } else { turn }]
            }
        }
    }
}

/// The hemisphere of GGX, stretched to α = 1, as seen from `wi` (Heitz 2018, listing 1).
struct VisibleDisk {
    axis: DVec3,
    tangent: DVec3,
    bitangent: DVec3,
    /// Share of the disk that the lower half of the projected hemisphere covers.
    share: f64,
}

impl VisibleDisk {
    #[inline]
    fn of(wi: DVec3, alpha: f64) -> Self {
        let axis = DVec3::new(alpha * wi.x, alpha * wi.y, wi.z).normalize();
        let tangent = DVec2::new(-axis.y, axis.x).normalize_or(DVec2::X).extend(0.0);
        Self { axis, tangent, bitangent: axis.cross(tangent), share: 0.5 * (1.0 + axis.z) }
    }
}
