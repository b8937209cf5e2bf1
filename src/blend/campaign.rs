//! Training campaigns: what a recipe asks for is rendered where it is missing, learnt from, and judged
//! leave-one-scene-out (thesis, section 5.5).
//!
//! Every image of a campaign is cached by the fingerprint of all that decides it, so that an interrupted campaign goes on
//! where it stopped and recipes share what they have in common. What a method does in a given time is decided by the
//! sources of the renderer too, so their fingerprint is part of it; references are the same by any sound renderer.

use super::{BlendError, Objective, Options, Pair, Table, leave_one_out, train};
use crate::forest::Model;
use crate::image::{Image, WriteOptions};
use crate::integrators::{Budget, Method, Settings, render};
use crate::load;
use crate::scene::Scene;
use ndarray::Zip;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Longest time, in seconds.
const LONGEST: f64 = 1e7;

/// Seeds of the two halves of a reference; no training run may use them.
const REFERENCE_SEEDS: [u64; 2] = [1 << 40, (1 << 40) + 1];

/// A campaign, as its TOML file has it. Times are processor seconds, so that they mean the same on a busy machine.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// The two methods; the model predicts the weight of the first.
    pub integrators: [Method; 2],
    /// Film size of all renders, in pixels.
    pub size: [usize; 2],
    /// Times per image. Blends at time t are compared with single methods at 2 t.
    pub times: Vec<f64>,
    /// Seeds; each is one run per scene and time.
    pub seeds: Vec<u64>,
    /// How references are rendered, where a scene says nothing else.
    pub reference: Reference,
    /// What the final forest is to get right.
    #[serde(default)]
    pub objective: Objective,
    /// How rows are made and forests grown.
    #[serde(default)]
    pub learning: Options,
    /// The scenes.
    pub scenes: Vec<RecipeScene>,
}

/// How a reference is rendered.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Reference {
    /// An unbiased method.
    pub integrator: Method,
    /// Processor seconds.
    pub time: f64,
}

/// A scene of a campaign.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct RecipeScene {
    /// Scene file, relative to the recipe's folder.
    pub file: PathBuf,
    /// How its reference is rendered, instead of the recipe's way.
    pub reference: Option<Reference>,
}

impl RecipeScene {
    /// The folder that the scene file is in, which a scene is called by.
    pub fn name(&self) -> String {
        let folder = self.file.parent().and_then(Path::file_name).unwrap_or(self.file.as_os_str());
        folder.to_string_lossy().into_owned()
    }

    /// Fails where two scenes have one name.
    pub(crate) fn tell_apart(scenes: &[Self]) -> Result<(), String> {
        match repeated(scenes.iter().map(Self::name)) {
            Some(name) => Err(format!("two scenes are called `{name}` after their folder; expected one")),
            None => Ok(()),
        }
    }
}

/// A name that occurs more than once.
pub(crate) fn repeated(names: impl Iterator<Item = String>) -> Option<String> {
    let mut seen = std::collections::BTreeSet::new();
    names.into_iter().find(|name| !seen.insert(name.clone()))
}

/// What a campaign found.
pub struct Findings {
    /// The model trained on all scenes, with the table and the references' errors on record.
    pub model: Model,
    /// Errors leave-one-scene-out.
    pub table: Table,
    /// Per scene the root mean squared error of its reference, estimated from the difference of its halves.
    pub reference_errors: Vec<(String, f64)>,
}

/// An image that a campaign needs.
struct Task<'a> {
    scene: &'a Scene,
    name: &'a str,
    method: Method,
    time: f64,
    seed: u64,
}

impl Recipe {
    /// Reads a recipe.
    ///
    /// # Errors
    /// [`BlendError::Load`] with the place in the file and what was expected there.
    pub fn read(path: &Path) -> Result<Self, BlendError> {
        let fail = |message: String| BlendError::Load { name: path.display().to_string(), message };
        let text = std::fs::read_to_string(path).map_err(|error| fail(error.to_string()))?;
        let recipe: Self = toml::from_str(&text).map_err(|error| fail(error.to_string()))?;
        let positive = |time: f64| time > 0.0 && time <= LONGEST;
        if recipe.integrators[0] == recipe.integrators[1] {
            return Err(fail("`integrators` names one method twice; expected two methods".into()));
        }
        if recipe.times.is_empty() || !recipe.times.iter().all(|t| positive(*t)) || recipe.seeds.is_empty() {
            return Err(fail("expected at least one time from 0 to 1e7 in `times` and one seed in `seeds`".into()));
        }
        if recipe.seeds.iter().any(|seed| REFERENCE_SEEDS.contains(seed)) {
            return Err(fail("`seeds` holds a seed that is reserved for references".into()));
        }
        let references = recipe.scenes.iter().filter_map(|s| s.reference).chain([recipe.reference]);
        for reference in references {
            if reference.integrator == Method::Sppm {
                return Err(fail("a reference by sppm would be biased; expected path, bdpt or mmlt".into()));
            }
            if !positive(reference.time) {
                return Err(fail("expected a reference time from 0 to 1e7".into()));
            }
        }
        RecipeScene::tell_apart(&recipe.scenes).map_err(fail)?;
        if recipe.scenes.len() < 2 {
            return Err(BlendError::TooFewScenes { found: recipe.scenes.len() });
        }
        recipe.learning.rows.check()?;
        recipe.learning.forest.check()?;
        Ok(recipe)
    }

    /// Renders what is missing, judges and trains. `folder` is what scene files are relative to, `cache` where images
    /// are kept; `log` gets a line for each image that is rendered.
    ///
    /// # Errors
    /// Scenes that do not load, images that cannot be written or read, and those of [`leave_one_out`] and [`train`].
    pub fn run(&self, folder: &Path, cache: &Path, mut log: impl FnMut(&str)) -> Result<Findings, BlendError> {
        let io = |error: std::io::Error| failed(&cache.display().to_string(), error);
        std::fs::create_dir_all(cache).map_err(io)?;
        let scenes = self.load_scenes(folder)?;
        let mut reference_errors = Vec::new();
        let mut references = Vec::new();
        for ((name, scene), entry) in scenes.iter().zip(&self.scenes) {
            let (image, error) = self.reference(name, scene, entry, cache, &mut log)?;
            reference_errors.push((name.clone(), error));
            references.push(image);
        }
        let mut runs = Vec::new();
        for (index, (name, scene)) in scenes.iter().enumerate() {
            for &time in &self.times {
                for &seed in &self.seeds {
                    for (method, time) in self.integrators.into_iter().flat_map(|m| [(m, time), (m, 2.0 * time)]) {
                        Task { scene, name, method, time, seed }.ensure(cache, &mut log)?;
                    }
                    runs.push((index, time, seed));
                }
            }
        }
        let names: Vec<String> = runs.iter().map(|(index, ..)| scenes[*index].0.clone()).collect();
        let integrators = self.integrators.map(|method| method.name().to_owned());
        let pair = |run: usize| {
            let (index, time, seed) = runs[run];
            let (name, scene) = &scenes[index];
            let read = |method, time| Task { scene, name, method, time, seed }.read(cache);
            let [a, b] = self.integrators;
            Ok(Pair {
                name: format!("{name}, {time} s, seed {seed}"),
                a: read(a, time)?,
                b: read(b, time)?,
                reference: references[index].clone(),
                a_alone: Some(read(a, 2.0 * time)?),
                b_alone: Some(read(b, 2.0 * time)?),
            })
        };
        log("learning leave-one-scene-out");
        let (table, rows) = leave_one_out(integrators.clone(), &names, pair, &self.learning)?;
        let mut model = train(rows, integrators, self.objective, &self.learning.rows, &self.learning.forest)?;
        model.held_out = json!({ "leave_one_out": table, "reference_rmse": reference_errors });
        Ok(Findings { model, table, reference_errors })
    }

    fn load_scenes(&self, folder: &Path) -> Result<Vec<(String, Scene)>, BlendError> {
        let options = load::Options { size: Some(self.size), ..load::Options::default() };
        let load = |entry: &RecipeScene| {
            let path = folder.join(&entry.file);
            let loaded = load::read(&path, &options).map_err(|error| failed(&path.display().to_string(), error))?;
            Ok((entry.name(), loaded.scene))
        };
        self.scenes.iter().map(load).collect()
    }

    /// The mean of two halves, and the root mean squared error of that mean as their difference shows it.
    fn reference(
        &self,
        name: &str,
        scene: &Scene,
        entry: &RecipeScene,
        cache: &Path,
        log: &mut impl FnMut(&str),
    ) -> Result<(Image, f64), BlendError> {
        let Reference { integrator, time } = entry.reference.unwrap_or(self.reference);
        let mut halves = Vec::new();
        for seed in REFERENCE_SEEDS {
            let task = Task { scene, name, method: integrator, time: 0.5 * time, seed };
            task.ensure(cache, log)?;
            halves.push(task.read(cache)?);
        }
        let mut mean = Image::new(self.size[0], self.size[1]);
        let mut squares = 0.0;
        Zip::from(&mut mean.colour).and(&halves[0].colour).and(&halves[1].colour).for_each(|mean, a, b| {
            *mean = 0.5 * (a + b);
            squares += f64::from(0.5 * (a - b)).powi(2);
        });
        Ok((mean, (squares / (self.size[0] * self.size[1] * 3) as f64).sqrt()))
    }
}

/// Fingerprint of the sources that renders are made by.
const RENDERER: &str = env!("PATHBLEND_RENDERER");

fn failed(name: &str, error: impl std::fmt::Display) -> BlendError {
    BlendError::Load { name: name.to_owned(), message: error.to_string() }
}

impl Task<'_> {
    fn path(&self, cache: &Path) -> PathBuf {
        let key = json!({
            "software": if REFERENCE_SEEDS.contains(&self.seed) { env!("CARGO_PKG_VERSION") } else { RENDERER },
            "scene": self.scene.hash,
            "size": self.scene.camera.size,
            "max_depth": self.scene.max_depth,
            "integrator": self.method,
            "cpu_s": self.time,
            "seed": self.seed,
        });
        let hash = blake3::hash(key.to_string().as_bytes()).to_hex();
        cache.join(format!("{}-{}-{}.exr", self.name, self.method.name(), &hash[..16]))
    }

    /// Renders the image unless it is there.
    fn ensure(&self, cache: &Path, log: &mut impl FnMut(&str)) -> Result<(), BlendError> {
        let path = self.path(cache);
        if path.is_file() {
            return Ok(());
        }
        log(&format!("{}: {} for {} s, seed {}", self.name, self.method.name(), self.time, self.seed));
        let settings = Settings {
            seed: self.seed,
            max_depth: self.scene.max_depth,
            features: true,
            budget: Budget::Cpu(Duration::from_secs_f64(self.time)),
            ..Settings::default()
        };
        let outcome = render(self.scene, self.method, &settings, |_| {});
        outcome.image.write(&path, &WriteOptions::default()).map_err(|error| failed(self.name, error))
    }

    fn read(&self, cache: &Path) -> Result<Image, BlendError> {
        Image::read(&self.path(cache)).map_err(|error| failed(self.name, error))
    }
}
