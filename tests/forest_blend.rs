//! Blending: laws, refusals, and learning on synthetic scenes whose answer is known.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use ndarray::{Array2, Array3};
use pathblend::blend::{
    BlendError, Classes, FeatureSet, Input, Objective, Options, Pair, RowSettings, append, apply, leave_one_out, train,
    weight_map,
};
use pathblend::forest::{Model, Rows, Settings};
use pathblend::image::{INTEGRATOR_KEY, Image, Layer, SCENE_KEY, luminance};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde_json::json;

const CLASSES: [&str; 3] = ["path_LDE", "path_LSDE", "path_LDDE"];

/// A pair whose images err where their bad class dominates: image a in LDE, image b in LSDE, each with unbiased noise. The
/// layers are noisy too, and add up to the image.
fn pair(width: usize, height: usize, seed: u64) -> Pair {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut images = [Image::new(width, height), Image::new(width, height)];
    let mut reference = Image::new(width, height);
    let mut layers = vec![Array2::<f32>::zeros((height, width)); 6];
    let exposure = random.random_range(0.1..10.0f32);
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let u = (x as f32 / width as f32 * 9.0 + seed as f32).sin().abs();
        let truth = [u, 1.0 - u, 0.2].map(|v| v * exposure * (1.0 + 0.5 * (y as f32 * 0.1).cos()));
        for (i, image) in images.iter_mut().enumerate() {
            let spread = if i == 0 { [0.9, 0.05, 0.1] } else { [0.05, 0.9, 0.1] };
            let mut sum = 0.0;
            for k in 0..3 {
                let noisy = truth[k] * (1.0 + spread[k] * random.random_range(-1.0..1.0f32));
                layers[3 * i + k][(y, x)] = noisy;
                sum += noisy;
            }
            (0..3).for_each(|c| image.colour[(y, x, c)] = sum);
        }
        (0..3).for_each(|c| reference.colour[(y, x, c)] = truth.iter().sum());
    }
    for (i, image) in images.iter_mut().enumerate() {
        for (k, name) in CLASSES.iter().enumerate() {
            image.layers.insert((*name).into(), Layer::Luminance(layers[3 * i + k].clone()));
        }
    }
    let [mut a, mut b] = images;
    a.manifest.insert(INTEGRATOR_KEY.into(), json!("mmlt"));
    b.manifest.insert(INTEGRATOR_KEY.into(), json!("sppm"));
    Pair { name: format!("pair {seed}"), a, b, reference, a_alone: None, b_alone: None }
}

fn inputs(pair: &Pair) -> [Input<'_>; 3] {
    [Input::new("a.exr", &pair.a), Input::new("b.exr", &pair.b), Input::new("ref.exr", &pair.reference)]
}

fn learn(features: FeatureSet, objective: Objective) -> Model {
    let settings = RowSettings { features, ..RowSettings::default() };
    let mut rows = Rows::new();
    for seed in 0..3 {
        let pair = pair(120, 80, seed);
        let [a, b, reference] = inputs(&pair);
        append(&mut rows, a, b, reference, seed as u32, &settings).unwrap();
    }
    train(rows, ["mmlt".into(), "sppm".into()], objective, &settings, &Settings::default()).unwrap()
}

fn mean() -> Model {
    learn(FeatureSet::Mean, Objective::default())
}

fn mse(image: &Image, reference: &Image) -> f64 {
    let squares = image.colour.iter().zip(&reference.colour).map(|(x, y)| f64::from(x - y).powi(2));
    squares.sum::<f64>() / image.colour.len() as f64
}

#[test]
fn blending_an_image_with_itself_is_the_identity() {
    let pair = pair(50, 31, 5);
    let mut twin = pair.a.clone();
    twin.manifest.insert(INTEGRATOR_KEY.into(), json!("sppm"));
    let out = apply(&mean(), Input::new("a", &pair.a), Input::new("b", &twin), Classes::Blend).unwrap();
    assert_eq!(out.colour, pair.a.colour);
    for name in CLASSES {
        assert_eq!(out.layers[name], pair.a.layers[name]);
    }
}

#[test]
fn weights_are_shares_and_layers_still_add_up() {
    let pair = pair(131, 37, 6);
    for set in [FeatureSet::Mean, FeatureSet::Both, FeatureSet::Difference] {
        let model = learn(set, Objective::default());
        let [a, b, _] = inputs(&pair);
        let out = apply(&model, a, b, Classes::Blend).unwrap();
        let Layer::Luminance(weights) = &out.layers["weight_mmlt"] else { panic!("no luminance") };
        assert_eq!(*weights, weight_map(&model, a, b).unwrap());
        assert!(weights.iter().all(|w| (0.0..=1.0).contains(w)));
        let (low, high) = weights.iter().fold((1.0f32, 0.0f32), |(l, h), &w| (l.min(w), h.max(w)));
        assert!(low < 0.2 && high > 0.8, "{set:?}: {low} to {high}");
        for ((y, x), &w) in weights.indexed_iter() {
            let sum: f32 = CLASSES
                .iter()
                .map(|name| match &out.layers[*name] {
                    Layer::Luminance(v) => v[(y, x)],
                    Layer::Colour(_) => panic!("colour"),
                })
                .sum();
            let colour = [0, 1, 2].map(|c| out.colour[(y, x, c)]);
            assert!((sum - luminance(colour)).abs() < 1e-4 * (1.0 + sum), "{sum} {colour:?}");
            let expected = w * pair.a.colour[(y, x, 0)] + (1.0 - w) * pair.b.colour[(y, x, 0)];
            assert!((colour[0] - expected).abs() < 1e-4 * (1.0 + sum));
        }
    }
}

#[test]
fn a_learnt_blend_recovers_most_of_what_can_be_gained() {
    // The gain that features can explain: with the weights that the true noise variances give.
    let model = mean();
    let pair = pair(300, 200, 40);
    let [a, b, _] = inputs(&pair);
    let blend = mse(&apply(&model, a, b, Classes::Blend).unwrap(), &pair.reference);
    let mut average = pair.a.clone();
    average.colour = (&pair.a.colour + &pair.b.colour) / 2.0;
    let average = mse(&average, &pair.reference);
    let ideal = mse(&ideal_blend(&pair, 40), &pair.reference);
    println!("mse: average {average}, blend {blend}, ideal {ideal}");
    assert!((average - blend) / (average - ideal) > 0.8);
    assert!(blend < mse(&pair.a, &pair.reference).min(mse(&pair.b, &pair.reference)));
}

/// The best blend by weights that do not depend on the noise: σ_b² / (σ_a² + σ_b²).
fn ideal_blend(pair: &Pair, seed: u64) -> Image {
    let mut image = pair.reference.clone();
    let (height, width) = (image.height(), image.width());
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let u = (x as f32 / width as f32 * 9.0 + seed as f32).sin().abs();
        let variance =
            |spread: [f32; 3]| -> f32 { spread.iter().zip([u, 1.0 - u, 0.2]).map(|(s, t)| (s * t).powi(2)).sum() };
        let (va, vb) = (variance([0.9, 0.05, 0.1]), variance([0.05, 0.9, 0.1]));
        let w = vb / (va + vb);
        (0..3).for_each(|c| {
            image.colour[(y, x, c)] = w * pair.a.colour[(y, x, c)] + (1.0 - w) * pair.b.colour[(y, x, c)];
        });
    }
    image
}

#[test]
fn a_feature_that_tells_the_better_image_recovers_the_oracles_gain() {
    // Each pixel is exact in one image, and its class says in which.
    let scene = |seed: u64| {
        let mut pair = pair(80, 60, seed);
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut layers = [Array2::<f32>::zeros((60, 80)), Array2::<f32>::zeros((60, 80))];
        pair.reference.colour = Array3::from_shape_simple_fn((60, 80, 3), || 1.0);
        (pair.a.colour, pair.b.colour) = (pair.reference.colour.clone(), pair.reference.colour.clone());
        for (y, x) in (0..60).flat_map(|y| (0..80).map(move |x| (y, x))) {
            let in_a = random.random_bool(0.5);
            let image = if in_a { &mut pair.b } else { &mut pair.a };
            (0..3).for_each(|c| image.colour[(y, x, c)] += random.random_range(-1.0..2.0f32));
            layers[usize::from(in_a)][(y, x)] = 0.7 + 0.3 * random.random::<f32>();
            layers[usize::from(!in_a)][(y, x)] = 0.3 * random.random::<f32>();
        }
        for image in [&mut pair.a, &mut pair.b] {
            image.layers = (0..2).map(|k| (CLASSES[k].to_owned(), Layer::Luminance(layers[k].clone()))).collect();
        }
        pair
    };
    let scenes = ["one", "two", "three"].map(String::from);
    let integrators = ["mmlt".to_owned(), "sppm".to_owned()];
    let load = |i: usize| Ok(scene(i as u64));
    let (table, _) = leave_one_out(integrators, &scenes, load, &Options::default()).unwrap();
    for s in &table.scenes {
        for blend in [s.forest_plain, s.forest_error_weighted, s.forest_blend_error] {
            assert!((s.average - blend) / (s.average - s.optimal) > 0.8, "{table}");
        }
    }
}

#[test]
fn leave_one_out_reports_what_it_promises() {
    let scenes: Vec<String> = ["x", "y", "x", "z"].map(String::from).to_vec();
    let load = |i: usize| {
        let mut pair = pair(100, 70, i as u64);
        pair.a_alone = Some(pair.a.clone());
        Ok(pair)
    };
    let integrators = ["mmlt".to_owned(), "sppm".to_owned()];
    let options = Options::default();
    let (table, rows) = leave_one_out(integrators, &scenes, load, &options).unwrap();
    println!("{table}");
    assert_eq!(table.scenes.iter().map(|s| s.runs).collect::<Vec<_>>(), [2, 1, 1]);
    assert_eq!(rows.len(), 4 * 100 * 70);
    for s in &table.scenes {
        assert_eq!((s.a_alone, s.b_alone), (Some(s.a), None));
        assert!(s.optimal < s.forest_blend_error && s.forest_blend_error < s.average && s.average < s.a.max(s.b));
        // Clamping row by row loses what averaging first keeps.
        assert!(s.forest_blend_error < s.forest_error_weighted && s.forest_blend_error < s.forest_plain);
        assert!(s.weights.unwrap().r2 > 0.0);
    }
    let text = table.to_string();
    assert!(text.lines().count() == 4 && text.contains("mmlt alone"));
    let back: pathblend::blend::Table = serde_json::from_str(&serde_json::to_string(&table).unwrap()).unwrap();
    assert_eq!(back.scenes.len(), 3);
    let one = ["x".to_owned()];
    let result = leave_one_out(["a".into(), "b".into()], &one, |_| Ok(pair(9, 9, 1)), &options);
    assert!(matches!(result, Err(BlendError::TooFewScenes { found: 1 })));
}

#[test]
fn misfits_are_named() {
    let (model, good, small) = (mean(), pair(20, 10, 1), pair(10, 20, 1));
    let a = Input::new("a.exr", &good.a);
    let refused = |b: &Image| apply(&model, a, Input::new("b.exr", b), Classes::Blend).unwrap_err().to_string();
    let message = refused(&small.b);
    assert!(message.contains("b.exr: 10 × 20") && message.contains("20 × 10 as in a.exr"), "{message}");
    let edited = |edit: &dyn Fn(&mut Image)| {
        let mut image = good.b.clone();
        edit(&mut image);
        refused(&image)
    };
    let message = edited(&|i| i.layers.clear());
    assert!(message.contains("b.exr: no layer called `path_*`"), "{message}");
    let message = edited(&|i| i.layers = [("path_LDE".into(), Layer::Luminance(Array2::zeros((3, 3))))].into());
    assert!(message.contains("b.exr: layer `path_LDE` has shape [3, 3]"), "{message}");
    let message = edited(&|i| drop(i.manifest.insert(INTEGRATOR_KEY.into(), json!("path"))));
    assert!(message.contains("b.exr: integrator `path`") && message.contains("`mmlt` and `sppm`"), "{message}");
    let message = edited(&|i| drop(i.manifest.insert(INTEGRATOR_KEY.into(), json!("mmlt"))));
    assert!(message.contains("integrator `mmlt`"), "{message}");
    let mut scened = good.clone();
    scened.a.manifest.insert(SCENE_KEY.into(), json!("1"));
    scened.b.manifest.insert(SCENE_KEY.into(), json!("2"));
    let [a, b, _] = inputs(&scened);
    let message = apply(&model, a, b, Classes::Blend).unwrap_err().to_string();
    assert!(message.contains("b.exr: scene hash `2`"), "{message}");
    let mut other = model.clone();
    other.settings.insert("features".into(), json!("magic"));
    let [a, b, reference] = inputs(&good);
    assert!(matches!(apply(&other, a, b, Classes::Blend), Err(BlendError::FeatureSet { .. })));
    let mut rows = Rows::new();
    let small = Input::new("small.exr", &small.reference);
    assert!(append(&mut rows, a, b, small, 0, &RowSettings::default()).is_err());
    let none = RowSettings { max_rows: 0, ..RowSettings::default() };
    assert!(append(&mut rows, a, b, reference, 0, &none).is_err());
}

#[test]
fn the_order_of_named_images_does_not_matter() {
    let (model, pair) = (mean(), pair(40, 30, 2));
    let [a, b, _] = inputs(&pair);
    assert_eq!(apply(&model, a, b, Classes::Blend).unwrap(), apply(&model, b, a, Classes::Blend).unwrap());
}

#[test]
fn pixels_without_features_and_broken_pixels_are_taken_care_of() {
    let (model, mut pair) = (mean(), pair(40, 30, 2));
    for image in [&mut pair.a, &mut pair.b] {
        for name in CLASSES {
            let Some(Layer::Luminance(v)) = image.layers.get_mut(name) else { panic!("no {name}") };
            v[(0, 1)] = f32::NAN;
        }
        (0..3).for_each(|c| image.colour[(0, 0, c)] = 0.0);
        (0..3).for_each(|c| image.colour[(0, 2, c)] = -1.0);
    }
    pair.a.colour[(1, 0, 1)] = f32::NAN;
    pair.b.colour[(1, 1, 0)] = f32::INFINITY;
    pair.a.colour[(1, 2, 2)] = f32::NAN;
    pair.b.colour[(1, 2, 2)] = f32::NAN;
    let [a, b, reference] = inputs(&pair);
    let out = apply(&model, a, b, Classes::Blend).unwrap();
    let Layer::Luminance(weights) = &out.layers["weight_mmlt"] else { panic!("no luminance") };
    assert_eq!([0, 2].map(|x| weights[(0, x)]), [0.5; 2]);
    assert!((0.0..=1.0).contains(&weights[(0, 1)]));
    assert_eq!([0, 1].map(|x| weights[(1, x)]), [0.0, 1.0]);
    assert!(out.colour.iter().all(|v| v.is_finite()));
    assert_eq!([0, 1, 2].map(|c| out.colour[(1, 2, c)]), [0.0; 3]);
    assert_eq!(out.manifest["blend"]["nonfinite_pixels"], 3);
    let mut rows = Rows::new();
    append(&mut rows, a, b, reference, 0, &RowSettings::default()).unwrap();
    assert_eq!(rows.len(), 40 * 30 - 5);
}

#[test]
fn classes_that_the_model_or_an_image_lacks() {
    let (model, mut pair) = (mean(), pair(40, 30, 2));
    pair.b.layers.remove("path_LSDE");
    let extra = Layer::Colour(Array3::from_elem((30, 40, 3), 0.25));
    pair.a.layers.insert("path_LSSE".into(), extra.clone());
    pair.b.layers.insert("path_LSSE".into(), extra.clone());
    pair.a.layers.insert("variance".into(), extra.clone());
    let [a, b, _] = inputs(&pair);
    let out = apply(&model, a, b, Classes::Blend).unwrap();
    assert_eq!(out.layers["path_LSSE"], extra);
    assert!(!out.layers.contains_key("variance"));
    let (Layer::Luminance(w), Layer::Luminance(v)) = (&out.layers["weight_mmlt"], &out.layers["path_LSDE"]) else {
        panic!("no luminance")
    };
    let Layer::Luminance(only) = &pair.a.layers["path_LSDE"] else { panic!("no luminance") };
    for (p, &v) in v.indexed_iter() {
        assert!((v - w[p] * only[p]).abs() < 1e-5);
    }
}

#[test]
fn rows_are_thinned_scaled_and_capped() {
    let mut pair = pair(100, 50, 3);
    let Some(Layer::Luminance(class)) = pair.a.layers.get_mut(CLASSES[0]) else { panic!("no luminance") };
    class[(7, 7)] += 1e6;
    (0..3).for_each(|c| pair.a.colour[(7, 7, c)] += 1e6);
    let [a, b, reference] = inputs(&pair);
    let make = |settings: &RowSettings| {
        let mut rows = Rows::new();
        let count = append(&mut rows, a, b, reference, 4, settings).unwrap();
        assert_eq!(count, rows.len());
        rows
    };
    let all = make(&RowSettings::default());
    assert_eq!(all.len(), 5000);
    let mean = |rows: &Rows| rows.weights().iter().sum::<f32>() / rows.len() as f32;
    let most = |rows: &Rows| rows.weights().iter().fold(0.0f32, |m, &w| m.max(w));
    assert!((mean(&all) - 1.0).abs() < 1e-3 && most(&all) < 30.0);
    let raw = make(&RowSettings { stake_quantile: 1.0, ..RowSettings::default() });
    assert!(most(&raw) > 4000.0, "one firefly holds all the weight");
    let few = RowSettings { max_rows: 123, ..RowSettings::default() };
    assert_eq!(make(&few), make(&few));
    assert_eq!(make(&few).len(), 123);
    assert_ne!(make(&few), make(&RowSettings { seed: 9, ..few.clone() }));
    // Class shares of each pixel add up to one.
    for row in 0..all.len() {
        let sum: f32 = all.entries(row).1.iter().sum();
        assert!((sum - 1.0).abs() < 1e-5);
    }
}
