//! The coat: a second reflection with the long-tailed distribution GTR of exponent 1 (Burley 2012, appendix B).

use crate::bsdf::Microfacet;
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// The coat at one point.
pub(super) struct Clearcoat {
    /// Strength, 0 to 1.
    pub strength: f64,
    /// Square of the roughness.
    a2: f64,
}

impl Clearcoat {
    /// With roughness 0.1 for satin (`gloss` 0) to 0.001.
    pub fn of(strength: f64, gloss: f64) -> Self {
        Self { strength, a2: (0.1 + (0.001 - 0.1) * gloss).powi(2) }
    }

    /// Burley 2012, eq. 4, normalised.
    pub fn density(&self, h: DVec3) -> f64 {
        let sin2 = h.truncate().length_squared();
        (self.a2 - 1.0) / (PI * self.a2.ln() * (sin2 + self.a2 * h.z * h.z))
    }

    /// Value for the Fresnel factor `fresnel`: as in Mitsuba, without the usual 1 / (4 cos θ cos θ), which Burley takes
    /// to be part of the shadowing; that has roughness 0.25.
    pub fn value(&self, wi: DVec3, wo: DVec3, h: DVec3, fresnel: f64) -> f64 {
        let smith =
            Microfacet { distribution: crate::bsdf::Distribution::Ggx, alpha: DVec2::splat(0.25), visible: true };
        0.25 * self.strength * fresnel * self.density(h) * smith.shadowing(wi, h) * smith.shadowing(wo, h)
    }

    /// Density of [`Clearcoat::sample`].
    pub fn pdf(&self, wi: DVec3, h: DVec3) -> f64 {
        self.density(h) * h.z / (4.0 * wi.dot(h))
    }

    pub fn sample(&self, wi: DVec3, u: [f64; 2]) -> DVec3 {
        // sin² = (a²^(1 − u) − a²) / (1 − a²), in a form that keeps the digits of small angles.
        let log = self.a2.ln();
        let sin2 = self.a2 * (-u[0] * log).exp_m1() / (1.0 - self.a2);
        let flat = DVec2::from_angle(TAU * u[1]) * sin2.clamp(0.0, 1.0).sqrt();
        let h = flat.extend((1.0 - sin2).max(0.0).sqrt());
        h * (2.0 * wi.dot(h)) - wi
    }

    pub fn invert(&self, h: DVec3) -> [f64; 2] {
        let sin2 = h.truncate().length_squared();
        let turn = h.y.atan2(h.x) / TAU;
        let u = -(sin2 * (1.0 - self.a2) / self.a2).ln_1p() / self.a2.ln();
        [u.clamp(0.0, 1.0), if turn < 0.0 { turn + 1.0 } else { turn }]
    }
}
