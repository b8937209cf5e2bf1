//! One image from several runs that differ in their seeds alone.
//!
//! Passes of all runs are alike, so colour and class layers are means weighted by passes. With n_i of the n passes in run i
//! and V_i the variance of its mean, the variance of the merged mean is Σ (n_i / n)² V_i, as runs are independent. Their
//! spread tells the same once more: Σ n_i (x_i − m)² / ((N − 1) n) for N runs with the means x_i and the mean m of all.

use super::render::OPTIONS_KEY;
use crate::film::{Health, VARIANCE_LAYER};
use crate::image::metrics::Expected;
use crate::image::{DEPTH_KEY, INTEGRATOR_KEY, Image, Layer, SCENE_KEY};
use ndarray::{Array, Array2, Array3, Dimension};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Why images are not runs of one render.
#[derive(Debug, thiserror::Error)]
pub enum MergeError {
    /// Not enough to merge.
    #[error("nothing to merge: expected at least two images, found {0}")]
    Few(usize),
    /// Not by this program, or by a verb that does not render.
    #[error(
        "{name}: no proper `{key}` in its manifest; expected an image by `pathblend render`, `reference` or `merge`"
    )]
    Manifest {
        /// The image.
        name: String,
        /// The key that is missing or has another type.
        key: &'static str,
    },
    /// Images of different things.
    #[error("{name}: {what} {found}, but {expected} in {first}; expected runs that differ in their seeds alone")]
    Differs {
        /// The image.
        name: String,
        /// What differs.
        what: &'static str,
        /// What it is in this image.
        found: String,
        /// What it is in the first image.
        expected: String,
        /// The first image.
        first: String,
    },
    /// The same random numbers twice.
    #[error("{name}: seed {seed}, as in {other}: the same passes twice are no new ones; expected different seeds")]
    Seed {
        /// The image.
        name: String,
        /// An earlier one.
        other: String,
        /// The seed of both.
        seed: u64,
    },
}

/// The passes of one seed.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Seed {
    seed: u64,
    passes: u64,
}

/// An image by its name, and what its manifest says of its passes.
struct Run<'a> {
    name: &'a str,
    image: &'a Image,
    seeds: Vec<Seed>,
    passes: u64,
}

impl<'a> Run<'a> {
    fn of((name, image): &'a (String, Image)) -> Result<Self, MergeError> {
        let missing = |key| MergeError::Manifest { name: name.clone(), key };
        let number = |key| image.manifest.get(key).and_then(Value::as_u64).ok_or_else(|| missing(key));
        let passes = Some(number("passes")?).filter(|passes| *passes > 0).ok_or_else(|| missing("passes"))?;
        let seeds = match image.manifest.get("seeds") {
            Some(seeds) => Vec::deserialize(seeds).map_err(|_| missing("seeds"))?,
            None => vec![Seed { seed: number("seed")?, passes }],
        };
        Ok(Self { name, image, seeds, passes })
    }

    fn luminance(&self, layer: &str) -> Option<&'a Array2<f32>> {
        match self.image.layers.get(layer) {
            Some(Layer::Luminance(plane)) => Some(plane),
            _ => None,
        }
    }

    fn variance(&self) -> Option<&'a Array3<f32>> {
        match self.image.layers.get(VARIANCE_LAYER) {
            Some(Layer::Colour(variance)) => Some(variance),
            _ => None,
        }
    }

    /// What must be the same in all runs.
    fn identity(&self) -> Result<[(&'static str, String); 6], MergeError> {
        let word = |key: &'static str| match self.image.manifest.get(key) {
            Some(Value::String(word)) => Ok(word.clone()),
            Some(value @ (Value::Number(_) | Value::Object(_))) => Ok(value.to_string()),
            _ => Err(MergeError::Manifest { name: self.name.to_owned(), key }),
        };
        let has_layers = self.image.layers.keys().any(|name| is_class(name));
        Ok([
            ("size", format!("{} × {}", self.image.width(), self.image.height())),
            ("scene", word(SCENE_KEY)?),
            ("method", word(INTEGRATOR_KEY)?),
            ("longest path", word(DEPTH_KEY)?),
            ("options", word(OPTIONS_KEY)?),
            ("path layers", if has_layers { "present" } else { "absent" }.to_owned()),
        ])
    }
}

fn is_class(layer: &str) -> bool {
    layer.starts_with("path_")
}

/// The mean of all passes of the images `named`, which are runs of one render with different seeds: colour, class layers,
/// and the variance where all have one. The manifest has the sums of passes, samples, rays and times, all seeds with their
/// passes, and the error expected by the variances (`relative`) and by the spread of the runs (`runs`).
///
/// # Errors
/// [`MergeError`], naming the image and what differs.
pub fn merge(named: &[(String, Image)]) -> Result<Image, MergeError> {
    let runs = named.iter().map(Run::of).collect::<Result<Vec<_>, _>>()?;
    let [first, others @ ..] = &runs[..] else { return Err(MergeError::Few(0)) };
    if others.is_empty() {
        return Err(MergeError::Few(1));
    }
    check(&runs)?;
    let total = runs.iter().map(|run| run.passes).sum::<u64>() as f64;
    let share = |run: &Run<'_>| run.passes as f64 / total;
    let mut image = Image::new(first.image.width(), first.image.height());
    image.colour = sum(runs.iter().map(|run| (&run.image.colour, share(run))), image.colour.raw_dim());
    for name in first.image.layers.keys().chain(others.iter().flat_map(|run| run.image.layers.keys())) {
        if is_class(name) && !image.layers.contains_key(name) {
            // Where a class has no layer it has no light.
            let planes = runs.iter().filter_map(|run| Some((run.luminance(name)?, share(run))));
            let plane = sum(planes, ndarray::Dim([image.height(), image.width()]));
            image.layers.insert(name.clone(), Layer::Luminance(plane));
        }
    }
    let variances: Option<Vec<_>> = runs.iter().map(|run| Some((run.variance()?, share(run).powi(2)))).collect();
    let variance = variances.map(|variances| sum(variances.into_iter(), image.colour.raw_dim()));
    let spread = spread(&runs, &image.colour, total);
    image.manifest = manifest(&runs, &image.colour, variance.as_ref(), &spread);
    image.layers.extend(variance.map(|variance| (VARIANCE_LAYER.to_owned(), Layer::Colour(variance))));
    Ok(image)
}

/// Checks that the runs differ in their seeds, and in nothing else.
fn check(runs: &[Run<'_>]) -> Result<(), MergeError> {
    let identities = runs.iter().map(Run::identity).collect::<Result<Vec<_>, _>>()?;
    let mut seeds = BTreeMap::new();
    for (run, identity) in runs.iter().zip(&identities) {
        for ((what, found), (_, expected)) in identity.iter().zip(&identities[0]) {
            if found != expected {
                let (found, expected) = (found.clone(), expected.clone());
                let (name, first) = (run.name.to_owned(), runs[0].name.to_owned());
                return Err(MergeError::Differs { name, what, found, expected, first });
            }
        }
        for &Seed { seed, .. } in &run.seeds {
            if let Some(other) = seeds.insert(seed, run.name) {
                return Err(MergeError::Seed { name: run.name.to_owned(), other: other.to_owned(), seed });
            }
        }
    }
    Ok(())
}

/// Σ w x over `parts`, formed in double precision.
fn sum<'a, D: Dimension + 'a>(parts: impl Iterator<Item = (&'a Array<f32, D>, f64)>, shape: D) -> Array<f32, D> {
    let mut sum = Array::<f64, D>::zeros(shape);
    for (part, weight) in parts {
        sum.zip_mut_with(part, |sum, value| *sum += weight * f64::from(*value));
    }
    sum.mapv(|value| value as f32)
}

/// Variance of `mean`, that of all runs, by how far the runs are from it.
fn spread(runs: &[Run<'_>], mean: &Array3<f32>, total: f64) -> Array3<f32> {
    let freedom = (runs.len() - 1) as f64;
    let deviation = |run: &Run<'_>| (&run.image.colour - mean).mapv(|difference| difference * difference);
    let squares: Vec<_> = runs.iter().map(|run| (deviation(run), run.passes as f64 / (freedom * total))).collect();
    sum(squares.iter().map(|(square, weight)| (square, *weight)), mean.raw_dim())
}

fn manifest(
    runs: &[Run<'_>],
    colour: &Array3<f32>,
    variance: Option<&Array3<f32>>,
    spread: &Array3<f32>,
) -> Map<String, Value> {
    let first = &runs[0].image.manifest;
    let values = |key: &'static str| runs.iter().filter_map(move |run| run.image.manifest.get(key));
    let mut manifest = Map::new();
    for key in ["software", SCENE_KEY, INTEGRATOR_KEY, DEPTH_KEY, OPTIONS_KEY] {
        manifest.extend(first.get(key).map(|value| (key.to_owned(), value.clone())));
    }
    let mut set = |key: &str, value: Value| manifest.insert(key.to_owned(), value);
    set("seeds", json!(runs.iter().flat_map(|run| &run.seeds).collect::<Vec<_>>()));
    set("passes", json!(runs.iter().map(|run| run.passes).sum::<u64>()));
    for key in ["wall_s", "cpu_s", "samples_per_pixel"] {
        set(key, json!(values(key).filter_map(Value::as_f64).sum::<f64>()));
    }
    for key in ["samples", "rays"] {
        set(key, json!(values(key).filter_map(Value::as_u64).sum::<u64>()));
    }
    let mut health = Health::default();
    values("health").filter_map(|value| Health::deserialize(value).ok()).for_each(|other| health.add(&other));
    set("health", json!(health));
    let mut error = Map::new();
    if let Some(expected) = variance.and_then(|variance| Expected::of(colour.view(), variance.view())) {
        error.insert("relative".to_owned(), json!(expected.relative));
        error.insert("relative_trimmed".to_owned(), json!(expected.relative_trimmed));
    }
    error.insert("runs".to_owned(), json!(Expected::of(colour.view(), spread.view()).map(|found| found.relative)));
    set("error", Value::Object(error));
    let classes: Map<String, Value> = values("classes").filter_map(Value::as_object).flat_map(Map::clone).collect();
    set("classes", Value::Object(classes));
    manifest
}

/// What `merge --json` prints: published, stable names.
pub fn summary(merged: &Image) -> Map<String, Value> {
    const PUBLISHED: [&str; 9] =
        [INTEGRATOR_KEY, "seeds", "wall_s", "cpu_s", "samples", "rays", "passes", "health", "error"];
    let entries = PUBLISHED.iter().filter_map(|key| merged.manifest.get_key_value(*key));
    entries.map(|(key, value)| (key.clone(), value.clone())).collect()
}
