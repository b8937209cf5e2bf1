//! pbrt scenes (version 4, and version 3 where it differs by names) become Mitsuba 3 XML with the mesh files that it
//! needs. What cannot be kept is replaced or left out, and reported with the line where it stood.
//!
//! pbrt's space is left-handed: its camera has +x on the right of the image, where Mitsuba's has it on the left. Points
//! keep their coordinates; the camera's x axis is turned over instead.

mod camera;
mod coated;
mod colour;
mod gzip;
mod interpret;
mod light;
mod material;
mod mesh;
mod octahedral;
mod output;
mod params;
mod ply;
mod quadric;
mod render;
mod report;
mod scaled;
mod shape;
mod source;
mod state;
mod texture;
mod token;
mod transform;
mod xml;

pub use report::{Change, Note, Report};

use crate::image::ImageError;
use crate::load::{LoadError, one_of};
use glam::DAffine3;
use material::Material;
use output::Output;
use params::{Param, Params};
use source::Spot;
use state::State;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use texture::Texture;
use xml::Node;

/// How strict a conversion is.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options {
    /// Replace what is unknown by the nearest thing instead of refusing it.
    pub approximate: bool,
}

/// A conversion that failed. No file was written.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The source has a mistake, or something that is not understood.
    #[error(transparent)]
    Source(#[from] LoadError),
    /// The result could not be written.
    #[error(transparent)]
    Output(#[from] ImageError),
    /// The result could not be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
}

/// Converts the pbrt scene at `input` to the Mitsuba 3 scene `output`. Meshes go to `meshes/` beside it.
///
/// # Errors
/// Mistakes in the source with their place; files that cannot be read or written. Nothing is written then.
pub fn import(input: &Path, output: &Path, options: &Options) -> Result<Report, ImportError> {
    let mut importer = Importer::new(input, output, options)?;
    importer.scene_file(input)?;
    importer.write()
}

/// Most names that a message lists.
const MOST_NAMES: usize = 12;

/// A conversion under way.
struct Importer<'o> {
    options: &'o Options,
    report: Report,
    out: Output,
    /// Where the files are looked for that a scene names.
    folder: PathBuf,
    /// The files that are being read, each included by the one before.
    open: Vec<PathBuf>,
    state: State,
    stack: Vec<(Opened, State)>,
    spaces: HashMap<String, DAffine3>,
    textures: HashMap<String, Texture>,
    /// Images that were multiplied, by file, factor, and whether their values are linear.
    scaled: HashMap<(String, [u64; 3], bool), String>,
    materials: Vec<Material>,
    /// Indices of materials by their names.
    named: HashMap<String, usize>,
    render: render::Render,
    /// Whether the world has begun.
    world: bool,
    lights: Vec<Node>,
    shapes: Vec<Node>,
    groups: HashMap<String, Group>,
    /// The name of the group that is being defined.
    group: Option<String>,
}

/// What a block was opened by.
#[derive(Clone, Copy, PartialEq)]
enum Opened {
    Attributes,
    Transform,
    Object,
}

/// Shapes that are placed several times.
struct Group {
    id: String,
    shapes: Vec<Node>,
}

/// The first names that are defined, for a message.
fn names<V>(defined: &HashMap<String, V>) -> Vec<String> {
    let mut names: Vec<_> = defined.keys().map(|name| token::cut(name)).collect();
    names.sort();
    if names.len() > MOST_NAMES {
        names.truncate(MOST_NAMES);
        names.push("…".to_owned());
    }
    names
}

impl<'o> Importer<'o> {
    fn new(input: &Path, output: &Path, options: &'o Options) -> Result<Self, ImportError> {
        Ok(Self {
            options,
            report: Report::default(),
            out: Output::new(output)?,
            folder: input.parent().unwrap_or(Path::new("")).to_owned(),
            open: Vec::new(),
            state: State::default(),
            stack: Vec::new(),
            spaces: HashMap::from([("world".to_owned(), DAffine3::IDENTITY)]),
            textures: HashMap::new(),
            scaled: HashMap::new(),
            materials: Vec::new(),
            named: HashMap::new(),
            render: render::Render::default(),
            world: false,
            lights: Vec::new(),
            shapes: Vec::new(),
            groups: HashMap::new(),
            group: None,
        })
    }

    /// Reports what nobody asked for.
    fn finish(&mut self, params: Params) {
        for param in params.list {
            self.report.left_out(&param.spot, format!("`{}` of {}", param.name, params.what));
        }
    }

    /// Something unknown: an error, or a note that `instead` takes its place.
    fn unknown<S: AsRef<str>>(
        &mut self,
        spot: &Spot,
        what: &str,
        found: &str,
        known: &[S],
        instead: &str,
    ) -> Result<(), LoadError> {
        let found = format!("{what} `{}`", token::cut(found));
        if self.options.approximate {
            self.report.approximated(spot, format!("{found}: {instead}"));
            return Ok(());
        }
        Err(spot.expected(&found, &format!("{} (--approximate takes {instead} instead)", one_of(known))))
    }

    /// The file that a parameter names, as a path relative to the result.
    fn resource(&mut self, param: &Param) -> Result<String, LoadError> {
        let path = self.find(param)?;
        self.out.relative(&path).map_err(|expected| param.error_at(0, &expected))
    }

    /// The path of the file that a parameter names.
    fn find(&self, param: &Param) -> Result<PathBuf, LoadError> {
        let name = param.string()?;
        // Version 4 looks beside the scene; files that include each other were often written for their own folder.
        let beside = param.spot.source.path.parent().map(|folder| folder.join(name)).filter(|path| path.is_file());
        let path = Some(self.folder.join(name)).filter(|path| path.is_file()).or(beside);
        let path = path.unwrap_or_else(|| self.folder.join(name));
        match std::fs::metadata(&path) {
            Ok(there) if there.is_file() => Ok(path),
            Ok(_) => Err(param.error_at(0, &format!("a file; {} is none", path.display()))),
            Err(error) => Err(param.error_at(0, &format!("a file that exists; {}: {error}", path.display()))),
        }
    }

    /// Writes the scene and the files that it needs.
    fn write(mut self) -> Result<Report, ImportError> {
        let mut root = Node::element("scene").with("version", "3.0.0");
        root = root.child(self.render.integrator_node()).child(self.render.sensor_node());
        for material in self.materials.iter().filter(|material| material.used) {
            root = root.child(material.whole());
            self.report.materials += 1;
        }
        let mut groups: Vec<_> = self.groups.into_values().filter(|group| !group.shapes.is_empty()).collect();
        groups.sort_by(|a, b| a.id.cmp(&b.id));
        for group in groups {
            let node = Node::new("shape", "shapegroup").with("id", group.id);
            root = root.child(group.shapes.into_iter().fold(node, Node::child));
        }
        root = self.lights.into_iter().chain(self.shapes).fold(root, Node::child);
        let mut text = String::new();
        root.write(0, &mut text);
        self.report.files = self.out.publish(&text)?;
        Ok(self.report)
    }
}
