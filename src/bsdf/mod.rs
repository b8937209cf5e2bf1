//! Scattering at surfaces. Directions are unit vectors in the shading frame (normal = +z) and point away from the
//! surface: `wi` back to the previous vertex of the walk, `wo` on to the next. `site` is where textures are looked up.
//!
//! A model may have delta lobes beside others. [`Bsdf::evaluate`] knows of the others only; [`Bsdf::sample`] chooses
//! among all, and says of what kind its choice was.
//!
//! A new variant: its file with `evaluate`, `sample`, `invert` side by side, one arm in each match below and in
//! `traits.rs`, one line in `tests/models.rs`. The compiler lists the arms.

mod blend;
mod coating;
mod conductor;
mod dielectric;
mod diffuse;
pub mod fresnel;
mod lobes;
mod mask;
mod microfacet;
mod phong;
mod plastic;
mod principled;
mod rough_coat;
mod rough_conductor;
mod rough_dielectric;
mod rough_plastic;
mod slopes;
mod substrate;
mod thin_dielectric;
mod traits;

pub use blend::Blend;
pub use coating::Coating;
pub use conductor::Conductor;
pub use dielectric::Dielectric;
pub use diffuse::Diffuse;
pub use mask::Mask;
pub use microfacet::{Distribution, Microfacet, Roughness};
pub use phong::Phong;
pub use plastic::Plastic;
pub use principled::Principled;
pub use rough_coat::RoughCoat;
pub use rough_conductor::RoughConductor;
pub use rough_dielectric::RoughDielectric;
pub use rough_plastic::RoughPlastic;
pub use substrate::Substrate;
pub use thin_dielectric::ThinDielectric;

use crate::math::{Row, SolidAnglePdf, Walk};
use crate::spectrum::Spectrum;
use crate::texture::Site;
use glam::DVec3;

/// The letter that a vertex has in Heckbert's notation, for one pair of directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Letter {
    /// Diffuse-like.
    D,
    /// Specular-like: delta lobes, and microfacet lobes with α below [`GLOSSY_ALPHA`].
    S,
}

/// Microfacet lobes with α below this roughness are specular-like (`S`), the others diffuse-like (`D`). At 0.2 a
/// highlight spreads over some 25°: beyond, sampling its density by connections works as for diffuse surfaces.
pub const GLOSSY_ALPHA: f64 = 0.2;

/// What a connection needs to know of a scattering event with given directions.
#[derive(Clone, Copy, Debug)]
pub struct Evaluation {
    /// BSDF value f in 1/sr, without cosine, for light that travels against a walk from the camera and with one from a
    /// light; delta lobes contribute nothing.
    pub value: Spectrum,
    /// Density with which [`Bsdf::sample`] takes `wi` to `wo`; over all directions it adds up to the probability that no
    /// delta lobe is chosen.
    pub pdf: SolidAnglePdf,
    /// Density with which it would take `wo` to `wi`.
    pub pdf_reverse: SolidAnglePdf,
    /// The letter of the vertex.
    pub letter: Letter,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct Scatter {
    /// The new direction, in the shading frame.
    pub direction: DVec3,
    /// f |cos θ| / pdf.
    pub weight: Spectrum,
    /// Density of the direction; for a delta lobe its probability.
    pub pdf: SolidAnglePdf,
    /// Density of the way back; for a delta lobe the coefficient of the same Dirac density as in `pdf`, that is the
    /// probability of the lobe times dω_o / dω_i.
    pub pdf_reverse: SolidAnglePdf,
    /// Whether the lobe is a Dirac density.
    pub delta: bool,
    /// The letter of the vertex.
    pub letter: Letter,
    /// Relative refractive index that was passed (transmitted over incident side), 1 for a reflection.
    pub eta: f64,
}

/// A scattering model.
#[derive(Clone, Debug, PartialEq)]
pub enum Bsdf {
    /// Lambertian reflection on the side of the normal.
    Diffuse(Diffuse),
    /// Mirror reflection by a metal on the side of the normal.
    Conductor(Conductor),
    /// Smooth boundary between two transparent media.
    Dielectric(Dielectric),
    /// A thin pane.
    ThinDielectric(ThinDielectric),
    /// Nothing: light passes straight on.
    Null,
    /// Microfacet reflection by a metal on the side of the normal.
    RoughConductor(RoughConductor),
    /// Microfacet boundary between two transparent media.
    RoughDielectric(RoughDielectric),
    /// A diffuse base under a smooth coat, on the side of the normal.
    Plastic(Plastic),
    /// A diffuse base under a rough coat, on the side of the normal.
    RoughPlastic(Box<RoughPlastic>),
    /// The modified Phong model on the side of the normal.
    Phong(Phong),
    /// Burley's model.
    Principled(Box<Principled>),
    /// A dielectric layer over another model, on the side of the normal.
    Coating(Box<Coating>),
    /// A model with gaps.
    Mask(Mask),
    /// A mixture of two models.
    Blend(Blend),
    /// One model for each side of the surface: on the side of the normal, and on the other.
    TwoSided(Box<[Bsdf; 2]>),
    /// A model as it is on a surface whose normal points the other way.
    Turned(Box<Bsdf>),
}

/// Mirrors at the plane of the surface.
#[inline]
fn flip(w: DVec3) -> DVec3 {
    DVec3::new(w.x, w.y, -w.z)
}

/// Straight on, the only thing that [`Bsdf::Null`] does.
#[inline]
fn pass(wi: DVec3) -> Scatter {
    Scatter::delta(-wi, Spectrum::ONE, 1.0, 1.0)
}

impl Bsdf {
    /// Value, densities and letter for a pair of directions; `None` where the value is zero, always so for delta lobes.
    #[inline]
    pub fn evaluate(&self, site: &Site, wi: DVec3, wo: DVec3, walk: Walk) -> Option<Evaluation> {
        // The most frequent model needs no call; nested models make one of the rest.
        match self {
            Self::Diffuse(diffuse) => diffuse.evaluate(site, wi, wo),
            _ => self.evaluate_any(site, wi, wo, walk),
        }
    }

    fn evaluate_any(&self, site: &Site, wi: DVec3, wo: DVec3, walk: Walk) -> Option<Evaluation> {
        match self {
            Self::Diffuse(diffuse) => diffuse.evaluate(site, wi, wo),
            Self::RoughConductor(rough) => rough.evaluate(site, wi, wo),
            Self::RoughDielectric(rough) => rough.evaluate(site, wi, wo, walk),
            Self::Conductor(_) | Self::Dielectric(_) | Self::ThinDielectric(_) | Self::Null => None,
            Self::Plastic(plastic) => plastic.evaluate(site, wi, wo),
            Self::RoughPlastic(plastic) => plastic.evaluate(site, wi, wo),
            Self::Phong(phong) => phong.evaluate(site, wi, wo),
            Self::Principled(principled) => principled.evaluate(site, wi, wo, walk),
            Self::Coating(coating) => coating.evaluate(site, wi, wo, walk),
            Self::Mask(mask) => mask.evaluate(site, wi, wo, walk),
            Self::Blend(blend) => blend.evaluate(site, wi, wo, walk),
            Self::TwoSided(sides) if wi.z >= 0.0 => sides[0].evaluate(site, wi, wo, walk),
            Self::TwoSided(sides) => sides[1].evaluate(site, flip(wi), flip(wo), walk),
            Self::Turned(bsdf) => bsdf.evaluate(site, flip(wi), flip(wo), walk),
        }
    }

    /// Samples a direction from the first three numbers of `row`; `None` where light is absorbed.
    #[inline]
    pub fn sample(&self, site: &Site, wi: DVec3, row: Row, walk: Walk) -> Option<Scatter> {
        match self {
            Self::Diffuse(diffuse) => diffuse.sample(site, wi, row),
            _ => self.sample_any(site, wi, row, walk),
        }
    }

    fn sample_any(&self, site: &Site, wi: DVec3, row: Row, walk: Walk) -> Option<Scatter> {
        let turned = |bsdf: &Self| {
            let scatter = bsdf.sample(site, flip(wi), row, walk)?;
            Some(Scatter { direction: flip(scatter.direction), ..scatter })
        };
        match self {
            Self::Diffuse(diffuse) => diffuse.sample(site, wi, row),
            Self::RoughConductor(rough) => rough.sample(site, wi, row),
            Self::RoughDielectric(rough) => rough.sample(site, wi, row, walk),
            Self::Conductor(conductor) => conductor.sample(site, wi),
            Self::Dielectric(dielectric) => dielectric.sample(wi, row, walk),
            Self::ThinDielectric(pane) => pane.sample(wi, row),
            Self::Null => Some(pass(wi)),
            Self::Plastic(plastic) => plastic.sample(site, wi, row),
            Self::RoughPlastic(plastic) => plastic.sample(site, wi, row),
            Self::Phong(phong) => phong.sample(site, wi, row),
            Self::Principled(principled) => principled.sample(site, wi, row, walk),
            Self::Coating(coating) => coating.sample(site, wi, row, walk),
            Self::Mask(mask) => mask.sample(site, wi, row, walk),
            Self::Blend(blend) => blend.sample(site, wi, row, walk),
            Self::TwoSided(sides) if wi.z >= 0.0 => sides[0].sample(site, wi, row, walk),
            Self::TwoSided(sides) => turned(&sides[1]),
            Self::Turned(bsdf) => turned(bsdf),
        }
    }

    /// A row that [`Bsdf::sample`] takes from `wi` to `wo`; numbers that the sampling leaves open are taken from
    /// `gamma`, and so is the lobe where several lead to `wo`. `delta` says whether a delta lobe is to be chosen, which
    /// the directions alone do not. `None` where `wo` cannot be sampled so.
    pub fn invert(&self, site: &Site, wi: DVec3, wo: DVec3, delta: bool, gamma: Row) -> Option<Row> {
        if if delta { !self.has_delta(wi) } else { self.is_delta(wi) } {
            return None;
        }
        match self {
            Self::Diffuse(diffuse) => diffuse.invert(wi, wo, gamma),
            Self::RoughConductor(rough) => rough.invert(site, wi, wo, gamma),
            Self::RoughDielectric(rough) => rough.invert(site, wi, wo, gamma),
            Self::Conductor(conductor) => conductor.invert(wi, wo, gamma),
            Self::Dielectric(dielectric) => dielectric.invert(wi, wo, gamma),
            Self::ThinDielectric(pane) => pane.invert(wi, wo, gamma),
            Self::Null => (wi.z * wo.z < 0.0).then_some(gamma),
            Self::Plastic(plastic) => plastic.invert(site, wi, wo, delta, gamma),
            Self::RoughPlastic(plastic) => plastic.invert(site, wi, wo, gamma),
            Self::Phong(phong) => phong.invert(site, wi, wo, gamma),
            Self::Principled(principled) => principled.invert(site, wi, wo, gamma),
            Self::Coating(coating) => coating.invert(site, wi, wo, delta, gamma),
            Self::Mask(mask) => mask.invert(site, wi, wo, delta, gamma),
            Self::Blend(blend) => blend.invert(site, wi, wo, delta, gamma),
            Self::TwoSided(sides) if wi.z >= 0.0 => sides[0].invert(site, wi, wo, delta, gamma),
            Self::TwoSided(sides) => sides[1].invert(site, flip(wi), flip(wo), delta, gamma),
            Self::Turned(bsdf) => bsdf.invert(site, flip(wi), flip(wo), delta, gamma),
        }
    }
}

#[cfg(test)]
mod tests;
