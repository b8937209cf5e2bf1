//! The sun through the air (Preetham, Shirley and Smits 1999, *A Practical Analytic Model for Daylight*, appendix 2),
//! which is Mitsuba 0.6's model. Mitsuba 3's sun is another one.

use crate::spectrum::Spectrum;

/// First and last wavelength of the sun's spectrum, and the step between, in nm.
const RANGE: [f64; 2] = [380.0, 750.0];
const STEP: f64 = 10.0;

/// Radiance of the sun before the air, in W/(m² sr nm).
const SUN: [f64; 38] = [
    16559.0, 16233.7, 21127.5, 25888.2, 25829.1, 24232.3, 26760.5, 29658.3, 30545.4, 30057.5, 30663.7, 28830.4,
    28712.1, 27825.0, 27100.6, 27233.6, 26361.3, 25503.8, 25060.2, 25311.6, 25355.9, 25134.2, 24631.5, 24173.2,
    23685.3, 23212.1, 22827.7, 22339.8, 21970.2, 21526.7, 21097.9, 20728.3, 20240.4, 19870.8, 19427.2, 19072.4,
    18628.9, 18259.2,
];

/// Absorption by ozone in 1/cm: wavelength and coefficient.
const OZONE: [(f64, f64); 54] = [
    (355.0, 0.0),
    (445.0, 0.003),
    (450.0, 0.003),
    (455.0, 0.004),
    (460.0, 0.006),
    (465.0, 0.008),
    (470.0, 0.009),
    (475.0, 0.012),
    (480.0, 0.014),
    (485.0, 0.017),
    (490.0, 0.021),
    (495.0, 0.025),
    (500.0, 0.03),
    (505.0, 0.035),
    (510.0, 0.04),
    (515.0, 0.045),
    (520.0, 0.048),
    (525.0, 0.057),
    (530.0, 0.063),
    (535.0, 0.07),
    (540.0, 0.075),
    (545.0, 0.08),
    (550.0, 0.085),
    (555.0, 0.095),
    (560.0, 0.103),
    (565.0, 0.11),
    (570.0, 0.12),
    (575.0, 0.122),
    (580.0, 0.12),
    (585.0, 0.118),
    (590.0, 0.115),
    (595.0, 0.12),
    (600.0, 0.125),
    (605.0, 0.13),
    (610.0, 0.12),
    (620.0, 0.105),
    (630.0, 0.09),
    (640.0, 0.079),
    (650.0, 0.067),
    (660.0, 0.057),
    (670.0, 0.048),
    (680.0, 0.036),
    (690.0, 0.028),
    (700.0, 0.023),
    (710.0, 0.018),
    (720.0, 0.014),
    (730.0, 0.011),
    (740.0, 0.01),
    (750.0, 0.009),
    (760.0, 0.007),
    (770.0, 0.004),
    (780.0, 0.0),
    (790.0, 0.0),
    (800.0, 0.0),
];

/// Absorption by water vapour.
const VAPOUR: [(f64, f64); 8] = [
    (689.0, 0.0),
    (690.0, 0.016),
    (700.0, 0.024),
    (710.0, 0.0125),
    (720.0, 1.0),
    (730.0, 0.87),
    (740.0, 0.061),
    (750.0, 0.001),
];

/// Radiance of the sun at the angle `zenith` to the zenith, where `turbidity` says how hazy the air is.
pub(super) fn radiance(zenith: f64, turbidity: f64) -> Spectrum {
    let count = ((RANGE[1] - RANGE[0]) / NARROW) as usize;
    let middles = (0..count).map(|i| RANGE[0] + (i as f64 + 0.5) * NARROW);
    let mut xyz = [0.0; 3];
    for wavelength in middles {
        let arriving = before_the_air(wavelength) * transmittance(wavelength, zenith, turbidity);
        for (sum, response) in xyz.iter_mut().zip(responses(wavelength)) {
            *sum += arriving * response * NARROW / RESPONSE;
        }
    }
    let [x, y, z] = xyz;
    Spectrum::rgb(
        3.240_479 * x - 1.537_150 * y - 0.498_535 * z,
        -0.969_256 * x + 1.875_991 * y + 0.041_556 * z,
        0.055_648 * x - 0.204_043 * y + 1.057_311 * z,
    )
    .map(|channel| channel.max(0.0))
}

/// Width of the steps of the integral over wavelength in nm.
const NARROW: f64 = 1.0;

/// Integral of the second of [`responses`].
const RESPONSE: f64 = 106.857;

fn before_the_air(wavelength: f64) -> f64 {
    let place = (wavelength - RANGE[0]) / STEP;
    let low = (place as usize).min(SUN.len() - 2);
    let share = place - low as f64;
    SUN[low] * (1.0 - share) + SUN[low + 1] * share
}

/// A piecewise linear curve, zero outside of its points.
fn curve(points: &[(f64, f64)], wavelength: f64) -> f64 {
    let after = points.partition_point(|(at, _)| *at <= wavelength);
    let (Some((a, low)), Some((b, high))) = (points.get(after.wrapping_sub(1)), points.get(after)) else {
        return 0.0;
    };
    low + (high - low) * (wavelength - a) / (b - a)
}

/// What the air lets through: Rayleigh scattering, aerosols, ozone (0.35 cm) and water vapour (2 cm). Mixed gases absorb
/// beyond the range only.
fn transmittance(wavelength: f64, zenith: f64, turbidity: f64) -> f64 {
    let mass = 1.0 / (zenith.cos() + 0.15 * (93.885 - zenith.to_degrees()).powf(-1.253));
    let beta = 0.046_083_658_220_50 * turbidity - 0.045_860_259_285_22;
    let micrometres = wavelength / 1000.0;
    let rayleigh = 0.008_735 * micrometres.powf(-4.08);
    let aerosols = beta * micrometres.powf(-1.3);
    let ozone = 0.35 * curve(&OZONE, wavelength);
    let vapour = 2.0 * curve(&VAPOUR, wavelength) * mass;
    (-mass * (rayleigh + aerosols + ozone) - 0.2385 * vapour / (1.0 + 20.07 * vapour).powf(0.45)).exp()
}

/// The CIE 1931 colour matching functions, fitted (Wyman, Sloan and Shirley 2013).
fn responses(wavelength: f64) -> [f64; 3] {
    let lobe = |height: f64, middle: f64, below: f64, above: f64| {
        let distance = (wavelength - middle) * if wavelength < middle { below } else { above };
        height * (-0.5 * distance * distance).exp()
    };
    [
        lobe(0.362, 442.0, 0.0624, 0.0374) + lobe(1.056, 599.8, 0.0264, 0.0323) - lobe(0.065, 501.1, 0.0490, 0.0382),
        lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322),
        lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725),
    ]
}
