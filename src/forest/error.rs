//! What can go wrong with rows, training and model files.

use std::path::PathBuf;

/// Errors of the `forest` room. Each says what was found and what was expected.
#[derive(Debug, thiserror::Error)]
pub enum ForestError {
    /// The model file could not be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The model file is of another format version.
    #[error("{}: model format version {found}, expected {expected}; train the model anew with this version", path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// The version that the file names.
        found: u64,
        /// The version that this program reads.
        expected: u64,
    },
    /// The model file is not what `models/README.md` describes.
    #[error("{}: {what}; expected {expected}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What was found, with its place in the file where there is one.
        what: String,
        /// What was expected there.
        expected: String,
    },
    /// A training row holds something that is no number to learn from.
    #[error("training row {row}: {what}; expected {expected}")]
    Row {
        /// Index of the row, from 0.
        row: usize,
        /// What was found.
        what: String,
        /// What was expected.
        expected: &'static str,
    },
    /// A feature name is empty, given twice, or one too many.
    #[error("feature `{name}`: {what}")]
    Feature {
        /// The name.
        name: String,
        /// What is wrong with it.
        what: &'static str,
    },
    /// A training setting is out of its range.
    #[error("setting `{name}` is {found}; expected {expected}")]
    Setting {
        /// The field of `Settings`.
        name: &'static str,
        /// Its value.
        found: String,
        /// Its range.
        expected: &'static str,
    },
    /// There is no row to learn from.
    #[error("no training row with a positive weight ({rows} rows in all); expected at least one")]
    NoRows {
        /// How many rows there were, those of weight 0 included.
        rows: usize,
    },
    /// The least-squares baseline has no solution.
    #[error("the linear baseline could not be solved: {0}")]
    Linear(String),
    /// Held-out quality was asked for where there is nothing to compare.
    #[error("held-out quality could not be computed: {0}")]
    Quality(String),
}
