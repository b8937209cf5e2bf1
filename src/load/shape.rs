//! `<shape>` elements.

use super::attributes::{Skin, shows};
use super::document::Element;
use super::error::LoadError;
use super::mesh::{self, Facing};
use super::mesh_file::MeshFile;
use super::plugin::Plugin;
use super::round;
use super::texture::Role;
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
    /// The shape as its textures see it, where one of them shows an attribute.
    pub skin: Option<Skin>,
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
    Form(Form, Option<Skin>),
    File(MeshFile<'a>),
}

/// What has been read of a shape.
pub(super) struct Read {
    pub form: Form,
    pub skin: Option<Skin>,
    /// Fingerprint of the file that it was read from.
    pub file: Option<blake3::Hash>,
}

impl Body<'_> {
    /// Reads the file, if there is one.
    pub fn read(self) -> Result<Read, LoadError> {
        match self {
            Self::Form(form, skin) => Ok(Read { form, skin, file: None }),
            Self::File(file) => file.read(),
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
        kind if !KINDS.contains(&kind) => plugin.stand_in(&KINDS, "left out").map(|()| Vec::new()),
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
    let shows = shows(element)?;
    let skin = shows.then(|| Skin::bare(format!("this {}", plugin.kind)));
    let body = match plugin.kind {
        "sphere" | "disk" | "cylinder" => {
            let round = round::read(&mut plugin, &to_world, transform, flip_normals)?;
            turned = round.turned;
            Body::Form(Form::Solid(round.solid), skin)
        }
        kind => {
            let face_normals = plugin.boolean("face_normals")?;
            let facing = Facing { face_normals, flip_normals };
            match kind {
                "rectangle" => Body::Form(Form::Mesh(mesh::rectangle().place_solid(&to_world, flip_normals)), skin),
                "cube" => Body::Form(Form::Mesh(mesh::cube().place_solid(&to_world, flip_normals)), skin),
                _ => Body::File(MeshFile::of(&mut plugin, to_world, facing, shows)?),
            }
        }
    };
    Ok((Opened { plugin, turned }, body))
}

impl<'a> Opened<'a> {
    /// Reads the rest of a shape.
    pub fn finish(self, read: Read) -> Result<Shape<'a>, LoadError> {
        let Self { mut plugin, turned } = self;
        let Read { mut form, skin, file } = read;
        let element = plugin.element;
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
        Ok(Shape { element, form, bsdf, turned, radiance, skin, file })
    }
}

/// Reads the emitter of a shape.
fn area(element: Element<'_>, skin: Option<&Skin>) -> Result<Colour, LoadError> {
    let mut plugin = Plugin::new(element)?.on(skin);
    if plugin.kind != "area" && element.document.approximate {
        plugin.stand_in(&["area"], "an area emitter")?;
    } else if plugin.kind != "area" {
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
