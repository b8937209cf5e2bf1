//! Shapes that stay round: `sphere`, `disk`, `cylinder`.

use super::document::Element;
use super::error::LoadError;
use super::plugin::Plugin;
use super::transform::normal_matrix;
use crate::geometry::Solid;
use crate::math::Frame;
use glam::{DAffine3, DMat3, DVec3};

/// Relative deviation that a transformation may have from one that keeps the form: matrices in scene files are rounded.
const FORM_TOLERANCE: f64 = 1e-4;

/// A round shape in world space.
pub(super) struct Round {
    pub solid: Solid,
    /// Whether its scattering model is seen from the other side: the normals of spheres and cylinders always point
    /// outwards.
    pub turned: bool,
}

/// Reads a shape of one of the three kinds, which `to_world` from the element `transform` places.
pub(super) fn read(
    plugin: &mut Plugin<'_>,
    to_world: &DAffine3,
    transform: Element<'_>,
    flip_normals: bool,
) -> Result<Round, LoadError> {
    match plugin.kind {
        "sphere" => {
            let turned = (to_world.matrix3.determinant() < 0.0) != flip_normals;
            Ok(Round { solid: sphere(plugin, to_world, transform)?, turned })
        }
        "disk" => Ok(Round { solid: disk(to_world, transform, flip_normals)?, turned: false }),
        _ => Ok(Round { solid: cylinder(plugin, to_world, transform)?, turned: flip_normals }),
    }
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
    let axes = frame([x_axis, y_axis, z_axis]);
    Ok(Solid::Sphere { center: to_world.transform_point3(center), radius: radius * x_axis.length(), axes })
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
    let axes = [x_axis, y_axis].map(DVec3::normalize_or_zero);
    Ok(Solid::Disk { center: to_world.translation, normal, radius: x_axis.length(), axes })
}

fn cylinder(plugin: &mut Plugin<'_>, to_world: &DAffine3, transform: Element<'_>) -> Result<Solid, LoadError> {
    let bottom = plugin.point("p0")?.unwrap_or(DVec3::ZERO);
    let top = plugin.point("p1")?.unwrap_or(DVec3::Z);
    let radius = plugin.positive("radius")?.unwrap_or(1.0);
    let Some(axis) = (top - bottom).try_normalize() else {
        return Err(plugin.element.error("a cylinder with `p0` and `p1` in the same place; expected two places"));
    };
    let Frame { tangent, bitangent, .. } = Frame::around(axis);
    let [x, y, z] = [tangent * radius, bitangent * radius, top - bottom].map(|v| to_world.matrix3 * v);
    if !(alike(x, y) && square(y, z) && square(z, x)) {
        let message = "a cylinder that is scaled differently across its axis, or sheared, is no cylinder; expected a \
                       `to_world` that keeps its form";
        return Err(transform.error(message));
    }
    let bottom = to_world.transform_point3(bottom);
    Ok(Solid::Cylinder { bottom, axes: frame([x, y, z]), length: z.length(), radius: x.length() })
}

fn frame(axes: [DVec3; 3]) -> Frame {
    let [tangent, bitangent, normal] = axes.map(DVec3::normalize_or_zero);
    Frame { tangent, bitangent, normal }
}

/// Whether two axes have the same length and a right angle between them.
fn alike(a: DVec3, b: DVec3) -> bool {
    let (la, lb) = (a.length(), b.length());
    (la - lb).abs() <= FORM_TOLERANCE * la && square(a, b)
}

/// Whether there is a right angle between two axes.
fn square(a: DVec3, b: DVec3) -> bool {
    a.dot(b).abs() <= FORM_TOLERANCE * a.length() * b.length()
}
