//! `<emitter>` elements that are not shapes.

use super::document::Element;
use super::error::LoadError;
use super::plugin::Plugin;
use crate::emitter::sky::{SUN_DIAMETER, Sky, SunModel, When};
use crate::emitter::{Backdrop, Panorama, Spot};
use crate::scene::Shine;
use glam::{DAffine3, DMat3, DVec3};

const KINDS: [&str; 9] =
    ["constant", "envmap", "sunsky", "sun", "sky", "point", "spot", "directional", "area (in a shape)"];

/// Largest cosine between axes of an environment, and largest relative difference of their lengths: matrices in scene
/// files are rounded.
const SKEW_TOLERANCE: f64 = 1e-3;

/// Parameters that cannot change the image, or hardly: how finely Mitsuba 0.6 draws the sky, and whether Mitsuba 3's sun
/// is darker at its rim.
const HARMLESS: [&str; 6] = ["sampling_weight", "resolution", "cache", "sun_samples", "complex_sun", "id"];

/// Reads an emitter that is not a shape; a sun as a point gives two.
pub(super) fn read(element: Element<'_>) -> Result<Vec<Shine>, LoadError> {
    let mut plugin = Plugin::new(element)?;
    plugin.ignore(&HARMLESS);
    let shines = match plugin.kind {
        "constant" => vec![Shine::Environment(plugin.light("radiance")?)],
        "envmap" => vec![image(&mut plugin)?],
        "sunsky" | "sun" | "sky" => sun_and_sky(&mut plugin)?,
        "point" => vec![point(&mut plugin)?],
        "spot" => vec![spot(&mut plugin)?],
        "directional" => vec![directional(&mut plugin)?],
        "area" => {
            return Err(element.error("an area emitter shines from a shape; expected it inside of a <shape>"));
        }
        _ => {
            plugin.stand_in(&KINDS, "left out")?;
            plugin.ignore_rest();
            Vec::new()
        }
    };
    plugin.finish()?;
    Ok(shines)
}

fn point(plugin: &mut Plugin<'_>) -> Result<Shine, LoadError> {
    let intensity = plugin.light("intensity")?;
    let (to_world, transform) = plugin.placement()?;
    let position = match plugin.point("position")? {
        Some(_) if transform.tag() == "transform" => {
            return Err(transform.error("a point emitter with both `position` and `to_world`; expected one"));
        }
        Some(position) => position,
        None => to_world.translation,
    };
    Ok(Shine::Point(position, intensity))
}

fn spot(plugin: &mut Plugin<'_>) -> Result<Shine, LoadError> {
    let to_world = plugin.placement()?.0;
    let intensity = plugin.light("intensity")?;
    let angle = plugin.float("cutoff_angle")?;
    let cutoff = angle.map(|angle| angle.check(|angle| *angle > 0.0 && *angle <= 180.0, "above 0, up to 180"));
    let cutoff = cutoff.transpose()?.unwrap_or(20.0);
    let beam = plugin.float("beam_width")?;
    let beam = beam.map(|beam| beam.check(|beam| (0.0..=cutoff).contains(beam), "from 0 to the cutoff angle"));
    let beam = beam.transpose()?.unwrap_or(0.75 * cutoff);
    let axis = to_world.matrix3.z_axis.normalize();
    let (cutoff, beam) = (cutoff.to_radians(), beam.to_radians());
    Ok(Shine::Spot(Spot { position: to_world.translation, axis, intensity, cutoff, beam }))
}

fn directional(plugin: &mut Plugin<'_>) -> Result<Shine, LoadError> {
    let irradiance = plugin.light("irradiance")?;
    let (to_world, transform) = plugin.placement()?;
    let along = match plugin.point("direction")? {
        Some(_) if transform.tag() == "transform" => {
            return Err(transform.error("a directional emitter with both `direction` and `to_world`; expected one"));
        }
        Some(direction) => direction,
        None => to_world.matrix3.z_axis,
    };
    let along = along.try_normalize().ok_or_else(|| plugin.element.error("`direction` has no length"))?;
    Ok(Shine::Directional(-along, irradiance))
}

fn image(plugin: &mut Plugin<'_>) -> Result<Shine, LoadError> {
    let name = plugin.string("filename")?.ok_or_else(|| plugin.lacks("filename"))?.value;
    let picture = plugin.element.document.pictures.get(name)?;
    let scale = scale(plugin, "scale", 1.0)?;
    let rotation = rotation(plugin)?;
    // A black image is no emitter, but not wrong either.
    let image = Panorama::new(picture, scale).map(|panorama| (panorama, rotation));
    Ok(Shine::Backdrop(Backdrop { image, sun: None }))
}

/// A factor of at least 0.
fn scale(plugin: &mut Plugin<'_>, name: &'static str, default: f64) -> Result<f64, LoadError> {
    let scale = plugin.float(name)?;
    let scale = scale.map(|scale| scale.check(|scale| *scale >= 0.0, "a number of at least 0")).transpose()?;
    Ok(scale.unwrap_or(default))
}

/// The rotation of `to_world`, whose lengths do not matter for what is infinitely far away.
fn rotation(plugin: &mut Plugin<'_>) -> Result<DMat3, LoadError> {
    let (DAffine3 { matrix3, .. }, transform) = plugin.placement()?;
    let [x, y, z] = [0, 1, 2].map(|axis| matrix3.col(axis).normalize_or_zero());
    let lengths = [0, 1, 2].map(|axis| matrix3.col(axis).length());
    let uneven = lengths.iter().any(|length| (length / lengths[0] - 1.0).abs() > SKEW_TOLERANCE);
    if uneven || [x.dot(y), y.dot(z), z.dot(x)].iter().any(|cosine| cosine.abs() > SKEW_TOLERANCE) {
        let message = "the axes of this environment differ in length or are not at right angles; expected a rotation";
        return Err(transform.error(message));
    }
    let y = (y - x * x.dot(y)).normalize();
    Ok(DMat3::from_cols(x, y, x.cross(y) * x.cross(y).dot(z).signum()))
}

/// The sun, the sky or both. Their own axes have +y up in files for Mitsuba 0.6, +z in newer ones.
fn sun_and_sky(plugin: &mut Plugin<'_>) -> Result<Vec<Shine>, LoadError> {
    let own = rotation(plugin)?;
    // Mitsuba 3 has +x in the south and +y in the west, which is a mirror image of the world.
    let upright = DMat3::from_cols(-DVec3::Y, DVec3::Z, DVec3::X);
    let rotation = if plugin.element.is_legacy() { own } else { own * upright };
    let range = |low: f64, high: f64| move |value: &f64| (low..=high).contains(value);
    let turbidity = plugin.float("turbidity")?.map(|t| t.check(range(1.0, 10.0), "1 to 10")).transpose()?;
    let stretch = plugin.float("stretch")?.map(|s| s.check(range(1.0, 2.0), "1 to 2")).transpose()?;
    let sky = Sky {
        towards: towards(plugin, &rotation)?,
        turbidity: turbidity.unwrap_or(3.0),
        albedo: plugin.share("albedo", if plugin.element.is_legacy() { 0.2 } else { 0.3 })?,
        stretch: stretch.unwrap_or(1.0),
        sun_model: if plugin.element.is_legacy() { SunModel::Preetham } else { SunModel::Hosek },
    };
    let whole = scale(plugin, "scale", 1.0)?;
    let mut shines = Vec::new();
    let mut backdrop = Backdrop { image: None, sun: None };
    if plugin.kind != "sun" {
        let brightness = if plugin.kind == "sky" { whole } else { scale(plugin, "sky_scale", whole)? };
        backdrop.image = sky.image(brightness).map(|panorama| (panorama, rotation));
    }
    if plugin.kind != "sky" {
        let brightness = if plugin.kind == "sun" { whole } else { scale(plugin, "sun_scale", whole)? };
        let aperture = plugin.positive("sun_aperture")?.unwrap_or(SUN_DIAMETER);
        let radius_scale = scale(plugin, "sun_radius_scale", aperture / SUN_DIAMETER)?;
        let mut sun = sky.sun(if radius_scale > 0.0 { radius_scale } else { 1.0 }, brightness);
        sun.towards = (rotation * sun.towards).normalize();
        if radius_scale > 0.0 {
            backdrop.sun = Some(sun);
        } else {
            shines.push(Shine::Directional(sun.towards, sky.sun_irradiance(brightness)));
        }
    }
    shines.push(Shine::Backdrop(backdrop));
    Ok(shines)
}

/// Where the sun stands, in the sky's own axes with +y up: by `sun_direction` in the world, or by time and place.
fn towards(plugin: &mut Plugin<'_>, rotation: &DMat3) -> Result<DVec3, LoadError> {
    let towards = match plugin.point("sun_direction")? {
        Some(direction) => (rotation.transpose() * direction).normalize_or_zero(),
        None => when(plugin)?.towards(),
    };
    if towards.y >= 0.0 && towards != DVec3::ZERO {
        return Ok(towards);
    }
    Err(plugin.element.error("the sun stands below the horizon; expected `sun_direction`, or a time, by day"))
}

/// Time and place; where they are not given, an afternoon in Tokyo, as in Mitsuba.
fn when(plugin: &mut Plugin<'_>) -> Result<When, LoadError> {
    let mut whole = |name, default: i64, range: std::ops::RangeInclusive<i64>| {
        let expected = format!("{} to {}", range.start(), range.end());
        let value = plugin.integer(name)?.map(|value| value.check(|value| range.contains(value), &expected));
        Ok::<_, LoadError>(value.transpose()?.unwrap_or(default))
    };
    let date = [whole("year", 2010, 1900..=2100)?, whole("month", 7, 1..=12)?, whole("day", 10, 1..=31)?];
    Ok(When {
        date,
        clock: [plugin.number("hour", 15.0)?, plugin.number("minute", 0.0)?, plugin.number("second", 0.0)?],
        timezone: plugin.number("timezone", 9.0)?,
        latitude: plugin.number("latitude", 35.6894)?,
        longitude: plugin.number("longitude", 139.6917)?,
    })
}
