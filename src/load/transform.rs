//! `<transform>`: steps that apply one after the other, each multiplied from the left.

use super::document::Element;
use super::error::LoadError;
use crate::math::Frame;
use glam::{DAffine3, DMat3, DQuat, DVec3};

/// The transformation of a `<transform>` element. It can be undone and is finite.
pub(super) fn read(element: Element<'_>) -> Result<DAffine3, LoadError> {
    element.only(&["name"])?;
    let mut whole = DAffine3::IDENTITY;
    for step in element.children() {
        whole = match step.tag() {
            "translate" => DAffine3::from_translation(axes(step, 0.0, &[])?),
            "scale" => DAffine3::from_scale(axes(step, 1.0, &[])?),
            "rotate" => rotate(step)?,
            "matrix" => matrix(step)?,
            "lookat" => look_at(step)?,
            "lookAt" if step.is_legacy() => look_at(step)?,
            other => {
                let expected = "translate, scale, rotate, matrix, lookat";
                return Err(step.error(format!("unknown transformation <{other}>; expected one of {expected}")));
            }
        } * whole;
    }
    let determinant = whole.matrix3.determinant();
    if !whole.is_finite() || !determinant.is_finite() {
        return Err(element.error("this transformation is too large to compute with"));
    }
    if determinant == 0.0 {
        return Err(element.error("this transformation flattens space; expected one that can be undone"));
    }
    Ok(whole)
}

/// Matrix that takes normals of surfaces to their world space, up to a positive factor: the inverse transpose. It is
/// formed from cofactors, which stay finite however small the transformation is.
pub(super) fn normal_matrix(transform: &DAffine3) -> DMat3 {
    let DMat3 { x_axis, y_axis, z_axis } = transform.matrix3;
    let cofactors = DMat3::from_cols(y_axis.cross(z_axis), z_axis.cross(x_axis), x_axis.cross(y_axis));
    cofactors * transform.matrix3.determinant().signum()
}

/// The attributes x, y, z, with a `default`, or three numbers in `value`.
fn axes(step: Element<'_>, default: f64, others: &[&str]) -> Result<DVec3, LoadError> {
    step.only(&[&["value", "x", "y", "z"], others].concat())?;
    if let Some(value) = step.attribute("value") {
        return value.triple();
    }
    let axis = |name| step.attribute(name).map_or(Ok(default), |text| text.number());
    Ok(DVec3::new(axis("x")?, axis("y")?, axis("z")?))
}

/// Rotation about an axis of any length.
fn rotate(step: Element<'_>) -> Result<DAffine3, LoadError> {
    let axis = axes(step, 0.0, &["angle"])?.try_normalize();
    let axis = axis.ok_or_else(|| step.error("<rotate> has no axis; expected x, y or z other than 0"))?;
    let angle = step.required("angle")?.number()?.to_radians();
    Ok(DAffine3::from_quat(DQuat::from_axis_angle(axis, angle)))
}

fn matrix(step: Element<'_>) -> Result<DAffine3, LoadError> {
    step.only(&["value"])?;
    let text = step.required("value")?;
    let rows = text.numbers()?;
    let cells = |stride: usize| DMat3::from_cols_array_2d(&[0, 1, 2].map(|c| [0, 1, 2].map(|r| rows[r * stride + c])));
    match rows.len() {
        9 => Ok(DAffine3::from_mat3(cells(3))),
        16 if rows[12..] == [0.0, 0.0, 0.0, 1.0] => {
            Ok(DAffine3::from_mat3_translation(cells(4), DVec3::new(rows[3], rows[7], rows[11])))
        }
        16 => {
            Err(text.error("the last row of this matrix is not 0 0 0 1; perspective transformations are not supported"))
        }
        count => Err(text.error(format!("found {count} numbers; expected 16, or 9 without translation"))),
    }
}

/// Frame at `origin` whose +z looks at `target`, +y up and +x left.
fn look_at(step: Element<'_>) -> Result<DAffine3, LoadError> {
    step.only(&["origin", "target", "up"])?;
    let origin = step.required("origin")?.triple()?;
    let target = step.required("target")?.triple()?;
    let direction = (target - origin).try_normalize();
    let direction = direction.ok_or_else(|| step.error("<lookat> has its target at its origin"))?;
    let up = match step.attribute("up") {
        Some(text) => text.triple()?,
        None => Frame::around(direction).tangent,
    };
    let left = up.cross(direction).try_normalize().filter(|_| up.normalize_or_zero().cross(direction).length() > 1e-12);
    let left = left.ok_or_else(|| step.error("<lookat> looks along `up`; expected another direction for `up`"))?;
    Ok(DAffine3::from_mat3_translation(DMat3::from_cols(left, direction.cross(left), direction), origin))
}
