//! Materials of version 4, and those of version 3 that have a counterpart among them.

use super::Importer;
use super::colour::{self, Role};
use super::params::{COLOURS, Params};
use super::source::Spot;
use super::texture::{Texture, grey};
use super::xml::Node;
use crate::load::LoadError;
use crate::spectrum::Spectrum;

/// Roughness below which pbrt takes a surface for smooth.
const SMOOTH: f64 = 1e-3;

/// Most elements of one material.
const MOST_ELEMENTS: usize = 1000;

const MATERIALS: [&str; 25] = [
    "diffuse",
    "coateddiffuse",
    "conductor",
    "dielectric",
    "thindielectric",
    "mix",
    "interface",
    "coatedconductor",
    "diffusetransmission",
    "measured",
    "subsurface",
    "hair",
    "matte",
    "plastic",
    "metal",
    "glass",
    "mirror",
    "substrate",
    "uber",
    "translucent",
    "disney",
    "fourier",
    "kdsubsurface",
    "none",
    "",
];

/// A material as it came out.
#[derive(Clone)]
pub(super) struct Material {
    pub id: String,
    /// The model for one side.
    pub node: Node,
    /// Whether light passes through it, which models for two sides cannot have.
    pub transmissive: bool,
    /// The model's opacity, where the material has one.
    pub opacity: Option<Texture>,
    pub used: bool,
}

impl Material {
    /// The model for both sides, with its name.
    pub fn whole(&self) -> Node {
        self.sides().with("id", self.id.clone())
    }

    /// The model for both sides.
    pub fn sides(&self) -> Node {
        let node =
            if self.transmissive { self.node.clone() } else { Node::new("bsdf", "twosided").child(self.node.clone()) };
        match &self.opacity {
            Some(opacity) => Node::new("bsdf", "mask").child(opacity.float_node("opacity")).child(node),
            None => node,
        }
    }

    /// Whether texture coordinates matter.
    pub fn is_textured(&self) -> bool {
        self.whole().contains("texture")
    }
}

/// A model, and whether light passes through it.
pub(super) struct Model {
    pub node: Node,
    pub transmissive: bool,
    pub opacity: Option<Texture>,
}

impl Model {
    pub fn opaque(node: Node) -> Self {
        Self { node, transmissive: false, opacity: None }
    }

    pub fn transmissive(node: Node) -> Self {
        Self { node, transmissive: true, opacity: None }
    }
}

/// How wide a microfacet distribution is along u and v.
pub(super) type Alpha = [f64; 2];

impl Importer<'_> {
    /// `Material "type" parameters`.
    pub(super) fn material(&mut self, kind: &str, params: Params) -> Result<(), LoadError> {
        let id = format!("material_{:04}", self.materials.len() + 1);
        self.state.material = Some(self.add_material(id, kind, params)?);
        Ok(())
    }

    /// `MakeNamedMaterial "name" "string type" "type" parameters`.
    pub(super) fn named_material(&mut self, name: String, mut params: Params) -> Result<(), LoadError> {
        let kind =
            params.string("type")?.ok_or_else(|| params.spot.error("this material lacks the parameter `type`"))?;
        params.what = format!("material `{kind}`");
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '-';
        let mut id: String = name.chars().map(|c| if plain(c) { c } else { '_' }).collect();
        let taken = |id: &str| self.materials.iter().any(|material| material.id == id);
        if id.is_empty() || id.starts_with('_') || taken(&id) || id.starts_with("object_") {
            id = format!("named_{id}_{}", self.materials.len() + 1);
        }
        let index = self.add_material(id, &kind, params)?;
        self.named.insert(name, index);
        Ok(())
    }

    fn add_material(&mut self, id: String, kind: &str, mut params: Params) -> Result<usize, LoadError> {
        let model = self.model(kind, &mut params)?;
        let node = self.relief(model.node, &mut params)?;
        self.finish(params);
        let Model { transmissive, opacity, .. } = model;
        self.materials.push(Material { id, node, transmissive, opacity, used: false });
        Ok(self.materials.len() - 1)
    }

    /// `NamedMaterial "name"`.
    pub(super) fn use_material(&mut self, name: &str, spot: &Spot) -> Result<(), LoadError> {
        match self.named.get(name) {
            Some(index) => self.state.material = Some(*index),
            None => {
                let known = super::names(&self.named);
                self.unknown(spot, "the material", name, &known, "a grey diffuse one")?;
                self.state.material = None;
            }
        }
        Ok(())
    }

    /// The model of a material.
    fn model(&mut self, kind: &str, params: &mut Params) -> Result<Model, LoadError> {
        match kind {
            "diffuse" => self.diffuse(params, "reflectance"),
            "matte" => {
                if params.has("sigma") && self.number(params, "sigma", 0.0)? != 0.0 {
                    self.report.approximated(&params.spot, "the roughness of a matte material: none");
                }
                self.diffuse(params, "Kd")
            }
            "conductor" => self.conductor(params, "", 0.0, Roughness::SquareRoot),
            "metal" => self.conductor(params, "", 0.01, Roughness::Polynomial),
            "mirror" => {
                let reflectance = self.share(params, "Kr", 0.9)?;
                Ok(Model::opaque(Node::new("bsdf", "conductor").child(reflectance.node("specular_reflectance"))))
            }
            "dielectric" => self.dielectric(params, Roughness::SquareRoot),
            "glass" => self.dielectric(params, Roughness::Polynomial),
            "thindielectric" => {
                let eta = self.index(params, &["eta"], 1.5)?;
                let node = Node::new("bsdf", "thindielectric").float("int_ior", eta).float("ext_ior", 1.0);
                Ok(Model::transmissive(node))
            }
            "mix" => self.mix(params),
            "interface" | "none" | "" => Ok(Model::transmissive(Node::new("bsdf", "null"))),
            _ if MATERIALS.contains(&kind) => self.layered(kind, params),
            _ => {
                self.unknown(&params.spot, "the material", kind, &MATERIALS, "a grey diffuse one")?;
                params.list.clear();
                Ok(Model::opaque(Node::new("bsdf", "diffuse").rgb("reflectance", Spectrum::grey(0.5))))
            }
        }
    }

    fn diffuse(&mut self, params: &mut Params, name: &str) -> Result<Model, LoadError> {
        let reflectance = self.share(params, name, 0.5)?;
        Ok(Model::opaque(Node::new("bsdf", "diffuse").child(reflectance.node("reflectance"))))
    }

    /// A metal by name, by its indices, or by its reflectance. `layer` comes before the names of the parameters.
    pub(super) fn conductor(
        &mut self,
        params: &mut Params,
        layer: &str,
        roughness: f64,
        law: Roughness,
    ) -> Result<Model, LoadError> {
        let alpha = self.alpha(params, layer, roughness, law)?;
        let node = rough("conductor", "roughconductor", alpha);
        if let Some(reflectance) = self.maybe_share(params, "reflectance")? {
            return Ok(Model::opaque(match reflectance.constant() {
                // As in pbrt: η is 1 and k such that the metal reflects that much head-on.
                Some(colour) => {
                    let k = colour.map(|r| 2.0 * r.min(0.9999).sqrt() / (1.0 - r.min(0.9999)).sqrt());
                    node.rgb("eta", Spectrum::ONE).rgb("k", k)
                }
                None => {
                    self.report.approximated(&params.spot, "a textured metal: without its Fresnel term");
                    node.child(reflectance.node("specular_reflectance"))
                }
            }));
        }
        let copper = colour::metal("Cu").unwrap_or([Spectrum::ONE; 2]);
        let mut values = copper;
        for (value, name) in values.iter_mut().zip(["eta", "k"]) {
            let name = format!("{layer}{name}");
            if let Some(texture) = self.maybe_texture(params, &name)? {
                *value = self.fixed(&texture, *value, &name, &params.spot);
            }
        }
        Ok(Model::opaque(node.rgb("eta", values[0]).rgb("k", values[1])))
    }

    fn dielectric(&mut self, params: &mut Params, law: Roughness) -> Result<Model, LoadError> {
        let eta = self.index(params, &["eta", "index"], 1.5)?;
        let alpha = self.alpha(params, "", 0.0, law)?;
        let mut node = rough("dielectric", "roughdielectric", alpha).float("int_ior", eta).float("ext_ior", 1.0);
        for (name, parameter) in [("Kr", "specular_reflectance"), ("Kt", "specular_transmittance")] {
            if let Some(share) = self.maybe_share(params, name)? {
                node = node.child(share.node(parameter));
            }
        }
        Ok(Model::transmissive(node))
    }

    /// Version 4 has a list of two materials, version 3 two names; `amount` is the share of the second, and in version
    /// 3 that of the first.
    fn mix(&mut self, params: &mut Params) -> Result<Model, LoadError> {
        let mut names = Vec::new();
        for parameter in ["materials", "namedmaterial2", "namedmaterial1"] {
            if let Some(param) = params.take(parameter, &["string"])? {
                for (index, name) in param.strings()?.iter().enumerate() {
                    let found = self.named.get(name).and_then(|index| self.materials.get(*index));
                    let found = found.ok_or_else(|| param.error_at(index, "the name of a material defined before"))?;
                    names.push(found.clone());
                }
            }
        }
        let [first, second] = &names[..] else {
            return Err(params.spot.error(format!("found {} materials in a mix; expected 2", names.len())));
        };
        // Each use is a copy: mixes of mixes of mixes would grow without bound.
        if first.node.count() + second.node.count() > MOST_ELEMENTS {
            let message =
                format!("found a mix of more than {MOST_ELEMENTS} elements; expected fewer mixes inside mixes");
            return Err(params.spot.error(message));
        }
        let amount = self.texture(params, "amount", 0.5)?;
        let amount = self.baked(amount, &params.spot);
        let transmissive = [first, second].iter().any(|material| material.transmissive || material.opacity.is_some());
        let side = |material: &Material| if transmissive { material.sides() } else { material.node.clone() };
        let node = Node::new("bsdf", "blendbsdf").child(amount.float_node("weight"));
        let node = node.child(side(first)).child(side(second));
        Ok(Model { node, transmissive, opacity: None })
    }

    /// Bumps and normal maps around a model.
    fn relief(&mut self, node: Node, params: &mut Params) -> Result<Node, LoadError> {
        let mut node = node;
        if let Some(file) = params.take("normalmap", &["string"])? {
            let map = Node::new("texture", "bitmap").named("normalmap").string("filename", self.resource(&file)?);
            node = Node::new("bsdf", "normalmap").child(map.boolean("raw", true)).child(node);
        }
        for name in ["displacement", "bumpmap"] {
            let Some(texture) = self.maybe_texture(params, name)? else { continue };
            let scale = texture.image_factor().map_or(1.0, grey);
            // A constant height changes nothing.
            if texture.constant().is_none() {
                let bump = Node::new("bsdf", "bumpmap").child(texture.float_node("arbitrary"));
                node = bump.float("scale", scale).child(node);
            }
        }
        Ok(node)
    }

    /// The parameter `name`, whose values are shares of light.
    pub(super) fn share(&mut self, params: &mut Params, name: &str, default: f64) -> Result<Texture, LoadError> {
        Ok(self.maybe_share(params, name)?.unwrap_or(Texture::grey(default)))
    }

    /// The parameter `name`, whose values are shares of light; `None` where it is not given.
    pub(super) fn maybe_share(&mut self, params: &mut Params, name: &str) -> Result<Option<Texture>, LoadError> {
        let Some(texture) = self.maybe_texture(params, name)? else { return Ok(None) };
        let texture = self.baked(texture, &params.spot);
        Ok(Some(match texture.constant() {
            Some(colour) if colour.max_element() > 1.0 => {
                self.report.approximated(&params.spot, format!("`{name}` above 1: 1"));
                Texture::Constant(colour.map(|channel| channel.min(1.0)))
            }
            _ => texture,
        }))
    }

    /// The value of a texture where Mitsuba has no texture.
    fn fixed(&mut self, texture: &Texture, default: Spectrum, name: &str, spot: &Spot) -> Spectrum {
        texture.constant().unwrap_or_else(|| {
            let [r, g, b] = default.to_rgb();
            self.report.approximated(spot, format!("`{name}` is a texture: {r} {g} {b} everywhere"));
            default
        })
    }

    /// A number that may be given as a texture.
    pub(super) fn number(&mut self, params: &mut Params, name: &str, default: f64) -> Result<f64, LoadError> {
        let Some(texture) = self.maybe_texture(params, name)? else { return Ok(default) };
        Ok(grey(self.fixed(&texture, Spectrum::grey(default), name, &params.spot)))
    }

    /// A refractive index, by the first of the names that is given.
    pub(super) fn index(&mut self, params: &mut Params, names: &[&str], default: f64) -> Result<f64, LoadError> {
        for name in names {
            let Some(param) = params.take(name, &[&COLOURS[..], &["float", "texture"]].concat())? else { continue };
            if param.kind == "texture" {
                self.report.approximated(&param.spot, format!("`{name}` is a texture: {default} everywhere"));
                return Ok(default);
            }
            let colour = colour::read(&param, Role::Share, &self.folder)?;
            // Glasses by name have no colour; of samples the middle counts.
            let index = grey(colour);
            return if index > 0.0 { Ok(index) } else { Err(param.error_at(0, "a number above 0")) };
        }
        Ok(default)
    }

    /// The widths that the roughness stands for.
    pub(super) fn alpha(
        &mut self,
        params: &mut Params,
        layer: &str,
        default: f64,
        law: Roughness,
    ) -> Result<Alpha, LoadError> {
        let both = self.roughness(params, &format!("{layer}roughness"))?.unwrap_or(default);
        let u = self.roughness(params, &format!("{layer}uroughness"))?.unwrap_or(both);
        let v = self.roughness(params, &format!("{layer}vroughness"))?.unwrap_or(both);
        let remap = params.boolean("remaproughness")?.unwrap_or(true);
        // Smooth glass of version 3 has the roughness 0, which its polynomial would make rough.
        Ok([u, v].map(|roughness| if remap && roughness > 0.0 { law.alpha(roughness) } else { roughness }))
    }

    fn roughness(&mut self, params: &mut Params, name: &str) -> Result<Option<f64>, LoadError> {
        let first = params.list.iter().find(|param| param.name == name).cloned();
        let Some(param) = first else { return Ok(None) };
        let value = self.number(params, name, 0.3)?;
        if value >= 0.0 { Ok(Some(value)) } else { Err(param.error_at(0, "a number of at least 0")) }
    }
}

/// How a roughness from 0 to 1 becomes the width of a distribution.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Roughness {
    /// Version 4.
    SquareRoot,
    /// Version 3.
    Polynomial,
}

impl Roughness {
    fn alpha(self, roughness: f64) -> f64 {
        match self {
            Self::SquareRoot => roughness.sqrt(),
            Self::Polynomial => {
                let x = roughness.max(1e-3).ln();
                1.62142 + x * (0.819955 + x * (0.1734 + x * (0.0171201 + x * 0.000640711)))
            }
        }
    }
}

/// The `smooth` plugin, or the `rough` one with its widths.
pub(super) fn rough(smooth: &str, rough: &str, [u, v]: Alpha) -> Node {
    if u.max(v) < SMOOTH {
        return Node::new("bsdf", smooth);
    }
    let node = Node::new("bsdf", rough).string("distribution", "ggx");
    if u == v {
        return node.float("alpha", u);
    }
    node.float("alpha_u", u.max(SMOOTH)).float("alpha_v", v.max(SMOOTH))
}
