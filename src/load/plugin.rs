//! A plugin element, such as `<bsdf type="diffuse">`, and the parameters inside it. Each parameter is taken once by the
//! code that understands it; what is left over in the end is an error, as in Mitsuba.

use super::document::Element;
use super::error::{LoadError, one_of};
use super::transform;
use super::value::Text;
use crate::spectrum::Spectrum;
use glam::{DAffine3, DVec3};
use std::collections::HashSet;

/// Linear Rec.709 of a spectrum that is one at all wavelengths: XYZ = (1, 1, 1).
const EQUAL_ENERGY: Spectrum = Spectrum::rgb(1.204_794, 0.948_291, 0.908_916);

/// A plugin element.
pub(super) struct Plugin<'a> {
    pub element: Element<'a>,
    /// The `type` attribute.
    pub kind: &'a str,
    children: Vec<Element<'a>>,
    /// What was asked for, to say what was expected.
    asked: Vec<String>,
}

/// A value and where it stands.
pub(super) struct Parameter<'a, T> {
    pub value: T,
    name: &'a str,
    element: Element<'a>,
}

impl<'a, T> Parameter<'a, T> {
    /// The value, where `valid` accepts it.
    pub fn check(self, valid: impl FnOnce(&T) -> bool, expected: &str) -> Result<T, LoadError> {
        if valid(&self.value) { Ok(self.value) } else { Err(self.refuse(expected)) }
    }

    /// An error that says what was found and what was expected.
    pub fn refuse(&self, expected: &str) -> LoadError {
        match self.element.attribute("value") {
            Some(text) => text.error(format!("`{}` is {}; expected {expected}", self.name, text.shown())),
            None => self.element.error(format!("found another `{}`; expected {expected}", self.name)),
        }
    }
}

impl<'a> Plugin<'a> {
    /// Opens a plugin element.
    pub fn new(element: Element<'a>) -> Result<Self, LoadError> {
        element.only(&["type", "id", "name"])?;
        let kind = element.required("type")?.text;
        let children: Vec<_> = element.children().collect();
        let mut names = HashSet::new();
        for name in children.iter().filter_map(|child| child.attribute("name")) {
            if !names.insert(name.text) {
                return Err(name.error(format!("the parameter `{}` is given twice", name.text)));
            }
        }
        Ok(Self { element, kind, children, asked: Vec::new() })
    }

    /// An error that this kind of plugin is unknown.
    pub fn unknown(&self, expected: &[&str]) -> LoadError {
        let message = format!("unknown {} `{}`; expected {}", self.element.tag(), self.kind, one_of(expected));
        self.element.error(message)
    }

    /// An error that the parameter `name` is missing.
    pub fn lacks(&self, name: &str) -> LoadError {
        self.element.error(format!("{} `{}` lacks the parameter `{name}`", self.element.tag(), self.kind))
    }

    /// Takes the parameter `name`, which must be one of `tags`.
    pub(super) fn take(&mut self, name: &str, tags: &[&str]) -> Result<Option<Element<'a>>, LoadError> {
        self.asked.push(name.to_owned());
        let named = |child: &Element<'_>| child.attribute("name").is_some_and(|text| text.text == name);
        let Some(index) = self.children.iter().position(named) else {
            return Ok(None);
        };
        let element = self.children.remove(index);
        if tags.contains(&element.tag()) {
            return Ok(Some(element));
        }
        let expected: Vec<_> = tags.iter().map(|tag| format!("<{tag}>")).collect();
        Err(element.error(format!("`{name}` is a <{}>; expected {}", element.tag(), one_of(&expected))))
    }

    fn scalar<T>(
        &mut self,
        name: &'static str,
        tags: &[&str],
        read: impl FnOnce(Text<'a>) -> Result<T, LoadError>,
    ) -> Result<Option<Parameter<'a, T>>, LoadError> {
        let Some(element) = self.take(name, tags)? else {
            return Ok(None);
        };
        element.only(&["name", "value"])?;
        Ok(Some(Parameter { value: read(element.required("value")?)?, name, element }))
    }

    /// A finite number.
    pub fn float(&mut self, name: &'static str) -> Result<Option<Parameter<'a, f64>>, LoadError> {
        self.scalar(name, &["float", "integer"], |text| text.number())
    }

    /// A finite number, `default` where it is not given.
    pub fn number(&mut self, name: &'static str, default: f64) -> Result<f64, LoadError> {
        Ok(self.float(name)?.map_or(default, |number| number.value))
    }

    /// A finite number above zero.
    pub fn positive(&mut self, name: &'static str) -> Result<Option<f64>, LoadError> {
        let value = self.float(name)?;
        value.map(|value| value.check(|value| *value > 0.0, "a number above 0")).transpose()
    }

    /// A whole number.
    pub fn integer(&mut self, name: &'static str) -> Result<Option<Parameter<'a, i64>>, LoadError> {
        self.scalar(name, &["integer"], |text| text.integer())
    }

    /// A truth value, `false` where it is not given.
    pub fn boolean(&mut self, name: &'static str) -> Result<bool, LoadError> {
        Ok(self.scalar(name, &["boolean"], |text| text.boolean())?.is_some_and(|flag| flag.value))
    }

    /// A text.
    pub fn string(&mut self, name: &'static str) -> Result<Option<Parameter<'a, Text<'a>>>, LoadError> {
        self.scalar(name, &["string"], Ok)
    }

    /// A number, or a text.
    pub fn float_or_string(&mut self, name: &'static str) -> Result<Option<Parameter<'a, Text<'a>>>, LoadError> {
        self.scalar(name, &["float", "integer", "string"], Ok)
    }

    /// A point.
    pub fn point(&mut self, name: &'static str) -> Result<Option<DVec3>, LoadError> {
        let Some(element) = self.take(name, &["point", "vector"])? else {
            return Ok(None);
        };
        element.only(&["name", "value", "x", "y", "z"])?;
        if let Some(value) = element.attribute("value") {
            return value.triple().map(Some);
        }
        let axis = |name| element.required(name)?.number();
        Ok(Some(DVec3::new(axis("x")?, axis("y")?, axis("z")?)))
    }

    /// A transformation that can be undone, with its place; the identity where it is not given.
    pub fn placement(&mut self) -> Result<(DAffine3, Element<'a>), LoadError> {
        self.transformation("to_world")
    }

    /// The transformation `name` that can be undone, with its place; the identity where it is not given.
    pub fn transformation(&mut self, name: &'static str) -> Result<(DAffine3, Element<'a>), LoadError> {
        match self.take(name, &["transform"])? {
            Some(element) => Ok((transform::read(element)?, element)),
            None => Ok((DAffine3::IDENTITY, self.element)),
        }
    }

    /// Whether the parameter `name` is there and is one of `tags`.
    pub fn has(&self, name: &str, tags: &[&str]) -> bool {
        let named = |child: &Element<'_>| child.attribute("name").is_some_and(|text| text.text == name);
        self.children.iter().any(|child| named(child) && tags.contains(&child.tag()))
    }

    /// A colour where a spectrum that is constant stands for grey: reflectances and refractive indices.
    pub fn colour(&mut self, name: &'static str) -> Result<Option<Parameter<'a, Spectrum>>, LoadError> {
        self.spectrum(name, Spectrum::ONE)
    }

    /// A share of light: a colour with channels from 0 to 1, 1 where it is not given.
    pub fn share(&mut self, name: &'static str, default: f64) -> Result<Spectrum, LoadError> {
        let in_range = |colour: &Spectrum| colour.to_rgb().iter().all(|channel| (0.0..=1.0).contains(channel));
        let colour = self.colour(name)?.map(|colour| colour.check(in_range, "values from 0 to 1")).transpose()?;
        Ok(colour.unwrap_or(Spectrum::grey(default)))
    }

    /// Emitted light, 1 where it is not given. A `<spectrum>` that is constant has the colour of equal energy at all
    /// wavelengths, as in Mitsuba's RGB modes; a `<float>` is grey.
    pub fn light(&mut self, name: &'static str) -> Result<Spectrum, LoadError> {
        let valid = |colour: &Spectrum| colour.is_valid();
        let light = self.spectrum(name, EQUAL_ENERGY)?;
        Ok(light.map(|light| light.check(valid, "values of at least 0")).transpose()?.unwrap_or(Spectrum::ONE))
    }

    fn spectrum(&mut self, name: &'static str, white: Spectrum) -> Result<Option<Parameter<'a, Spectrum>>, LoadError> {
        let Some(element) = self.take(name, &["rgb", "spectrum", "float"])? else {
            return Ok(None);
        };
        element.only(&["name", "value"])?;
        let text = element.required("value")?;
        let value = match element.tag() {
            "rgb" => text.colour()?,
            "spectrum" => white * text.constant_spectrum()?,
            _ => Spectrum::grey(text.number()?),
        };
        Ok(Some(Parameter { value, name, element }))
    }

    /// Takes all nested elements `tag`; references are followed.
    pub fn objects(&mut self, tag: &str) -> Result<Vec<Element<'a>>, LoadError> {
        self.asked.push(format!("<{tag}>"));
        let (mine, rest) = self.children.drain(..).partition(|child| [tag, "ref"].contains(&child.tag()));
        self.children = rest;
        let follow = |child: Element<'a>| {
            if child.tag() != "ref" {
                return Ok(child);
            }
            let target = child.document.find(child)?;
            if target.tag() == tag {
                return Ok(target);
            }
            Err(child.error(format!("this refers to a <{}>; expected a <{tag}>", target.tag())))
        };
        Vec::into_iter(mine).map(follow).collect()
    }

    /// Takes the nested element `tag`, if there is one.
    pub fn object(&mut self, tag: &str) -> Result<Option<Element<'a>>, LoadError> {
        let objects = self.objects(tag)?;
        match objects[..] {
            [] => Ok(None),
            [one] => Ok(Some(one)),
            [_, second, ..] => Err(second.error(format!("a second <{tag}> in {} `{}`", self.element.tag(), self.kind))),
        }
    }

    /// Drops parameters that cannot change the image.
    pub fn ignore(&mut self, names: &[&str]) {
        let harmless = |child: &Element<'_>| child.attribute("name").is_some_and(|name| names.contains(&name.text));
        self.children.retain(|child| !harmless(child));
    }

    /// Refuses what nobody asked for.
    pub fn finish(self) -> Result<(), LoadError> {
        let Some(child) = self.children.first() else {
            return Ok(());
        };
        let found = match child.attribute("name") {
            Some(name) => format!("parameter `{}`", name.text),
            None => format!("<{}>", child.tag()),
        };
        let (tag, kind, expected) = (self.element.tag(), self.kind, one_of(&self.asked));
        Err(child.error(format!("unreferenced {found} in {tag} `{kind}`; expected {expected}")))
    }
}
