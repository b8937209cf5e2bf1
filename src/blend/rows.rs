//! Training rows from two images and their reference.

use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::{Deserialize, Serialize};

use super::features::{FeatureSet, Features, STRIDE, TILE};
use super::planes::{Planes, colours, same_size};
use super::weights::{Quotient, quotient};
use super::{BlendError, Input};
use crate::forest::Rows;

/// How pixels become rows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RowSettings {
    /// What describes a pixel.
    pub features: FeatureSet,
    /// Most rows per pair of images; more pixels are thinned out at random. ≥ 1.
    pub max_rows: usize,
    /// Stakes |I_a − I_b|² above this quantile of the pair's are lowered to it, in (0, 1]; 1 lowers none.
    ///
    /// A Monte Carlo image's squared errors have a heavy tail: a handful of fireflies can hold most of the total, and trees
    /// that chase them learn the accidents of one run. Lowered, a firefly still counts as much as any of the worst pixels.
    pub stake_quantile: f64,
    /// Seed of the thinning.
    pub seed: u64,
}

impl Default for RowSettings {
    fn default() -> Self {
        Self { features: FeatureSet::Mean, max_rows: 50_000, stake_quantile: 0.99, seed: 1 }
    }
}

impl RowSettings {
    pub(super) fn check(&self) -> Result<(), BlendError> {
        if !(self.stake_quantile > 0.0 && self.stake_quantile <= 1.0) {
            let (name, found) = ("stake_quantile", self.stake_quantile.to_string());
            return Err(BlendError::Setting { name, found, expected: "more than 0, up to 1" });
        }
        if self.max_rows == 0 {
            return Err(BlendError::Setting { name: "max_rows", found: "0".into(), expected: "1 or more" });
        }
        Ok(())
    }
}

/// Appends one row per pixel (or a random choice of them) of a pair of images with its reference.
///
/// A row's target is the unclamped [`Quotient::weight`] of image a, its weight the stake |I_a − I_b|², capped (see
/// [`RowSettings::stake_quantile`]) and scaled so that the mean over the pair's rows is 1: brighter scenes and longer
/// renders would otherwise count for more or less than others, though what is judged is each scene's error beside that
/// of its own inputs. [`super::Objective`] turns rows into the outcomes that a forest is to learn.
/// Pixels without features, without a finite value or where the images agree have weight 0 and are left out.
/// `group` is the scene's number. Returns the number of rows appended.
///
/// # Errors
/// [`BlendError::Size`], [`BlendError::NoLayers`], [`BlendError::LayerShape`], [`BlendError::Setting`].
pub fn append(
    rows: &mut Rows,
    a: Input<'_>,
    b: Input<'_>,
    reference: Input<'_>,
    group: u32,
    settings: &RowSettings,
) -> Result<usize, BlendError> {
    settings.check()?;
    same_size(reference, a)?;
    let planes = Planes::of(a, b)?;
    let features = Features::new(settings.features, &planes, None);
    let chosen = choose(&planes, &colours(reference.image), settings);
    let cap = quantile(chosen.iter().map(|(_, q)| q.stake).collect(), settings.stake_quantile);
    let total: f64 = chosen.iter().map(|(_, q)| q.stake.min(cap)).sum();
    let scale = chosen.len() as f64 / total.max(f64::MIN_POSITIVE);
    let columns = features.names().iter().map(|n| rows.feature(n)).collect::<Result<Vec<u16>, _>>()?;
    let mut tile = features.tile();
    let (mut entries, mut appended, mut next) = (Vec::new(), 0, 0);
    for start in (0..planes.pixels).step_by(TILE) {
        let range = start..(start + TILE).min(planes.pixels);
        let end = next + chosen[next..].partition_point(|(p, _)| *p < range.end);
        if end == next {
            continue;
        }
        features.fill(range, &mut tile);
        for &(pixel, quotient) in &chosen[next..end] {
            let i = pixel - start;
            if tile.known(i) {
                entries.clear();
                entries.extend(columns.iter().enumerate().map(|(c, &column)| (column, tile.values[c * STRIDE + i])));
                entries.retain(|e| e.1 != 0.0);
                rows.push(&entries, quotient.weight, (quotient.stake.min(cap) * scale) as f32, group)?;
                appended += 1;
            }
        }
        next = end;
    }
    Ok(appended)
}

/// The pixels that have an optimal weight, thinned to at most `max_rows`, in order.
fn choose(planes: &Planes<'_>, reference: &[f32], settings: &RowSettings) -> Vec<(usize, Quotient)> {
    let pixel = |plane: &[f32], i: usize| [plane[3 * i], plane[3 * i + 1], plane[3 * i + 2]];
    let of = |i| quotient(pixel(&planes.a, i), pixel(&planes.b, i), pixel(reference, i)).map(|q| (i, q));
    let all: Vec<(usize, Quotient)> = (0..planes.pixels).filter_map(of).collect();
    // Selection sampling (Knuth, TAOCP 2, algorithm 3.4.2 S) keeps the order and takes exactly what is wanted.
    let mut random = Xoshiro256PlusPlus::seed_from_u64(settings.seed);
    let (mut left, mut wanted) = (all.len(), settings.max_rows.min(all.len()));
    let mut take = |_: &(usize, Quotient)| {
        let taken = random.random_range(0..left) < wanted;
        left -= 1;
        wanted -= usize::from(taken);
        taken
    };
    all.into_iter().filter(|q| take(q)).collect()
}

/// The value below which a share `q` of the values lies; infinite without values.
fn quantile(mut values: Vec<f64>, q: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let index = (values.len() as f64 * q).ceil() as usize;
    values.get(index.clamp(1, values.len().max(1)) - 1).copied().unwrap_or(f64::INFINITY)
}
