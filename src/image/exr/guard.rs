//! Keeps damaged files from ending the process: what to refuse before the decoder sees it.

use std::panic::{AssertUnwindSafe, catch_unwind};

use ::exr::block::chunk::{Chunk, CompressedBlock};
use ::exr::error::{Error, Result as ExrResult};
use ::exr::meta::MetaData;
use ::exr::meta::header::Header;
use ::exr::prelude::Compression;

/// How many numbers the head of a DWA block has, and by how much they may exceed twice the pixels' bytes: DCT
/// blocks at the edge are padded to 8×8.
const DWA_NUMBERS: usize = 11;
const DWA_SLACK: u64 = 1 << 16;
/// A block costs at least this many bytes: its place in the offset table, a coordinate and a size.
const LEAST_BYTES_PER_BLOCK: u128 = 16;

/// Runs a decoder on bytes that may be anything; `None` if it panics.
///
/// The `exr` crate (1.74) answers some damaged files with a panic: of 100 000 files with a few bytes changed, 19
/// made its B44 decoder subtract with overflow (where such checks are compiled in, as in tests). Foreseeing every
/// case would mean to write the decoders again. Nothing outlives the unwinding, because the closure only borrows
/// the bytes. What would abort instead of unwinding, an impossible allocation, is ruled out by [`check_promise`]
/// and [`check_block`].
pub(super) fn guarded<T>(decode: impl FnOnce() -> T) -> Option<T> {
    catch_unwind(AssertUnwindSafe(decode)).ok()
}

/// Refuses a header that promises more pixels or blocks than the file's bytes can hold: believing it would
/// mean to ask for terabytes of memory, which ends the process.
pub(super) fn check_promise(header: &Header, file_bytes: usize) -> Result<(), String> {
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

/// Refuses a DWA block whose head asks for more memory than its pixels take. The head is eleven numbers of
/// eight bytes, sizes and counts all but two small ones (OpenEXR, `internal_dwa_compressor.h`), and the `exr`
/// crate (1.74) allocates what they say before it looks further.
pub(super) fn check_block(chunk: &Chunk, meta: &MetaData) -> ExrResult<()> {
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

pub(super) fn invalid(reason: String) -> Error {
    Error::Invalid(reason.into())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;
    use ::exr::meta::BlockDescription;
    use ::exr::meta::attribute::{ChannelDescription, LineOrder, SampleType, Text};

    fn header(size: (usize, usize), compression: Compression) -> Header {
        let channels = [ChannelDescription::named("Y", SampleType::F32)];
        let header = Header::new(Text::default(), size, channels.into_iter().collect());
        header.with_encoding(compression, BlockDescription::ScanLines, LineOrder::Increasing)
    }

    #[test]
    fn a_file_cannot_hold_more_than_its_compression_allows() {
        let raw = header((100, 100), Compression::Uncompressed);
        assert!(check_promise(&raw, 40_000).is_ok());
        assert!(check_promise(&raw, 39_999).is_err());
        let zip = header((100, 100), Compression::ZIP16);
        assert!(check_promise(&zip, 200).is_ok());
        let huge = header((1 << 30, 1 << 30), Compression::ZIP16);
        let reason = check_promise(&huge, 1 << 20).unwrap_err();
        assert!(reason.contains("1073741824x1073741824"), "{reason}");
        assert!(check_promise(&header((0, 3), Compression::ZIP16), 999).is_err());
    }

    #[test]
    fn a_panic_becomes_no_result() {
        assert_eq!(guarded(|| 3), Some(3));
        assert_eq!(guarded(|| [1, 2][std::hint::black_box(2)]), None);
    }
}
