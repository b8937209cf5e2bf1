//! Blending two images by a model (Otsu thesis, section 5.4.2).

use ndarray::{Array2, Array3};
use rayon::prelude::*;
use serde_json::{Map, Value, json};

use super::features::TILE;
use super::planes::{Class, Planes};
use super::predict::{UNKNOWN, feature_set, forest_weights, mix, mix_colours, mix_planes};
use super::{BlendError, Input};
use crate::forest::Model;
use crate::image::{DEPTH_KEY, INTEGRATOR_KEY, Image, Layer, SCENE_KEY};

/// The weight of image a at every pixel, height × width, in [0, 1]: the forest's prediction; 0.5 where a pixel has no
/// light in either image; all weight on the other image where one's colour is not finite.
///
/// # Errors
/// As [`apply`], but neither order nor manifests are looked at.
pub fn weight_map(model: &Model, a: Input<'_>, b: Input<'_>) -> Result<Array2<f32>, BlendError> {
    let planes = Planes::of(a, b)?;
    let weights = safe_weights(model, &planes)?.0;
    array2(weights, a.image)
}

/// What becomes of the path layers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Classes {
    /// They are left out of the blend, which then takes no longer where there are hundreds.
    Drop,
    /// They are blended as the image is.
    Blend,
}

/// Blends two images of one scene by a model: colour w A + (1 − w) B per pixel, and the weights as luminance layer
/// `weight_NAME`, NAME being the model's first integrator.
///
/// Path layers are blended likewise if `classes` says so, and then still add up to the image's luminance; a path layer
/// that only one image has counts as black in the other. Other layers are left out: what a blend of, say, two variances
/// means is not for this function to guess.
///
/// Images whose manifests name their integrators may come in either order. The result's manifest says, under `blend`,
/// what was blended by which model, the mean weight, and how many pixels had no features or no finite colour (black where
/// neither image has one).
///
/// # Errors
/// [`BlendError::Size`], [`BlendError::NoLayers`], [`BlendError::LayerShape`] for images that do not fit;
/// [`BlendError::Content`] if their manifests name other integrators than the model, or different scenes;
/// [`BlendError::FeatureSet`] for a model not made by this room.
pub fn apply(model: &Model, a: Input<'_>, b: Input<'_>, classes: Classes) -> Result<Image, BlendError> {
    let (a, b) = in_order(model, a, b)?;
    // Sizes first: a scene's fingerprint says less to a user than the two sizes do.
    let planes = Planes::of(a, b)?;
    same_scene(a, b)?;
    let (weights, nonfinite) = safe_weights(model, &planes)?;
    let mut image = Image::new(a.image.width(), a.image.height());
    let mut colour = mix_colours(&weights, &planes.a, &planes.b);
    for pixel in nonfinite.neither {
        colour[3 * pixel..3 * pixel + 3].fill(0.0);
    }
    image.colour = array3(colour, a.image)?;
    if classes == Classes::Blend {
        let layers = planes.classes.par_iter().map(|c| Ok((c.name.to_owned(), class_layer(c, &weights, a, b)?)));
        image.layers = layers.collect::<Result<_, BlendError>>()?;
    }
    let sums: Vec<f64> = weights.par_chunks(TILE).map(|tile| tile.iter().map(|&w| f64::from(w)).sum()).collect();
    let mean = sums.iter().sum::<f64>() / weights.len().max(1) as f64;
    image.layers.insert(weight_layer(&model.integrators[0]), Layer::Luminance(array2(weights, a.image)?));
    if let Some(scene) = a.image.manifest.get(SCENE_KEY) {
        image.manifest.insert(SCENE_KEY.into(), scene.clone());
    }
    let input = |i: Input<'_>| json!({ "file": i.name, "manifest": i.image.manifest });
    image.manifest.insert(INTEGRATOR_KEY.into(), json!("blend"));
    image.manifest.insert(
        "blend".into(),
        json!({
            "inputs": [input(a), input(b)],
            "integrators": model.integrators,
            "training_hash": model.training_hash,
            "settings": Value::Object(model.settings.clone()),
            "mean_weight": mean,
            "nonfinite_pixels": nonfinite.count,
        }),
    );
    Ok(image)
}

/// Name of the layer that holds the weights of an integrator's image.
pub fn weight_layer(integrator: &str) -> String {
    let name = integrator.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' });
    format!("weight_{}", name.collect::<String>())
}

/// Pixels without a finite colour.
#[derive(Default)]
struct Nonfinite {
    /// In one image or both.
    count: usize,
    /// In both.
    neither: Vec<usize>,
}

impl Nonfinite {
    fn join(mut self, other: Self) -> Self {
        self.count += other.count;
        self.neither.extend(other.neither);
        self
    }
}

fn safe_weights(model: &Model, planes: &Planes<'_>) -> Result<(Vec<f32>, Nonfinite), BlendError> {
    let mut weights = forest_weights(&model.forest, feature_set(model)?, planes);
    let tiles = weights.par_chunks_mut(TILE).enumerate();
    let nonfinite = tiles.map(|(tile, weights)| decide_nonfinite(planes, tile * TILE, weights));
    let nonfinite = nonfinite.reduce(Nonfinite::default, Nonfinite::join);
    Ok((weights, nonfinite))
}

/// Puts all weight on the other image where one's colour is not finite; `weights` are those from pixel `first` on.
fn decide_nonfinite(planes: &Planes<'_>, first: usize, weights: &mut [f32]) -> Nonfinite {
    let mut nonfinite = Nonfinite::default();
    let pixels = planes.a[3 * first..].chunks_exact(3).zip(planes.b[3 * first..].chunks_exact(3));
    // Summing says of a whole pixel in one test whether it is finite: colours near the largest number that overflow are
    // as useless as infinities.
    let finite = |colour: &[f32]| (colour[0] + colour[1] + colour[2]).is_finite();
    for ((i, w), (a, b)) in weights.iter_mut().enumerate().zip(pixels) {
        *w = match (finite(a), finite(b)) {
            (true, true) => continue,
            (true, false) => 1.0,
            (false, true) => 0.0,
            (false, false) => {
                nonfinite.neither.push(first + i);
                UNKNOWN
            }
        };
        nonfinite.count += 1;
    }
    nonfinite
}

/// One path class of the blend; in colour where both images have it so.
fn class_layer(class: &Class<'_>, weights: &[f32], a: Input<'_>, b: Input<'_>) -> Result<Layer, BlendError> {
    if let (Some(Layer::Colour(x)), Some(Layer::Colour(y))) =
        (a.image.layers.get(class.name), b.image.layers.get(class.name))
    {
        let mixed = x.iter().zip(y).enumerate().map(|(i, (&x, &y))| mix(weights[i / 3], x, y));
        return Ok(Layer::Colour(array3(mixed.collect(), a.image)?));
    }
    Ok(Layer::Luminance(array2(mix_planes(weights, class.a.as_ref(), class.b.as_ref()), a.image)?))
}

/// The images in the order of the model's integrators, as far as their manifests say which they are.
fn in_order<'a>(model: &Model, a: Input<'a>, b: Input<'a>) -> Result<(Input<'a>, Input<'a>), BlendError> {
    let of = |i: Input<'a>| text(&i.image.manifest, INTEGRATOR_KEY);
    let [first, second] = &model.integrators;
    let fits = |i: Input<'a>, name: &str| of(i).is_none_or(|found| found == name);
    if fits(a, first) && fits(b, second) {
        return Ok((a, b));
    }
    if fits(b, first) && fits(a, second) {
        return Ok((b, a));
    }
    let known = |i: Input<'a>| of(i).is_none_or(|found| found == first || found == second);
    let (wrong, other) = if known(a) { (b, a) } else { (a, b) };
    Err(BlendError::Content {
        name: wrong.name.to_owned(),
        what: "integrator",
        found: of(wrong).unwrap_or_default().to_owned(),
        expected: format!("one of the model's, `{first}` and `{second}`, and another than in {}", other.name),
    })
}

fn same_scene(a: Input<'_>, b: Input<'_>) -> Result<(), BlendError> {
    for (key, what) in [(SCENE_KEY, "scene hash"), (DEPTH_KEY, "longest path")] {
        match (a.image.manifest.get(key), b.image.manifest.get(key)) {
            (Some(x), Some(y)) if x != y => {
                return Err(BlendError::Content {
                    name: b.name.to_owned(),
                    what,
                    found: y.to_string().trim_matches('"').to_owned(),
                    expected: format!("`{}` as in {}", x.to_string().trim_matches('"'), a.name),
                });
            }
            _ => {}
        }
    }
    Ok(())
}

fn text<'m>(manifest: &'m Map<String, Value>, key: &str) -> Option<&'m str> {
    manifest.get(key).and_then(Value::as_str)
}

fn array2(values: Vec<f32>, like: &Image) -> Result<Array2<f32>, BlendError> {
    Array2::from_shape_vec((like.height(), like.width()), values).map_err(shape_error)
}

fn array3(values: Vec<f32>, like: &Image) -> Result<Array3<f32>, BlendError> {
    Array3::from_shape_vec((like.height(), like.width(), 3), values).map_err(shape_error)
}

fn shape_error(error: ndarray::ShapeError) -> BlendError {
    BlendError::Load { name: "blended image".into(), message: error.to_string() }
}
