//! `pathblend import`.

use super::{check_output, say};
use crate::import::{Change, Options, import};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(super) struct Import {
    /// Scene of pbrt, version 4 or 3.
    scene: PathBuf,
    /// Scene to write; meshes go to the folder `meshes` beside it.
    #[arg(short, long, value_name = "OUT.xml")]
    output: PathBuf,
    /// Replace what is unknown by the nearest thing instead of refusing it.
    #[arg(long)]
    approximate: bool,
    /// Print what was done as one JSON object.
    #[arg(long)]
    json: bool,
}

impl Import {
    pub(super) fn run(self) -> anyhow::Result<()> {
        check_output(&self.output, "xml", &[&self.scene])?;
        let report = import(&self.scene, &self.output, &Options { approximate: self.approximate })?;
        if self.json {
            return say(format_args!("{}", serde_json::to_string(&report)?));
        }
        for note in &report.notes {
            say(format_args!("{note}"))?;
        }
        let count = |change| report.notes.iter().filter(|note| note.change == change).count();
        say(format_args!(
            "{}: {} shapes, {} instances, {} lights, {} materials; {} approximated, {} left out",
            self.output.display(),
            report.shapes,
            report.instances,
            report.lights,
            report.materials,
            count(Change::Approximated),
            count(Change::LeftOut),
        ))
    }
}
