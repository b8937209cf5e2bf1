//! Mitsuba's scene files (XML) become a [`Scene`]: the only room that knows file formats.
//!
//! Files of Mitsuba 2 and 3 show the picture that Mitsuba 3 makes of them. Files of Mitsuba 0.4 to 0.6 are read as they
//! are: as Mitsuba 3 converts them, and what it refuses as Mitsuba 0.6 had it. What is not supported is an error that
//! names it and says what is expected. Understood are
//!
//! - `<include>`, `<path>`, `<default>`, `<alias>`, references;
//! - shapes `rectangle`, `cube`, `sphere`, `disk`, `cylinder`, `obj`, `ply`, `serialized`, `shapegroup`, `instance`;
//! - bsdfs `diffuse`, `conductor`, `roughconductor`, `dielectric`, `thindielectric`, `roughdielectric`, `plastic`,
//!   `roughplastic`, `principled`, `phong`, `coating`, `roughcoating`, `null`, `mask`, `blendbsdf`, `bumpmap`, `normalmap`, `twosided`;
//! - textures `bitmap`, `checkerboard`, `mesh_attribute` of PLY meshes;
//! - emitters `area`, `constant`, `envmap`, `sunsky` (also `sun`, `sky`), `point`, `spot`, `directional`;
//! - colours as `<rgb>`, `<spectrum>` of values, pairs or a file; in old files also `<srgb>` and `<blackbody>`;
//! - sensors `perspective`, `thinlens`, `orthographic` with an `hdrfilm`, its crop, and the filters `box`, `tent`, `gaussian`;
//! - any integrator's `max_depth` and `hide_emitters`; samplers are read over.

mod attributes;
mod bsdf;
mod cie;
mod document;
mod emitter;
mod error;
mod files;
mod ior;
mod legacy;
mod mesh;
mod mesh_file;
mod obj;
mod picture;
mod plugin;
mod ply;
mod references;
mod round;
mod sensor;
mod serialized;
mod shape;
mod source;
mod spectral;
mod texture;
mod transform;
mod value;

pub(crate) use error::one_of;
pub use error::{LoadError, Place};

use crate::camera::Camera;
use crate::scene::{BsdfId, Builder, FilmSpec, Scene, SceneError};
use bsdf::Model;
use document::{Document, Element};
use files::{At, Files};
use plugin::Plugin;
use rayon::prelude::*;
use shape::{Body, Form, Shape};
use source::Source;
use std::collections::{BTreeMap, HashMap};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use texture::Role;

/// Longest path, in edges, of a scene that sets no bound (`max_depth` −1 or missing).
pub const UNBOUNDED_DEPTH: usize = 65;

/// Largest `max_depth` that a scene may ask for.
pub const LARGEST_DEPTH: usize = 4096;

/// Most triangles of a scene: instances of instances would fill any memory.
const MOST_TRIANGLES: usize = 1 << 28;

/// Most shapes whose files are in memory at the same time, before the scene has taken them over.
const AT_ONCE: usize = 32;

const TAGS: [&str; 7] = ["default", "integrator", "sensor", "texture", "bsdf", "emitter", "shape"];

/// Tags of Mitsuba's that change the image and that are not understood.
const UNSUPPORTED: [&str; 4] = ["medium", "volume", "phase", "subsurface"];

/// What the caller changes about a scene.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Values for the file's `<default>` parameters, by name.
    pub overrides: BTreeMap<String, String>,
    /// Width and height of the image in pixels instead of the file's.
    pub size: Option<[usize; 2]>,
    /// Replace what is not known by the nearest thing, or leave it out, with a warning, instead of refusing it.
    pub approximate: bool,
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
    let main = Source::read(path)?;
    if let Some(size) = options.size {
        sensor::check_size(size).map_err(|message| LoadError::whole(path, message))?;
    }
    let files = Files::read(main, &options.overrides)?;
    let trees = files.trees()?;
    let document = Document::new(&files, &trees, options.approximate)?;
    let mut reader = Reader { size: options.size, ..Reader::default() };
    for source in &files.sources {
        reader.builder.fingerprint(source.text.as_bytes());
    }
    for text in options.overrides.iter().flat_map(|(name, value)| [name, value]) {
        reader.builder.fingerprint(text.as_bytes());
    }
    let root = document.root();
    check_root(root)?;
    document.pictures.read_ahead(&document);
    let elements: Vec<_> = root.children().collect();
    for run in elements.chunk_by(|a, b| a.tag() == "shape" && b.tag() == "shape") {
        match run[0].tag() {
            "shape" => reader.shapes(run)?,
            _ => reader.element(run[0])?,
        }
    }
    reader.finish(root)
}

fn check_root(root: Element<'_>) -> Result<(), LoadError> {
    if root.tag() != "scene" {
        return Err(root.error(format!("found <{}>; expected <scene version=\"3.0.0\">", root.tag())));
    }
    root.only(&["version", "type", "id"])?;
    root.required("version").map(drop)
}

/// What has been read of a scene so far.
#[derive(Default)]
struct Reader {
    builder: Builder,
    size: Option<[usize; 2]>,
    sensor: Option<(Camera, FilmSpec)>,
    max_depth: Option<usize>,
    shapes: usize,
    triangles: usize,
    /// Scattering models in use, by node and by whether they are turned over.
    bsdfs: HashMap<(Option<At>, bool, bool), BsdfId>,
    warnings: Vec<String>,
}

impl Reader {
    /// Reads an element of the scene that is no shape.
    fn element(&mut self, element: Element<'_>) -> Result<(), LoadError> {
        match element.tag() {
            "integrator" if self.max_depth.is_some() => Err(element.error("a scene can have one integrator only")),
            "integrator" => {
                let (depth, hide_emitters) = integrator(element)?;
                self.max_depth = Some(depth.unwrap_or(UNBOUNDED_DEPTH));
                self.builder.hide_emitters(hide_emitters);
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
            "bsdf" => bsdf::read(element, None).map(drop),
            "texture" => texture::read(element, None, Role::Colour).map(drop),
            "emitter" => {
                let add = |shine| self.builder.emitter(shine).map_err(|error| element.error(error.to_string()));
                emitter::read(element)?.into_iter().try_for_each(add)
            }
            // A sampler, film or filter out here has an id to be found by.
            "sampler" | "film" | "rfilter" => Ok(()),
            // Other programs keep their settings in files of Mitsuba 0.5 and 0.6.
            other if element.is_legacy() && !UNSUPPORTED.contains(&other) => {
                let message = format!("<{other}> is not an element of a scene and is read over");
                element.warn(message);
                Ok(())
            }
            other if element.document.approximate => {
                element.warn(format!("<{other}> is not known: left out"));
                Ok(())
            }
            other => {
                let expected = error::one_of(&TAGS);
                Err(element.error(format!("unexpected <{other}> in the scene; expected {expected}")))
            }
        }
    }

    /// Reads shapes, whose files are read several at a time. Errors come in the order of the document all the same.
    fn shapes<'a>(&mut self, elements: &[Element<'a>]) -> Result<(), LoadError> {
        let members = |element: &Element<'a>| match shape::members(*element) {
            Ok(members) => members.into_iter().map(Ok).collect(),
            Err(error) => vec![Err(error)],
        };
        let mut members = elements.iter().flat_map(members);
        loop {
            let mut error = None;
            let open = |member: Result<_, _>| member.and_then(|(element, outer)| shape::open(element, &outer));
            let (opened, bodies): (Vec<_>, Vec<_>) = members
                .by_ref()
                .take(AT_ONCE)
                .map_while(|member| open(member).map_err(|found| error = Some(found)).ok())
                .unzip();
            let ended = opened.is_empty();
            let forms: Vec<_> = bodies.into_par_iter().map(Body::read).collect();
            for (opened, form) in opened.into_iter().zip(forms) {
                self.add_shape(opened.finish(form?)?)?;
            }
            match error {
                Some(error) => return Err(error),
                None if ended => return Ok(()),
                None => {}
            }
        }
    }

    /// Adds a shape.
    fn add_shape(&mut self, shape: Shape<'_>) -> Result<(), LoadError> {
        let element = shape.element;
        let bsdf = match (&shape.skin, shape.bsdf) {
            // What shows the attributes of a mesh belongs to it alone.
            (Some(skin), Some(bsdf)) => self.add(bsdf::read(bsdf, Some(skin))?, shape.turned),
            _ => self.bsdf(shape.bsdf, shape.turned, shape.radiance.is_some())?,
        };
        if let Some(hash) = &shape.file {
            self.builder.fingerprint(hash.as_bytes());
        }
        self.shapes += 1;
        if let Form::Mesh(mesh) = &shape.form {
            self.triangles += mesh.triangles.len();
        }
        if self.triangles > MOST_TRIANGLES {
            return Err(element.error(format!("with this shape the scene has more than {MOST_TRIANGLES} triangles")));
        }
        let added = match shape.form {
            Form::Mesh(mesh) => self.builder.mesh(mesh, bsdf, shape.radiance),
            Form::Solid(solid) => self.builder.solid(solid, bsdf, shape.radiance),
        };
        added.map_err(|error: SceneError| element.error(error.to_string()))
    }

    /// The model of `element`, added to the scene when it is first used; a grey one where there is none.
    fn bsdf(&mut self, element: Option<Element<'_>>, turned: bool, shines: bool) -> Result<BsdfId, LoadError> {
        let key = (element.map(Element::key), turned, shines && element.is_none());
        if let Some(id) = self.bsdfs.get(&key) {
            return Ok(*id);
        }
        let model = match element {
            Some(element) => bsdf::read(element, None)?,
            None => Model { bsdf: bsdf::default(shines), relief: None },
        };
        let id = self.add(model, turned);
        self.bsdfs.insert(key, id);
        Ok(id)
    }

    /// Adds a model to the scene.
    fn add(&mut self, Model { bsdf, relief }: Model, turned: bool) -> BsdfId {
        let id = self.builder.bsdf(if turned { bsdf::turned(bsdf) } else { bsdf });
        if let Some(relief) = relief {
            self.builder.relief(id, relief);
        }
        id
    }

    fn finish(mut self, root: Element<'_>) -> Result<Loaded, LoadError> {
        let (camera, film) = self.sensor.ok_or_else(|| root.error("this scene lacks a <sensor>"))?;
        self.builder.fingerprint(format!("{:?}", film.size).as_bytes());
        root.document.fingerprint(&mut self.builder);
        root.document.pictures.fingerprint(&mut self.builder);
        self.warnings.extend(root.document.warnings.take());
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

/// The bound on the length of paths, in edges, that an integrator of any kind sets, or one that it holds; and whether
/// lights themselves are invisible. All else chooses between estimators of the same image, or divides work.
fn integrator(element: Element<'_>) -> Result<(Option<usize>, bool), LoadError> {
    let mut plugin = Plugin::new(element)?;
    let depth = plugin.integer("max_depth")?;
    let allowed = |depth: &i64| *depth == -1 || (1..=LARGEST_DEPTH as i64).contains(depth);
    let depth = depth.map(|d| d.check(allowed, &format!("-1 (no bound) or 1 to {LARGEST_DEPTH}"))).transpose()?;
    let mut depth = depth.map(|depth| usize::try_from(depth).unwrap_or(UNBOUNDED_DEPTH));
    let mut hide_emitters = plugin.boolean("hide_emitters")?;
    for inner in plugin.objects("integrator")? {
        let (inner_depth, hides) = integrator(inner)?;
        depth = depth.or(inner_depth);
        hide_emitters |= hides;
    }
    plugin.ignore_rest();
    Ok((depth, hide_emitters))
}

/// Runs a parser that was written by others: should it panic, that is an error of the file.
fn guard<R>(parse: impl FnOnce() -> R) -> Result<R, String> {
    catch_unwind(AssertUnwindSafe(parse)).map_err(|_| "it confuses the parser".to_owned())
}
