//! `<shape>` elements.

use super::attributes::{Skin, shows};
use super::document::Element;
use super::error::LoadError;
use super::mesh::{self, Facing, RawMesh};
use super::plugin::Plugin;
use super::round;
use super::source::read_bounded;
use super::texture::Role;
use super::{obj, ply, serialized};
use crate::geometry::Solid;
use crate::scene::Mesh;
use crate::texture::Colour;
use glam::{DAffine3, DVec3};

const KINDS: [&str; 10] =
    ["rectangle", "cube", "sphere", "disk", "cylinder", "obj", "ply", "serialized", "shapegroup", "instance"];

/// Largest coordinate: squares of distances stay finite in single precision.
const FAR: f64 = 1e18;

/// A shape of the scene file.
pub(super) struct Shape<'a> {
    pub form: Form,
    /// Its scattering model, if it names one.
    pub bsdf: Option<Element<'a>>,
    /// Whether the model is seen from the other side: see [`round::Round::turned`].
    pub turned: bool,
    /// What it radiates.
    pub radiance: Option<Colour>,
    /// The shape as its textures see it, where one of them shows an attribute.
    pub skin: Option<Skin>,
    /// Bytes of the mesh file that it was read from.
    pub file: Option<Vec<u8>>,
}

/// A shape in world space.
pub(super) enum Form {
    Mesh(Mesh),
    Solid(Solid),
}

/// The shapes that `element` stands for, each with what places it: the shape itself, the shapes that an `instance`
/// repeats, or nothing for a `shapegroup`, which shows only where it is repeated.
pub(super) fn members(element: Element<'_>) -> Result<Vec<(Element<'_>, DAffine3)>, LoadError> {
    let mut plugin = Plugin::new(element)?;
    match plugin.kind {
        "shapegroup" => {
            plugin.objects("shape")?;
            plugin.finish()?;
            Ok(Vec::new())
        }
        "instance" => {
            let (to_world, _) = plugin.placement()?;
            let group = plugin.object("shape")?;
            plugin.finish()?;
            let group = group.filter(|group| group.attribute("type").is_some_and(|kind| kind.text == "shapegroup"));
            let group =
                group.ok_or_else(|| element.error("an instance of nothing; expected a <ref> to a shapegroup"))?;
            let shapes = Plugin::new(group)?.objects("shape")?;
            for shape in &shapes {
                check_member(*shape)?;
            }
            Ok(shapes.into_iter().map(|shape| (shape, to_world)).collect())
        }
        _ => Ok(vec![(element, DAffine3::IDENTITY)]),
    }
}

/// Refuses what a group cannot hold, as Mitsuba does.
fn check_member(shape: Element<'_>) -> Result<(), LoadError> {
    let mut plugin = Plugin::new(shape)?;
    if ["shapegroup", "instance"].contains(&plugin.kind) {
        return Err(shape.error(format!("a shapegroup cannot hold the shape `{}`", plugin.kind)));
    }
    match plugin.object("emitter")? {
        Some(emitter) => Err(emitter.error("a shape in a shapegroup cannot shine")),
        None => Ok(()),
    }
}

/// Reads a shape and the mesh file that it names; `outer` places it once more.
pub(super) fn read<'a>(element: Element<'a>, outer: &DAffine3) -> Result<Shape<'a>, LoadError> {
    let mut plugin = Plugin::new(element)?;
    if !KINDS.contains(&plugin.kind) {
        return Err(plugin.unknown(&KINDS));
    }
    let (inner, transform) = plugin.placement()?;
    let to_world = *outer * inner;
    let flip_normals = plugin.boolean("flip_normals")?;
    let (mut turned, mut file) = (false, None);
    let mut skin = shows(element)?.then(|| Skin::bare(format!("this {}", plugin.kind)));
    let mut form = match plugin.kind {
        "sphere" | "disk" | "cylinder" => {
            let round = round::read(&mut plugin, &to_world, transform, flip_normals)?;
            turned = round.turned;
            Form::Solid(round.solid)
        }
        kind => {
            let face_normals = plugin.boolean("face_normals")?;
            Form::Mesh(match kind {
                "rectangle" => mesh::rectangle().place_solid(&to_world, flip_normals),
                "cube" => mesh::cube().place_solid(&to_world, flip_normals),
                _ => {
                    let mut read = mesh_file(&mut plugin, skin.is_some())?;
                    file = Some(read.bytes);
                    let attributes = std::mem::take(&mut read.raw.attributes);
                    let mesh = read.raw.place(&to_world, Facing { face_normals, flip_normals });
                    skin = skin.map(|_| Skin::of(format!("the mesh {}", read.name), &mesh, attributes));
                    mesh
                }
            })
        }
    };
    if let Form::Mesh(mesh) = &mut form {
        mesh.charted = skin.is_some();
    }
    check_size(&form, element)?;
    let bsdf = plugin.object("bsdf")?;
    let radiance = plugin.object("emitter")?.map(|emitter| area(emitter, skin.as_ref())).transpose()?;
    plugin.finish()?;
    if turned && radiance.is_some() {
        let kind = element.required("type")?.text;
        let message = format!("a {kind} that shines inwards is not supported; its normals must point outwards");
        return Err(element.error(message));
    }
    Ok(Shape { form, bsdf, turned, radiance, skin, file })
}

/// Reads the emitter of a shape.
fn area(element: Element<'_>, skin: Option<&Skin>) -> Result<Colour, LoadError> {
    let mut plugin = Plugin::new(element)?.on(skin);
    if plugin.kind != "area" {
        let message = format!("unexpected emitter `{}` in a shape; expected area", plugin.kind);
        return Err(element.error(message));
    }
    plugin.ignore(&["sampling_weight"]);
    let radiance = match plugin.texture("radiance", Role::Colour)? {
        Some(texture) => Colour::Textured(texture),
        None => Colour::Constant(plugin.light("radiance")?),
    };
    plugin.finish()?;
    Ok(radiance)
}

/// A mesh file.
struct MeshFile<'a> {
    name: &'a str,
    raw: RawMesh,
    bytes: Vec<u8>,
}

fn mesh_file<'a>(plugin: &mut Plugin<'a>, attributes: bool) -> Result<MeshFile<'a>, LoadError> {
    let name = plugin.string("filename")?.ok_or_else(|| plugin.lacks("filename"))?.value;
    let path = name.source.beside(name.text);
    let bytes = read_bounded(&path, u64::MAX).map_err(|reason| {
        let looked = name.source.looked(name.text);
        name.error(format!("cannot read the mesh {}: {reason}{looked}", path.display()))
    })?;
    let raw = match plugin.kind {
        "obj" => {
            // Says how Mitsuba 0.6 groups what is one mesh here.
            plugin.ignore(&["collapse"]);
            obj::read(&bytes, plugin.boolean_or("flip_tex_coords", true)?)
        }
        "ply" => ply::read(&bytes, plugin.boolean("flip_tex_coords")?, attributes),
        _ => {
            let index = plugin.integer("shape_index")?;
            let index =
                index.map(|index| index.check(|index| *index >= 0, "a whole number of at least 0")).transpose()?;
            serialized::read(&bytes, index.unwrap_or(0) as usize)
        }
    };
    let raw = raw.map_err(|reason| name.error(format!("the mesh {} is broken: {reason}", path.display())))?;
    let finite = raw.positions.iter().chain(&raw.normals).all(|v| v.is_finite());
    if !finite || !raw.uvs.iter().all(|uv| uv.is_finite()) {
        let message = format!("the mesh {} has a coordinate that is not a finite number", path.display());
        return Err(name.error(message));
    }
    Ok(MeshFile { name: name.text, raw, bytes })
}

fn check_size(form: &Form, element: Element<'_>) -> Result<(), LoadError> {
    let near = |reach: DVec3| reach.abs().max_element() <= FAR;
    let fits = match form {
        Form::Mesh(mesh) => mesh.positions.iter().all(|p| p.is_finite() && near(p.as_dvec3())),
        Form::Solid(solid) => solid.is_valid() && solid.bounds().max_abs() <= FAR,
    };
    let expected = format!("expected coordinates up to {FAR:e}");
    if fits {
        Ok(())
    } else {
        Err(element.error(format!("this shape is too small or too large to compute with; {expected}")))
    }
}
