//! Contributions to pixels that are not known beforehand.

use super::{BAND_ROWS, Kernel, PathClass};
use crate::spectrum::Spectrum;
use glam::DVec2;

/// A contribution to one pixel.
#[derive(Clone, Copy, Debug)]
pub struct Splat {
    /// y × width + x.
    pub pixel: u32,
    /// Its path class.
    pub class: PathClass,
    /// Linear Rec.709.
    pub value: [f32; 3],
}

/// The splats of one job, sorted by the band that they fall into.
pub struct Splats {
    size: [usize; 2],
    bands: Vec<Vec<Splat>>,
}

impl Splats {
    /// No splats, for a film of `size`.
    pub fn new(size: [usize; 2]) -> Self {
        Self { size, bands: vec![Vec::new(); size[1].div_ceil(BAND_ROWS)] }
    }

    /// Adds `value` at the film position `film` to all pixels within reach of the filter. The weights of a position
    /// integrate to one over each pixel, so `value` has the scale of a pixel's mean.
    #[inline]
    pub fn add(&mut self, kernel: &Kernel, film: DVec2, class: PathClass, value: Spectrum) {
        let [width, height] = self.size;
        kernel.pixels_near(film.y, height, |y, weight_y| {
            kernel.pixels_near(film.x, width, |x, weight_x| {
                let value = (value * (weight_x * weight_y)).to_rgb().map(|v| v as f32);
                self.bands[y / BAND_ROWS].push(Splat { pixel: (y * width + x) as u32, class, value });
            });
        });
    }

    pub(super) fn band(&self, index: usize) -> &[Splat] {
        &self.bands[index]
    }
}
