//! Laws that every forest must keep.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use pathblend::forest::{ForestError, Rows, Settings, SplitBy, train};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Rows of `features` mostly-zero features of 50 levels each (so that every level has its bin); the target follows the
/// first two.
fn sparse(count: usize, features: u16, seed: u64) -> Rows {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut rows = Rows::new();
    (0..features).for_each(|f| assert_eq!(rows.feature(&format!("f{f}")).unwrap(), f));
    for i in 0..count {
        let mut entries: Vec<(u16, f32)> = Vec::new();
        for f in 0..features {
            if f < 2 || random.random_bool(0.1) {
                entries.push((f, random.random_range(1..=50) as f32 / 50.0));
            }
        }
        let target = 0.2 + 0.6 * entries[0].1 * entries[1].1 + 0.1 * random.random::<f32>();
        rows.push(&entries, target, random.random(), (i % 4) as u32).unwrap();
    }
    rows
}

/// One tree that follows its rows as closely as it can.
fn exact() -> Settings {
    Settings { trees: 1, min_rows: 1, min_weight: 0.0, bootstrap: false, refinement: 0.0, ..Settings::default() }
}

#[test]
fn predictions_stay_within_the_targets() {
    let rows = sparse(5000, 20, 1);
    let (low, high) = rows.targets().iter().fold((1.0f32, 0.0f32), |(l, h), &t| (l.min(t), h.max(t)));
    let forest = train(&rows, &Settings::default()).unwrap();
    for prediction in forest.predict(&sparse(1000, 20, 2)) {
        // Leaves are rounded to four decimals.
        assert!((low - 5e-5..=high + 5e-5).contains(&prediction), "{prediction} outside {low} to {high}");
    }
    let far = forest.predict_with(|f| if f % 2 == 0 { 1e30 } else { -1e30 });
    assert!((low - 5e-5..=high + 5e-5).contains(&far));
}

#[test]
fn a_forest_asks_for_the_heaviest_features_only() {
    let rows = sparse(3000, 20, 1);
    let used = |max_features: usize| train(&rows, &Settings { max_features, ..exact() }).unwrap().used_features();
    assert!(used(20).len() > 15);
    assert_eq!(used(2), [0, 1], "those that every row has");
    assert!(matches!(train(&rows, &Settings { max_features: 0, ..exact() }), Err(ForestError::Setting { .. })));
}

#[test]
fn targets_outside_the_unit_interval_are_averaged_before_they_are_clamped() {
    let mut rows = Rows::new();
    let x = rows.feature("x").unwrap();
    for (value, target) in [(0.0, -3.0), (0.0, 4.0), (1.0, 5.0), (1.0, -8.0)] {
        rows.push(&[(x, value)], target, 1.0, 0).unwrap();
    }
    let forest = train(&rows, &Settings { min_rows: 2, ..exact() }).unwrap();
    assert_eq!((forest.predict_with(|_| 0.0), forest.predict_with(|_| 1.0)), (0.5, 0.0));
}

#[test]
fn a_tree_reproduces_a_piecewise_constant_function() {
    let step = |x: f32, y: f32| {
        if x < 0.3 {
            0.1
        } else if y < 0.65 {
            0.75
        } else {
            0.4
        }
    };
    let mut rows = Rows::new();
    let (x, y) = (rows.feature("x").unwrap(), rows.feature("y").unwrap());
    let grid = |i: u32| i as f32 / 40.0;
    for (i, j) in (0..1600).map(|k| (k / 40, k % 40)) {
        rows.push(&[(x, grid(i)), (y, grid(j))], step(grid(i), grid(j)), 1.0, 0).unwrap();
    }
    let forest = train(&rows, &exact()).unwrap();
    assert_eq!(forest.trees()[0].leaves(), 3);
    for (row, prediction) in forest.predict(&rows).into_iter().enumerate() {
        assert_eq!(prediction, rows.targets()[row]);
    }
}

#[test]
fn weight_two_equals_the_row_twice() {
    let once = sparse(3000, 10, 5).map_outcomes(|t, w| (t, if w > 0.5 { 2.0 } else { 1.0 })).unwrap();
    let indices: Vec<u32> = (0..once.len() as u32).flat_map(|i| vec![i; once.weights()[i as usize] as usize]).collect();
    let twice = once.select(&indices).map_outcomes(|t, _| (t, 1.0)).unwrap();
    assert!(twice.len() > 4000);
    let settings = Settings { max_leaves: 60, ..exact() };
    let (a, b) = (train(&once, &settings).unwrap(), train(&twice, &settings).unwrap());
    let probe = sparse(1000, 10, 6);
    for (a, b) in a.predict(&probe).into_iter().zip(b.predict(&probe)) {
        assert!((a - b).abs() < 2e-4, "{a} {b}");
    }
    let plain = once.clone().map_outcomes(|t, _| (t, 1.0)).unwrap();
    let ignored = train(&plain, &Settings { max_leaves: 1, ..exact() }).unwrap();
    let heard = train(&once, &Settings { max_leaves: 1, ..exact() }).unwrap();
    let mean = |r: &Rows| -> f32 {
        let pairs = r.targets().iter().zip(r.weights());
        pairs.map(|(t, w)| t * w).sum::<f32>() / r.weights().iter().sum::<f32>()
    };
    assert!((heard.predict_with(|_| 0.0) - mean(&once)).abs() < 1e-4);
    assert!((ignored.predict_with(|_| 0.0) - mean(&plain)).abs() < 1e-4);
}

#[test]
fn rows_of_weight_zero_teach_nothing() {
    let rows = sparse(2000, 6, 9);
    let poisoned = rows.clone().map_outcomes(|t, w| if w < 0.3 { (1.0 - t, 0.0) } else { (t, w) }).unwrap();
    let kept: Vec<u32> = (0..rows.len() as u32).filter(|&i| rows.weights()[i as usize] >= 0.3).collect();
    let forest = train(&poisoned, &exact()).unwrap();
    assert_eq!(forest, train(&rows.select(&kept), &exact()).unwrap());
}

#[test]
fn any_number_of_threads_grows_the_same_forest() {
    let rows = sparse(20_000, 30, 11);
    let settings = Settings { features_per_split: 0.5, refine_by: SplitBy::Groups, ..Settings::default() };
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| train(&rows, &settings).unwrap())
    };
    let one = on(1);
    assert_eq!(one, on(2));
    assert_eq!(one, on(5));
    assert_ne!(one, train(&rows, &Settings { seed: 2, ..settings.clone() }).unwrap());
    assert_ne!(one.trees()[0], one.trees()[1]);
}

#[test]
fn limits_are_kept() {
    let rows = sparse(4000, 10, 13);
    for (max_depth, max_leaves) in [(0, 10), (3, 100), (15, 7), (15, 1)] {
        let settings = Settings { max_depth, max_leaves, ..Settings::default() };
        for tree in train(&rows, &settings).unwrap().trees() {
            assert!(tree.depth() <= max_depth && tree.leaves() <= max_leaves);
        }
    }
    let tree = &train(&rows, &Settings { min_rows: 300, ..exact() }).unwrap().trees()[0].clone();
    let mut rows_per_leaf = vec![0; tree.nodes().len()];
    (0..rows.len()).for_each(|r| rows_per_leaf[tree.leaf_of(|f| rows.value(r, f))] += 1);
    assert!(tree.leaves() > 4);
    assert!(rows_per_leaf.iter().all(|&n| n == 0 || n >= 300));
}

#[test]
fn refinement_helps_where_growing_overfits() {
    let noisy = |seed| sparse(3000, 10, seed);
    let error = |settings: &Settings| {
        let forest = train(&noisy(17), settings).unwrap();
        let test = noisy(18);
        let pairs = forest.predict(&test).into_iter().zip(test.targets().to_vec());
        pairs.map(|(p, t)| (p - t).powi(2)).sum::<f32>() / test.len() as f32
    };
    let grown = Settings {
        trees: 1,
        min_rows: 1,
        min_weight: 0.0,
        bootstrap: false,
        max_leaves: 1500,
        refinement: 0.0,
        ..Settings::default()
    };
    let refined = Settings { refinement: 0.5, max_leaves: 300, ..grown.clone() };
    assert!(error(&refined) < error(&grown), "{} {}", error(&refined), error(&grown));
}

#[test]
fn shrinkage_draws_every_answer_towards_one_half() {
    let rows = sparse(2000, 5, 3);
    let predict = |shrinkage| train(&rows, &Settings { shrinkage, ..Settings::default() }).unwrap().predict(&rows);
    for (full, drawn) in predict(0.0).into_iter().zip(predict(0.25)) {
        assert!((drawn - (0.5 + 0.75 * (full - 0.5))).abs() < 2e-4, "{full} {drawn}");
    }
    assert!(predict(1.0).into_iter().all(|w| w == 0.5));
}

#[test]
fn wrong_settings_and_empty_tables_are_errors() {
    let rows = sparse(10, 2, 1);
    for settings in [
        Settings { trees: 0, ..Settings::default() },
        Settings { max_leaves: 0, ..Settings::default() },
        Settings { max_depth: 65, ..Settings::default() },
        Settings { min_rows: 0, ..Settings::default() },
        Settings { min_weight: f64::NAN, ..Settings::default() },
        Settings { features_per_split: 0.0, ..Settings::default() },
        Settings { refinement: 1.0, ..Settings::default() },
    ] {
        assert!(matches!(train(&rows, &settings), Err(ForestError::Setting { .. })));
    }
    assert!(matches!(train(&Rows::new(), &exact()), Err(ForestError::NoRows { rows: 0 })));
    let weightless = rows.map_outcomes(|t, _| (t, 0.0)).unwrap();
    assert!(matches!(train(&weightless, &exact()), Err(ForestError::NoRows { rows: 10 })));
}

#[test]
fn a_single_row_and_no_features_are_enough() {
    let mut rows = Rows::new();
    rows.push(&[], 0.25, 1.0, 0).unwrap();
    for refine_by in [SplitBy::Rows, SplitBy::Groups] {
        let forest = train(&rows, &Settings { refine_by, ..Settings::default() }).unwrap();
        assert_eq!(forest.predict(&rows), [0.25]);
    }
}
