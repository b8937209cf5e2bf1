//! Learning where to trust which of two images, and blending them by it (Otsu, PhD thesis 2017, chapter 5).
//!
//! [`append`] turns two images and a reference into training rows, [`train`] learns a [`Model`](crate::forest::Model)
//! from them, [`apply`] blends two images by it, and [`leave_one_out`] judges all that on scenes that were not learnt from.
//! Images are black boxes: colour, and `path_*` layers of class luminances, from this program or another.

mod apply;
mod builtin;
mod campaign;
mod error;
mod evaluate;
mod features;
mod learn;
mod noise;
mod planes;
mod predict;
mod rows;
mod table;
mod weights;

pub use apply::{Classes, apply, weight_layer, weight_map};
pub use builtin::builtin;
pub(crate) use campaign::repeated;
pub use campaign::{Findings, Recipe, RecipeScene, Reference};
pub use error::BlendError;
pub use evaluate::{Options, Pair, leave_one_out};
pub use features::FeatureSet;
pub use learn::{Objective, train};
pub use rows::{RowSettings, append};
pub use table::{SceneErrors, Table};
pub use weights::{QUOTIENT_BOUND, Quotient, quotient};

use crate::image::Image;

/// An image with the name that errors call it by, usually its file.
#[derive(Debug, Clone, Copy)]
pub struct Input<'a> {
    /// Name for messages.
    pub name: &'a str,
    /// The image.
    pub image: &'a Image,
}

impl<'a> Input<'a> {
    /// Names an image.
    pub fn new(name: &'a str, image: &'a Image) -> Self {
        Self { name, image }
    }
}
