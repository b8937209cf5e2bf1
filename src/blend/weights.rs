//! The optimal blending weight of a pixel (Otsu thesis, section 5.3.2).

/// [`Quotient::weight`] is kept within 0.5 ± this. Where the two images nearly agree the quotient is huge, of either
/// sign, and tells nothing; the bound is symmetric about 0.5 and so does not favour either image.
pub const QUOTIENT_BOUND: f32 = 10.0;

/// The least-squares weight of a pixel and what is at stake there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quotient {
    /// Σ_c (I−I_b)(I_a−I_b) / Σ_c (I_a−I_b)², not yet clamped to [0, 1].
    pub weight: f32,
    /// Σ_c (I_a−I_b)², > 0.
    pub stake: f64,
}

impl Quotient {
    /// The optimal weight of the first image, argmin over [0, 1] of Σ_c |w I_a + (1−w) I_b − I|² (thesis eq. 5.6, 5.7,
    /// there for one channel).
    pub fn clamped(self) -> f32 {
        self.weight.clamp(0.0, 1.0)
    }
}

/// Optimal weight of image a at a pixel, given its colour in images a and b and in the reference.
///
/// The blend's squared error there is stake · (w − weight)² + a constant, for any w: that is why a regression of the
/// weight with the stake as row weight minimises the blended image's error.
/// `None` where the images agree, so that any weight is as good, or where a value is not finite.
pub fn quotient(a: [f32; 3], b: [f32; 3], reference: [f32; 3]) -> Option<Quotient> {
    let (mut along, mut stake) = (0.0f64, 0.0f64);
    for c in 0..3 {
        let (a, b, reference) = (f64::from(a[c]), f64::from(b[c]), f64::from(reference[c]));
        along += (reference - b) * (a - b);
        stake += (a - b) * (a - b);
    }
    if !(along.is_finite() && stake.is_finite() && stake > 0.0) {
        return None;
    }
    let bound = f64::from(QUOTIENT_BOUND);
    Some(Quotient { weight: (along / stake).clamp(0.5 - bound, 0.5 + bound) as f32, stake })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;
    use proptest::prelude::*;

    fn error(w: f32, a: [f32; 3], b: [f32; 3], reference: [f32; 3]) -> f64 {
        (0..3).map(|c| f64::from(w * a[c] + (1.0 - w) * b[c] - reference[c]).powi(2)).sum()
    }

    #[test]
    fn known_pixels() {
        let grey = |v: f32| [v; 3];
        assert_eq!(quotient(grey(1.0), grey(3.0), grey(2.5)).unwrap().clamped(), 0.25);
        assert_eq!(quotient(grey(1.0), grey(2.0), grey(0.5)).unwrap().clamped(), 1.0);
        assert_eq!(quotient(grey(1.0), grey(2.0), grey(9.0)).unwrap().clamped(), 0.0);
        assert_eq!(quotient(grey(1.0), grey(1.0), grey(9.0)), None);
        assert_eq!(quotient(grey(f32::NAN), grey(1.0), grey(9.0)), None);
        assert_eq!(quotient(grey(1.0), grey(f32::INFINITY), grey(9.0)), None);
    }

    proptest! {
        #[test]
        fn never_worse_than_the_average_or_any_other_weight(
            a in prop::array::uniform3(0f32..4.0), b in prop::array::uniform3(0f32..4.0),
            reference in prop::array::uniform3(0f32..4.0), other in 0f32..=1.0) {
            if let Some(best) = quotient(a, b, reference) {
                let least = error(best.clamped(), a, b, reference);
                prop_assert!((0.0..=1.0).contains(&best.clamped()));
                prop_assert!(least <= error(0.5, a, b, reference) + 1e-5);
                prop_assert!(least <= error(other, a, b, reference) + 1e-5);
            }
        }
    }
}
