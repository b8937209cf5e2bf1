//! Spectra become linear Rec.709.

use super::params::Param;
use super::token::{cut, number};
use crate::load::LoadError;
use crate::spectrum::Spectrum;
use glam::DVec3;
use std::path::Path;

/// What a spectrum is for.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Role {
    /// A share or a refractive index: a constant spectrum is grey.
    Share,
    /// Emitted light: its luminance is one, as pbrt scales it.
    Light,
}

/// Refractive and absorption indices of metals as Mitsuba has them in its RGB modes; brass after pbrt's table.
const METALS: [(&str, [f64; 3], [f64; 3]); 7] = [
    ("Cu", [0.201005, 0.92375, 1.10222], [3.91326, 2.45305, 2.14209]),
    ("Au", [0.143036, 0.375307, 1.44205], [3.983, 2.38556, 1.60336]),
    ("Ag", [0.155276, 0.116728, 0.138388], [4.82835, 3.12222, 2.1469]),
    ("Al", [1.6575, 0.880405, 0.521244], [9.22381, 6.2695, 4.837]),
    ("CuZn", [0.444, 0.527, 1.094], [3.695, 2.765, 1.829]),
    ("MgO", [2.08958, 1.65072, 1.59488], [0.0, 0.0, 0.0]),
    ("TiO2", [3.45661, 2.80174, 2.90517], [0.0001, 0.0, 0.0007]),
];

/// Refractive indices of glasses at 589 nm (Schott's data sheets).
const GLASSES: [(&str, f64); 8] = [
    ("glass-BK7", 1.5168),
    ("glass-BAF10", 1.67),
    ("glass-FK51A", 1.4866),
    ("glass-LASF9", 1.8503),
    ("glass-F5", 1.6034),
    ("glass-F10", 1.6231),
    ("glass-F11", 1.6206),
    ("glass-SF11", 1.7847),
];

/// Temperatures of the lights whose spectrum is, or is close to, that of a black body.
const ILLUMINANTS: [(&str, f64); 2] = [("stdillum-A", 2856.0), ("stdillum-D50", 5003.0)];

/// The refractive and absorption index of a metal.
pub(super) fn metal(name: &str) -> Option<[Spectrum; 2]> {
    let (_, eta, k) = METALS.iter().find(|(known, ..)| *known == name)?;
    Some([eta, k].map(|[r, g, b]| Spectrum::rgb(*r, *g, *b)))
}

/// The refractive index of a glass.
pub(super) fn glass(name: &str) -> Option<f64> {
    GLASSES.iter().find(|(known, _)| *known == name).map(|(_, index)| *index)
}

/// The colour that a parameter stands for. `folder` is where files of spectra are looked for.
pub(super) fn read(param: &Param, role: Role, folder: &Path) -> Result<Spectrum, LoadError> {
    match param.kind {
        "rgb" | "color" => {
            let [r, g, b] = triple(param)?.to_array();
            Ok(Spectrum::rgb(r, g, b))
        }
        "xyz" => Ok(to_rgb(triple(param)?)),
        "blackbody" => black_body(param),
        "spectrum" | "illuminant" => spectrum(param, role, folder),
        _ => {
            let value = param.numbers(1)?[0];
            if value < 0.0 { Err(param.error_at(0, "a number of at least 0")) } else { Ok(Spectrum::grey(value)) }
        }
    }
}

fn triple(param: &Param) -> Result<DVec3, LoadError> {
    let numbers = param.numbers(3)?;
    match numbers.iter().position(|value| *value < 0.0) {
        Some(index) => Err(param.error_at(index, "a number of at least 0")),
        None => Ok(DVec3::from_slice(numbers)),
    }
}

/// A temperature in kelvin; version 3 has a factor behind it.
fn black_body(param: &Param) -> Result<Spectrum, LoadError> {
    let numbers = param.numbers(0)?;
    let (kelvin, factor) = match numbers[..] {
        [kelvin] => (kelvin, 1.0),
        [kelvin, factor] => (kelvin, factor),
        _ => return Err(param.spot.expected(&format!("{} values of `{}`", numbers.len(), param.name), "1")),
    };
    if !(100.0..=1e6).contains(&kelvin) {
        return Err(param.error_at(0, "a temperature from 100 to 1000000 kelvin"));
    }
    Ok(light(|wavelength| planck(wavelength, kelvin)) * factor)
}

fn spectrum(param: &Param, role: Role, folder: &Path) -> Result<Spectrum, LoadError> {
    if let Ok(numbers) = param.numbers(0) {
        return match numbers {
            [constant] => Ok(Spectrum::grey(*constant)),
            samples => sampled(samples, role).ok_or_else(|| {
                param.error_at(0, "pairs of a growing wavelength in nanometres and a value of at least 0")
            }),
        };
    }
    let name = param.string()?;
    let (base, part) = name.strip_prefix("metal-").and_then(|rest| rest.rsplit_once('-')).unwrap_or((name, ""));
    if let Some([eta, k]) = metal(base) {
        match part {
            "eta" => return Ok(eta),
            "k" => return Ok(k),
            _ => (),
        }
    }
    if let Some(index) = glass(name) {
        return Ok(Spectrum::grey(index));
    }
    if let Some((_, kelvin)) = ILLUMINANTS.iter().find(|(known, _)| *known == name) {
        return Ok(light(|wavelength| planck(wavelength, *kelvin)));
    }
    if name.starts_with("stdillum-") || name.starts_with("illum-") {
        return Ok(Spectrum::ONE);
    }
    file(param, name, role, folder)
}

/// A file of pairs of wavelength and value.
fn file(param: &Param, name: &str, role: Role, folder: &Path) -> Result<Spectrum, LoadError> {
    let path = folder.join(name);
    let expected = "a spectrum's name, such as metal-Cu-eta or glass-BK7, or a file of wavelengths and values";
    let text = std::fs::read_to_string(&path)
        .map_err(|error| param.error_at(0, &format!("{expected}; {} cannot be read: {error}", cut(name))))?;
    let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default());
    let numbers: Option<Vec<f64>> = lines.flat_map(str::split_whitespace).map(number).collect();
    numbers.and_then(|samples| sampled(&samples, role)).ok_or_else(|| param.error_at(0, expected))
}

/// The colour of values at growing wavelengths, constant beyond the ends.
fn sampled(samples: &[f64], role: Role) -> Option<Spectrum> {
    let (pairs, []) = samples.as_chunks::<2>() else { return None };
    let [first, .., last] = pairs else { return None };
    if !pairs.windows(2).all(|pair| pair[0][0] < pair[1][0]) || pairs.iter().any(|[_, value]| *value < 0.0) {
        return None;
    }
    let at = |wavelength: f64| {
        let right = pairs.partition_point(|[at, _]| *at <= wavelength);
        match (right.checked_sub(1).and_then(|left| pairs.get(left)), pairs.get(right)) {
            (Some([l0, v0]), Some([l1, v1])) => v0 + (v1 - v0) * (wavelength - l0) / (l1 - l0),
            (None, _) => first[1],
            (_, None) => last[1],
        }
    };
    Some(match role {
        Role::Light => light(at),
        Role::Share => share(at),
    })
}

/// Light of the colour of a spectrum, with luminance one.
fn light(at: impl Fn(f64) -> f64) -> Spectrum {
    let sum = integrate(at);
    if sum.y > 0.0 { to_rgb(sum / sum.y) } else { Spectrum::BLACK }
}

/// The colour of a spectrum under which a constant one is grey.
fn share(at: impl Fn(f64) -> f64) -> Spectrum {
    to_rgb(integrate(at) / integrate(|_| 1.0) * WHITE)
}

/// XYZ of white in Rec.709 (D65).
const WHITE: DVec3 = DVec3::new(0.950_47, 1.0, 1.088_83);

fn integrate(at: impl Fn(f64) -> f64) -> DVec3 {
    (0..=94).map(|step| 360.0 + 5.0 * f64::from(step)).map(|wavelength| matching(wavelength) * at(wavelength)).sum()
}

/// The CIE 1931 colour matching functions as sums of Gaussians (Wyman, Sloan and Shirley 2013).
fn matching(wavelength: f64) -> DVec3 {
    let lobe = |height: f64, centre: f64, left: f64, right: f64| {
        let t = (wavelength - centre) / if wavelength < centre { left } else { right };
        height * (-0.5 * t * t).exp()
    };
    DVec3::new(
        lobe(1.056, 599.8, 37.9, 31.0) + lobe(0.362, 442.0, 16.0, 26.7) + lobe(-0.065, 501.1, 20.4, 26.2),
        lobe(0.821, 568.8, 46.9, 40.5) + lobe(0.286, 530.9, 16.3, 31.1),
        lobe(1.217, 437.0, 11.8, 36.0) + lobe(0.681, 459.0, 26.0, 13.8),
    )
}

/// Planck's law up to a factor, at a wavelength in nanometres.
fn planck(wavelength: f64, kelvin: f64) -> f64 {
    (wavelength / 560.0).powi(-5) / (1.438_776_877e7 / (wavelength * kelvin)).exp_m1()
}

/// Linear Rec.709 (IEC 61966-2-1); what lies outside of it is moved to its edge.
fn to_rgb(xyz: DVec3) -> Spectrum {
    let rows = [
        DVec3::new(3.240_454_2, -1.537_138_5, -0.498_531_4),
        DVec3::new(-0.969_266_0, 1.876_010_8, 0.041_556_0),
        DVec3::new(0.055_643_4, -0.204_025_9, 1.057_225_2),
    ];
    let [r, g, b] = rows.map(|row| row.dot(xyz).max(0.0));
    Spectrum::rgb(r, g, b)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn constant_spectra_are_grey_and_white_light_is_white() {
        for channel in share(|_| 0.25).to_rgb() {
            assert!((channel - 0.25).abs() < 1e-4, "{channel}");
        }
        let day = light(|wavelength| planck(wavelength, 6504.0));
        assert!((day.luminance() - 1.0).abs() < 1e-3);
        assert!(day.to_rgb().iter().all(|channel| (channel - 1.0).abs() < 0.06), "{day:?}");
        let [r, g, b] = light(|wavelength| planck(wavelength, 2856.0)).to_rgb();
        assert!(r > g && g > b);
    }

    #[test]
    fn samples_grow_and_are_interpolated() {
        let grey = sampled(&[400.0, 0.5, 700.0, 0.5], Role::Share).unwrap();
        assert!(grey.to_rgb().iter().all(|channel| (channel - 0.5).abs() < 1e-4));
        let [r, _, b] = sampled(&[400.0, 0.0, 700.0, 1.0], Role::Share).unwrap().to_rgb();
        assert!(r > b);
        for bad in [&[400.0][..], &[400.0, 1.0], &[500.0, 1.0, 400.0, 1.0], &[400.0, -1.0, 500.0, 1.0]] {
            assert!(sampled(bad, Role::Share).is_none(), "{bad:?}");
        }
    }
}
