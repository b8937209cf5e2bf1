//! Images on the texture plane, with the conventions of Mitsuba 3: the unit square shows the image once, its first row
//! at v = 0, and the centre of the first pixel lies half a pixel from the origin.

use super::Picture;
use crate::spectrum::Spectrum;
use glam::{DAffine2, DVec2};
use std::sync::Arc;

/// What is seen between the centres of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Lookup {
    /// The four pixels around, by their distance along the two axes.
    #[default]
    Bilinear,
    /// The closest pixel.
    Nearest,
}

/// What is seen outside of the unit square.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Wrap {
    /// The image again.
    #[default]
    Repeat,
    /// The image again, every second time mirrored.
    Mirror,
    /// The pixels at the border.
    Clamp,
}

impl Wrap {
    /// The pixel out of `count` that is seen in the place of pixel `index`, which is far outside where it saturates.
    fn apply(self, index: i32, count: i32) -> usize {
        let inside = match self {
            Self::Repeat => index.rem_euclid(count),
            Self::Clamp => index.clamp(0, count - 1),
            Self::Mirror => {
                let place = i64::from(index).rem_euclid(2 * i64::from(count));
                place.min(2 * i64::from(count) - 1 - place) as i32
            }
        };
        inside as usize
    }
}

/// An image as a texture.
#[derive(Clone, Debug, PartialEq)]
pub struct Bitmap {
    /// The pixels.
    pub picture: Arc<Picture>,
    /// Whether samples in the sRGB curve are taken as they are.
    pub raw: bool,
    /// Between the pixels.
    pub lookup: Lookup,
    /// Outside of the image.
    pub wrap: Wrap,
    /// From texture coordinates to the plane of the image.
    pub to_uv: DAffine2,
}

impl Bitmap {
    #[inline]
    pub(super) fn colour(&self, uv: DVec2) -> Spectrum {
        let [width, height] = self.picture.size().map(|pixels| pixels as i32);
        let place = self.to_uv.transform_point2(uv) * DVec2::new(f64::from(width), f64::from(height));
        let column = |x| self.wrap.apply(x, width);
        let row = |y| self.wrap.apply(y, height);
        if self.lookup == Lookup::Nearest {
            return self.picture.pixel(column(place.x.floor() as i32), row(place.y.floor() as i32), self.raw);
        }
        let low = (place - 0.5).floor();
        let (x, y) = (low.x as i32, low.y as i32);
        let within = x >= 0 && y >= 0 && x < width - 1 && y < height - 1;
        let (columns, rows) = match within {
            true => ([x as usize, x as usize + 1], [y as usize, y as usize + 1]),
            false => ([x, x.saturating_add(1)].map(column), [y, y.saturating_add(1)].map(row)),
        };
        self.picture.between(columns, rows, place - 0.5 - low, self.raw)
    }

    pub(super) fn mean(&self) -> Spectrum {
        self.picture.mean(self.raw)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::texture::Texels;

    fn bitmap() -> Bitmap {
        let bytes = vec![10, 200, 30, 250, 128, 5, 90, 60, 220, 0, 255, 127, 40, 41, 42, 200, 100, 50];
        Bitmap {
            picture: Arc::new(Picture::new([3, 2], Texels::Bytes(bytes)).unwrap()),
            raw: false,
            lookup: Lookup::Bilinear,
            wrap: Wrap::Repeat,
            to_uv: DAffine2::IDENTITY,
        }
    }

    fn assert_at(bitmap: &Bitmap, uv: [f64; 2], expected: [f64; 3]) {
        let found = bitmap.colour(uv.into()).to_rgb();
        let close = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 3e-6);
        assert!(close, "{bitmap:?} {uv:?}: {found:?}, expected {expected:?}");
    }

    /// Values of Mitsuba 3.9.1 (scalar_rgb) for the same image.
    #[test]
    fn lookups_agree_with_mitsuba() {
        let plain = bitmap();
        assert_at(&plain, [1.0 / 6.0, 0.25], [0.003035, 0.577581, 0.012983]);
        assert_at(&plain, [0.1, 0.1], [0.050668, 0.577418, 0.160317]);
        assert_at(&plain, [0.37, 0.61], [0.172931, 0.390480, 0.071440]);
        assert_at(&plain, [-1.45, 1.2], [0.755590, 0.175030, 0.100226]);
        let raw = Bitmap { raw: true, ..bitmap() };
        assert_at(&raw, [1.3, -0.2], [0.098039, 0.665020, 0.336078]);
        assert_at(&raw, [-0.4, 2.7], [0.389804, 0.249373, 0.183961]);
        let nearest = Bitmap { lookup: Lookup::Nearest, ..bitmap() };
        assert_at(&nearest, [0.9, 0.95], [0.577581, 0.127438, 0.031896]);
        assert_at(&nearest, [1.3, -0.2], [0.0, 1.0, 0.212231]);
        let mirror = Bitmap { wrap: Wrap::Mirror, ..bitmap() };
        assert_at(&mirror, [1.3, -0.2], [0.443734, 0.113456, 0.430023]);
        assert_at(&mirror, [-1.45, 1.2], [0.104673, 0.037963, 0.024465]);
        let clamp = Bitmap { wrap: Wrap::Clamp, ..bitmap() };
        assert_at(&clamp, [1.3, -0.2], [0.102242, 0.045186, 0.715694]);
        assert_at(&clamp, [-0.4, 2.7], [0.0, 1.0, 0.212231]);
        let to_uv = DAffine2::from_scale_angle_translation([2.0, 3.0].into(), 0.0, [0.2, 0.3].into());
        let placed = Bitmap { to_uv, ..bitmap() };
        assert_at(&placed, [0.37, 0.61], [0.147838, 0.261418, 0.394533]);
    }

    /// The values are those of Mitsuba 3.9.1.
    #[test]
    fn sixteen_bits_are_decoded_and_one_channel_is_grey() {
        let texels = Texels::Shorts(vec![1000, 20000, 30, 65535, 32768, 5]);
        let deep = Bitmap { picture: Arc::new(Picture::new([3, 2], texels).unwrap()), ..bitmap() };
        // Mitsuba stores halves.
        let found = deep.colour(DVec2::new(0.37, 0.61)).to_rgb();
        assert!(found.iter().all(|channel| (channel - 0.387861).abs() < 1e-4), "{found:?}");
        assert!((deep.mean().luminance() - 0.215169).abs() < 1e-4);
    }

    #[test]
    fn far_away_is_not_out_of_bounds() {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for far in [1e300, -1e300, f64::INFINITY, f64::NAN] {
                Bitmap { wrap, ..bitmap() }.colour(DVec2::new(far, -far));
            }
        }
        assert!(Picture::new([2, 2], Texels::Bytes(vec![0; 8])).is_none());
        assert!(Picture::new([0, 2], Texels::Bytes(vec![])).is_none());
    }

    #[test]
    fn linear_samples_take_half_the_room_where_nothing_is_lost() {
        assert!(matches!(Texels::linear(vec![0.5, 3.0, 0.0]), Texels::Halves(_)));
        assert!(matches!(Texels::linear(vec![0.1, 1e6, 0.0]), Texels::Floats(_)));
    }
}
