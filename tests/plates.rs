//! Parallel plates, diffuse and of glass, whose light is known to any number of bounces.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::{
    Estimate, METHODS, Worst, build, class_mean, colour_mean, diffuse, estimate, glass, images, parallel, reflectance,
};
use glam::DVec3;
use pathblend::bsdf::{Bsdf, ThinDielectric};
use pathblend::geometry::Solid;
use pathblend::integrators::Method;
use pathblend::scene::{Builder, Scene, Shine};
use pathblend::spectrum::Spectrum;
use std::f64::consts::PI;

const SIZE: usize = 16;

/// A diffuse disk around the z axis.
#[derive(Clone, Copy)]
struct Plate {
    radius: f64,
    reflectance: f64,
}

const LOWER: Plate = Plate { radius: 1.5, reflectance: 0.8 };
const UPPER: Plate = Plate { radius: 1.0, reflectance: 0.6 };
const GAP: f64 = 1.2;
/// What the upper plate shines with.
const RADIANCE: f64 = 2.0;
/// Half the width of the square in the middle of a plate that the camera sees.
const SEEN: f64 = 0.5;

/// Irradiance, at the distance `r` from the axis, by a coaxial disk of `radius` whose radiance is `light`. A ring of
/// radius q has ∫ h² / d⁴ dφ with d² = h² + r² + q² − 2 r q cos φ, which is 2π h² A / (A² − 4 r² q²)^(3/2) with
/// A = h² + r² + q².
fn irradiance(r: f64, radius: f64, light: &dyn Fn(f64) -> f64) -> f64 {
    let n = 300;
    let step = radius / f64::from(n);
    let ring = |i: i32| {
        let q = step * (f64::from(i) + 0.5);
        let a = GAP * GAP + r * r + q * q;
        light(q) * 2.0 * PI * GAP * GAP * a / (a * a - 4.0 * r * r * q * q).powf(1.5) * q * step
    };
    (0..n).map(ring).sum()
}

/// View factor from a point at the distance `r` from the axis to a parallel disk around it (Howell, *A Catalog of
/// Radiation Heat Transfer Configuration Factors*, element to parallel disk).
fn view_factor(r: f64, radius: f64) -> f64 {
    let (h2, r2, a2) = (GAP * GAP, r * r, radius * radius);
    0.5 * (1.0 - (h2 + r2 - a2) / ((h2 + r2 + a2).powi(2) - 4.0 * a2 * r2).sqrt())
}

/// What `plate` shows, as a function of the distance from the axis and tabulated for the next bounce, of light from
/// `other` whose radiance is `light`.
fn reflected(plate: Plate, other: Plate, light: &dyn Fn(f64) -> f64) -> impl Fn(f64) -> f64 + use<> {
    let cells = 2000;
    let at = |i: i32| plate.radius * f64::from(i) / f64::from(cells);
    let table: Vec<f64> =
        (0..=cells).map(|i| plate.reflectance / PI * irradiance(at(i), other.radius, light)).collect();
    move |r| {
        let place = (r / plate.radius * f64::from(cells)).min(f64::from(cells) - 1e-9);
        let (index, share) = (place as usize, place.fract());
        table[index] * (1.0 - share) + table[index + 1] * share
    }
}

/// The mean over the square that the camera sees.
fn seen(light: &dyn Fn(f64) -> f64) -> f64 {
    let n = 100;
    let middle = |i: i32| (f64::from(i) + 0.5) / f64::from(n) * SEEN;
    let sum: f64 = (0..n * n).map(|i| light(middle(i / n).hypot(middle(i % n)))).sum();
    sum / f64::from(n * n)
}

/// Two coaxial disks that face each other; the upper one shines. Looking at the lower one shows odd numbers of bounces,
/// looking at the upper one even ones.
fn facing_plates(looks_down: bool) -> Scene {
    let mut builder = Builder::new();
    let (lower, upper) = (builder.bsdf(diffuse(LOWER.reflectance)), builder.bsdf(diffuse(UPPER.reflectance)));
    builder.solid(Solid::disk(DVec3::ZERO, DVec3::Z, LOWER.radius), lower, None).unwrap();
    let lamp = Solid::disk(DVec3::Z * GAP, -DVec3::Z, UPPER.radius);
    builder.solid(lamp, upper, Some(Spectrum::grey(RADIANCE).into())).unwrap();
    let towards = if looks_down { -DVec3::Z } else { DVec3::Z };
    build(builder, parallel(SIZE, SEEN, DVec3::Z * (0.5 * GAP), towards), 5)
}

/// Radiosity between two disks: each bounce is one integral over radii, so every class has its value.
#[test]
fn diffuse_plates_exchange_light_as_their_view_factors_say() {
    for r in [0.0, 0.7, 1.4] {
        let by_rings = irradiance(r, UPPER.radius, &|_| 1.0) / PI;
        assert!((by_rings - view_factor(r, UPPER.radius)).abs() < 1e-5, "{by_rings}");
    }
    let shining = |_: f64| RADIANCE;
    let first = reflected(LOWER, UPPER, &shining);
    let second = reflected(UPPER, LOWER, &first);
    let third = reflected(LOWER, UPPER, &second);
    let fourth = reflected(UPPER, LOWER, &third);
    let mut worst = Worst::default();
    for (looks_down, expected) in [
        (true, [("LDE", seen(&first)), ("LDDDE", seen(&third))].as_slice()),
        (false, [("LE", RADIANCE), ("LDDE", seen(&second)), ("LDDDDE", seen(&fourth))].as_slice()),
    ] {
        let scene = facing_plates(looks_down);
        for method in METHODS {
            // Photons and chains take a while: one has a radius that shrinks, the other little light at first.
            let passes = if method == Method::Sppm || method.has_chains() { 60 } else { 12 };
            let images = images(&scene, method, passes);
            let sum: f64 = expected.iter().map(|(_, value)| value).sum();
            worst.expect(method, "beauty", estimate(&images, colour_mean), Estimate::exact(sum, 2e-5 * sum));
            for (word, value) in expected {
                let found = estimate(&images, |image| class_mean(image, word));
                worst.expect(method, word, found, Estimate::exact(*value, 2e-5 * value));
            }
        }
    }
    worst.print();
}

/// Index of the glass.
const ETA: f64 = 1.5;

/// A lamp behind `pane`, which is added to the builder, and a sky of radiance 1 before it, seen at the angle `tilt`.
fn before_a_lamp(tilt: f64, pane: impl Fn(&mut Builder)) -> Scene {
    let mut builder = Builder::new();
    pane(&mut builder);
    let black = builder.bsdf(diffuse(0.0));
    let lamp = Solid::disk(DVec3::new(0.0, 0.0, -1.0), DVec3::Z, 12.0);
    builder.solid(lamp, black, Some(Spectrum::grey(RADIANCE).into())).unwrap();
    builder.emitter(Shine::Environment(Spectrum::ONE)).unwrap();
    let back = DVec3::new(tilt.sin(), 0.0, tilt.cos());
    build(builder, parallel(SIZE, 0.2, back * 5.0, -back), 7)
}

/// With R the reflectance of a face, a slab shows (1 − R)² R^2m of the lamp after m times there and back, and of the sky
/// R from its front and (1 − R)² R^(2m − 1) after m times to its back.
#[test]
fn a_slab_of_glass_passes_and_reflects_a_geometric_series() {
    let slab = |builder: &mut Builder| {
        let bsdf = builder.bsdf(glass(ETA));
        for side in [1.0, -1.0] {
            builder.solid(Solid::disk(DVec3::Z * (0.2 * side), DVec3::Z * side, 5.0), bsdf, None).unwrap();
        }
    };
    let mut worst = Worst::default();
    for tilt in [0.0, 40f64, 70.0].map(f64::to_radians) {
        let scene = before_a_lamp(tilt, slab);
        let r = reflectance(tilt, ETA);
        let through = (1.0 - r).powi(2);
        // The longest paths have seven edges.
        let expected = [
            ("LSE", r),
            ("LSSE", RADIANCE * through),
            ("LSSSE", through * r),
            ("LSSSSE", RADIANCE * through * r.powi(2)),
            ("LSSSSSE", through * r.powi(3)),
            ("LSSSSSSE", RADIANCE * through * r.powi(4)),
        ];
        let sum: f64 = expected.iter().map(|(_, value)| value).sum();
        for method in METHODS {
            let images = images(&scene, method, 12);
            worst.expect(method, "beauty", estimate(&images, colour_mean), Estimate::exact(sum, 0.0));
            // Of what hardly ever happens a spread says nothing, and a chain of paths of all lengths is where the light is.
            let least = if method == Method::Mlt { 1e-2 } else { 1e-3 };
            for (word, value) in expected.into_iter().filter(|(_, value)| *value > least) {
                let found = estimate(&images, |image| class_mean(image, word));
                worst.expect(method, word, found, Estimate::exact(value, 0.0));
            }
        }
    }
    worst.print();
}

/// The thin pane is the slab without end: T = (1 − R)² / (1 − R²), and the rest is reflected.
#[test]
fn a_thin_pane_is_the_whole_series() {
    let thin = |builder: &mut Builder| {
        let one = Spectrum::ONE;
        let pane = ThinDielectric { eta: ETA, specular_reflectance: one, specular_transmittance: one };
        let bsdf = builder.bsdf(Bsdf::ThinDielectric(pane));
        builder.solid(Solid::disk(DVec3::ZERO, DVec3::Z, 5.0), bsdf, None).unwrap();
    };
    let mut worst = Worst::default();
    for tilt in [0.0, 40f64, 70.0].map(f64::to_radians) {
        let scene = before_a_lamp(tilt, thin);
        let r = reflectance(tilt, ETA);
        let passes = (1.0 - r).powi(2) / (1.0 - r * r);
        let expected = Estimate::exact(RADIANCE * passes + 1.0 - passes, 0.0);
        for method in METHODS {
            let images = images(&scene, method, 8);
            worst.expect(method, "LSE", estimate(&images, |image| class_mean(image, "LSE")), expected);
            worst.expect(method, "beauty", estimate(&images, colour_mean), expected);
        }
    }
    worst.print();
}
