//! The render loop: passes until the budget is spent, then the image with what is known of how it was made.

use super::photons::FIRST_RADIUS;
use super::{Counts, Integrator, Method};
use crate::film::{Film, Health, PathClass};
use crate::image::{DEPTH_KEY, INTEGRATOR_KEY, Image, SCENE_KEY};
use crate::paths::Heuristic;
use crate::scene::{LightChoice, Scene};
use cpu_time::ProcessTime;
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
}

/// How far a render is.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Passes done.
    pub passes: u64,
    /// Share of the budget that is spent, 0 to 1.
    pub fraction: f64,
}

/// A finished render.
pub struct Outcome {
    /// The image, with its layers and its manifest.
    pub image: Image,
    /// Passes done.
    pub passes: u64,
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
    let (wall, cpu) = (Instant::now(), ProcessTime::now());
    let mut film = Film::new(scene.camera.size, scene.film.filter, settings.features);
    let mut counts = Counts::default();
    let mut passes = 0;
    if scene.has_lights() {
        let mut integrator = Integrator::start(method, scene, settings);
        loop {
            integrator.pass(scene, &mut film, passes, &mut counts);
            passes += 1;
            let fraction = spent(settings.budget, passes, wall, cpu);
            progress(Progress { passes, fraction: fraction.min(1.0) });
            if stops(settings.budget, passes, fraction) {
                break;
            }
        }
    }
    let image = film.develop(passes.max(1) as f64);
    let mut outcome =
        Outcome { image, passes, wall: wall.elapsed(), cpu: cpu.elapsed(), counts, health: film.health() };
    outcome.image.manifest = manifest(scene, method, settings, &outcome);
    outcome
}

/// Share of the budget that is spent.
fn spent(budget: Budget, passes: u64, wall: Instant, cpu: ProcessTime) -> f64 {
    match budget {
        Budget::Passes(n) => passes as f64 / n as f64,
        Budget::Wall(time) => wall.elapsed().as_secs_f64() / time.as_secs_f64(),
        Budget::Cpu(time) => cpu.elapsed().as_secs_f64() / time.as_secs_f64(),
    }
}

/// Whether another pass would overshoot the budget by more than stopping now falls short of it.
fn stops(budget: Budget, passes: u64, fraction: f64) -> bool {
    match budget {
        Budget::Passes(n) => passes >= n,
        Budget::Wall(_) | Budget::Cpu(_) => fraction + 0.5 * fraction / passes as f64 >= 1.0,
    }
}

impl Outcome {
    /// What `render --json` prints: published, stable names.
    pub fn summary(&self) -> Map<String, Value> {
        const PUBLISHED: [&str; 8] = ["integrator", "seed", "wall_s", "cpu_s", "samples", "rays", "passes", "health"];
        let mut summary = Map::new();
        for name in PUBLISHED.into_iter().chain(["acceptance"]) {
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
    };
    let pixels = scene.camera.size.iter().product::<usize>().max(1);
    let mut manifest = Map::new();
    let mut set = |name: &str, value: Value| manifest.insert(name.to_owned(), value);
    set("software", json!(concat!("pathblend ", env!("CARGO_PKG_VERSION"))));
    set(SCENE_KEY, json!(scene.hash));
    set(INTEGRATOR_KEY, json!(method.name()));
    set("seed", json!(settings.seed));
    set(DEPTH_KEY, json!(settings.max_depth));
    set("budget", budget);
    set("passes", json!(outcome.passes));
    set("wall_s", json!(outcome.wall.as_secs_f64()));
    set("cpu_s", json!(outcome.cpu.as_secs_f64()));
    set("samples", json!(outcome.counts.samples));
    set("samples_per_pixel", json!(outcome.counts.samples as f64 / pixels as f64));
    set("rays", json!(outcome.counts.rays));
    set("health", json!(outcome.health));
    if !outcome.counts.acceptance.is_empty() {
        set("acceptance", json!(outcome.counts.acceptance));
    }
    set("classes", Value::Object(classes));
    manifest
}
