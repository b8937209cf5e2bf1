//! What can go wrong with an image, said so that a person can mend it.

use std::io;
use std::path::PathBuf;

/// An image that could not be read, written or compared. Each message names the file (or the layer) and
/// says what was expected.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The operating system refused; `action` is `read` or `write`.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// The file in question.
        path: PathBuf,
        /// `read` or `write`.
        action: &'static str,
        /// The system's reason.
        source: io::Error,
    },
    /// The file does not start like an OpenEXR file.
    #[error(
        "{} is not an OpenEXR file: expected it to start with the bytes 76 2f 31 01, found {found}",
        path.display()
    )]
    NotExr {
        /// The file in question.
        path: PathBuf,
        /// Its first bytes, in hexadecimal.
        found: String,
    },
    /// An OpenEXR file that contradicts itself or ends too early.
    #[error("{} is truncated or damaged: {reason}; expected a complete OpenEXR file", path.display())]
    Damaged {
        /// The file in question.
        path: PathBuf,
        /// What does not fit.
        reason: String,
    },
    /// A valid OpenEXR file with a feature that is not supported (deep pixels, subsampled channels).
    #[error(
        "{} uses an OpenEXR feature that pathblend cannot read ({reason}); \
         expected flat, full-resolution channels",
        path.display()
    )]
    Unsupported {
        /// The file in question.
        path: PathBuf,
        /// The feature.
        reason: String,
    },
    /// An OpenEXR file without a picture.
    #[error(
        "{} has no colour: expected channels R, G, B (or Y for grey), found {channels}",
        path.display()
    )]
    NoColour {
        /// The file in question.
        path: PathBuf,
        /// The channels that it does have.
        channels: String,
    },
    /// The JSON manifest in the file is not a JSON object.
    #[error("{} has a damaged manifest: expected a JSON object in the attribute `pathblend`: {reason}",
        path.display())]
    Manifest {
        /// The file in question.
        path: PathBuf,
        /// What the JSON parser said.
        reason: String,
    },
    /// The output path names something that must not be replaced by a file.
    #[error("cannot write {}: expected a file or a new name, found {found}", path.display())]
    Target {
        /// The path in question.
        path: PathBuf,
        /// What is there.
        found: &'static str,
    },
    /// The image could not be put into the file's format.
    #[error("cannot write {}: {reason}", path.display())]
    Encode {
        /// The file in question.
        path: PathBuf,
        /// What does not fit.
        reason: String,
    },
    /// A layer with a name that other tools would split or strip.
    #[error("bad layer name `{name}`: expected a letter, then letters, digits or underscores")]
    LayerName {
        /// The name.
        name: String,
    },
    /// A layer of another size than its image, or colour without three channels.
    #[error("layer `{layer}` has the shape {found:?}: expected {expected:?} (height, width, channels)")]
    LayerShape {
        /// The layer's name; `colour` for the image itself.
        layer: String,
        /// The shape that it has.
        found: Vec<usize>,
        /// The shape that it must have.
        expected: Vec<usize>,
    },
    /// Two images that cannot be compared pixel by pixel.
    #[error(
        "the images differ in size: the image is {}x{}, the reference is {}x{} pixels; expected the same",
        image.0, image.1, reference.0, reference.1
    )]
    SizeMismatch {
        /// Width and height of the image.
        image: (usize, usize),
        /// Width and height of the reference.
        reference: (usize, usize),
    },
    /// Not one pixel is finite in both images, or the images have no pixels.
    #[error("nothing to compare: expected pixels that are finite in both images, found none of {pixels}")]
    NothingToCompare {
        /// How many pixels each image has.
        pixels: usize,
    },
}
