//! What directives change and blocks restore.

use super::light::AreaLight;
use super::params::Param;
use glam::DAffine3;

/// The state of the scene description.
#[derive(Clone, Default)]
pub(super) struct State {
    /// From the current space to the world; before the world begins, from the world to the camera.
    pub transform: DAffine3,
    /// Whether surfaces have been turned over.
    pub reversed: bool,
    /// Whether transformations apply to the start of the shutter's interval, the only one that is kept.
    pub at_end_only: bool,
    /// Index of the current material.
    pub material: Option<usize>,
    /// What the following shapes radiate.
    pub area: Option<AreaLight>,
    /// Parameters for all directives of a kind (`Attribute`).
    pub defaults: Vec<(String, Vec<Param>)>,
}

impl State {
    /// The parameters that were set for all directives of the kind.
    pub fn defaults_of(&self, kind: &str) -> Vec<Param> {
        let mine = self.defaults.iter().rev().filter(|(target, _)| target == kind);
        mine.flat_map(|(_, params)| params.iter().cloned()).collect()
    }
}
