//! `<bsdf>` elements. Parameters and defaults are those of Mitsuba 3; models and parameters that only Mitsuba 0.6 has
//! are those of 0.6.

mod metals;
mod microfacet;
mod principled;

pub(super) use microfacet::Coats;

use super::attributes::Skin;
use super::document::Element;
use super::error::{LoadError, one_of};
use super::ior;
use super::plugin::Plugin;
use super::texture::Role;
use crate::bsdf::{
    Blend, Bsdf, Coating, Conductor, Dielectric, Diffuse, Mask, Phong, Plastic, RoughConductor, RoughDielectric,
    RoughPlastic, ThinDielectric,
};
use crate::spectrum::Spectrum;
use crate::texture::{Colour, Relief, ReliefMap};

const KINDS: [&str; 18] = [
    "diffuse",
    "conductor",
    "roughconductor",
    "dielectric",
    "thindielectric",
    "roughdielectric",
    "plastic",
    "roughplastic",
    "phong",
    "coating",
    "roughcoating",
    "principled",
    "null",
    "mask",
    "blendbsdf",
    "twosided",
    "bumpmap",
    "normalmap",
];

/// Reflectance of shapes without a BSDF, and of `diffuse` without a parameter.
const GREY: f64 = 0.5;

/// What models call their colour, where a diffuse one stands for them.
const COLOURS: [&str; 4] = ["reflectance", "diffuse_reflectance", "base_color", "specular_reflectance"];

/// Deepest nesting of models; references may run in a circle.
const DEEPEST: usize = 16;

/// Parameters that scene files carry for other renderers.
const FOREIGN: [&str; 1] = ["use_path_guiding"];

/// A scattering model, and the relief of the surface that has it.
pub(super) struct Model {
    pub bsdf: Bsdf,
    pub relief: Option<Relief>,
}

/// The model of shapes without a BSDF: as in Mitsuba, lights then reflect nothing.
pub(super) fn default(shines: bool) -> Bsdf {
    let reflectance = if shines { 0.0 } else { GREY };
    Bsdf::Diffuse(Diffuse { reflectance: Spectrum::grey(reflectance).into() })
}

/// The model as it is on a surface whose normal points the other way.
pub(super) fn turned(bsdf: Bsdf) -> Bsdf {
    match bsdf {
        Bsdf::TwoSided(sides) => {
            let [front, back] = *sides;
            Bsdf::TwoSided(Box::new([back, front]))
        }
        one => Bsdf::Turned(Box::new(one)),
    }
}

/// Reads a scattering model, as it is on the shape `skin`.
pub(super) fn read(element: Element<'_>, skin: Option<&Skin>) -> Result<Model, LoadError> {
    let mut reader = Reader { skin, depth: 0, relief: None };
    let bsdf = reader.read(element)?;
    Ok(Model { bsdf, relief: reader.relief })
}

/// What has been met on the way through nested models.
struct Reader<'s> {
    /// The shape that textures lie on, where one of them shows an attribute.
    skin: Option<&'s Skin>,
    depth: usize,
    relief: Option<Relief>,
}

impl Reader<'_> {
    fn read(&mut self, element: Element<'_>) -> Result<Bsdf, LoadError> {
        if self.depth > DEEPEST {
            return Err(element.error(format!("bsdfs nested more than {DEEPEST} deep; do references run in a circle?")));
        }
        self.depth += 1;
        let mut plugin = Plugin::new(element)?.on(self.skin);
        let bsdf = match plugin.kind {
            "mask" => Bsdf::Mask(Mask {
                opacity: plugin.number_texture("opacity", 0.5)?,
                nested: Box::new(self.one(&mut plugin)?),
            }),
            "blendbsdf" => Bsdf::Blend(self.blend(&mut plugin)?),
            "coating" | "roughcoating" => Bsdf::Coating(Box::new(self.coating(&mut plugin)?)),
            "twosided" => self.two_sided(&mut plugin)?,
            "bumpmap" | "normalmap" => self.relief(&mut plugin)?,
            kind if !KINDS.contains(&kind) => self.substitute(&mut plugin)?,
            _ => plain(&mut plugin)?,
        };
        plugin.ignore(&FOREIGN);
        plugin.finish()?;
        self.depth -= 1;
        Ok(bsdf)
    }

    /// What stands for an unknown model: the first one in it, or a diffuse one of its colour.
    fn substitute(&mut self, plugin: &mut Plugin<'_>) -> Result<Bsdf, LoadError> {
        let nested = plugin.objects("bsdf")?;
        let by = if nested.is_empty() { "a diffuse one of its colour" } else { "the first model in it" };
        plugin.stand_in(&KINDS, by)?;
        let colour = COLOURS.into_iter().find(|name| plugin.is_given(name)).unwrap_or("reflectance");
        let bsdf = match nested.first() {
            Some(first) => self.read(*first)?,
            None => Bsdf::Diffuse(Diffuse { reflectance: plugin.colour_texture(colour, GREY)? }),
        };
        plugin.ignore_rest();
        Ok(bsdf)
    }

    /// The one nested model.
    fn one(&mut self, plugin: &mut Plugin<'_>) -> Result<Bsdf, LoadError> {
        let nested = plugin.objects("bsdf")?;
        let [one] = nested[..] else {
            let message = format!("a {} with {} nested <bsdf>; expected one", plugin.kind, nested.len());
            return Err(plugin.element.error(message));
        };
        self.read(one)
    }

    fn blend(&mut self, plugin: &mut Plugin<'_>) -> Result<Blend, LoadError> {
        if !plugin.is_given("weight") {
            return Err(plugin.lacks("weight"));
        }
        let weight = plugin.number_texture("weight", 0.5)?;
        let nested = plugin.objects("bsdf")?;
        let [first, second] = nested[..] else {
            let message = format!("a blendbsdf with {} nested <bsdf>; expected two", nested.len());
            return Err(plugin.element.error(message));
        };
        Ok(Blend { weight, nested: Box::new([self.read(first)?, self.read(second)?]) })
    }

    /// The layers of Mitsuba 0.6.
    fn coating(&mut self, plugin: &mut Plugin<'_>) -> Result<Coating, LoadError> {
        let eta = relative_index(plugin, ior::BK7)?;
        let thickness = plugin.positive("thickness")?.unwrap_or(1.0);
        let valid = |colour: &Spectrum| colour.is_valid();
        let absorption = plugin.colour("sigma_a")?.map(|c| c.check(valid, "values of at least 0")).transpose()?;
        let rough = plugin.kind == "roughcoating";
        let rough = if rough { Some(microfacet::coat(plugin, eta)?) } else { None };
        let specular_reflectance = plugin.colour_texture("specular_reflectance", 1.0)?;
        let nested = self.one(plugin)?;
        if nested.transmits() {
            return Err(plugin
                .element
                .error(format!("a {} over a transparent bsdf; expected an opaque one", plugin.kind)));
        }
        let depth = absorption.unwrap_or(Spectrum::BLACK) * thickness;
        Ok(Coating { eta, depth, rough, specular_reflectance, nested: Box::new(nested) })
    }

    fn two_sided(&mut self, plugin: &mut Plugin<'_>) -> Result<Bsdf, LoadError> {
        let nested = plugin.objects("bsdf")?;
        let mut side = |element: &Element<'_>| {
            let kind = element.required("type")?;
            // One in itself is refused before it is read, so that the message does not speak of circles.
            let bsdf = if kind.text == "twosided" { None } else { Some(self.read(*element)?) };
            let message = format!("a twosided bsdf cannot hold `{}`; expected an opaque bsdf", kind.text);
            bsdf.filter(|bsdf| !bsdf.transmits()).ok_or_else(|| kind.error(message))
        };
        let sides = match &nested[..] {
            [both] => {
                let both = side(both)?;
                [both.clone(), both]
            }
            [front, back] => [side(front)?, side(back)?],
            _ => {
                let message = format!("a twosided bsdf with {} nested <bsdf>; expected one or two", nested.len());
                return Err(plugin.element.error(message));
            }
        };
        Ok(Bsdf::TwoSided(Box::new(sides)))
    }

    /// The nested model of a bump or normal map, whose texture is kept aside.
    fn relief(&mut self, plugin: &mut Plugin<'_>) -> Result<Bsdf, LoadError> {
        if self.relief.is_some() {
            return Err(plugin.element.error(format!("a {} inside of another relief; expected one", plugin.kind)));
        }
        let bump = plugin.kind == "bumpmap";
        let name = if bump { "map" } else { "normalmap" };
        let role = if bump { Role::Height } else { Role::Normal };
        let texture = match plugin.texture(name, role)? {
            Some(texture) => Some(texture),
            None => plugin.any_texture(role)?,
        };
        let texture = texture.ok_or_else(|| plugin.lacks(name))?;
        let map = if bump {
            ReliefMap::Bump { texture, scale: plugin.float("scale")?.map_or(1.0, |scale| scale.value) }
        } else {
            ReliefMap::Normal { texture }
        };
        self.relief = Some(Relief {
            map,
            mirrors: plugin.boolean_or("flip_invalid_normals", true)?,
            shadows: plugin.boolean_or("use_shadowing_function", true)?,
        });
        self.one(plugin)
    }
}

/// Reads a model that holds no others.
fn plain(plugin: &mut Plugin<'_>) -> Result<Bsdf, LoadError> {
    Ok(match plugin.kind {
        "diffuse" => Bsdf::Diffuse(Diffuse { reflectance: plugin.colour_texture("reflectance", GREY)? }),
        "conductor" => {
            plugin.ignore(&["alpha"]);
            Bsdf::Conductor(conductor(plugin)?)
        }
        "roughconductor" => Bsdf::RoughConductor(RoughConductor {
            metal: conductor(plugin)?,
            roughness: microfacet::roughness(plugin)?,
        }),
        "dielectric" => {
            plugin.ignore(&["alpha"]);
            Bsdf::Dielectric(dielectric(plugin)?)
        }
        "thindielectric" => {
            let Dielectric { eta, specular_reflectance, specular_transmittance } = dielectric(plugin)?;
            Bsdf::ThinDielectric(ThinDielectric { eta, specular_reflectance, specular_transmittance })
        }
        "roughdielectric" => Bsdf::RoughDielectric(rough_dielectric(plugin)?),
        "plastic" => Bsdf::Plastic(plastic(plugin)?),
        "roughplastic" => Bsdf::RoughPlastic(Box::new(rough_plastic(plugin)?)),
        "phong" => Bsdf::Phong(Phong {
            exponent: plugin.number_texture("exponent", 30.0)?,
            specular_reflectance: plugin.colour_texture("specular_reflectance", 0.2)?,
            diffuse_reflectance: plugin.colour_texture("diffuse_reflectance", 0.5)?,
        }),
        "principled" => Bsdf::Principled(Box::new(principled::principled(plugin)?)),
        "null" => Bsdf::Null,
        // Kinds that are not known have met `Reader::substitute`.
        _ => return Err(plugin.unknown(&KINDS)),
    })
}

/// A metal by its name or its complex refractive index; one without η reflects everything, as does `material` none.
/// `ext_eta` is the index of the medium outside, 1 where it is not given.
fn conductor(plugin: &mut Plugin<'_>) -> Result<Conductor, LoadError> {
    let material = plugin.string("material")?;
    let valid = |colour: &Spectrum| colour.is_valid();
    let mut index = |name| plugin.colour(name)?.map(|c| c.check(valid, "values of at least 0")).transpose();
    let (eta, k) = (index("eta")?, index("k")?);
    let index = match material.filter(|material| material.value.text != "none") {
        Some(material) if eta.is_some() || k.is_some() => {
            return Err(material.refuse("either `material` or `eta` and `k`"));
        }
        Some(material) => {
            let known = metals::named(material.value.text);
            Some(known.ok_or_else(|| material.refuse(&one_of(&metals::names())))?)
        }
        // With η = 0 and any k, all light is reflected; k is 1 where it is not given.
        None => eta.filter(|eta| !eta.is_black()).map(|eta| (eta, k.unwrap_or(Spectrum::ONE))),
    };
    let outside = ior::read(plugin, "ext_eta", 1.0)?;
    Ok(Conductor {
        index: index.map(|(eta, k)| (eta / outside, k / outside)),
        specular_reflectance: plugin.colour_texture("specular_reflectance", 1.0)?,
    })
}

fn dielectric(plugin: &mut Plugin<'_>) -> Result<Dielectric, LoadError> {
    Ok(Dielectric {
        eta: relative_index(plugin, ior::BK7)?,
        specular_reflectance: plugin.share("specular_reflectance", 1.0)?,
        specular_transmittance: plugin.share("specular_transmittance", 1.0)?,
    })
}

/// Refractive index inside over outside, of `inside` in air where it is not given.
fn relative_index(plugin: &mut Plugin<'_>, inside: f64) -> Result<f64, LoadError> {
    Ok(ior::read(plugin, "int_ior", inside)? / ior::read(plugin, "ext_ior", ior::AIR)?)
}

fn rough_dielectric(plugin: &mut Plugin<'_>) -> Result<RoughDielectric, LoadError> {
    let Dielectric { eta, specular_reflectance, specular_transmittance } = dielectric(plugin)?;
    if eta == 1.0 {
        return Err(plugin.element.error("`int_ior` equals `ext_ior`; expected two indices that differ"));
    }
    let roughness = microfacet::roughness(plugin)?;
    Ok(RoughDielectric { eta, roughness, specular_reflectance, specular_transmittance })
}

fn plastic(plugin: &mut Plugin<'_>) -> Result<Plastic, LoadError> {
    let eta = relative_index(plugin, ior::POLYPROPYLENE)?;
    let (diffuse, specular) = reflectances(plugin)?;
    Ok(Plastic::new(eta, diffuse, specular, plugin.boolean("nonlinear")?))
}

fn rough_plastic(plugin: &mut Plugin<'_>) -> Result<RoughPlastic, LoadError> {
    let eta = relative_index(plugin, ior::POLYPROPYLENE)?;
    let (diffuse, specular) = reflectances(plugin)?;
    let coat = microfacet::coat(plugin, eta)?;
    Ok(RoughPlastic::new(coat, diffuse, specular, plugin.boolean("nonlinear")?))
}

/// Of the base and of the coat.
fn reflectances(plugin: &mut Plugin<'_>) -> Result<(Colour, Colour), LoadError> {
    let diffuse = plugin.colour_texture("diffuse_reflectance", 0.5)?;
    Ok((diffuse, plugin.colour_texture("specular_reflectance", 1.0)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Stream, Walk};
    use crate::texture::Site;
    use glam::DVec3;

    /// A turned model does from below what the model does from above.
    #[test]
    fn turned_models_mirror() {
        let glass = Dielectric { eta: 1.5, specular_reflectance: Spectrum::ONE, specular_transmittance: Spectrum::ONE };
        let mirror = Conductor { index: None, specular_reflectance: Spectrum::grey(0.9).into() };
        let sides = Bsdf::TwoSided(Box::new([default(false), Bsdf::Conductor(mirror.clone())]));
        let mut stream = Stream::new(1, &[]);
        for bsdf in [default(false), Bsdf::Conductor(mirror), Bsdf::Dielectric(glass), sides] {
            let other = turned(bsdf.clone());
            for wi in [DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.0, 0.28, -0.96)] {
                let row = stream.row();
                let mirrored = |w: DVec3| DVec3::new(w.x, w.y, -w.z);
                let here = bsdf.sample(&Site::default(), wi, row, Walk::FromCamera);
                let there = other.sample(&Site::default(), mirrored(wi), row, Walk::FromCamera);
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
