//! Slopes of a Beckmann surface with α = 1 that a direction sees (Jakob 2014, *An Improved Visible Normal Sampling
//! Routine for the Beckmann Distribution*). In the plane of the direction a slope x has the density
//! (cos θ − x sin θ) exp(−x²) / √π over the projected area, across it a Gaussian one; both have closed distribution
//! functions. They are inverted to rounding, so that the density is exact.

use glam::{DVec2, DVec3};
use libm::erfc;
use std::f64::consts::FRAC_2_SQRT_PI;

/// Slopes further out have less probability than the smallest number that is drawn.
const STEEPEST: f64 = 9.0;

/// More steps than bisection to rounding takes.
const STEPS: usize = 80;

/// What a direction sees.
pub(super) struct Slopes {
    cos: f64,
    sin: f64,
    /// Unit vector of the direction in the plane.
    towards: DVec2,
}

impl Slopes {
    /// For `stretched`, of any length, above the horizon.
    #[inline]
    pub fn of(stretched: DVec3) -> Self {
        let w = stretched.normalize();
        let flat = w.truncate();
        Self { cos: w.z, sin: flat.length(), towards: flat.normalize_or(DVec2::X) }
    }

    /// Slope whose facets are seen edge on.
    fn steepest(&self) -> f64 {
        if self.cos < STEEPEST * self.sin { self.cos / self.sin } else { STEEPEST }
    }

    /// Projected area of the facets with slopes up to `x`.
    #[inline]
    fn up_to(&self, x: f64) -> f64 {
        0.5 * self.cos * erfc(-x) + 0.25 * FRAC_2_SQRT_PI * self.sin * (-x * x).exp()
    }

    /// Projected area of all facets that are seen: cos θ over the shadowing.
    #[inline]
    pub fn area(&self) -> f64 {
        self.up_to(self.steepest())
    }

    /// Slopes along the two tangents.
    pub fn sample(&self, u: [f64; 2]) -> DVec2 {
        self.towards * self.along(u[0]) + self.towards.perp() * gaussian(u[1])
    }

    /// Slope in the plane of the direction.
    pub fn along(&self, u: f64) -> f64 {
        let target = u * self.area();
        let (mut low, mut high) = (-STEEPEST, self.steepest());
        let mut x = 0f64.clamp(low, high);
        for _ in 0..STEPS {
            let excess = self.up_to(x) - target;
            if excess > 0.0 {
                high = x
            } else {
                low = x
            }
            let slope = 0.5 * FRAC_2_SQRT_PI * (self.cos - x * self.sin) * (-x * x).exp();
            let newton = x - excess / slope;
            // Where Newton's step leaves the bracket, half of the bracket.
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            let step = (next - x).abs();
            x = next;
            if step <= 1e-15 * (1.0 + x.abs()) {
                break;
            }
        }
        x
    }

    /// The inverse of [`Slopes::sample`].
    pub fn invert(&self, slope: DVec2) -> [f64; 2] {
        let (along, across) = (slope.dot(self.towards), slope.dot(self.towards.perp()));
        [(self.up_to(along) / self.area()).min(1.0), 0.5 * erfc(-across)]
    }
}

/// The x at which (1 + erf x) / 2 = `u`: a start by Giles 2010, *Approximating the erfinv function*, whose seven digits
/// hold up to tails of 10⁻⁷, and Halley's method from there.
pub(super) fn gaussian(u: f64) -> f64 {
    let u = u.clamp(f64::EPSILON * 0.25, 1.0 - f64::EPSILON * 0.5);
    let w = -(4.0 * u * (1.0 - u)).ln();
    let (t, terms) = if w < 5.0 { (w - 2.5, &CENTRE) } else { (w.min(16.0).sqrt() - 3.0, &TAIL) };
    let mut x = (2.0 * u - 1.0) * terms.iter().fold(0.0, |sum, term| sum * t + term);
    for _ in 0..STEPS {
        // The smaller of the two tails keeps its digits.
        let excess = if u < 0.5 { 0.5 * erfc(-x) - u } else { (1.0 - u) - 0.5 * erfc(x) };
        let newton = excess / (0.5 * FRAC_2_SQRT_PI * (-x * x).exp());
        let step = newton / (1.0 + x * newton);
        x -= step;
        if step.abs() <= 1e-6 {
            break;
        }
    }
    x
}

const CENTRE: [f64; 9] = [
    2.810_226_36e-8,
    3.432_739_39e-7,
    -3.523_387_7e-6,
    -4.391_506_54e-6,
    0.000_218_580_87,
    -0.001_253_725_03,
    -0.004_177_681_64,
    0.246_640_727,
    1.501_409_41,
];

const TAIL: [f64; 9] = [
    -0.000_200_214_257,
    0.000_100_950_558,
    0.001_349_343_22,
    -0.003_673_428_44,
    0.005_739_507_73,
    -0.007_622_461_3,
    0.009_438_870_47,
    1.001_674_06,
    2.832_976_82,
];

#[cfg(test)]
mod tests {
    use super::*;
    use libm::erf;

    #[test]
    fn the_gaussian_inverts_to_rounding() {
        for i in 1..10_000 {
            let u = f64::from(i) / 10_000.0;
            assert!((0.5 * (1.0 + erf(gaussian(u))) - u).abs() < 2e-15, "{u}");
        }
        for u in [0.0, 1e-12, 1.0 - 1e-12] {
            assert!((0.5 * erfc(-gaussian(u)) - u).abs() < 1e-16 + 1e-12 * u.min(1.0 - u), "{u}");
        }
    }

    #[test]
    fn slopes_invert_at_every_angle() {
        for cos in [1f64, 0.999, 0.7, 0.1, 1e-3, 1e-6] {
            let slopes = Slopes::of(DVec3::new((1.0 - cos * cos).sqrt(), 0.0, cos));
            for i in 0..1000 {
                let u = [(f64::from(i) + 0.5) / 1000.0, 0.3];
                let back = slopes.invert(slopes.sample(u));
                assert!((back[0] - u[0]).abs() < 1e-12 && (back[1] - u[1]).abs() < 1e-12, "{cos} {u:?} {back:?}");
            }
        }
    }
}
