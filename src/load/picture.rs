//! Image files become [`Picture`]s: PNG, JPEG, TGA, BMP, Radiance HDR and OpenEXR.

use super::document::{Document, Element};
use super::error::LoadError;
use super::guard;
use super::source::read_bounded;
use super::value::Text;
use crate::image::Image;
use crate::scene::Builder;
use crate::texture::{Picture, Texels};
use ::image::{DynamicImage, ImageFormat, ImageReader, Limits};
use rayon::prelude::*;
use std::cell::RefCell;
use std::collections::HashMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Most pixels along an axis.
const MOST: u32 = 1 << 16;

/// Most bytes of a file, and most that a decoder may ask for.
const MOST_BYTES: u64 = 1 << 32;

const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// The images that one load has read, each once.
#[derive(Default)]
pub(super) struct Pictures {
    /// Those in use, in the order in which they were asked for.
    used: RefCell<Vec<Entry>>,
    /// Those that nobody has asked for yet.
    ahead: RefCell<Vec<Entry>>,
}

struct Entry {
    path: PathBuf,
    hash: blake3::Hash,
    picture: Arc<Picture>,
}

impl Pictures {
    /// Reads the images that the textures and emitters of `document` name, all at the same time. What fails is left to
    /// be read again in its turn, so that the first error in the scene is the one that is told.
    pub fn read_ahead(&self, document: &Document<'_>) {
        let names: HashMap<_, _> = document.elements().filter_map(shown).map(|name| (name.path(), name)).collect();
        let names: Vec<_> = names.into_values().collect();
        self.ahead.replace(names.into_par_iter().filter_map(|name| read(name).ok()).collect());
    }

    /// The image that the file name `name` means.
    pub fn get(&self, name: Text<'_>) -> Result<Arc<Picture>, LoadError> {
        let path = name.path();
        let mut used = self.used.borrow_mut();
        if let Some(entry) = used.iter().find(|entry| entry.path == path) {
            return Ok(entry.picture.clone());
        }
        let mut ahead = self.ahead.borrow_mut();
        let entry = match ahead.iter().position(|entry| entry.path == path) {
            Some(index) => ahead.swap_remove(index),
            None => read(name)?,
        };
        let picture = entry.picture.clone();
        used.push(entry);
        Ok(picture)
    }

    /// Adds what is in use to the scene's fingerprint.
    pub fn fingerprint(&self, builder: &mut Builder) {
        for entry in self.used.borrow().iter() {
            builder.fingerprint(entry.hash.as_bytes());
        }
    }
}

/// The name of the image that the texture or emitter around this parameter shows.
fn shown(parameter: Element<'_>) -> Option<Text<'_>> {
    let owner = parameter.node.parent_element()?.tag_name().name();
    let names = parameter.tag() == "string" && parameter.attribute("name")?.text == "filename";
    if names && ["texture", "emitter"].contains(&owner) { parameter.attribute("value") } else { None }
}

/// Reads the image that the file name `name` means.
fn read(name: Text<'_>) -> Result<Entry, LoadError> {
    let path = name.path();
    let bytes = read_bounded(&path, MOST_BYTES).map_err(|reason| {
        let looked = name.source.looked(name.text);
        name.error(format!("cannot read the image {}: {reason}{looked}", path.display()))
    })?;
    let picture = guard(|| decode(&path, &bytes)).and_then(|result| result);
    let picture = picture
        .map_err(|reason| name.error(format!("the image {} cannot be used: {reason}", path.display())))
        .map(Arc::new)?;
    Ok(Entry { path, hash: blake3::hash(&bytes), picture })
}

fn decode(path: &Path, bytes: &[u8]) -> Result<Picture, String> {
    let (size, texels) = if bytes.starts_with(&EXR_MAGIC) { exr(path)? } else { common(path, bytes)? };
    let finite = match &texels {
        Texels::Floats(samples) => samples.iter().all(|sample| sample.is_finite()),
        Texels::Halves(samples) => samples.iter().all(|sample| sample.is_finite()),
        Texels::Bytes(_) | Texels::Shorts(_) => true,
    };
    if !finite {
        return Err("it has a value that is not a finite number".to_owned());
    }
    Picture::new(size, texels).ok_or_else(|| "it has no pixels".to_owned())
}

fn exr(path: &Path) -> Result<([usize; 2], Texels), String> {
    let image = Image::read(path).map_err(|error| error.to_string())?;
    let size = [image.width(), image.height()];
    // Row by row, as it has been read.
    Ok((size, Texels::linear(image.colour.into_raw_vec_and_offset().0)))
}

/// Every format but OpenEXR. What a file starts with counts more than its name; TGA has only the name.
fn common(path: &Path, bytes: &[u8]) -> Result<([usize; 2], Texels), String> {
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|error| error.to_string())?;
    if reader.format().is_none() {
        let format = ImageFormat::from_path(path).ok().filter(|format| *format == ImageFormat::Tga);
        reader.set_format(format.ok_or("it is none of PNG, JPEG, TGA, BMP, HDR, EXR")?);
    }
    let mut limits = Limits::no_limits();
    (limits.max_image_width, limits.max_image_height) = (Some(MOST), Some(MOST));
    limits.max_alloc = Some(MOST_BYTES);
    reader.limits(limits);
    let image = reader.decode().map_err(|error| error.to_string())?;
    let size = [image.width() as usize, image.height() as usize];
    Ok((size, texels(image)))
}

/// The samples without alpha, which does not change what a texture shows.
fn texels(image: DynamicImage) -> Texels {
    use DynamicImage as Kind;
    match image {
        Kind::ImageLuma8(_) | Kind::ImageLumaA8(_) => Texels::Bytes(image.into_luma8().into_raw()),
        Kind::ImageRgb8(_) | Kind::ImageRgba8(_) => Texels::Bytes(image.into_rgb8().into_raw()),
        Kind::ImageLuma16(_) | Kind::ImageLumaA16(_) => Texels::Shorts(image.into_luma16().into_raw()),
        Kind::ImageRgb16(_) | Kind::ImageRgba16(_) => Texels::Shorts(image.into_rgb16().into_raw()),
        _ => Texels::linear(image.into_rgb32f().into_raw()),
    }
}
