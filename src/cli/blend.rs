//! `pathblend blend`.

use super::{check_output, say};
use crate::blend::{self, Classes, Input};
use crate::forest::Model;
use crate::image::{Image, WriteOptions, write_png};
use clap::Args;
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct Blend {
    /// An image with path layers by one of the model's methods.
    a: PathBuf,
    /// An image of the same scene by the other.
    b: PathBuf,
    /// Model; default: the built-in one.
    #[arg(long)]
    model: Option<PathBuf>,
    /// Image to write: the blend with the weight map.
    #[arg(short, long, value_name = "OUT.exr")]
    output: PathBuf,
    /// Also blend the path layers.
    #[arg(long)]
    layers: bool,
    /// Also write a picture in sRGB.
    #[arg(long, value_name = "OUT.png")]
    png: Option<PathBuf>,
}

/// The model of a file, or the built-in one.
pub(super) fn model(path: Option<&Path>) -> anyhow::Result<Model> {
    Ok(match path {
        Some(path) => Model::load(path)?,
        None => blend::builtin()?,
    })
}

impl Blend {
    pub(super) fn run(self) -> anyhow::Result<()> {
        check_output(&self.output, "exr", &[&self.a, &self.b])?;
        if let Some(png) = &self.png {
            check_output(png, "png", &[])?;
        }
        let model = model(self.model.as_deref())?;
        let (a, b) = (Image::read(&self.a)?, Image::read(&self.b)?);
        let (name_a, name_b) = (self.a.display().to_string(), self.b.display().to_string());
        let classes = if self.layers { Classes::Blend } else { Classes::Drop };
        let start = std::time::Instant::now();
        let image = blend::apply(&model, Input::new(&name_a, &a), Input::new(&name_b, &b), classes)?;
        let time = start.elapsed();
        image.write(&self.output, &WriteOptions::default())?;
        if let Some(png) = &self.png {
            write_png(png, image.colour.view(), 0.0)?;
        }
        let (time, output) = (time.as_secs_f64() * 1e3, self.output.display());
        say(format_args!("blended {name_a} and {name_b} in {time:.0} ms, wrote {output}"))
    }
}
