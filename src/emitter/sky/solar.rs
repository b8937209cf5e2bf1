//! The sun through the air (Hosek and Wilkie 2013, *Adding a Solar-Radiance Function to the Hosek-Wilkie Skylight
//! Model*), for red, green and blue, which is Mitsuba 3's model. The coefficients are in a file of their own, with their
//! licence beside it; limb darkening has been averaged over the disk.

use super::hosek::RESPONSE;
use crate::spectrum::Spectrum;
use std::f64::consts::FRAC_PI_2;
use std::sync::LazyLock;

/// Turbidities of the table.
const TURBIDITIES: usize = 10;
/// Intervals of the elevation, evenly spread over its cube root.
const SEGMENTS: usize = 45;
/// Coefficients of the cubic polynomial in an interval.
const POWERS: usize = 4;
/// From the spectral radiance of the table's unit to the one of the sky's coefficients.
const SCALE: f64 = 467.069_280_386;

static TABLE: LazyLock<Vec<f64>> = LazyLock::new(|| super::numbers(include_bytes!("hosek_wilkie_sun_rgb.f32")));

/// Mean radiance of the sun's disk at the angle `zenith` to the zenith, for a `turbidity` from 1 to 10.
pub(super) fn radiance(zenith: f64, turbidity: f64) -> Spectrum {
    let elevation = (FRAC_PI_2 - zenith).clamp(0.0, FRAC_PI_2);
    let segment = (((elevation / FRAC_PI_2).cbrt() * SEGMENTS as f64) as usize).min(SEGMENTS - 1);
    let x = elevation - FRAC_PI_2 * (segment as f64 / SEGMENTS as f64).powi(3);
    let low = (turbidity as usize).clamp(1, TURBIDITIES - 1);
    let share = turbidity - low as f64;
    let channel = |channel: usize| {
        let at = |turbidity: usize| {
            let first = (((turbidity - 1) * SEGMENTS + segment) * 3 + channel) * POWERS;
            TABLE[first..first + POWERS].iter().rev().fold(0.0, |sum, coefficient| sum * x + coefficient)
        };
        (SCALE / RESPONSE * (at(low) * (1.0 - share) + at(low + 1) * share)).max(0.0)
    };
    Spectrum::rgb(channel(0), channel(1), channel(2))
}
