//! Path features of pixels: class luminances over the pixel's luminance, which is their sum (Otsu thesis, eq. 5.5).

use std::borrow::Cow;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::noise;
use super::planes::Planes;
use crate::image::luminance;

/// Pixels whose features are computed together: few enough for all channels to stay in the cache, enough for each plane to
/// be read in runs of a page.
pub(super) const TILE: usize = 1024;

/// Distance between a tile's channels. A power of two would put the same pixel of all channels into the same few lines of
/// the cache.
pub(super) const STRIDE: usize = TILE + 16;

/// Which features describe a pixel. The choice is stored in the model, and blending follows it.
///
/// To add one: a variant, its channels in `FeatureSet::channels`, and how they are named and computed in `Channel`; the
/// compiler points at the rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FeatureSet {
    /// Of each class, its share of the light in the mean of the two images; feature names are layer names.
    #[default]
    Mean,
    /// Of each class, its share in image a and its share in image b, as `a.path_*` and `b.path_*`.
    Both,
    /// As [`FeatureSet::Mean`], and `difference` = (A − B) / (A + B) of the two images' luminances, in [−1, 1]: it
    /// shows a firefly in either image, but a model that uses it darkens noisy pixels on average.
    Difference,
    /// As [`FeatureSet::Mean`], and `noise`: b's share of the noise around the pixel, in [0, 1], as the two images show it.
    Noise,
}

/// One number per pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Channel {
    /// Share of a class (by index) in the mean of both images.
    Mean(usize),
    A(usize),
    B(usize),
    Difference,
    Noise,
}

impl FeatureSet {
    fn channels(self, classes: usize) -> Vec<Channel> {
        let mean = (0..classes).map(Channel::Mean);
        match self {
            Self::Mean => mean.collect(),
            Self::Both => (0..classes).map(Channel::A).chain((0..classes).map(Channel::B)).collect(),
            Self::Difference => mean.chain([Channel::Difference]).collect(),
            Self::Noise => mean.chain([Channel::Noise]).collect(),
        }
    }
}

impl Channel {
    fn name(self, planes: &Planes<'_>) -> String {
        match self {
            Self::Mean(k) => planes.classes[k].name.to_owned(),
            Self::A(k) => format!("a.{}", planes.classes[k].name),
            Self::B(k) => format!("b.{}", planes.classes[k].name),
            Self::Difference => "difference".to_owned(),
            Self::Noise => "noise".to_owned(),
        }
    }
}

/// Computes features of two images, tile by tile.
///
/// Classes add up to the image, so the colour's luminance stands for their sum, and only the planes of wanted classes are
/// read: an image may have hundreds, of which a model asks for a few dozen.
#[derive(Debug)]
pub(super) struct Features<'a> {
    planes: &'a Planes<'a>,
    channels: Vec<Channel>,
    names: Vec<String>,
    /// The channel [`Channel::Noise`] per pixel; empty where it is not wanted.
    noise: Vec<f32>,
}

/// Features of up to [`TILE`] neighbouring pixels.
#[derive(Debug)]
pub(super) struct Tile {
    /// Channel c of pixel i stands at `values[c * STRIDE + i]`.
    pub values: Vec<f32>,
    /// Luminance of each pixel in images a and b.
    a: [f32; TILE],
    b: [f32; TILE],
}

impl Tile {
    /// Whether a pixel has any features: some light in one of the images.
    #[inline]
    pub(super) fn known(&self, i: usize) -> bool {
        self.a[i] + self.b[i] > 0.0
    }
}

impl<'a> Features<'a> {
    /// All features of the set that the images have, or only those that `wanted` names.
    pub(super) fn new(set: FeatureSet, planes: &'a Planes<'a>, wanted: Option<&[&str]>) -> Self {
        let channels = set.channels(planes.classes.len()).into_iter().map(|c| (c, c.name(planes)));
        let is_wanted = |name: &str| wanted.is_none_or(|w| w.contains(&name));
        let (channels, names): (Vec<Channel>, _) = channels.filter(|(_, name)| is_wanted(name)).unzip();
        let noise = if channels.contains(&Channel::Noise) { noise::share(planes) } else { Vec::new() };
        Self { planes, channels, names, noise }
    }

    /// Names of the channels, in order.
    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// Memory for one tile.
    pub(super) fn tile(&self) -> Tile {
        Tile { values: vec![0.0; self.channels.len() * STRIDE], a: [0.0; TILE], b: [0.0; TILE] }
    }

    /// Computes the features of the pixels in `range`, at most [`TILE`] of them.
    pub(super) fn fill(&self, range: Range<usize>, tile: &mut Tile) {
        let count = range.len();
        let sums = |plane: &[f32], sums: &mut [f32; TILE]| {
            let colours = plane[3 * range.start..3 * range.end].chunks_exact(3);
            sums.iter_mut().zip(colours).for_each(|(sum, c)| *sum = light(luminance([c[0], c[1], c[2]])));
        };
        sums(&self.planes.a, &mut tile.a);
        sums(&self.planes.b, &mut tile.b);
        let both: [f32; TILE] = std::array::from_fn(|i| reciprocal(tile.a[i] + tile.b[i]));
        let (only_a, only_b) = (tile.a.map(reciprocal), tile.b.map(reciprocal));
        let part = |plane: &'a Option<Cow<'a, [f32]>>| plane.as_deref().map_or(&[][..], |p| &p[range.clone()]);
        for (&channel, out) in self.channels.iter().zip(tile.values.chunks_exact_mut(STRIDE)) {
            let out = &mut out[..count];
            match channel {
                Channel::Mean(k) => {
                    let class = &self.planes.classes[k];
                    shares(part(&class.a), &both, out);
                    add_shares(part(&class.b), &both, out);
                }
                Channel::A(k) => shares(part(&self.planes.classes[k].a), &only_a, out),
                Channel::B(k) => shares(part(&self.planes.classes[k].b), &only_b, out),
                Channel::Noise => out.copy_from_slice(&self.noise[range.clone()]),
                Channel::Difference => (0..count).for_each(|i| out[i] = (tile.a[i] - tile.b[i]) * both[i]),
            }
        }
    }
}

/// A class's light times `scale`, at most 1; nothing where the image lacks the class.
fn shares(plane: &[f32], scale: &[f32; TILE], out: &mut [f32]) {
    if plane.is_empty() {
        out.fill(0.0);
    }
    out.iter_mut().zip(plane).zip(scale).for_each(|((out, &v), scale)| *out = (light(v) * scale).min(1.0));
}

fn add_shares(plane: &[f32], scale: &[f32; TILE], out: &mut [f32]) {
    out.iter_mut().zip(plane).zip(scale).for_each(|((out, &v), scale)| *out = (*out + light(v) * scale).min(1.0));
}

/// Luminance as a feature sees it: negative lobes of a reconstruction filter, NaN and infinities are no light.
#[inline]
fn light(v: f32) -> f32 {
    // The upper bound keeps sums and shares finite.
    if (v > 0.0) & (v < 1e30) { v } else { 0.0 }
}

#[inline]
fn reciprocal(v: f32) -> f32 {
    // Below this the reciprocal would overflow; such a pixel is as dark as one without light.
    if v > 1e-30 { 1.0 / v } else { 0.0 }
}
