//! Files that were packed by gzip (RFC 1952), as pbrt reads them.

use miniz_oxide::inflate::decompress_to_vec_with_limit;

/// Most bytes that a file may unpack to.
const MOST: usize = 1 << 32;

/// Bytes of the header that is always there, and of the end.
const HEADER: usize = 10;
const END: usize = 8;

/// The bytes, unpacked if they are packed.
pub(super) fn unpack(bytes: Vec<u8>) -> Result<Vec<u8>, String> {
    if !bytes.starts_with(&[0x1f, 0x8b, 8]) {
        return Ok(bytes);
    }
    let start =
        body(&bytes).filter(|start| start + END <= bytes.len()).ok_or("it is a gzip file that ends too early")?;
    let (packed, end) = bytes[start..].split_at(bytes.len() - start - END);
    let unpacked =
        decompress_to_vec_with_limit(packed, MOST).map_err(|error| format!("it is a damaged gzip file: {error}"))?;
    // The last four bytes are the length.
    if end[4..] != (unpacked.len() as u32).to_le_bytes() {
        return Err("it is a damaged gzip file: its length is another".to_owned());
    }
    Ok(unpacked)
}

/// Where the packed bytes start: behind the optional parts of the header that its flags announce.
fn body(bytes: &[u8]) -> Option<usize> {
    let flags = bytes.get(3)?;
    let mut at = HEADER;
    if flags & 4 != 0 {
        at += 2 + usize::from(u16::from_le_bytes([*bytes.get(at)?, *bytes.get(at + 1)?]));
    }
    for text in [8, 16] {
        if flags & text != 0 {
            at += bytes.get(at..)?.iter().position(|byte| *byte == 0)? + 1;
        }
    }
    Some(if flags & 2 != 0 { at + 2 } else { at })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn packed_files_are_unpacked_and_damage_is_seen() {
        let text = b"Shape \"sphere\"".repeat(20);
        let mut packed = vec![0x1f, 0x8b, 8, 8, 0, 0, 0, 0, 0, 3];
        packed.extend(b"name.pbrt\0");
        packed.extend(miniz_oxide::deflate::compress_to_vec(&text, 6));
        packed.extend([0; 4]);
        packed.extend((text.len() as u32).to_le_bytes());
        assert_eq!(unpack(packed.clone()).unwrap(), text);
        assert_eq!(unpack(text.clone()).unwrap(), text);
        for length in 3..packed.len() {
            assert!(unpack(packed[..length].to_vec()).is_err(), "{length}");
        }
    }
}
