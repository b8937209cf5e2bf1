//! Colour quantities. RGB in linear Rec.709; wavelength-sampled quantities will live here too.

use glam::DVec3;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign};

/// A radiometric quantity (radiance, throughput, reflectance) in linear Rec.709.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spectrum(DVec3);

impl Spectrum {
    /// Nothing.
    pub const BLACK: Self = Self(DVec3::ZERO);
    /// One in every channel.
    pub const ONE: Self = Self(DVec3::ONE);

    /// From red, green and blue.
    #[inline]
    pub const fn rgb(r: f64, g: f64, b: f64) -> Self {
        Self(DVec3::new(r, g, b))
    }

    /// The same value in every channel.
    #[inline]
    pub const fn grey(value: f64) -> Self {
        Self(DVec3::splat(value))
    }

    /// Red, green and blue.
    #[inline]
    pub fn to_rgb(self) -> [f64; 3] {
        self.0.to_array()
    }

    /// Relative luminance (Rec. ITU-R BT.709).
    #[inline]
    pub fn luminance(self) -> f64 {
        self.0.dot(DVec3::new(0.2126, 0.7152, 0.0722))
    }

    /// The largest channel.
    #[inline]
    pub fn max_element(self) -> f64 {
        self.0.max_element()
    }

    /// Whether all channels are zero.
    #[inline]
    pub fn is_black(self) -> bool {
        self.0 == DVec3::ZERO
    }

    /// Whether all channels are finite and none is negative: what a contribution must be.
    #[inline]
    pub fn is_valid(self) -> bool {
        self.0.is_finite() && self.0.min_element() >= 0.0
    }

    /// Applies `f` to each channel.
    #[inline]
    pub fn map(self, f: impl Fn(f64) -> f64) -> Self {
        Self(DVec3::new(f(self.0.x), f(self.0.y), f(self.0.z)))
    }
}

impl Add for Spectrum {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

impl AddAssign for Spectrum {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        self.0 += other.0;
    }
}

impl Mul for Spectrum {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0)
    }
}

impl MulAssign for Spectrum {
    #[inline]
    fn mul_assign(&mut self, other: Self) {
        self.0 *= other.0;
    }
}

impl Mul<f64> for Spectrum {
    type Output = Self;
    #[inline]
    fn mul(self, factor: f64) -> Self {
        Self(self.0 * factor)
    }
}

impl Div<f64> for Spectrum {
    type Output = Self;
    #[inline]
    fn div(self, divisor: f64) -> Self {
        Self(self.0 / divisor)
    }
}
