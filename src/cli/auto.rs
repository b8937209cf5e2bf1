//! `pathblend auto`: the main job.

use super::blend::model;
use super::progress::Reporter;
use super::render::parse_threads;
use super::{SceneArguments, check_output, on_threads, parse_time, say};
use crate::blend::{self, Classes, Input, weight_layer};
use crate::image::{Image, Layer, WriteOptions, write_false_colour, write_png};
use crate::integrators::{Budget, Method, Settings, render};
use crate::scene::Scene;
use anyhow::Context;
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};
use std::time::Duration;

#[derive(Debug, Args)]
pub(super) struct Auto {
    #[command(flatten)]
    scene: SceneArguments,
    /// Time for everything (such as 60s, 10m), half for each method.
    #[arg(long, value_name = "TIME", value_parser = parse_time, default_value = "60s")]
    time: Duration,
    /// Seed of the random numbers.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Threads; default: all cores.
    #[arg(long, value_name = "N", value_parser = parse_threads)]
    threads: Option<usize>,
    /// Model; default: the built-in one.
    #[arg(long)]
    model: Option<PathBuf>,
    /// Blend to write; OUT.png and OUT_weight.png appear beside it.
    #[arg(short, long, value_name = "OUT.exr")]
    output: PathBuf,
    /// Also write the two images that went into the blend, as OUT_METHOD.exr and .png.
    #[arg(long)]
    keep: bool,
}

impl Auto {
    pub(super) fn run(self) -> anyhow::Result<()> {
        check_output(&self.output, "exr", &[&self.scene.scene])?;
        let model = model(self.model.as_deref())?;
        let scene = self.scene.load()?;
        let mut inputs = Vec::new();
        for name in &model.integrators {
            let method = Method::from_str(name, true)
                .ok()
                .with_context(|| format!("the model blends with `{name}`, a method that pathblend does not have"))?;
            let image = on_threads(self.threads, || self.render(&scene, method))?;
            if self.keep {
                image.write(&self.beside(name, "exr"), &WriteOptions::default())?;
                write_png(&self.beside(name, "png"), image.colour.view(), 0.0)?;
            }
            inputs.push((name, image));
        }
        let [(name_a, a), (name_b, b)] = &inputs[..] else { anyhow::bail!("a model blends two methods") };
        let (a, b) = (Input::new(name_a, a), Input::new(name_b, b));
        let image = on_threads(self.threads, || blend::apply(&model, a, b, Classes::Blend))??;
        image.write(&self.output, &WriteOptions::default())?;
        let picture = self.output.with_extension("png");
        write_png(&picture, image.colour.view(), 0.0)?;
        say(format_args!("wrote {} and {}", self.output.display(), picture.display()))?;
        if let Some(Layer::Luminance(weights)) = image.layers.get(&weight_layer(name_a)) {
            let map = self.beside("weight", "png");
            write_false_colour(&map, weights.view())?;
            say(format_args!("wrote {}: orange is {name_a}, blue is {name_b}", map.display()))?;
        }
        Ok(())
    }

    fn render(&self, scene: &Scene, method: Method) -> Image {
        let settings = Settings {
            seed: self.seed,
            max_depth: scene.max_depth,
            features: true,
            budget: Budget::Wall(self.time / 2),
            ..Settings::default()
        };
        let mut reporter = Reporter::new(method.name());
        let outcome = render(scene, method, &settings, |progress| reporter.update(progress));
        reporter.finish();
        let wall = outcome.wall.as_secs_f64();
        eprintln!("{}: {} passes in {wall:.1} s; {}", method.name(), outcome.passes, outcome.health);
        outcome.image
    }

    /// OUT_`name`.`extension`.
    fn beside(&self, name: &str, extension: &str) -> PathBuf {
        let stem = self.output.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Path::new(&self.output).with_file_name(format!("{stem}_{name}.{extension}"))
    }
}
