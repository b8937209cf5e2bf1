//! Reading OpenEXR, by whomever it was written, whatever has happened to it since.

use std::collections::HashSet;
use std::fs;
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use ::exr::block::chunk::{Chunk, CompressedBlock};
use ::exr::block::lines::LineRef;
use ::exr::block::reader::{ChunksReader, Reader};
use ::exr::block::{self, UncompressedBlock};
use ::exr::error::{Error, Result as ExrResult};
use ::exr::meta::MetaData;
use ::exr::meta::attribute::{AttributeValue, SampleType, Text};
use ::exr::meta::header::Header;
use ::exr::prelude::Compression;
use half::f16;
use ndarray::{Array2, Array3};
use rayon::prelude::*;
use serde_json::{Map, Value};

use super::super::{Image, ImageError, Layer};
use super::groups::{self, Group};
use super::{LAYERS_FILE, MANIFEST, RENDER_TIME, SAMPLES, Twin};

const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];
/// How many blocks are decompressed before their samples are taken out.
const BLOCKS_AT_ONCE: usize = 32;
/// How many numbers the head of a DWA block has, and by how much they may exceed twice the pixels' bytes: DCT
/// blocks at the edge are padded to 8×8.
const DWA_NUMBERS: usize = 11;
const DWA_SLACK: u64 = 1 << 16;
/// A block costs at least this many bytes: its place in the offset table, a coordinate and a size.
const LEAST_BYTES_PER_BLOCK: u128 = 16;

/// See [`Image::read`].
pub(in super::super) fn read(path: &Path) -> Result<Image, ImageError> {
    let bytes = load(path)?;
    guarded(path, || read_picture(path, &bytes))
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

/// Runs a decoder on bytes that may be anything. The `exr` crate (1.74) answers some damaged files with a
/// failed assertion or an index out of bounds instead of an error (PIZ blocks, tile sizes of zero), and there
/// is no way to see all of them coming without writing the decoder again. Nothing outlives the unwinding: the
/// closure only borrows the bytes. What would abort instead of unwinding, an impossible allocation, is ruled
/// out by [`check_promise`].
fn guarded<T>(path: &Path, decode: impl FnOnce() -> Result<T, ImageError>) -> Result<T, ImageError> {
    catch_unwind(AssertUnwindSafe(decode))
        .unwrap_or_else(|_| Err(damaged(path, "its contents contradict each other".to_owned())))
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

/// Refuses a header that promises more pixels or blocks than the file's bytes can hold: believing it would
/// mean to ask for terabytes of memory, which ends the process.
fn check_promise(header: &Header, file_bytes: usize) -> Result<(), String> {
    let (width, height) = (header.layer_size.width(), header.layer_size.height());
    if width == 0 || height == 0 {
        return Err("it has no pixels".to_owned());
    }
    let file_bytes = file_bytes as u128;
    let bytes = width as u128 * height as u128 * header.channels.bytes_per_pixel as u128;
    let blocks = header.chunk_count as u128;
    if bytes > file_bytes * best_ratio(header.compression) || blocks * LEAST_BYTES_PER_BLOCK > file_bytes {
        let channels = header.channels.list.len();
        return Err(format!(
            "it promises {width}x{height} pixels with {channels} channels, \
             more than its {file_bytes} bytes can hold"
        ));
    }
    Ok(())
}

/// An upper bound of how many bytes of pixels one byte of a file can stand for.
fn best_ratio(compression: Compression) -> u128 {
    match compression {
        Compression::Uncompressed => 1,
        // A pair of bytes stands for a run of at most 128.
        Compression::RLE => 64,
        // Deflate reaches 1032; PXR24 also drops a byte of four. Runs in PIZ reach 255 samples in 9 bits.
        Compression::ZIP1 | Compression::ZIP16 | Compression::PXR24 | Compression::PIZ => 2048,
        Compression::B44 | Compression::B44A => 16,
        // Deflate over one number for a block of 64 samples.
        _ => 1 << 17,
    }
}

fn list_channels(headers: &[Header]) -> String {
    let channels = headers.iter().flat_map(|header| header.channels.list.iter());
    let names: Vec<String> = channels.map(|channel| channel.name.to_string()).collect();
    match names.len() {
        0..=12 => names.join(", "),
        more => format!("{} and {} more", names[..10].join(", "), more - 10),
    }
}

/// The samples of one group while they are collected: pixels in rows, `step` numbers each.
struct Plane {
    step: usize,
    samples: Vec<f32>,
}

impl Plane {
    fn into_layer(self, (height, width): (usize, usize)) -> Option<Layer> {
        if self.step == 1 {
            let samples = Array2::from_shape_vec((height, width), self.samples);
            samples.ok().map(Layer::Luminance)
        } else {
            let samples = Array3::from_shape_vec((height, width, 3), self.samples);
            samples.ok().map(Layer::Colour)
        }
    }
}

/// Where the samples of one channel go.
#[derive(Clone, Copy)]
struct Slot {
    plane: usize,
    component: usize,
}

/// Reads the samples of all `groups`, which must be of one size, in their order.
fn read_planes(reader: Reader<Cursor<&[u8]>>, groups: &[Group], file_bytes: usize) -> ExrResult<Vec<Plane>> {
    let meta = reader.meta_data().clone();
    let slots = slots(&meta.headers, groups);
    let wanted: HashSet<usize> = groups.iter().map(|group| group.part).collect();
    let mut planes = groups
        .iter()
        .map(|group| empty_plane(&meta.headers[group.part], group, file_bytes))
        .collect::<ExrResult<Vec<_>>>()?;
    let mut chunks = reader
        .filter_chunks(false, |_, tile, block| wanted.contains(&block.layer) && tile.is_largest_resolution_level())?;
    let expected = chunks.expected_chunk_count();
    let mut seen = HashSet::with_capacity(expected);
    loop {
        let batch: Vec<Chunk> = chunks.by_ref().take(BLOCKS_AT_ONCE).collect::<ExrResult<_>>()?;
        if batch.is_empty() {
            break;
        }
        for block in decompress(batch, &meta)? {
            seen.insert((block.index.layer, block.index.level, block.index.pixel_position));
            store(&block, &meta, &slots, &mut planes)?;
        }
    }
    // A damaged offset table sends the reader to the same block twice, and another stays black.
    if seen.len() == expected {
        return Ok(planes);
    }
    let missing = expected - seen.len();
    Err(invalid(format!("{missing} of {expected} blocks of pixels are missing")))
}

fn invalid(reason: String) -> Error {
    Error::Invalid(reason.into())
}

/// For each part and channel, where its samples go, if anywhere.
fn slots(headers: &[Header], groups: &[Group]) -> Vec<Vec<Option<Slot>>> {
    let none = |header: &Header| vec![None; header.channels.list.len()];
    let mut slots: Vec<Vec<Option<Slot>>> = headers.iter().map(none).collect();
    for (plane, group) in groups.iter().enumerate() {
        for (component, &channel) in group.channels.iter().enumerate() {
            slots[group.part][channel] = Some(Slot { plane, component });
        }
    }
    slots
}

fn empty_plane(header: &Header, group: &Group, file_bytes: usize) -> ExrResult<Plane> {
    let step = group.channels.len();
    let length = header.layer_size.area() * step;
    let mut samples = Vec::new();
    samples
        .try_reserve_exact(length)
        .map_err(|_| invalid(format!("no memory for {length} samples of a file of {file_bytes} bytes")))?;
    samples.resize(length, 0.0);
    Ok(Plane { step, samples })
}

fn decompress(batch: Vec<Chunk>, meta: &MetaData) -> ExrResult<Vec<UncompressedBlock>> {
    let decompress = |chunk: Chunk| {
        check_dwa(&chunk, meta)?;
        UncompressedBlock::decompress_chunk(chunk, meta, false)
    };
    batch.into_par_iter().map(decompress).collect()
}

/// Refuses a DWA block whose head asks for more memory than its pixels take. The head is eleven numbers of
/// eight bytes, sizes and counts all but two small ones (OpenEXR, `internal_dwa_compressor.h`), and the `exr`
/// crate (1.74) allocates what they say before it looks further.
fn check_dwa(chunk: &Chunk, meta: &MetaData) -> ExrResult<()> {
    let Some(header) = meta.headers.get(chunk.layer_index) else {
        return Ok(()); // the decoder has its own error for this
    };
    let bytes = match &chunk.compressed_block {
        CompressedBlock::ScanLine(block) => &block.compressed_pixels_le,
        CompressedBlock::Tile(block) => &block.compressed_pixels_le,
        _ => return Ok(()),
    };
    if !matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
        return Ok(());
    }
    let place = header.get_block_data_indices(&chunk.compressed_block)?;
    let place = header.get_absolute_block_pixel_coordinates(place)?;
    let raw = place.size.area() * header.channels.bytes_per_pixel;
    let mut numbers = bytes.as_chunks::<8>().0.iter().take(DWA_NUMBERS);
    let limit = 2 * raw as u64 + DWA_SLACK;
    // A block that did not shrink is stored as it is, without a head.
    if bytes.len() != raw && numbers.any(|bytes| u64::from_le_bytes(*bytes) > limit) {
        return Err(invalid("a block of pixels has an impossible size".to_owned()));
    }
    Ok(())
}

/// Takes the wanted channels out of a block.
fn store(
    block: &UncompressedBlock,
    meta: &MetaData,
    slots: &[Vec<Option<Slot>>],
    planes: &mut [Plane],
) -> ExrResult<()> {
    let stray = || invalid("a block of pixels lies outside the image".to_owned());
    let header = meta.headers.get(block.index.layer).ok_or_else(stray)?;
    if block.index.level != ::exr::math::Vec2(0, 0) {
        return Err(stray());
    }
    for line in block.lines(&header.channels) {
        let location = line.location;
        let Some(slot) = slots[location.layer][location.channel] else {
            continue;
        };
        let plane = &mut planes[slot.plane];
        let start = location.position.y() * header.layer_size.width() + location.position.x();
        let pixels = start * plane.step..(start + location.sample_count) * plane.step;
        let target = plane.samples.get_mut(pixels).ok_or_else(stray)?;
        let target = target.iter_mut().skip(slot.component).step_by(plane.step);
        copy_line(line, header.channels.list[location.channel].sample_type, target);
    }
    Ok(())
}

/// Converts the samples of a line to `f32`: exactly from halves, rounded from unsigned integers.
fn copy_line<'a>(line: LineRef<'_>, kind: SampleType, target: impl Iterator<Item = &'a mut f32>) {
    let (words, halves) = (line.value.as_chunks::<4>().0, line.value.as_chunks::<2>().0);
    match kind {
        SampleType::F32 => target.zip(words).for_each(|(t, b)| *t = f32::from_ne_bytes(*b)),
        SampleType::U32 => target.zip(words).for_each(|(t, b)| *t = u32::from_ne_bytes(*b) as f32),
        SampleType::F16 => target.zip(halves).for_each(|(t, b)| *t = f16::from_ne_bytes(*b).to_f32()),
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
