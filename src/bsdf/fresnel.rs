//! Fresnel reflectances of smooth boundaries, unpolarised.

use crate::spectrum::Spectrum;

/// Reflectance of a dielectric boundary and, where light passes, the cosine on the far side (positive).
/// `cos_i` is the positive cosine of incidence, `eta` the refractive index of the far side over that of the near side.
#[inline]
pub fn dielectric(cos_i: f64, eta: f64) -> (f64, Option<f64>) {
    let sin2_t = (1.0 - cos_i * cos_i) / (eta * eta);
    if sin2_t >= 1.0 {
        return (1.0, None);
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    (0.5 * (parallel * parallel + perpendicular * perpendicular), Some(cos_t))
}

/// Reflectance of a dielectric boundary for diffuse light, by the fits of Egan and Hilgeman (1973) for `eta` < 1 and
/// of d'Eon and Irving (2011) for others: as Mitsuba has it.
pub fn diffuse_reflectance(eta: f64) -> f64 {
    let over = 1.0 / eta;
    if eta < 1.0 {
        return 0.0636 * over + 0.6681 + eta * (0.7099 - 1.4399 * eta);
    }
    const TERMS: [f64; 6] = [-1.36881, 4.98554, -7.80989, 6.75335, -3.4793, 0.919317];
    TERMS.iter().fold(0.0, |sum, term| sum * over + term)
}

/// Reflectance of a metal with complex refractive index `eta` + i `k`, relative to the medium outside.
#[inline]
pub fn conductor(cos_i: f64, eta: Spectrum, k: Spectrum) -> Spectrum {
    let [er, eg, eb] = eta.to_rgb();
    let [kr, kg, kb] = k.to_rgb();
    Spectrum::rgb(conductor_channel(cos_i, er, kr), conductor_channel(cos_i, eg, kg), conductor_channel(cos_i, eb, kb))
}

/// One channel of [`conductor`] (Born and Wolf, *Principles of Optics*, section 14.2, in real arithmetic).
fn conductor_channel(cos_i: f64, eta: f64, k: f64) -> f64 {
    let cos2 = cos_i * cos_i;
    let sin2 = 1.0 - cos2;
    let t0 = eta * eta - k * k - sin2;
    let a2_plus_b2 = (t0 * t0 + 4.0 * eta * eta * k * k).sqrt();
    let a = (0.5 * (a2_plus_b2 + t0)).max(0.0).sqrt();
    let rs = (a2_plus_b2 + cos2 - 2.0 * a * cos_i) / (a2_plus_b2 + cos2 + 2.0 * a * cos_i);
    let t3 = cos2 * a2_plus_b2 + sin2 * sin2;
    let t4 = 2.0 * a * cos_i * sin2;
    // Nothing over nothing where the light comes straight and η = k = 0.
    let rp = if t3 + t4 > 0.0 { rs * (t3 - t4) / (t3 + t4) } else { rs };
    0.5 * (rs + rp)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used)]
    use super::*;

    #[test]
    fn normal_incidence_has_the_textbook_values() {
        assert!((dielectric(1.0, 1.5).0 - 0.04).abs() < 1e-12);
        let copper = conductor(1.0, Spectrum::grey(0.2), Spectrum::grey(3.0)).to_rgb()[0];
        let expected = ((0.2f64 - 1.0).powi(2) + 9.0) / ((0.2f64 + 1.0).powi(2) + 9.0);
        assert!((copper - expected).abs() < 1e-12);
    }

    #[test]
    fn brewster_angle_and_total_reflection() {
        let brewster = 1.5f64.atan();
        let (reflectance, cos_t) = dielectric(brewster.cos(), 1.5);
        let perpendicular =
            (brewster.cos() - 1.5 * cos_t.expect("passes")) / (brewster.cos() + 1.5 * cos_t.expect("passes"));
        assert!((reflectance - 0.5 * perpendicular * perpendicular).abs() < 1e-12);
        assert_eq!(dielectric(0.1, 1.0 / 1.5), (1.0, None));
    }
}
