//! `pathblend render`.

use super::mutations::MutationArguments;
use super::progress::Reporter;
use super::{SceneArguments, check_output, on_threads, parse_time, say};
use crate::image::{Precision, WriteOptions, write_png};
use crate::integrators::{Budget, Method, Settings, render};
use crate::paths::Heuristic;
use crate::scene::LightChoice;
use clap::Args;
use std::path::PathBuf;
use std::time::Duration;

/// Time budget where none is given.
const DEFAULT_TIME: Duration = Duration::from_secs(30);

#[derive(Debug, Args)]
pub(super) struct Render {
    #[command(flatten)]
    scene: SceneArguments,
    /// Method.
    #[arg(short, long, value_enum, default_value_t = Method::Bdpt)]
    integrator: Method,
    /// Render for this long (such as 30s, 5m, 2h), to the nearest pass. Default: 30s.
    #[arg(long, value_name = "TIME", value_parser = parse_time, conflicts_with = "passes")]
    time: Option<Duration>,
    /// Render this many passes: the same image, bit for bit, on any number of threads.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    passes: Option<u64>,
    /// Seed of the random numbers.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Threads; default: all cores.
    #[arg(long, value_name = "N", value_parser = parse_threads)]
    threads: Option<usize>,
    #[command(flatten)]
    tuning: Tuning,
    #[command(flatten)]
    chains: MutationArguments,
    /// Image to write: OpenEXR with one layer per path class.
    #[arg(short, long, value_name = "OUT.exr")]
    output: PathBuf,
    /// Also write a picture in sRGB.
    #[arg(long, value_name = "OUT.png")]
    png: Option<PathBuf>,
    /// Leave out the path class layers.
    #[arg(long)]
    no_features: bool,
    /// Store half instead of full floats.
    #[arg(long)]
    half: bool,
    /// Write colour and layers to two files.
    #[arg(long)]
    split: bool,
    /// Print what was done as one JSON object.
    #[arg(long)]
    json: bool,
}

/// How methods do what they do. Each option says which methods hear it.
#[derive(Debug, Args)]
#[command(next_help_heading = "Tuning")]
pub(super) struct Tuning {
    /// How techniques are weighted against each other: path, bdpt, sppm, vcm.
    #[arg(long, value_enum, default_value_t = Heuristic::Power)]
    heuristic: Heuristic,
    /// How lights are chosen for direct light: path, bdpt, sppm, vcm.
    #[arg(long, value_enum, default_value_t = LightChoice::Position)]
    lights: LightChoice,
    /// Light subpaths per pass, up to 16777216: sppm, vcm. Default: one per pixel, up to 1048576 (vcm: 131072).
    #[arg(long, value_name = "N", value_parser = parse_photons)]
    photons: Option<usize>,
    /// First radius in pixels: sppm, vcm.
    #[arg(long, value_name = "PIXELS", default_value_t = Settings::default().radius, value_parser = parse_radius)]
    radius: f64,
    /// Estimate direct light by photons too: sppm.
    #[arg(long)]
    direct_by_photons: bool,
}

impl Tuning {
    /// `settings` with these options.
    pub(super) fn applied(&self, settings: Settings) -> Settings {
        let Self { heuristic, lights, photons, radius, direct_by_photons } = *self;
        Settings { heuristic, lights, photons, radius, sample_direct: !direct_by_photons, ..settings }
    }
}

/// A number of light subpaths whose photons fit into some gigabytes.
fn parse_photons(text: &str) -> Result<usize, String> {
    let number = text.parse().ok().filter(|n| (1..=1 << 24).contains(n));
    number.ok_or_else(|| "expected a number from 1 to 16777216".to_owned())
}

/// A radius in pixels.
fn parse_radius(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|radius| *radius > 0.0 && *radius <= 1e4);
    number.ok_or_else(|| "expected a number of pixels above 0, at most 10000".to_owned())
}

/// A number of threads that a machine can have.
pub(super) fn parse_threads(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|n| (1..=1024).contains(n)).ok_or_else(|| "expected a number from 1 to 1024".to_owned())
}

impl Render {
    pub(super) fn run(self) -> anyhow::Result<()> {
        check_output(&self.output, "exr", &[&self.scene.scene])?;
        if let Some(png) = &self.png {
            check_output(png, "png", &[])?;
        }
        let mutations = self.chains.mutations()?;
        let scene = self.scene.load()?;
        let budget = match (self.passes, self.time) {
            (Some(passes), _) => Budget::Passes(passes),
            (None, time) => Budget::Wall(time.unwrap_or(DEFAULT_TIME)),
        };
        let (seed, max_depth, features) = (self.seed, scene.max_depth, !self.no_features);
        let given = Settings { seed, max_depth, features, budget, mutations, ..Settings::default() };
        let settings = self.tuning.applied(given);
        if self.integrator == Method::Sppm && !scene.gathers() {
            eprintln!("warning: nothing in the scene scatters diffuse-like, so sppm has nowhere to gather photons");
        }
        let mut reporter = Reporter::new(self.integrator.name());
        let outcome = on_threads(self.threads, || render(&scene, self.integrator, &settings, |p| reporter.update(p)))?;
        reporter.finish();
        let precision = if self.half { Precision::Half } else { Precision::Float };
        outcome.image.write(&self.output, &WriteOptions { precision, split: self.split })?;
        if let Some(png) = &self.png {
            write_png(png, outcome.image.colour.view(), 0.0)?;
        }
        if self.json {
            say(format_args!("{}", serde_json::to_string(&outcome.summary())?))?;
        } else {
            let (wall, cpu) = (outcome.wall.as_secs_f64(), outcome.cpu.as_secs_f64());
            let counts = &outcome.counts;
            say(format_args!(
                "{}: {} passes in {wall:.2} s ({cpu:.2} s of processor time): {:.3} M samples/s, {:.2} M rays/s; {}",
                self.integrator.name(),
                outcome.passes,
                counts.samples as f64 / wall / 1e6,
                counts.rays as f64 / wall / 1e6,
                outcome.health
            ))?;
        }
        Ok(())
    }
}
