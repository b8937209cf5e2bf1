//! Lights.

use super::Importer;
use super::colour::{self, Role};
use super::octahedral;
use super::params::{COLOURS, Params};
use super::source::Spot;
use super::texture::grey;
use super::xml::Node;
use crate::image::{Image, Precision};
use crate::load::LoadError;
use crate::spectrum::Spectrum;
use glam::{DAffine3, DMat3, DVec3};
use std::f64::consts::PI;

const LIGHTS: [&str; 7] = ["infinite", "exinfinite", "distant", "point", "spot", "goniometric", "projection"];

/// What shapes radiate.
#[derive(Clone)]
pub(super) struct AreaLight {
    pub radiance: Spectrum,
    /// Power in all, which with the area gives the radiance.
    pub power: Option<f64>,
    pub spot: Spot,
}

impl Importer<'_> {
    /// `AreaLightSource "diffuse" parameters`.
    pub(super) fn area_light(&mut self, kind: &str, mut params: Params) -> Result<(), LoadError> {
        if !["diffuse", "area"].contains(&kind) {
            self.unknown(&params.spot, "the area light", kind, &["diffuse"], "a diffuse one")?;
        }
        if params.boolean("twosided")? == Some(true) {
            self.report.approximated(&params.spot, "a light that shines to both sides: to its front");
        }
        if params.any("filename").is_some() {
            self.report.left_out(&params.spot, "the image of an area light");
        }
        // How many samples it gets.
        params.ignore(&["samples", "nsamples"]);
        let radiance = self.radiance(&mut params, "L")?;
        let power = params.positive("power")?;
        let spot = params.spot.clone();
        self.finish(params);
        self.state.area = Some(AreaLight { radiance, power, spot });
        Ok(())
    }

    /// The emitter of a shape of this area.
    pub(super) fn area_node(&mut self, light: &AreaLight, area: Option<f64>) -> Node {
        let radiance = match (light.power, area) {
            (Some(power), Some(area)) if area > 0.0 => with_luminance(light.radiance, power / (PI * area)),
            (Some(_), _) => {
                self.report.left_out(&light.spot, "the power of an area light");
                light.radiance
            }
            (None, _) => light.radiance,
        };
        self.report.lights += 1;
        Node::new("emitter", "area").rgb("radiance", radiance)
    }

    /// `LightSource "type" parameters`.
    pub(super) fn light(&mut self, kind: &str, mut params: Params) -> Result<(), LoadError> {
        params.ignore(&["samples", "nsamples"]);
        let node = match kind {
            "infinite" | "exinfinite" => self.infinite(&mut params)?,
            "distant" => self.distant(&mut params)?,
            "point" => self.point(&mut params)?,
            "goniometric" => {
                self.report.approximated(&params.spot, "goniometric: a point light");
                params.ignore(&["filename", "mapname"]);
                self.point(&mut params)?
            }
            "spot" => self.spot(&mut params)?,
            "projection" => {
                self.report.approximated(&params.spot, "projection: a spot light");
                params.ignore(&["filename", "mapname"]);
                if let Some(fov) = params.float("fov")? {
                    params.ignore(&["coneangle"]);
                    self.cone(&mut params, 0.5 * fov, 0.0)?
                } else {
                    self.spot(&mut params)?
                }
            }
            _ => {
                self.unknown(&params.spot, "the light", kind, &LIGHTS, "nothing")?;
                return Ok(());
            }
        };
        self.finish(params);
        self.report.lights += 1;
        self.lights.push(node);
        Ok(())
    }

    /// The parameter `name`, times `scale`.
    fn radiance(&mut self, params: &mut Params, name: &str) -> Result<Spectrum, LoadError> {
        let colour = match params.take(name, &COLOURS)? {
            Some(param) => colour::read(&param, Role::Light, &self.folder)?,
            None => Spectrum::ONE,
        };
        Ok(colour * self.scale(params)?)
    }

    /// A number, which version 3 has as a colour.
    fn scale(&mut self, params: &mut Params) -> Result<Spectrum, LoadError> {
        let kinds = [&COLOURS[..], &["float", "integer"]].concat();
        match params.take("scale", &kinds)? {
            Some(param) => colour::read(&param, Role::Share, &self.folder),
            None => Ok(Spectrum::ONE),
        }
    }

    fn infinite(&mut self, params: &mut Params) -> Result<Node, LoadError> {
        let file = match params.take("filename", &["string"])? {
            None => params.take("mapname", &["string"])?,
            found => found,
        };
        if params.any("portal").is_some() {
            // It only says where to look for light.
            self.report.approximated(&params.spot, "the portal of an environment: all of it is sampled");
        }
        let radiance = self.radiance(params, "L")?;
        let illuminance = params.positive("illuminance")?;
        let Some(file) = file else {
            let radiance = illuminance.map_or(radiance, |lux| with_luminance(radiance, lux / PI));
            return Ok(Node::new("emitter", "constant").rgb("radiance", radiance));
        };
        if illuminance.is_some() {
            self.report.left_out(&params.spot, "the illuminance of an environment image");
        }
        let path = self.find(&file)?;
        let image = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr")).then(|| Image::read(&path));
        let image = image.transpose().map_err(|error| file.error_at(0, &format!("an image ({error})")))?;
        let octahedral = image.filter(|image| image.width() == image.height());
        let (name, axes) = match octahedral {
            Some(image) => {
                self.report.approximated(&file.spot, "an octahedral environment: resampled by latitude and longitude");
                let resampled = octahedral::to_equirectangular(&image);
                (self.out.image(&resampled, Precision::Float).map_err(|error| file.spot.error(error))?, Y_UP)
            }
            None => (self.resource(&file)?, Y_UP_MIRRORED),
        };
        let factor = grey(radiance);
        if radiance != Spectrum::grey(factor) {
            self.report.approximated(&params.spot, "the colour that multiplies an environment image: its luminance");
        }
        let turn = DAffine3::from_mat3(self.state.transform.matrix3 * axes);
        Ok(Node::new("emitter", "envmap").string("filename", name).float("scale", factor).placed(&turn))
    }

    fn distant(&mut self, params: &mut Params) -> Result<Node, LoadError> {
        let from = params.triple("from")?.unwrap_or(DVec3::ZERO);
        let to = params.triple("to")?.unwrap_or(DVec3::Z);
        let irradiance = self.radiance(params, "L")?;
        let illuminance = params.positive("illuminance")?;
        let irradiance = illuminance.map_or(irradiance, |lux| with_luminance(irradiance, lux));
        let direction = self.state.transform.transform_vector3(to - from).try_normalize();
        let direction = direction.ok_or_else(|| params.spot.error("found `from` at `to`; expected two points"))?;
        let node = Node::new("emitter", "directional").triple("vector", "direction", direction);
        Ok(node.rgb("irradiance", irradiance))
    }

    fn point(&mut self, params: &mut Params) -> Result<Node, LoadError> {
        let from = params.triple("from")?.unwrap_or(DVec3::ZERO);
        let intensity = self.radiance(params, "I")?;
        let power = params.positive("power")?;
        let intensity = power.map_or(intensity, |power| with_luminance(intensity, power / (4.0 * PI)));
        let position = self.state.transform.transform_point3(from);
        Ok(Node::new("emitter", "point").triple("point", "position", position).rgb("intensity", intensity))
    }

    fn spot(&mut self, params: &mut Params) -> Result<Node, LoadError> {
        let cone = params.positive("coneangle")?.unwrap_or(30.0);
        let delta = params.float("conedeltaangle")?.unwrap_or(5.0).clamp(0.0, cone);
        if delta > 0.0 {
            self.report.approximated(&params.spot, "the edge of a spot light: it fades linearly");
        }
        self.cone(params, cone, delta)
    }

    /// A spot light whose cone opens by `cone` degrees from its axis and fades over the last `delta`.
    fn cone(&mut self, params: &mut Params, cone: f64, delta: f64) -> Result<Node, LoadError> {
        let from = params.triple("from")?.unwrap_or(DVec3::ZERO);
        let to = params.triple("to")?.unwrap_or(DVec3::Z);
        let mut intensity = self.radiance(params, "I")?;
        if let Some(power) = params.positive("power")? {
            let (inner, outer) = ((cone - delta).to_radians().cos(), cone.to_radians().cos());
            let angle = 2.0 * PI * ((1.0 - inner) + 0.5 * (inner - outer));
            intensity = with_luminance(intensity, power / angle);
        }
        let [from, to] = [from, to].map(|point| self.state.transform.transform_point3(point));
        let axis = (to - from).try_normalize();
        let axis = axis.ok_or_else(|| params.spot.error("found `from` at `to`; expected two points"))?;
        let (side, up) = axis.any_orthonormal_pair();
        let turn = DMat3::from_cols(side, up, axis);
        let turn = if turn.determinant() < 0.0 { DMat3::from_cols(up, side, axis) } else { turn };
        let node = Node::new("emitter", "spot").placed(&DAffine3::from_mat3_translation(turn, from));
        let node = node.rgb("intensity", intensity).float("cutoff_angle", cone);
        Ok(node.float("beam_width", cone - delta))
    }
}

/// The colour with another luminance; black stays black.
fn with_luminance(colour: Spectrum, luminance: f64) -> Spectrum {
    if colour.is_black() { colour } else { colour * (luminance / grey(colour)) }
}

/// From Mitsuba's environments, with +y up, to pbrt's, with +z up; the same as in [`octahedral`].
const Y_UP: DMat3 = DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y);

/// The same for images by latitude and longitude: they run the other way around, and start at another place.
const Y_UP_MIRRORED: DMat3 = DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::NEG_X);
