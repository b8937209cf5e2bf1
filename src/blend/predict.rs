//! Weight maps: a trained regressor's answer at every pixel.

use std::borrow::Cow;

use rayon::prelude::*;

use super::BlendError;
use super::features::{FeatureSet, Features, STRIDE, TILE, Tile};
use super::planes::Planes;
use crate::forest::{Forest, LANES, Lanes, Linear, Model};

/// The weight of a pixel of which nothing is known (thesis, section 5.5).
pub(super) const UNKNOWN: f32 = 0.5;

/// The features that a model was trained on.
pub(super) fn feature_set(model: &Model) -> Result<FeatureSet, BlendError> {
    let found = model.settings.get("features").cloned().unwrap_or_default();
    serde_json::from_value(found.clone()).map_err(|_| BlendError::FeatureSet { found: found.to_string() })
}

/// The weight of image a at every pixel by a forest; features that the images lack are 0.
pub(super) fn forest_weights(forest: &Forest, set: FeatureSet, planes: &Planes<'_>) -> Vec<f32> {
    let used: Vec<&str> = forest.used_features().iter().map(|&f| forest.features()[usize::from(f)].as_str()).collect();
    let features = Features::new(set, planes, Some(&used));
    let lanes = Lanes::new(forest, &positions(forest.features(), &features), STRIDE / LANES);
    weights(&features, planes.pixels, |tile, out| lanes.predict(tile.values.as_chunks().0, out))
}

/// The same by the linear baseline.
pub(super) fn linear_weights(linear: &Linear, set: FeatureSet, planes: &Planes<'_>) -> Vec<f32> {
    let features = Features::new(set, planes, None);
    let positions = positions(linear.features(), &features);
    weights(&features, planes.pixels, |tile, out| {
        for (i, out) in out.iter_mut().enumerate() {
            let value = |f: u16| positions[usize::from(f)].map_or(0.0, |p| tile.values[p * STRIDE + i]);
            *out = linear.predict_with(value);
        }
    })
}

/// Where each of the regressor's features stands among those computed.
fn positions(wanted: &[String], features: &Features<'_>) -> Vec<Option<usize>> {
    wanted.iter().map(|name| features.names().iter().position(|n| n == name)).collect()
}

fn weights(features: &Features<'_>, pixels: usize, predict: impl Fn(&Tile, &mut [f32]) + Sync) -> Vec<f32> {
    let mut weights = vec![UNKNOWN; pixels];
    weights.par_chunks_mut(TILE).enumerate().for_each_init(
        || features.tile(),
        |tile, (task, out)| {
            features.fill(task * TILE..task * TILE + out.len(), tile);
            predict(tile, out);
            out.iter_mut().enumerate().filter(|(i, _)| !tile.known(*i)).for_each(|(_, w)| *w = UNKNOWN);
        },
    );
    weights
}

/// The blend of two images' colours by the weights of a, three numbers per pixel.
pub(super) fn mix_colours(weights: &[f32], a: &[f32], b: &[f32]) -> Vec<f32> {
    let mut out = vec![0.0f32; a.len()];
    out.par_chunks_mut(3 * TILE).enumerate().for_each(|(task, out)| {
        let first = task * TILE;
        let weights = &weights[first..first + out.len() / 3];
        let (a, b) = (&a[3 * first..], &b[3 * first..]);
        for (i, &w) in weights.iter().enumerate() {
            for c in 3 * i..3 * i + 3 {
                out[c] = mix(w, a[c], b[c]);
            }
        }
    });
    out
}

/// One number per pixel, blended; an image without the class has none of its light.
pub(super) fn mix_planes(weights: &[f32], a: Option<&Cow<'_, [f32]>>, b: Option<&Cow<'_, [f32]>>) -> Vec<f32> {
    let at = |plane: Option<&Cow<'_, [f32]>>, i: usize| plane.map_or(0.0, |p| p[i]);
    weights.iter().enumerate().map(|(i, &w)| mix(w, at(a, i), at(b, i))).collect()
}

/// w a + (1 − w) b, exactly b where both are equal, and free of what has no weight, be it NaN.
#[inline]
pub(super) fn mix(w: f32, a: f32, b: f32) -> f32 {
    let mixed = b + w * (a - b);
    let mixed = if w > 0.0 { mixed } else { b };
    if w < 1.0 { mixed } else { a }
}
