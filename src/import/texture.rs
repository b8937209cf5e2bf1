//! Textures: a value, an image or a pattern.

use super::Importer;
use super::colour::{self, Role};
use super::params::{COLOURS, Param, Params};
use super::xml::{Node, rgb};
use crate::load::LoadError;
use crate::spectrum::Spectrum;
use glam::DVec2;
use std::path::PathBuf;

/// Classes that are understood.
const CLASSES: [&str; 5] = ["constant", "scale", "mix", "checkerboard", "imagemap"];

/// Most textures in one: each use is a copy.
const MOST: usize = 100;

/// The value that stands in for classes that are not known.
const GREY: f64 = 0.5;

/// A value that may vary over a surface.
#[derive(Clone)]
pub(super) enum Texture {
    Constant(Spectrum),
    /// An image and the factor on its values. Mitsuba has no such factor.
    Image {
        /// The texture without its file.
        node: Node,
        /// The file, relative to the result.
        file: String,
        /// Where the file is.
        source: PathBuf,
        /// Whether its values are linear.
        linear: bool,
        factor: Spectrum,
    },
    Checker {
        sides: Box<[Texture; 2]>,
        to_uv: Node,
    },
}

impl Texture {
    /// The same value everywhere.
    pub fn grey(value: f64) -> Self {
        Self::Constant(Spectrum::grey(value))
    }

    /// The value where it is the same everywhere.
    pub fn constant(&self) -> Option<Spectrum> {
        match self {
            Self::Constant(value) => Some(*value),
            _ => None,
        }
    }

    /// The texture with each value multiplied.
    fn times(self, factor: Spectrum) -> Self {
        match self {
            Self::Constant(value) => Self::Constant(value * factor),
            Self::Image { node, file, source, linear, factor: before } => {
                Self::Image { node, file, source, linear, factor: before * factor }
            }
            Self::Checker { sides, to_uv } => {
                let [a, b] = *sides;
                Self::Checker { sides: Box::new([a.times(factor), b.times(factor)]), to_uv }
            }
        }
    }

    /// How many textures there are in it.
    fn count(&self) -> usize {
        match self {
            Self::Checker { sides, .. } => sides[0].count() + sides[1].count(),
            _ => 1,
        }
    }

    /// The factor of an image, where it has one.
    pub fn image_factor(&self) -> Option<Spectrum> {
        match self {
            Self::Constant(_) => None,
            Self::Image { factor, .. } => Some(*factor).filter(|factor| *factor != Spectrum::ONE),
            Self::Checker { sides, .. } => sides.iter().find_map(Self::image_factor),
        }
    }

    /// The parameter `name` of a plugin.
    pub fn node(&self, name: &str) -> Node {
        match self {
            Self::Constant(value) => rgb(name, *value),
            Self::Image { node, file, .. } => node.clone().string("filename", file).named(name),
            Self::Checker { sides, to_uv } => {
                let node = Node::new("texture", "checkerboard").named(name);
                node.child(sides[0].node("color0")).child(sides[1].node("color1")).child(to_uv.clone())
            }
        }
    }

    /// The parameter `name` of a plugin that wants one number.
    pub fn float_node(&self, name: &str) -> Node {
        match self {
            Self::Constant(value) => Node::element("float").named(name).with("value", grey(*value).to_string()),
            other => other.node(name),
        }
    }
}

/// The luminance; exact for greys, because its weights might not quite add up to one.
pub(super) fn grey(colour: Spectrum) -> f64 {
    let [r, g, b] = colour.to_rgb();
    if r == g && g == b { r } else { colour.luminance() }
}

impl Importer<'_> {
    /// `Texture "name" "type" "class" parameters`.
    pub(super) fn define_texture(&mut self, name: String, class: &str, mut params: Params) -> Result<(), LoadError> {
        let texture = match class {
            "constant" => self.texture(&mut params, "value", 1.0)?,
            "scale" => self.scale_texture(&mut params)?,
            "mix" => self.mix_texture(&mut params)?,
            "checkerboard" => self.checkerboard(&mut params)?,
            "imagemap" => self.image_map(&mut params)?,
            _ => {
                self.unknown(&params.spot, "the texture", class, &CLASSES, "a grey of 0.5")?;
                params.list.clear();
                Texture::grey(GREY)
            }
        };
        self.finish(params);
        self.textures.insert(name, texture);
        Ok(())
    }

    /// The parameter `name`: a texture, a colour or a number.
    pub(super) fn texture(&mut self, params: &mut Params, name: &str, default: f64) -> Result<Texture, LoadError> {
        Ok(self.maybe_texture(params, name)?.unwrap_or(Texture::grey(default)))
    }

    /// The parameter `name`: a texture, a colour or a number; `None` where it is not given.
    pub(super) fn maybe_texture(&mut self, params: &mut Params, name: &str) -> Result<Option<Texture>, LoadError> {
        let kinds = [&COLOURS[..], &["texture", "float"]].concat();
        let Some(param) = params.take(name, &kinds)? else {
            return Ok(None);
        };
        if param.kind == "texture" {
            return self.named_texture(&param).map(Some);
        }
        colour::read(&param, Role::Share, &self.folder).map(|colour| Some(Texture::Constant(colour)))
    }

    fn named_texture(&mut self, param: &Param) -> Result<Texture, LoadError> {
        let name = param.string()?;
        match self.textures.get(name) {
            Some(texture) => Ok(texture.clone()),
            None if self.options.approximate => {
                self.report.approximated(&param.spot, format!("the texture `{name}` is not defined: a grey of 0.5"));
                Ok(Texture::grey(GREY))
            }
            None => Err(param.error_at(0, "the name of a texture that is defined before this place")),
        }
    }

    /// Product of two textures (version 3: `tex1`, `tex2`; version 4: `tex`, `scale`).
    fn scale_texture(&mut self, params: &mut Params) -> Result<Texture, LoadError> {
        let [a, b] = if params.has("tex1") || params.has("tex2") { ["tex1", "tex2"] } else { ["tex", "scale"] };
        let (a, b) = (self.texture(params, a, 1.0)?, self.texture(params, b, 1.0)?);
        Ok(match (a.constant(), b.constant()) {
            (_, Some(factor)) => a.times(factor),
            (Some(factor), None) => b.times(factor),
            (None, None) => {
                let message = "a texture that scales another: only the other";
                self.report.approximated(&params.spot, message);
                a
            }
        })
    }

    fn mix_texture(&mut self, params: &mut Params) -> Result<Texture, LoadError> {
        let (a, b) = (self.texture(params, "tex1", 0.0)?, self.texture(params, "tex2", 1.0)?);
        let amount = self.texture(params, "amount", 0.5)?;
        if let (Some(a), Some(b), Some(t)) = (a.constant(), b.constant(), amount.constant()) {
            return Ok(Texture::Constant(a * t.map(|t| 1.0 - t) + b * t));
        }
        if let (Some(black), Some(white)) = (a.constant(), b.constant())
            && black.is_black()
        {
            return Ok(amount.times(white));
        }
        let second = amount.constant().is_some_and(|t| t.luminance() > 0.5);
        let (kept, texture) = if second { ("second", b) } else { ("first", a) };
        self.report.approximated(&params.spot, format!("a mix of textures: only the {kept}"));
        Ok(texture)
    }

    fn checkerboard(&mut self, params: &mut Params) -> Result<Texture, LoadError> {
        if params.integer("dimension")?.is_some_and(|dimension| dimension != 2) {
            self.report.approximated(&params.spot, "a checkerboard in space: one in texture coordinates");
        }
        params.ignore(&["aamode"]);
        let sides = [self.texture(params, "tex1", 1.0)?, self.texture(params, "tex2", 0.0)?];
        if sides.iter().map(Texture::count).sum::<usize>() > MOST {
            let message =
                format!("found a checkerboard of more than {MOST} textures; expected fewer inside each other");
            return Err(params.spot.error(message));
        }
        let sides = Box::new(sides);
        // Mitsuba's pattern has two fields per unit.
        let to_uv = self.mapping(params, 0.5)?.unwrap_or_else(|| uv_node(DVec2::splat(0.5), DVec2::ZERO));
        Ok(Texture::Checker { sides, to_uv })
    }

    fn image_map(&mut self, params: &mut Params) -> Result<Texture, LoadError> {
        let Some(file) = params.take("filename", &["string"])? else {
            return Err(params.spot.error("an imagemap lacks the parameter `filename`"));
        };
        let source = self.find(&file)?;
        let file = self.resource(&file)?;
        let mut node = Node::new("texture", "bitmap");
        let wrap = params.string("wrap")?.unwrap_or("repeat".to_owned());
        match wrap.as_str() {
            "repeat" => (),
            "clamp" => node = node.string("wrap_mode", "clamp"),
            _ => {
                node = node.string("wrap_mode", "clamp");
                let message = format!("an image that is `{wrap}` beyond its edge: its edge is repeated");
                self.report.approximated(&params.spot, message);
            }
        }
        if params.string("filter")?.is_some_and(|filter| filter == "point") {
            node = node.string("filter_type", "nearest");
        }
        params.ignore(&["maxanisotropy", "trilinear"]);
        let linear = self.is_linear(params)?;
        if linear {
            node = node.boolean("raw", true);
        }
        if params.boolean("invert")? == Some(true) {
            self.report.left_out(&params.spot, "`invert` of an image");
        }
        let factor = params.float("scale")?.unwrap_or(1.0);
        node = node.maybe(self.mapping(params, 1.0)?);
        Ok(Texture::Image { node, file, source, linear, factor: Spectrum::grey(factor) })
    }

    /// Whether the image's bytes are the values themselves.
    fn is_linear(&mut self, params: &mut Params) -> Result<bool, LoadError> {
        let gamma = params.boolean("gamma")?;
        let encoding = params.string("encoding")?.unwrap_or("sRGB".to_owned());
        match encoding.as_str() {
            "linear" => return Ok(true),
            "sRGB" => (),
            _ => self.report.approximated(&params.spot, format!("the encoding `{encoding}` of an image: sRGB")),
        }
        Ok(gamma == Some(false))
    }

    /// What takes texture coordinates to the place in the image, which has its first row at v = 0 in Mitsuba and at
    /// v = 1 in pbrt: all shapes of the result have 1 − v instead of pbrt's v.
    fn mapping(&mut self, params: &mut Params, period: f64) -> Result<Option<Node>, LoadError> {
        if let Some(mapping) = params.string("mapping")?.filter(|mapping| mapping != "uv") {
            self.report.approximated(&params.spot, format!("the mapping `{mapping}`: texture coordinates"));
            params.ignore(&["v1", "v2"]);
        }
        let mut number = |name, default| Ok::<_, LoadError>(params.float(name)?.unwrap_or(default));
        let scale = DVec2::new(number("uscale", 1.0)?, number("vscale", 1.0)?);
        let shift = DVec2::new(number("udelta", 0.0)?, number("vdelta", 0.0)?);
        let shift = DVec2::new(shift.x, 1.0 - scale.y - shift.y);
        if scale == DVec2::ONE && shift == DVec2::ZERO {
            return Ok(None);
        }
        Ok(Some(uv_node(scale * period, shift * period)))
    }
}

fn uv_node(scale: DVec2, shift: DVec2) -> Node {
    let steps = Node::element("transform").named("to_uv");
    let pair = |tag, value: DVec2| Node::element(tag).with("x", value.x.to_string()).with("y", value.y.to_string());
    let steps = steps.child(pair("scale", scale));
    if shift == DVec2::ZERO { steps } else { steps.child(pair("translate", shift)) }
}
