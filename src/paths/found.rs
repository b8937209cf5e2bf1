//! What a chain knows of its path.

use super::mis::{Heuristic, Techniques};
use crate::film::PathClass;
use crate::spectrum::Spectrum;
use glam::DVec2;

/// The primary samples of a path do not know where its light is to arrive: lights are chosen by power.
pub const TECHNIQUES: Techniques = Techniques::connections(Heuristic::Power);

/// A path as the film and the chain see it.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    /// Weighted contribution over density, times the number of techniques.
    pub value: Spectrum,
    /// Luminance of `value`: the chain's target.
    pub luminance: f64,
    /// Its class.
    pub class: PathClass,
    /// Film position.
    pub film: DVec2,
    /// Light vertices of the technique.
    pub technique: usize,
}
