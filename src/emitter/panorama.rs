//! An image of everything around, in degrees of longitude and latitude, with Mitsuba 3's conventions: +y is up, the
//! middle of the image is −z, its first row lies at the pole and its last one at the other, its columns start half a
//! pixel from the seam at +z. Between the pixels colours are bilinear.
//!
//! A direction is chosen by the cell between four pixels, each with the exact integral of its luminance over solid angle,
//! and evenly within the cell.

use crate::math::{Discrete, SolidAnglePdf};
use crate::spectrum::Spectrum;
use crate::texture::Picture;
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// An image of everything around.
#[derive(Clone, Debug, PartialEq)]
pub struct Panorama {
    picture: Arc<Picture>,
    scale: f64,
    /// Choice of a row of cells, and of a cell in each row that is not black.
    rows: Discrete,
    columns: Vec<Option<Discrete>>,
    /// Luminance over the sphere.
    integral: f64,
}

/// A place in a cell: row, column, and shares of both.
struct Place {
    row: usize,
    column: usize,
    down: f64,
    right: f64,
}

impl Panorama {
    /// The picture with its radiance multiplied by `scale`; `None` when it is black or too bright to compute with.
    pub fn new(picture: Arc<Picture>, scale: f64) -> Option<Self> {
        let blank = Discrete::new(&[1.0])?;
        let mut panorama = Self { picture, scale, rows: blank, columns: Vec::new(), integral: 0.0 };
        let cells = |row| {
            let weights = panorama.weights(row);
            (weights.iter().sum::<f64>(), Discrete::new(&weights))
        };
        let (sums, columns): (Vec<_>, _) = (0..panorama.row_count()).into_par_iter().map(cells).unzip();
        (panorama.rows, panorama.columns) = (Discrete::new(&sums)?, columns);
        panorama.integral = sums.iter().sum();
        Some(panorama)
    }

    /// Integrals of the luminance over the cells of a row: the colours of its upper and its lower pixels count by the
    /// integrals of their bilinear weight times the sine.
    fn weights(&self, row: usize) -> Vec<f64> {
        let [top, bottom] = [self.angle(row), self.angle(row + 1)];
        let slope = (bottom.sin() - top.sin()) / (bottom - top);
        let [upper, lower] = [top.cos() - slope, slope - bottom.cos()];
        let width = self.width();
        let line = |y| (0..width).map(|x| self.pixel(x, y).luminance()).collect::<Vec<_>>();
        let (above, below) = (line(row), line(row + 1));
        let side = |x: usize| above[x % width] * upper + below[x % width] * lower;
        (0..width).map(|x| (0.5 * (side(x) + side(x + 1)) * TAU / width as f64).max(0.0)).collect()
    }

    fn width(&self) -> usize {
        self.picture.size()[0]
    }

    /// Rows of cells; an image of one row is stretched from pole to pole.
    fn row_count(&self) -> usize {
        (self.picture.size()[1] - 1).max(1)
    }

    /// Angle from +y to the pixels of a row.
    fn angle(&self, row: usize) -> f64 {
        PI * row as f64 / self.row_count() as f64
    }

    #[inline]
    fn pixel(&self, x: usize, y: usize) -> Spectrum {
        let y = y.min(self.picture.size()[1] - 1);
        self.picture.pixel(x, y, false).map(|channel| channel.max(0.0)) * self.scale
    }

    #[inline]
    fn place(&self, direction: DVec3) -> Place {
        let width = self.width() as f64;
        let down = direction.x.hypot(direction.z).atan2(direction.y) / PI * self.row_count() as f64;
        let row = (down as usize).min(self.row_count() - 1);
        let turn = direction.x.atan2(-direction.z) / TAU - 0.5 / width;
        let right = (turn - turn.floor()) * width;
        let column = (right as usize).min(self.width() - 1);
        Place { row, column, down: down - row as f64, right: right - column as f64 }
    }

    /// Radiance from the unit vector `direction`.
    #[inline]
    pub fn radiance(&self, direction: DVec3) -> Spectrum {
        let Place { row, column, down, right } = self.place(direction);
        let next = (column + 1) % self.width();
        let line = |y| self.pixel(column, y) * (1.0 - right) + self.pixel(next, y) * right;
        line(row) * (1.0 - down) + line(row + 1) * down
    }

    /// Luminance over the sphere.
    pub(super) fn integral(&self) -> f64 {
        self.integral
    }

    /// Maps [0, 1)² to a unit vector.
    #[inline]
    pub fn sample(&self, u: [f64; 2]) -> DVec3 {
        let (row, down) = self.rows.sample(u[0]);
        let (column, right) = self.columns[row].as_ref().map_or((0, u[1]), |columns| columns.sample(u[1]));
        let [top, bottom] = [self.angle(row).cos(), self.angle(row + 1).cos()];
        let y = top + (bottom - top) * down;
        let radius = (1.0 - y * y).max(0.0).sqrt();
        let (sin, cos) = (TAU * (column as f64 + right + 0.5) / self.width() as f64).sin_cos();
        DVec3::new(radius * sin, y, -radius * cos)
    }

    /// Density of `direction`.
    #[inline]
    pub fn pdf(&self, direction: DVec3) -> SolidAnglePdf {
        let Place { row, column, .. } = self.place(direction);
        let Some(columns) = &self.columns[row] else { return SolidAnglePdf(0.0) };
        let height = self.angle(row).cos() - self.angle(row + 1).cos();
        let cell = height * TAU / self.width() as f64;
        SolidAnglePdf(self.rows.pdf(row) * columns.pdf(column) / cell)
    }

    /// The inverse of [`Panorama::sample`].
    pub fn invert(&self, direction: DVec3) -> [f64; 2] {
        let Place { row, column, right, .. } = self.place(direction);
        let [top, bottom] = [self.angle(row).cos(), self.angle(row + 1).cos()];
        let down = ((direction.y - top) / (bottom - top)).clamp(0.0, 1.0);
        let across = self.columns[row].as_ref().map_or(right, |columns| columns.invert(column, right));
        [self.rows.invert(row, down), across]
    }
}
