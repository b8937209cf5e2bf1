//! A rough dielectric boundary, and how much light it lets pass in total.

use super::{Evaluation, Microfacet, fresnel};
use crate::math::SolidAnglePdf;
use crate::spectrum::Spectrum;
use glam::{DVec2, DVec3};

/// Entries of the table of transmittances, evenly spaced over the cosine.
const ENTRIES: usize = 64;

/// The boundary as seen from outside.
#[derive(Clone, Debug, PartialEq)]
pub struct RoughCoat {
    /// Refractive index inside over outside.
    pub eta: f64,
    /// The distribution of the facets.
    pub microfacet: Microfacet,
    /// Share of light that is not reflected, by the cosine of incidence.
    transmittance: Box<[f64]>,
}

impl RoughCoat {
    /// Tabulates what passes.
    pub fn new(eta: f64, microfacet: Microfacet) -> Self {
        let passes = |i: usize| 1.0 - reflected(&microfacet, i as f64 / (ENTRIES - 1) as f64, eta);
        Self { eta, microfacet, transmittance: (0..ENTRIES).map(passes).collect() }
    }

    /// Share of diffuse light from inside that is reflected back.
    pub fn internal_reflectance(&self) -> f64 {
        let entry = |i: usize| i as f64 / (ENTRIES - 1) as f64;
        let sum: f64 = (0..ENTRIES).map(|i| reflected(&self.microfacet, entry(i), 1.0 / self.eta) * entry(i)).sum();
        2.0 * sum / ENTRIES as f64
    }

    /// Share of the light at the positive cosine `cos` that is not reflected.
    #[inline]
    pub(super) fn transmittance(&self, cos: f64) -> f64 {
        let position = cos.clamp(0.0, 1.0) * (ENTRIES - 1) as f64;
        let index = (position as usize).min(ENTRIES - 2);
        let (low, high) = (self.transmittance[index], self.transmittance[index + 1]);
        low + (high - low) * (position - index as f64)
    }

    /// The reflection, for directions above the surface (Walter et al. 2007, eq. 20).
    #[inline]
    pub(super) fn evaluate(&self, wi: DVec3, wo: DVec3) -> Evaluation {
        let h = (wi + wo).normalize();
        let cos = wi.dot(h);
        let (reflectance, _) = fresnel::dielectric(cos, self.eta);
        let shadowing = self.microfacet.shadowing(wi, h) * self.microfacet.shadowing(wo, h);
        let value = reflectance * self.microfacet.density(h) * shadowing / (4.0 * wi.z * wo.z);
        Evaluation {
            value: Spectrum::grey(value),
            pdf: SolidAnglePdf(self.microfacet.pdf(wi, h) / (4.0 * cos)),
            pdf_reverse: SolidAnglePdf(self.microfacet.pdf(wo, h) / (4.0 * cos)),
            letter: self.microfacet.letter(),
        }
    }

    #[inline]
    pub(super) fn sample(&self, wi: DVec3, u: [f64; 2]) -> DVec3 {
        let h = self.microfacet.sample(wi, u);
        h * (2.0 * wi.dot(h)) - wi
    }

    pub(super) fn invert(&self, wi: DVec3, wo: DVec3) -> [f64; 2] {
        self.microfacet.invert(wi, (wi + wo).normalize())
    }
}

/// Share of light at the cosine `cos` that facets reflect and do not shadow, by the visible normals at the nodes of a
/// product of Gauss-Legendre rules.
fn reflected(microfacet: &Microfacet, cos: f64, eta: f64) -> f64 {
    let visible = Microfacet { visible: true, ..*microfacet };
    let cos = cos.max(1e-6);
    let wi = DVec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    // Total reflection has an edge, which takes more nodes.
    let rule = gauss_legendre(if eta > 1.0 { 32 } else { 128 });
    let at = |u: DVec2| {
        let h = visible.sample(wi, u.to_array());
        let cos = wi.dot(h);
        let wo = h * (2.0 * cos) - wi;
        if wo.z <= 0.0 || cos <= 0.0 { 0.0 } else { visible.shadowing(wo, h) * fresnel::dielectric(cos, eta).0 }
    };
    let along = |x: f64| rule.iter().map(|(y, weight)| weight * at(DVec2::new(x, *y))).sum::<f64>();
    rule.iter().map(|(x, weight)| weight * along(*x)).sum()
}

/// Nodes and weights on 0 to 1, by Newton's method on the Legendre polynomial.
fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    let node = |i: usize| {
        let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..20 {
            let (mut before, mut value) = (1.0, x);
            for k in 2..=n {
                let k = k as f64;
                (before, value) = (value, ((2.0 * k - 1.0) * x * value - (k - 1.0) * before) / k);
            }
            slope = n as f64 * (x * value - before) / (x * x - 1.0);
            x -= value / slope;
        }
        (0.5 * (1.0 - x), 1.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..n).map(node).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_integrates_polynomials() {
        for n in [2, 5, 32] {
            for power in 0..2 * n {
                let sum: f64 = gauss_legendre(n).iter().map(|(x, weight)| weight * x.powi(power as i32)).sum();
                assert!((sum - 1.0 / (power as f64 + 1.0)).abs() < 1e-13, "{n} {power} {sum}");
            }
        }
    }
}
