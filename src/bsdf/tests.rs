//! Every model against every law.

#![allow(clippy::expect_used)]

mod chi_square;
mod models;

use super::*;
use crate::math::{Stream, warp};
use models::{Case, cases};

/// The models of these tests are the same everywhere.
fn here() -> Site {
    Site::default()
}

/// Directions over the whole sphere, but for those along the surface.
fn incident(stream: &mut Stream) -> DVec3 {
    loop {
        let w = warp::sphere::sample([stream.number(), stream.number()]);
        if w.z.abs() > 0.02 {
            return w;
        }
    }
}

fn other(walk: Walk) -> Walk {
    if walk == Walk::FromLight { Walk::FromCamera } else { Walk::FromLight }
}

fn assert_close(name: &str, what: &str, a: Spectrum, b: Spectrum) {
    for (a, b) in a.to_rgb().into_iter().zip(b.to_rgb()) {
        assert!((a - b).abs() <= 1e-8 * a.abs().max(b.abs()) + 1e-13, "{name}: {what}: {a} {b}");
    }
}

/// Runs `law` on samples of every model from both ends of a path.
fn for_samples(seed: u64, n: usize, mut law: impl FnMut(&Case, DVec3, Row, &Scatter, Walk, &mut Stream)) {
    for case in cases() {
        let mut stream = Stream::new(seed, &[]);
        for i in 0..n {
            let (wi, row) = (incident(&mut stream), stream.row());
            let walk = if i % 2 == 0 { Walk::FromLight } else { Walk::FromCamera };
            if let Some(scatter) = case.bsdf.sample(&here(), wi, row, walk) {
                law(&case, wi, row, &scatter, walk, &mut stream);
            }
        }
    }
}

#[test]
fn sampling_agrees_with_evaluation() {
    for_samples(3, 3000, |case, wi, _, scatter, walk, _| {
        let name = &case.name;
        assert!((scatter.direction.length() - 1.0).abs() < 1e-9, "{name}");
        let has = if scatter.delta { case.bsdf.has_delta(wi) } else { !case.bsdf.is_delta(wi) };
        assert!(has, "{name}: a lobe that the model says it lacks");
        if scatter.delta {
            assert_eq!(scatter.letter, Letter::S);
            return;
        }
        let evaluation = case.bsdf.evaluate(&here(), wi, scatter.direction, walk).expect("what is sampled evaluates");
        let weight = evaluation.value * (scatter.direction.z.abs() / evaluation.pdf.0);
        assert_close(name, "weight", weight, scatter.weight);
        assert_close(name, "density", Spectrum::grey(evaluation.pdf.0), Spectrum::grey(scatter.pdf.0));
        assert_eq!(evaluation.letter, scatter.letter, "{name}");
        let refracts = wi.z * scatter.direction.z < 0.0;
        assert!(refracts || scatter.eta == 1.0, "{name}");
    });
}

/// Veach 1997, section 5.2: for one and the same path both walks have the same value; densities and letters are those
/// of the way back.
#[test]
fn walks_are_adjoint() {
    for_samples(4, 3000, |case, wi, _, scatter, walk, _| {
        let (name, wo) = (&case.name, scatter.direction);
        if scatter.delta || wo.z == 0.0 {
            return;
        }
        let there = case.bsdf.evaluate(&here(), wi, wo, walk).expect("what is sampled evaluates");
        let back = case.bsdf.evaluate(&here(), wo, wi, other(walk)).expect("the way back exists");
        assert_close(name, "adjoint", there.value, back.value);
        assert_close(name, "reverse", Spectrum::grey(there.pdf_reverse.0), Spectrum::grey(back.pdf.0));
        assert_close(name, "forward", Spectrum::grey(there.pdf.0), Spectrum::grey(back.pdf_reverse.0));
        for walk in [Walk::FromCamera, Walk::FromLight] {
            let letter = |a, b| case.bsdf.evaluate(&here(), a, b, walk).map(|evaluation| evaluation.letter);
            assert_eq!((letter(wi, wo), letter(wo, wi)), (Some(there.letter), Some(there.letter)), "{name}");
        }
    });
}

/// The same for the coefficients of Dirac densities: δ(ω_i − T⁻¹ω_o) = δ(ω_o − Tω_i) dω_o / dω_i.
#[test]
fn delta_lobes_are_adjoint() {
    for_samples(6, 2000, |case, wi, _, scatter, walk, stream| {
        let (name, wo) = (&case.name, scatter.direction);
        if !scatter.delta || wo.z.abs() < 1e-6 {
            return;
        }
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-8 * a.abs().max(b.abs()) + 1e-13;
        let mut agrees = |_: usize| {
            let row = case.bsdf.invert(&here(), wo, wi, true, stream.row()).expect("the way back inverts");
            let back = case.bsdf.sample(&here(), wo, row, other(walk)).expect("the way back exists");
            assert!(back.delta && (back.direction - wi).length() < 1e-7, "{name}");
            let there = (scatter.weight * (scatter.pdf.0 / wo.z.abs())).to_rgb();
            let again = (back.weight * (scatter.pdf_reverse.0 / wi.z.abs())).to_rgb();
            there.iter().zip(again).all(|(a, b)| near(*a, b))
                && near(scatter.pdf.0 * back.pdf.0, scatter.pdf_reverse.0 * back.pdf_reverse.0)
        };
        // Where two lobes lead back, the inverse may be that of the other one.
        assert!((0..100).any(&mut agrees), "{name} from {wi} to {wo}");
    });
}

#[test]
fn rows_invert() {
    for_samples(5, 3000, |case, wi, row, scatter, walk, stream| {
        let (name, wo) = (&case.name, scatter.direction);
        let back = case.bsdf.invert(&here(), wi, wo, scatter.delta, stream.row()).expect("a sampled direction inverts");
        assert!(back.iter().all(|number| (0.0..=1.0).contains(number)), "{name}: {back:?}");
        if !scatter.delta && !case.mixes {
            let near = |i: usize| (back[i] - row[i]).abs() < 1e-6;
            assert!(near(1) && near(2), "{name}: {row:?} {back:?}");
        }
        let again = case.bsdf.sample(&here(), wi, back, walk).expect("the inverse samples");
        assert_eq!(again.delta, scatter.delta, "{name}");
        assert!((again.direction - wo).length() < 1e-6, "{name}: {wi} {row:?} {back:?} {} {wo}", again.direction);
    });
}

/// Where one lobe alone leads to a direction, its density is the share of the first number that chooses the lobe over the
/// map's Jacobian, by central differences.
#[test]
fn densities_are_jacobians() {
    let mut models = std::collections::BTreeSet::new();
    const CHOICES: usize = 256;
    for_samples(6, 400, |case, wi, row, scatter, walk, _| {
        if scatter.delta || case.mixes {
            return;
        }
        let at = |row: Row| case.bsdf.sample(&here(), wi, row, walk).map(|found| (found.direction, found.delta));
        let first = |i: usize| (i as f64 + 0.5) / CHOICES as f64;
        let same = |i: &usize| at([first(*i), row[1], row[2], row[3]]) == Some((scatter.direction, false));
        let share = (0..CHOICES).filter(same).count() as f64 / CHOICES as f64;
        let h = 1e-5;
        let difference = |i: usize| {
            let moved = |by: f64| {
                let mut moved = row;
                moved[i] += by;
                at(moved).map(|(direction, _)| direction)
            };
            let (near, far) = ((moved(h)? - moved(-h)?) / (2.0 * h), (moved(2.0 * h)? - moved(-2.0 * h)?) / (4.0 * h));
            // The maps of the disk have kinks, where differences mean nothing.
            ((near - far).length() < 1e-4 * near.length()).then_some(near)
        };
        let (Some(du), Some(dv)) = (difference(1), difference(2)) else { return };
        let (pdf, unsure) = (share / du.cross(dv).length(), 1.0 / (CHOICES as f64 * share));
        models.insert(case.name.clone());
        assert!(
            (pdf / scatter.pdf.0 - 1.0).abs() < 2e-3 + unsure,
            "{}: {wi} {row:?}: {pdf} {:?}",
            case.name,
            scatter.pdf
        );
    });
    assert!(models.len() >= 8, "{models:?}");
}

/// Rows that are drawn by inversion are distributed as those that sampled the directions.
#[test]
fn inverted_rows_keep_their_distribution() {
    const BINS: usize = 8;
    for case in cases() {
        let mut stream = Stream::new(8, &[]);
        let mut counts = [[[0.0; BINS]; 2]; 3];
        for wi in [DVec3::new(0.3, 0.1, 0.9).normalize(), DVec3::new(0.5, -0.7, -0.4).normalize()] {
            for _ in 0..4000 {
                let row = stream.row();
                let Some(scatter) = case.bsdf.sample(&here(), wi, row, Walk::FromLight) else { continue };
                let gamma = stream.row();
                let back = case.bsdf.invert(&here(), wi, scatter.direction, scatter.delta, gamma).expect("it inverts");
                for (i, bins) in counts.iter_mut().enumerate() {
                    for (row, bins) in [row, back].iter().zip(bins) {
                        bins[((row[i] * BINS as f64) as usize).min(BINS - 1)] += 1.0;
                    }
                }
            }
        }
        for [a, b] in counts {
            let excess = |(a, b): (&f64, &f64)| if a + b > 0.0 { (a - b) * (a - b) / (a + b) } else { 0.0 };
            let sum: f64 = a.iter().zip(&b).map(excess).sum();
            assert!(chi_square::deviation(sum, (BINS - 1) as f64) < 5.5, "{}: {a:?} {b:?}", case.name);
        }
    }
}

/// A white furnace: no model makes energy, and those without a loss keep it all.
#[test]
fn energy_is_conserved() {
    for case in cases() {
        let mut stream = Stream::new(9, &[]);
        for wi in [DVec3::new(0.3, 0.1, 0.9), DVec3::new(0.5, -0.7, -0.4), DVec3::new(0.9, 0.3, 0.15)] {
            let (n, mut sum, mut squares) = (20_000, 0.0, 0.0);
            for _ in 0..n {
                let scatter = case.bsdf.sample(&here(), wi.normalize(), stream.row(), Walk::FromLight);
                let weight = scatter.map_or(0.0, |scatter| scatter.weight.luminance());
                sum += weight;
                squares += weight * weight;
            }
            let mean = sum / f64::from(n);
            let error = ((squares / f64::from(n) - mean * mean).max(0.0) / f64::from(n)).sqrt();
            assert!(mean <= 1.0 + 5.0 * error + 1e-9, "{} makes energy from {wi}: {mean}", case.name);
            assert!(!case.lossless || (mean - 1.0).abs() < 5.0 * error + 1e-9, "{} loses: {mean}", case.name);
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
    let weight = |walk| glass.sample(&here(), DVec3::Z, [0.5; 4], walk).expect("passes").weight.to_rgb()[0];
    assert!((weight(Walk::FromCamera) - 1.0 / 2.25).abs() < 1e-12);
    assert!((weight(Walk::FromLight) - 1.0).abs() < 1e-12);
}
