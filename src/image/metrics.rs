//! How far an image is from a reference.
//!
//! With a the image and b the reference, both linear, every measure is a mean over pixels and their three
//! channels (Rousselle et al. 2011 for the relative squared error):
//!
//! - MSE: (a − b)²; RMSE is the root of the mean
//! - relMSE: (a − b)² / (b² + ε)
//! - SMAPE: |a − b| / ((|a| + |b|) / 2 + ε), between 0 and 2
//! - MAPE: |a − b| / (|b| + ε)
//! - ꟻLIP: Andersson et al., "FLIP: A Difference Evaluator for Alternating Images", 2020; see [`flip_map`]
//!
//! ε is [`EPSILON`]. A *trimmed* mean leaves out the 0.1 % (rounded up) of the pixels where that very measure
//! is largest, so that a few fireflies do not decide. Pixels that are not finite in one of the images are
//! counted and left out of everything.

use ndarray::{Array2, ArrayView1, ArrayView3, Axis, Zip};
use serde::Serialize;

use super::{Image, ImageError, luminance, srgb};

/// Keeps the relative measures finite where the reference is black.
pub const EPSILON: f64 = 0.01;
/// The share of pixels that a trimmed mean leaves out.
pub const TRIMMED_SHARE: f64 = 0.001;

/// The measures of [`compare`]; as JSON, an object with these names as keys, which stay as they are.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Metrics {
    /// Mean squared error.
    pub mse: f64,
    /// Root of the mean squared error.
    pub rmse: f64,
    /// Mean squared error relative to the reference's square.
    pub relmse: f64,
    /// The same without the 0.1 % of the pixels where it is largest.
    pub relmse_trimmed: f64,
    /// Symmetric mean absolute error relative to both, in [0, 2].
    pub smape: f64,
    /// Mean absolute error relative to the reference.
    pub mape: f64,
    /// Mean ꟻLIP error, in [0, 1].
    pub flip: f64,
    /// Mean of the image over the mean of the reference: 1 where both means are equal, also when they are
    /// zero; infinite (`null` in JSON) over a black reference.
    pub mean_ratio: f64,
    /// Which ꟻLIP: `ldr`, on 8-bit sRGB pictures without exposure or tone curve.
    pub flip_mode: &'static str,
    /// The other measures without the 0.1 % of the pixels where each is largest.
    pub trimmed: Trimmed,
    /// How many pixels were compared.
    pub pixels: usize,
    /// How many pixels were left out because a channel of one of the images is infinite or not a number.
    pub nonfinite: usize,
}

/// Trimmed means; `rmse` is the root of the trimmed `mse`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Trimmed {
    /// See [`Metrics::mse`].
    pub mse: f64,
    /// See [`Metrics::rmse`].
    pub rmse: f64,
    /// See [`Metrics::smape`].
    pub smape: f64,
    /// See [`Metrics::mape`].
    pub mape: f64,
    /// See [`Metrics::flip`].
    pub flip: f64,
}

/// Height × width: where the luminance of `image` is below that of `reference` and where above, by their difference over
/// their sum: 0 for all too dark, 0.5 for the same, 1 for all too bright, NaN where either is not finite.
///
/// # Errors
/// As [`compare`].
pub fn difference(image: &Image, reference: &Image) -> Result<Array2<f32>, ImageError> {
    check_pair(image, reference)?;
    let light = |image: &Image, y: usize, x: usize| luminance([0, 1, 2].map(|channel| image.colour[[y, x, channel]]));
    Ok(Array2::from_shape_fn((image.height(), image.width()), |(y, x)| {
        let (a, b) = (light(image, y, x), light(reference, y, x));
        0.5 + 0.5 * (a - b) / (a.abs() + b.abs() + EPSILON as f32)
    }))
}

/// Measures how far `image` is from `reference`, on their colour alone.
///
/// # Errors
/// [`ImageError::SizeMismatch`]; [`ImageError::NothingToCompare`] where no pixel is finite in both;
/// [`ImageError::LayerShape`] for colour without three channels.
pub fn compare(image: &Image, reference: &Image) -> Result<Metrics, ImageError> {
    check_pair(image, reference)?;
    let (a, b) = (image.colour.view(), reference.colour.view());
    let pixels = finite_pixels(a, b);
    let total = image.width() * image.height();
    if pixels.is_empty() {
        return Err(ImageError::NothingToCompare { pixels: total });
    }
    let all = flip_errors(a, b);
    let flip = pixels.iter().map(|pixel| f64::from(all[pixel.index]));
    let mse = Measure::of(&pixels, |a, b| (a - b).powi(2));
    let relmse = Measure::of(&pixels, |a, b| (a - b).powi(2) / (b * b + EPSILON));
    let smape = Measure::of(&pixels, |a, b| (a - b).abs() / (0.5 * (a.abs() + b.abs()) + EPSILON));
    let mape = Measure::of(&pixels, |a, b| (a - b).abs() / (b.abs() + EPSILON));
    let flip = Measure::new(flip.collect());
    Ok(Metrics {
        mse: mse.mean,
        rmse: mse.mean.sqrt(),
        relmse: relmse.mean,
        relmse_trimmed: relmse.trimmed,
        smape: smape.mean,
        mape: mape.mean,
        flip: flip.mean,
        mean_ratio: mean_ratio(&pixels),
        flip_mode: "ldr",
        trimmed: Trimmed {
            mse: mse.trimmed,
            rmse: mse.trimmed.sqrt(),
            smape: smape.trimmed,
            mape: mape.trimmed,
            flip: flip.trimmed,
        },
        pixels: pixels.len(),
        nonfinite: total - pixels.len(),
    })
}

/// How far an image is expected to be from the truth, as its own noise has it: the roots of the expected [`Metrics::relmse`]
/// and [`Metrics::relmse_trimmed`], with the image in the place of the reference in the denominator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected {
    /// Root of the mean of σ² / (I² + ε).
    pub relative: f64,
    /// The same without the 0.1 % of the pixels where it is largest.
    pub relative_trimmed: f64,
}

impl Expected {
    /// From `colour` and the variances of its channels, both height × width × 3. Pixels that are not finite are left out;
    /// `None` where that leaves none.
    pub fn of(colour: ArrayView3<'_, f32>, variance: ArrayView3<'_, f32>) -> Option<Self> {
        let pixels = finite_pixels(colour, variance);
        // Here the second of the pair is the variance.
        let relative = |i: f64, variance: f64| variance / (i * i + EPSILON);
        let measure = (!pixels.is_empty()).then(|| Measure::of(&pixels, relative))?;
        Some(Self { relative: measure.mean.sqrt(), relative_trimmed: measure.trimmed.sqrt() })
    }
}

/// The ꟻLIP error of every pixel in [0, 1], height × width.
///
/// This is LDR-ꟻLIP at its authors' viewing distance (67 pixels per degree) on the images as 8-bit sRGB:
/// values above 1 are clipped, so it sees what a plain PNG shows. Pixels that are not finite in one of the
/// images are black in both.
///
/// # Errors
/// [`ImageError::SizeMismatch`] and [`ImageError::LayerShape`], as for [`compare`].
pub fn flip_map(image: &Image, reference: &Image) -> Result<Array2<f32>, ImageError> {
    check_pair(image, reference)?;
    let (width, height) = (image.width(), image.height());
    let errors = flip_errors(image.colour.view(), reference.colour.view());
    Ok(Array2::from_shape_fn((height, width), |(y, x)| errors[y * width + x]))
}

fn check_pair(image: &Image, reference: &Image) -> Result<(), ImageError> {
    let size = |image: &Image| (image.width(), image.height());
    if size(image) != size(reference) {
        return Err(ImageError::SizeMismatch { image: size(image), reference: size(reference) });
    }
    image.check()?;
    reference.check()
}

/// See [`flip_map`]; row by row. An image without pixels has no errors.
fn flip_errors<'a>(image: ArrayView3<'a, f32>, reference: ArrayView3<'a, f32>) -> Vec<f32> {
    let (height, width, _) = image.dim();
    if image.is_empty() {
        return Vec::new();
    }
    let mut pictures = [image, reference].map(|view| srgb::to_srgb8(view, 0.0));
    let finite = finite_mask(image, reference);
    for picture in &mut pictures {
        let pixels = picture.chunks_exact_mut(3).zip(&finite);
        for (pixel, _) in pixels.filter(|(_, finite)| !**finite) {
            pixel.fill(0);
        }
    }
    let load = |picture: &[u8]| nv_flip::FlipImageRgb8::with_data(width as u32, height as u32, picture);
    let [image, reference] = pictures.each_ref().map(|picture| load(picture));
    nv_flip::flip(reference, image, nv_flip::DEFAULT_PIXELS_PER_DEGREE).to_vec()
}

/// A pixel that is finite in both images.
struct Pixel {
    /// Its place, counted row by row.
    index: usize,
    image: [f64; 3],
    reference: [f64; 3],
}

fn finite_mask(a: ArrayView3<'_, f32>, b: ArrayView3<'_, f32>) -> Vec<bool> {
    let finite = |lane: ArrayView1<'_, f32>| lane.iter().all(|c| c.is_finite());
    let mask = Zip::from(a.lanes(Axis(2))).and(b.lanes(Axis(2))).map_collect(|a, b| finite(a) && finite(b));
    mask.into_iter().collect()
}

fn finite_pixels(a: ArrayView3<'_, f32>, b: ArrayView3<'_, f32>) -> Vec<Pixel> {
    let lanes = a.lanes(Axis(2)).into_iter().zip(b.lanes(Axis(2)));
    let rgb = |lane: ArrayView1<'_, f32>| [0, 1, 2].map(|c| f64::from(lane[c]));
    lanes
        .enumerate()
        .map(|(index, (a, b))| Pixel { index, image: rgb(a), reference: rgb(b) })
        .filter(|pixel| {
            let mut channels = pixel.image.iter().chain(&pixel.reference);
            channels.all(|c| c.is_finite())
        })
        .collect()
}

/// The mean of a measure over pixels, and the mean without the worst.
struct Measure {
    mean: f64,
    trimmed: f64,
}

impl Measure {
    fn of(pixels: &[Pixel], error: impl Fn(f64, f64) -> f64) -> Self {
        let of_pixel = |p: &Pixel| {
            let channels = p.image.iter().zip(p.reference);
            channels.map(|(&a, b)| error(a, b)).sum::<f64>() / 3.0
        };
        Self::new(pixels.iter().map(of_pixel).collect())
    }

    /// `errors` has at least one element.
    fn new(mut errors: Vec<f64>) -> Self {
        let count = errors.len();
        let mean = errors.iter().sum::<f64>() / count as f64;
        let dropped = (count as f64 * TRIMMED_SHARE).ceil() as usize;
        let kept = count - dropped.min(count - 1); // one pixel is its own trimmed mean
        let (best, _, _) = errors.select_nth_unstable_by(kept - 1, f64::total_cmp);
        let best = best.len();
        let trimmed = errors[..=best].iter().sum::<f64>() / kept as f64;
        Self { mean, trimmed }
    }
}

fn mean_ratio(pixels: &[Pixel]) -> f64 {
    let sum = |of: fn(&Pixel) -> [f64; 3]| -> f64 { pixels.iter().flat_map(of).sum() };
    let (image, reference) = (sum(|p| p.image), sum(|p| p.reference));
    if image == reference { 1.0 } else { image / reference }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;
    use ndarray::Array3;

    fn grey(values: &[f32]) -> Image {
        let mut image = Image::new(values.len(), 1);
        image.colour = Array3::from_shape_fn((1, values.len(), 3), |(_, x, _)| values[x]);
        image
    }

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() <= 1e-9 * expected.abs(), "{found} is not {expected}");
    }

    #[test]
    fn an_image_does_not_differ_from_itself() {
        let image = grey(&[0.1, 5.0, 0.0]);
        let found = compare(&image, &image).unwrap();
        assert_eq!(found.mse + found.relmse + found.smape + found.mape + found.flip, 0.0);
        assert_eq!((found.mean_ratio, found.pixels, found.nonfinite), (1.0, 3, 0));
    }

    #[test]
    fn small_values_by_hand() {
        let found = compare(&grey(&[1.0, 0.0]), &grey(&[0.5, 0.25])).unwrap();
        near(found.mse, (0.25 + 0.0625) / 2.0);
        near(found.rmse, 0.15625f64.sqrt());
        near(found.relmse, (0.25 / 0.26 + 0.0625 / 0.0725) / 2.0);
        near(found.smape, (0.5 / 0.76 + 0.25 / 0.135) / 2.0);
        near(found.mape, (0.5 / 0.51 + 0.25 / 0.26) / 2.0);
        near(found.mean_ratio, 1.0 / 0.75);
        near(found.trimmed.mse, 0.0625);
        near(found.relmse_trimmed, 0.0625 / 0.0725);
        near(found.trimmed.mape, 0.25 / 0.26);
    }

    #[test]
    fn trimming_drops_one_pixel_in_a_thousand_rounded_up() {
        let reference = grey(&[0.0; 2001]);
        let mut values = [0.1; 2001];
        values[7..10].fill(100.0);
        let found = compare(&grey(&values), &reference).unwrap();
        near(found.trimmed.mse, f64::from(0.1f32).powi(2));
        values[10] = 100.0;
        let found = compare(&grey(&values), &reference).unwrap();
        assert!(found.trimmed.mse > 1.0, "a fourth firefly stays");
    }

    #[test]
    fn pixels_that_are_no_numbers_are_counted_and_left_out() {
        let image = grey(&[1.0, f32::NAN, 0.0, 3.0]);
        let reference = grey(&[0.5, 1.0, 0.25, f32::NEG_INFINITY]);
        let found = compare(&image, &reference).unwrap();
        assert_eq!((found.pixels, found.nonfinite), (2, 2));
        near(found.mse, (0.25 + 0.0625) / 2.0);
        assert!(found.flip.is_finite());
        let error = compare(&grey(&[f32::NAN]), &grey(&[1.0])).unwrap_err();
        assert!(matches!(error, ImageError::NothingToCompare { pixels: 1 }));
        assert!(compare(&grey(&[]), &grey(&[])).is_err());
    }

    #[test]
    fn sizes_must_match_and_both_are_said() {
        let error = compare(&Image::new(3, 2), &Image::new(2, 3)).unwrap_err().to_string();
        assert!(error.contains("3x2") && error.contains("2x3"), "{error}");
    }

    #[test]
    fn flip_sees_black_against_white_fully_and_nothing_beyond_white() {
        let (black, white) = (Image::new(8, 8), grey(&[1.0; 64]));
        let wide = Image::new(64, 1);
        let found = compare(&wide, &white).unwrap();
        assert!(found.flip > 0.9 && found.flip <= 1.0, "{}", found.flip);
        assert_eq!(compare(&grey(&[9.0; 64]), &white).unwrap().flip, 0.0);
        assert_eq!(compare(&black, &black).unwrap().flip, 0.0);
    }

    #[test]
    fn published_keys_stay() {
        let found = compare(&grey(&[1.0]), &grey(&[0.0])).unwrap();
        let json = serde_json::to_value(&found).unwrap();
        for key in ["mse", "rmse", "relmse", "relmse_trimmed", "smape", "mape", "flip"] {
            assert!(json[key].is_f64(), "{key}");
        }
        assert!(json["mean_ratio"].is_null(), "a ratio to black is infinite");
        assert_eq!(json["flip_mode"], "ldr");
        assert!(json["trimmed"]["mape"].is_f64());
    }
}
