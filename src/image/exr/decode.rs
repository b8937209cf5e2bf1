//! Reading OpenEXR, by whomever it was written, whatever has happened to it since.

use std::fs;
use std::io::Cursor;
use std::path::Path;

use ::exr::block;
use ::exr::block::reader::Reader;
use ::exr::error::Error;
use ::exr::meta::attribute::{AttributeValue, Text};
use ::exr::meta::header::Header;
use ndarray::Array3;
use serde_json::{Map, Value};

use super::super::{Image, ImageError, Layer};
use super::groups;
use super::guard::{check_promise, guarded};
use super::planes::read_planes;
use super::{LAYERS_FILE, MANIFEST, RENDER_TIME, SAMPLES, Twin};

const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];
/// See [`Image::read`].
pub(in super::super) fn read(path: &Path) -> Result<Image, ImageError> {
    let bytes = load(path)?;
    let picture = guarded(|| read_picture(path, &bytes));
    picture.unwrap_or_else(|| Err(damaged(path, "its contents contradict each other".to_owned())))
}

fn load(path: &Path) -> Result<Vec<u8>, ImageError> {
    let bytes = fs::read(path).map_err(|source| ImageError::Io { path: path.to_owned(), action: "read", source })?;
    if bytes.starts_with(&MAGIC) {
        return Ok(bytes);
    }
    let first: Vec<String> = bytes.iter().take(4).map(|b| format!("{b:02x}")).collect();
    let found = if first.is_empty() { "an empty file".to_owned() } else { first.join(" ") };
    Err(ImageError::NotExr { path: path.to_owned(), found })
}

fn damaged(path: &Path, reason: String) -> ImageError {
    ImageError::Damaged { path: path.to_owned(), reason }
}

fn convert(path: &Path, error: Error) -> ImageError {
    let path = path.to_owned();
    match error {
        Error::NotSupported(reason) => ImageError::Unsupported { path, reason: reason.into_owned() },
        Error::Invalid(reason) => ImageError::Damaged { path, reason: reason.into_owned() },
        Error::Io(source) => ImageError::Io { path, action: "read", source },
        Error::Aborted => ImageError::Damaged { path, reason: "reading stopped".to_owned() },
    }
}

fn read_picture(path: &Path, bytes: &[u8]) -> Result<Image, ImageError> {
    let reader = open(path, bytes)?;
    let headers = reader.headers().to_vec();
    let Some(selection) = groups::select(&headers) else {
        return Err(ImageError::NoColour { path: path.to_owned(), channels: list_channels(&headers) });
    };
    let size = headers[selection.beauty.part].layer_size;
    let manifest = manifest(path, &headers[selection.beauty.part])?;
    let (names, layers): (Vec<_>, Vec<_>) = selection.layers.into_iter().unzip();
    let groups = [vec![selection.beauty], layers].concat();
    let planes = read_planes(reader, &groups, bytes.len()).map_err(|e| convert(path, e))?;
    let shape = (size.height(), size.width());
    let mut layers = planes.into_iter().map(|plane| plane.into_layer(shape));
    let beauty = layers.next().flatten().ok_or_else(|| no_samples(path))?;
    let layers = names.into_iter().zip(layers.flatten()).collect();
    let mut image = Image {
        colour: match beauty {
            Layer::Colour(colour) => colour,
            Layer::Luminance(grey) => Array3::from_shape_fn((shape.0, shape.1, 3), |(y, x, _)| grey[[y, x]]),
        },
        layers,
        manifest,
    };
    join_layers_file(path, &headers[0], &mut image)?;
    Ok(image)
}

fn no_samples(path: &Path) -> ImageError {
    damaged(path, "its channels do not fill its window".to_owned())
}

/// Parses what comes before the pixels and checks it.
fn open<'a>(path: &Path, bytes: &'a [u8]) -> Result<Reader<Cursor<&'a [u8]>>, ImageError> {
    let reader = block::read(Cursor::new(bytes), false).map_err(|e| convert(path, e))?;
    for header in reader.headers() {
        check_promise(header, bytes.len()).map_err(|reason| damaged(path, reason))?;
    }
    Ok(reader)
}

fn list_channels(headers: &[Header]) -> String {
    let channels = headers.iter().flat_map(|header| header.channels.list.iter());
    let names: Vec<String> = channels.map(|channel| channel.name.to_string()).collect();
    match names.len() {
        0..=12 => names.join(", "),
        more => format!("{} and {} more", names[..10].join(", "), more - 10),
    }
}

fn attribute<'a>(header: &'a Header, name: &str) -> Option<&'a AttributeValue> {
    let name = Text::from(name);
    let own = header.own_attributes.other.get(&name);
    own.or_else(|| header.shared_attributes.other.get(&name))
}

fn text_attribute<'a>(header: &'a Header, name: &str) -> Option<&'a [u8]> {
    match attribute(header, name)? {
        AttributeValue::Text(text) => Some(text.as_slice()),
        _ => None,
    }
}

/// The manifest, completed by what pbrt's attributes say where it is silent.
fn manifest(path: &Path, header: &Header) -> Result<Map<String, Value>, ImageError> {
    let mut manifest = match text_attribute(header, MANIFEST) {
        None => Map::new(),
        Some(json) => serde_json::from_slice(json)
            .map_err(|error| ImageError::Manifest { path: path.to_owned(), reason: error.to_string() })?,
    };
    for Twin { attribute: name, key } in [RENDER_TIME, SAMPLES] {
        let value = match attribute(header, name) {
            Some(AttributeValue::F32(value)) => Value::from(*value),
            Some(AttributeValue::I32(value)) => Value::from(*value),
            _ => continue,
        };
        manifest.entry(key).or_insert(value);
    }
    Ok(manifest)
}

/// Adds the layers of a split image, where the file with them still lies beside the picture.
fn join_layers_file(path: &Path, header: &Header, image: &mut Image) -> Result<(), ImageError> {
    let name = text_attribute(header, LAYERS_FILE).and_then(|name| str::from_utf8(name).ok());
    // Only a plain name counts: a file from elsewhere must not send the reader to other folders.
    let Some(name) = name.filter(|name| Path::new(name).file_name() == Some(name.as_ref())) else {
        return Ok(());
    };
    let beside = path.with_file_name(name);
    if !beside.is_file() {
        return Ok(());
    }
    let bytes = load(&beside)?;
    let reader = open(&beside, &bytes)?;
    let headers = reader.headers().to_vec();
    let (names, groups): (Vec<_>, Vec<_>) = groups::all_layers(&headers).into_iter().unzip();
    let size = (image.width(), image.height());
    if let Some(other) = headers.iter().map(|h| h.layer_size).find(|s| (s.0, s.1) != size) {
        return Err(damaged(
            &beside,
            format!("its layers have {}x{} pixels, {} has {}x{}", other.0, other.1, path.display(), size.0, size.1),
        ));
    }
    let planes = read_planes(reader, &groups, bytes.len()).map_err(|e| convert(&beside, e))?;
    for (name, plane) in names.into_iter().zip(planes) {
        let layer = plane.into_layer((size.1, size.0)).ok_or_else(|| no_samples(&beside))?;
        image.insert(name, layer)?;
    }
    Ok(())
}
