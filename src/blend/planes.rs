//! The path layers of two images side by side, as plain slices.

use std::borrow::Cow;
use std::collections::BTreeSet;

use ndarray::Array2;

use super::{BlendError, Input};
use crate::image::{Image, Layer, luminance};

/// Beginning of the names of layers that hold one path class each.
pub const PATH_PREFIX: &str = "path_";

/// One path class in both images: luminance per pixel, row by row; absent where an image lacks the layer.
#[derive(Debug)]
pub(super) struct Class<'a> {
    pub name: &'a str,
    pub a: Option<Cow<'a, [f32]>>,
    pub b: Option<Cow<'a, [f32]>>,
}

/// Two images of one size with all their path classes, sorted by name.
#[derive(Debug)]
pub(super) struct Planes<'a> {
    pub classes: Vec<Class<'a>>,
    /// Colours, three numbers per pixel.
    pub a: Cow<'a, [f32]>,
    pub b: Cow<'a, [f32]>,
    pub pixels: usize,
    /// Pixels per row.
    pub width: usize,
}

impl<'a> Planes<'a> {
    /// # Errors
    /// [`BlendError::Size`], [`BlendError::LayerShape`], [`BlendError::NoLayers`].
    pub(super) fn of(a: Input<'a>, b: Input<'a>) -> Result<Self, BlendError> {
        same_size(b, a)?;
        for input in [a, b] {
            if !path_layers(input.image).any(|_| true) {
                return Err(BlendError::NoLayers { name: input.name.to_owned() });
            }
        }
        let names: BTreeSet<&str> = path_layers(a.image).chain(path_layers(b.image)).map(|(n, _)| n).collect();
        let class = |name| Ok(Class { name, a: plane(a, name)?, b: plane(b, name)? });
        Ok(Self {
            classes: names.into_iter().map(class).collect::<Result<_, BlendError>>()?,
            a: colours(a.image),
            b: colours(b.image),
            pixels: a.image.width() * a.image.height(),
            width: a.image.width(),
        })
    }
}

/// Checks that `image` is as large as `other`, and has three channels.
pub(super) fn same_size(image: Input<'_>, other: Input<'_>) -> Result<(), BlendError> {
    for input in [image, other] {
        if input.image.colour.dim().2 != 3 {
            let found = input.image.colour.shape().to_vec();
            let (height, width) = (input.image.height(), input.image.width());
            let layer = "colour".to_owned();
            return Err(BlendError::LayerShape { name: input.name.to_owned(), layer, found, height, width });
        }
    }
    let size = |i: Input<'_>| (i.image.width(), i.image.height());
    let ((found_width, found_height), (width, height)) = (size(image), size(other));
    if (found_width, found_height) == (width, height) {
        return Ok(());
    }
    let (name, other) = (image.name.to_owned(), other.name.to_owned());
    Err(BlendError::Size { name, found_width, found_height, other, width, height })
}

/// The layers that hold one path class each.
pub(super) fn path_layers(image: &Image) -> impl Iterator<Item = (&str, &Layer)> {
    let layers = image.layers.iter().map(|(name, layer)| (name.as_str(), layer));
    layers.filter(|(name, _)| name.starts_with(PATH_PREFIX))
}

/// An image's colours, three numbers per pixel, row by row.
pub(super) fn colours(image: &Image) -> Cow<'_, [f32]> {
    match image.colour.as_slice() {
        Some(slice) => Cow::Borrowed(slice),
        None => Cow::Owned(image.colour.iter().copied().collect()),
    }
}

/// One layer's luminance per pixel.
fn plane<'a>(input: Input<'a>, name: &str) -> Result<Option<Cow<'a, [f32]>>, BlendError> {
    let Some(layer) = input.image.layers.get(name) else { return Ok(None) };
    let (height, width) = (input.image.height(), input.image.width());
    let expected = [height, width, 3];
    let rank = layer.shape().len();
    if layer.shape() != &expected[..rank.min(3)] {
        let (name, layer, found) = (input.name.to_owned(), name.to_owned(), layer.shape().to_vec());
        return Err(BlendError::LayerShape { name, layer, found, height, width });
    }
    Ok(Some(match layer {
        Layer::Luminance(samples) => values(samples),
        Layer::Colour(samples) => {
            let pixels = samples.rows();
            Cow::Owned(pixels.into_iter().map(|p| luminance([p[0], p[1], p[2]])).collect())
        }
    }))
}

fn values(samples: &Array2<f32>) -> Cow<'_, [f32]> {
    match samples.as_slice() {
        Some(slice) => Cow::Borrowed(slice),
        None => Cow::Owned(samples.iter().copied().collect()),
    }
}
