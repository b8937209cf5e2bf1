//! The model file: round trips, and refusals that never panic.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::path::Path;

use pathblend::forest::{ForestError, Model, Rows, Settings, train};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde_json::{Value, json};

fn model(count: usize, settings: &Settings) -> (Rows, Model) {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
    let mut rows = Rows::new();
    let columns: Vec<u16> = (0..100).map(|f| rows.feature(&format!("path_LDSDSDS{f}")).unwrap()).collect();
    for i in 0..count {
        let entries: Vec<(u16, f32)> =
            columns.iter().filter(|c| *c % 7 == 0 || random.random_bool(0.1)).map(|&c| (c, 0.0)).collect();
        let entries: Vec<(u16, f32)> = entries.into_iter().map(|(c, _)| (c, random.random::<f32>().powi(4))).collect();
        rows.push(&entries, random.random(), random.random(), i as u32 % 5).unwrap();
    }
    let forest = train(&rows, settings).unwrap();
    let mut model = Model::new(["mmlt".into(), "sppm".into()], &rows, forest);
    model.settings = serde_json::to_value(settings).unwrap().as_object().unwrap().clone();
    model.held_out = json!([{"scene": "box", "rmse": 0.0358}]);
    (rows, model)
}

fn small() -> (Rows, Model) {
    model(300, &Settings { max_leaves: 8, ..Settings::default() })
}

#[test]
fn what_is_saved_is_what_is_loaded() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.json");
    let (rows, model) = model(20_000, &Settings::default());
    model.save(&path).unwrap();
    let loaded = Model::load(&path).unwrap();
    assert_eq!(loaded, model);
    assert_eq!(loaded.forest.predict(&rows), model.forest.predict(&rows));
    assert_eq!(loaded.training_hash, rows.hash());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_full_model_fits_in_100_kilobytes() {
    let (_, model) = model(60_000, &Settings { max_depth: 60, min_rows: 2, min_weight: 0.0, ..Settings::default() });
    assert!(model.forest.trees().iter().all(|t| t.leaves() == 700));
    let bytes = model.to_json(Path::new("m")).unwrap().len();
    println!("5 trees of 700 leaves over 100 features: {bytes} bytes");
    assert!(bytes <= 100_000, "{bytes}");
}

#[test]
fn saving_into_nowhere_says_where() {
    let error = small().1.save(Path::new("/nonexistent/m.json")).unwrap_err();
    assert!(error.to_string().contains("/nonexistent/m.json"), "{error}");
    assert!(matches!(Model::load(Path::new("/nonexistent/m.json")), Err(ForestError::Io { .. })));
}

fn edited(edit: impl FnOnce(&mut Value)) -> Result<Model, ForestError> {
    let text = small().1.to_json(Path::new("m")).unwrap();
    let mut value: Value = serde_json::from_str(&text).unwrap();
    edit(&mut value);
    Model::from_json(&value.to_string(), Path::new("models/m"))
}

/// A tree that is one long branch.
fn chain(splits: usize) -> Value {
    let mut feature = vec![0; splits];
    feature.resize(2 * splits + 1, -1);
    json!({"feature": feature, "value": vec![0.5; 2 * splits + 1]})
}

#[test]
fn each_kind_of_damage_is_named() {
    assert!(edited(|_| ()).is_ok());
    assert!(edited(|v| v["trees"][0] = chain(64)).is_ok());
    let error = edited(|v| v["version"] = json!(2)).unwrap_err();
    assert!(matches!(error, ForestError::Version { found: 2, expected: 1, .. }));
    let cases: Vec<(&str, Result<Model, ForestError>)> = vec![
        ("format `other`", edited(|v| v["format"] = json!("other"))),
        ("missing field `features`", edited(|v| drop(v.as_object_mut().unwrap().remove("features")))),
        ("unknown field `extra`", edited(|v| v["extra"] = json!(1))),
        ("asks for feature 100", edited(|v| v["trees"][0]["feature"][0] = json!(100))),
        ("asks for feature -2", edited(|v| v["trees"][0]["feature"][0] = json!(-2))),
        ("tree 1: the tree is complete after 1", edited(|v| v["trees"][1]["feature"][0] = json!(-1))),
        ("the tree ends after 1 nodes", edited(|v| v["trees"][0] = json!({"feature": [3], "value": [0.5]}))),
        ("as many of one", edited(|v| v["trees"][0] = json!({"feature": [], "value": []}))),
        ("as many of one", edited(|v| drop(v["trees"][0]["value"].as_array_mut().unwrap().pop()))),
        ("leaf of value 1.5", edited(|v| v["trees"][0] = json!({"feature": [-1], "value": [1.5]}))),
        ("threshold inf", edited(|v| v["trees"][0] = json!({"feature": [0, -1, -1], "value": [1e300, 0.5, 0.5]}))),
        ("65 splits on the way", edited(|v| v["trees"][0] = chain(65))),
        ("no trees", edited(|v| v["trees"] = json!([]))),
        ("twice", edited(|v| v["features"][1] = v["features"][0].clone())),
        ("invalid length 1", edited(|v| v["integrators"] = json!(["mmlt"]))),
        ("invalid type", edited(|v| v["trees"][0]["value"][0] = json!("x"))),
    ];
    for (message, result) in cases {
        let error = result.expect_err(message).to_string();
        assert!(
            error.contains(message) && error.starts_with("models/m: ") && error.contains("expected"),
            "{message}: {error}"
        );
    }
}

#[test]
fn no_truncation_or_flipped_byte_panics() {
    let (rows, model) = small();
    let text = model.to_json(Path::new("m")).unwrap();
    for end in (0..text.len() - 3).step_by(13) {
        assert!(Model::from_json(&text[..end], Path::new("m")).is_err(), "cut at {end}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.json");
    let mut random = Xoshiro256PlusPlus::seed_from_u64(5);
    let (mut refused, tries) = (0, 3000);
    for _ in 0..tries {
        let mut bytes = text.clone().into_bytes();
        for _ in 0..random.random_range(1..4) {
            let at = random.random_range(0..bytes.len());
            bytes[at] = random.random();
        }
        std::fs::write(&path, bytes).unwrap();
        match Model::load(&path) {
            // A changed digit is still a model, and must then predict within bounds.
            Ok(model) => assert!(model.forest.predict(&rows).iter().all(|p| (0.0..=1.0).contains(p))),
            Err(error) => {
                refused += 1;
                assert!(error.to_string().contains("m.json"));
            }
        }
    }
    assert!(refused > tries / 2, "{refused}");
}
