//! False colour for a quantity in [0, 1] that has a middle, such as a blending weight.
//!
//! The map runs straight through Oklab (Björn Ottosson, "A perceptual color space for image processing",
//! 2020), so that equal steps of the value are about equal steps to the eye, and both sides weigh the same.

use super::srgb;

/// Oklab lightness of the neutral middle and of both ends, and the chroma of the ends.
const MIDDLE_LIGHTNESS: f32 = 0.96;
const END_LIGHTNESS: f32 = 0.60;
const END_CHROMA: f32 = 0.13;
/// Oklab hues of the ends, in degrees.
const BLUE_HUE: f32 = 255.0;
const ORANGE_HUE: f32 = 55.0;
/// Not on the map, so that it shows where a weight is no number.
const NOT_A_NUMBER: [u8; 3] = [255, 0, 255];

/// The sRGB colour of a value: 0 is blue, 0.5 is neutral, 1 is orange. Values outside [0, 1] are clamped;
/// NaN is magenta.
pub fn diverging(value: f32) -> [u8; 3] {
    if value.is_nan() {
        return NOT_A_NUMBER;
    }
    oklab_to_linear(ramp(value.clamp(0.0, 1.0))).map(|c| srgb::to_byte(srgb::encode(c)))
}

/// The Oklab colour (L, a, b) of a value in [0, 1].
fn ramp(value: f32) -> [f32; 3] {
    let offset = (2.0 * value - 1.0).abs();
    let hue = if value < 0.5 { BLUE_HUE } else { ORANGE_HUE };
    let (sin, cos) = hue.to_radians().sin_cos();
    let chroma = offset * END_CHROMA;
    let lightness = MIDDLE_LIGHTNESS + offset * (END_LIGHTNESS - MIDDLE_LIGHTNESS);
    [lightness, chroma * cos, chroma * sin]
}

/// Oklab to linear Rec.709 (Ottosson 2020, "Converting to linear sRGB").
fn oklab_to_linear([lightness, a, b]: [f32; 3]) -> [f32; 3] {
    let l = (lightness + 0.396_337_78 * a + 0.215_803_76 * b).powi(3);
    let m = (lightness - 0.105_561_346 * a - 0.063_854_17 * b).powi(3);
    let s = (lightness - 0.089_484_18 * a - 1.291_485_5 * b).powi(3);
    [
        4.076_741_7 * l - 3.307_711_6 * m + 0.230_969_94 * s,
        -1.268_438 * l + 2.609_757_4 * m - 0.341_319_38 * s,
        -0.004_196_086_3 * l - 0.703_418_6 * m + 1.707_614_7 * s,
    ]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;

    #[test]
    fn ends_are_blue_and_orange_and_the_middle_is_neutral() {
        let [r, g, b] = diverging(0.0);
        assert!(b > g && g > r, "blue: {r} {g} {b}");
        let [r, g, b] = diverging(1.0);
        assert!(r > g && g > b, "orange: {r} {g} {b}");
        let [r, g, b] = diverging(0.5);
        assert!(r.abs_diff(g) <= 1 && g.abs_diff(b) <= 1, "grey: {r} {g} {b}");
        assert_eq!(diverging(-3.0), diverging(0.0));
        assert_eq!(diverging(f32::INFINITY), diverging(1.0));
        assert_eq!(diverging(f32::NAN), NOT_A_NUMBER);
    }

    #[test]
    fn the_whole_ramp_is_inside_the_gamut() {
        for step in 0..=1000 {
            let colour = oklab_to_linear(ramp(step as f32 / 1000.0));
            assert!(colour.iter().all(|c| (0.0..=1.0).contains(c)), "{step}: {colour:?}");
        }
    }

    #[test]
    fn values_can_be_told_apart_and_both_sides_darken_alike() {
        let luma = |value: f32| -> f32 {
            let linear = oklab_to_linear(ramp(value));
            crate::image::luminance(linear)
        };
        for step in 0..50 {
            let (low, high) = (step as f32 / 100.0, 1.0 - step as f32 / 100.0);
            assert!(luma(low) < luma(low + 0.01) && luma(high) < luma(high - 0.01));
            assert!((luma(low) / luma(high) - 1.0).abs() < 0.15);
            assert_ne!(diverging(low), diverging(high));
        }
    }
}
