//! Where textures are looked up.

use super::Texture;
use crate::spectrum::Spectrum;
use glam::DVec2;
use std::ptr;

/// A place on the texture plane. It may know the colour of one texture there: a model asks for the same colour each time
/// that it is evaluated, and pixels that are not in the cache are best fetched while there is other work to do.
#[derive(Clone, Copy, Debug, Default)]
pub struct Site {
    /// Texture coordinates, or a place in the chart of a mesh.
    pub uv: DVec2,
    /// Address of the texture whose colour is known; 0 for none.
    known: usize,
    colour: Spectrum,
}

impl Site {
    /// The place `uv`, with the colour of `texture` there.
    #[inline]
    pub fn new(uv: DVec2, texture: Option<&Texture>) -> Self {
        match texture {
            Some(texture) => Self { uv, known: ptr::from_ref(texture).addr(), colour: texture.colour(uv) },
            None => uv.into(),
        }
    }

    /// The colour of `texture` here.
    #[inline]
    pub(super) fn colour(&self, texture: &Texture) -> Spectrum {
        if ptr::from_ref(texture).addr() == self.known { self.colour } else { texture.colour(self.uv) }
    }
}

impl From<DVec2> for Site {
    #[inline]
    fn from(uv: DVec2) -> Self {
        Self { uv, known: 0, colour: Spectrum::BLACK }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::Checkerboard;
    use glam::DAffine2;

    #[test]
    fn every_texture_has_its_own_colour() {
        let board = |v| {
            let colours = [Spectrum::grey(v), Spectrum::grey(2.0 * v)];
            Texture::Checkerboard(Checkerboard { colours, to_uv: DAffine2::IDENTITY })
        };
        let [one, other] = [board(1.0), board(3.0)];
        for uv in [DVec2::new(0.1, 0.2), DVec2::new(0.1, 0.7)] {
            let site = Site::new(uv, Some(&one));
            for texture in [&one, &other] {
                assert_eq!(site.colour(texture), texture.colour(uv));
                assert_eq!(Site::from(uv).colour(texture), texture.colour(uv));
            }
        }
    }
}
