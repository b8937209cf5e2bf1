//! `<shape>` elements.

use super::document::Element;
use super::error::LoadError;
use super::mesh::{self, Facing, RawMesh};
use super::plugin::Plugin;
use super::transform::normal_matrix;
use super::{obj, ply};
use crate::geometry::Solid;
use crate::scene::Mesh;
use crate::texture::Colour;
use glam::{DAffine3, DMat3, DVec3};

const KINDS: [&str; 6] = ["rectangle", "cube", "sphere", "disk", "obj", "ply"];

/// Largest coordinate: squares of distances stay finite in single precision.
const FAR: f64 = 1e18;

/// Relative deviation that a sphere's or a disk's transformation may have from one that keeps its form: matrices in
/// scene files are rounded.
const FORM_TOLERANCE: f64 = 1e-4;

/// A shape of the scene file.
pub(super) struct Shape<'a> {
    pub form: Form,
    /// Its scattering model, if it names one.
    pub bsdf: Option<Element<'a>>,
    /// Whether the model is seen from the other side: the normals of [`Form::Solid`] spheres always point outwards.
    pub turned: bool,
    /// What it radiates.
    pub radiance: Option<Colour>,
    /// Bytes of the mesh file that it was read from.
    pub file: Option<Vec<u8>>,
}

/// A shape in world space.
pub(super) enum Form {
    Mesh(Mesh),
    Solid(Solid),
}

/// Reads a shape and the mesh file that it names.
pub(super) fn read(element: Element<'_>) -> Result<Shape<'_>, LoadError> {
    let mut plugin = Plugin::new(element)?;
    if !KINDS.contains(&plugin.kind) {
        return Err(plugin.unknown(&KINDS));
    }
    let (to_world, transform) = plugin.placement()?;
    let flip_normals = plugin.boolean("flip_normals")?;
    let (mut turned, mut file) = (false, None);
    let form = match plugin.kind {
        "sphere" => {
            turned = (to_world.matrix3.determinant() < 0.0) != flip_normals;
            Form::Solid(sphere(&mut plugin, &to_world, transform)?)
        }
        "disk" => Form::Solid(disk(&to_world, transform, flip_normals)?),
        kind => {
            let facing = Facing { face_normals: plugin.boolean("face_normals")?, flip_normals };
            Form::Mesh(match kind {
                "rectangle" => mesh::rectangle().place_solid(&to_world, flip_normals),
                "cube" => mesh::cube().place_solid(&to_world, flip_normals),
                _ => {
                    let (raw, bytes) = mesh_file(&mut plugin)?;
                    file = Some(bytes);
                    raw.place(&to_world, facing)
                }
            })
        }
    };
    check_size(&form, element)?;
    let bsdf = plugin.object("bsdf")?;
    let radiance = plugin.object("emitter")?.map(area).transpose()?;
    plugin.finish()?;
    if turned && radiance.is_some() {
        return Err(element.error("a sphere that shines inwards is not supported; its normals must point outwards"));
    }
    if matches!((&form, &radiance), (Form::Solid(_), Some(Colour::Textured(_)))) {
        return Err(element.error("a sphere or disk that shines by a texture is not supported; expected a mesh"));
    }
    Ok(Shape { form, bsdf, turned, radiance, file })
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

fn mesh_file(plugin: &mut Plugin<'_>) -> Result<(RawMesh, Vec<u8>), LoadError> {
    let name = plugin.string("filename")?.ok_or_else(|| plugin.lacks("filename"))?.value;
    let path = name.source.beside(name.text);
    let bytes = std::fs::read(&path)
        .map_err(|error| name.error(format!("cannot read the mesh {}: {error}", path.display())))?;
    let raw = if plugin.kind == "obj" { obj::read(&bytes) } else { ply::read(&bytes) };
    let raw = raw.map_err(|reason| name.error(format!("the mesh {} is broken: {reason}", path.display())))?;
    if !raw.positions.iter().chain(&raw.normals).all(|v| v.is_finite()) {
        let message = format!("the mesh {} has a coordinate that is not a finite number", path.display());
        return Err(name.error(message));
    }
    Ok((raw, bytes))
}

fn sphere(plugin: &mut Plugin<'_>, to_world: &DAffine3, transform: Element<'_>) -> Result<Solid, LoadError> {
    let center = plugin.point("center")?.unwrap_or(DVec3::ZERO);
    let radius = plugin.positive("radius")?.unwrap_or(1.0);
    let DMat3 { x_axis, y_axis, z_axis } = to_world.matrix3;
    if !(alike(x_axis, y_axis) && alike(y_axis, z_axis) && alike(z_axis, x_axis)) {
        let message = "a sphere that is scaled differently along its axes, or sheared, is no sphere; expected a \
                       `to_world` that keeps its form";
        return Err(transform.error(message));
    }
    Ok(Solid::Sphere { center: to_world.transform_point3(center), radius: radius * x_axis.length() })
}

fn disk(to_world: &DAffine3, transform: Element<'_>, flip_normals: bool) -> Result<Solid, LoadError> {
    let DMat3 { x_axis, y_axis, .. } = to_world.matrix3;
    if !alike(x_axis, y_axis) {
        let message = "a disk that is scaled differently along x and y, or sheared, is no disk; expected a `to_world` \
                       that keeps its form";
        return Err(transform.error(message));
    }
    let normal = (normal_matrix(to_world) * DVec3::Z).normalize_or_zero();
    let normal = if flip_normals { -normal } else { normal };
    Ok(Solid::Disk { center: to_world.translation, normal, radius: x_axis.length() })
}

/// Whether two axes have the same length and a right angle between them.
fn alike(a: DVec3, b: DVec3) -> bool {
    let (la, lb) = (a.length(), b.length());
    (la - lb).abs() <= FORM_TOLERANCE * la && a.dot(b).abs() <= FORM_TOLERANCE * la * lb
}

fn check_size(form: &Form, element: Element<'_>) -> Result<(), LoadError> {
    let near = |reach: DVec3| reach.abs().max_element() <= FAR;
    let fits = match form {
        Form::Mesh(mesh) => mesh.positions.iter().all(|p| p.is_finite() && near(p.as_dvec3())),
        Form::Solid(Solid::Sphere { center, radius }) => near(center.abs() + *radius) && *radius > 0.0,
        Form::Solid(Solid::Disk { center, normal, radius }) => {
            near(center.abs() + *radius) && *radius > 0.0 && normal.is_normalized()
        }
    };
    let expected = format!("expected coordinates up to {FAR:e}");
    if fits {
        Ok(())
    } else {
        Err(element.error(format!("this shape is too small or too large to compute with; {expected}")))
    }
}
