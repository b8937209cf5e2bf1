//! Images: linear colour with named float layers, their files, and how far two of them are apart.
//!
//! [`Image`] is what every stage hands to the next: a renderer develops its film into one, the blender
//! reads several and writes one. It lives in multi-layer OpenEXR files ([`Image::read`], [`Image::write`]);
//! [`write_png`] and [`write_false_colour`] make pictures to look at, and [`metrics::compare`] measures.

mod colour_map;
mod error;
mod exr;
mod layers;
pub mod metrics;
mod png;
mod srgb;
mod whole;

pub use colour_map::diverging;
pub use error::ImageError;
pub use exr::{Precision, WriteOptions, layers_path};
pub use layers::{
    DEPTH_KEY, INTEGRATOR_KEY, Image, LUMINANCE_WEIGHTS, Layer, SCENE_KEY, check_layer_name, is_in_classes, luminance,
};
pub use png::{write_false_colour, write_png};
pub use srgb::{encode as srgb_encode, to_srgb8};
pub use whole::write_whole;
