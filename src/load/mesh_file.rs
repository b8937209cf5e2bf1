//! The files of meshes that shapes name.

use super::attributes::Skin;
use super::error::LoadError;
use super::mesh::Facing;
use super::plugin::Plugin;
use super::shape::{Form, Read};
use super::source::read_bounded;
use super::value::Text;
use super::{obj, ply, serialized};
use glam::DAffine3;

/// A mesh file, and all that it takes to read it.
pub(super) struct MeshFile<'a> {
    name: Text<'a>,
    format: Format,
    to_world: DAffine3,
    facing: Facing,
    /// Whether textures show its attributes.
    shows: bool,
}

/// How the file is to be understood.
enum Format {
    Obj {
        flip_v: bool,
    },
    Ply {
        flip_v: bool,
    },
    /// One of the meshes in a file.
    Serialized {
        index: usize,
    },
}

impl<'a> MeshFile<'a> {
    /// The file that a shape names, which stands at `to_world`; `shows` says whether textures show its attributes.
    pub fn of(plugin: &mut Plugin<'a>, to_world: DAffine3, facing: Facing, shows: bool) -> Result<Self, LoadError> {
        let name = plugin.string("filename")?.ok_or_else(|| plugin.lacks("filename"))?.value;
        let format = match plugin.kind {
            "obj" => {
                // Says how Mitsuba 0.6 groups what is one mesh here.
                plugin.ignore(&["collapse"]);
                Format::Obj { flip_v: plugin.boolean_or("flip_tex_coords", true)? }
            }
            "ply" => Format::Ply { flip_v: plugin.boolean("flip_tex_coords")? },
            _ => {
                let index = plugin.integer("shape_index")?;
                let index =
                    index.map(|index| index.check(|index| *index >= 0, "a whole number of at least 0")).transpose()?;
                Format::Serialized { index: index.unwrap_or(0) as usize }
            }
        };
        Ok(Self { name, format, to_world, facing, shows })
    }

    /// The mesh in the world.
    pub fn read(&self) -> Result<Read, LoadError> {
        let name = self.name;
        let path = name.path();
        let bytes = read_bounded(&path, u64::MAX).map_err(|reason| {
            let looked = name.source.looked(name.text);
            name.error(format!("cannot read the mesh {}: {reason}{looked}", path.display()))
        })?;
        let raw = match self.format {
            Format::Obj { flip_v } => obj::read(&bytes, flip_v),
            Format::Ply { flip_v } => ply::read(&bytes, flip_v, self.shows),
            Format::Serialized { index } => serialized::read(&bytes, index),
        };
        let mut raw = raw.map_err(|reason| name.error(format!("the mesh {} is broken: {reason}", path.display())))?;
        let finite = raw.positions.iter().chain(&raw.normals).all(|v| v.is_finite());
        if !finite || !raw.uvs.iter().all(|uv| uv.is_finite()) {
            let message = format!("the mesh {} has a coordinate that is not a finite number", path.display());
            return Err(name.error(message));
        }
        let hash = blake3::hash(&bytes);
        drop(bytes);
        let attributes = std::mem::take(&mut raw.attributes);
        let mesh = raw.place(&self.to_world, self.facing);
        let skin = self.shows.then(|| Skin::of(format!("the mesh {}", name.text), &mesh, attributes));
        Ok(Read { form: Form::Mesh(mesh), skin, file: Some(hash) })
    }
}
