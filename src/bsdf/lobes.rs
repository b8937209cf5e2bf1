//! Choosing among lobes by one number, and what a mixture of two makes of them.

use super::{Evaluation, Letter, Scatter};
use crate::math::SolidAnglePdf;
use crate::spectrum::Spectrum;
use glam::DVec3;

/// Whether `u` chooses the first of two lobes, which has probability `first`, and what is left of `u`.
#[inline]
pub(super) fn choose(u: f64, first: f64) -> (bool, f64) {
    if u < first { (true, u / first) } else { (false, (u - first) / (1.0 - first)) }
}

/// The inverse of [`choose`].
#[inline]
pub(super) fn unchoose((is_first, rest): (bool, f64), first: f64) -> f64 {
    // Rounding must not carry the number over to the other lobe.
    if is_first { (rest * first).min(first.next_down()) } else { (first + rest * (1.0 - first)).min(1f64.next_down()) }
}

/// Which of two lobes has sampled a direction, drawn by `gamma` in proportion to their densities.
#[inline]
pub(super) fn guess(gamma: f64, first: f64, second: f64) -> (bool, f64) {
    choose(gamma, share(first, second))
}

/// Probability of the first of two lobes with these weights.
#[inline]
pub(super) fn share(first: f64, second: f64) -> f64 {
    if first > 0.0 { first / (first + second) } else { 0.0 }
}

/// Mean of the channels: how lobes are weighted against each other.
#[inline]
pub(super) fn mean(colour: Spectrum) -> f64 {
    let [r, g, b] = colour.to_rgb();
    (r + g + b) / 3.0
}

/// The letter of a specular-like and a diffuse-like share: that of the larger one.
#[inline]
pub(super) fn letter(specular: Spectrum, diffuse: Spectrum) -> Letter {
    if specular.luminance() > diffuse.luminance() { Letter::S } else { Letter::D }
}

/// The direction on the other side of the normal.
#[inline]
pub(super) fn mirrored(wi: DVec3) -> DVec3 {
    DVec3::new(-wi.x, -wi.y, wi.z)
}

/// Square of the distance of directions that are the same but for the rounding of the points that they connect.
pub(super) const SAME: f64 = 1e-10;

/// Whether two unit vectors are the same but for rounding.
#[inline]
pub(super) fn same(a: DVec3, b: DVec3) -> bool {
    a.distance_squared(b) < SAME
}

impl Evaluation {
    /// As part of a mixture: value and densities times these factors.
    #[inline]
    pub(super) fn scaled(self, value: Spectrum, pdf: f64, pdf_reverse: f64) -> Self {
        Self {
            value: self.value * value,
            pdf: SolidAnglePdf(self.pdf.0 * pdf),
            pdf_reverse: SolidAnglePdf(self.pdf_reverse.0 * pdf_reverse),
            letter: self.letter,
        }
    }

    /// The sum of two parts of a mixture; the larger one names it.
    #[inline]
    pub(super) fn sum(self, other: Self) -> Self {
        let larger = if self.value.luminance() >= other.value.luminance() { self.letter } else { other.letter };
        Self {
            value: self.value + other.value,
            pdf: SolidAnglePdf(self.pdf.0 + other.pdf.0),
            pdf_reverse: SolidAnglePdf(self.pdf_reverse.0 + other.pdf_reverse.0),
            letter: larger,
        }
    }
}

impl Scatter {
    /// A direction that lobes without Dirac densities have sampled, and how they evaluate there.
    #[inline]
    pub(super) fn of(direction: DVec3, evaluation: &Evaluation, eta: f64) -> Option<Self> {
        (evaluation.pdf.0 > 0.0).then(|| Self {
            direction,
            weight: evaluation.value * (direction.z.abs() / evaluation.pdf.0),
            pdf: evaluation.pdf,
            pdf_reverse: evaluation.pdf_reverse,
            delta: false,
            letter: evaluation.letter,
            eta,
        })
    }

    /// A direction by a delta lobe with these coefficients.
    #[inline]
    pub(super) fn delta(direction: DVec3, weight: Spectrum, pdf: f64, pdf_reverse: f64) -> Self {
        Self {
            direction,
            weight,
            pdf: SolidAnglePdf(pdf),
            pdf_reverse: SolidAnglePdf(pdf_reverse),
            delta: true,
            letter: Letter::S,
            eta: 1.0,
        }
    }

    /// As part of a mixture that chose it with these probabilities.
    #[inline]
    pub(super) fn chosen(self, probability: f64, reverse: f64) -> Self {
        Self {
            pdf: SolidAnglePdf(self.pdf.0 * probability),
            pdf_reverse: SolidAnglePdf(self.pdf_reverse.0 * reverse),
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_invert_at_the_edges() {
        for first in [1e-9, 0.3, 0.5, 1.0 - 1e-9] {
            for u in [0.0, 1e-17, 0.3, 0.5, 1f64.next_down()] {
                for is_first in [true, false] {
                    let (found, rest) = choose(unchoose((is_first, u), first), first);
                    assert!(found == is_first && (rest - u).abs() < 1e-6 && rest < 1.0, "{first} {u}");
                }
            }
        }
    }
}
