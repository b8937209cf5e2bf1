//! A rough dielectric boundary, and how much light it lets pass in total.

use super::microfacet::SMALLEST_ALPHA;
use super::slopes::{Slopes, gaussian};
use super::{Distribution, Evaluation, Microfacet, fresnel};
use crate::math::{SolidAnglePdf, warp::disk};
use crate::spectrum::Spectrum;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::sync::LazyLock;

/// Entries of the table of transmittances, evenly spaced over the cosine.
const ENTRIES: usize = 64;

/// The boundary as seen from outside.
#[derive(Clone, Debug, PartialEq)]
pub struct RoughCoat {
    /// Refractive index inside over outside.
    pub eta: f64,
    /// The distribution of the facets.
    pub microfacet: Microfacet,
    /// Share of light that is refracted and not shadowed, by the cosine of incidence.
    transmittance: Box<[f64]>,
    /// Share of diffuse light from inside that is reflected back.
    internal_reflectance: f64,
}

impl RoughCoat {
    /// Facets with roughness `alpha`; tabulates what passes, which takes milliseconds.
    pub fn new(eta: f64, (distribution, alpha, visible): (Distribution, f64, bool)) -> Self {
        let microfacet = Microfacet { distribution, alpha: DVec2::splat(alpha.max(SMALLEST_ALPHA)), visible };
        let passes = |i| PASSING.share(&microfacet, entry(i), |wi, h| refracted(&microfacet, wi, h, eta));
        let returns = |i| RETURNING.share(&microfacet, entry(i), |wi, h| reflected(&microfacet, wi, h, 1.0 / eta));
        let table =
            |share: &(dyn Fn(usize) -> f64 + Sync)| -> Vec<f64> { (0..ENTRIES).into_par_iter().map(share).collect() };
        let weighted = table(&returns).into_iter().enumerate().map(|(i, share)| share * entry(i));
        let internal_reflectance = 2.0 * weighted.sum::<f64>() / ENTRIES as f64;
        Self { eta, microfacet, transmittance: table(&passes).into(), internal_reflectance }
    }

    /// Whether it is what [`RoughCoat::new`] makes of these.
    pub fn is_of(&self, eta: f64, (distribution, alpha, visible): (Distribution, f64, bool)) -> bool {
        let alpha = DVec2::splat(alpha.max(SMALLEST_ALPHA));
        self.eta == eta && self.microfacet == Microfacet { distribution, alpha, visible }
    }

    /// Share of diffuse light from inside that is reflected back.
    pub fn internal_reflectance(&self) -> f64 {
        self.internal_reflectance
    }

    /// Share of the light at the positive cosine `cos` that passes.
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

/// Cosine of an entry of the table.
fn entry(i: usize) -> f64 {
    i as f64 / (ENTRIES - 1) as f64
}

/// Share that the facet `h` reflects of light from `wi`, and that is not shadowed.
fn reflected(microfacet: &Microfacet, wi: DVec3, h: DVec3, eta: f64) -> f64 {
    let cos = wi.dot(h);
    let wo = h * (2.0 * cos) - wi;
    if wo.z <= 0.0 || cos <= 0.0 { 0.0 } else { microfacet.shadowing(wo, h) * fresnel::dielectric(cos, eta).0 }
}

/// Share that it refracts.
fn refracted(microfacet: &Microfacet, wi: DVec3, h: DVec3, eta: f64) -> f64 {
    let cos = wi.dot(h);
    match fresnel::dielectric(cos, eta) {
        (reflectance, Some(cos_t)) if cos > 0.0 => {
            let wo = h * (cos / eta - cos_t) - wi / eta;
            if wo.z < 0.0 { microfacet.shadowing(wo, h) * (1.0 - reflectance) } else { 0.0 }
        }
        _ => 0.0,
    }
}

/// The rule for light from outside.
static PASSING: LazyLock<Rule> = LazyLock::new(|| Rule::new(32));

/// The rule for light from inside: total reflection has an edge, which takes more nodes.
static RETURNING: LazyLock<Rule> = LazyLock::new(|| Rule::new(128));

/// A rule of Gauss and Legendre on the unit square.
struct Rule {
    /// Nodes and weights of one axis.
    nodes: Vec<(f64, f64)>,
    /// Slopes of a Beckmann surface across the plane of incidence, and weights, for the first half of the nodes: the
    /// facets on both sides of that plane do the same.
    across: Vec<(f64, f64)>,
    /// Where the unit disk has the visible normals of GGX: for each node, its pairs with the first half of the nodes.
    disk: Vec<DVec2>,
}

impl Rule {
    fn new(n: usize) -> Self {
        let nodes = gauss_legendre(n);
        let across = nodes[..n / 2].iter().map(|(v, weight)| (gaussian(*v), 2.0 * weight)).collect();
        let pairs = nodes.iter().flat_map(|(u, _)| nodes[..n / 2].iter().map(|(v, _)| disk::sample([*v, *u])));
        let disk = pairs.collect();
        Self { nodes, across, disk }
    }

    /// Mean over the facets that are seen at the cosine `cos`.
    fn share(&self, microfacet: &Microfacet, cos: f64, of: impl Fn(DVec3, DVec3) -> f64) -> f64 {
        let visible = Microfacet { visible: true, ..*microfacet };
        let (cos, alpha) = (cos.max(1e-6), microfacet.alpha.x);
        let wi = DVec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
        let slopes = Slopes::of(DVec3::new(alpha * wi.x, 0.0, wi.z));
        let seen = visible.seen_from(wi);
        let inner = |u: f64, disk: &[DVec2]| -> f64 {
            match visible.distribution {
                Distribution::Ggx => {
                    let half = self.nodes.iter().zip(disk);
                    half.map(|((_, weight), point)| 2.0 * weight * of(wi, seen(*point))).sum()
                }
                Distribution::Beckmann => {
                    let x = slopes.along(u);
                    let normal = |y: f64| DVec3::new(-alpha * x, -alpha * y, 1.0).normalize();
                    self.across.iter().map(|(y, weight)| weight * of(wi, normal(*y))).sum()
                }
            }
        };
        let rows = self.nodes.iter().zip(self.disk.chunks(self.across.len()));
        rows.map(|((u, weight), disk)| weight * inner(*u, disk)).sum()
    }
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
            let next = x - value / slope;
            if next == x {
                break;
            }
            x = next;
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
