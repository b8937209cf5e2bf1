//! What can go wrong between images and models.

use crate::forest::ForestError;

/// Errors of the `blend` room. Each names the image and says what was found and expected.
#[derive(Debug, thiserror::Error)]
pub enum BlendError {
    /// Two images that belong together differ in size.
    #[error("{name}: {found_width} × {found_height} pixels; expected {width} × {height} as in {other}")]
    Size {
        /// The image of the wrong size.
        name: String,
        /// Its width.
        found_width: usize,
        /// Its height.
        found_height: usize,
        /// The image it was compared with.
        other: String,
        /// That one's width.
        width: usize,
        /// That one's height.
        height: usize,
    },
    /// The image has no path layers.
    #[error("{name}: no layer called `path_*`; expected luminance per path class (render with feature layers)")]
    NoLayers {
        /// The image.
        name: String,
    },
    /// A layer's array is not of the image's size.
    #[error("{name}: layer `{layer}` has shape {found:?}; expected that of the image, {height} × {width}")]
    LayerShape {
        /// The image.
        name: String,
        /// The layer.
        layer: String,
        /// Its shape.
        found: Vec<usize>,
        /// The image's height.
        height: usize,
        /// The image's width.
        width: usize,
    },
    /// The image's manifest contradicts the model or the other image.
    #[error("{name}: {what} `{found}`; expected {expected}")]
    Content {
        /// The image.
        name: String,
        /// What of its manifest.
        what: &'static str,
        /// What it says.
        found: String,
        /// What was expected.
        expected: String,
    },
    /// The model was not made for blending images.
    #[error("model: setting `features` is {found}; expected one of \"mean\", \"both\", \"difference\", \"noise\"")]
    FeatureSet {
        /// What the model says.
        found: String,
    },
    /// A setting is out of its range.
    #[error("setting `{name}` is {found}; expected {expected}")]
    Setting {
        /// The setting.
        name: &'static str,
        /// Its value.
        found: String,
        /// Its range.
        expected: &'static str,
    },
    /// Leaving a scene out needs another to learn from.
    #[error("{found} scene(s) to evaluate on; expected at least 2")]
    TooFewScenes {
        /// Number of scenes.
        found: usize,
    },
    /// An image could not be brought into memory.
    #[error("{name}: {message}")]
    Load {
        /// The image.
        name: String,
        /// Why.
        message: String,
    },
    /// Training or prediction failed.
    #[error(transparent)]
    Forest(#[from] ForestError),
}
