//! What the conversion changed, for the user to judge.

use super::source::Spot;
use serde::Serialize;
use std::collections::HashSet;
use std::fmt;
use std::path::PathBuf;

/// How the result differs from the source.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Change {
    /// Replaced by the nearest thing.
    Approximated,
    /// Not in the result.
    LeftOut,
}

/// One difference between source and result.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Note {
    /// How the result differs.
    pub change: Change,
    /// The file that has the line.
    pub file: PathBuf,
    /// The line, from 1.
    pub line: usize,
    /// What was there and what became of it.
    pub message: String,
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let change = match self.change {
            Change::Approximated => "approximated",
            Change::LeftOut => "left out",
        };
        write!(f, "{}:{}: {change}: {}", self.file.display(), self.line, self.message)
    }
}

/// What a conversion did.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    /// Shapes of the result, those of groups once.
    pub shapes: usize,
    /// Placements of groups.
    pub instances: usize,
    /// Lights, shapes that shine included.
    pub lights: usize,
    /// Materials of the result.
    pub materials: usize,
    /// Files that were written beside the scene, relative to it.
    pub files: Vec<PathBuf>,
    /// Differences between source and result, in the order in which they were met.
    pub notes: Vec<Note>,
    #[serde(skip)]
    seen: HashSet<Note>,
}

impl Report {
    /// Notes that something was replaced by the nearest thing.
    pub(super) fn approximated(&mut self, spot: &Spot, message: impl Into<String>) {
        self.note(Change::Approximated, spot, message.into());
    }

    /// Notes that something is not in the result.
    pub(super) fn left_out(&mut self, spot: &Spot, message: impl Into<String>) {
        self.note(Change::LeftOut, spot, message.into());
    }

    fn note(&mut self, change: Change, spot: &Spot, message: String) {
        let note = Note { change, file: spot.source.path.clone(), line: spot.line(), message };
        if self.seen.insert(note.clone()) {
            self.notes.push(note);
        }
    }
}
