//! Refractive indices by name: Mitsuba's table, most of it from Hecht, *Optics*, 4th edition (0 to 20 °C, 589 nm).

use super::error::{LoadError, one_of};
use super::plugin::Plugin;

const INDICES: [(&str, f64); 23] = [
    ("vacuum", 1.0),
    ("helium", 1.000036),
    ("hydrogen", 1.000132),
    ("air", 1.000277),
    ("carbon dioxide", 1.00045),
    ("water", 1.333),
    ("acetone", 1.36),
    ("ethanol", 1.361),
    ("carbon tetrachloride", 1.461),
    ("glycerol", 1.4729),
    ("benzene", 1.501),
    ("silicone oil", 1.52045),
    ("bromine", 1.661),
    ("water ice", 1.31),
    ("fused quartz", 1.458),
    ("pyrex", 1.47),
    ("acrylic glass", 1.49),
    ("polypropylene", 1.49),
    ("bk7", 1.5046),
    ("sodium chloride", 1.544),
    ("amber", 1.55),
    ("pet", 1.575),
    ("diamond", 2.419),
];

/// The index of a material by its name, in upper or lower case.
fn named(name: &str) -> Option<f64> {
    INDICES.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|(_, index)| *index)
}

/// The parameter `name`, a positive number or the name of a material; `default` where it is not given.
pub(super) fn read(plugin: &mut Plugin<'_>, name: &'static str, default: f64) -> Result<f64, LoadError> {
    let Some(parameter) = plugin.float_or_string(name)? else {
        return Ok(default);
    };
    let index = named(parameter.value.text).or_else(|| parameter.value.number().ok());
    index.filter(|index| *index > 0.0).ok_or_else(|| {
        let names = INDICES.map(|(name, _)| name);
        parameter.refuse(&format!("a number above 0 or {}", one_of(&names)))
    })
}

/// Index of the glass that Mitsuba takes for the inside.
pub(super) const BK7: f64 = 1.5046;

/// Index of the air that Mitsuba takes for the outside.
pub(super) const AIR: f64 = 1.000277;

/// Index of the plastic that Mitsuba takes for the inside.
pub(super) const POLYPROPYLENE: f64 = 1.49;
