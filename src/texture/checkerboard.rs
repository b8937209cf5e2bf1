//! Squares of two colours.

use crate::spectrum::Spectrum;
use glam::{DAffine2, DVec2};

/// Two by two squares per unit of the transformed texture plane, as in Mitsuba.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Checkerboard {
    /// The colours; the square at the origin has the first.
    pub colours: [Spectrum; 2],
    /// From texture coordinates to the plane of the squares.
    pub to_uv: DAffine2,
}

impl Checkerboard {
    #[inline]
    pub(super) fn colour(&self, uv: DVec2) -> Spectrum {
        let at = self.to_uv.transform_point2(uv);
        let low = |v: f64| v - v.floor() < 0.5;
        self.colours[usize::from(low(at.x) != low(at.y))]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As measured in Mitsuba 3.9.1.
    #[test]
    fn the_first_colour_is_at_the_origin() {
        let colours = [Spectrum::grey(0.1), Spectrum::grey(0.9)];
        let board = Checkerboard { colours, to_uv: DAffine2::IDENTITY };
        for (u, v, expected) in [(0.1, 0.1, 0), (0.6, 0.1, 1), (0.1, 0.6, 1), (-0.1, 0.1, 1), (0.6, 0.7, 0)] {
            assert_eq!(board.colour(DVec2::new(u, v)), colours[expected]);
        }
    }
}
