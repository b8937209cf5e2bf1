//! `pathblend train`.

use super::render::parse_threads;
use super::{on_threads, write_model};
use crate::blend::Recipe;
use clap::Args;
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct Train {
    /// Recipe (TOML): scenes, methods, times, seeds.
    recipe: PathBuf,
    /// Model to write; `.json` is added to a name without extension.
    #[arg(short, long, value_name = "models/NAME")]
    output: PathBuf,
    /// Folder for the rendered images; default: `cache` beside the recipe.
    #[arg(long)]
    cache: Option<PathBuf>,
    /// Threads; default: all cores.
    #[arg(long, value_name = "N", value_parser = parse_threads)]
    threads: Option<usize>,
    /// Print the leave-one-out table as JSON.
    #[arg(long)]
    json: bool,
}

impl Train {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let recipe = Recipe::read(&self.recipe)?;
        let folder = self.recipe.parent().unwrap_or(Path::new("."));
        let cache = self.cache.clone().unwrap_or_else(|| folder.join("cache"));
        let findings = on_threads(self.threads, || recipe.run(folder, &cache, |line| eprintln!("{line}")))??;
        let output = if self.output.extension().is_none() { self.output.with_extension("json") } else { self.output };
        let bytes = write_model(&findings.model, &output)?;
        if self.json {
            println!("{}", serde_json::to_string(&findings.table)?);
            return Ok(());
        }
        println!("Root mean squared errors on scenes that the forest did not see; `alone` has the time of both:\n");
        print!("{}", findings.table);
        println!("\nErrors of the references, from the difference of their halves:");
        for (scene, error) in &findings.reference_errors {
            println!("  {scene}: {error:.5}");
        }
        println!("\nwrote {} ({bytes} bytes)", output.display());
        Ok(())
    }
}
