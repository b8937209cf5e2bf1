//! A dielectric layer over another model: the simple model of Mitsuba 0.6, in which light is refracted on its way in and
//! on its way out, absorbed in between, and not reflected back to the base (Weidlich and Wilkie 2007, *Arbitrarily
//! Layered Micro-Facet Surfaces*).

use super::lobes::{choose, guess, letter, mean, mirrored, share, unchoose};
use super::{Bsdf, Evaluation, Letter, RoughCoat, Scatter, fresnel};
use crate::math::{Row, Walk};
use crate::spectrum::Spectrum;
use crate::texture::{Colour, Site};
use glam::DVec3;

/// Reflects at the layer, and scatters as `nested` below it, on the side of the normal.
#[derive(Clone, Debug, PartialEq)]
pub struct Coating {
    /// Refractive index of the layer over that of the outside.
    pub eta: f64,
    /// Absorption times thickness of the layer.
    pub depth: Spectrum,
    /// Facets of the layer's surface; `None` where it is smooth.
    pub rough: Option<RoughCoat>,
    /// Factor on the reflection by the layer, 1 in nature.
    pub specular_reflectance: Colour,
    /// The opaque model below.
    pub nested: Box<Bsdf>,
}

/// A direction outside and what becomes of it on the way to the base.
struct Entry {
    /// The direction within the layer.
    inside: DVec3,
    /// Share of light that passes the surface.
    pass: f64,
    /// Probability that the reflection by the layer is chosen.
    layer: f64,
    /// dω outside over dω inside is the inverse of this (Snell).
    squeeze: f64,
}

impl Coating {
    #[inline]
    fn enter(&self, site: &Site, w: DVec3) -> Entry {
        let (reflectance, cos) = fresnel::dielectric(w.z, self.eta);
        // Below an outside of higher index there is total reflection.
        let cos = cos.unwrap_or(0.0);
        let pass = self.rough.as_ref().map_or(1.0 - reflectance, |rough| rough.transmittance(w.z));
        let pass = if cos > 0.0 { pass } else { 0.0 };
        let below = mean(self.depth.map(|depth| (-2.0 * depth).exp()));
        Entry {
            inside: DVec3::new(w.x / self.eta, w.y / self.eta, cos),
            pass,
            layer: share((1.0 - pass) * mean(self.specular_reflectance.at(site)), pass * below),
            squeeze: if cos > 0.0 { w.z / (self.eta * self.eta * cos) } else { 0.0 },
        }
    }

    /// What is left of light after the ways in and out.
    #[inline]
    fn absorption(&self, i: &Entry, o: &Entry) -> Spectrum {
        let ways = 1.0 / i.inside.z + 1.0 / o.inside.z;
        self.depth.map(|depth| (-depth * ways).exp())
    }

    /// Layer and base with their shares of the density.
    fn parts(&self, site: &Site, wi: DVec3, wo: DVec3, walk: Walk) -> [Option<Evaluation>; 2] {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return [None, None];
        }
        let (i, o) = (self.enter(site, wi), self.enter(site, wo));
        let layer = self
            .rough
            .as_ref()
            .map(|rough| rough.evaluate(wi, wo).scaled(self.specular_reflectance.at(site), i.layer, o.layer));
        let base =
            (i.pass > 0.0 && o.pass > 0.0).then(|| self.nested.evaluate(site, i.inside, o.inside, walk)).flatten();
        let base = base.map(|base| {
            // Radiance is squeezed by η² on the way in; cosines and solid angles outside are other ones.
            let factor = self.absorption(&i, &o) * (i.pass * o.pass / (self.eta * self.eta));
            base.scaled(factor, (1.0 - i.layer) * o.squeeze, (1.0 - o.layer) * i.squeeze)
        });
        [layer, base]
    }

    pub(super) fn evaluate(&self, site: &Site, wi: DVec3, wo: DVec3, walk: Walk) -> Option<Evaluation> {
        match self.parts(site, wi, wo, walk) {
            [Some(layer), Some(base)] if layer.letter == base.letter => Some(layer.sum(base)),
            [Some(layer), Some(base)] => {
                let s_like =
                    if layer.letter == Letter::S { [layer.value, base.value] } else { [base.value, layer.value] };
                Some(Evaluation { letter: letter(s_like[0], s_like[1]), ..layer.sum(base) })
            }
            [layer, base] => layer.or(base),
        }
    }

    pub(super) fn sample(&self, site: &Site, wi: DVec3, row: Row, walk: Walk) -> Option<Scatter> {
        if wi.z <= 0.0 {
            return None;
        }
        let i = self.enter(site, wi);
        let (is_layer, rest) = choose(row[0], i.layer);
        let direction = match &self.rough {
            None if is_layer => {
                let weight = self.specular_reflectance.at(site) * ((1.0 - i.pass) / i.layer);
                return Some(Scatter::delta(mirrored(wi), weight, i.layer, i.layer));
            }
            Some(rough) if is_layer => rough.sample(wi, [row[1], row[2]]),
            _ => {
                let scatter = self.nested.sample(site, i.inside, [rest, row[1], row[2], row[3]], walk)?;
                let direction = self.leave(scatter.direction)?;
                if scatter.delta {
                    return Some(self.leave_by_delta(site, &i, scatter, direction));
                }
                direction
            }
        };
        Scatter::of(direction, &self.evaluate(site, wi, direction, walk)?, 1.0)
    }

    /// The direction outside; `None` for total reflection, after which the light is lost.
    fn leave(&self, inside: DVec3) -> Option<DVec3> {
        let (_, cos) = fresnel::dielectric(inside.z, 1.0 / self.eta);
        cos.filter(|_| inside.z > 0.0).map(|cos| DVec3::new(inside.x * self.eta, inside.y * self.eta, cos))
    }

    /// A delta lobe of the base. Jacobians of the ways in and out are those of the directions' cosines, which cancel in
    /// the value.
    fn leave_by_delta(&self, site: &Site, i: &Entry, scatter: Scatter, direction: DVec3) -> Scatter {
        let o = self.enter(site, direction);
        let weight = scatter.weight * self.absorption(i, &o) * (i.pass * o.pass / (1.0 - i.layer));
        let turned = if i.squeeze > 0.0 { i.squeeze / o.squeeze } else { 1.0 };
        Scatter { direction, weight, ..scatter.chosen(1.0 - i.layer, (1.0 - o.layer) * turned) }
    }

    pub(super) fn invert(&self, site: &Site, wi: DVec3, wo: DVec3, delta: bool, gamma: Row) -> Option<Row> {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return None;
        }
        let (i, o) = (self.enter(site, wi), self.enter(site, wo));
        let layer = if delta {
            let below = self.nested.has_delta(i.inside) && i.layer < 1.0;
            if self.rough.is_some() {
                0.0
            } else if below {
                i.layer
            } else {
                1.0
            }
        } else {
            let [layer, base] =
                self.parts(site, wi, wo, Walk::FromCamera).map(|part| part.map_or(0.0, |part| part.pdf.0));
            if layer + base <= 0.0 {
                return None;
            }
            share(layer, base)
        };
        let (is_layer, rest) = guess(gamma[0], layer, 1.0 - layer);
        let [lobe, u, v, w] = match &self.rough {
            None if is_layer => [rest, gamma[1], gamma[2], gamma[3]],
            Some(rough) if is_layer => {
                let [u, v] = rough.invert(wi, wo);
                [rest, u, v, gamma[3]]
            }
            _ => self.nested.invert(site, i.inside, o.inside, delta, [rest, gamma[1], gamma[2], gamma[3]])?,
        };
        Some([unchoose((is_layer, lobe), i.layer), u, v, w])
    }
}
