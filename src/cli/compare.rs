//! `pathblend compare`.

use super::say;
use crate::image::{Image, metrics};
use anyhow::Context;
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(super) struct Compare {
    /// Image to judge.
    image: PathBuf,
    /// What it should look like.
    reference: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl Compare {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let image = Image::read(&self.image)?;
        let reference = Image::read(&self.reference)?;
        let found = metrics::compare(&image, &reference)
            .with_context(|| format!("cannot compare {} with {}", self.image.display(), self.reference.display()))?;
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
