//! Mitsuba 3 scene files (XML) become a [`Scene`]: the only room that knows file formats.
//!
//! A file that loads here loads in Mitsuba 3 and shows the same picture; what of Mitsuba's format is not supported is
//! an error that names it and says what is expected. Understood are
//!
//! - shapes `rectangle`, `cube`, `sphere`, `disk`, `obj`, `ply`;
//! - bsdfs `diffuse`, `conductor`, `roughconductor`, `dielectric`, `thindielectric`, `roughdielectric`, `plastic`,
//!   `roughplastic`, `phong`, `coating`, `roughcoating`, `principled`, `null`, `mask`, `blendbsdf`, `twosided`, nested or
//!   by reference;
//! - emitters `area`, `constant`, `point`;
//! - sensors `perspective`, `thinlens` with an `hdrfilm` and the filters `box`, `tent`, `gaussian`;
//! - any integrator's `max_depth`; samplers are read over.

mod bsdf;
mod document;
mod error;
mod ior;
mod mesh;
mod obj;
mod plugin;
mod ply;
mod sensor;
mod shape;
mod transform;
mod value;

pub use error::{LoadError, Place};

use crate::bsdf::Bsdf;
use crate::camera::Camera;
use crate::scene::{BsdfId, Builder, FilmSpec, Scene, SceneError, Shine};
use document::{Document, Element, Source};
use plugin::Plugin;
use shape::Form;
use std::collections::{BTreeMap, HashMap};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Longest path, in edges, of a scene that sets no bound (`max_depth` −1 or missing).
pub const UNBOUNDED_DEPTH: usize = 65;

/// Largest `max_depth` that a scene may ask for.
pub const LARGEST_DEPTH: usize = 4096;

const TAGS: [&str; 6] = ["default", "integrator", "sensor", "bsdf", "emitter", "shape"];

/// What the caller changes about a scene.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Values for the file's `<default>` parameters, by name.
    pub overrides: BTreeMap<String, String>,
    /// Width and height of the image in pixels instead of the file's.
    pub size: Option<[usize; 2]>,
}

/// A scene, and what the user should know about it.
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// What is legal but hardly meant, one sentence each.
    pub warnings: Vec<String>,
}

/// Reads the scene file at `path` and the meshes that it names.
///
/// # Errors
/// Whatever the file has that is not understood, with its place; files that cannot be read.
pub fn read(path: &Path, options: &Options) -> Result<Loaded, LoadError> {
    let source = Source::read(path)?;
    if let Some(size) = options.size {
        sensor::check_size(size).map_err(|message| LoadError::whole(path, message))?;
    }
    let tree = source.parse()?;
    let document = Document::new(&source, &tree, &options.overrides)?;
    let mut reader = Reader { size: options.size, ..Reader::default() };
    reader.builder.fingerprint(source.text.as_bytes());
    for text in options.overrides.iter().flat_map(|(name, value)| [name, value]) {
        reader.builder.fingerprint(text.as_bytes());
    }
    let root = Element { document: &document, node: tree.root_element() };
    check_root(root)?;
    for element in root.children() {
        reader.element(element)?;
    }
    reader.finish(root)
}

fn check_root(root: Element<'_>) -> Result<(), LoadError> {
    if root.tag() != "scene" {
        return Err(root.error(format!("found <{}>; expected <scene version=\"3.0.0\">", root.tag())));
    }
    root.only(&["version"])?;
    let version = root.required("version")?;
    match version.text.split('.').next() {
        Some("2" | "3") => Ok(()),
        _ => Err(version.error(format!("scene format {} is not supported; expected 2 or 3", version.shown()))),
    }
}

/// What has been read of a scene so far.
#[derive(Default)]
struct Reader {
    builder: Builder,
    size: Option<[usize; 2]>,
    sensor: Option<(Camera, FilmSpec)>,
    max_depth: Option<usize>,
    shapes: usize,
    /// Scattering models in use, by node and by whether they are turned over.
    bsdfs: HashMap<(Option<roxmltree::NodeId>, bool), BsdfId>,
    warnings: Vec<String>,
}

impl Reader {
    /// Reads an element of the scene.
    fn element(&mut self, element: Element<'_>) -> Result<(), LoadError> {
        match element.tag() {
            "integrator" if self.max_depth.is_some() => Err(element.error("a scene can have one integrator only")),
            "integrator" => {
                self.max_depth = Some(max_depth(element)?);
                Ok(())
            }
            "sensor" => {
                let sensor = sensor::read(element, self.size)?;
                if self.sensor.is_some() {
                    self.warnings.push("the scene has several sensors; the first one is used".to_owned());
                }
                self.sensor.get_or_insert(sensor);
                Ok(())
            }
            // Models that no shape refers to are checked, and then left out.
            "bsdf" => bsdf::read(element).map(drop),
            "emitter" => {
                let shine = shine(element)?;
                self.builder.emitter(shine).map_err(|error| element.error(error.to_string()))
            }
            "shape" => self.shape(element),
            other => {
                let expected = error::one_of(&TAGS);
                Err(element.error(format!("unexpected <{other}> in the scene; expected {expected}")))
            }
        }
    }

    fn shape(&mut self, element: Element<'_>) -> Result<(), LoadError> {
        let shape = shape::read(element)?;
        let bsdf = self.bsdf(shape.bsdf, shape.turned)?;
        if let Some(bytes) = &shape.file {
            self.builder.fingerprint(bytes);
        }
        self.shapes += 1;
        let added = match shape.form {
            Form::Mesh(mesh) => self.builder.mesh(mesh, bsdf, shape.radiance),
            Form::Solid(solid) => self.builder.solid(solid, bsdf, shape.radiance),
        };
        added.map_err(|error: SceneError| element.error(error.to_string()))
    }

    /// The model of `element`, added to the scene when it is first used; a grey one where there is none.
    fn bsdf(&mut self, element: Option<Element<'_>>, turned: bool) -> Result<BsdfId, LoadError> {
        let key = (element.map(|element| element.node.id()), turned);
        if let Some(id) = self.bsdfs.get(&key) {
            return Ok(*id);
        }
        let model: Bsdf = match element {
            Some(element) => bsdf::read(element)?.bsdf,
            None => bsdf::default(),
        };
        let id = self.builder.bsdf(if turned { bsdf::turned(model) } else { model });
        self.bsdfs.insert(key, id);
        Ok(id)
    }

    fn finish(mut self, root: Element<'_>) -> Result<Loaded, LoadError> {
        let (camera, film) = self.sensor.ok_or_else(|| root.error("this scene lacks a <sensor>"))?;
        self.builder.fingerprint(format!("{:?}", film.size).as_bytes());
        let max_depth = self.max_depth.unwrap_or(UNBOUNDED_DEPTH);
        let scene = self.builder.build(camera, film, max_depth).map_err(|error| root.error(error.to_string()))?;
        if self.shapes == 0 {
            self.warnings.push("the scene has no shapes".to_owned());
        }
        if !scene.has_lights() {
            self.warnings.push("nothing in the scene shines: the image will be black".to_owned());
        }
        Ok(Loaded { scene, warnings: self.warnings })
    }
}

/// The bound on the length of paths, in edges, that an integrator of any kind sets.
fn max_depth(element: Element<'_>) -> Result<usize, LoadError> {
    let mut plugin = Plugin::new(element)?;
    let depth = plugin.integer("max_depth")?;
    let allowed = |depth: &i64| *depth == -1 || (1..=LARGEST_DEPTH as i64).contains(depth);
    let depth = depth.map(|d| d.check(allowed, &format!("-1 (no bound) or 1 to {LARGEST_DEPTH}"))).transpose()?;
    if plugin.boolean("hide_emitters")? {
        return Err(element.error("`hide_emitters` is not supported; expected false"));
    }
    // These choose between estimators of the same image, or how work is divided.
    plugin.ignore(&["rr_depth", "samples_per_pass", "timeout", "block_size", "emitter_samples", "bsdf_samples"]);
    plugin.finish()?;
    Ok(depth.and_then(|depth| usize::try_from(depth).ok()).unwrap_or(UNBOUNDED_DEPTH))
}

/// Reads an emitter that is not a shape.
fn shine(element: Element<'_>) -> Result<Shine, LoadError> {
    let mut plugin = Plugin::new(element)?;
    plugin.ignore(&["sampling_weight"]);
    let shine = match plugin.kind {
        "constant" => Shine::Environment(plugin.light("radiance")?),
        "point" => {
            let intensity = plugin.light("intensity")?;
            let (to_world, transform) = plugin.placement()?;
            let position = match plugin.point("position")? {
                Some(_) if transform.tag() == "transform" => {
                    return Err(transform.error("a point emitter with both `position` and `to_world`; expected one"));
                }
                Some(position) => position,
                None => to_world.translation,
            };
            Shine::Point(position, intensity)
        }
        "area" => {
            return Err(element.error("an area emitter shines from a shape; expected it inside of a <shape>"));
        }
        _ => return Err(plugin.unknown(&["constant", "point", "area (in a shape)"])),
    };
    plugin.finish()?;
    Ok(shine)
}

/// Runs a parser that was written by others: should it panic, that is an error of the file.
fn guard<R>(parse: impl FnOnce() -> R) -> Result<R, String> {
    catch_unwind(AssertUnwindSafe(parse)).map_err(|_| "it confuses the parser".to_owned())
}
