//! The text of a pbrt file, and places in it.

use super::gzip;
use crate::load::{LoadError, Place};
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// A file that was read, with the places where its lines start.
pub(super) struct Source {
    pub path: PathBuf,
    pub text: String,
    lines: Vec<usize>,
}

impl Source {
    /// Reads the file at `path`. Bytes that are not UTF-8, such as names in comments, become replacement characters.
    pub fn read(path: &Path) -> Result<Rc<Self>, String> {
        let bytes = std::fs::read(path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
        let bytes = gzip::unpack(bytes).map_err(|reason| format!("cannot read {}: {reason}", path.display()))?;
        let text = match String::from_utf8(bytes) {
            Ok(text) => text,
            Err(error) => String::from_utf8_lossy(error.as_bytes()).into_owned(),
        };
        Ok(Self::new(path, text))
    }

    /// A file with the content `text`.
    pub fn new(path: &Path, text: String) -> Rc<Self> {
        let lines = text.match_indices('\n').map(|(at, _)| at + 1).collect();
        Rc::new(Self { path: path.to_owned(), text, lines })
    }
}

/// A place in a file.
#[derive(Clone)]
pub(super) struct Spot {
    pub source: Rc<Source>,
    pub offset: usize,
}

impl Spot {
    /// An error at this place.
    pub fn error(&self, message: impl Into<String>) -> LoadError {
        let place = Some(Place::at(&self.source.text, self.offset));
        LoadError { place, ..LoadError::whole(&self.source.path, message) }
    }

    /// An error that says what was found here and what should be.
    pub fn expected(&self, found: &str, expected: &str) -> LoadError {
        self.error(format!("found {found}; expected {expected}"))
    }

    /// The number of the line, from 1.
    pub fn line(&self) -> usize {
        self.source.lines.partition_point(|start| *start <= self.offset) + 1
    }
}
