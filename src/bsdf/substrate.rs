//! A diffuse base under a dielectric boundary: what plastics have in common.

use crate::spectrum::Spectrum;
use crate::texture::{Colour, Site};
use std::f64::consts::FRAC_1_PI;

/// The base.
#[derive(Clone, Debug, PartialEq)]
pub struct Substrate {
    /// Reflected share of the light that gets to the base.
    pub reflectance: Colour,
    /// Whether light that the boundary throws back is coloured by the base once more each time.
    pub nonlinear: bool,
    /// Share of diffuse light from inside that the boundary throws back.
    pub internal: f64,
    /// Refractive index inside over outside.
    pub eta: f64,
}

impl Substrate {
    /// BSDF value, of which the boundary lets pass the shares `pass_i` and `pass_o`: the geometric series of reflections
    /// between base and boundary; the solid angle grows by η² on the way out.
    #[inline]
    pub(super) fn value(&self, site: &Site, pass_i: f64, pass_o: f64) -> Spectrum {
        let factor = FRAC_1_PI * pass_i * pass_o / (self.eta * self.eta);
        self.reflectance.at(site).map(|base| {
            // Textures may hold more than 1, where the series would not end.
            let again = if self.nonlinear { base.min(1.0) * self.internal } else { self.internal };
            factor * base / (1.0 - again)
        })
    }
}
