//! Hundreds of lights: however they are chosen and techniques are weighted, the image is the same, and the choice by
//! position has less noise.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use glam::{DVec2, DVec3};
use pathblend::bsdf::{Bsdf, Conductor, Diffuse, Distribution, RoughConductor, Roughness};
use pathblend::camera::{Camera, Projection};
use pathblend::emitter::Spot;
use pathblend::film::Filter;
use pathblend::geometry::Solid;
use pathblend::image::{Image, Layer};
use pathblend::integrators::{Budget, Method, Settings, render};
use pathblend::math::{Frame, Stream};
use pathblend::paths::Heuristic;
use pathblend::scene::{Builder, FilmSpec, LightChoice, Scene, Shine};
use pathblend::spectrum::Spectrum;

const SIZE: usize = 16;
const SEEDS: u64 = 16;
/// Threshold in standard errors. With 15 degrees of freedom a correct program exceeds it about once in 10⁵ comparisons.
const SIGMAS: f64 = 7.0;
const CLASSES: [&str; 3] = ["path_LDE", "path_LDDE", "path_LDDDE"];

fn diffuse(reflectance: f64) -> Bsdf {
    Bsdf::Diffuse(Diffuse { reflectance: Spectrum::grey(reflectance).into() })
}

fn metal() -> Bsdf {
    Bsdf::RoughConductor(RoughConductor {
        metal: Conductor { index: None, specular_reflectance: Spectrum::grey(0.9).into() },
        roughness: Roughness::isotropic(Distribution::Ggx, 0.3),
    })
}

/// A floor with a diffuse ball and one of `body` on it, under `count` lights of four kinds at all heights within `reach`, and a faint sky.
fn scene(count: usize, reach: f64, body: Bsdf) -> Scene {
    let mut builder = Builder::new();
    let [paint, black] = [0.6, 0.0].map(|reflectance| builder.bsdf(diffuse(reflectance)));
    let body = builder.bsdf(body);
    builder.solid(Solid::disk(DVec3::ZERO, DVec3::Z, 12.0f64.max(1.5 * reach)), paint, None).unwrap();
    builder.solid(Solid::sphere(DVec3::new(1.0, 0.5, 0.6), 0.6), body, None).unwrap();
    builder.solid(Solid::sphere(DVec3::new(-1.0, -0.5, 0.6), 0.6), paint, None).unwrap();
    builder.emitter(Shine::Environment(Spectrum::grey(0.05))).unwrap();
    let mut stream = Stream::new(5, &[]);
    for i in 0..count {
        let [x, y, z, w] = stream.row();
        let position = DVec3::new((2.0 * x - 1.0) * reach, (2.0 * y - 1.0) * reach, 1.4 + 2.0 * z);
        let strength = Spectrum::grey(0.2 + w);
        match i % 4 {
            0 => builder.emitter(Shine::Point(position, strength * 0.3)).unwrap(),
            1 => {
                let axis = DVec3::new(w - 0.5, 0.3, -1.0).normalize();
                let spot = Spot { position, axis, intensity: strength, cutoff: 0.9, beam: 0.5 };
                builder.emitter(Shine::Spot(spot)).unwrap();
            }
            2 => builder.solid(Solid::sphere(position, 0.05), black, Some((strength * 20.0).into())).unwrap(),
            _ => {
                let disk = Solid::disk(position, DVec3::new(0.2, x - 0.5, -1.0).normalize(), 0.1);
                builder.solid(disk, black, Some((strength * 20.0).into())).unwrap();
            }
        }
    }
    let camera = Camera {
        origin: DVec3::new(0.0, -3.0, 1.3),
        axes: Frame::around(DVec3::new(0.0, 3.0, -1.0).normalize()),
        size: [SIZE, SIZE],
        half: DVec2::splat(0.7),
        center: DVec2::ZERO,
        projection: Projection::Perspective { lens_radius: 0.0, focus_distance: 1.0 },
    };
    builder.build(camera, FilmSpec { size: [SIZE, SIZE], filter: Filter::Box }, 4).expect("a sound scene")
}

/// Means over the image, without what shines itself, and over classes.
fn means(image: &Image) -> Vec<f64> {
    CLASSES
        .iter()
        .map(|name| match image.layers.get(*name) {
            Some(Layer::Luminance(layer)) => layer.iter().map(|v| f64::from(*v)).sum::<f64>() / layer.len() as f64,
            _ => 0.0,
        })
        .collect()
}

/// Mean and squared standard error over seeds of each class.
fn estimate(scene: &Scene, method: Method, settings: Settings) -> Vec<[f64; 2]> {
    let runs: Vec<Vec<f64>> = (0..SEEDS)
        .map(|seed| {
            let settings = Settings { seed: 100 * seed + settings.seed, max_depth: 4, ..settings };
            let outcome = render(scene, method, &settings, |_| {});
            assert_eq!(outcome.health, Default::default(), "{method:?} made invalid contributions");
            means(&outcome.image)
        })
        .collect();
    let n = SEEDS as f64;
    (0..CLASSES.len())
        .map(|c| {
            let mean = runs.iter().map(|run| run[c]).sum::<f64>() / n;
            [mean, runs.iter().map(|run| (run[c] - mean).powi(2)).sum::<f64>() / (n - 1.0) / n]
        })
        .collect()
}

#[test]
fn choices_and_weights_do_not_change_the_image() {
    let scene = scene(200, 5.0, metal());
    let passes = |n| Settings { budget: Budget::Passes(n), ..Settings::default() };
    let by_power = Settings { seed: 1, lights: LightChoice::Power, ..passes(192) };
    let expected = estimate(&scene, Method::Path, by_power);
    let mut worst = 0f64;
    for lights in [LightChoice::Power, LightChoice::Position] {
        for heuristic in [Heuristic::Balance, Heuristic::Power] {
            for method in [Method::Path, Method::Light, Method::Bdpt, Method::Vcm] {
                let settings = Settings { lights, heuristic, seed: 2, ..passes(32) };
                let found = estimate(&scene, method, settings);
                for (name, (found, expected)) in CLASSES.iter().zip(found.iter().zip(&expected)) {
                    let z = (found[0] - expected[0]) / (found[1] + expected[1]).sqrt();
                    worst = worst.max(z.abs());
                    assert!(
                        z.abs() < SIGMAS,
                        "{method:?} {lights:?} {heuristic:?} {name}: {} for {}, z {z:.1}",
                        found[0],
                        expected[0]
                    );
                }
            }
        }
    }
    println!("worst z: {worst:.1}");
}

/// Photons have a bias that shrinks; what they gather of direct light is compared at a small radius.
#[test]
fn direct_light_may_be_gathered() {
    let scene = scene(200, 5.0, metal());
    let settings = Settings { budget: Budget::Passes(48), radius: 0.7, photons: Some(4000), ..Settings::default() };
    let expected = estimate(&scene, Method::Path, Settings { seed: 1, ..settings });
    for sample_direct in [true, false] {
        let found = estimate(&scene, Method::Sppm, Settings { sample_direct, seed: 2, ..settings });
        for (name, (found, expected)) in CLASSES.iter().zip(found.iter().zip(&expected)) {
            let error = (found[1] + expected[1]).sqrt();
            // The bias of the disk at the rims of floor and balls.
            let close = (found[0] - expected[0]).abs() < SIGMAS * error + 0.02 * expected[0];
            assert!(close, "{sample_direct} {name}: {} ± {error} for {}", found[0], expected[0]);
        }
    }
}

#[test]
fn the_choice_by_position_has_less_noise() {
    // A town, of which the camera sees a yard; highlights would have noise of their own, which no choice of lights takes away.
    let scene = scene(1000, 30.0, diffuse(0.6));
    for method in [Method::Path, Method::Bdpt] {
        // Between pixels of two renders: their number makes the variance known to a few percent.
        let noise = |lights| {
            let images = [1, 2].map(|seed| {
                let budget = Budget::Passes(64);
                render(&scene, method, &Settings { seed, lights, budget, max_depth: 2, ..Settings::default() }, |_| {})
                    .image
            });
            let [Some(Layer::Luminance(a)), Some(Layer::Luminance(b))] =
                images.each_ref().map(|i| i.layers.get("path_LDE"))
            else {
                panic!("no direct light")
            };
            a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>()
        };
        let ratio = noise(LightChoice::Position) / noise(LightChoice::Power);
        println!("{method:?}: variance of direct light {ratio:.2} times");
        assert!(ratio < 0.5, "{method:?}: {ratio}");
    }
}
