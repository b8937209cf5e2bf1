//! What an experiment is made of, as its TOML file has it.

use super::ReportError;
use crate::blend::{RecipeScene, Reference, repeated};
use crate::image::is_in_classes;
use crate::integrators::Method;
use crate::markov::Mutations;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// An experiment. Times are processor seconds of one thread, so that they mean the same on a busy machine.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ExperimentRecipe {
    /// Film size in pixels.
    pub size: [usize; 2],
    /// Longest path in edges; else what the scene files say.
    pub max_depth: Option<usize>,
    /// Which light is judged, if not all: that of the path classes with this in them, where D and S that repeat count once,
    /// such as `SDS`.
    pub classes: Option<String>,
    /// Independent runs of each variant.
    pub seeds: u64,
    /// Times of a run; each is a run of its own.
    pub times: Vec<f64>,
    /// How references are rendered, where a scene says nothing else; by a method without bias, if all light is judged.
    pub reference: Reference,
    /// What is compared.
    pub variants: Vec<Variant>,
    /// On what.
    pub scenes: Vec<RecipeScene>,
}

/// A method and how its chains move.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Variant {
    /// What tables and plots call it.
    pub name: String,
    /// The method.
    pub integrator: Method,
    /// How its chains move; the usual way for what is not said.
    #[serde(default)]
    pub mutations: Mutations,
}

impl ExperimentRecipe {
    /// Reads a recipe.
    ///
    /// # Errors
    /// [`ReportError::File`] with the place in the file and what was expected there.
    pub fn read(path: &Path) -> Result<Self, ReportError> {
        let fail = |message: String| ReportError::File { name: path.display().to_string(), message };
        let text = std::fs::read_to_string(path).map_err(|error| fail(error.to_string()))?;
        let recipe: Self = toml::from_str(&text).map_err(|error| fail(error.to_string()))?;
        let positive = |time: f64| time > 0.0 && time <= 1e7;
        if recipe.times.is_empty() || !recipe.times.iter().all(|time| positive(*time)) {
            return Err(fail("`times`: expected at least one time above 0, at most 1e7".into()));
        }
        if recipe.seeds < 2 {
            return Err(fail("`seeds`: expected at least 2, or nothing could be said of the spread".into()));
        }
        if recipe.classes.as_ref().is_some_and(|classes| !is_in_classes(classes)) {
            return Err(fail("`classes`: expected letters of L, D, S and E, such as `SDS`".into()));
        }
        if recipe.scenes.is_empty() || recipe.variants.is_empty() {
            return Err(fail("expected at least one scene in `scenes` and one variant in `variants`".into()));
        }
        for reference in recipe.scenes.iter().filter_map(|scene| scene.reference).chain([recipe.reference]) {
            // Light of some classes is found by photons alone; their bias is small after a long time.
            let biased = matches!(reference.integrator, Method::Sppm | Method::Vcm) && recipe.classes.is_none();
            if biased || !positive(reference.time) {
                return Err(fail("a reference needs a method without bias and a time above 0, at most 1e7".into()));
            }
        }
        RecipeScene::tell_apart(&recipe.scenes).map_err(fail)?;
        if let Some(name) = repeated(recipe.variants.iter().map(|variant| variant.name.clone())) {
            return Err(fail(format!("two variants are called `{name}`; expected one")));
        }
        for variant in &recipe.variants {
            variant.mutations.checked().map_err(|error| fail(format!("variant `{}`: {error}", variant.name)))?;
        }
        Ok(recipe)
    }
}
