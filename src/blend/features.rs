//! Path features of pixels: class luminances over their sum (Otsu thesis, eq. 5.5).

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::planes::Planes;

/// Pixels whose features are computed together: their planes stay in the nearest caches.
pub(super) const TILE: usize = 128;

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
    /// As [`FeatureSet::Mean`], and `difference` = (A − B) / (A + B) of the two images' summed luminances, in [−1, 1]: it
    /// shows a firefly in either image, but a model that uses it darkens noisy pixels on average.
    Difference,
}

/// One number per pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Channel {
    /// Share of a class (by index) in the mean of both images.
    Mean(usize),
    A(usize),
    B(usize),
    Difference,
}

impl FeatureSet {
    fn channels(self, classes: usize) -> Vec<Channel> {
        let mean = (0..classes).map(Channel::Mean);
        match self {
            Self::Mean => mean.collect(),
            Self::Both => (0..classes).map(Channel::A).chain((0..classes).map(Channel::B)).collect(),
            Self::Difference => mean.chain([Channel::Difference]).collect(),
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
        }
    }
}

/// Computes features of two images, tile by tile.
#[derive(Debug)]
pub(super) struct Features<'a> {
    planes: &'a Planes<'a>,
    channels: Vec<Channel>,
    names: Vec<String>,
}

/// Features of up to [`TILE`] neighbouring pixels.
#[derive(Debug)]
pub(super) struct Tile {
    /// Channel c of pixel i stands at `values[c * TILE + i]`.
    pub values: Vec<f32>,
    /// Summed class luminance of each pixel in images a and b.
    a: [f32; TILE],
    b: [f32; TILE],
}

impl Tile {
    /// Whether a pixel has any features: some light in some class.
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
        let (channels, names) = channels.filter(|(_, name)| is_wanted(name)).unzip();
        Self { planes, channels, names }
    }

    /// Names of the channels, in order.
    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// Memory for one tile.
    pub(super) fn tile(&self) -> Tile {
        Tile { values: vec![0.0; self.channels.len() * TILE], a: [0.0; TILE], b: [0.0; TILE] }
    }

    /// Computes the features of the pixels in `range`, at most [`TILE`] of them.
    pub(super) fn fill(&self, range: Range<usize>, tile: &mut Tile) {
        let count = range.len();
        tile.a = [0.0; TILE];
        tile.b = [0.0; TILE];
        for class in &self.planes.classes {
            for (plane, sums) in [(&class.a, &mut tile.a), (&class.b, &mut tile.b)] {
                if let Some(plane) = plane {
                    sums.iter_mut().zip(&plane[range.clone()]).for_each(|(sum, &v)| *sum += light(v));
                }
            }
        }
        let both: [f32; TILE] = std::array::from_fn(|i| reciprocal(tile.a[i] + tile.b[i]));
        let (only_a, only_b) = (tile.a.map(reciprocal), tile.b.map(reciprocal));
        for (&channel, out) in self.channels.iter().zip(tile.values.chunks_exact_mut(TILE)) {
            let out = &mut out[..count];
            match channel {
                Channel::Mean(k) => {
                    let class = &self.planes.classes[k];
                    out.fill(0.0);
                    add(out, class.a.as_deref(), &range);
                    add(out, class.b.as_deref(), &range);
                    scale(out, &both);
                }
                Channel::A(k) => {
                    out.fill(0.0);
                    add(out, self.planes.classes[k].a.as_deref(), &range);
                    scale(out, &only_a);
                }
                Channel::B(k) => {
                    out.fill(0.0);
                    add(out, self.planes.classes[k].b.as_deref(), &range);
                    scale(out, &only_b);
                }
                Channel::Difference => {
                    (0..count).for_each(|i| out[i] = (tile.a[i] - tile.b[i]) * both[i]);
                }
            }
        }
    }
}

fn add(out: &mut [f32], plane: Option<&[f32]>, range: &Range<usize>) {
    if let Some(plane) = plane {
        out.iter_mut().zip(&plane[range.clone()]).for_each(|(out, &v)| *out += light(v));
    }
}

fn scale(out: &mut [f32], by: &[f32; TILE]) {
    out.iter_mut().zip(by).for_each(|(out, by)| *out *= by);
}

/// A class's luminance as a feature sees it: negative lobes of a reconstruction filter, NaN and infinities are no light.
#[inline]
fn light(v: f32) -> f32 {
    // The upper bound keeps sums of all classes finite.
    if v > 0.0 && v < 1e30 { v } else { 0.0 }
}

#[inline]
fn reciprocal(v: f32) -> f32 {
    // Below this the reciprocal would overflow; such a pixel is as dark as one without light.
    if v > 1e-30 { 1.0 / v } else { 0.0 }
}
