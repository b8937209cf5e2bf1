//! `pathblend compare`.

use super::say;
use crate::image::{Image, is_in_classes, metrics, write_false_colour};
use anyhow::Context;
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(super) struct Compare {
    /// Image to judge.
    image: PathBuf,
    /// What it should look like.
    reference: PathBuf,
    /// Compare the light of those path classes alone that have this in their name, where letters that repeat count once
    #[arg(long, value_name = "SDS", value_parser = path_classes)]
    classes: Option<String>,
    /// Picture of the difference over the sum: blue where the image is too dark, orange where too bright
    #[arg(long, value_name = "MAP.png")]
    map: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl Compare {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let image = Image::read(&self.image)?.of_classes(self.classes.as_deref());
        let reference = Image::read(&self.reference)?.of_classes(self.classes.as_deref());
        let found = metrics::compare(&image, &reference)
            .with_context(|| format!("cannot compare {} with {}", self.image.display(), self.reference.display()))?;
        if let Some(map) = &self.map {
            write_false_colour(map, metrics::difference(&image, &reference)?.view())?;
        }
        if self.json {
            say(format_args!("{}", serde_json::to_string(&found)?))?;
            return Ok(());
        }
        say(format_args!("{:<10} {:>12} {:>12}", "", "all", "trimmed"))?;
        let rows = [
            ("MSE", found.mse, found.trimmed.mse),
            ("RMSE", found.rmse, found.trimmed.rmse),
            ("relMSE", found.relmse, found.relmse_trimmed),
            ("SMAPE", found.smape, found.trimmed.smape),
            ("MAPE", found.mape, found.trimmed.mape),
            ("FLIP (LDR)", found.flip, found.trimmed.flip),
        ];
        for (name, all, trimmed) in rows {
            say(format_args!("{name:<10} {all:>12.6} {trimmed:>12.6}"))?;
        }
        say(format_args!("{:<10} {:>12.6}", "mean ratio", found.mean_ratio))?;
        say(format_args!(
            "trimmed: without the 0.1 % worst of {} pixels; {} pixels not finite",
            found.pixels, found.nonfinite
        ))?;
        Ok(())
    }
}

fn path_classes(text: &str) -> Result<String, String> {
    match is_in_classes(text) {
        true => Ok(text.to_owned()),
        false => Err("expected letters of L, D, S and E, such as SDS".to_owned()),
    }
}
