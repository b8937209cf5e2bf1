//! From the blocks of a file to the samples of each layer.

use std::collections::HashSet;
use std::io::Cursor;

use ::exr::block::UncompressedBlock;
use ::exr::block::chunk::Chunk;
use ::exr::block::lines::LineRef;
use ::exr::block::reader::{ChunksReader, Reader};
use ::exr::error::Result as ExrResult;
use ::exr::meta::MetaData;
use ::exr::meta::attribute::SampleType;
use ::exr::meta::header::Header;
use half::f16;
use ndarray::{Array2, Array3};
use rayon::prelude::*;

use super::super::Layer;
use super::groups::Group;
use super::guard::{check_block, invalid};

/// How many blocks are decompressed before their samples are taken out.
const BLOCKS_AT_ONCE: usize = 32;
/// The samples of one group while they are collected: pixels in rows, `step` numbers each.
pub(super) struct Plane {
    step: usize,
    samples: Vec<f32>,
}

impl Plane {
    /// As a layer of an image of this height and width; `None` if it has another size.
    pub(super) fn into_layer(self, (height, width): (usize, usize)) -> Option<Layer> {
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
pub(super) fn read_planes(reader: Reader<Cursor<&[u8]>>, groups: &[Group], file_bytes: usize) -> ExrResult<Vec<Plane>> {
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
        check_block(&chunk, meta)?;
        UncompressedBlock::decompress_chunk(chunk, meta, false)
    };
    batch.into_par_iter().map(decompress).collect()
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
