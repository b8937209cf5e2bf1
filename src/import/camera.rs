//! Cameras.

use super::Importer;
use super::params::Params;
use super::transform::{mirrors, similarity};
use super::xml::Node;
use crate::load::LoadError;
use glam::{DAffine3, DMat3, DVec3};

/// Field of view where nothing is said.
const FOV: f64 = 90.0;

/// How far the camera sees: pbrt has no bound.
const FAR: f64 = 1e6;

const CAMERAS: [&str; 2] = ["perspective", "realistic"];

/// The camera of a scene without one.
pub(super) fn default() -> Node {
    node("perspective", &DAffine3::IDENTITY, FOV)
}

/// A camera whose own space, with +x on the right, `to_world` places in the world.
fn node(kind: &str, to_world: &DAffine3, fov: f64) -> Node {
    // Mitsuba's camera has +x on the left.
    let turned = *to_world * DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let node = Node::new("sensor", kind).placed(&turned).float("fov", fov).string("fov_axis", "smaller");
    node.float("far_clip", FAR)
}

impl Importer<'_> {
    /// `Camera "type" parameters`: the current transformation is that from the world to the camera.
    pub(super) fn camera(&mut self, kind: &str, mut params: Params) -> Result<(), LoadError> {
        let to_world = self.state.transform.inverse();
        self.spaces.insert("camera".to_owned(), to_world);
        match kind {
            "perspective" => (),
            "realistic" => {
                self.report.approximated(&params.spot, "the camera `realistic`: a perspective one of 40 degrees");
                params.ignore(&["lensfile", "aperturediameter", "aperture"]);
            }
            _ => self.unknown(&params.spot, "the camera", kind, &CAMERAS, "perspective")?,
        }
        let fov = match params.take("fov", &["float"])? {
            Some(param) => {
                let fov = param.numbers(1)?[0];
                if !(fov > 0.0 && fov < 180.0) {
                    return Err(param.error_at(0, "an angle between 0 and 180 degrees"));
                }
                fov
            }
            None if kind == "realistic" => 40.0,
            None => self.half_fov(&mut params)?,
        };
        let (axes, scale) = self.axes(&to_world, &params);
        let lens = params.float("lensradius")?.unwrap_or(0.0) * scale;
        let focus = params.positive("focaldistance")?.unwrap_or(FAR) * scale;
        params.ignore(&["shutteropen", "shutterclose"]);
        self.render.camera = Some(if lens > 0.0 {
            node("thinlens", &axes, fov).float("aperture_radius", lens).float("focus_distance", focus)
        } else {
            node("perspective", &axes, fov)
        });
        self.render.camera_spot = Some(params.spot.clone());
        self.finish(params);
        Ok(())
    }

    /// Version 3 has also half the field of view.
    fn half_fov(&mut self, params: &mut Params) -> Result<f64, LoadError> {
        let Some(param) = params.take("halffov", &["float"])? else { return Ok(FOV) };
        match param.numbers(1)?[0] {
            half if half > 0.0 && half < 90.0 => Ok(2.0 * half),
            _ => Err(param.error_at(0, "an angle between 0 and 90 degrees")),
        }
    }

    /// The camera's placement without scale, and the scale, which the lens keeps.
    fn axes(&mut self, to_world: &DAffine3, params: &Params) -> (DAffine3, f64) {
        let matrix = to_world.matrix3;
        let scale = similarity(to_world);
        if scale.is_none() {
            self.report.approximated(&params.spot, "the camera's space is stretched or sheared: its directions alone");
        }
        let z = matrix.z_axis.normalize();
        let y = (matrix.y_axis - z * matrix.y_axis.dot(z)).normalize();
        let x = y.cross(z) * if mirrors(to_world) { -1.0 } else { 1.0 };
        let axes = DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), to_world.translation);
        (axes, scale.unwrap_or_else(|| matrix.determinant().abs().cbrt()))
    }
}
