//! All methods see the same through an orthographic camera, in the scenes that `tests/features` compares with Mitsuba.

#![allow(clippy::unwrap_used, clippy::expect_used)]

use pathblend::image::luminance;
use pathblend::integrators::{Budget, Method, Settings, render};
use pathblend::load;
use std::path::Path;

const TILE: usize = 8;
const RUNS: u64 = 12;

/// Mean luminance of each tile, with its variance, over runs of several seeds.
fn tiles(scene: &pathblend::scene::Scene, method: Method, passes: u64) -> Vec<(f64, f64)> {
    let columns = scene.camera.size[0] / TILE;
    let runs: Vec<Vec<f64>> = (0..RUNS)
        .map(|seed| {
            let settings = Settings {
                seed,
                max_depth: scene.max_depth,
                features: false,
                budget: Budget::Passes(passes),
                ..Settings::default()
            };
            let image = render(scene, method, &settings, |_| {}).image.colour;
            let mut sums = vec![0.0; columns * scene.camera.size[1] / TILE];
            for ((y, x, channel), value) in image.indexed_iter() {
                let mut rgb = [0.0; 3];
                rgb[channel] = *value;
                sums[y / TILE * columns + x / TILE] += f64::from(luminance(rgb)) / (TILE * TILE) as f64;
            }
            sums
        })
        .collect();
    let n = RUNS as f64;
    let tile = |i: usize| {
        let mean = runs.iter().map(|run| run[i]).sum::<f64>() / n;
        (mean, runs.iter().map(|run| (run[i] - mean).powi(2)).sum::<f64>() / (n - 1.0) / n)
    };
    (0..runs[0].len()).map(tile).collect()
}

/// sppm is biased by the width of what a pixel gathers from; the others are not.
#[test]
fn methods_agree() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/features");
    for name in ["orthographic", "orthographic_glass", "orthographic_clipped"] {
        let scene = load::read(&folder.join(name).with_extension("xml"), &load::Options::default()).unwrap().scene;
        let expected = tiles(&scene, Method::Path, 96);
        for (method, passes, bias) in
            [(Method::Bdpt, 24, 0.003), (Method::Mmlt, 48, 0.003), (Method::Rjmlt, 48, 0.003), (Method::Sppm, 48, 0.05)]
        {
            for (i, (a, b)) in expected.iter().zip(tiles(&scene, method, passes)).enumerate() {
                let excess = ((a.0 - b.0).abs() - bias * a.0).max(0.0) / (a.1 + b.1).sqrt().max(1e-12);
                assert!(excess < 9.0, "{name} by {}, tile {i}: {:.4}, expected {:.4}", method.name(), b.0, a.0);
            }
        }
    }
}
