//! Contributions to pixels that are not known beforehand.

use super::{BAND_ROWS, Kernel, PathClass};
use crate::spectrum::Spectrum;
use glam::DVec2;

/// A contribution at a position on the film.
#[derive(Clone, Copy, Debug)]
pub struct Splat {
    /// Position in pixels.
    pub film: [f32; 2],
    /// Its path class.
    pub class: PathClass,
    /// Linear Rec.709.
    pub value: [f32; 3],
}

/// The splats of one job, sorted by the bands that their filter reaches.
pub struct Splats {
    rows: usize,
    bands: Vec<Vec<Splat>>,
}

impl Splats {
    /// No splats, for a film of `size`.
    pub fn new(size: [usize; 2]) -> Self {
        Self { rows: size[1], bands: vec![Vec::new(); size[1].div_ceil(BAND_ROWS)] }
    }

    /// Adds `value` at the film position `film`. The weights of a position integrate to one over each pixel, so `value`
    /// has the scale of a pixel's mean.
    #[inline]
    pub fn add(&mut self, kernel: &Kernel, film: DVec2, class: PathClass, value: Spectrum) {
        // Rounded before the rows are found: the band that applies the filter must find the same ones.
        let splat = Splat { film: film.as_vec2().to_array(), class, value: value.to_rgb().map(|v| v as f32) };
        let (first, last) = kernel.reach(f64::from(splat.film[1]), self.rows);
        for band in first / BAND_ROWS..=last / BAND_ROWS {
            self.bands[band].push(splat);
        }
    }

    pub(super) fn band(&self, index: usize) -> &[Splat] {
        &self.bands[index]
    }
}
