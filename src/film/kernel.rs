//! Reconstruction filters, as densities over the offset from a pixel's centre.
//!
//! Paths from the camera sample the position on the film from the filter of their pixel (so that each contributes to
//! one pixel with weight one); contributions at a given position are weighted by the same density. Both estimate the
//! same pixel value. At the border of the film the filter is cut off and renormalised.

/// The filters by name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Filter {
    /// Constant over the pixel.
    Box,
    /// Linear, radius 1.
    Tent,
    /// Normal with standard deviation `stddev` in pixels, cut off at four of them and lowered to reach zero there.
    Gaussian {
        /// Standard deviation in pixels, positive.
        stddev: f64,
    },
}

/// Bins of the tabulated density over [-radius, radius].
const BINS: usize = 256;

/// A separable filter as a tabulated, normalised density per axis, constant within each bin.
#[derive(Clone, Debug, PartialEq)]
pub struct Kernel {
    radius: f64,
    /// Cumulative probability at the bin borders.
    cumulative: Vec<f64>,
}

impl Kernel {
    /// Tabulates `filter`.
    pub fn new(filter: Filter) -> Self {
        let (radius, bins): (f64, usize) = match filter {
            Filter::Box => (0.5, 1),
            Filter::Tent => (1.0, BINS),
            Filter::Gaussian { stddev } => (4.0 * stddev, BINS),
        };
        let value = |x: f64| match filter {
            Filter::Box => 1.0,
            Filter::Tent => 1.0 - x.abs(),
            Filter::Gaussian { stddev } => {
                let bell = |x: f64| (-0.5 * (x / stddev).powi(2)).exp();
                (bell(x) - bell(radius)).max(0.0)
            }
        };
        let mut cumulative = vec![0.0];
        for bin in 0..bins {
            let x = (2.0 * (bin as f64 + 0.5) / bins as f64 - 1.0) * radius;
            cumulative.push(cumulative[bin] + value(x));
        }
        let total = cumulative[bins];
        cumulative.iter_mut().for_each(|c| *c /= total);
        Self { radius, cumulative }
    }

    fn bins(&self) -> usize {
        self.cumulative.len() - 1
    }

    /// Probability of offsets below `x`.
    fn below(&self, x: f64) -> f64 {
        let position = ((x / self.radius + 1.0) * 0.5 * self.bins() as f64).clamp(0.0, self.bins() as f64);
        let bin = (position as usize).min(self.bins() - 1);
        self.cumulative[bin] + (position - bin as f64) * (self.cumulative[bin + 1] - self.cumulative[bin])
    }

    fn density(&self, x: f64) -> f64 {
        let position = (x / self.radius + 1.0) * 0.5 * self.bins() as f64;
        if !(position >= 0.0 && position < self.bins() as f64) {
            return 0.0;
        }
        let bin = position as usize;
        (self.cumulative[bin + 1] - self.cumulative[bin]) * self.bins() as f64 / (2.0 * self.radius)
    }

    /// Film coordinate for the pixel `pixel` of `pixels` along one axis, from `u` in [0, 1).
    #[inline]
    pub fn sample(&self, u: f64, pixel: usize, pixels: usize) -> f64 {
        let center = pixel as f64 + 0.5;
        if self.bins() == 1 {
            return center + (u - 0.5) * 2.0 * self.radius;
        }
        let low = self.below(-center);
        let high = self.below(pixels as f64 - center);
        let target = low + u * (high - low);
        let bin = self.cumulative.partition_point(|c| *c <= target).clamp(1, self.bins()) - 1;
        let share = (target - self.cumulative[bin]) / (self.cumulative[bin + 1] - self.cumulative[bin]);
        let x = ((bin as f64 + share) / self.bins() as f64 * 2.0 - 1.0) * self.radius;
        (center + x).clamp(0.0, pixels as f64 * (1.0 - f64::EPSILON))
    }

    /// The first and the last pixel along one axis whose filter may reach the film coordinate `x`.
    #[inline]
    pub fn reach(&self, x: f64, pixels: usize) -> (usize, usize) {
        if self.bins() == 1 {
            let pixel = (x as usize).min(pixels - 1);
            return (pixel, pixel);
        }
        let first = (x - self.radius - 0.5).ceil().max(0.0) as usize;
        let last = ((x + self.radius - 0.5).floor().max(0.0) as usize).min(pixels - 1);
        (first.min(last), last)
    }

    /// Calls `each(pixel, weight)` for the pixels along one axis whose filter reaches the film coordinate `x`.
    #[inline]
    pub fn pixels_near(&self, x: f64, pixels: usize, mut each: impl FnMut(usize, f64)) {
        let (first, last) = self.reach(x, pixels);
        if self.bins() == 1 {
            each(first, 1.0);
            return;
        }
        for pixel in first..=last {
            let center = pixel as f64 + 0.5;
            let mass = self.below(pixels as f64 - center) - self.below(-center);
            let weight = self.density(x - center) / mass;
            if weight > 0.0 {
                each(pixel, weight);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples of a pixel's position and weights of given positions describe the same density, borders included.
    #[test]
    fn samples_and_weights_agree() {
        let pixels = 5;
        for filter in [Filter::Box, Filter::Tent, Filter::Gaussian { stddev: 0.5 }] {
            let kernel = Kernel::new(filter);
            let n = 20_000;
            let test = |x: f64| (1.3 * x).sin() + 0.2 * x * x;
            let mut by_weights = vec![0.0; pixels];
            for i in 0..n {
                let x = (f64::from(i) + 0.5) / f64::from(n) * pixels as f64;
                kernel.pixels_near(x, pixels, |pixel, weight| {
                    by_weights[pixel] += test(x) * weight * pixels as f64 / f64::from(n);
                });
            }
            for (pixel, expected) in by_weights.iter().enumerate() {
                let mean: f64 = (0..n)
                    .map(|i| test(kernel.sample((f64::from(i) + 0.5) / f64::from(n), pixel, pixels)))
                    .sum::<f64>()
                    / f64::from(n);
                assert!((mean - expected).abs() < 1e-3, "{filter:?} pixel {pixel}: {mean} {expected}");
            }
        }
    }
}
