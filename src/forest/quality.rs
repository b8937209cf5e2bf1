//! How well predictions match held-out targets, by linfa's regression metrics.

use linfa::prelude::SingleTargetRegression;
use ndarray::Array1;
use serde::{Deserialize, Serialize};

use super::{ForestError, Rows};

/// Figures of merit of predictions against the targets of held-out rows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Number of rows.
    pub rows: usize,
    /// Mean squared error.
    pub mse: f64,
    /// Mean absolute error.
    pub mae: f64,
    /// Coefficient of determination R²: 1 is perfect, 0 as good as the targets' mean, negative worse.
    pub r2: f64,
}

impl Quality {
    /// Compares `predictions` with the targets of the `rows`; each row of positive weight counts once.
    ///
    /// # Errors
    /// [`ForestError::Quality`] if the lengths differ or no row has a positive weight.
    pub fn of(predictions: &[f32], rows: &Rows) -> Result<Self, ForestError> {
        if predictions.len() != rows.len() {
            let what = format!("{} predictions for {} rows", predictions.len(), rows.len());
            return Err(ForestError::Quality(what));
        }
        let counted = |values: &[f32]| -> Array1<f64> {
            let pairs = values.iter().zip(rows.weights());
            pairs.filter(|(_, weight)| **weight > 0.0).map(|(&v, _)| f64::from(v)).collect()
        };
        let (found, expected) = (counted(predictions), counted(rows.targets()));
        let failed = |e: linfa::error::Error| ForestError::Quality(e.to_string());
        Ok(Self {
            rows: found.len(),
            mse: found.mean_squared_error(&expected).map_err(failed)?,
            mae: found.mean_absolute_error(&expected).map_err(failed)?,
            r2: found.r2(&expected).map_err(failed)?,
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;

    #[test]
    fn figures_match_a_hand_computation() {
        let mut rows = Rows::new();
        for (target, weight) in [(0.0, 1.0), (1.0, 1.0), (0.3, 0.0)] {
            rows.push(&[], target, weight, 0).unwrap();
        }
        let quality = Quality::of(&[0.1, 0.7, 0.9], &rows).unwrap();
        // Errors 0.1 and 0.3; the targets' variance about 0.5 is 0.25 each.
        assert_eq!(quality.rows, 2);
        assert!((quality.mse - 0.05).abs() < 1e-6);
        assert!((quality.mae - 0.2).abs() < 1e-6);
        assert!((quality.r2 - 0.8).abs() < 1e-6);
        assert!(Quality::of(&[0.1], &rows).is_err());
        assert!(Quality::of(&[], &Rows::new()).is_err());
    }
}
