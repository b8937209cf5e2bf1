//! Errors that point at the user's line.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Most characters of a line that are shown.
const SHOWN: usize = 120;

/// A scene file that cannot be loaded: where, what was found, and what was expected.
///
/// It reads `FILE:LINE:COLUMN: MESSAGE`, followed by the line with a caret under the column.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{}", self.describe())]
pub struct LoadError {
    /// The scene file.
    pub file: PathBuf,
    /// Where in the scene file; `None` where the whole file is meant.
    pub place: Option<Place>,
    /// What was found and what was expected.
    pub message: String,
}

/// A place in a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// The line, cut where it is long.
    pub excerpt: String,
    /// Number of characters of the excerpt before the place.
    pub indent: usize,
}

impl LoadError {
    /// An error that concerns the whole file.
    pub(crate) fn whole(file: &Path, message: impl Into<String>) -> Self {
        Self { file: file.to_owned(), place: None, message: printable(&message.into()) }
    }

    fn describe(&self) -> String {
        let mut text = self.file.display().to_string();
        if let Some(place) = &self.place {
            let _ = write!(text, ":{}:{}", place.line, place.column);
        }
        let _ = write!(text, ": {}", self.message);
        if let Some(place) = &self.place {
            let pad = |c| if c == '\t' { '\t' } else { ' ' };
            let indent: String = place.excerpt.chars().take(place.indent).map(pad).collect();
            let _ = write!(text, "\n   | {}\n   | {indent}^", place.excerpt);
        }
        text
    }
}

impl Place {
    /// The place at the byte `offset` of `text`.
    pub(crate) fn at(text: &str, offset: usize) -> Self {
        let before = text.get(..offset).unwrap_or(text);
        let start = before.rfind('\n').map_or(0, |newline| newline + 1);
        let line = text.get(start..).and_then(|rest| rest.lines().next()).unwrap_or_default();
        let column = before[start..].chars().count();
        let (excerpt, indent) = cut(line, column);
        Self { line: before.matches('\n').count() + 1, column: column + 1, excerpt, indent }
    }
}

/// At most [`SHOWN`] characters of `line` around `column`, and how many of them stand before it.
fn cut(line: &str, column: usize) -> (String, usize) {
    let skipped = if column < SHOWN { 0 } else { column - SHOWN / 2 };
    let excerpt: String = line.chars().skip(skipped).take(SHOWN).collect();
    (printable(&excerpt), column - skipped)
}

/// The text on one line, with the characters replaced that would garble a terminal.
pub(super) fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() && c != '\t' { char::REPLACEMENT_CHARACTER } else { c }).collect()
}

/// `nothing`, `a`, or `one of a, b, c`.
pub(crate) fn one_of<S: AsRef<str>>(names: &[S]) -> String {
    match names {
        [] => "nothing".to_owned(),
        [only] => only.as_ref().to_owned(),
        _ => format!("one of {}", names.iter().map(AsRef::as_ref).collect::<Vec<_>>().join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_caret_stands_under_the_place() {
        let text = "<scene>\r\n\t<bsdf type=\"ä\" id=\"velvet\"/>\r\n</scene>";
        let place = Place::at(text, text.find("id").unwrap_or_default());
        assert_eq!((place.line, place.column), (2, 17));
        let error = LoadError { file: "s.xml".into(), place: Some(place), message: "odd".into() };
        let expected = "s.xml:2:17: odd\n   | \t<bsdf type=\"ä\" id=\"velvet\"/>\n   | \t               ^";
        assert_eq!(error.to_string(), expected);
    }

    #[test]
    fn long_lines_are_cut_around_the_place() {
        let text = format!("{}x{}", "a".repeat(1000), "b".repeat(1000));
        let place = Place::at(&text, 1000);
        assert_eq!(place.excerpt.chars().nth(place.indent), Some('x'));
        assert_eq!((place.column, place.excerpt.chars().count()), (1001, SHOWN));
    }
}
