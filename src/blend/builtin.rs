//! The model that is built into the program.

use super::BlendError;
use crate::forest::Model;
use std::path::Path;

/// The model of `models/default.json`.
///
/// # Errors
/// None for a program that was built from a sound tree; a test reads the model.
pub fn builtin() -> Result<Model, BlendError> {
    Ok(Model::from_json(include_str!("../../models/default.json"), Path::new("the built-in model"))?)
}
