//! `pathblend experiment`.

use super::{on_threads, say};
use crate::report::ExperimentRecipe;
use clap::Args;
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct Experiment {
    /// Recipe (TOML): scenes, variants of methods, times, number of seeds.
    recipe: PathBuf,
    /// Folder for the runs, the references and the plots; what is there already is not made again.
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Print all runs as JSON, one object for each line.
    #[arg(long)]
    json: bool,
}

impl Experiment {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let recipe = ExperimentRecipe::read(&self.recipe)?;
        let folder = self.recipe.parent().unwrap_or(Path::new("."));
        let done = on_threads(Some(1), || recipe.run(folder, &self.output, |line| eprintln!("{line}")))??;
        if !self.json {
            return say(format_args!("{done}"));
        }
        done.runs.iter().try_for_each(|run| say(format_args!("{}", serde_json::to_string(run)?)))
    }
}
