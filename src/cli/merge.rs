//! `pathblend merge`.

use super::{check_output, say};
use crate::image::{Image, WriteOptions, write_png};
use crate::integrators::{merge, merge_summary};
use clap::Args;
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct Merge {
    /// Images of one scene by one method, rendered with different seeds; two at least.
    #[arg(required = true)]
    images: Vec<PathBuf>,
    /// Image to write: the mean of all passes.
    #[arg(short, long, value_name = "OUT.exr")]
    output: PathBuf,
    /// Also write a picture in sRGB.
    #[arg(long, value_name = "OUT.png")]
    png: Option<PathBuf>,
    /// Print what was merged as one JSON object.
    #[arg(long)]
    json: bool,
}

impl Merge {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let inputs: Vec<&Path> = self.images.iter().map(PathBuf::as_path).collect();
        check_output(&self.output, "exr", &inputs)?;
        if let Some(png) = &self.png {
            check_output(png, "png", &[])?;
        }
        let read = |path: &PathBuf| Ok((path.display().to_string(), Image::read(path)?));
        let runs = self.images.iter().map(read).collect::<anyhow::Result<Vec<_>>>()?;
        let merged = merge(&runs)?;
        merged.write(&self.output, &WriteOptions::default())?;
        if let Some(png) = &self.png {
            write_png(png, merged.colour.view(), 0.0)?;
        }
        let summary = merge_summary(&merged);
        if self.json {
            return say(format_args!("{}", serde_json::to_string(&summary)?));
        }
        let percent = |name: &str| summary.get("error")?.get(name)?.as_f64().map(|share| 100.0 * share);
        let by_runs = percent("runs").map_or_else(String::new, |e| format!(", by the spread of the runs {e:.3} %"));
        let by_batches = percent("relative").map_or_else(|| "unknown".to_owned(), |e| format!("{e:.3} %"));
        let passes = summary.get("passes").cloned().unwrap_or_default();
        let (count, output) = (runs.len(), self.output.display());
        say(format_args!(
            "merged {count} images, {passes} passes: expected error {by_batches}{by_runs}, wrote {output}"
        ))
    }
}
