//! Speed at campaign size; run with `cargo test --release --test forest_speed -- --ignored --nocapture`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::time::{Duration, Instant};

use ndarray::Array2;
use pathblend::blend::{Classes, Input, apply, weight_map};
use pathblend::forest::{Model, Rows, Settings, train};
use pathblend::image::{Image, Layer};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde_json::json;

fn rows(count: usize, features: u16, random: &mut Xoshiro256PlusPlus) -> Rows {
    let mut rows = Rows::new();
    for f in 0..features {
        rows.feature(&format!("path_{f}")).unwrap();
    }
    let mut entries = Vec::new();
    for i in 0..count {
        entries.clear();
        entries.extend((0..features).filter(|f| f % 20 == 0 || random.random_bool(0.12)).map(|f| (f, 0.0f32)));
        entries.iter_mut().for_each(|e| e.1 = random.random::<f32>().powi(3));
        let sum: f32 = entries.iter().map(|e| e.1).sum();
        entries.iter_mut().for_each(|e| e.1 /= sum);
        let target = (entries.iter().take(4).map(|e| e.1).sum::<f32>() + 0.5 * random.random::<f32>()).min(1.0);
        rows.push(&entries, target, random.random(), i as u32 % 8).unwrap();
    }
    rows
}

fn image(classes: usize, random: &mut Xoshiro256PlusPlus) -> Image {
    let (width, height) = (1280, 720);
    let mut image = Image::new(width, height);
    image.colour.iter_mut().for_each(|v| *v = random.random());
    for k in 0..classes {
        let plane = Array2::from_shape_simple_fn((height, width), || {
            if k % 20 == 0 || random.random_bool(0.12) { random.random::<f32>().powi(3) } else { 0.0 }
        });
        image.layers.insert(format!("path_{k}"), Layer::Luminance(plane));
    }
    image
}

fn best_of(tries: usize, mut f: impl FnMut()) -> Duration {
    let mut once = || {
        let start = Instant::now();
        f();
        start.elapsed()
    };
    (0..tries).map(|_| once()).min().unwrap()
}

#[test]
#[ignore = "measures time"]
fn training_on_half_a_million_rows() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
    let rows = rows(500_000, 100, &mut random);
    let nonzero: usize = (0..rows.len()).map(|r| rows.entries(r).0.len()).sum();
    let start = Instant::now();
    let forest = train(&rows, &Settings::default()).unwrap();
    let time = start.elapsed();
    let leaves: Vec<usize> = forest.trees().iter().map(|t| t.leaves()).collect();
    println!("{} rows, {nonzero} non-zero entries, leaves {leaves:?}: {time:?}", rows.len());
    assert!(time < Duration::from_secs(60));
}

#[test]
#[ignore = "measures time"]
fn blending_a_720p_pair() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(2);
    let rows = rows(100_000, 60, &mut random);
    let forest = train(&rows, &Settings::default()).unwrap();
    let mut model = Model::new(["a".into(), "b".into()], &rows, forest);
    model.settings.insert("features".into(), json!("mean"));
    let (a, b) = (image(60, &mut random), image(60, &mut random));
    let (a, b) = (Input::new("a", &a), Input::new("b", &b));
    let threads = rayon::current_num_threads();
    let weights = best_of(10, || drop(weight_map(&model, a, b).unwrap()));
    let start = cpu_time::ProcessTime::now();
    weight_map(&model, a, b).unwrap();
    let cpu = start.elapsed();
    let whole = |classes: Classes| best_of(10, || drop(apply(&model, a, b, classes).unwrap()));
    let (colour, all) = (whole(Classes::Drop), whole(Classes::Blend));
    println!(
        "1280×720, 60 classes, {threads} threads: weights {weights:?} ({cpu:?} of processor time), blend {colour:?}, with all layers {all:?}"
    );
}
