//! The error measures against independent implementations.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use ndarray::Array3;
use pathblend::image::{Image, WriteOptions, metrics};

/// 48×32 pixels of sixteenths, exact in every format: `((px·x + py·y + pc·c) mod 32 + offset) / 16`.
fn pattern([px, py, pc]: [usize; 3], offset: usize) -> Image {
    let mut image = Image::new(48, 32);
    image.colour =
        Array3::from_shape_fn((32, 48, 3), |(y, x, c)| ((px * x + py * y + pc * c) % 32 + offset) as f32 / 16.0);
    image
}

/// The expected numbers come from the EXR files of this pair, read with Mitsuba 3.9.1 and worked out in
/// Python: `mse`, `relmse`, their trimmed forms and `mean_ratio` by numpy 64-bit sums as in the project's
/// oracle (`compare_exr.py`, `metrics`), `smape` and `mape` by the formulas of the module's documentation, and
/// ꟻLIP by its authors' package `flip-evaluator` 1.7 (LDR, `inputsRGB`, 67 pixels per degree) on the sRGB
/// encoding rounded to 8 bits, its map averaged in 64 bits.
#[test]
fn a_pair_measured_in_python() {
    let folder = tempfile::tempdir().unwrap();
    let through_file = |name: &str, image: Image| {
        let path = folder.path().join(name);
        image.write(&path, &WriteOptions::default()).unwrap();
        Image::read(&path).unwrap()
    };
    let image = through_file("a.exr", pattern([7, 13, 5], 0));
    let reference = through_file("b.exr", pattern([3, 11, 7], 3));
    let found = metrics::compare(&image, &reference).unwrap();
    let near = |name: &str, found: f64, expected: f64| {
        let error = (found / expected - 1.0).abs();
        assert!(error < 1e-12, "{name}: {found} is not {expected}");
    };
    near("mse", found.mse, 0.69921875);
    near("rmse", found.rmse, 0.8361930100162283);
    near("relmse", found.relmse, 1.8745671719990082);
    near("relmse_trimmed", found.relmse_trimmed, 1.849276356171653);
    near("smape", found.smape, 0.7248788401912781);
    near("mape", found.mape, 0.8560463730111831);
    near("mean_ratio", found.mean_ratio, 0.8378378378378378);
    near("trimmed mse", found.trimmed.mse, 0.6973819127553237);
    near("trimmed smape", found.trimmed.smape, 0.7238564763149684);
    near("trimmed mape", found.trimmed.mape, 0.8527717764075069);
    // ꟻLIP works in 32 bits, whose last digits depend on the compiler.
    let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-5, "{found}");
    near(found.flip, 0.29916791708092205);
    near(found.trimmed.flip, 0.29860181604284974);
}
