//! The image in memory: colour, named layers, manifest.

use std::collections::BTreeMap;
use std::path::Path;

use ndarray::{Array2, Array3, Axis};
use serde_json::{Map, Value};

use super::{ImageError, WriteOptions, exr};

/// Manifest key under which an image names its integrator.
pub const INTEGRATOR_KEY: &str = "integrator";
/// Manifest key under which an image gives the length of its longest paths, in edges.
pub const DEPTH_KEY: &str = "max_depth";
/// Manifest key under which an image names its scene's fingerprint.
pub const SCENE_KEY: &str = "scene_hash";

/// Luminance of linear Rec.709 red, green and blue (ITU-R BT.709-6, item 3.2).
pub const LUMINANCE_WEIGHTS: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Luminance of a linear Rec.709 colour, in the unit of its channels.
pub fn luminance(rgb: [f32; 3]) -> f32 {
    rgb.iter().zip(LUMINANCE_WEIGHTS).map(|(c, w)| c * w).sum()
}

/// A picture with feature layers of the same size.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Height × width × 3, linear Rec.709; any float, negative and non-finite values included.
    pub colour: Array3<f32>,
    /// Further quantities per pixel, by name; see [`check_layer_name`].
    pub layers: BTreeMap<String, Layer>,
    /// How the image came about: scene, integrator, seed, time, counters. Kept word for word in the file.
    pub manifest: Map<String, Value>,
}

/// One named quantity per pixel.
#[derive(Debug, Clone, PartialEq)]
pub enum Layer {
    /// Height × width: one number, stored as the channel `Y`.
    Luminance(Array2<f32>),
    /// Height × width × 3: linear Rec.709, stored as `R`, `G`, `B`.
    Colour(Array3<f32>),
}

impl Layer {
    /// The shape of the samples: `[height, width]` or `[height, width, 3]`.
    pub fn shape(&self) -> &[usize] {
        match self {
            Self::Luminance(samples) => samples.shape(),
            Self::Colour(samples) => samples.shape(),
        }
    }
}

impl Image {
    /// A black image of `width` × `height` pixels without layers.
    pub fn new(width: usize, height: usize) -> Self {
        Self { colour: Array3::zeros((height, width, 3)), layers: BTreeMap::new(), manifest: Map::new() }
    }

    /// Pixels per row.
    pub fn width(&self) -> usize {
        self.colour.dim().1
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.colour.dim().0
    }

    /// Adds a layer, or replaces the one of that name.
    ///
    /// # Errors
    /// [`ImageError::LayerName`] and [`ImageError::LayerShape`].
    pub fn insert(&mut self, name: impl Into<String>, layer: Layer) -> Result<(), ImageError> {
        let name = name.into();
        self.check_layer(&name, &layer)?;
        self.layers.insert(name, layer);
        Ok(())
    }

    /// Reads an OpenEXR file: by pathblend with all layers and the manifest, or by any other renderer.
    ///
    /// Half, float and unsigned samples become `f32`. The colour is the first part with top-level channels
    /// `R`, `G`, `B`, else a layer named like the picture (`combined`, `beauty`, …), else a lone `Y` as grey.
    /// Every other group of `R`, `G`, `B` or `Y` becomes a layer, under a name made proper where it must be;
    /// alpha and other channels are left out, and so are parts of another size. Colours are taken for linear
    /// Rec.709, whatever the file says about its primaries.
    ///
    /// # Errors
    /// A file that is missing, not OpenEXR, damaged, unsupported or without colour: see [`ImageError`].
    pub fn read(path: &Path) -> Result<Self, ImageError> {
        exr::read(path)
    }

    /// Writes a multi-layer OpenEXR file, whole or not at all.
    ///
    /// # Errors
    /// A layer with a bad name or shape, an image without pixels, or a path that cannot be written.
    pub fn write(&self, path: &Path, options: &WriteOptions) -> Result<(), ImageError> {
        exr::write(self, path, options)
    }

    /// The luminance of the path classes that have `classes` in their name, where letters that repeat count once, as a grey
    /// picture: `SDS` is in `LSDSE` and in `LSSDDSE`. The image as it is, if nothing is said.
    pub fn of_classes(self, classes: Option<&str>) -> Self {
        let Some(classes) = classes else { return self };
        let mut colour = Array3::zeros(self.colour.dim());
        for (name, layer) in &self.layers {
            if let (Some(class), Layer::Luminance(light)) = (name.strip_prefix("path_"), layer)
                && once_each(class).contains(classes)
            {
                colour += &light.view().insert_axis(Axis(2));
            }
        }
        Self { colour, ..self }
    }

    /// Checks what the types cannot: three channels, and layers with proper names and this image's size.
    pub(super) fn check(&self) -> Result<(), ImageError> {
        let (height, width, _) = self.colour.dim();
        check_shape("colour", self.colour.shape(), &[height, width, 3])?;
        self.layers.iter().try_for_each(|(name, layer)| self.check_layer(name, layer))
    }

    fn check_layer(&self, name: &str, layer: &Layer) -> Result<(), ImageError> {
        check_layer_name(name)?;
        let expected = [self.height(), self.width(), 3];
        let rank = match layer {
            Layer::Luminance(_) => 2,
            Layer::Colour(_) => 3,
        };
        check_shape(name, layer.shape(), &expected[..rank])
    }
}

/// Checks a layer's name: a letter, then letters, digits and underscores, all ASCII, because tools for
/// OpenEXR split names at dots and strip other characters, each in its own way.
///
/// # Errors
/// [`ImageError::LayerName`].
pub fn check_layer_name(name: &str) -> Result<(), ImageError> {
    let starts_well = name.starts_with(|c: char| c.is_ascii_alphabetic());
    if starts_well && name.chars().all(is_name_char) {
        return Ok(());
    }
    Err(ImageError::LayerName { name: name.to_owned() })
}

/// Whether a layer's name may hold this character after its first letter.
pub(super) fn is_name_char(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

/// Whether the name of a path class can have this in it.
pub fn is_in_classes(text: &str) -> bool {
    !text.is_empty() && text.chars().all(|letter| "LDSE".contains(letter))
}

/// A name in which no letter follows itself.
fn once_each(name: &str) -> String {
    let mut letters: Vec<char> = name.chars().collect();
    letters.dedup();
    letters.into_iter().collect()
}

fn check_shape(layer: &str, found: &[usize], expected: &[usize]) -> Result<(), ImageError> {
    if found == expected {
        return Ok(());
    }
    Err(ImageError::LayerShape { layer: layer.to_owned(), found: found.to_vec(), expected: expected.to_vec() })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;

    #[test]
    fn white_has_unit_luminance_and_green_is_brightest() {
        assert!((luminance([1.0; 3]) - 1.0).abs() < 1e-6);
        assert!(luminance([0.0, 1.0, 0.0]) > luminance([1.0, 0.0, 1.0]));
    }

    #[test]
    fn layer_names_are_identifiers() {
        for good in ["a", "path_LDSE", "Z9_"] {
            check_layer_name(good).unwrap();
        }
        for bad in ["", "_a", "9a", "a.b", "a b", "ä", "C<L.>", "a\0"] {
            assert!(check_layer_name(bad).is_err(), "{bad:?} passed");
        }
    }

    #[test]
    fn classes_are_found_by_what_is_in_them() {
        let mut image = Image::new(3, 2);
        for (name, light) in [("path_LSDSE", 1.0), ("path_LSSDDSE", 2.0), ("path_LDSE", 4.0), ("albedo", 8.0)] {
            image.insert(name, Layer::Luminance(Array2::from_elem((2, 3), light))).unwrap();
        }
        let colour = |classes| image.clone().of_classes(Some(classes)).colour;
        assert_eq!(colour("SDS"), Array3::from_elem((2, 3, 3), 3.0));
        assert_eq!(colour("DSE"), Array3::from_elem((2, 3, 3), 7.0));
        assert_eq!(colour("SE"), colour("DSE"));
        assert_eq!(colour("LE"), Image::new(3, 2).colour);
    }

    #[test]
    fn a_layer_must_fit_its_image() {
        let mut image = Image::new(3, 2);
        let layer = |h, w| Layer::Luminance(Array2::zeros((h, w)));
        image.insert("fits", layer(2, 3)).unwrap();
        let error = image.insert("turned", layer(3, 2)).unwrap_err().to_string();
        assert!(error.contains("turned") && error.contains("[3, 2]") && error.contains("[2, 3]"));
        let flat = Layer::Colour(Array3::zeros((2, 3, 1)));
        assert!(image.insert("flat", flat).is_err());
        assert_eq!(image.layers.len(), 1);
    }
}
