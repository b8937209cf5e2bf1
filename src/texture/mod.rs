//! Quantities that vary over a surface, by its texture coordinates.

mod checkerboard;

pub use checkerboard::Checkerboard;

use crate::spectrum::Spectrum;
use glam::DVec2;
use std::sync::Arc;

/// A colour per point of the texture plane.
#[derive(Clone, Debug, PartialEq)]
pub enum Texture {
    /// Squares of two colours.
    Checkerboard(Checkerboard),
}

impl Texture {
    /// The colour at `uv`, linear Rec.709.
    #[inline]
    pub fn colour(&self, uv: DVec2) -> Spectrum {
        match self {
            Self::Checkerboard(checkerboard) => checkerboard.colour(uv),
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
    /// The colour at `uv`.
    #[inline]
    pub fn at(&self, uv: DVec2) -> Spectrum {
        match self {
            Self::Constant(colour) => *colour,
            Self::Textured(texture) => texture.colour(uv),
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
pub enum Relief {
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
    /// The number at `uv`.
    #[inline]
    pub fn at(&self, uv: DVec2) -> f64 {
        match self {
            Self::Constant(number) => *number,
            Self::Textured(texture) => texture.colour(uv).luminance(),
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
