//! OpenEXR files: one single part, top-level `R`, `G`, `B`, and a layer `NAME.Y` or `NAME.R/G/B` each.
//!
//! Samples are 32-bit floats (or halves, where asked for) in ZIP-compressed scan lines. The manifest is one
//! string attribute, `pathblend`; what pbrt names itself is also written under pbrt's names, so that scripts
//! made for pbrt's files find it. See `ARCHITECTURE.md`, "Images".

mod decode;
mod encode;
mod groups;
mod guard;
mod planes;
mod zip;

use std::ffi::OsString;
use std::path::{Path, PathBuf};

pub(super) use decode::read;
pub(super) use encode::write;

/// The attribute that holds the JSON manifest.
const MANIFEST: &str = "pathblend";
/// The attribute of a split file that names the file with its layers, without folder.
const LAYERS_FILE: &str = "pathblendLayers";

/// An attribute of pbrt's (pbrt-v4, `util/image.h`, `ImageMetadata`) and the manifest's key for the same thing.
struct Twin {
    attribute: &'static str,
    key: &'static str,
}

const RENDER_TIME: Twin = Twin { attribute: "renderTimeSeconds", key: "wall_s" };
const SAMPLES: Twin = Twin { attribute: "samplesPerPixel", key: "samples_per_pixel" };

/// How exactly samples are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// 32-bit floats: what was written is what is read, bit for bit.
    #[default]
    Float,
    /// 16-bit floats: 11 significant bits. Finite values beyond ±65504 become ±65504, not infinite.
    Half,
}

/// How to write an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct WriteOptions {
    /// How exactly samples are stored.
    pub precision: Precision,
    /// Write the layers to a second file, [`layers_path`], for tools that choke on extra channels. Reading
    /// the first file joins the layers again where the second still lies beside it.
    pub split: bool,
}

/// Where the layers of a split image go: `OUT.exr` gives `OUT_layers.exr`.
pub fn layers_path(path: &Path) -> PathBuf {
    let mut name = OsString::from(path.file_stem().unwrap_or_default());
    name.push("_layers");
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}
