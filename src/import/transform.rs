//! Directives that change the current transformation.

use super::Importer;
use super::source::Spot;
use super::token::Tokens;
use crate::load::LoadError;
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, DVec4};

/// Largest difference of lengths or cosine between axes that counts as rounding: matrices are written in decimals.
const ROUNDING: f64 = 1e-3;

impl Importer<'_> {
    /// Applies `directive` if it is about transformations; whether it is.
    pub(super) fn transformation(
        &mut self,
        directive: &str,
        spot: &Spot,
        tokens: &mut Tokens<'_>,
    ) -> Result<bool, LoadError> {
        let now = self.state.transform;
        let next = match directive {
            "Identity" => DAffine3::IDENTITY,
            "Translate" => now * DAffine3::from_translation(tokens.numbers::<3>()?.into()),
            "Scale" => now * DAffine3::from_scale(tokens.numbers::<3>()?.into()),
            "Rotate" => now * rotation(tokens.numbers()?, spot)?,
            "LookAt" => now * look_at(tokens.numbers()?, spot)?,
            "Transform" => matrix(&tokens.numbers()?, spot)?,
            "ConcatTransform" => now * matrix(&tokens.numbers()?, spot)?,
            "CoordinateSystem" => {
                let name = tokens.string("the name of a coordinate system")?;
                self.spaces.insert(name, now);
                now
            }
            "CoordSysTransform" => {
                let name = tokens.string("the name of a coordinate system")?;
                match self.spaces.get(&name) {
                    Some(space) => *space,
                    None => {
                        let known = super::names(&self.spaces);
                        self.unknown(spot, "the coordinate system", &name, &known, "the current one")?;
                        now
                    }
                }
            }
            _ => return Ok(false),
        };
        if !self.state.at_end_only {
            self.state.transform = check(next, spot)?;
        }
        Ok(true)
    }
}

/// Refuses transformations that cannot be undone.
fn check(transform: DAffine3, spot: &Spot) -> Result<DAffine3, LoadError> {
    let determinant = transform.matrix3.determinant();
    if !transform.is_finite() || !determinant.is_finite() {
        return Err(spot.error("found a transformation that is too large to compute with; expected a smaller one"));
    }
    if determinant == 0.0 {
        return Err(spot.error("found a transformation that flattens space; expected one that can be undone"));
    }
    Ok(transform)
}

fn rotation([angle, x, y, z]: [f64; 4], spot: &Spot) -> Result<DAffine3, LoadError> {
    let axis = DVec3::new(x, y, z).try_normalize();
    let axis = axis.ok_or_else(|| spot.error("found a rotation about 0 0 0; expected an axis"))?;
    Ok(DAffine3::from_quat(DQuat::from_axis_angle(axis, angle.to_radians())))
}

/// From the world to a camera that looks along +z with +y up and +x on the right, which is left-handed.
fn look_at(numbers: [f64; 9], spot: &Spot) -> Result<DAffine3, LoadError> {
    let [eye, target, up] = [0, 3, 6].map(|at| DVec3::from_slice(&numbers[at..]));
    let ahead = (target - eye).try_normalize();
    let ahead =
        ahead.ok_or_else(|| spot.error("found a LookAt with its target at its eye; expected another target"))?;
    let side = up.normalize_or_zero().cross(ahead);
    let side = side.try_normalize().filter(|_| side.length() > 1e-12);
    let side = side.ok_or_else(|| spot.error("found a LookAt along its up vector; expected another up vector"))?;
    Ok(DAffine3::from_mat3_translation(DMat3::from_cols(side, ahead.cross(side), ahead), eye).inverse())
}

/// pbrt writes the columns of a matrix one after the other.
fn matrix(numbers: &[f64; 16], spot: &Spot) -> Result<DAffine3, LoadError> {
    let matrix = DMat4::from_cols_array(numbers);
    let w = matrix.w_axis.w;
    if matrix.row(3) / w != DVec4::W {
        return Err(spot.error("found a matrix with perspective; expected 0 0 0 1 at the places 4, 8, 12 and 16"));
    }
    Ok(DAffine3::from_mat4(matrix * (1.0 / w)))
}

/// The factor by which a transformation scales, if it keeps the form of things.
pub(super) fn similarity(transform: &DAffine3) -> Option<f64> {
    let DMat3 { x_axis, y_axis, z_axis } = transform.matrix3;
    let scale = x_axis.length();
    let alike = |a: DVec3, b: DVec3| {
        (a.length() - b.length()).abs() <= ROUNDING * scale && a.dot(b).abs() <= ROUNDING * scale * scale
    };
    (alike(x_axis, y_axis) && alike(y_axis, z_axis) && alike(z_axis, x_axis)).then_some(scale)
}

/// Whether the transformation mirrors.
pub(super) fn mirrors(transform: &DAffine3) -> bool {
    transform.matrix3.determinant() < 0.0
}
