//! Clear sky and sun, as Mitsuba understands them; here +y is up.

mod hosek;
mod position;
mod solar;
mod sunlight;

pub use position::When;

use super::{Panorama, Sun};
use crate::math::warp;
use crate::spectrum::Spectrum;
use crate::texture::{Picture, Texels};
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

/// Angular diameter of the sun in degrees.
pub const SUN_DIAMETER: f64 = 0.5358;

/// Columns and rows of the image of the sky.
const SIZE: [usize; 2] = [512, 256];

/// Whose sun it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SunModel {
    /// Preetham's, as in Mitsuba 0.6.
    Preetham,
    /// That of Hosek and Wilkie, as in Mitsuba 3.
    Hosek,
}

/// A clear sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    /// Unit vector towards the sun, above the horizon.
    pub towards: DVec3,
    /// How hazy the air is, from 1 to 10.
    pub turbidity: f64,
    /// What the ground reflects.
    pub albedo: Spectrum,
    /// Factor of all angles to the zenith, from 1 to 2.
    pub stretch: f64,
    /// The model of the sun.
    pub sun_model: SunModel,
}

/// Numbers of a table, kept as 32-bit floats, least significant byte first.
fn numbers(bytes: &[u8]) -> Vec<f64> {
    bytes.as_chunks::<4>().0.iter().map(|bytes| f64::from(f32::from_le_bytes(*bytes))).collect()
}

impl Sky {
    fn zenith(&self) -> f64 {
        self.towards.y.clamp(-1.0, 1.0).acos()
    }

    /// The sky without the sun, `scale` times as bright.
    pub fn image(&self, scale: f64) -> Option<Panorama> {
        let dome = hosek::Dome::new(self.turbidity, self.albedo, FRAC_PI_2 - self.zenith());
        let around = |column| (TAU * (column as f64 + 0.5) / SIZE[0] as f64).sin_cos();
        let around: Vec<_> = (0..SIZE[0]).map(around).collect();
        let row = |row| {
            let zenith = PI * row as f64 / (SIZE[1] - 1) as f64 / self.stretch;
            let (sin, cos) = zenith.sin_cos();
            let (dome, above) = (&dome, zenith <= FRAC_PI_2);
            let radiance = move |(x, z): &(f64, f64)| match above {
                true => dome.radiance(cos, DVec3::new(sin * x, cos, -sin * z).angle_between(self.towards)),
                false => Spectrum::BLACK,
            };
            around.iter().flat_map(move |turn| radiance(turn).to_rgb().map(|channel| channel as f32))
        };
        let samples = (0..SIZE[1]).into_par_iter().flat_map_iter(row).collect();
        Panorama::new(Arc::new(Picture::new(SIZE, Texels::Floats(samples))?), scale)
    }

    /// The sun as a disk `radius_scale` times as wide as it is, with the same light in all, `scale` times as bright.
    pub fn sun(&self, radius_scale: f64, scale: f64) -> Sun {
        let cap = |angle: f64| 2.0 * (0.5 * angle).sin().powi(2);
        let radius = 0.5 * SUN_DIAMETER.to_radians();
        let wide = cap(radius * radius_scale);
        let real = match self.sun_model {
            SunModel::Preetham => sunlight::radiance(self.zenith(), self.turbidity),
            SunModel::Hosek => solar::radiance(self.zenith(), self.turbidity),
        };
        let radiance = real * (scale * cap(radius) / wide);
        let zenith = self.zenith() * self.stretch;
        let level = DVec3::new(self.towards.x, 0.0, self.towards.z).normalize_or_zero();
        Sun { towards: level * zenith.sin() + DVec3::Y * zenith.cos(), cap: wide, radiance }
    }

    /// Irradiance by the sun of a surface that faces it.
    pub fn sun_irradiance(&self, scale: f64) -> Spectrum {
        let Sun { cap, radiance, .. } = self.sun(1.0, scale);
        radiance / warp::cone::pdf(cap).0
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    /// From Mitsuba 3, where +z is up, to here.
    fn turned(v: [f64; 3]) -> DVec3 {
        DVec3::new(v[0], v[2], -v[1]).normalize()
    }

    const TOWARDS: [f64; 3] = [-0.865804, 0.276929, 0.416766];

    #[test]
    fn skies_agree_with_mitsuba() {
        let directions = [[0.0, 0.0, 1.0], [0.5, 0.3, 0.6], [-0.8, 0.3, 0.5], [1.0, 0.0, 0.02]];
        let expected = [
            [[0.013476, 0.0265511, 0.0523302], [0.0199513, 0.0381239, 0.069419]],
            [[0.195828, 0.213193, 0.21203], [0.153328, 0.193212, 0.183]],
            [[0.0142066, 0.0288119, 0.0573352], [0.021682, 0.0419702, 0.0768046]],
            [[0.149714, 0.178178, 0.197099], [0.177144, 0.224429, 0.213122]],
        ];
        for (case, (turbidity, albedo)) in [(3.0, 0.2), (2.5, 0.45)].into_iter().enumerate() {
            let towards = turned(TOWARDS);
            let sky =
                Sky { towards, turbidity, albedo: Spectrum::grey(albedo), stretch: 1.0, sun_model: SunModel::Preetham };
            let dome = hosek::Dome::new(turbidity, sky.albedo, FRAC_PI_2 - sky.zenith());
            let image = sky.image(1.0).unwrap();
            for (i, direction) in directions.into_iter().map(turned).enumerate() {
                let wanted = expected[2 * case + i / 2][i % 2];
                let exact = dome.radiance(direction.y, direction.angle_between(towards)).to_rgb();
                let drawn = image.radiance(direction).to_rgb();
                for channel in 0..3 {
                    let off = |found: f64| (found / wanted[channel] - 1.0).abs();
                    assert!(off(exact[channel]) < 2e-5, "{direction}: {exact:?}, expected {wanted:?}");
                    assert!(off(drawn[channel]) < 5e-3, "{direction}: {drawn:?}, expected {wanted:?}");
                }
            }
        }
    }

    /// Mitsuba 3 interpolates the mean of the disk between thirty elevations, which is off by half a percent near the
    /// horizon.
    #[test]
    fn the_sun_is_as_bright_as_mitsubas() {
        let expected = [
            (3.0, 0.5, [20122.6, 15732.5, 10322.8]),
            (3.0, 1.0, [21807.5, 18214.9, 13946.9]),
            (5.0, 0.9, [20225.4, 16661.2, 12613.3]),
            (2.5, 0.2, [16120.2, 10284.8, 4104.91]),
            (8.0, 1.4, [18863.4, 15685.1, 12489.8]),
        ];
        for (turbidity, elevation, expected) in expected {
            let found = solar::radiance(FRAC_PI_2 - elevation, turbidity).to_rgb();
            let close = found.iter().zip(expected).all(|(a, b)| (a / b - 1.0).abs() < 0.005);
            assert!(close, "{turbidity} {elevation}: {found:?}, expected {expected:?}");
        }
    }

    /// Irradiance by the sun that Mitsuba 0.6 has drawn into an image, at turbidity 5.
    #[test]
    fn the_sun_is_as_bright_as_that_of_mitsuba_0_6() {
        let towards = DVec3::new(0.6145, 0.7830, 0.0960).normalize();
        let sky =
            Sky { towards, turbidity: 5.0, albedo: Spectrum::grey(0.2), stretch: 1.0, sun_model: SunModel::Preetham };
        let found = sky.sun_irradiance(1.0).to_rgb();
        let close = found.iter().zip([1.1044, 0.8713, 0.6671]).all(|(a, b)| (a / b - 1.0).abs() < 0.01);
        assert!(close, "{found:?}");
    }

    /// Its light does not depend on how large the disk is drawn.
    #[test]
    fn a_larger_sun_is_darker() {
        let sky = Sky {
            towards: turned(TOWARDS),
            turbidity: 3.0,
            albedo: Spectrum::grey(0.2),
            stretch: 1.0,
            sun_model: SunModel::Preetham,
        };
        let light = |sun: Sun| sun.radiance.luminance() / warp::cone::pdf(sun.cap).0;
        let (real, drawn) = (light(sky.sun(1.0, 2.0)), light(sky.sun(18.8131, 2.0)));
        assert!((real / drawn - 1.0).abs() < 1e-12 && (sky.sun(3.0, 1.0).towards - sky.towards).length() < 1e-12);
        assert!((sky.sun_irradiance(2.0).luminance() / real - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_sun_stands_where_mitsuba_puts_it() {
        let tokyo = When {
            date: [2010, 7, 10],
            clock: [15.0, 0.0, 0.0],
            timezone: 9.0,
            latitude: 35.6894,
            longitude: 139.6917,
        };
        let morning = When { clock: [9.0, 0.0, 0.0], ..tokyo };
        let clock = [11.0, 20.0, 0.0];
        let vienna = When { date: [2024, 1, 15], clock, timezone: 1.0, latitude: 48.2, longitude: 16.4 };
        let expected = [
            (tokyo, [0.0513854, 0.691748, 0.720308]),
            (morning, [0.0956952, -0.614786, 0.782867]),
            (vienna, [0.92328, -0.176476, 0.341189]),
        ];
        for (when, [south, west, up]) in expected {
            let off = when.towards() - DVec3::new(-west, up, south);
            // Mitsuba 3 counts days in single precision.
            assert!(off.length() < 2e-3, "{when:?}: {}, off by {off}", when.towards());
        }
    }
}
