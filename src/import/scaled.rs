//! Images whose values are multiplied: Mitsuba's textures have no factor.

use super::Importer;
use super::source::Spot;
use super::texture::Texture;
use crate::image::{Image, Precision};
use crate::spectrum::Spectrum;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

impl Importer<'_> {
    /// The texture with its factors multiplied into its images, which are written anew; where an image cannot be read,
    /// its factor is left out.
    pub(super) fn baked(&mut self, texture: Texture, spot: &Spot) -> Texture {
        match texture {
            Texture::Image { node, file, source, linear, factor } if factor != Spectrum::ONE => {
                let key = (file.clone(), factor.to_rgb().map(f64::to_bits), linear);
                let known = self.scaled.get(&key).cloned();
                let written = known.map_or_else(
                    || read(&source, linear, factor).and_then(|image| self.out.image(&image, Precision::Half)),
                    Ok,
                );
                let file = match written {
                    Ok(name) => {
                        self.scaled.insert(key, name.clone());
                        name
                    }
                    Err(reason) => {
                        let [r, g, b] = factor.to_rgb();
                        self.report.left_out(spot, format!("the factor {r} {g} {b} on the values of {file}: {reason}"));
                        file
                    }
                };
                Texture::Image { node, file, source, linear, factor: Spectrum::ONE }
            }
            Texture::Checker { sides, to_uv } => {
                let sides = Box::new(sides.map(|side| self.baked(side, spot)));
                Texture::Checker { sides, to_uv }
            }
            other => other,
        }
    }
}

/// The image at `path`, in linear values, times `factor`.
fn read(path: &Path, linear: bool, factor: Spectrum) -> Result<Image, String> {
    let is = |extension: &str| path.extension().is_some_and(|found| found.eq_ignore_ascii_case(extension));
    let mut image = if is("exr") {
        let mut image = Image::read(path).map_err(|error| error.to_string())?;
        image.layers.clear();
        image
    } else if is("png") {
        png(path, linear)?
    } else {
        return Err("only PNG and OpenEXR can be multiplied".to_owned());
    };
    let factor = factor.to_rgb();
    for ((.., channel), value) in image.colour.indexed_iter_mut() {
        *value *= factor[channel] as f32;
    }
    Ok(image)
}

/// Reads a PNG file; its alpha is left aside.
fn png(path: &Path, linear: bool) -> Result<Image, String> {
    let file = File::open(path).map_err(|error| error.to_string())?;
    let mut decoder = png::Decoder::new(BufReader::new(file));
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(|error| error.to_string())?;
    let size = reader.output_buffer_size().ok_or("it is too large")?;
    let mut bytes = vec![0; size];
    let info = reader.next_frame(&mut bytes).map_err(|error| error.to_string())?;
    let (channels, deep) = (info.color_type.samples(), info.bit_depth == png::BitDepth::Sixteen);
    let sample = |index: usize| match deep {
        true => f32::from(u16::from_be_bytes([bytes[2 * index], bytes[2 * index + 1]])) / 65535.0,
        false => f32::from(bytes[index]) / 255.0,
    };
    let mut image = Image::new(info.width as usize, info.height as usize);
    let width = image.width();
    for ((row, column, channel), value) in image.colour.indexed_iter_mut() {
        let channel = if channels < 3 { 0 } else { channel };
        let encoded = sample((row * width + column) * channels + channel);
        *value = if linear { encoded } else { decode(encoded) };
    }
    Ok(image)
}

/// From sRGB to linear values (IEC 61966-2-1).
fn decode(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}
