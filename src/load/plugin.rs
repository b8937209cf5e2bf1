//! A plugin element, such as `<bsdf type="diffuse">`, and the parameters inside it. Each parameter is taken once by the
//! code that understands it; what is left over in the end is an error, as in Mitsuba.

use super::attributes::Skin;
use super::document::Element;
use super::error::{LoadError, one_of};
use super::legacy;
use super::spectral::{self, Meaning};
use super::transform;
use super::value::Text;
use crate::spectrum::Spectrum;
use glam::{DAffine3, DVec3};
use std::borrow::Cow;
use std::collections::HashSet;

/// Attributes of a plugin element; a file's outermost one has a version too.
const ATTRIBUTES: [&str; 4] = ["type", "id", "name", "version"];

/// A plugin element.
pub(super) struct Plugin<'a> {
    pub element: Element<'a>,
    /// The `type` attribute.
    pub kind: &'a str,
    /// The shape that its textures lie on, where one of them shows an attribute.
    pub skin: Option<&'a Skin>,
    children: Vec<Child<'a>>,
    /// What was asked for, to say what was expected.
    asked: Vec<String>,
}

/// A parameter or a nested plugin.
struct Child<'a> {
    element: Element<'a>,
    /// Its name as Mitsuba 3 spells it.
    name: Option<Cow<'a, str>>,
}

impl Child<'_> {
    fn is_named(&self, name: &str) -> bool {
        self.name.as_deref() == Some(name)
    }
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
        let is_file = element.node.parent_element().is_none();
        element.only(&ATTRIBUTES[..if is_file { 4 } else { 3 }])?;
        let kind = element.required("type")?.text;
        let mut names = HashSet::new();
        let mut children = Vec::new();
        for child in element.children() {
            let given = child.attribute("name");
            let name = given.map(|given| legacy::name(child, kind, given.text));
            if let (Some(given), Some(name)) = (given, &name)
                && !names.insert(name.clone())
            {
                return Err(given.error(format!("the parameter `{}` is given twice", given.text)));
            }
            children.push(Child { element: child, name });
        }
        Ok(Self { element, kind, skin: None, children, asked: Vec::new() })
    }

    /// The element as a part of the shape `skin`.
    pub fn on(self, skin: Option<&'a Skin>) -> Self {
        Self { skin, ..self }
    }

    /// An error that this kind of plugin is unknown.
    pub fn unknown(&self, expected: &[&str]) -> LoadError {
        let message = format!("unknown {} `{}`; expected {}", self.element.tag(), self.kind, one_of(expected));
        self.element.error(message)
    }

    /// Says what stands for a plugin of an unknown kind: `by`; an error where the user has not asked for that.
    pub fn stand_in(&self, known: &[&str], by: &str) -> Result<(), LoadError> {
        if !self.element.document.approximate {
            return Err(self.unknown(known));
        }
        self.element.warn(format!("the {} `{}` is not known: {by}", self.element.tag(), self.kind));
        Ok(())
    }

    /// An error that the parameter `name` is missing.
    pub fn lacks(&self, name: &str) -> LoadError {
        self.element.error(format!("{} `{}` lacks the parameter `{name}`", self.element.tag(), self.kind))
    }

    /// Whether the parameter `name` is there.
    pub fn is_given(&self, name: &str) -> bool {
        self.children.iter().any(|child| child.is_named(name))
    }

    /// Whether the parameter `name` is there and is one of `tags`; a reference is `ref` or what it refers to.
    pub fn has(&self, name: &str, tags: &[&str]) -> bool {
        let mut named = self.children.iter().filter(|child| child.is_named(name));
        named.any(|Child { element, .. }| {
            tags.contains(&element.tag()) || follow(*element).is_ok_and(|target| tags.contains(&target.tag()))
        })
    }

    /// Takes the parameter `name`, which must be one of `tags`; references are followed, unless `tags` has `ref`.
    pub(super) fn take(&mut self, name: &str, tags: &[&str]) -> Result<Option<Element<'a>>, LoadError> {
        self.asked.push(name.to_owned());
        let Some(index) = self.children.iter().position(|child| child.is_named(name)) else {
            return Ok(None);
        };
        let element = self.children.remove(index).element;
        let found = if tags.contains(&"ref") { element } else { follow(element)? };
        if tags.contains(&found.tag()) {
            return Ok(Some(found));
        }
        let expected: Vec<_> = tags.iter().map(|tag| format!("<{tag}>")).collect();
        let given = element.attribute("name").map_or(name, |given| given.text);
        Err(element.error(format!("`{given}` is a <{}>; expected {}", found.tag(), one_of(&expected))))
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
        let value = read(element.required("value")?)?;
        Ok(Some(Parameter { value, name: element.attribute("name").map_or(name, |given| given.text), element }))
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
        self.boolean_or(name, false)
    }

    /// A truth value, `default` where it is not given.
    pub fn boolean_or(&mut self, name: &'static str, default: bool) -> Result<bool, LoadError> {
        Ok(self.scalar(name, &["boolean"], |text| text.boolean())?.map_or(default, |flag| flag.value))
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

    /// A colour where a spectrum that is constant stands for grey: refractive indices.
    pub fn colour(&mut self, name: &'static str) -> Result<Option<Parameter<'a, Spectrum>>, LoadError> {
        self.spectrum(name, Meaning::Index)
    }

    /// A share of light: a colour with channels from 0 to 1, `default` where it is not given.
    pub fn share(&mut self, name: &'static str, default: f64) -> Result<Spectrum, LoadError> {
        let in_range = |colour: &Spectrum| colour.to_rgb().iter().all(|channel| (0.0..=1.0).contains(channel));
        let colour = self.spectrum(name, Meaning::Share)?;
        let colour = colour.map(|colour| colour.check(in_range, "values from 0 to 1")).transpose()?;
        Ok(colour.unwrap_or(Spectrum::grey(default)))
    }

    /// Emitted light, 1 where it is not given. A `<spectrum>` that is constant has the colour of equal energy at all
    /// wavelengths, as in Mitsuba's RGB modes; a `<float>` is grey, and so was a spectrum in Mitsuba 0.6.
    pub fn light(&mut self, name: &'static str) -> Result<Spectrum, LoadError> {
        let valid = |colour: &Spectrum| colour.is_valid();
        let light = self.spectrum(name, Meaning::Light)?;
        Ok(light.map(|light| light.check(valid, "values of at least 0")).transpose()?.unwrap_or(Spectrum::ONE))
    }

    fn spectrum(&mut self, name: &'static str, meaning: Meaning) -> Result<Option<Parameter<'a, Spectrum>>, LoadError> {
        let legacy_tags = ["rgb", "spectrum", "float", "integer", "srgb", "blackbody"];
        let Some(element) = self.take(name, &legacy_tags[..if self.element.is_legacy() { 6 } else { 3 }])? else {
            return Ok(None);
        };
        let value = spectral::read(element, meaning)?;
        Ok(Some(Parameter { value, name: element.attribute("name").map_or(name, |given| given.text), element }))
    }

    /// Takes all nested elements `tag`; references to such elements are followed.
    pub fn objects(&mut self, tag: &str) -> Result<Vec<Element<'a>>, LoadError> {
        self.asked.push(format!("<{tag}>"));
        let mut found = Vec::new();
        let mut rest = Vec::new();
        for child in self.children.drain(..) {
            match follow(child.element)? {
                target if target.tag() == tag => found.push(target),
                _ => rest.push(child),
            }
        }
        self.children = rest;
        Ok(found)
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
        self.children.retain(|child| !names.iter().any(|name| child.is_named(name)));
    }

    /// Drops everything: what nobody asked for does not matter here.
    pub fn ignore_rest(&mut self) {
        self.children.clear();
    }

    /// Refuses what nobody asked for.
    pub fn finish(mut self) -> Result<(), LoadError> {
        if self.element.is_legacy() {
            // Mitsuba 0.6 warned of parameters that it did not know.
            const SCALARS: [&str; 4] = ["boolean", "integer", "float", "string"];
            let (odd, rest) = self.children.into_iter().partition(|child| SCALARS.contains(&child.element.tag()));
            let odd: Vec<Child<'_>> = odd;
            for child in odd {
                child.element.warn(format!("{} `{}` has no such parameter", self.element.tag(), self.kind));
            }
            self.children = rest;
        }
        if self.element.document.approximate {
            for Child { element: child, .. } in self.children {
                let name = child.attribute("name").map_or(child.tag(), |name| name.text);
                child.warn(format!("{} `{}` has no parameter `{name}` here: left out", self.element.tag(), self.kind));
            }
            return Ok(());
        }
        let Some(Child { element: child, .. }) = self.children.first() else {
            return Ok(());
        };
        let target = follow(*child)?;
        if child.tag() == "ref" {
            let message = format!("this refers to a <{}>; expected {}", target.tag(), one_of(&self.asked));
            return Err(child.error(message));
        }
        let found = match child.attribute("name") {
            Some(name) => format!("parameter `{}`", name.text),
            None => format!("<{}>", child.tag()),
        };
        let (tag, kind, expected) = (self.element.tag(), self.kind, one_of(&self.asked));
        Err(child.error(format!("unreferenced {found} in {tag} `{kind}`; expected {expected}")))
    }
}

/// The element that a reference means; any other element itself.
fn follow(element: Element<'_>) -> Result<Element<'_>, LoadError> {
    if element.tag() == "ref" { element.document.find(element) } else { Ok(element) }
}
