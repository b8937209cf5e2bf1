//! Regression forests for blending weights (Otsu, PhD thesis 2017, section 5.4): rows in, numbers out.
//!
//! [`Rows`] holds sparse training rows, [`train`] grows and refines the trees, [`Forest`] predicts, [`Model`] is the
//! file form, [`Linear`] is a straight-line baseline and [`Quality`] says how well either predicts held-out rows.
//! This room knows nothing of rendering.

mod binned;
mod error;
mod file;
mod grow;
mod lanes;
mod linear;
mod quality;
mod refine;
mod rows;
mod train;
mod tree;

pub use error::ForestError;
pub use file::{FORMAT, MAX_FILE_BYTES, Model, VERSION};
pub(crate) use lanes::{LANES, Lanes};
pub use linear::Linear;
pub use quality::Quality;
pub use rows::{MAX_FEATURES, Rows, SplitBy};
pub use train::{Settings, train};
pub use tree::{Forest, LEAF, MAX_DEPTH, MAX_NODES, Node, Tree};
