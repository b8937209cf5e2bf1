//! The model of Burley 2012, *Physically Based Shading at Disney*, and Burley 2015, *Extending the Disney BRDF to a BSDF
//! with Integrated Subsurface Scattering*, with the lobes and parameters that Mitsuba 3 gives it: no subsurface
//! scattering but its flat approximation, and no thin surfaces.

mod clearcoat;
mod local;

use super::lobes::{choose, guess, unchoose};
use super::{Evaluation, Letter, Scatter};
use crate::math::{Row, Walk, warp::hemisphere};
use crate::texture::{Colour, Number, Site};
use clearcoat::Clearcoat;
use glam::DVec3;
use local::{Local, Pair};

/// Diffuse, metallic and transparent lobes in one model; the normal points to the outside.
#[derive(Clone, Debug, PartialEq)]
pub struct Principled {
    /// Colour of the base.
    pub base_color: Colour,
    /// Root of the roughness α.
    pub roughness: Number,
    /// 0 for round highlights, 1 for long ones along the tangent.
    pub anisotropic: Number,
    /// 0 for a dielectric, 1 for a metal.
    pub metallic: Number,
    /// Share of a dielectric that is transparent.
    pub spec_trans: Number,
    /// How much the base colours the reflection of a dielectric.
    pub spec_tint: Number,
    /// Strength of the sheen at grazing angles.
    pub sheen: Number,
    /// How much the base colours the sheen.
    pub sheen_tint: Number,
    /// How much the diffuse lobe is flattened as by subsurface scattering.
    pub flatness: Number,
    /// Strength of the coat.
    pub clearcoat: Number,
    /// 0 for a coat of satin, 1 for one of gloss.
    pub clearcoat_gloss: Number,
    /// Refractive index inside over outside.
    pub eta: f64,
}

impl Principled {
    /// The numbers that may vary.
    fn numbers(&self) -> [&Number; 10] {
        [
            &self.roughness,
            &self.anisotropic,
            &self.metallic,
            &self.spec_trans,
            &self.spec_tint,
            &self.sheen,
            &self.sheen_tint,
            &self.flatness,
            &self.clearcoat,
            &self.clearcoat_gloss,
        ]
    }

    /// Whether it is the same everywhere.
    pub(super) fn is_constant(&self) -> bool {
        self.base_color.is_constant() && self.numbers().iter().all(|number| number.is_constant())
    }

    /// Whether light may pass to the other side.
    pub(super) fn transmits(&self) -> bool {
        self.spec_trans != Number::Constant(0.0)
    }

    /// Whether photons are gathered: unless the rough lobes are all there is, and glossy.
    #[inline]
    pub(super) fn gathers(&self) -> bool {
        let local = Local::of(self, &Site::default());
        !self.is_constant() || local.diffuse() > 0.0 || local.microfacet.letter() == Letter::D
    }

    pub(super) fn evaluate(&self, site: &Site, wi: DVec3, wo: DVec3, walk: Walk) -> Option<Evaluation> {
        let local = Local::of(self, site);
        let pair = Pair::of(&local, wi, wo)?;
        let evaluation = local.evaluate(&pair, walk);
        (evaluation.pdf.0 > 0.0).then_some(evaluation)
    }

    pub(super) fn sample(&self, site: &Site, wi: DVec3, row: Row, walk: Walk) -> Option<Scatter> {
        let local = Local::of(self, site);
        let u = [row[1], row[2]];
        let (main, coat) = local.probabilities(wi);
        let (is_main, rest) = choose(row[0], main);
        let direction = if is_main {
            local.sample_main(wi, rest, u)?
        } else if choose(rest, coat).0 {
            local.coat.sample(wi, u)
        } else {
            hemisphere::sample(u)
        };
        // The coat and the base reflect only.
        if !is_main && direction.z <= 0.0 {
            return None;
        }
        let eta = if wi.z * direction.z > 0.0 { 1.0 } else { local.relative_eta(wi) };
        Scatter::of(direction, &self.evaluate(site, wi, direction, walk)?, eta)
    }

    pub(super) fn invert(&self, site: &Site, wi: DVec3, wo: DVec3, gamma: Row) -> Option<Row> {
        let local = Local::of(self, site);
        let pair = Pair::of(&local, wi, wo)?;
        let (main, coat) = local.probabilities(wi);
        let [main_pdf, coat_pdf, base_pdf] = local.densities(&pair);
        if main_pdf + coat_pdf + base_pdf <= 0.0 {
            return None;
        }
        let (is_main, rest) = guess(gamma[0], main_pdf, coat_pdf + base_pdf);
        let (lobe, [u, v]) = if is_main {
            local.invert_main(&pair, rest)
        } else {
            let (is_coat, rest) = guess(rest, coat_pdf, base_pdf);
            let u = if is_coat { local.coat.invert(pair.h) } else { hemisphere::invert(wo) };
            (unchoose((is_coat, rest), coat), u)
        };
        Some([unchoose((is_main, lobe), main), u, v, gamma[3]])
    }
}
