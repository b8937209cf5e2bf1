//! Path features of pixels: class luminances over their sum (Otsu thesis, eq. 5.5).

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::noise;
use super::planes::Planes;

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
    /// As [`FeatureSet::Mean`], and `difference` = (A − B) / (A + B) of the two images' summed luminances, in [−1, 1]: it
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
#[derive(Debug)]
pub(super) struct Features<'a> {
    planes: &'a Planes<'a>,
    channels: Vec<Channel>,
    names: Vec<String>,
    /// For each class the channels that its plane in image a, and that in image b, go into.
    outputs: Vec<[Option<usize>; 2]>,
    /// The channel [`Channel::Noise`] per pixel; empty where it is not wanted.
    noise: Vec<f32>,
}

/// Features of up to [`TILE`] neighbouring pixels.
#[derive(Debug)]
pub(super) struct Tile {
    /// Channel c of pixel i stands at `values[c * STRIDE + i]`.
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
        let (channels, names): (Vec<Channel>, _) = channels.filter(|(_, name)| is_wanted(name)).unzip();
        let mut outputs = vec![[None; 2]; planes.classes.len()];
        for (c, &channel) in channels.iter().enumerate() {
            match channel {
                Channel::Mean(k) => outputs[k] = [Some(c); 2],
                Channel::A(k) => outputs[k][0] = Some(c),
                Channel::B(k) => outputs[k][1] = Some(c),
                Channel::Difference | Channel::Noise => {}
            }
        }
        let noise = if channels.contains(&Channel::Noise) { noise::share(planes) } else { Vec::new() };
        Self { planes, channels, names, outputs, noise }
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
    ///
    /// Each plane is read once, for the sums and for its channel together: reading is most of the work.
    pub(super) fn fill(&self, range: Range<usize>, tile: &mut Tile) {
        let count = range.len();
        tile.a = [0.0; TILE];
        tile.b = [0.0; TILE];
        for (class, &[to_a, to_b]) in self.planes.classes.iter().zip(&self.outputs) {
            let mut put = |plane: Option<&[f32]>, sums: &mut [f32; TILE], to: Option<usize>, start_afresh: bool| {
                let out = to.map(|c| &mut tile.values[c * STRIDE..c * STRIDE + count]);
                gather(plane.map(|p| &p[range.clone()]), &mut sums[..count], out, start_afresh);
            };
            put(class.a.as_deref(), &mut tile.a, to_a, true);
            put(class.b.as_deref(), &mut tile.b, to_b, to_a != to_b);
        }
        let both: [f32; TILE] = std::array::from_fn(|i| reciprocal(tile.a[i] + tile.b[i]));
        let (only_a, only_b) = (tile.a.map(reciprocal), tile.b.map(reciprocal));
        for (&channel, out) in self.channels.iter().zip(tile.values.chunks_exact_mut(STRIDE)) {
            let out = &mut out[..count];
            match channel {
                Channel::Mean(_) => scale(out, &both),
                Channel::A(_) => scale(out, &only_a),
                Channel::B(_) => scale(out, &only_b),
                Channel::Noise => out.copy_from_slice(&self.noise[range.clone()]),
                Channel::Difference => (0..count).for_each(|i| out[i] = (tile.a[i] - tile.b[i]) * both[i]),
            }
        }
    }
}

/// Adds the light of a plane to `sums`, and to `out` (or puts it there, to `start_afresh`).
fn gather(plane: Option<&[f32]>, sums: &mut [f32], out: Option<&mut [f32]>, start_afresh: bool) {
    match (plane, out) {
        (None, Some(out)) if start_afresh => out.fill(0.0),
        (None, _) => {}
        (Some(plane), None) => sums.iter_mut().zip(plane).for_each(|(sum, &v)| *sum += light(v)),
        (Some(plane), Some(out)) if start_afresh => {
            for ((sum, out), &v) in sums.iter_mut().zip(out).zip(plane) {
                *out = light(v);
                *sum += *out;
            }
        }
        (Some(plane), Some(out)) => {
            for ((sum, out), &v) in sums.iter_mut().zip(out).zip(plane) {
                let light = light(v);
                *out += light;
                *sum += light;
            }
        }
    }
}

fn scale(out: &mut [f32], by: &[f32; TILE]) {
    out.iter_mut().zip(by).for_each(|(out, by)| *out *= by);
}

/// A class's luminance as a feature sees it: negative lobes of a reconstruction filter, NaN and infinities are no light.
#[inline]
fn light(v: f32) -> f32 {
    // The upper bound keeps sums of all classes finite.
    if (v > 0.0) & (v < 1e30) { v } else { 0.0 }
}

#[inline]
fn reciprocal(v: f32) -> f32 {
    // Below this the reciprocal would overflow; such a pixel is as dark as one without light.
    if v > 1e-30 { 1.0 / v } else { 0.0 }
}
