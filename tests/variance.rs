//! The variance layer against what it claims: the spread of independent renders, by every method.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use pathblend::image::{Image, Layer, metrics};
use pathblend::integrators::{Budget, Method, Settings, render};
use pathblend::load;
use pathblend::scene::Scene;
use std::path::Path;

/// Standard errors. Student's t exceeds them once in 10⁷ times with the 63 degrees of freedom of 64 seeds, and once in 10⁶
/// times with the 31 of 32; the statistic is a sum over many pixels, so that it is nearly normal.
const SIGMAS: f64 = 6.0;

fn scene(name: &str, side: usize) -> Scene {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).join("scene.xml");
    let options = load::Options { size: Some([side, side]), ..load::Options::default() };
    let mut scene = load::read(&file, &options).expect("own scenes load").scene;
    scene.max_depth = 5;
    scene
}

fn run(scene: &Scene, method: Method, seed: u64, passes: u64) -> Image {
    let settings = Settings {
        seed,
        max_depth: scene.max_depth,
        features: false,
        budget: Budget::Passes(passes),
        ..Settings::default()
    };
    render(scene, method, &settings, |_| {}).image
}

fn variance(image: &Image) -> &ndarray::Array3<f32> {
    let Some(Layer::Colour(variance)) = image.layers.get("variance") else { panic!("no variance layer") };
    variance
}

/// Compares, summed over pixels and channels relative to the square of the mean, the squared deviations of each render from
/// the mean of all with the variance that it claims. `granted` is the share by which the claim may be off beside noise.
#[track_caller]
fn agrees(scene: &Scene, method: Method, passes: u64, seeds: u64, granted: f64) {
    let images: Vec<Image> = (0..seeds).map(|seed| run(scene, method, seed, passes)).collect();
    let n = seeds as f64;
    let double = |image: &Image| image.colour.mapv(f64::from);
    let mean = images.iter().skip(1).fold(double(&images[0]), |sum, image| sum + double(image)) / n;
    let weight = mean.mapv(|m| 1.0 / (m * m + metrics::EPSILON));
    let differences: Vec<(f64, f64)> = images
        .iter()
        .map(|image| {
            // The mean of all holds a part of the render's own deviation.
            let squares = (double(image) - &mean).mapv(|d| d * d) * (n / (n - 1.0)) * &weight;
            let claims = variance(image).mapv(f64::from) * &weight;
            (squares.sum() - claims.sum(), claims.sum())
        })
        .collect();
    let claim = differences.iter().map(|d| d.1).sum::<f64>() / n;
    let mean = differences.iter().map(|d| d.0).sum::<f64>() / n;
    let error = (differences.iter().map(|d| (d.0 - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt();
    eprintln!("{method:?}: spread {} ± {} of the claim", 1.0 + mean / claim, error / claim);
    assert!(claim > 0.0 && error < 0.1 * claim, "{method:?}: no telling with {error} of {claim}");
    assert!(mean.abs() < SIGMAS * error + granted * claim, "{method:?}: {mean} ± {error} beside a claim of {claim}");
}

#[test]
fn independent_passes_know_their_spread() {
    let scene = scene("box", 16);
    agrees(&scene, Method::Path, 64, 64, 0.0);
    agrees(&scene, Method::Path, 5, 64, 0.0);
    agrees(&scene, Method::Bdpt, 64, 64, 0.0);
}

/// Radii shrink, so that later passes are noisier and have another mean; granted: 3 %.
#[test]
fn photons_know_their_spread() {
    let scene = scene("box", 16);
    agrees(&scene, Method::Sppm, 64, 64, 0.03);
    agrees(&scene, Method::Vcm, 64, 64, 0.03);
}

/// Chains need passes: here each of the 16 chains per length takes some 300 mutations in one of the last batches. Granted:
/// 20 %, since most batches are shorter and share what the chains remember.
#[test]
fn chains_know_their_spread_after_many_passes() {
    agrees(&scene("box", 32), Method::Mmlt, 256, 32, 0.2);
}

/// The manifest's estimates are the layer's, and two halves tell the same.
#[test]
fn the_manifest_has_the_expected_error() {
    let scene = scene("box", 32);
    let (image, truth) = (run(&scene, Method::Path, 1, 64), run(&scene, Method::Path, 2, 4096));
    let error = |name: &str| image.manifest["error"][name].as_f64().expect("a number");
    let relative = f64::from(
        ndarray::Zip::from(&image.colour)
            .and(variance(&image))
            .fold(0.0f32, |sum, i, v| sum + v / (i * i + metrics::EPSILON as f32)),
    );
    let relative = (relative / image.colour.len() as f64).sqrt();
    assert!((error("relative") / relative - 1.0).abs() < 1e-4, "{} {relative}", error("relative"));
    assert!(error("relative_trimmed") <= error("relative"));
    // 1024 pixels of one degree of freedom, channels counted as one: 4.5 % for the mean square, six times that.
    assert!(((error("halves") / relative).powi(2) - 1.0).abs() < 0.27, "{} {relative}", error("halves"));
    // The same for what is there really; the image itself stands for the truth in the denominator, which costs some percent.
    let found = metrics::compare(&image, &truth).unwrap().relmse;
    assert!((found / relative.powi(2) - 1.0).abs() < 0.35, "{found} {}", relative.powi(2));
}

#[test]
fn one_pass_has_no_variance() {
    let image = run(&scene("box", 8), Method::Path, 0, 1);
    assert!(image.layers.is_empty() && !image.manifest.contains_key("error"));
    assert!(!run(&scene("box", 8), Method::Path, 0, 2).layers.is_empty());
}
