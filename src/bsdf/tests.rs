//! Every model against every law.

#![allow(clippy::expect_used)]

use super::*;
use crate::math::{Stream, warp};

const UV: DVec2 = DVec2::new(0.3, 0.7);

/// The models under test; a new variant joins by one line.
fn models() -> Vec<(&'static str, Bsdf)> {
    let gold = Conductor {
        index: Some((Spectrum::rgb(0.14, 0.37, 1.44), Spectrum::rgb(3.98, 2.39, 1.6))),
        specular_reflectance: Spectrum::ONE,
    };
    let mirror = Conductor { index: None, specular_reflectance: Spectrum::ONE };
    let rough = |metal, distribution, alpha| {
        Bsdf::RoughConductor(RoughConductor { metal, microfacet: Microfacet { distribution, alpha } })
    };
    let diffuse = Bsdf::Diffuse(Diffuse { reflectance: Spectrum::rgb(0.2, 0.5, 0.9).into() });
    vec![
        ("diffuse", diffuse.clone()),
        ("conductor", Bsdf::Conductor(gold)),
        (
            "dielectric",
            Bsdf::Dielectric(Dielectric {
                eta: 1.5,
                specular_reflectance: Spectrum::ONE,
                specular_transmittance: Spectrum::ONE,
            }),
        ),
        ("ggx 0.05", rough(mirror, Distribution::Ggx, 0.05)),
        ("ggx 0.4", rough(gold, Distribution::Ggx, 0.4)),
        ("beckmann 0.3", rough(mirror, Distribution::Beckmann, 0.3)),
        ("two-sided", Bsdf::TwoSided(Box::new([diffuse, rough(gold, Distribution::Ggx, 0.2)]))),
    ]
}

fn incident(stream: &mut Stream) -> DVec3 {
    loop {
        let w = warp::sphere::sample([stream.number(), stream.number()]);
        if w.z.abs() > 0.02 {
            return w;
        }
    }
}

#[test]
fn sampling_agrees_with_evaluation() {
    for (name, bsdf) in models() {
        let mut stream = Stream::new(3, &[]);
        for _ in 0..20_000 {
            let wi = incident(&mut stream);
            let Some(scatter) = bsdf.sample(UV, wi, stream.row(), Walk::FromLight) else { continue };
            assert!((scatter.direction.length() - 1.0).abs() < 1e-9, "{name}");
            let evaluation = bsdf.evaluate(UV, wi, scatter.direction, Walk::FromLight);
            assert_eq!(evaluation.is_none(), scatter.delta, "{name}");
            let Some(evaluation) = evaluation else { continue };
            let weight = evaluation.value * (scatter.direction.z.abs() / evaluation.pdf.0);
            for (a, b) in weight.to_rgb().into_iter().zip(scatter.weight.to_rgb()) {
                assert!((a - b).abs() < 1e-9 * b.max(1.0), "{name}: {a} {b}");
            }
            let back = bsdf.evaluate(UV, scatter.direction, wi, Walk::FromLight).expect("the way back exists");
            assert!((back.pdf.0 - evaluation.pdf_reverse.0).abs() <= 1e-9 * back.pdf.0, "{name}");
            for (a, b) in back.value.to_rgb().into_iter().zip(evaluation.value.to_rgb()) {
                assert!((a - b).abs() <= 1e-9 * b, "{name} is not reciprocal: {a} {b}");
            }
        }
    }
}

#[test]
fn rows_invert() {
    for (name, bsdf) in models() {
        let mut stream = Stream::new(5, &[]);
        for _ in 0..20_000 {
            let wi = incident(&mut stream);
            let row = stream.row();
            let Some(scatter) = bsdf.sample(UV, wi, row, Walk::FromCamera) else { continue };
            let back = bsdf
                .invert(UV, wi, scatter.direction, scatter.delta, stream.row())
                .expect("a sampled direction inverts");
            if !scatter.delta {
                assert!((back[1] - row[1]).abs() < 1e-6 && (back[2] - row[2]).abs() < 1e-6, "{name}: {row:?} {back:?}");
            }
            let again = bsdf.sample(UV, wi, back, Walk::FromCamera).expect("the inverse samples");
            assert!((again.direction - scatter.direction).length() < 1e-7, "{name}");
        }
    }
}

/// ∫ f cos over the sphere of outgoing directions, by uniform directions and by the model's own samples.
#[test]
fn sampled_and_uniform_albedo_agree_and_conserve_energy() {
    for (name, bsdf) in models() {
        let mut stream = Stream::new(9, &[]);
        for wi in [DVec3::new(0.3, 0.1, 0.9).normalize(), DVec3::new(0.5, -0.7, -0.4).normalize()] {
            let n = 200_000;
            let (mut sampled, mut uniform) = (Moments::default(), Moments::default());
            for _ in 0..n {
                let scatter = bsdf.sample(UV, wi, stream.row(), Walk::FromLight);
                sampled.push(scatter.filter(|s| !s.delta).map_or(0.0, |s| s.weight.luminance()));
                let wo = warp::sphere::sample([stream.number(), stream.number()]);
                let value = bsdf.evaluate(UV, wi, wo, Walk::FromLight).map_or(0.0, |e| e.value.luminance());
                uniform.push(value * wo.z.abs() / warp::sphere::PDF.0);
            }
            let error = (sampled.variance_of_mean() + uniform.variance_of_mean()).sqrt();
            assert!((sampled.mean() - uniform.mean()).abs() < 4.5 * error + 1e-12, "{name} from {wi}");
            assert!(sampled.mean() <= 1.0 + 4.5 * error, "{name} makes energy");
        }
    }
}

#[test]
fn refraction_squeezes_radiance_only() {
    let glass = Bsdf::Dielectric(Dielectric {
        eta: 1.5,
        specular_reflectance: Spectrum::ONE,
        specular_transmittance: Spectrum::ONE,
    });
    let weight = |walk| glass.sample(UV, DVec3::Z, [0.5; 4], walk).expect("passes").weight.to_rgb()[0];
    assert!((weight(Walk::FromCamera) - 1.0 / 2.25).abs() < 1e-12);
    assert!((weight(Walk::FromLight) - 1.0).abs() < 1e-12);
}

#[derive(Default)]
struct Moments {
    n: f64,
    sum: f64,
    squares: f64,
}

impl Moments {
    fn push(&mut self, x: f64) {
        self.n += 1.0;
        self.sum += x;
        self.squares += x * x;
    }
    fn mean(&self) -> f64 {
        self.sum / self.n
    }
    fn variance_of_mean(&self) -> f64 {
        (self.squares / self.n - self.mean().powi(2)) / self.n
    }
}
