//! Colours in all the forms that scene files give them, as linear Rec.709.
//!
//! Values per wavelength become colours as in the RGB modes of Mitsuba 3: by the CIE observer of 1931, reflectances
//! under D65 so that white is (1, 1, 1), and light as it is.

use super::cie::{FIRST, STEP, TABLE};
use super::document::Element;
use super::error::LoadError;
use super::source::read_bounded;
use super::value::Text;
use crate::spectrum::Spectrum;

/// Linear Rec.709 of a spectrum that is one at all wavelengths: XYZ = (1, 1, 1).
const EQUAL_ENERGY: Spectrum = Spectrum::rgb(1.204_794, 0.948_291, 0.908_916);

/// Mitsuba sums the spectra of surfaces over steps that are too short by a thousandth.
const MITSUBA_SUM: f64 = 0.999;

/// Most bytes of a file with a spectrum.
const MOST_BYTES: u64 = 1 << 24;

/// What a colour stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Meaning {
    /// A share of light, from 0 to 1.
    Share,
    /// A refractive index.
    Index,
    /// Emitted light.
    Light,
}

/// Reads the colour that `element` gives.
pub(super) fn read(element: Element<'_>, meaning: Meaning) -> Result<Spectrum, LoadError> {
    match element.tag() {
        "spectrum" => spectrum(element, meaning),
        "blackbody" => black_body(element),
        tag => {
            element.only(&["name", "value"])?;
            let text = element.required("value")?;
            match tag {
                "rgb" => text.colour(),
                "srgb" => Ok(text.colour()?.map(decode)),
                _ => text.number().map(Spectrum::grey),
            }
        }
    }
}

fn spectrum(element: Element<'_>, meaning: Meaning) -> Result<Spectrum, LoadError> {
    let legacy = element.is_legacy();
    element.only(&["name", "value", "filename", "intent"][..if legacy { 4 } else { 3 }])?;
    if let Some(name) = element.attribute("filename") {
        return Ok(colour(&file(name)?, meaning));
    }
    let text = element.required("value")?;
    if text.text.contains(':') {
        return Ok(colour(&pairs(text)?, meaning));
    }
    match text.numbers()?[..] {
        [value] if meaning == Meaning::Light && !legacy => Ok(EQUAL_ENERGY * value),
        [value] => Ok(Spectrum::grey(value)),
        // In Mitsuba 0.6 these were the channels.
        [r, g, b] if legacy => Ok(Spectrum::rgb(r, g, b)),
        _ => Err(text.expected("one finite number, or pairs wavelength:value")),
    }
}

/// Pairs of wavelengths in nm and values.
fn pairs(text: Text<'_>) -> Result<Vec<[f64; 2]>, LoadError> {
    let words = text.text.split(|c: char| c == ',' || c.is_whitespace()).filter(|word| !word.is_empty());
    let pair = |word: &str| {
        let (wavelength, value) = word.split_once(':')?;
        finite([wavelength, value])
    };
    let pairs: Option<Vec<_>> = words.map(pair).collect();
    let pairs = pairs.ok_or_else(|| text.expected("pairs wavelength:value of finite numbers"))?;
    check(&pairs).map_err(|reason| text.error(reason))?;
    Ok(pairs)
}

/// The file that `name` means, with a wavelength and a value in each line.
fn file(name: Text<'_>) -> Result<Vec<[f64; 2]>, LoadError> {
    let path = name.source.beside(name.text);
    let bytes = read_bounded(&path, MOST_BYTES).map_err(|reason| {
        let looked = name.source.looked(name.text);
        name.error(format!("cannot read the spectrum {}: {reason}{looked}", path.display()))
    })?;
    let broken = |reason: String| name.error(format!("the spectrum {} is broken: {reason}", path.display()));
    let mut pairs = Vec::new();
    for (index, line) in String::from_utf8_lossy(&bytes).lines().enumerate() {
        let words: Vec<_> = line.split('#').next().unwrap_or_default().split_whitespace().collect();
        let pair = match words[..] {
            [] => continue,
            [wavelength, value] => finite([wavelength, value]),
            _ => None,
        };
        let missing = || broken(format!("line {}: expected a wavelength and a value", index + 1));
        pairs.push(pair.ok_or_else(missing)?);
    }
    check(&pairs).map_err(broken)?;
    Ok(pairs)
}

fn finite(words: [&str; 2]) -> Option<[f64; 2]> {
    let number = |word: &str| word.trim().parse().ok().filter(|value: &f64| value.is_finite());
    Some([number(words[0])?, number(words[1])?])
}

fn check(pairs: &[[f64; 2]]) -> Result<(), String> {
    if pairs.len() < 2 {
        return Err("a spectrum of fewer than two values; expected at least two".to_owned());
    }
    if !pairs.is_sorted_by(|a, b| a[0] < b[0]) {
        return Err("the wavelengths of this spectrum do not grow; expected them in ascending order".to_owned());
    }
    match pairs.iter().find(|pair| pair[1] < 0.0) {
        Some([wavelength, value]) => Err(format!("this spectrum is {value} at {wavelength} nm; expected at least 0")),
        None => Ok(()),
    }
}

/// Glow of a black body in W/(m² sr nm) by Planck's law, as in Mitsuba 0.6.
fn black_body(element: Element<'_>) -> Result<Spectrum, LoadError> {
    element.only(&["name", "temperature", "scale", "multiplier"])?;
    let text = element.required("temperature")?;
    let kelvin = Text { text: text.text.trim_end_matches(['k', 'K']).trim(), ..text };
    let temperature = kelvin.number()?;
    if temperature <= 0.0 {
        return Err(text.expected("a temperature above 0 K"));
    }
    let mut scale = 1.0;
    for name in ["scale", "multiplier"] {
        scale *= element.attribute(name).map_or(Ok(1.0), |text| text.number())?;
    }
    let (h, c, k) = (6.626_070_15e-34, 299_792_458.0, 1.380_649e-23);
    let glow = |index: usize| {
        let nm = FIRST + STEP * index as f64;
        let metres = nm * 1e-9;
        let power = 2.0 * h * c * c / (metres.powi(5) * (h * c / (k * temperature * metres)).exp_m1());
        [nm, power * 1e-9]
    };
    let pairs: Vec<_> = (0..TABLE.len()).map(glow).collect();
    Ok(colour(&pairs, Meaning::Light) * scale)
}

/// The linear value of an sRGB code value (IEC 61966-2-1).
fn decode(code: f64) -> f64 {
    if code <= 0.04045 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

/// The colour of values per wavelength, with straight lines between them and nothing outside.
pub(super) fn colour(pairs: &[[f64; 2]], meaning: Meaning) -> Spectrum {
    let weighted = meaning != Meaning::Light;
    let all = [[FIRST, 1.0], [FIRST + STEP * (TABLE.len() - 1) as f64, 1.0]];
    let white = integrate(&all, weighted)[1];
    let factor = if weighted { MITSUBA_SUM / white } else { 1.0 / white };
    let [x, y, z] = integrate(pairs, weighted).map(|sum| sum * factor);
    // XYZ to linear Rec.709.
    let rgb = Spectrum::rgb(
        3.240_479 * x - 1.537_150 * y - 0.498_535 * z,
        -0.969_256 * x + 1.875_991 * y + 0.041_556 * z,
        0.055_648 * x - 0.204_043 * y + 1.057_311 * z,
    );
    let most = if meaning == Meaning::Share { 1.0 } else { f64::INFINITY };
    rgb.map(|channel| channel.clamp(0.0, most))
}

/// The integrals of the values times x̄, ȳ and z̄, under D65 where they are `weighted`. All functions are straight
/// between the wavelengths of the table and of `pairs`, so Simpson's rule between these is exact.
fn integrate(pairs: &[[f64; 2]], weighted: bool) -> [f64; 3] {
    let last = FIRST + STEP * (TABLE.len() - 1) as f64;
    let (low, high) = match (pairs.first(), pairs.last()) {
        (Some(a), Some(b)) => (a[0].max(FIRST), b[0].min(last)),
        _ => return [0.0; 3],
    };
    let rows = (0..TABLE.len()).map(|index| FIRST + STEP * index as f64);
    let mut knots: Vec<f64> = rows.chain(pairs.iter().map(|pair| pair[0])).collect();
    knots.retain(|wavelength| (low..=high).contains(wavelength));
    knots.extend([low, high].iter().filter(|_| low < high));
    knots.sort_by(f64::total_cmp);
    let at = |wavelength: f64| {
        let [x, y, z, d65] = row(wavelength);
        let value = value(pairs, wavelength) * if weighted { d65 } else { 1.0 };
        [x * value, y * value, z * value]
    };
    let mut sums = [0.0; 3];
    for pair in knots.windows(2) {
        let [a, b] = [pair[0], pair[1]];
        let (start, middle, end) = (at(a), at(0.5 * (a + b)), at(b));
        for (i, sum) in sums.iter_mut().enumerate() {
            *sum += (b - a) / 6.0 * (start[i] + 4.0 * middle[i] + end[i]);
        }
    }
    sums
}

/// The table at a wavelength inside it.
fn row(wavelength: f64) -> [f64; 4] {
    let at = (wavelength - FIRST) / STEP;
    let index = (at as usize).min(TABLE.len() - 2);
    let t = at - index as f64;
    [0, 1, 2, 3].map(|i| TABLE[index][i] * (1.0 - t) + TABLE[index + 1][i] * t)
}

/// The value at a wavelength between the first and the last.
fn value(pairs: &[[f64; 2]], wavelength: f64) -> f64 {
    let after = pairs.partition_point(|pair| pair[0] <= wavelength).clamp(1, pairs.len() - 1);
    let ([a, x], [b, y]) = (pairs[after - 1], pairs[after]);
    let t = (wavelength - a) / (b - a);
    x * (1.0 - t) + y * t
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What Mitsuba 3.9.1 makes of the same pairs (`scalar_rgb`).
    #[test]
    fn spectra_have_mitsubas_colours() {
        let steps = [[400.0, 0.1], [500.0, 0.2], [600.0, 0.7], [700.0, 0.9]];
        let falling = [[400.0, 2.0], [700.0, 0.5]];
        let (rising, flat) = ([[400.0, 1.5], [700.0, 2.5]], [[300.0, 1.0], [900.0, 1.0]]);
        let cases = [
            (&steps[..], Meaning::Share, [0.856_079, 0.404_085, 0.112_402]),
            (&steps, Meaning::Light, [0.988_160, 0.387_351, 0.095_602]),
            (&rising, Meaning::Index, [2.2972, 1.9761, 1.6284]),
            (&falling, Meaning::Share, [0.784_462, 1.0, 1.0]),
            (&falling, Meaning::Light, [0.988_927, 1.216_960, 1.636_342]),
            (&flat, Meaning::Light, [1.204_884, 0.948_228, 0.909_267]),
        ];
        for (pairs, meaning, expected) in cases {
            let found = colour(pairs, meaning).to_rgb();
            let close = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 4e-4 * b.max(0.1));
            assert!(close, "{pairs:?} {meaning:?}: {found:?}, expected {expected:?}");
        }
    }

    #[test]
    fn spectra_outside_of_what_is_seen_are_black() {
        for pairs in [[[100.0, 1.0], [200.0, 1.0]], [[900.0, 1.0], [1000.0, 1.0]]] {
            assert!(colour(&pairs, Meaning::Light).is_black());
        }
    }
}
