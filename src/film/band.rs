//! Some rows of the film.

use super::noise::{Batch, Moments};
use super::{Health, Kernel, PathClass, Splat, class::CLASSES};
use crate::spectrum::Spectrum;
use serde::{Deserialize, Serialize};

/// Sums for the pixels of some rows.
#[derive(Serialize, Deserialize)]
pub struct Band {
    width: usize,
    first_row: usize,
    rows: usize,
    colour: Vec<[f64; 3]>,
    /// What the batches of passes had to say about `colour`.
    moments: Vec<Moments>,
    /// Luminance per class and pixel; classes that have not occurred have no memory. Empty when none are kept.
    classes: Vec<Option<Box<[f64]>>>,
    /// What went wrong in these rows.
    pub health: Health,
}

impl Band {
    pub(super) fn new(width: usize, first_row: usize, rows: usize, features: bool) -> Self {
        Self {
            width,
            first_row,
            rows,
            colour: vec![[0.0; 3]; width * rows],
            moments: vec![Moments::default(); width * rows],
            classes: if features { vec![None; CLASSES] } else { Vec::new() },
            health: Health::default(),
        }
    }

    /// Coordinates of the pixels of the band, row by row.
    pub fn pixels(&self) -> impl Iterator<Item = [usize; 2]> + use<> {
        let (width, first, end) = (self.width, self.first_row, self.first_row + self.rows);
        (first..end).flat_map(move |y| (0..width).map(move |x| [x, y]))
    }

    /// Adds `value` to a pixel, which lies in this band. What is not a valid contribution is counted instead.
    #[inline]
    pub fn add(&mut self, pixel: [usize; 2], class: PathClass, value: Spectrum) {
        self.add_at(self.index(pixel), class, value);
    }

    /// Adds a splat to the pixels of the band that the filter reaches; `size` is that of the film.
    pub(super) fn splat(&mut self, kernel: &Kernel, size: [usize; 2], splat: &Splat) {
        let [r, g, b] = splat.value.map(f64::from);
        let value = Spectrum::rgb(r, g, b);
        let (first, end) = (self.first_row, self.first_row + self.rows);
        kernel.pixels_near(f64::from(splat.film[1]), size[1], |y, weight_y| {
            if (first..end).contains(&y) {
                kernel.pixels_near(f64::from(splat.film[0]), size[0], |x, weight_x| {
                    self.add([x, y], splat.class, value * (weight_x * weight_y));
                });
            }
        });
    }

    #[inline]
    fn add_at(&mut self, index: usize, class: PathClass, value: Spectrum) {
        if !self.health.accepts(value) {
            return;
        }
        let sum = &mut self.colour[index];
        for (channel, v) in sum.iter_mut().zip(value.to_rgb()) {
            *channel += v;
        }
        if let Some(layer) = self.classes.get_mut(class.code()) {
            let size = self.width * self.rows;
            layer.get_or_insert_with(|| vec![0.0; size].into_boxed_slice())[index] += value.luminance();
        }
    }

    pub(super) fn has(&self, class: PathClass) -> bool {
        self.classes.get(class.code()).is_some_and(Option::is_some)
    }

    #[inline]
    fn index(&self, [x, y]: [usize; 2]) -> usize {
        (y - self.first_row) * self.width + x
    }

    pub(super) fn colour(&self, pixel: [usize; 2]) -> [f64; 3] {
        self.colour[self.index(pixel)]
    }

    pub(super) fn luminance(&self, class: PathClass, pixel: [usize; 2]) -> f64 {
        let layer = self.classes.get(class.code()).and_then(Option::as_ref);
        layer.map_or(0.0, |layer| layer[self.index(pixel)])
    }

    /// Takes note of the passes since the last batch.
    pub(super) fn end_batch(&mut self, batch: Batch) {
        self.moments.iter_mut().zip(&self.colour).for_each(|(moments, sum)| moments.add(batch, *sum));
    }

    /// The moments of a pixel, with those of a batch that is not full.
    pub(super) fn moments(&self, pixel: [usize; 2], last: Option<Batch>) -> Moments {
        let index = self.index(pixel);
        let mut moments = self.moments[index];
        if let Some(last) = last {
            moments.add(last, self.colour[index]);
        }
        moments
    }

    /// Whether it has the form of `other`: rows, and whether it keeps classes.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        let form = |band: &Self| (band.width, band.first_row, band.rows, band.classes.len());
        let (pixels, layers) = (self.width * self.rows, self.classes.iter().flatten());
        form(self) == form(other)
            && [self.colour.len(), self.moments.len()] == [pixels; 2]
            && layers.into_iter().all(|layer| layer.len() == pixels)
    }
}
