//! What methods are worth in a given time: experiments over scenes, seeds and times, as tables and plots.

mod experiment;
mod plot;
mod recipe;
mod table;

pub use experiment::{Experiment, Run};
pub use recipe::{ExperimentRecipe, Variant};

/// What keeps an experiment from being made.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A file that cannot be used.
    #[error("{name}: {message}")]
    File {
        /// The file.
        name: String,
        /// What is wrong with it, and what was expected.
        message: String,
    },
    /// An image that cannot be read, written or compared.
    #[error(transparent)]
    Image(#[from] crate::image::ImageError),
    /// A plot that cannot be drawn.
    #[error("cannot draw {name}: {message}")]
    Plot {
        /// Its file.
        name: String,
        /// Why.
        message: String,
    },
}
