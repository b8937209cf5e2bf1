//! Runs of an experiment. Each is kept as soon as it is done, so that an interrupted experiment goes on where it stopped.

use super::{ExperimentRecipe, ReportError, Variant};
use crate::image::metrics::compare;
use crate::image::{Image, WriteOptions};
use crate::integrators::{Acceptance, Budget, ChainReport, Settings, render};
use crate::load;
use crate::scene::Scene;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Seed of references; no run has it.
const REFERENCE_SEED: u64 = 1 << 40;

/// One run.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct Run {
    /// Fingerprint of what decides the run: scene, variant, seed, time, reference and the renderer's sources.
    pub key: String,
    /// Name of the scene.
    pub scene: String,
    /// Name of the variant.
    pub variant: String,
    /// Its seed.
    pub seed: u64,
    /// Processor seconds that were asked for.
    pub time: f64,
    /// Processor seconds that it took.
    pub cpu_s: f64,
    /// Samples or mutations.
    pub samples: u64,
    /// Rays.
    pub rays: u64,
    /// Mean squared error.
    pub mse: f64,
    /// Relative mean squared error.
    pub relmse: f64,
    /// Acceptance by mutation, then by length.
    pub acceptance: BTreeMap<String, Vec<Acceptance>>,
    /// Chains by length.
    pub chains: Vec<ChainReport>,
}

/// All runs.
pub struct Experiment {
    /// What was asked for.
    pub recipe: ExperimentRecipe,
    /// By scene, variant, time and seed.
    pub runs: Vec<Run>,
}

/// Where an experiment keeps its files.
struct Kept {
    folder: PathBuf,
    runs: BTreeMap<String, Run>,
}

impl Kept {
    fn open(folder: &Path) -> Result<Self, ReportError> {
        std::fs::create_dir_all(folder).map_err(|error| file(folder, error))?;
        let text = std::fs::read_to_string(folder.join("runs.jsonl")).unwrap_or_default();
        // A line that a kill has cut off is made again.
        let runs = text.lines().filter_map(|line| serde_json::from_str::<Run>(line).ok());
        Ok(Self { folder: folder.to_owned(), runs: runs.map(|run| (run.key.clone(), run)).collect() })
    }

    fn add(&mut self, run: &Run) -> Result<(), ReportError> {
        let path = self.folder.join("runs.jsonl");
        let line = serde_json::to_string(run).map_err(|error| file(&path, error))?;
        let opened = std::fs::OpenOptions::new().create(true).append(true).open(&path);
        opened.and_then(|mut out| writeln!(out, "{line}")).map_err(|error| file(&path, error))?;
        self.runs.insert(run.key.clone(), run.clone());
        Ok(())
    }
}

fn file(path: &Path, error: impl std::fmt::Display) -> ReportError {
    ReportError::File { name: path.display().to_string(), message: error.to_string() }
}

impl ExperimentRecipe {
    /// Renders what is missing, on one thread, and keeps it in `output`. Scene files are relative to `folder`; `log` gets
    /// a line for each render.
    ///
    /// # Errors
    /// Scenes that cannot be loaded, files that cannot be read or written.
    pub fn run(self, folder: &Path, output: &Path, log: impl Fn(&str)) -> Result<Experiment, ReportError> {
        let mut kept = Kept::open(output)?;
        let mut runs = Vec::new();
        for entry in &self.scenes {
            let path = folder.join(&entry.file);
            let options = load::Options { size: Some(self.size), ..load::Options::default() };
            let mut scene = load::read(&path, &options).map_err(|error| file(&path, error))?.scene;
            scene.max_depth = self.max_depth.unwrap_or(scene.max_depth);
            let name = entry.name();
            let reference = entry.reference.unwrap_or(self.reference);
            let depth = scene.max_depth;
            let how = format!("{} {depth} {} {}", scene.hash, reference.integrator.name(), reference.time);
            let how = fingerprint(&how);
            let target = output.join(format!("{name}-{how}.exr"));
            if !target.exists() {
                log(&format!("{name}: reference by {} for {} s", reference.integrator.name(), reference.time));
                let settings = Settings {
                    seed: REFERENCE_SEED,
                    max_depth: depth,
                    budget: Budget::Cpu(Duration::from_secs_f64(reference.time)),
                    ..Settings::default()
                };
                render(&scene, reference.integrator, &settings, |_| {})
                    .image
                    .write(&target, &WriteOptions::default())?;
            }
            let image = Image::read(&target)?.of_classes(self.classes.as_deref());
            // Seeds outermost, so that what the machine does meanwhile falls on all variants.
            for seed in 0..self.seeds {
                for time in &self.times {
                    for variant in &self.variants {
                        let classes = self.classes.as_deref();
                        let key = key(&scene, variant, seed, *time, &format!("{how} {}", classes.unwrap_or_default()));
                        if !kept.runs.contains_key(&key) {
                            log(&format!("{name}: {} for {time} s, seed {seed}", variant.name));
                            let run = Plan { scene: &scene, variant, classes, seed, time: *time };
                            kept.add(&run.one(&name, key.clone(), &image)?)?;
                        }
                        runs.extend(kept.runs.get(&key).cloned());
                    }
                }
            }
        }
        let experiment = Experiment { recipe: self, runs };
        experiment.draw(output)?;
        Ok(experiment)
    }
}

/// What tells one thing that is kept from another.
fn fingerprint(all: &str) -> String {
    blake3::hash(all.as_bytes()).to_hex()[..24].to_owned()
}

/// Decided by all that decides the run's errors; `reference` is the fingerprint of what it is compared with.
fn key(scene: &Scene, variant: &Variant, seed: u64, time: f64, reference: &str) -> String {
    let Variant { integrator, mutations, .. } = variant;
    let mutations = serde_json::to_string(mutations).unwrap_or_default();
    let depth = scene.max_depth;
    let build = env!("PATHBLEND_RENDERER");
    let method = integrator.name();
    fingerprint(&format!("{build} {} {depth} {method} {mutations} {seed} {time} {reference}", scene.hash))
}

/// A run that is to be made.
struct Plan<'a> {
    scene: &'a Scene,
    variant: &'a Variant,
    classes: Option<&'a str>,
    seed: u64,
    time: f64,
}

impl Plan<'_> {
    fn one(&self, name: &str, key: String, reference: &Image) -> Result<Run, ReportError> {
        let Self { scene, variant, classes, seed, time } = *self;
        let settings = Settings {
            seed,
            max_depth: scene.max_depth,
            features: classes.is_some(),
            budget: Budget::Cpu(Duration::from_secs_f64(time)),
            mutations: variant.mutations,
            ..Settings::default()
        };
        let outcome = render(scene, variant.integrator, &settings, |_| {});
        let metrics = compare(&outcome.image.of_classes(classes), reference)?;
        let counts = outcome.counts;
        Ok(Run {
            key,
            scene: name.to_owned(),
            variant: variant.name.clone(),
            seed,
            time,
            cpu_s: outcome.cpu.as_secs_f64(),
            samples: counts.samples,
            rays: counts.rays,
            mse: metrics.mse,
            relmse: metrics.relmse,
            acceptance: counts.acceptance.into_iter().map(|(kind, lengths)| (kind.to_owned(), lengths)).collect(),
            chains: counts.chains,
        })
    }
}
