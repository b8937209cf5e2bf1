//! Pictures to look at: PNG files of 8-bit sRGB.

use std::io::BufWriter;
use std::path::Path;

use ndarray::{ArrayView2, ArrayView3};

use super::{ImageError, diverging, srgb, whole::write_whole};

/// Writes a height × width × 3 array of linear Rec.709 as an sRGB PNG, whole or not at all, after an
/// exposure in EV (each step doubles the values). Values beyond white clip; NaN becomes black.
///
/// # Errors
/// [`ImageError::LayerShape`] without three channels, and whatever keeps the file from being written.
pub fn write_png(path: &Path, colour: ArrayView3<'_, f32>, exposure_ev: f32) -> Result<(), ImageError> {
    let (height, width, channels) = colour.dim();
    if channels != 3 {
        return Err(ImageError::LayerShape {
            layer: "colour".to_owned(),
            found: colour.shape().to_vec(),
            expected: vec![height, width, 3],
        });
    }
    write_bytes(path, (width, height), &srgb::to_srgb8(colour, exposure_ev))
}

/// Writes a height × width array of values in [0, 1] in false colour, whole or not at all: see [`diverging`].
///
/// # Errors
/// Whatever keeps the file from being written.
pub fn write_false_colour(path: &Path, field: ArrayView2<'_, f32>) -> Result<(), ImageError> {
    let (height, width) = field.dim();
    let bytes: Vec<u8> = field.iter().flat_map(|&value| diverging(value)).collect();
    write_bytes(path, (width, height), &bytes)
}

fn write_bytes(path: &Path, size: (usize, usize), bytes: &[u8]) -> Result<(), ImageError> {
    let refused = |reason: String| ImageError::Encode { path: path.to_owned(), reason };
    let side =
        |length: usize| u32::try_from(length).map_err(|_| refused(format!("{length} pixels are too many for PNG")));
    let (width, height) = (side(size.0)?, side(size.1)?);
    write_whole(path, |file| {
        let mut encoder = png::Encoder::new(BufWriter::new(file), width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
        let written = encoder.write_header().and_then(|mut writer| {
            writer.write_image_data(bytes)?;
            writer.finish()
        });
        written.map_err(|error| refused(error.to_string()))
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;
    use ndarray::{Array3, arr2};
    use std::fs::File;
    use std::io::BufReader;

    fn decode(path: &Path) -> (u32, u32, Vec<u8>) {
        let decoder = png::Decoder::new(BufReader::new(File::open(path).unwrap()));
        let mut reader = decoder.read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        assert_eq!(info.color_type, png::ColorType::Rgb);
        (info.width, info.height, bytes)
    }

    #[test]
    fn pixels_keep_their_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let mut colour = Array3::<f32>::zeros((2, 3, 3));
        colour[[1, 0, 2]] = 0.5;
        write_png(&path, colour.view(), 1.0).unwrap();
        let (width, height, bytes) = decode(&path);
        assert_eq!((width, height), (3, 2));
        let lit: Vec<usize> = (0..bytes.len()).filter(|&i| bytes[i] > 0).collect();
        assert_eq!((lit, bytes[11]), (vec![11], 255));
    }

    #[test]
    fn false_colour_keeps_the_shape() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("w.png");
        write_false_colour(&path, arr2(&[[0.0, 1.0]]).view()).unwrap();
        let (width, height, bytes) = decode(&path);
        assert_eq!((width, height), (2, 1));
        assert!(bytes[2] > bytes[0] && bytes[3] > bytes[5], "blue, then orange");
    }

    #[test]
    fn an_empty_picture_is_an_error_and_leaves_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        assert!(write_png(&path, Array3::zeros((0, 0, 3)).view(), 0.0).is_err());
        assert!(write_png(&path, Array3::zeros((1, 1, 2)).view(), 0.0).is_err());
        assert!(!path.exists());
    }
}
