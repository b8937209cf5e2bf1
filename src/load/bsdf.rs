//! `<bsdf>` elements. Parameters and defaults are those of Mitsuba 3.

use super::document::Element;
use super::error::LoadError;
use super::ior;
use super::plugin::Plugin;
use crate::bsdf::{Bsdf, Conductor, Dielectric, Diffuse, Distribution, Microfacet, RoughConductor};
use crate::spectrum::Spectrum;

const KINDS: [&str; 5] = ["diffuse", "conductor", "roughconductor", "dielectric", "twosided"];

/// Reflectance of shapes without a BSDF, and of `diffuse` without a parameter.
const GREY: f64 = 0.5;

/// The model of shapes without a BSDF.
pub(super) fn default() -> Bsdf {
    Bsdf::Diffuse(Diffuse { reflectance: Spectrum::grey(GREY).into() })
}

/// Reads a scattering model.
pub(super) fn read(element: Element<'_>) -> Result<Bsdf, LoadError> {
    let mut plugin = Plugin::new(element)?;
    let bsdf = match plugin.kind {
        "diffuse" => Bsdf::Diffuse(Diffuse { reflectance: plugin.share("reflectance", GREY)?.into() }),
        "conductor" => Bsdf::Conductor(conductor(&mut plugin)?),
        "roughconductor" => Bsdf::RoughConductor(rough_conductor(&mut plugin)?),
        "dielectric" => Bsdf::Dielectric(dielectric(&mut plugin)?),
        "twosided" => two_sided(&mut plugin)?,
        _ => return Err(plugin.unknown(&KINDS)),
    };
    plugin.finish()?;
    Ok(bsdf)
}

/// The model as it is on a surface whose normal points the other way.
pub(super) fn turned(bsdf: Bsdf) -> Bsdf {
    let black = Bsdf::Diffuse(Diffuse { reflectance: Spectrum::BLACK.into() });
    match bsdf {
        Bsdf::Dielectric(glass) => Bsdf::Dielectric(Dielectric { eta: 1.0 / glass.eta, ..glass }),
        Bsdf::TwoSided(sides) => {
            let [front, back] = *sides;
            Bsdf::TwoSided(Box::new([back, front]))
        }
        opaque @ (Bsdf::Diffuse(_) | Bsdf::Conductor(_) | Bsdf::RoughConductor(_)) => {
            Bsdf::TwoSided(Box::new([black, opaque]))
        }
    }
}

/// A metal by its complex refractive index; one without η reflects everything, as does `material` none.
fn conductor(plugin: &mut Plugin<'_>) -> Result<Conductor, LoadError> {
    let material = plugin.string("material")?;
    let valid = |colour: &Spectrum| colour.is_valid();
    let mut index = |name| plugin.colour(name)?.map(|c| c.check(valid, "values of at least 0")).transpose();
    let (eta, k) = (index("eta")?, index("k")?);
    if let Some(material) = material.filter(|material| material.value.text != "none") {
        return Err(material.refuse("none: measured metals come later; give `eta` and `k` instead"));
    }
    Ok(Conductor {
        // With η = 0 and any k, all light is reflected; k is 1 where it is not given.
        index: eta.filter(|eta| !eta.is_black()).map(|eta| (eta, k.unwrap_or(Spectrum::ONE))),
        specular_reflectance: plugin.share("specular_reflectance", 1.0)?,
    })
}

fn rough_conductor(plugin: &mut Plugin<'_>) -> Result<RoughConductor, LoadError> {
    plugin.ignore(&["sample_visible"]);
    let metal = conductor(plugin)?;
    let distribution = match plugin.string("distribution")? {
        None => Distribution::Beckmann,
        Some(name) => match name.value.text {
            "beckmann" => Distribution::Beckmann,
            "ggx" => Distribution::Ggx,
            _ => return Err(name.refuse("one of beckmann, ggx")),
        },
    };
    let alpha = plugin.positive("alpha")?.unwrap_or(0.1);
    Ok(RoughConductor { metal, microfacet: Microfacet { distribution, alpha } })
}

fn dielectric(plugin: &mut Plugin<'_>) -> Result<Dielectric, LoadError> {
    let inside = ior::read(plugin, "int_ior", ior::BK7)?;
    let outside = ior::read(plugin, "ext_ior", ior::AIR)?;
    Ok(Dielectric {
        eta: inside / outside,
        specular_reflectance: plugin.share("specular_reflectance", 1.0)?,
        specular_transmittance: plugin.share("specular_transmittance", 1.0)?,
    })
}

fn two_sided(plugin: &mut Plugin<'_>) -> Result<Bsdf, LoadError> {
    let nested = plugin.objects("bsdf")?;
    let side = |element: &Element<'_>| {
        // Refused before it is read, so that references cannot run in a circle.
        if let Some(kind) = element.attribute("type").filter(|kind| ["twosided", "dielectric"].contains(&kind.text)) {
            return Err(kind.error(format!("a twosided bsdf cannot hold `{}`; expected an opaque bsdf", kind.text)));
        }
        read(*element)
    };
    let sides = match &nested[..] {
        [both] => [side(both)?, side(both)?],
        [front, back] => [side(front)?, side(back)?],
        _ => {
            let message = format!("a twosided bsdf with {} nested <bsdf>; expected one or two", nested.len());
            return Err(plugin.element.error(message));
        }
    };
    Ok(Bsdf::TwoSided(Box::new(sides)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Stream, Walk};
    use glam::{DVec2, DVec3};

    /// A turned model does from below what the model does from above.
    #[test]
    fn turned_models_mirror() {
        let glass = Dielectric { eta: 1.5, specular_reflectance: Spectrum::ONE, specular_transmittance: Spectrum::ONE };
        let mirror = Conductor { index: None, specular_reflectance: Spectrum::grey(0.9) };
        let sides = Bsdf::TwoSided(Box::new([default(), Bsdf::Conductor(mirror)]));
        let mut stream = Stream::new(1, &[]);
        for bsdf in [default(), Bsdf::Conductor(mirror), Bsdf::Dielectric(glass), sides] {
            let other = turned(bsdf.clone());
            for wi in [DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.0, 0.28, -0.96)] {
                let row = stream.row();
                let mirrored = |w: DVec3| DVec3::new(w.x, w.y, -w.z);
                let here = bsdf.sample(DVec2::ZERO, wi, row, Walk::FromCamera);
                let there = other.sample(DVec2::ZERO, mirrored(wi), row, Walk::FromCamera);
                let seen = here.map(|s| (s.direction, s.weight));
                let expected = there.filter(|s| !s.weight.is_black()).map(|s| (mirrored(s.direction), s.weight));
                assert_eq!(seen.is_some(), expected.is_some(), "{bsdf:?} {wi}");
                if let (Some((a, x)), Some((b, y))) = (seen, expected) {
                    assert!((a - b).length() < 1e-12 && x == y, "{bsdf:?} {wi}");
                }
            }
        }
    }
}
