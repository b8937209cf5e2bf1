//! `<shape>` elements.

use super::document::Element;
use super::error::LoadError;
use super::mesh::{self, Facing};
use super::mesh_file::MeshFile;
use super::plugin::Plugin;
use super::round;
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
    pub element: Element<'a>,
    pub form: Form,
    /// Its scattering model, if it names one.
    pub bsdf: Option<Element<'a>>,
    /// Whether the model is seen from the other side: see [`round::Round::turned`].
    pub turned: bool,
    /// What it radiates.
    pub radiance: Option<Colour>,
    /// Fingerprint of the mesh file that it was read from.
    pub file: Option<blake3::Hash>,
}

/// A shape whose form is known, and the rest not yet.
pub(super) struct Opened<'a> {
    plugin: Plugin<'a>,
    turned: bool,
}

/// The form of a shape, or where it is to be read: what can be done for many shapes at the same time.
pub(super) enum Body<'a> {
    Form(Form),
    File(MeshFile<'a>),
}

impl Body<'_> {
    /// The form, and the fingerprint of the file that it was read from.
    pub fn read(self) -> Result<(Form, Option<blake3::Hash>), LoadError> {
        match self {
            Self::Form(form) => Ok((form, None)),
            Self::File(file) => file.read().map(|(mesh, hash)| (Form::Mesh(mesh), Some(hash))),
        }
    }
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

/// Reads what makes the form of a shape; `outer` places it once more.
pub(super) fn open<'a>(element: Element<'a>, outer: &DAffine3) -> Result<(Opened<'a>, Body<'a>), LoadError> {
    let mut plugin = Plugin::new(element)?;
    if !KINDS.contains(&plugin.kind) {
        return Err(plugin.unknown(&KINDS));
    }
    let (inner, transform) = plugin.placement()?;
    let to_world = *outer * inner;
    let flip_normals = plugin.boolean("flip_normals")?;
    let mut turned = false;
    let body = match plugin.kind {
        "sphere" | "disk" | "cylinder" => {
            let round = round::read(&mut plugin, &to_world, transform, flip_normals)?;
            turned = round.turned;
            Body::Form(Form::Solid(round.solid))
        }
        kind => {
            let face_normals = plugin.boolean("face_normals")?;
            match kind {
                "rectangle" => Body::Form(Form::Mesh(mesh::rectangle().place_solid(&to_world, flip_normals))),
                "cube" => Body::Form(Form::Mesh(mesh::cube().place_solid(&to_world, flip_normals))),
                _ => Body::File(MeshFile::of(&mut plugin, to_world, Facing { face_normals, flip_normals })?),
            }
        }
    };
    Ok((Opened { plugin, turned }, body))
}

impl<'a> Opened<'a> {
    /// Reads the rest of a shape with this form, from this file.
    pub fn finish(self, (form, file): (Form, Option<blake3::Hash>)) -> Result<Shape<'a>, LoadError> {
        let Self { mut plugin, turned } = self;
        let element = plugin.element;
        check_size(&form, element)?;
        let bsdf = plugin.object("bsdf")?;
        let radiance = plugin.object("emitter")?.map(area).transpose()?;
        plugin.finish()?;
        if turned && radiance.is_some() {
            let kind = element.required("type")?.text;
            let message = format!("a {kind} that shines inwards is not supported; its normals must point outwards");
            return Err(element.error(message));
        }
        Ok(Shape { element, form, bsdf, turned, radiance, file })
    }
}

/// Reads the emitter of a shape.
fn area(element: Element<'_>) -> Result<Colour, LoadError> {
    let mut plugin = Plugin::new(element)?;
    if plugin.kind != "area" {
        let message = format!("unexpected emitter `{}` in a shape; expected area", plugin.kind);
        return Err(element.error(message));
    }
    plugin.ignore(&["sampling_weight"]);
    let radiance = match plugin.texture("radiance")? {
        Some(texture) => Colour::Textured(texture),
        None => Colour::Constant(plugin.light("radiance")?),
    };
    plugin.finish()?;
    Ok(radiance)
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
