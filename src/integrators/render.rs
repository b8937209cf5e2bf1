//! The render loop: passes until the budget is spent, then the image with what is known of how it was made.

use super::photons::FIRST_RADIUS;
use super::{Counts, Integrator, Method};
use crate::film::{Film, Health, NoiseEstimate, PathClass};
use crate::image::{DEPTH_KEY, INTEGRATOR_KEY, Image, SCENE_KEY};
use crate::markov::Mutations;
use crate::paths::Heuristic;
use crate::scene::{LightChoice, Scene};
use cpu_time::ProcessTime;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::time::{Duration, Instant};

/// What a render is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Seed of all random streams.
    pub seed: u64,
    /// Longest path in edges: 1 is light seen directly, 2 direct light.
    pub max_depth: usize,
    /// Whether the luminance per path class is kept.
    pub features: bool,
    /// When to stop.
    pub budget: Budget,
    /// How the densities of techniques make weights; in mmlt always by the power heuristic.
    pub heuristic: Heuristic,
    /// How lights are chosen for direct light; by power in mmlt, whose primary samples do not know the point.
    pub lights: LightChoice,
    /// Light subpaths per pass of sppm and vcm; where not given one per pixel, up to [`super::MOST_PHOTONS`].
    pub photons: Option<usize>,
    /// First radius of sppm and vcm, in units of the size that a pixel has where photons are looked for.
    pub radius: f64,
    /// Whether sppm estimates direct light by sampling lights; else by photons too.
    pub sample_direct: bool,
    /// How chains move.
    pub mutations: Mutations,
}

impl Settings {
    /// How the method works, as the manifest has it: names and values of the options.
    pub fn options(&self) -> Value {
        let Self { heuristic, lights, photons, radius, sample_direct, mutations, .. } = self;
        json!({
            "heuristic": heuristic,
            "lights": lights,
            "photons": photons,
            "radius": radius,
            "sample_direct": sample_direct,
            "mutations": mutations,
        })
    }
}

impl Default for Settings {
    /// One pass with seed 0 of paths up to 6 edges, with features.
    fn default() -> Self {
        Self {
            seed: 0,
            max_depth: 6,
            features: true,
            budget: Budget::Passes(1),
            heuristic: Heuristic::Power,
            lights: LightChoice::default(),
            photons: None,
            radius: FIRST_RADIUS,
            sample_direct: true,
            mutations: Mutations::default(),
        }
    }
}

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// After this many passes: the image depends on the seed alone, not on the number of threads.
    Passes(u64),
    /// After this much wall-clock time, to the nearest pass, but not before the first.
    Wall(Duration),
    /// After this much processor time of the whole process, to the nearest pass, but not before the first.
    Cpu(Duration),
    /// When the expected error is small enough, after [`LEAST_PASSES`] at least; or after some time.
    Noise {
        /// What the larger of both estimates of [`NoiseEstimate`] must not exceed, as a share: 0.01 is one percent.
        relative: f64,
        /// Most wall-clock time, to the nearest pass.
        wall: Option<Duration>,
    },
}

/// Passes before a render trusts what it knows of its own noise: with fewer, too many pixels have not yet met the rare
/// paths that will make up their noise.
pub const LEAST_PASSES: u64 = 32;

/// Manifest key of [`Settings::options`].
pub(super) const OPTIONS_KEY: &str = "options";

/// How far a render is.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Passes done.
    pub passes: u64,
    /// Share of the budget that is spent, 0 to 1.
    pub fraction: f64,
    /// The expected error, where the budget asks for it and it is known.
    pub error: Option<f64>,
}

/// A finished render.
pub struct Outcome {
    /// The image, with its layers and its manifest.
    pub image: Image,
    /// Passes done.
    pub passes: u64,
    /// The expected error; `None` for fewer than two passes.
    pub noise: Option<NoiseEstimate>,
    /// Wall-clock time of the render, without loading the scene.
    pub wall: Duration,
    /// Processor time of all threads in that time.
    pub cpu: Duration,
    /// Samples, rays, acceptance.
    pub counts: Counts,
    /// What went wrong on the way.
    pub health: Health,
}

/// Renders `scene` with `method` on the current rayon thread pool. `progress` is called after each pass.
pub fn render(scene: &Scene, method: Method, settings: &Settings, mut progress: impl FnMut(Progress)) -> Outcome {
    let mut run = Run::start(scene, method, settings);
    while !run.is_done() {
        run.pass();
        progress(run.progress());
    }
    run.finish()
}

/// Time that a render has taken.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Elapsed {
    pub wall: Duration,
    pub cpu: Duration,
}

/// A render under way.
pub(super) struct Run<'a> {
    pub scene: &'a Scene,
    pub method: Method,
    pub settings: &'a Settings,
    pub film: Film,
    pub counts: Counts,
    /// `None` in a scene without light.
    integrator: Option<Integrator>,
    /// The noise when a batch ended last, where the budget asks for it.
    noise: Option<NoiseEstimate>,
    started: (Instant, ProcessTime),
    /// Time taken by the run that this one goes on from.
    earlier: Elapsed,
}

impl<'a> Run<'a> {
    pub fn start(scene: &'a Scene, method: Method, settings: &'a Settings) -> Self {
        let started = (Instant::now(), ProcessTime::now());
        Self {
            scene,
            method,
            settings,
            film: Film::new(scene.camera.size, scene.film.filter, settings.features),
            counts: Counts::default(),
            integrator: scene.has_lights().then(|| Integrator::start(method, scene, settings)),
            noise: None,
            started,
            earlier: Elapsed::default(),
        }
    }

    /// Goes on from an earlier run, whose sums the film has been given.
    pub fn go_on(&mut self, earlier: Elapsed, counts: Counts) {
        (self.earlier, self.counts) = (earlier, counts);
        if let Some(integrator) = &mut self.integrator {
            integrator.skip(self.film.passes());
        }
        // Within a batch the earlier run had not looked either, or it would have stopped.
        if self.film.is_between_batches() {
            self.look();
        }
    }

    pub fn pass(&mut self) {
        let Some(integrator) = &mut self.integrator else { return };
        let number = self.film.passes();
        integrator.pass(self.scene, &mut self.film, number, &mut self.counts);
        if self.film.end_pass() {
            self.look();
        }
    }

    /// Looks at the noise. Only between batches, so that it depends on passes alone when a render stops.
    fn look(&mut self) {
        if matches!(self.settings.budget, Budget::Noise { .. }) && self.film.passes() >= LEAST_PASSES {
            self.noise = self.film.noise();
        }
    }

    pub fn elapsed(&self) -> Elapsed {
        let (wall, cpu) = self.started;
        Elapsed { wall: self.earlier.wall + wall.elapsed(), cpu: self.earlier.cpu + cpu.elapsed() }
    }

    pub fn progress(&self) -> Progress {
        let fraction = self.spent().min(1.0);
        Progress { passes: self.film.passes(), fraction, error: self.noise.map(|noise| noise.larger()) }
    }

    /// Share of the budget that is spent.
    fn spent(&self) -> f64 {
        let share = |part: Duration, of: Duration| part.as_secs_f64() / of.as_secs_f64();
        match self.settings.budget {
            Budget::Passes(n) => self.film.passes() as f64 / n as f64,
            Budget::Wall(time) => share(self.elapsed().wall, time),
            Budget::Cpu(time) => share(self.elapsed().cpu, time),
            Budget::Noise { relative, wall } => {
                // Errors fall with the root of the number of passes.
                let noise = self.noise.map_or(0.0, |noise| (relative / noise.larger()).powi(2));
                wall.map_or(0.0, |time| share(self.elapsed().wall, time)).max(noise)
            }
        }
    }

    /// Whether there is nothing to render, or another pass would overshoot the budget by more than stopping now falls short
    /// of it.
    pub fn is_done(&self) -> bool {
        let passes = self.film.passes();
        if self.integrator.is_none() || passes == 0 {
            return self.integrator.is_none();
        }
        let is_over = |fraction: f64| fraction + 0.5 * fraction / passes as f64 >= 1.0;
        match self.settings.budget {
            Budget::Passes(n) => passes >= n,
            Budget::Wall(_) | Budget::Cpu(_) => is_over(self.spent()),
            Budget::Noise { relative, wall } => {
                self.noise.is_some_and(|noise| noise.larger() <= relative)
                    || wall.is_some_and(|time| is_over(self.elapsed().wall.as_secs_f64() / time.as_secs_f64()))
            }
        }
    }

    pub fn finish(self) -> Outcome {
        let (image, noise) = rayon::join(|| self.film.develop(), || self.film.noise());
        let Elapsed { wall, cpu } = self.elapsed();
        let (passes, health) = (self.film.passes(), self.film.health());
        let mut outcome = Outcome { image, passes, noise, wall, cpu, counts: self.counts, health };
        outcome.image.manifest = manifest(self.scene, self.method, self.settings, &outcome);
        outcome
    }
}

impl Outcome {
    /// What `render --json` prints: published, stable names.
    pub fn summary(&self) -> Map<String, Value> {
        const PUBLISHED: [&str; 8] = ["integrator", "seed", "wall_s", "cpu_s", "samples", "rays", "passes", "health"];
        let mut summary = Map::new();
        for name in PUBLISHED.into_iter().chain(["acceptance", "chains", "rejections", "error"]) {
            if let Some(value) = self.image.manifest.get(name) {
                summary.insert(name.to_owned(), value.clone());
            }
        }
        summary
    }
}

fn manifest(scene: &Scene, method: Method, settings: &Settings, outcome: &Outcome) -> Map<String, Value> {
    let classes: Map<String, Value> = PathClass::all()
        .filter(|class| outcome.image.layers.contains_key(&class.layer_name()))
        .map(|class| (class.layer_name(), Value::from(class.light_path_expression())))
        .collect();
    let budget = match settings.budget {
        Budget::Passes(n) => json!({ "passes": n }),
        Budget::Wall(time) => json!({ "wall_s": time.as_secs_f64() }),
        Budget::Cpu(time) => json!({ "cpu_s": time.as_secs_f64() }),
        Budget::Noise { relative, wall: None } => json!({ "error": relative }),
        Budget::Noise { relative, wall: Some(time) } => json!({ "error": relative, "wall_s": time.as_secs_f64() }),
    };
    let pixels = scene.camera.size.iter().product::<usize>().max(1);
    let mut manifest = Map::new();
    let mut set = |name: &str, value: Value| manifest.insert(name.to_owned(), value);
    set("software", json!(concat!("pathblend ", env!("CARGO_PKG_VERSION"))));
    set(SCENE_KEY, json!(scene.hash));
    set(INTEGRATOR_KEY, json!(method.name()));
    set("seed", json!(settings.seed));
    set(DEPTH_KEY, json!(settings.max_depth));
    set(OPTIONS_KEY, settings.options());
    set("budget", budget);
    set("passes", json!(outcome.passes));
    set("wall_s", json!(outcome.wall.as_secs_f64()));
    set("cpu_s", json!(outcome.cpu.as_secs_f64()));
    set("samples", json!(outcome.counts.samples));
    set("samples_per_pixel", json!(outcome.counts.samples as f64 / pixels as f64));
    set("rays", json!(outcome.counts.rays));
    set("health", json!(outcome.health));
    if let Some(noise) = outcome.noise {
        set("error", json!(noise));
    }
    if !outcome.counts.acceptance.is_empty() {
        set("acceptance", json!(outcome.counts.acceptance));
        set("chains", json!(outcome.counts.chains));
    }
    if !outcome.counts.rejections.is_empty() {
        set("rejections", json!(outcome.counts.rejections));
    }
    set("classes", Value::Object(classes));
    manifest
}
