//! Accumulation of colour and of luminance per path class.
//!
//! The film is cut into bands of rows. A band is written by one job at a time, so sums are formed in an order that
//! does not depend on the number of threads. Contributions to pixels that are not known beforehand (light tracing,
//! Markov chains) are kept as [`Splat`]s by the job that makes them and added in the order of the jobs.

mod band;
mod class;
mod kernel;
mod noise;
mod splat;

pub use band::Band;
pub use class::{PathClass, Word};
pub use kernel::{Filter, Kernel};
pub use noise::{NoiseEstimate, VARIANCE_LAYER};
pub use splat::{Splat, Splats};

use crate::image::{Image, Layer};
use crate::spectrum::Spectrum;
use ndarray::{Array2, Array3, Axis};
use noise::Batches;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Rows in a band. Small enough that two threads share a film evenly, large enough that a band amortises its job.
pub const BAND_ROWS: usize = 8;

/// Counters of what went wrong, never silently dropped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Health {
    /// Contributions that were infinite or not a number; left out.
    pub nonfinite: u64,
    /// Contributions with a negative channel; left out.
    pub negative: u64,
}

impl std::fmt::Display for Health {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if *self == Self::default() {
            return f.write_str("all contributions valid");
        }
        write!(f, "left out {} contributions that were not finite and {} negative ones", self.nonfinite, self.negative)
    }
}

impl Health {
    /// Counts `value` where it is no valid contribution; says whether it is one.
    #[inline]
    pub fn accepts(&mut self, value: Spectrum) -> bool {
        if value.is_valid() {
            return true;
        }
        let finite = value.to_rgb().iter().all(|c| c.is_finite());
        *(if finite { &mut self.negative } else { &mut self.nonfinite }) += 1;
        false
    }

    /// Adds the counts of another job.
    pub fn add(&mut self, other: &Self) {
        self.nonfinite += other.nonfinite;
        self.negative += other.negative;
    }
}

/// Sums over passes: colour and class luminances per pixel, and how they came about.
pub struct Film {
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Reconstruction filter.
    pub kernel: Kernel,
    /// Whether class luminances are kept.
    features: bool,
    sums: Sums,
}

/// All that passes change in a film: with it a render can go on later.
#[derive(Serialize, Deserialize)]
pub struct Sums {
    bands: Vec<Band>,
    /// What went wrong before it reached a band.
    elsewhere: Health,
    batches: Batches,
}

impl Film {
    /// A black film; `features` says whether class luminances are kept.
    pub fn new(size: [usize; 2], filter: Filter, features: bool) -> Self {
        let bands = (0..size[1].div_ceil(BAND_ROWS))
            .map(|index| {
                let first_row = index * BAND_ROWS;
                Band::new(size[0], first_row, BAND_ROWS.min(size[1] - first_row), features)
            })
            .collect();
        let sums = Sums { bands, elsewhere: Health::default(), batches: Batches::default() };
        Self { size, kernel: Kernel::new(filter), features, sums }
    }

    /// What passes have changed so far.
    pub fn sums(&self) -> &Sums {
        &self.sums
    }

    /// Goes on from `sums`; `false`, and nothing changes, where they are those of a film of another form.
    pub fn restore(&mut self, sums: Sums) -> bool {
        let fits = sums.bands.len() == self.sums.bands.len()
            && sums.bands.iter().zip(&self.sums.bands).all(|(new, old)| new.is_like(old));
        if fits {
            self.sums = sums;
        }
        fits
    }

    /// Runs `job` once for each band, in parallel; results in the order of the bands.
    pub fn for_each_band<R: Send>(&mut self, job: impl Fn(usize, &mut Band) -> R + Sync) -> Vec<R> {
        self.sums.bands.par_iter_mut().enumerate().map(|(index, band)| job(index, band)).collect()
    }

    /// Adds the splats of some jobs, in the order of the jobs.
    pub fn splat(&mut self, jobs: &[Splats]) {
        let (kernel, size) = (&self.kernel, self.size);
        self.sums.bands.par_iter_mut().enumerate().for_each(|(index, band)| {
            for splats in jobs {
                for splat in splats.band(index) {
                    band.splat(kernel, size, splat);
                }
            }
        });
    }

    /// Adds what went wrong before it reached the film.
    pub fn report(&mut self, health: &Health) {
        self.sums.elsewhere.add(health);
    }

    /// What went wrong so far.
    pub fn health(&self) -> Health {
        let mut health = self.sums.elsewhere;
        self.sums.bands.iter().for_each(|band| health.add(&band.health));
        health
    }

    /// The image: sums divided by the number of passes, class layers named `path_LDE` and so on, and the variance of the
    /// colour where there are passes enough to tell.
    pub fn develop(&self) -> Image {
        let [width, height] = self.size;
        let mut image = Image::new(width, height);
        image.colour = self.colour();
        let occurs = |class| self.sums.bands.iter().any(|band| band.has(class));
        // An image without any light still says that it has class layers.
        let dark = self.features && !PathClass::all().any(occurs);
        let shown = |class: &PathClass| occurs(*class) || dark && *class == Word::EMPTY.class();
        let classes: Vec<PathClass> = PathClass::all().filter(shown).collect();
        let layer = |class: &PathClass| {
            let layer = Array2::from_shape_fn((height, width), |(y, x)| {
                (self.sums.bands[y / BAND_ROWS].luminance(*class, [x, y]) / self.divisor()) as f32
            });
            (class.layer_name(), Layer::Luminance(layer))
        };
        image.layers.extend(classes.par_iter().map(layer).collect::<Vec<_>>());
        if let Some(variance) = self.variance() {
            image.layers.insert(VARIANCE_LAYER.to_owned(), Layer::Colour(variance));
        }
        image
    }

    /// What sums are divided by: the number of passes, or 1 where there are none.
    fn divisor(&self) -> f64 {
        self.passes().max(1) as f64
    }

    fn colour(&self) -> Array3<f32> {
        self.picture(|band, pixel| band.colour(pixel).map(|sum| sum / self.divisor()))
    }

    /// One colour for each pixel, height × width × 3.
    fn picture(&self, value: impl Fn(&Band, [usize; 2]) -> [f64; 3] + Sync) -> Array3<f32> {
        let mut picture = Array3::zeros((self.size[1], self.size[0], 3));
        let rows: Vec<_> = picture.axis_chunks_iter_mut(Axis(0), BAND_ROWS).collect();
        rows.into_par_iter().zip(&self.sums.bands).for_each(|(mut rows, band)| {
            for (mut lane, pixel) in rows.lanes_mut(Axis(2)).into_iter().zip(band.pixels()) {
                lane.iter_mut().zip(value(band, pixel)).for_each(|(channel, v)| *channel = v as f32);
            }
        });
        picture
    }
}
