//! Parameters of Burley's model.

use crate::bsdf::Principled;
use crate::load::error::LoadError;
use crate::load::plugin::Plugin;
use crate::texture::Number;

/// Parameters that only steer the sampling in Mitsuba.
const RATES: [&str; 3] =
    ["diffuse_reflectance_sampling_rate", "main_specular_sampling_rate", "clearcoat_sampling_rate"];

/// The model, whose index is given as such or by `specular`, the reflectance at normal incidence in units of 0.08.
pub(super) fn principled(plugin: &mut Plugin<'_>) -> Result<Principled, LoadError> {
    plugin.ignore(&RATES);
    let spec_trans = unit(plugin, "spec_trans", 0.0)?;
    let eta = eta(plugin, spec_trans != Number::Constant(0.0))?;
    Ok(Principled {
        base_color: plugin.colour_texture("base_color", 0.5)?,
        roughness: unit(plugin, "roughness", 0.5)?,
        anisotropic: unit(plugin, "anisotropic", 0.0)?,
        metallic: unit(plugin, "metallic", 0.0)?,
        spec_trans,
        spec_tint: unit(plugin, "spec_tint", 0.0)?,
        sheen: unit(plugin, "sheen", 0.0)?,
        sheen_tint: unit(plugin, "sheen_tint", 0.0)?,
        flatness: unit(plugin, "flatness", 0.0)?,
        clearcoat: unit(plugin, "clearcoat", 0.0)?,
        clearcoat_gloss: unit(plugin, "clearcoat_gloss", 0.0)?,
        eta,
    })
}

/// A number from 0 to 1 that may be a texture.
fn unit(plugin: &mut Plugin<'_>, name: &'static str, default: f64) -> Result<Number, LoadError> {
    match plugin.number_texture(name, default)? {
        Number::Constant(value) if !(0.0..=1.0).contains(&value) => {
            Err(plugin.element.error(format!("`{name}` is {value}; expected a number from 0 to 1")))
        }
        number => Ok(number),
    }
}

/// An index of 1 refracts nothing; a transparent model gets one close to it, as in Mitsuba.
fn eta(plugin: &mut Plugin<'_>, transparent: bool) -> Result<f64, LoadError> {
    if plugin.is_given("eta") {
        if plugin.is_given("specular") {
            return Err(plugin.element.error("both `eta` and `specular`; expected one or the other"));
        }
        let eta = plugin.positive("eta")?.unwrap_or(1.5);
        return Ok(if transparent && eta == 1.0 { 1.001 } else { eta });
    }
    let specular = plugin.float("specular")?;
    let specular = specular.map(|s| s.check(|s| (0.0..=1.0).contains(s), "a number from 0 to 1")).transpose()?;
    let specular = specular.unwrap_or(0.5).max(if transparent { 1e-3 } else { 0.0 });
    Ok(2.0 / (1.0 - (0.08 * specular).sqrt()) - 1.0)
}
