//! Leave-one-scene-out: what a blend is worth on scenes that its forest has not seen.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::planes::{Planes, colours, same_size};
use super::predict::{forest_weights, linear_weights, mix_colours};
use super::rows::{RowSettings, append};
use super::table::{SceneErrors, Table};
use super::weights::quotient;
use super::{BlendError, Input, Objective};
use crate::forest::{self, Forest, Linear, Quality, Rows, Settings};
use crate::image::Image;

/// Two images of a scene with the same time each, and the reference.
#[derive(Debug, Clone)]
pub struct Pair {
    /// What messages call this pair.
    pub name: String,
    /// By the first integrator.
    pub a: Image,
    /// By the second integrator.
    pub b: Image,
    /// The image both converge to.
    pub reference: Image,
    /// By the first integrator in the whole time, for comparison.
    pub a_alone: Option<Image>,
    /// By the second.
    pub b_alone: Option<Image>,
}

/// How to learn in each fold.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Options {
    /// How pixels become rows.
    pub rows: RowSettings,
    /// How forests are grown.
    pub forest: Settings,
}

/// Trains, for each scene, on the pairs of all others, and measures the blends on its own.
///
/// `scenes` names the scene of each pair; `load` brings a pair into memory by its index. Each is called for twice, and
/// only one is held at a time, because a campaign's images do not fit in memory together.
/// Returns the table, and the rows of all pairs (scene i of the table is group i) for training the final model.
///
/// # Errors
/// [`BlendError::TooFewScenes`] for less than two scenes; those of `load`, [`append`] and training.
pub fn leave_one_out(
    integrators: [String; 2],
    scenes: &[String],
    mut load: impl FnMut(usize) -> Result<Pair, BlendError>,
    options: &Options,
) -> Result<(Table, Rows), BlendError> {
    let mut groups: BTreeMap<&str, (u32, Vec<usize>)> = BTreeMap::new();
    let mut order: Vec<&str> = Vec::new();
    for (pair, scene) in scenes.iter().enumerate() {
        let group = order.len() as u32;
        let entry = groups.entry(scene).or_insert_with(|| {
            order.push(scene);
            (group, Vec::new())
        });
        entry.1.push(pair);
    }
    if order.len() < 2 {
        return Err(BlendError::TooFewScenes { found: order.len() });
    }
    let mut rows = Rows::new();
    for (index, scene) in scenes.iter().enumerate() {
        let pair = load(index)?;
        let settings = RowSettings { seed: options.rows.seed.wrapping_add(index as u64), ..options.rows.clone() };
        let [a, b, reference] = pair.inputs();
        append(&mut rows, a, b, reference, groups[scene.as_str()].0, &settings)?;
    }
    let mut table = Table { integrators, scenes: Vec::new() };
    for scene in order {
        let (group, pairs) = &groups[scene];
        let fold = Fold::learn(&rows, *group, options)?;
        let mut sums = Sums::default();
        for &index in pairs {
            fold.measure(&load(index)?, options, &mut sums)?;
        }
        let held_out = Objective::Plain.outcomes(rows.subset(|g| g == *group))?;
        let weights = Quality::of(&fold.forests[0].predict(&held_out), &held_out).ok();
        table.scenes.push(sums.errors(scene, weights));
    }
    Ok((table, rows))
}

impl Pair {
    fn inputs(&self) -> [Input<'_>; 3] {
        let input = |image| Input::new(&self.name, image);
        [input(&self.a), input(&self.b), input(&self.reference)]
    }
}

/// What was learnt without one scene.
struct Fold {
    /// In the order of [`Objective::ALL`].
    forests: Vec<Forest>,
    linear: Linear,
}

impl Fold {
    fn learn(rows: &Rows, without: u32, options: &Options) -> Result<Self, BlendError> {
        let rows = rows.subset(|g| g != without);
        let mut forests = Vec::new();
        for objective in Objective::ALL {
            forests.push(forest::train(&objective.outcomes(rows.clone())?, &options.forest)?);
        }
        let linear = Linear::fit(&Objective::BlendError.outcomes(rows)?)?;
        Ok(Self { forests, linear })
    }

    fn measure(&self, pair: &Pair, options: &Options, sums: &mut Sums) -> Result<(), BlendError> {
        let [a, b, reference] = pair.inputs();
        same_size(reference, a)?;
        let planes = Planes::of(a, b)?;
        let truth = colours(reference.image);
        let set = options.rows.features;
        let forests = self.forests.iter().map(|f| forest_weights(f, set, &planes));
        let linear = linear_weights(&self.linear, set, &planes);
        let average = vec![0.5; planes.pixels];
        let maps = [average, optimal(&planes, &truth), linear].into_iter().chain(forests);
        let blends = maps.map(|w| mse(&mix_colours(&w, &planes.a, &planes.b), &truth));
        let errors: Vec<f64> = [mse(&planes.a, &truth), mse(&planes.b, &truth)].into_iter().chain(blends).collect();
        sums.add(errors);
        for (image, total) in [(&pair.a_alone, &mut sums.a_alone), (&pair.b_alone, &mut sums.b_alone)] {
            if let Some(image) = image {
                same_size(Input::new(&pair.name, image), a)?;
                total.push(mse(&colours(image), &truth));
            }
        }
        Ok(())
    }
}

/// Mean squared errors, run by run.
#[derive(Default)]
struct Sums {
    runs: Vec<Vec<f64>>,
    a_alone: Vec<f64>,
    b_alone: Vec<f64>,
}

impl Sums {
    fn add(&mut self, errors: Vec<f64>) {
        self.runs.push(errors);
    }

    fn errors(&self, scene: &str, weights: Option<Quality>) -> SceneErrors {
        let rmse = |errors: &[f64]| (errors.iter().sum::<f64>() / errors.len() as f64).sqrt();
        let column = |c: usize| rmse(&self.runs.iter().map(|r| r[c]).collect::<Vec<f64>>());
        let alone = |errors: &[f64]| (!errors.is_empty()).then(|| rmse(errors));
        SceneErrors {
            scene: scene.to_owned(),
            runs: self.runs.len(),
            a: column(0),
            b: column(1),
            a_alone: alone(&self.a_alone),
            b_alone: alone(&self.b_alone),
            average: column(2),
            optimal: column(3),
            linear: column(4),
            forest_plain: column(5),
            forest_error_weighted: column(6),
            forest_blend_error: column(7),
            weights,
        }
    }
}

/// Each pixel's optimal weight; 0.5 where any is.
fn optimal(planes: &Planes<'_>, truth: &[f32]) -> Vec<f32> {
    let pixel = |plane: &[f32], i: usize| [plane[3 * i], plane[3 * i + 1], plane[3 * i + 2]];
    let one = |i| quotient(pixel(&planes.a, i), pixel(&planes.b, i), pixel(truth, i)).map_or(0.5, |q| q.clamped());
    (0..planes.pixels).map(one).collect()
}

/// Mean squared error over all channels; values that are not finite are left out.
fn mse(image: &[f32], truth: &[f32]) -> f64 {
    let squares = image.iter().zip(truth).map(|(&x, &y)| (f64::from(x) - f64::from(y)).powi(2));
    let (sum, count) = squares.filter(|s| s.is_finite()).fold((0.0, 0usize), |(sum, n), s| (sum + s, n + 1));
    sum / count.max(1) as f64
}
