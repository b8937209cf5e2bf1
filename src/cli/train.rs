//! `pathblend train`.

use super::render::parse_threads;
use super::{check_output, on_threads, say};
use crate::blend::Recipe;
use anyhow::Context;
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
        let output = if self.output.extension().is_none() { self.output.with_extension("json") } else { self.output };
        if let Some(folder) = output.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
        }
        check_output(&output, "json", &[&self.recipe])?;
        let recipe = Recipe::read(&self.recipe)?;
        let folder = self.recipe.parent().unwrap_or(Path::new("."));
        let cache = self.cache.clone().unwrap_or_else(|| folder.join("cache"));
        let findings = on_threads(self.threads, || recipe.run(folder, &cache, |line| eprintln!("{line}")))??;
        findings.model.save(&output)?;
        let bytes = std::fs::metadata(&output)?.len();
        if self.json {
            return say(format_args!("{}", serde_json::to_string(&findings.table)?));
        }
        say(format_args!(
            "Root mean squared errors on scenes that the forest did not see; `alone` has the time of both:"
        ))?;
        say(format_args!("\n{}", findings.table))?;
        say(format_args!("Errors of the references, from the difference of their halves:"))?;
        for (scene, error) in &findings.reference_errors {
            say(format_args!("  {scene}: {error:.5}"))?;
        }
        say(format_args!("\nwrote {} ({bytes} bytes)", output.display()))
    }
}
