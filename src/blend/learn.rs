//! From rows to a model.

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::{BlendError, RowSettings};
use crate::forest::{self, ForestError, Model, Rows, Settings};

/// What the forest is to get right.
///
/// Rows come with the unclamped least-squares weight q and the stake s = |I_a − I_b|² of their pixel; the blend's squared
/// error there is s (w − q)² plus a constant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Objective {
    /// The weight itself, as in the papers: target q clamped to [0, 1], all rows alike. Pixels where nothing is at stake
    /// have as much to say as the worst ones.
    Plain,
    /// The clamped weight where it matters: target q clamped to [0, 1], row weight s.
    ErrorWeighted,
    /// The blended image's squared error: target q as it is, row weight s; only the mean over a leaf is clamped.
    /// Clamping each row first, as above, pulls the mean away from its optimum: where both images are unbiased with noise of
    /// variance σ_a² and σ_b², the best weight is σ_b² / (σ_a² + σ_b²), and that is Σ s q / Σ s, but not Σ s clamp(q) / Σ s.
    #[default]
    BlendError,
}

impl Objective {
    /// All of them, in the order of the papers' to ours.
    pub const ALL: [Objective; 3] = [Objective::Plain, Objective::ErrorWeighted, Objective::BlendError];

    /// The rows with the outcomes that this objective regresses, every scene with the same total weight.
    ///
    /// # Errors
    /// None for rows that [`super::append`] made.
    pub fn outcomes(self, rows: Rows) -> Result<Rows, ForestError> {
        let outcome = |q: f32, stake: f32| match self {
            Self::Plain => (q.clamp(0.0, 1.0), if stake > 0.0 { 1.0 } else { 0.0 }),
            Self::ErrorWeighted => (q.clamp(0.0, 1.0), stake),
            Self::BlendError => (q, stake),
        };
        Ok(rows.map_outcomes(outcome)?.balance_groups())
    }
}

/// Trains a model on rows made by [`super::append`] with `row_settings`. The model records all settings; the caller adds
/// held-out errors.
///
/// # Errors
/// Those of [`forest::train`].
pub fn train(
    rows: Rows,
    integrators: [String; 2],
    objective: Objective,
    row_settings: &RowSettings,
    settings: &Settings,
) -> Result<Model, BlendError> {
    let rows = objective.outcomes(rows)?;
    let forest = forest::train(&rows, settings)?;
    let mut model = Model::new(integrators, &rows, forest);
    model.settings.insert("features".into(), json!(row_settings.features));
    model.settings.insert("objective".into(), json!(objective));
    model.settings.insert("rows".into(), json!(row_settings));
    model.settings.insert("forest".into(), json!(settings));
    Ok(model)
}
