//! Writing OpenEXR.

use std::io::BufWriter;
use std::path::Path;

use ::exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock};
use ::exr::block::writer::ChunksWriter;
use ::exr::block::{self, BlockIndex, UncompressedBlock, lines::LineRefMut};
use ::exr::error::UnitResult;
use ::exr::meta::attribute::{AttributeValue, ChannelDescription, LineOrder, SampleType, Text};
use ::exr::meta::header::Header;
use ::exr::meta::{BlockDescription, MetaData};
use ::exr::prelude::Compression;
use half::f16;
use ndarray::{ArrayView2, ArrayView3, Axis};
use rayon::prelude::*;
use serde_json::Value;

use super::super::{Image, ImageError, Layer, whole::write_whole};
use super::{LAYERS_FILE, MANIFEST, Precision, RENDER_TIME, SAMPLES, WriteOptions, layers_path, zip};

/// How many blocks are compressed before they are written: enough to keep all cores busy, few enough to
/// hold in memory.
const BLOCKS_AT_ONCE: usize = 32;

/// One channel of the file: its full name and its samples, height × width.
struct Channel<'a> {
    name: String,
    samples: ArrayView2<'a, f32>,
}

type Attributes = Vec<(&'static str, AttributeValue)>;

/// See [`Image::write`].
pub(in super::super) fn write(image: &Image, path: &Path, options: &WriteOptions) -> Result<(), ImageError> {
    image.check()?;
    if image.colour.is_empty() {
        return Err(ImageError::Encode { path: path.to_owned(), reason: "the image has no pixels".to_owned() });
    }
    let mut channels = colour_channels("", image.colour.view());
    let layers = image.layers.iter().flat_map(|(name, layer)| match layer {
        Layer::Luminance(samples) => vec![Channel { name: format!("{name}.Y"), samples: samples.view() }],
        Layer::Colour(samples) => colour_channels(&format!("{name}."), samples.view()),
    });
    let mut attributes = attributes(image);
    if options.split && !image.layers.is_empty() {
        let beside = layers_path(path);
        write_file(&beside, layers.collect(), attributes.clone(), options)?;
        let name = beside.file_name().unwrap_or_default();
        attributes.push((LAYERS_FILE, text(name.as_encoded_bytes())));
    } else {
        channels.extend(layers);
    }
    write_file(path, channels, attributes, options)
}

fn colour_channels<'a>(prefix: &str, colour: ArrayView3<'a, f32>) -> Vec<Channel<'a>> {
    let channel = |(index, letter)| Channel {
        name: format!("{prefix}{letter}"),
        samples: colour.index_axis_move(Axis(2), index),
    };
    ["R", "G", "B"].iter().enumerate().map(channel).collect()
}

/// The manifest as JSON, and pbrt's names for what it also knows.
fn attributes(image: &Image) -> Attributes {
    let manifest = Value::Object(image.manifest.clone()).to_string();
    let mut attributes = vec![(MANIFEST, text(manifest.as_bytes()))];
    let number = |key: &str| image.manifest.get(key);
    if let Some(seconds) = number(RENDER_TIME.key).and_then(Value::as_f64) {
        attributes.push((RENDER_TIME.attribute, AttributeValue::F32(seconds as f32)));
    }
    let samples = number(SAMPLES.key).and_then(|n| {
        let whole = n.as_i64().and_then(|n| i32::try_from(n).ok());
        let value = n.as_f64()? as f32;
        Some(whole.map_or(AttributeValue::F32(value), AttributeValue::I32))
    });
    attributes.extend(samples.map(|value| (SAMPLES.attribute, value)));
    attributes
}

/// OpenEXR's strings are bytes of any encoding; here they are UTF-8.
fn text(bytes: &[u8]) -> AttributeValue {
    AttributeValue::Text(Text::from_slice_unchecked(bytes))
}

fn write_file(
    path: &Path,
    mut channels: Vec<Channel<'_>>,
    attributes: Attributes,
    options: &WriteOptions,
) -> Result<(), ImageError> {
    // The format asks for channels in the order of their names.
    channels.sort_by(|a, b| a.name.cmp(&b.name));
    let header = header(&channels, attributes, options.precision);
    write_whole(path, |file| {
        let buffered = BufWriter::with_capacity(1 << 20, file);
        block::write(buffered, [header].into_iter().collect(), true, |meta, writer| {
            write_blocks(&meta, writer, &channels)
        })
        .map_err(|error| match error {
            ::exr::error::Error::Io(source) => ImageError::Io { path: path.to_owned(), action: "write", source },
            other => ImageError::Encode { path: path.to_owned(), reason: other.to_string() },
        })
    })
}

fn header(channels: &[Channel<'_>], attributes: Attributes, precision: Precision) -> Header {
    let sample_type = match precision {
        Precision::Float => SampleType::F32,
        Precision::Half => SampleType::F16,
    };
    let describe = |channel: &Channel<'_>| ChannelDescription {
        name: Text::from_slice_unchecked(channel.name.as_bytes()),
        sample_type,
        quantize_linearly: false,
        sampling: ::exr::math::Vec2(1, 1),
    };
    let (height, width) = channels.first().map_or((0, 0), |c| c.samples.dim());
    let list = channels.iter().map(describe).collect();
    let mut header = Header::new(Text::default(), (width, height), list).with_encoding(
        Compression::ZIP16,
        BlockDescription::ScanLines,
        LineOrder::Increasing,
    );
    header.own_attributes.layer_name = None; // a part's name belongs to files of several parts
    header.own_attributes.software_name = Some(Text::from("pathblend"));
    header.own_attributes.other = attributes.into_iter().map(|(name, value)| (Text::from(name), value)).collect();
    header
}

/// Compresses blocks in parallel in the caller's thread pool and writes them in order.
fn write_blocks(meta: &MetaData, writer: &mut impl ChunksWriter, channels: &[Channel<'_>]) -> UnitResult {
    let blocks: Vec<(usize, BlockIndex)> = meta.enumerate_ordered_header_block_indices().collect();
    for batch in blocks.chunks(BLOCKS_AT_ONCE) {
        let compress = |&(index, block): &(usize, BlockIndex)| {
            let list = &meta.headers[block.layer].channels;
            let fill = |line: LineRefMut<'_>| fill(line, channels);
            let samples = UncompressedBlock::collect_block_data_from_lines(list, block, fill);
            (index, chunk(block, zip::compress(samples)))
        };
        let chunks: Vec<(usize, Chunk)> = batch.par_iter().map(compress).collect();
        for (index, chunk) in chunks {
            writer.write_chunk(index, chunk)?;
        }
    }
    Ok(())
}

fn chunk(block: BlockIndex, compressed_pixels_le: Vec<u8>) -> Chunk {
    Chunk {
        layer_index: block.layer,
        compressed_block: CompressedBlock::ScanLine(CompressedScanLineBlock {
            // The file's window starts at zero and its height is an `i32`.
            y_coordinate: block.pixel_position.y() as i32,
            compressed_pixels_le,
        }),
    }
}

/// Copies one line of one channel into a block, as little-endian samples. Lines are whole rows, because the
/// file is in scan lines.
fn fill(line: LineRefMut<'_>, channels: &[Channel<'_>]) {
    let row = channels[line.location.channel].samples;
    let row = row.row(line.location.position.y());
    if line.value.len() == 4 * row.len() {
        for (bytes, sample) in line.value.chunks_exact_mut(4).zip(row) {
            bytes.copy_from_slice(&sample.to_le_bytes());
        }
    } else {
        for (bytes, &sample) in line.value.chunks_exact_mut(2).zip(row) {
            bytes.copy_from_slice(&to_half(sample).to_le_bytes());
        }
    }
}

/// Rounds to the nearest half; a finite value stays finite.
fn to_half(sample: f32) -> f16 {
    if sample.is_finite() {
        f16::from_f32(sample.clamp(f16::MIN.to_f32(), f16::MAX.to_f32()))
    } else {
        f16::from_f32(sample)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;

    #[test]
    fn halves_keep_the_bright_finite_and_the_infinite_infinite() {
        assert_eq!(to_half(1e9), f16::MAX);
        assert_eq!(to_half(-1e9), f16::MIN);
        assert_eq!(to_half(f32::INFINITY), f16::INFINITY);
        assert!(to_half(f32::NAN).is_nan());
        assert_eq!(to_half(0.1), f16::from_f32(0.1));
    }
}
