//! Quantities that vary over a surface, by its texture coordinates, or by its faces (see [`attribute`]).

pub mod attribute;
mod bitmap;
mod checkerboard;
mod picture;
mod site;

pub use attribute::{Attribute, Draped};
pub use bitmap::{Bitmap, Lookup, Wrap};
pub use checkerboard::Checkerboard;
pub use picture::{Picture, Texels};
pub use site::Site;

use crate::spectrum::Spectrum;
use glam::DVec2;
use std::sync::Arc;

/// A colour per point of the texture plane.
#[derive(Clone, Debug, PartialEq)]
pub enum Texture {
    /// Squares of two colours.
    Checkerboard(Checkerboard),
    /// An image.
    Bitmap(Bitmap),
    /// Values of a mesh.
    Attribute(Attribute),
    /// Another texture on a mesh with values.
    Draped(Draped),
}

impl Texture {
    /// The colour at `uv`, linear Rec.709.
    #[inline]
    pub fn colour(&self, uv: DVec2) -> Spectrum {
        match self {
            Self::Checkerboard(checkerboard) => checkerboard.colour(uv),
            Self::Bitmap(bitmap) => bitmap.colour(uv),
            Self::Attribute(attribute) => attribute.colour(uv),
            Self::Draped(draped) => draped.colour(uv),
        }
    }

    /// The mean colour of the texture plane, for choices that need one number; a clamped bitmap's is the image's.
    pub fn mean(&self) -> Spectrum {
        match self {
            Self::Checkerboard(checkerboard) => (checkerboard.colours[0] + checkerboard.colours[1]) * 0.5,
            Self::Bitmap(bitmap) => bitmap.mean(),
            Self::Attribute(attribute) => attribute.mean(),
            Self::Draped(draped) => draped.texture.mean(),
        }
    }
}

/// A colour that may vary.
#[derive(Clone, Debug, PartialEq)]
pub enum Colour {
    /// The same everywhere.
    Constant(Spectrum),
    /// By texture coordinates.
    Textured(Arc<Texture>),
}

impl Colour {
    /// The colour at `site`.
    #[inline]
    pub fn at(&self, site: &Site) -> Spectrum {
        match self {
            Self::Constant(colour) => *colour,
            Self::Textured(texture) => site.colour(texture),
        }
    }

    /// The mean over the texture plane.
    pub fn mean(&self) -> Spectrum {
        match self {
            Self::Constant(colour) => *colour,
            Self::Textured(texture) => texture.mean(),
        }
    }

    /// The texture that it has, if it varies.
    #[inline]
    pub fn texture(&self) -> Option<&Texture> {
        match self {
            Self::Constant(_) => None,
            Self::Textured(texture) => Some(texture),
        }
    }

    /// Whether it is the same everywhere.
    pub fn is_constant(&self) -> bool {
        matches!(self, Self::Constant(_))
    }
}

impl From<Spectrum> for Colour {
    fn from(colour: Spectrum) -> Self {
        Self::Constant(colour)
    }
}

/// A texture that perturbs the shading frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Relief {
    /// How the texture is read.
    pub map: ReliefMap,
    /// Whether normals that face away from the viewer are mirrored at the surface's own normal.
    pub mirrors: bool,
    /// Whether light fades out towards the horizon where the normal is tilted.
    pub shadows: bool,
}

/// What a texture says of the shading frame.
#[derive(Clone, Debug, PartialEq)]
pub enum ReliefMap {
    /// Heights, the luminance of a texture times `scale`.
    Bump {
        /// The heights.
        texture: Arc<Texture>,
        /// Factor on the heights.
        scale: f64,
    },
    /// Normals in the shading frame, from −1 to 1 as 0 to 1.
    Normal {
        /// The normals.
        texture: Arc<Texture>,
    },
}

/// A number that may vary: the luminance of a texture.
#[derive(Clone, Debug, PartialEq)]
pub enum Number {
    /// The same everywhere.
    Constant(f64),
    /// By texture coordinates.
    Textured(Arc<Texture>),
}

impl Number {
    /// The number at `site`.
    #[inline]
    pub fn at(&self, site: &Site) -> f64 {
        match self {
            Self::Constant(number) => *number,
            Self::Textured(texture) => site.colour(texture).luminance(),
        }
    }

    /// The mean over the texture plane.
    pub fn mean(&self) -> f64 {
        match self {
            Self::Constant(number) => *number,
            Self::Textured(texture) => texture.mean().luminance(),
        }
    }

    /// Whether it is the same everywhere.
    pub fn is_constant(&self) -> bool {
        matches!(self, Self::Constant(_))
    }
}

impl From<f64> for Number {
    fn from(number: f64) -> Self {
        Self::Constant(number)
    }
}
