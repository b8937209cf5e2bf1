//! Weighted ridge regression: the baseline beside which a user sees what the forest buys.

use smartcore::linalg::basic::arrays::{Array, Array2};
use smartcore::linalg::basic::matrix::DenseMatrix;
use smartcore::linalg::traits::cholesky::CholeskyDecomposable;

use super::{ForestError, Rows};

/// Penalty on each coefficient relative to the mean of its feature's square; it only keeps features that
/// always occur together, or never, from making the equations singular.
const RIDGE: f64 = 1e-6;

/// A straight line in the features, clamped to [0, 1].
#[derive(Debug, Clone, PartialEq)]
pub struct Linear {
    features: Vec<String>,
    coefficients: Vec<f64>,
    intercept: f64,
}

impl Linear {
    /// Weighted least squares over all rows, Σ w (b + c·x − y)², by smartcore's Cholesky solver on the normal equations:
    /// they are gathered from the sparse rows, because the dense table that smartcore's own ridge regression takes would be gigabytes.
    ///
    /// # Errors
    /// [`ForestError::NoRows`] without a row of positive weight, [`ForestError::Linear`] if the equations have no solution.
    pub fn fit(rows: &Rows) -> Result<Self, ForestError> {
        let total: f64 = rows.weights().iter().map(|&w| f64::from(w)).sum();
        if total <= 0.0 {
            return Err(ForestError::NoRows { rows: rows.len() });
        }
        let n = rows.features().len() + 1;
        let (mut gram, right) = normal_equations(rows, n);
        let trace: f64 = (0..n).map(|i| gram[i * n + i]).sum();
        for i in 0..n - 1 {
            gram[i * n + i] += RIDGE * gram[i * n + i] + 1e-12 * trace;
        }
        let failed = |e: smartcore::error::Failed| ForestError::Linear(e.to_string());
        let gram = DenseMatrix::new(n, n, gram, false).map_err(failed)?;
        let right = DenseMatrix::from_iterator(right.into_iter(), n, 1, 0);
        let solution = gram.cholesky_solve_mut(right).map_err(failed)?;
        let coefficients: Vec<f64> = (0..n).map(|i| *solution.get((i, 0))).collect();
        if coefficients.iter().any(|c| !c.is_finite()) {
            return Err(ForestError::Linear("a coefficient is not finite".into()));
        }
        let intercept = coefficients[n - 1];
        Ok(Self { features: rows.features().to_vec(), coefficients: coefficients[..n - 1].to_vec(), intercept })
    }

    /// Names of the features, by column.
    pub fn features(&self) -> &[String] {
        &self.features
    }

    /// Prediction in [0, 1] for features given by column.
    pub fn predict_with(&self, value: impl Fn(u16) -> f32) -> f32 {
        let terms = self.coefficients.iter().enumerate().map(|(f, c)| c * f64::from(value(f as u16)));
        (self.intercept + terms.sum::<f64>()).clamp(0.0, 1.0) as f32
    }
}

/// XᵀWX (n × n, row by row) and XᵀWy, with a last feature that is always 1.
fn normal_equations(rows: &Rows, n: usize) -> (Vec<f64>, Vec<f64>) {
    let (mut gram, mut right) = (vec![0.0f64; n * n], vec![0.0f64; n]);
    for row in 0..rows.len() {
        let (weight, target) = (f64::from(rows.weights()[row]), f64::from(rows.targets()[row]));
        let (columns, values) = rows.entries(row);
        let entries = columns.iter().map(|&c| usize::from(c)).zip(values.iter().map(|&v| f64::from(v)));
        let entries: Vec<(usize, f64)> = entries.chain([(n - 1, 1.0)]).collect();
        for &(i, x) in &entries {
            right[i] += weight * x * target;
            for &(j, y) in &entries {
                gram[i * n + j] += weight * x * y;
            }
        }
    }
    (gram, right)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;
    use rand::{RngExt, SeedableRng};
    use smartcore::linear::ridge_regression::{RidgeRegression, RidgeRegressionParameters};

    #[test]
    fn agrees_with_smartcores_own_ridge_regression() {
        let mut random = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(3);
        let mut rows = Rows::new();
        let columns: Vec<u16> = (0..4).map(|i| rows.feature(&format!("f{i}")).unwrap()).collect();
        let (mut x, mut y) = (Vec::new(), Vec::new());
        for _ in 0..400 {
            let point: Vec<f32> = (0..4).map(|_| random.random::<f32>() / 4.0).collect();
            let target = 0.1 + 0.5 * point[0] + 0.3 * point[1] + 0.01 * random.random::<f32>();
            let entries: Vec<(u16, f32)> = columns.iter().copied().zip(point.iter().copied()).collect();
            rows.push(&entries, target, 1.0, 0).unwrap();
            x.push(point.iter().map(|&v| f64::from(v)).collect::<Vec<f64>>());
            y.push(f64::from(target));
        }
        let ours = Linear::fit(&rows).unwrap();
        let x = DenseMatrix::from_2d_vec(&x).unwrap();
        let parameters = RidgeRegressionParameters::default().with_alpha(1e-6);
        let theirs = RidgeRegression::fit(&x, &y, parameters).unwrap().predict(&x).unwrap();
        for (row, expected) in theirs.iter().enumerate() {
            let found = ours.predict_with(|f| rows.value(row, f));
            assert!((f64::from(found) - expected).abs() < 1e-4, "row {row}: {found} {expected}");
        }
    }

    #[test]
    fn useless_features_do_no_harm() {
        let mut rows = Rows::new();
        let (a, b) = (rows.feature("a").unwrap(), rows.feature("b").unwrap());
        rows.feature("never").unwrap();
        for i in 0..10 {
            let v = i as f32 / 10.0;
            rows.push(&[(a, v), (b, v)], v, 1.0, 0).unwrap();
        }
        let line = Linear::fit(&rows).unwrap();
        assert!((line.predict_with(|_| 0.5) - 0.5).abs() < 1e-3);
        assert!(matches!(Linear::fit(&Rows::new()), Err(ForestError::NoRows { rows: 0 })));
    }
}
