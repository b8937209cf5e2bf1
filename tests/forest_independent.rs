//! The forest against smartcore's regressors, which were written by others, on the same data.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use pathblend::forest::{Quality, Rows, Settings, train};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use smartcore::ensemble::random_forest_regressor::{RandomForestRegressor, RandomForestRegressorParameters};
use smartcore::linalg::basic::matrix::DenseMatrix;
use smartcore::tree::decision_tree_regressor::{DecisionTreeRegressor, DecisionTreeRegressorParameters};

const FEATURES: usize = 5;

/// Points in the unit cube and a smooth function of them with a little noise, in [0, 1].
fn data(count: usize, seed: u64) -> (Rows, DenseMatrix<f64>, Vec<f64>) {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut rows = Rows::new();
    let columns: Vec<u16> = (0..FEATURES).map(|f| rows.feature(&format!("f{f}")).unwrap()).collect();
    let (mut points, mut targets) = (Vec::new(), Vec::new());
    for _ in 0..count {
        let x: Vec<f32> = (0..FEATURES).map(|_| random.random()).collect();
        let smooth = 0.5 + 0.25 * (3.0 * x[0]).sin() * x[1] - 0.2 * x[2] * x[2] + 0.1 * x[3];
        let target = smooth + 0.05 * (random.random::<f32>() - 0.5);
        let entries: Vec<(u16, f32)> = columns.iter().copied().zip(x.iter().copied()).collect();
        rows.push(&entries, target, 1.0, 0).unwrap();
        points.push(x.iter().map(|&v| f64::from(v)).collect::<Vec<f64>>());
        targets.push(f64::from(target));
    }
    (rows, DenseMatrix::from_2d_vec(&points).unwrap(), targets)
}

fn mse(predictions: &[f64], rows: &Rows) -> f64 {
    let predictions: Vec<f32> = predictions.iter().map(|&p| p as f32).collect();
    Quality::of(&predictions, rows).unwrap().mse
}

#[test]
fn one_tree_is_as_good_as_smartcores() {
    let (rows, x, y) = data(4000, 1);
    let (test, test_x, _) = data(4000, 2);
    // smartcore's depth counts nodes on the way down, ours splits.
    let parameters = DecisionTreeRegressorParameters::default().with_max_depth(9).with_min_samples_leaf(10);
    let theirs = DecisionTreeRegressor::fit(&x, &y, parameters).unwrap().predict(&test_x).unwrap();
    let settings = Settings {
        trees: 1,
        max_depth: 8,
        min_rows: 10,
        min_weight: 0.0,
        bootstrap: false,
        refinement: 0.0,
        ..Settings::default()
    };
    let ours = Quality::of(&train(&rows, &settings).unwrap().predict(&test), &test).unwrap();
    let ratio = ours.mse / mse(&theirs, &test);
    println!("tree: mse {} against smartcore's {}: ratio {ratio}", ours.mse, mse(&theirs, &test));
    assert!((0.93..1.07).contains(&ratio), "{ratio}");
    assert!(ours.r2 > 0.8);
}

#[test]
fn a_forest_is_as_good_as_smartcores() {
    let (rows, x, y) = data(4000, 3);
    let (test, test_x, _) = data(4000, 4);
    let parameters = RandomForestRegressorParameters::default()
        .with_n_trees(10)
        .with_m(FEATURES)
        .with_max_depth(13)
        .with_min_samples_leaf(5);
    let theirs = RandomForestRegressor::fit(&x, &y, parameters).unwrap().predict(&test_x).unwrap();
    let settings = Settings {
        trees: 10,
        max_depth: 12,
        max_leaves: 10_000,
        min_rows: 5,
        min_weight: 0.0,
        refinement: 0.0,
        ..Settings::default()
    };
    let ours = Quality::of(&train(&rows, &settings).unwrap().predict(&test), &test).unwrap();
    let ratio = ours.mse / mse(&theirs, &test);
    println!("forest: mse {} against smartcore's {}: ratio {ratio}", ours.mse, mse(&theirs, &test));
    assert!((0.93..1.07).contains(&ratio), "{ratio}");
}
