//! `pathblend reference`.

use super::progress::Reporter;
use super::render::{Tuning, parse_threads};
use super::{SceneArguments, check_output, on_threads, parse_time, say};
use crate::image::{WriteOptions, write_png};
use crate::integrators::{Budget, Keep, Method, Outcome, Settings, reference, usual_method};
use clap::Args;
use serde_json::json;
use std::path::PathBuf;
use std::time::Duration;

#[derive(Debug, Args)]
pub(super) struct Reference {
    #[command(flatten)]
    scene: SceneArguments,
    /// Render until the expected relative error of the image is at most this (such as 0.5%): the root of the relMSE by
    /// noise that `compare` would find against the truth.
    #[arg(long, value_name = "PERCENT", value_parser = parse_percent)]
    error: f64,
    /// Render no longer than this (such as 30m, 2h), interrupted runs included. Default: no limit.
    #[arg(long, value_name = "TIME", value_parser = parse_time)]
    time: Option<Duration>,
    /// Method: path, bdpt, sppm or vcm. Default: bdpt in scenes without mirrors, smooth glass and the like, else vcm.
    #[arg(short, long, value_enum)]
    integrator: Option<Method>,
    /// Seed of the random numbers.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Threads; default: all cores.
    #[arg(long, value_name = "N", value_parser = parse_threads)]
    threads: Option<usize>,
    #[command(flatten)]
    tuning: Tuning,
    /// Image to write: OpenEXR with one layer per path class. The state goes to OUT.exr.checkpoint, and the same command
    /// goes on from it.
    #[arg(short, long, value_name = "OUT.exr")]
    output: PathBuf,
    /// Also write a picture in sRGB.
    #[arg(long, value_name = "OUT.png")]
    png: Option<PathBuf>,
    /// Time between two states in OUT.exr.checkpoint.
    #[arg(long, value_name = "TIME", value_parser = parse_time, default_value = "60s")]
    checkpoint_every: Duration,
    /// Leave out the path class layers.
    #[arg(long)]
    no_features: bool,
    /// Print what was done as one JSON object.
    #[arg(long)]
    json: bool,
}

/// `0.5%` as a share.
fn parse_percent(text: &str) -> Result<f64, String> {
    let percent = text.strip_suffix('%').and_then(|number| number.trim().parse::<f64>().ok());
    let share = percent.map(|percent| percent / 100.0).filter(|share| *share > 0.0 && *share <= 1.0);
    share.ok_or_else(|| "expected a percentage above 0% and up to 100%, such as 0.5%".to_owned())
}

impl Reference {
    pub(super) fn run(self) -> anyhow::Result<()> {
        check_output(&self.output, "exr", &[&self.scene.scene])?;
        if let Some(png) = &self.png {
            check_output(png, "png", &[])?;
        }
        let scene = self.scene.load()?;
        let method = self.integrator.unwrap_or_else(|| usual_method(&scene));
        let budget = Budget::Noise { relative: self.error, wall: self.time };
        let (seed, max_depth, features) = (self.seed, scene.max_depth, !self.no_features);
        let settings = self.tuning.applied(Settings { seed, max_depth, features, budget, ..Settings::default() });
        let mut checkpoint = self.output.clone().into_os_string();
        checkpoint.push(".checkpoint");
        let keep = Keep { path: checkpoint.as_ref(), every: self.checkpoint_every };
        let mut reporter = Reporter::new(method.name());
        let render = || reference(&scene, method, &settings, keep, |progress| reporter.update(progress));
        let outcome = on_threads(self.threads, render)?;
        reporter.finish();
        let outcome = outcome?;
        outcome.image.write(&self.output, &WriteOptions::default())?;
        if let Some(png) = &self.png {
            write_png(png, outcome.image.colour.view(), 0.0)?;
        }
        self.tell(method, scene.has_lights(), &outcome)
    }

    fn tell(&self, method: Method, has_lights: bool, outcome: &Outcome) -> anyhow::Result<()> {
        // Darkness is exact.
        let reached = outcome.noise.map_or(!has_lights, |noise| noise.larger() <= self.error);
        if self.json {
            let mut summary = outcome.summary();
            summary.insert("asked".to_owned(), json!(self.error));
            summary.insert("reached".to_owned(), json!(reached));
            return say(format_args!("{}", serde_json::to_string(&summary)?));
        }
        let (name, passes, wall) = (method.name(), outcome.passes, outcome.wall.as_secs_f64());
        let error = outcome.noise.map_or_else(
            || "expected error unknown".to_owned(),
            |noise| {
                let [batches, trimmed, halves] =
                    [noise.relative, noise.relative_trimmed, noise.halves].map(|share| share * 100.0);
                format!("expected error {batches:.3} % ({trimmed:.3} % trimmed), by two halves {halves:.3} %")
            },
        );
        let end = if reached { "reached" } else { "not reached: the time is up" };
        // Rounded back to what the user wrote.
        let asked = (self.error * 1e8).round() / 1e6;
        say(format_args!("{name}: {passes} passes in {wall:.2} s: {error}; {asked} % {end}; {}", outcome.health))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentages() {
        assert_eq!(parse_percent("0.5%"), Ok(0.005));
        assert_eq!(parse_percent("100%"), Ok(1.0));
        for bad in ["0%", "-1%", "200%", "0.5", "%", "nan%", "inf%", "small", ""] {
            assert!(parse_percent(bad).is_err(), "{bad}");
        }
    }
}
