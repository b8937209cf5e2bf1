//! One small scene for each feature of the scene format, against Mitsuba 3. `tests/features/make.py` writes the scenes
//! and their references.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use pathblend::image::{Image, luminance};
use pathblend::integrators::{Budget, Method, Settings, render};
use pathblend::load;
use std::path::{Path, PathBuf};

const TILE: usize = 8;
const RUNS: u64 = 16;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/features")
}

/// Names of all scenes that have a reference, sorted.
fn names() -> Vec<String> {
    let files = std::fs::read_dir(folder()).expect("the folder").map(|entry| entry.expect("an entry").path());
    let scenes = files.filter(|file| file.extension().is_some_and(|extension| extension == "xml"));
    let mut names: Vec<String> = scenes.map(|file| file.file_stem().unwrap().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// Mean luminance of each tile, then of the whole image.
fn means(colour: &ndarray::Array3<f32>) -> Vec<f64> {
    let (height, width, _) = colour.dim();
    let columns = width / TILE;
    let mut sums = vec![0.0; height / TILE * columns + 1];
    let whole = sums.len() - 1;
    for y in 0..height {
        for x in 0..width {
            let pixel = f64::from(luminance([0, 1, 2].map(|c| colour[[y, x, c]])));
            sums[y / TILE * columns + x / TILE] += pixel / (TILE * TILE) as f64;
            sums[whole] += pixel / (height * width) as f64;
        }
    }
    sums
}

struct Reference {
    means: Vec<f64>,
    /// Of the means.
    variances: Vec<f64>,
}

fn reference(name: &str) -> Reference {
    let read = |file: String| Image::read(&folder().join(file)).expect("a reference").colour;
    let mean = read(format!("{name}.exr"));
    let (height, width, _) = mean.dim();
    // Channels are taken as fully correlated, which errs to the safe side.
    let squares = read(format!("{name}_var.exr")).mapv(f32::sqrt);
    let squares = ndarray::Array3::from_shape_fn(squares.dim(), |(y, x, _)| {
        luminance([0, 1, 2].map(|c| squares[[y, x, c]])).powi(2)
    });
    let mut variances: Vec<f64> = means(&squares).into_iter().map(|v| v / (TILE * TILE) as f64).collect();
    *variances.last_mut().unwrap() *= (TILE * TILE) as f64 / (height * width) as f64;
    Reference { means: means(&mean), variances }
}

/// A comparison of the whole image, and of its worst tile.
struct Row {
    ratio: f64,
    error: f64,
    z: f64,
    worst_tile: f64,
}

fn compare(name: &str, method: Method, passes: u64) -> Result<Row, String> {
    let file = folder().join(format!("{name}.xml"));
    let scene = load::read(&file, &load::Options::default()).map_err(|error| error.to_string())?.scene;
    let runs: Vec<Vec<f64>> = (0..RUNS)
        .map(|seed| {
            let budget = Budget::Passes(passes);
            let settings =
                Settings { seed, max_depth: scene.max_depth, features: false, budget, ..Settings::default() };
            means(&render(&scene, method, &settings, |_| {}).image.colour)
        })
        .collect();
    let Reference { means, variances } = reference(name);
    let n = RUNS as f64;
    let column = |i: usize| {
        let mean = runs.iter().map(|run| run[i]).sum::<f64>() / n;
        let variance = runs.iter().map(|run| (run[i] - mean).powi(2)).sum::<f64>() / (n - 1.0) / n;
        (mean, (variance + variances[i]).sqrt())
    };
    let whole = means.len() - 1;
    let (mean, error) = column(whole);
    // Beside noise, half a percent is granted for half floats, single precision and what heavy tails hide.
    let excess = |i: usize| {
        let (mean, error) = column(i);
        ((mean - means[i]).abs() - 0.005 * means[i]).max(0.0) / error
    };
    Ok(Row {
        ratio: mean / means[whole],
        error: error / means[whole],
        z: (mean - means[whole]) / error,
        worst_tile: (0..whole).map(excess).fold(0.0, f64::max),
    })
}

/// No correct program fails this more than once in 10⁴ runs: some 900 comparisons by 9 standard errors, of which most
/// comes from 16 runs (Student's t with 15 degrees of freedom: 2·10⁻⁷ each).
#[test]
fn every_feature_agrees_with_mitsuba() {
    let mut wrong = Vec::new();
    for name in names() {
        match compare(&name, Method::Path, 24) {
            Err(message) => wrong.push(format!("{name}: {message}")),
            Ok(row) if row.worst_tile > 9.0 || (row.ratio - 1.0).abs() > 0.005 + 9.0 * row.error => {
                wrong.push(format!("{name}: ratio {:.4}, worst tile {:.1} s.e.", row.ratio, row.worst_tile));
            }
            Ok(_) => {}
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The same with enough samples to see half a percent; prints the table. Takes some minutes.
#[test]
#[ignore = "long: cargo test --release --test features -- --ignored --nocapture"]
fn table_of_features() {
    println!("| feature | method | ratio | s.e. | z | worst tile, s.e. |\n|---|---|---|---|---|---|");
    let mut wrong = Vec::new();
    for name in names() {
        // What only light from a point or from one direction makes, path tracing finds too: no lens can be hit.
        for (method, passes) in [(Method::Path, 200), (Method::Bdpt, 60)] {
            let label = method.name();
            match compare(&name, method, passes) {
                Err(message) => println!("| {name} | {label} | {message} |"),
                Ok(Row { ratio, error, z, worst_tile }) => {
                    println!("| {name} | {label} | {ratio:.4} | {error:.4} | {z:+.1} | {worst_tile:.1} |");
                    if worst_tile > 9.0 || (ratio - 1.0).abs() > 0.005 + 9.0 * error {
                        wrong.push(format!("{name} by {label}"));
                    }
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}
