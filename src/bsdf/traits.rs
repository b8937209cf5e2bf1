//! What integrators ask of a model before they look at directions.

use super::{Bsdf, Letter, flip};
use crate::texture::{Number, Site, Texture};
use glam::DVec3;

impl Bsdf {
    /// Whether all lobes for light from `wi` are Dirac densities, so that no connection can be made there.
    #[inline]
    pub fn is_delta(&self, wi: DVec3) -> bool {
        // As in `Bsdf::evaluate`, the most frequent model needs no call.
        !matches!(self, Self::Diffuse(_)) && self.is_all_delta(wi)
    }

    fn is_all_delta(&self, wi: DVec3) -> bool {
        match self {
            Self::Conductor(_) | Self::Dielectric(_) | Self::ThinDielectric(_) | Self::Null => true,
            Self::Diffuse(_)
            | Self::RoughConductor(_)
            | Self::RoughDielectric(_)
            | Self::Plastic(_)
            | Self::RoughPlastic(_)
            | Self::Phong(_)
            | Self::Principled(_) => false,
            Self::Coating(coating) => coating.rough.is_none() && coating.nested.is_delta(wi),
            Self::Mask(mask) => mask.nested.is_delta(wi),
            Self::Blend(blend) => blend.nested.iter().all(|nested| nested.is_delta(wi)),
            Self::TwoSided(sides) if wi.z >= 0.0 => sides[0].is_delta(wi),
            Self::TwoSided(sides) => sides[1].is_delta(flip(wi)),
            Self::Turned(bsdf) => bsdf.is_delta(flip(wi)),
        }
    }

    /// Whether some lobes for light from `wi` are Dirac densities, so that a walk may go on by one.
    #[inline]
    pub fn has_delta(&self, wi: DVec3) -> bool {
        match self {
            Self::Conductor(_) | Self::Dielectric(_) | Self::ThinDielectric(_) | Self::Null => true,
            Self::Plastic(_) | Self::Mask(_) => true,
            Self::Diffuse(_)
            | Self::RoughConductor(_)
            | Self::RoughDielectric(_)
            | Self::RoughPlastic(_)
            | Self::Phong(_)
            | Self::Principled(_) => false,
            Self::Coating(coating) => coating.rough.is_none() || coating.nested.has_delta(wi),
            Self::Blend(blend) => blend.nested.iter().any(|nested| nested.has_delta(wi)),
            Self::TwoSided(sides) if wi.z >= 0.0 => sides[0].has_delta(wi),
            Self::TwoSided(sides) => sides[1].has_delta(flip(wi)),
            Self::Turned(bsdf) => bsdf.has_delta(flip(wi)),
        }
    }

    /// Whether [`Bsdf::sample`] may choose among lobes by the first number of a row.
    pub fn chooses(&self) -> bool {
        match self {
            Self::Diffuse(_) => false,
            Self::TwoSided(sides) => sides.iter().any(Self::chooses),
            Self::Turned(bsdf) => bsdf.chooses(),
            _ => true,
        }
    }

    /// Whether light that arrives from `wi` leaves diffuse-like: where photons are gathered.
    #[inline]
    pub fn gathers(&self, wi: DVec3) -> bool {
        match self {
            Self::Diffuse(_) | Self::Plastic(_) | Self::RoughPlastic(_) | Self::Phong(_) => true,
            Self::RoughConductor(rough) => rough.roughness.gathers(),
            Self::RoughDielectric(rough) => rough.roughness.gathers(),
            Self::Conductor(_) | Self::Dielectric(_) | Self::ThinDielectric(_) | Self::Null => false,
            Self::Principled(principled) => principled.gathers(),
            Self::Coating(coating) => {
                let rough = coating.rough.as_ref().map(|rough| rough.microfacet.letter());
                rough == Some(Letter::D) || coating.nested.gathers(wi)
            }
            Self::Mask(mask) => mask.nested.gathers(wi),
            Self::Blend(blend) => blend.nested.iter().any(|nested| nested.gathers(wi)),
            Self::TwoSided(sides) if wi.z >= 0.0 => sides[0].gathers(wi),
            Self::TwoSided(sides) => sides[1].gathers(flip(wi)),
            Self::Turned(bsdf) => bsdf.gathers(flip(wi)),
        }
    }

    /// Whether light may pass to the other side.
    pub fn transmits(&self) -> bool {
        match self {
            Self::Dielectric(_) | Self::ThinDielectric(_) | Self::RoughDielectric(_) | Self::Null | Self::Mask(_) => {
                true
            }
            Self::Diffuse(_)
            | Self::Conductor(_)
            | Self::RoughConductor(_)
            | Self::Plastic(_)
            | Self::RoughPlastic(_)
            | Self::Phong(_)
            | Self::Coating(_)
            | Self::TwoSided(_) => false,
            Self::Principled(principled) => principled.transmits(),
            Self::Blend(blend) => blend.nested.iter().any(Self::transmits),
            Self::Turned(bsdf) => bsdf.transmits(),
        }
    }

    /// Refractive index on the side away from the normal over that on the normal's, if there is one smooth or rough
    /// boundary that bends light which passes.
    pub fn refractive_index(&self) -> Option<f64> {
        match self {
            Self::Dielectric(glass) => Some(glass.eta),
            Self::RoughDielectric(rough) => Some(rough.eta),
            Self::Turned(bsdf) => bsdf.refractive_index().map(f64::recip),
            Self::Mask(mask) => mask.nested.refractive_index(),
            Self::Blend(blend) => blend.nested.iter().find_map(Self::refractive_index),
            Self::Diffuse(_)
            | Self::Conductor(_)
            | Self::RoughConductor(_)
            | Self::ThinDielectric(_)
            | Self::Null
            | Self::Plastic(_)
            | Self::RoughPlastic(_)
            | Self::Phong(_)
            | Self::Principled(_)
            | Self::Coating(_)
            | Self::TwoSided(_) => None,
        }
    }

    /// Roughness α, the smaller one, of a model that has one microfacet lobe and nothing else, as `met` meets it; a mirror
    /// but for a blur.
    pub fn gloss(&self, site: &Site, met: DVec3) -> Option<f64> {
        match self {
            Self::RoughConductor(rough) => Some(rough.roughness.at(site).alpha.min_element()),
            Self::RoughDielectric(rough) => Some(rough.roughness.at(site).alpha.min_element()),
            Self::TwoSided(sides) => sides[usize::from(met.z < 0.0)].gloss(site, met),
            Self::Turned(bsdf) => bsdf.gloss(site, met),
            _ => None,
        }
    }

    /// Whether it is the same for directions turned about the normal, so that the tangent does not matter.
    pub fn is_isotropic(&self) -> bool {
        match self {
            Self::RoughConductor(rough) => rough.roughness.is_isotropic(),
            Self::RoughDielectric(rough) => rough.roughness.is_isotropic(),
            Self::Principled(principled) => matches!(principled.anisotropic, Number::Constant(0.0)),
            Self::Coating(coating) => coating.nested.is_isotropic(),
            Self::Mask(mask) => mask.nested.is_isotropic(),
            Self::Blend(blend) => blend.nested.iter().all(Self::is_isotropic),
            Self::TwoSided(sides) => sides.iter().all(Self::is_isotropic),
            Self::Turned(bsdf) => bsdf.is_isotropic(),
            Self::Diffuse(_)
            | Self::Conductor(_)
            | Self::Dielectric(_)
            | Self::ThinDielectric(_)
            | Self::Null
            | Self::Plastic(_)
            | Self::RoughPlastic(_)
            | Self::Phong(_) => true,
        }
    }

    /// The texture that it is most likely to ask for, if any.
    #[inline]
    pub fn texture(&self) -> Option<&Texture> {
        match self {
            Self::Diffuse(diffuse) => diffuse.reflectance.texture(),
            Self::Plastic(plastic) => plastic.base.reflectance.texture(),
            Self::RoughPlastic(plastic) => plastic.base.reflectance.texture(),
            Self::Phong(phong) => phong.diffuse_reflectance.texture(),
            Self::Principled(principled) => principled.base_color.texture(),
            Self::Conductor(metal) => metal.specular_reflectance.texture(),
            Self::RoughConductor(rough) => rough.metal.specular_reflectance.texture(),
            Self::Dielectric(_) | Self::ThinDielectric(_) | Self::RoughDielectric(_) | Self::Null => None,
            Self::Coating(coating) => coating.nested.texture(),
            Self::Mask(mask) => mask.nested.texture(),
            Self::Blend(blend) => blend.nested[0].texture().or_else(|| blend.nested[1].texture()),
            Self::TwoSided(sides) => sides[0].texture().or_else(|| sides[1].texture()),
            Self::Turned(bsdf) => bsdf.texture(),
        }
    }

    /// Whether it is the same everywhere, so that texture coordinates do not matter.
    pub fn is_constant(&self) -> bool {
        match self {
            Self::Diffuse(diffuse) => diffuse.reflectance.is_constant(),
            Self::Dielectric(_) | Self::ThinDielectric(_) | Self::Null => true,
            Self::Conductor(metal) => metal.specular_reflectance.is_constant(),
            Self::RoughConductor(rough) => {
                rough.metal.specular_reflectance.is_constant() && rough.roughness.is_constant()
            }
            Self::RoughDielectric(rough) => rough.roughness.is_constant(),
            Self::Plastic(plastic) => {
                plastic.base.reflectance.is_constant() && plastic.specular_reflectance.is_constant()
            }
            Self::RoughPlastic(plastic) => {
                plastic.base.reflectance.is_constant() && plastic.specular_reflectance.is_constant()
            }
            Self::Phong(phong) => {
                phong.specular_reflectance.is_constant()
                    && phong.diffuse_reflectance.is_constant()
                    && phong.exponent.is_constant()
            }
            Self::Principled(principled) => principled.is_constant(),
            Self::Coating(coating) => coating.specular_reflectance.is_constant() && coating.nested.is_constant(),
            Self::Mask(mask) => mask.opacity.is_constant() && mask.nested.is_constant(),
            Self::Blend(blend) => blend.weight.is_constant() && blend.nested.iter().all(Self::is_constant),
            Self::TwoSided(sides) => sides.iter().all(Self::is_constant),
            Self::Turned(bsdf) => bsdf.is_constant(),
        }
    }
}
