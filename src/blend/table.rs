//! The leave-one-out table: errors per scene, as data and as text.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::forest::Quality;

/// Root mean squared errors on one scene, over all pixels, channels and runs. "By forest" means a forest that did not see
/// this scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SceneErrors {
    /// The scene.
    pub scene: String,
    /// Number of pairs of images.
    pub runs: usize,
    /// The first integrator's image, which has half of the time.
    pub a: f64,
    /// The second integrator's.
    pub b: f64,
    /// The first integrator's image with the whole time, where one was given.
    pub a_alone: Option<f64>,
    /// The second integrator's.
    pub b_alone: Option<f64>,
    /// The plain average of both.
    pub average: f64,
    /// The blend by each pixel's optimal weight, which needs the reference: what no blend can beat.
    pub optimal: f64,
    /// The blend by forest, objective [`super::Objective::Plain`].
    pub forest_plain: f64,
    /// The blend by forest, objective [`super::Objective::ErrorWeighted`].
    pub forest_error_weighted: f64,
    /// The blend by forest, objective [`super::Objective::BlendError`].
    pub forest_blend_error: f64,
    /// The blend by the linear baseline, objective [`super::Objective::BlendError`].
    pub linear: f64,
    /// How well the forest of the plain objective predicts optimal weights of the scene's rows.
    pub weights: Option<Quality>,
}

/// Errors on all scenes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Table {
    /// The two methods, in the order of the weights.
    pub integrators: [String; 2],
    /// One entry per scene.
    pub scenes: Vec<SceneErrors>,
}

impl fmt::Display for Table {
    /// Plain text: the errors, then (in brackets) those of the forest as a share of the average's.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b] = &self.integrators;
        let alone = |name: &str| format!("{name} alone");
        let names = [a, b, &alone(a), &alone(b), "average", "optimal", "linear", "f.plain", "f.weighted", "f.blend"];
        let width = self.scenes.iter().map(|s| s.scene.chars().count()).chain([5]).max().unwrap_or(5);
        write!(f, "{:width$}", "scene")?;
        for name in names {
            write!(f, "  {name:>10}")?;
        }
        writeln!(f, "  f.blend/average")?;
        for s in &self.scenes {
            write!(f, "{:width$}", s.scene)?;
            let some = [Some(s.a), Some(s.b), s.a_alone, s.b_alone, Some(s.average), Some(s.optimal), Some(s.linear)];
            let forests = [s.forest_plain, s.forest_error_weighted, s.forest_blend_error].map(Some);
            for value in some.into_iter().chain(forests) {
                match value {
                    Some(value) => write!(f, "  {value:>10.5}")?,
                    None => write!(f, "  {:>10}", "-")?,
                }
            }
            writeln!(f, "  {:>15.3}", s.forest_blend_error / s.average)?;
        }
        Ok(())
    }
}
