//! The sRGB transfer curve and 8-bit pictures (IEC 61966-2-1).

use ndarray::ArrayView3;

/// The sRGB code value in [0, 1] of a linear value; values outside [0, 1] are clamped and NaN becomes 0.
pub fn encode(linear: f32) -> f32 {
    // `max` gives 0 for NaN, where `clamp` alone would keep it.
    let clamped = linear.max(0.0).clamp(0.0, 1.0);
    if clamped <= 0.003_130_8 { 12.92 * clamped } else { 1.055 * clamped.powf(1.0 / 2.4) - 0.055 }
}

/// A code value in [0, 1] as a byte, rounded.
pub(super) fn to_byte(code: f32) -> u8 {
    (code * 255.0).round() as u8
}

/// A height × width × 3 picture of linear values as sRGB bytes, row by row from the top, after an exposure
/// in EV: each step doubles the values. Values outside [0, 1] are clamped; NaN becomes black.
pub fn to_srgb8(colour: ArrayView3<'_, f32>, exposure_ev: f32) -> Vec<u8> {
    let scale = exposure_ev.exp2();
    colour.iter().map(|&c| to_byte(encode(c * scale))).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;
    use ndarray::arr3;

    /// The inverse as the standard states it, so that the round trip checks both branches.
    fn decode(code: f64) -> f64 {
        if code <= 0.04045 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
    }

    #[test]
    fn every_byte_survives_the_round_trip() {
        for byte in 0..=255u8 {
            let linear = decode(f64::from(byte) / 255.0) as f32;
            assert_eq!(to_byte(encode(linear)), byte);
        }
    }

    #[test]
    fn exposure_doubles_and_odd_values_clamp() {
        let view = arr3(&[[[0.25, f32::NAN, f32::INFINITY], [-1.0, 2.0, 0.5]]]);
        let bytes = to_srgb8(view.view(), 1.0);
        assert_eq!(bytes, [188, 0, 255, 0, 255, 255]);
    }
}
