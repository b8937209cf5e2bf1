//! The verbs of the command line: arguments in, one call into the library each.

mod auto;
mod blend;
mod compare;
mod experiment;
mod import;
mod merge;
mod mutations;
mod progress;
mod reference;
mod render;
mod train;

use anyhow::{Context, bail};
use clap::{Args, Parser, Subcommand};
use std::io::Write;
use std::path::Path;
use std::time::Duration;

/// Renders a scene with several light transport algorithms and blends the results by what it has learned.
#[derive(Debug, Parser)]
#[command(name = "pathblend", version, about, max_term_width = 110)]
#[command(after_help = "Example: pathblend auto scenes/spheres/scene.xml --time 20s -o spheres.exr")]
pub struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Render a scene with one method.
    #[command(after_help = "Example: pathblend render scenes/box/scene.xml -i bdpt --time 10s -o box.exr")]
    Render(render::Render),
    /// Render a scene until its noise is as small as you ask, with a checkpoint to go on from.
    #[command(after_help = "Example: pathblend reference scenes/box/scene.xml --error 2% --time 1h -o reference.exr")]
    Reference(reference::Reference),
    /// Merge runs of one render with different seeds.
    #[command(after_help = "Example: pathblend merge seed1.exr seed2.exr -o merged.exr")]
    Merge(merge::Merge),
    /// Measure how far an image is from a reference.
    #[command(after_help = "Example: pathblend compare box.exr reference.exr --json")]
    Compare(compare::Compare),
    /// Render what a recipe asks for, learn a model from it, and judge it leave-one-scene-out.
    #[command(after_help = "Example: pathblend train training/own.toml -o models/own")]
    Train(train::Train),
    /// Compare variants of methods over scenes, seeds and times: tables and plots.
    #[command(after_help = "Example: pathblend experiment training/jumps.toml -o jumps")]
    Experiment(experiment::Experiment),
    /// Blend two images with a learned model.
    #[command(after_help = "Example: pathblend blend bdpt.exr sppm.exr -o blend.exr")]
    Blend(blend::Blend),
    /// Render a scene with two methods for half the time each and blend them with the built-in model.
    #[command(after_help = "Example: pathblend auto scenes/spheres/scene.xml --time 60s -o spheres.exr")]
    Auto(auto::Auto),
    /// Convert a scene of pbrt to Mitsuba 3 XML.
    #[command(after_help = "Example: pathblend import pbrt/scene.pbrt -o scene.xml")]
    Import(import::Import),
}

/// Runs the verb that the user asked for.
///
/// # Errors
/// Whatever went wrong, as one line for the user.
pub fn run(arguments: Arguments) -> anyhow::Result<()> {
    match arguments.verb {
        Verb::Render(render) => render.run(),
        Verb::Reference(reference) => reference.run(),
        Verb::Merge(merge) => merge.run(),
        Verb::Compare(compare) => compare.run(),
        Verb::Train(train) => train.run(),
        Verb::Experiment(experiment) => experiment.run(),
        Verb::Blend(blend) => blend.run(),
        Verb::Auto(auto) => auto.run(),
        Verb::Import(import) => import.run(),
    }
}

/// The scene and how to see it, shared by the verbs that render.
#[derive(Debug, Args)]
struct SceneArguments {
    /// Scene file, Mitsuba 3 XML.
    scene: std::path::PathBuf,
    /// Film size in pixels instead of the scene's.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<[usize; 2]>,
    /// Value for a `<default>` of the scene file; may be repeated.
    #[arg(short = 'D', value_name = "NAME=VALUE", value_parser = parse_define)]
    define: Vec<(String, String)>,
    /// Replace or leave out what the file asks for and pathblend lacks, with a warning for each place.
    #[arg(long)]
    approximate: bool,
    /// Longest path in edges instead of the scene's (1: light seen directly, 2: direct light).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    max_depth: Option<u32>,
}

impl SceneArguments {
    /// Loads the scene; warnings go to standard error.
    fn load(&self) -> anyhow::Result<crate::scene::Scene> {
        let options = crate::load::Options {
            size: self.size,
            overrides: self.define.iter().cloned().collect(),
            approximate: self.approximate,
        };
        let loaded = crate::load::read(&self.scene, &options)?;
        for warning in &loaded.warnings {
            eprintln!("warning: {warning}");
        }
        let mut scene = loaded.scene;
        if let Some(max_depth) = self.max_depth {
            scene.max_depth = max_depth as usize;
        }
        Ok(scene)
    }
}

/// Runs `work` on a pool of `threads` threads, or on all cores.
fn on_threads<R: Send>(threads: Option<usize>, work: impl FnOnce() -> R + Send) -> anyhow::Result<R> {
    let mut builder = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = threads {
        builder = builder.num_threads(threads);
    }
    Ok(builder.build().context("cannot start the threads")?.install(work))
}

/// An output file must have the extension `extension`, must be none of the `inputs`, and must be writable: said before the
/// work, not after it.
fn check_output(path: &Path, extension: &str, inputs: &[&Path]) -> anyhow::Result<()> {
    if !path.extension().is_some_and(|found| found.eq_ignore_ascii_case(extension)) {
        bail!("cannot write {}: expected a name that ends in .{extension}", path.display());
    }
    if path.is_dir() {
        bail!("cannot write {}: it is a folder", path.display());
    }
    let real = std::fs::canonicalize(path).ok();
    if real.is_some() && inputs.iter().any(|input| std::fs::canonicalize(input).ok() == real) {
        bail!("cannot write {}: it is an input of the same command", path.display());
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !folder.is_dir() {
        bail!("cannot write {}: the folder {} does not exist", path.display(), folder.display());
    }
    // The only sure way to know that files can be made there is to make one.
    tempfile::tempfile_in(folder).with_context(|| format!("cannot write {}", path.display()))?;
    Ok(())
}

/// Prints a line. A reader that has gone away, such as `head`, is no error.
fn say(line: std::fmt::Arguments<'_>) -> anyhow::Result<()> {
    match writeln!(std::io::stdout(), "{line}") {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}

/// `30s`, `1.5m`, `2h`, `500ms`; a bare number means seconds.
fn parse_time(text: &str) -> Result<Duration, String> {
    let split = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let (number, unit) = text.split_at(split);
    let seconds_per_unit = match unit {
        "ms" => 1e-3,
        "" | "s" => 1.0,
        "m" | "min" => 60.0,
        "h" => 3600.0,
        _ => return Err(format!("unknown unit `{unit}`; expected ms, s, m or h")),
    };
    let value: f64 = number.parse().map_err(|_| format!("`{number}` is no number; expected a time such as 30s"))?;
    let seconds = value * seconds_per_unit;
    if !(seconds > 0.0 && seconds <= 1e7) {
        return Err("expected a time between 0 and 1e7 seconds".to_owned());
    }
    Ok(Duration::from_secs_f64(seconds))
}

/// `640x480`.
fn parse_size(text: &str) -> Result<[usize; 2], String> {
    let parse = |part: &str| part.parse::<usize>().ok().filter(|n| (1..=32_768).contains(n));
    let size = text.split_once('x').and_then(|(width, height)| Some([parse(width)?, parse(height)?]));
    size.ok_or_else(|| "expected WIDTHxHEIGHT, each between 1 and 32768".to_owned())
}

/// `name=value`.
fn parse_define(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or("expected NAME=VALUE")?;
    Ok((name.to_owned(), value.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        use clap::CommandFactory;
        Arguments::command().debug_assert();
    }

    #[test]
    fn times_and_sizes() {
        assert_eq!(parse_time("30s"), Ok(Duration::from_secs(30)));
        assert_eq!(parse_time("1.5m"), Ok(Duration::from_secs(90)));
        assert_eq!(parse_time("250ms"), Ok(Duration::from_millis(250)));
        for bad in ["", "s", "-3s", "0", "3d", "nan", "inf", "1e99h"] {
            assert!(parse_time(bad).is_err(), "{bad}");
        }
        assert_eq!(parse_size("640x480"), Ok([640, 480]));
        for bad in ["640", "0x1", "x", "1x99999", "-1x3"] {
            assert!(parse_size(bad).is_err(), "{bad}");
        }
    }
}
