//! The radiance of the clear sky (Hosek and Wilkie 2012, *An Analytic Model for Full Spectral Sky-Dome Radiance*), for
//! red, green and blue. The coefficients are in a file of their own, with their licence beside it.

use crate::spectrum::Spectrum;
use std::f64::consts::FRAC_PI_2;
use std::sync::LazyLock;

/// Turbidities of the table.
const TURBIDITIES: usize = 10;
/// Control points of the sun's elevation.
const CONTROLS: usize = 6;
/// Coefficients of the radiance of a channel.
const COEFFICIENTS: usize = 9;
/// Entries for one channel of a table with one number for each control point.
const STATES: usize = 2 * TURBIDITIES * CONTROLS;
/// Integral of the eye's response over wavelength in nm, by which Mitsuba 3 divides; 0.6 divides by 106.857.
pub(super) const RESPONSE: f64 = 106.750_259;

static TABLE: LazyLock<Vec<f64>> = LazyLock::new(|| super::numbers(include_bytes!("hosek_wilkie_rgb.f32")));

/// The sky for one place of the sun.
pub(super) struct Dome {
    coefficients: [[f64; COEFFICIENTS]; 3],
    radiance: [f64; 3],
}

impl Dome {
    /// The sky for a `turbidity` from 1 to 10, the albedo of the ground, and the sun's `elevation` from 0 to π/2.
    pub fn new(turbidity: f64, albedo: Spectrum, elevation: f64) -> Self {
        let weights = albedo.to_rgb().map(|albedo| Weights::new(turbidity, albedo, elevation));
        let of = |channel: usize, first: usize, stride: usize| weights[channel].apply(first, stride);
        let channels = [0, 1, 2];
        Self {
            coefficients: channels.map(|channel| {
                let first = channel * STATES * COEFFICIENTS;
                std::array::from_fn(|k| of(channel, first + k, COEFFICIENTS))
            }),
            radiance: channels.map(|channel| of(channel, (3 * COEFFICIENTS + channel) * STATES, 1)),
        }
    }

    /// Radiance from a direction whose cosine with the zenith is `cos`, at the angle `gamma` to the sun.
    pub fn radiance(&self, cos: f64, gamma: f64) -> Spectrum {
        let channel = |i: usize| {
            let [a, b, c, d, e, f, g, i_, h] = self.coefficients[i];
            let near = gamma.cos();
            let halo = (1.0 + near * near) / (1.0 + h * h - 2.0 * h * near).powf(1.5);
            let horizon = 1.0 + a * (b / (cos + 0.01)).exp();
            let shape = c + d * (e * gamma).exp() + f * near * near + g * halo + i_ * cos.max(0.0).sqrt();
            (horizon * shape * self.radiance[i] / RESPONSE).max(0.0)
        };
        Spectrum::rgb(channel(0), channel(1), channel(2))
    }
}

/// Weights of the table's entries: linear in albedo and turbidity, a Bézier curve of fifth degree over the elevation.
struct Weights {
    albedo: f64,
    turbidity: (usize, f64),
    elevation: [f64; CONTROLS],
}

impl Weights {
    fn new(turbidity: f64, albedo: f64, elevation: f64) -> Self {
        let low = (turbidity as usize).clamp(1, TURBIDITIES - 1);
        // The control points are evenly spread over the cube root of the elevation.
        let x = (elevation / FRAC_PI_2).clamp(0.0, 1.0).cbrt();
        let binomials = [1.0, 5.0, 10.0, 10.0, 5.0, 1.0];
        let bezier = |i: usize| binomials[i] * x.powi(i as i32) * (1.0 - x).powi((CONTROLS - 1 - i) as i32);
        Self { albedo, turbidity: (low - 1, turbidity - low as f64), elevation: std::array::from_fn(bezier) }
    }

    /// The weighted sum of the entries at `first` and every `stride` after it.
    fn apply(&self, first: usize, stride: usize) -> f64 {
        let curve = |state: usize| {
            let entry = |i: usize| TABLE[first + (state * CONTROLS + i) * stride] * self.elevation[i];
            (0..CONTROLS).map(entry).sum::<f64>()
        };
        let (low, share) = self.turbidity;
        let ground = |albedo: usize| {
            let state = albedo * TURBIDITIES + low;
            curve(state) * (1.0 - share) + curve(state + 1) * share
        };
        ground(0) * (1.0 - self.albedo) + ground(1) * self.albedo
    }
}
