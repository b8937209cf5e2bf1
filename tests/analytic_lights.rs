//! Every method under every kind of light, on a floor whose radiance is known.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::METHODS;
use glam::{DAffine2, DMat3, DVec2, DVec3, Vec2, Vec3};
use pathblend::bsdf::{Bsdf, Diffuse};
use pathblend::camera::{Camera, Projection};
use pathblend::emitter::{Backdrop, Panorama, Spot, Start, Sun};
use pathblend::film::Filter;
use pathblend::geometry::Solid;
use pathblend::integrators::{Budget, Settings, render};
use pathblend::math::{Frame, warp};
use pathblend::scene::{Builder, FilmSpec, Mesh, Scene, Shine};
use pathblend::spectrum::Spectrum;
use pathblend::texture::{Checkerboard, Colour, Picture, Texels, Texture};
use std::f64::consts::{FRAC_1_PI, PI};
use std::sync::Arc;

const REFLECTANCE: f64 = 0.8;
const SIZE: usize = 16;
/// Threshold in standard errors. With 15 degrees of freedom a correct program exceeds it about once in 3·10⁵ tests.
const SIGMAS: f64 = 7.0;
const SEEDS: u64 = 16;
/// Where the camera looks at the floor.
const SEEN: DVec3 = DVec3::new(1.0, 0.0, 0.0);

/// A floor of radius 4 around the origin that faces +z.
fn floor() -> Builder {
    let mut builder = Builder::new();
    let paint = builder.bsdf(Bsdf::Diffuse(Diffuse { reflectance: Spectrum::grey(REFLECTANCE).into() }));
    builder.solid(Solid::disk(DVec3::ZERO, DVec3::Z, 4.0), paint, None).unwrap();
    builder
}

fn build(builder: Builder) -> Scene {
    let camera = Camera {
        origin: SEEN + DVec3::Z,
        axes: Frame::around(-DVec3::Z),
        size: [SIZE, SIZE],
        half: DVec2::splat(1e-3),
        center: DVec2::ZERO,
        projection: Projection::Perspective { lens_radius: 0.0, focus_distance: 1.0 },
    };
    builder.build(camera, FilmSpec { size: [SIZE, SIZE], filter: Filter::Box }, 3).expect("a sound scene")
}

#[track_caller]
fn expect(scene: &Scene, passes: u64, irradiance: f64) {
    let expected = REFLECTANCE * FRAC_1_PI * irradiance;
    for method in METHODS {
        let means: Vec<f64> = (0..SEEDS)
            .map(|seed| {
                let settings = Settings {
                    seed,
                    max_depth: 3,
                    features: false,
                    budget: Budget::Passes(passes),
                    ..Settings::default()
                };
                let outcome = render(scene, method, &settings, |_| {});
                assert_eq!(outcome.health, Default::default(), "{method:?} made invalid contributions");
                outcome.image.colour.iter().map(|v| f64::from(*v)).sum::<f64>() / outcome.image.colour.len() as f64
            })
            .collect();
        let mean = means.iter().sum::<f64>() / SEEDS as f64;
        let variance = means.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (SEEDS - 1) as f64;
        let error = (variance / SEEDS as f64).sqrt();
        let close = (mean - expected).abs() < SIGMAS * error + 2e-4 * expected;
        assert!(close, "{method:?}: {mean} ± {error}, expected {expected}");
    }
}

#[test]
fn parallel_light_falls_off_with_the_cosine() {
    let mut builder = floor();
    builder.emitter(Shine::Directional(DVec3::new(0.6, 0.0, 0.8), Spectrum::grey(5.0))).unwrap();
    expect(&build(builder), 8, 5.0 * 0.8);
}

/// Each light is chosen with a probability of its own, and what it gives does not depend on that.
#[test]
fn lights_of_different_power_add_up() {
    let mut builder = floor();
    builder.emitter(Shine::Directional(DVec3::new(0.6, 0.0, 0.8), Spectrum::grey(5.0))).unwrap();
    // Straight above the place that the camera sees.
    builder.emitter(Shine::Point(DVec3::new(1.0, 0.0, 2.0), Spectrum::grey(4.0))).unwrap();
    builder.emitter(Shine::Point(DVec3::new(1.0, 0.0, 4.0), Spectrum::grey(30.0))).unwrap();
    expect(&build(builder), 32, 5.0 * 0.8 + 4.0 / 4.0 + 30.0 / 16.0);
}

/// At the camera's place the intensity is between the full one and none.
#[test]
fn a_spot_light_fades_to_its_edge() {
    let (cutoff, beam) = (30f64.to_radians(), 20f64.to_radians());
    let position = DVec3::new(0.0, 0.0, 2.0);
    let mut builder = floor();
    let intensity = Spectrum::grey(5.0);
    builder.emitter(Shine::Spot(Spot { position, axis: -DVec3::Z, intensity, cutoff, beam })).unwrap();
    let angle = 0.5f64.atan();
    let share = (cutoff - angle) / (cutoff - beam);
    expect(&build(builder), 8, 5.0 * share * angle.cos().powi(3) / 4.0);
}

/// An image of the surroundings with a sun before it, against the integral of both.
#[test]
fn an_environment_lights_the_floor() {
    let pixels = [0.5f32, 3.0, 0.0, 1.0, 0.0, 0.0, 6.0, 2.0, 1.0, 1.0, 0.0, 4.0];
    let picture = Arc::new(Picture::new([4, 3], Texels::linear(pixels.to_vec())).unwrap());
    let rotation = DMat3::from_rotation_y(0.7) * DMat3::from_rotation_x(1.2);
    let image = Some((Panorama::new(picture, 0.5).unwrap(), rotation));
    let sun = Sun { towards: DVec3::new(0.0, 0.6, 0.8), cap: 0.01, radiance: Spectrum::grey(30.0) };
    let mut builder = floor();
    builder.emitter(Shine::Backdrop(Backdrop { image, sun: Some(sun) })).unwrap();
    let scene = build(builder);
    let environment = scene.emitter(scene.environment().unwrap());
    let side = 2000;
    let middle = |i: usize| (i as f64 + 0.5) / side as f64;
    // The mean over directions in proportion to the cosine, times π.
    let sum: f64 = (0..side * side)
        .map(|i| {
            let towards = warp::hemisphere::sample([middle(i / side), middle(i % side)]);
            environment.radiance(&Start::Infinite { towards }, -towards).luminance()
        })
        .sum();
    expect(&scene, 24, sum / (side * side) as f64 * PI);
}

/// A square above the floor of which one half shines, by a texture; the other half would be as bright.
#[test]
fn half_of_a_square_light_shines_by_its_texture() {
    let colours = [Spectrum::grey(4.0), Spectrum::BLACK];
    // One stripe over the half with u < 1/2.
    let to_uv = DAffine2::from_scale(DVec2::new(1.0, 0.0));
    let texture = Texture::Checkerboard(Checkerboard { colours, to_uv });
    let mut builder = floor();
    let black = builder.bsdf(Bsdf::Diffuse(Diffuse { reflectance: Spectrum::BLACK.into() }));
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Vec2::from);
    let square = Mesh {
        positions: corners.iter().map(|uv| Vec3::new(2.0 * uv.x, 2.0 * uv.y - 1.0, 2.0)).collect(),
        uvs: corners.to_vec(),
        triangles: vec![[0, 2, 1], [0, 3, 2]],
        ..Mesh::default()
    };
    builder.mesh(square, black, Some(Colour::Textured(Arc::new(texture)))).unwrap();
    // What shines are the x from 0 to 1, y from -1 to 1 at height 2, seen from (1, 0, 0): two corners of 1 by 1.
    let (a, b, h) = (1.0f64, 1.0f64, 2.0f64);
    let (p, q) = ((h * h + a * a).sqrt(), (h * h + b * b).sqrt());
    let corner = 0.5 * (a / p * (b / p).atan() + b / q * (a / q).atan());
    expect(&build(builder), 32, 4.0 * 2.0 * corner);
}
