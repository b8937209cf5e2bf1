//! Directives, one after the other.

use super::params::Params;
use super::source::{Source, Spot};
use super::state::State;
use super::token::{Token, Tokens};
use super::{Group, Importer, Opened};
use crate::load::LoadError;
use glam::DAffine3;
use std::path::Path;

/// Most files that include each other.
const DEEPEST: usize = 64;

/// Directives that are understood, those of transformations among them.
const DIRECTIVES: [&str; 42] = [
    "Accelerator",
    "ActiveTransform",
    "AreaLightSource",
    "Attribute",
    "AttributeBegin",
    "AttributeEnd",
    "Camera",
    "ColorSpace",
    "ConcatTransform",
    "CoordSysTransform",
    "CoordinateSystem",
    "Film",
    "Identity",
    "Import",
    "Include",
    "Integrator",
    "LightSource",
    "LookAt",
    "MakeNamedMaterial",
    "MakeNamedMedium",
    "Material",
    "MediumInterface",
    "NamedMaterial",
    "ObjectBegin",
    "ObjectEnd",
    "ObjectInstance",
    "Option",
    "PixelFilter",
    "Renderer",
    "ReverseOrientation",
    "Rotate",
    "Sampler",
    "Scale",
    "Shape",
    "SurfaceIntegrator",
    "Texture",
    "Transform",
    "TransformBegin",
    "TransformEnd",
    "TransformTimes",
    "Translate",
    "WorldBegin",
];

impl Importer<'_> {
    /// Reads the file that is the scene.
    pub(super) fn scene_file(&mut self, path: &Path) -> Result<(), LoadError> {
        let source = Source::read(path).map_err(|message| LoadError::whole(path, message))?;
        self.file(path, &source)?;
        let end = Spot { offset: source.text.len(), source };
        match self.stack.last() {
            None => Ok(()),
            Some(_) => Err(end.error("found the end of the file; expected the end of a block that is still open")),
        }
    }

    fn file(&mut self, path: &Path, source: &std::rc::Rc<Source>) -> Result<(), LoadError> {
        self.open.push(std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned()));
        let mut tokens = Tokens::new(source, 0);
        loop {
            let offset = tokens.position();
            let spot = tokens.spot(offset);
            match tokens.next()? {
                None => break,
                Some(Token::Word(directive)) => self.directive(directive, &spot, &mut tokens)?,
                Some(token) => return Err(spot.expected(&token.shown(), "a directive, such as Shape")),
            }
        }
        self.open.pop();
        Ok(())
    }

    fn include(&mut self, spot: &Spot, tokens: &mut Tokens<'_>) -> Result<(), LoadError> {
        let name = tokens.string("the name of a file")?;
        let path = self.folder.join(&name);
        let real = std::fs::canonicalize(&path).unwrap_or_else(|_| path.clone());
        if self.open.contains(&real) {
            return Err(spot.error(format!("found a file that includes itself: {name}; expected another file")));
        }
        if self.open.len() >= DEEPEST {
            return Err(spot.error(format!("found more than {DEEPEST} files inside each other; expected fewer")));
        }
        let source = Source::read(&path).map_err(|message| spot.error(message))?;
        self.file(&path, &source)
    }

    fn directive(&mut self, directive: &str, spot: &Spot, tokens: &mut Tokens<'_>) -> Result<(), LoadError> {
        if self.transformation(directive, spot, tokens)? || self.block(directive, spot, tokens)? {
            return Ok(());
        }
        match directive {
            "Include" | "Import" => self.include(spot, tokens),
            "WorldBegin" => self.begin_world(spot),
            "WorldEnd" => Ok(()),
            "Option" => self.option(spot, tokens),
            "ReverseOrientation" => {
                self.state.reversed = !self.state.reversed;
                Ok(())
            }
            "ActiveTransform" => self.active_transform(spot, tokens),
            "TransformTimes" => {
                tokens.numbers::<2>()?;
                Ok(())
            }
            "ColorSpace" => {
                let name = tokens.string("the name of a colour space")?;
                if name != "srgb" {
                    self.report.approximated(spot, format!("the colour space `{name}`: srgb"));
                }
                Ok(())
            }
            "MediumInterface" => self.medium_interface(spot, tokens),
            "NamedMaterial" => {
                let name = tokens.string("the name of a material")?;
                self.use_material(&name, spot)
            }
            _ => self.typed(directive, spot, tokens),
        }
    }

    /// Directives with a type, or name, and parameters.
    fn typed(&mut self, directive: &str, spot: &Spot, tokens: &mut Tokens<'_>) -> Result<(), LoadError> {
        if !DIRECTIVES.contains(&directive) {
            self.unknown(spot, "the directive", directive, &DIRECTIVES, "nothing")?;
            return skip(tokens);
        }
        if directive == "Texture" {
            let name = tokens.string("the name of a texture")?;
            tokens.string("the type of a texture: spectrum or float")?;
            let class = tokens.string("the class of a texture")?;
            let params = self.params(tokens, "texture", &class, spot)?;
            return self.define_texture(name, &class, params);
        }
        let kind = tokens.string("a type")?;
        let target = match directive {
            "Shape" => "shape",
            "Material" | "MakeNamedMaterial" => "material",
            "LightSource" | "AreaLightSource" => "light",
            other => other,
        };
        let params = self.params(tokens, target, &kind, spot)?;
        match directive {
            "Shape" => self.shape(&kind, params),
            "Material" => self.material(&kind, params),
            "MakeNamedMaterial" => self.named_material(kind, params),
            "LightSource" => self.light(&kind, params),
            "AreaLightSource" => self.area_light(&kind, params),
            "Attribute" => self.attribute(kind, params),
            "MakeNamedMedium" => {
                self.report.left_out(spot, format!("the medium `{kind}`"));
                Ok(())
            }
            "Accelerator" | "Renderer" => Ok(()),
            _ => self.render_directive(directive, &kind, params),
        }
    }

    /// The parameters that follow, and those that hold for all directives of the kind.
    fn params(&self, tokens: &mut Tokens<'_>, target: &str, kind: &str, spot: &Spot) -> Result<Params, LoadError> {
        let what = format!("{} `{kind}`", target.to_lowercase());
        let mut params = Params::read(tokens, what, spot.clone())?;
        params.default_to(&self.state.defaults_of(target));
        Ok(params)
    }

    fn attribute(&mut self, target: String, params: Params) -> Result<(), LoadError> {
        const TARGETS: [&str; 5] = ["shape", "light", "material", "medium", "texture"];
        if !TARGETS.contains(&target.as_str()) {
            return self.unknown(&params.spot, "the target", &target, &TARGETS, "nothing");
        }
        self.state.defaults.push((target, params.list));
        Ok(())
    }

    fn begin_world(&mut self, spot: &Spot) -> Result<(), LoadError> {
        if self.world {
            return Err(spot.error("found a second WorldBegin; expected one"));
        }
        self.world = true;
        self.state.transform = DAffine3::IDENTITY;
        self.spaces.insert("world".to_owned(), DAffine3::IDENTITY);
        Ok(())
    }

    /// Options choose how pbrt computes; those that change the image are for debugging.
    fn option(&mut self, spot: &Spot, tokens: &mut Tokens<'_>) -> Result<(), LoadError> {
        const HARMLESS: [&str; 6] = [
            "rendercoordsys",
            "seed",
            "msereferenceimage",
            "msereferenceout",
            "disablepixeljitter",
            "disabletexturefiltering",
        ];
        let mut params = Params::read(tokens, "Option".to_owned(), spot.clone())?;
        params.ignore(&HARMLESS);
        self.finish(params);
        Ok(())
    }

    fn active_transform(&mut self, spot: &Spot, tokens: &mut Tokens<'_>) -> Result<(), LoadError> {
        let at = tokens.position();
        match tokens.next()? {
            Some(Token::Word("StartTime" | "All")) => self.state.at_end_only = false,
            Some(Token::Word("EndTime")) => {
                self.report.left_out(spot, "motion: things stay where they are at the start");
                self.state.at_end_only = true;
            }
            other => {
                let found = other.map_or("the end of the file".to_owned(), |token| token.shown());
                return Err(tokens.spot(at).expected(&found, "one of StartTime, EndTime, All"));
            }
        }
        Ok(())
    }

    fn medium_interface(&mut self, spot: &Spot, tokens: &mut Tokens<'_>) -> Result<(), LoadError> {
        let mut names = vec![tokens.string("the name of a medium")?];
        if let Some(Token::Quoted(outside)) = tokens.peek()? {
            tokens.next()?;
            names.push(outside);
        }
        if names.iter().any(|name| !name.is_empty()) {
            self.report.left_out(spot, format!("the media `{}`", names.join("`, `")));
        }
        Ok(())
    }

    /// Directives that open or close a block, or place one; whether it is one.
    fn block(&mut self, directive: &str, spot: &Spot, tokens: &mut Tokens<'_>) -> Result<bool, LoadError> {
        match directive {
            "AttributeBegin" => self.stack.push((Opened::Attributes, self.state.clone())),
            "TransformBegin" => self.stack.push((Opened::Transform, self.state.clone())),
            "AttributeEnd" => self.close(Opened::Attributes, directive, spot)?,
            "TransformEnd" => {
                let now = self.state.clone();
                self.close(Opened::Transform, directive, spot)?;
                let transform = self.state.transform;
                self.state = State { transform, ..now };
            }
            "ObjectBegin" => {
                let name = tokens.string("the name of an object")?;
                if self.group.is_some() {
                    return Err(spot.error("found an object inside of another; expected ObjectEnd before it"));
                }
                self.stack.push((Opened::Object, self.state.clone()));
                let id = format!("object_{:04}", self.groups.len() + 1);
                self.groups.insert(name.clone(), Group { id, shapes: Vec::new() });
                self.group = Some(name);
            }
            "ObjectEnd" => {
                self.close(Opened::Object, directive, spot)?;
                self.group = None;
            }
            "ObjectInstance" => {
                let name = tokens.string("the name of an object")?;
                self.instance(&name, spot)?;
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn close(&mut self, opened: Opened, directive: &str, spot: &Spot) -> Result<(), LoadError> {
        match self.stack.pop() {
            Some((found, state)) if found == opened => {
                self.state = state;
                Ok(())
            }
            Some(_) => Err(spot.error(format!("found {directive} inside of another block; expected that block's end"))),
            None => Err(spot.error(format!("found {directive} without its beginning; expected a block to end"))),
        }
    }
}

/// Reads over what follows an unknown directive, up to the next word that starts like a directive.
fn skip(tokens: &mut Tokens<'_>) -> Result<(), LoadError> {
    loop {
        match tokens.peek()? {
            None => return Ok(()),
            Some(Token::Word(word)) if word.starts_with(|c: char| c.is_ascii_uppercase()) => return Ok(()),
            Some(_) => tokens.next()?,
        };
    }
}
