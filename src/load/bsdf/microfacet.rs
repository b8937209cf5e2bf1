//! Parameters of microfacet distributions.

use crate::bsdf::{Distribution, RoughCoat, Roughness};
use crate::load::document::Element;
use crate::load::error::LoadError;
use crate::load::plugin::Plugin;
use crate::texture::Number;
use std::cell::RefCell;

/// Roughness α where it is not given.
const ALPHA: f64 = 0.1;

/// The coats that one load has tabulated: many surfaces of a scene share a coat.
#[derive(Default)]
pub(in crate::load) struct Coats(RefCell<Vec<RoughCoat>>);

/// The coat of index `eta` whose one α is the same everywhere.
pub(super) fn coat(plugin: &mut Plugin<'_>, eta: f64) -> Result<RoughCoat, LoadError> {
    let facets = (distribution(plugin)?, plugin.positive("alpha")?.unwrap_or(ALPHA), visible(plugin)?);
    let mut known = plugin.element.document.coats.0.borrow_mut();
    if let Some(coat) = known.iter().find(|coat| coat.is_of(eta, facets)) {
        return Ok(coat.clone());
    }
    let coat = RoughCoat::new(eta, facets);
    known.push(coat.clone());
    Ok(coat)
}

/// A distribution whose α may be two numbers and textures.
pub(super) fn roughness(plugin: &mut Plugin<'_>) -> Result<Roughness, LoadError> {
    let distribution = distribution(plugin)?;
    let visible = visible(plugin)?;
    let (alpha_u, alpha_v) = if plugin.is_given("alpha_u") || plugin.is_given("alpha_v") {
        if plugin.is_given("alpha") {
            return Err(plugin.element.error("both `alpha` and `alpha_u`, `alpha_v`; expected one or the other"));
        }
        (alpha(plugin, "alpha_u")?, alpha(plugin, "alpha_v")?)
    } else {
        let both = alpha(plugin, "alpha")?;
        (both.clone(), both)
    };
    Ok(Roughness { distribution, alpha_u, alpha_v, visible })
}

fn distribution(plugin: &mut Plugin<'_>) -> Result<Distribution, LoadError> {
    let Some(name) = plugin.string("distribution")? else {
        return Ok(Distribution::Beckmann);
    };
    match name.value.text {
        "beckmann" => Ok(Distribution::Beckmann),
        "ggx" => Ok(Distribution::Ggx),
        _ => Err(name.refuse("one of beckmann, ggx")),
    }
}

/// Whether only visible normals are sampled, as is the default.
fn visible(plugin: &mut Plugin<'_>) -> Result<bool, LoadError> {
    let named = plugin.is_given("sample_visible");
    Ok(plugin.boolean("sample_visible")? || !named)
}

fn alpha(plugin: &mut Plugin<'_>, name: &'static str) -> Result<Number, LoadError> {
    let constant = |child: Element<'_>| {
        ["float", "integer"].contains(&child.tag()) && child.attribute("name").is_some_and(|text| text.text == name)
    };
    if plugin.element.children().any(constant) {
        return Ok(plugin.positive(name)?.unwrap_or(ALPHA).into());
    }
    plugin.number_texture(name, ALPHA)
}
