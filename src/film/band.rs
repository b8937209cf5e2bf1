//! Some rows of the film.

use super::{Health, Kernel, PathClass, Splat, class::CLASSES};
use crate::spectrum::Spectrum;

/// Sums for the pixels of some rows.
pub struct Band {
    width: usize,
    first_row: usize,
    rows: usize,
    colour: Vec<[f64; 3]>,
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
            classes: if features { vec![None; CLASSES] } else { Vec::new() },
            health: Health::default(),
        }
    }

    /// Coordinates of the pixels of the band, row by row.
    pub fn pixels(&self) -> impl Iterator<Item = [usize; 2]> + use<> {
        let (width, first, end) = (self.width, self.first_row, self.first_row + self.rows);
        (first..end).flat_map(move |y| (0..width).map(move |x| [x, y]))
    }

    /// Adds `value` to the pixel (x, y), which lies in this band. What is not a valid contribution is counted instead.
    #[inline]
    pub fn add(&mut self, [x, y]: [usize; 2], class: PathClass, value: Spectrum) {
        self.add_at((y - self.first_row) * self.width + x, class, value);
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

    pub(super) fn colour(&self, x: usize, y: usize) -> [f64; 3] {
        self.colour[(y - self.first_row) * self.width + x]
    }

    pub(super) fn luminance(&self, class: PathClass, x: usize, y: usize) -> f64 {
        let layer = self.classes.get(class.code()).and_then(Option::as_ref);
        layer.map_or(0.0, |layer| layer[(y - self.first_row) * self.width + x])
    }
}
