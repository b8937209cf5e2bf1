//! Every method on scenes whose images are known.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::METHODS;
use glam::{DVec2, DVec3, Vec3};
use pathblend::bsdf::{Bsdf, Conductor, Dielectric, Diffuse, Distribution, RoughConductor, Roughness};
use pathblend::camera::{Camera, Projection};
use pathblend::film::Filter;
use pathblend::geometry::Solid;
use pathblend::image::{Image, Layer};
use pathblend::integrators::{Budget, Method, Settings, render};
use pathblend::math::Frame;
use pathblend::scene::{Builder, FilmSpec, Mesh, Scene, Shine};
use pathblend::spectrum::Spectrum;

const SIZE: usize = 16;
/// Threshold in standard errors. With 15 degrees of freedom a correct program exceeds it about once in 3·10⁵ tests.
const SIGMAS: f64 = 7.0;
const SEEDS: u64 = 16;

fn camera(origin: DVec3, towards: DVec3, half: f64) -> Camera {
    Camera {
        origin,
        axes: Frame::around(towards.normalize()),
        size: [SIZE, SIZE],
        half: DVec2::splat(half),
        center: DVec2::ZERO,
        projection: Projection::Perspective { lens_radius: 0.0, focus_distance: 1.0 },
    }
}

fn build(builder: Builder, camera: Camera, max_depth: usize) -> Scene {
    let film = FilmSpec { size: [SIZE, SIZE], filter: Filter::Box };
    builder.build(camera, film, max_depth).expect("a sound scene")
}

/// The cube [-1, 1]³ seen from inside: every wall faces inwards.
fn room() -> Mesh {
    let positions: Vec<Vec3> = (0..8u8)
        .map(|i| Vec3::new(f32::from(i & 1), f32::from(i >> 1 & 1), f32::from(i >> 2)) * 2.0 - Vec3::ONE)
        .collect();
    let quads = [[0u32, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let mut triangles: Vec<[u32; 3]> = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    for triangle in &mut triangles {
        let [a, b, c] = triangle.map(|i| positions[i as usize]);
        if (b - a).cross(c - a).dot(a + b + c) > 0.0 {
            triangle.swap(1, 2);
        }
    }
    Mesh { positions, triangles, ..Mesh::default() }
}

fn diffuse(reflectance: f64) -> Bsdf {
    Bsdf::Diffuse(Diffuse { reflectance: Spectrum::grey(reflectance).into() })
}

/// Mean over pixels and seeds of `value`, with its standard error over seeds.
fn mean(scene: &Scene, method: Method, passes: u64, value: impl Fn(&Image) -> f64) -> (f64, f64) {
    let values: Vec<f64> = (0..SEEDS)
        .map(|seed| {
            let settings = Settings {
                seed,
                max_depth: scene.max_depth,
                features: true,
                budget: Budget::Passes(passes),
                ..Settings::default()
            };
            let outcome = render(scene, method, &settings, |_| {});
            assert_eq!(outcome.health, Default::default(), "{method:?} made invalid contributions");
            value(&outcome.image)
        })
        .collect();
    let n = SEEDS as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

fn colour_mean(image: &Image) -> f64 {
    image.colour.iter().map(|v| f64::from(*v)).sum::<f64>() / image.colour.len() as f64
}

fn layer_mean(image: &Image, name: &str) -> f64 {
    match image.layers.get(name) {
        Some(Layer::Luminance(layer)) => layer.iter().map(|v| f64::from(*v)).sum::<f64>() / layer.len() as f64,
        _ => 0.0,
    }
}

#[track_caller]
fn expect(scene: &Scene, method: Method, passes: u64, what: &str, expected: f64, value: impl Fn(&Image) -> f64) {
    let (found, error) = mean(scene, method, passes, value);
    assert!(
        (found - expected).abs() < SIGMAS * error + 1e-5 * expected,
        "{method:?}, {what}: {found} ± {error}, expected {expected}"
    );
}

/// In a closed room whose walls shine with radiance 1 and reflect ρ, light of n bounces has radiance ρⁿ everywhere. Walks
/// are longer than what roulette spares.
#[test]
fn a_glowing_room_is_a_geometric_series() {
    let (reflectance, max_depth) = (0.5, 7);
    let mut builder = Builder::new();
    let paint = builder.bsdf(diffuse(reflectance));
    builder.mesh(room(), paint, Some(Spectrum::ONE.into())).unwrap();
    // Off the corners: there a photon gather's disk reaches past the wall.
    let scene = build(builder, camera(DVec3::new(0.1, 0.2, 0.0), DVec3::new(0.05, 0.02, 1.0), 0.3), max_depth);
    for method in METHODS.into_iter().chain([Method::Light]) {
        let sum: f64 = (0..max_depth).map(|n| reflectance.powi(n as i32)).sum();
        expect(&scene, method, 16, "beauty", sum, colour_mean);
        for (bounces, word) in ["LE", "LDE", "LDDE", "LDDDE", "LDDDDE", "LDDDDDE", "LDDDDDDE"].into_iter().enumerate() {
            let layer = format!("path_{word}");
            expect(&scene, method, 16, word, reflectance.powi(bounces as i32), |image| layer_mean(image, &layer));
        }
    }
}

/// Under an even sky a convex white body shows its albedo, and glass is invisible.
#[test]
fn under_an_even_sky_glass_is_invisible_and_paint_shows_its_albedo() {
    let glass = Bsdf::Dielectric(Dielectric {
        eta: 1.5,
        specular_reflectance: Spectrum::ONE,
        specular_transmittance: Spectrum::ONE,
    });
    for (body, expected, max_depth) in [(diffuse(0.7), 0.7, 4), (glass, 1.0, 40)] {
        let mut builder = Builder::new();
        let bsdf = builder.bsdf(body);
        builder.solid(Solid::sphere(DVec3::ZERO, 1.0), bsdf, None).unwrap();
        builder.emitter(Shine::Environment(Spectrum::ONE)).unwrap();
        let scene = build(builder, camera(DVec3::new(0.0, 0.0, -4.0), DVec3::Z, 0.1), max_depth);
        for method in METHODS {
            expect(&scene, method, 8, "beauty", expected, colour_mean);
        }
    }
}

/// A point light of intensity I at height h over a white floor: E = I cos³θ / h², seen as ρ E / π.
#[test]
fn a_point_light_falls_off_as_it_should() {
    let mut builder = Builder::new();
    let paint = builder.bsdf(diffuse(0.8));
    builder.solid(Solid::disk(DVec3::ZERO, DVec3::Z, 10.0), paint, None).unwrap();
    builder.emitter(Shine::Point(DVec3::new(0.0, 0.0, 2.0), Spectrum::grey(5.0))).unwrap();
    // A narrow view of the point (1, 0, 0).
    let scene = build(builder, camera(DVec3::new(1.0, 0.0, 1.0), -DVec3::Z, 1e-4), 3);
    let cos: f64 = 2.0 / 5f64.sqrt();
    let expected = 0.8 / std::f64::consts::PI * 5.0 * cos.powi(3) / 4.0;
    for method in METHODS {
        expect(&scene, method, 8, "beauty", expected, colour_mean);
    }
}

/// A sphere light's form factor: a floor point right below sees E = π L (r / d)².
#[test]
fn a_sphere_light_has_its_form_factor() {
    let mut builder = Builder::new();
    let paint = builder.bsdf(diffuse(0.6));
    builder.solid(Solid::disk(DVec3::ZERO, DVec3::Z, 10.0), paint, None).unwrap();
    let black = builder.bsdf(diffuse(0.0));
    let lamp = Solid::sphere(DVec3::new(0.0, 0.0, 3.0), 1.0);
    builder.solid(lamp, black, Some(Spectrum::grey(4.0).into())).unwrap();
    // Below the sphere, as the camera must not block or see it.
    let scene = build(builder, camera(DVec3::new(0.0, 0.0, 1.0), -DVec3::Z, 1e-3), 3);
    for method in METHODS {
        expect(&scene, method, 32, "beauty", 0.6 * 4.0 / 9.0, colour_mean);
    }
}

/// A point light in the centre of a glass ball: all rays meet the glass at right angles, so they pass straight, and what is
/// reflected passes the centre again and leaves on the other side. The ball might as well not be there. Only walks from the
/// light find this light: it tests light tracing and photons against E = I cos³θ / h².
#[test]
fn a_point_light_in_a_glass_ball_shines_as_if_it_were_bare() {
    let (height, reflectance, intensity) = (2.0, 0.8, 5.0);
    let mut builder = Builder::new();
    let paint = builder.bsdf(diffuse(reflectance));
    builder.solid(Solid::disk(DVec3::ZERO, DVec3::Z, 10.0), paint, None).unwrap();
    let glass = builder.bsdf(Bsdf::Dielectric(Dielectric {
        eta: 1.5,
        specular_reflectance: Spectrum::ONE,
        specular_transmittance: Spectrum::ONE,
    }));
    let center = DVec3::new(0.0, 0.0, height);
    builder.solid(Solid::sphere(center, 0.2), glass, None).unwrap();
    builder.emitter(Shine::Point(center, Spectrum::grey(intensity))).unwrap();
    // Looks down from below the ball at the square [-1, 1]² of the floor.
    let scene = build(builder, camera(DVec3::Z, -DVec3::Z, 1.0), 6);
    let n = 200;
    let radiance = |i: usize| {
        let (x, y) = ((i % n) as f64 / n as f64, (i / n) as f64 / n as f64);
        let distance_squared = (2.0 * x - 1.0).powi(2) + (2.0 * y - 1.0).powi(2) + height * height;
        reflectance / std::f64::consts::PI * intensity * height / distance_squared.powf(1.5)
    };
    let expected = (0..n * n).map(radiance).sum::<f64>() / (n * n) as f64;
    for method in METHODS.into_iter().chain([Method::Light]).filter(|method| *method != Method::Path) {
        expect(&scene, method, 250, "beauty", expected, colour_mean);
        // The first interface lets 96 % pass, and each way back again 96 % of the rest.
        let class = |image: &Image| layer_mean(image, "path_LSDE");
        expect(&scene, method, 250, "LSDE", 0.96 * expected, class);
        let class = |image: &Image| layer_mean(image, "path_LSSDE");
        expect(&scene, method, 250, "LSSDE", 0.04 * 0.96 * expected, class);
    }
}

/// A lamp under glass, seen from above: radiance is squeezed by 1/η², and the boundary keeps 4 % of it.
#[test]
fn a_lamp_under_glass_is_dimmed_by_the_squared_index() {
    let mut builder = Builder::new();
    let black = builder.bsdf(diffuse(0.0));
    let lamp = Solid::disk(DVec3::ZERO, DVec3::Z, 1.0);
    builder.solid(lamp, black, Some(Spectrum::grey(3.0).into())).unwrap();
    let glass = builder.bsdf(Bsdf::Dielectric(Dielectric {
        eta: 1.5,
        specular_reflectance: Spectrum::ONE,
        specular_transmittance: Spectrum::ONE,
    }));
    // The surface of the glass; the disk's normal points to the outside.
    builder.solid(Solid::disk(DVec3::new(0.0, 0.0, 0.5), DVec3::Z, 2.0), glass, None).unwrap();
    let scene = build(builder, camera(DVec3::new(0.0, 0.0, 2.0), -DVec3::Z, 1e-3), 3);
    for method in METHODS {
        expect(&scene, method, 64, "beauty", 3.0 * 0.96 / 2.25, colour_mean);
    }
}

/// A room of several materials without closed form: all unbiased methods agree, image and classes.
#[test]
fn the_unbiased_methods_agree_class_by_class() {
    let mut builder = Builder::new();
    let paint = builder.bsdf(diffuse(0.6));
    builder.mesh(room(), paint, None).unwrap();
    let mirror = Conductor { index: None, specular_reflectance: Spectrum::grey(0.9).into() };
    let roughness = |alpha| Roughness::isotropic(Distribution::Ggx, alpha);
    let bodies = [
        Bsdf::Dielectric(Dielectric {
            eta: 1.5,
            specular_reflectance: Spectrum::ONE,
            specular_transmittance: Spectrum::ONE,
        }),
        Bsdf::Conductor(mirror.clone()),
        Bsdf::RoughConductor(RoughConductor { metal: mirror.clone(), roughness: roughness(0.3) }),
        Bsdf::RoughConductor(RoughConductor { metal: mirror.clone(), roughness: roughness(0.12) }),
    ];
    for (i, body) in bodies.into_iter().enumerate() {
        let bsdf = builder.bsdf(body);
        let center = DVec3::new(-0.6 + 0.4 * i as f64, -0.8, 0.3 * (i % 2) as f64);
        builder.solid(Solid::sphere(center, 0.18), bsdf, None).unwrap();
    }
    let black = builder.bsdf(diffuse(0.0));
    let lamp = Solid::disk(DVec3::new(0.0, 0.99, 0.0), -DVec3::Y, 0.4);
    builder.solid(lamp, black, Some(Spectrum::grey(10.0).into())).unwrap();
    let scene = build(builder, camera(DVec3::new(0.0, -0.2, -0.9), DVec3::new(0.0, -0.5, 1.0), 0.6), 6);
    let classes = ["LDE", "LSE", "LDDE", "LDSE", "LSDE", "LDDDE", "LSSDE", "LDSSE", "LDDDDE"];
    let values = |image: &Image| -> Vec<f64> {
        let layers = classes.iter().map(|word| layer_mean(image, &format!("path_{word}")));
        layers.chain([colour_mean(image)]).collect()
    };
    let runs = |method, passes| -> Vec<Vec<f64>> {
        let one = |seed| {
            let settings =
                Settings { seed, max_depth: 6, features: true, budget: Budget::Passes(passes), ..Settings::default() };
            values(&render(&scene, method, &settings, |_| {}).image)
        };
        (0..SEEDS).map(one).collect()
    };
    let path = runs(Method::Path, 256);
    for (method, passes) in [(Method::Bdpt, 64), (Method::Pssmlt, 64), (Method::Mmlt, 64), (Method::Rjmlt, 64)] {
        let other = runs(method, passes);
        for (index, word) in classes.into_iter().chain(["all"]).enumerate() {
            let column = |runs: &[Vec<f64>]| moments(&runs.iter().map(|run| run[index]).collect::<Vec<_>>());
            let ((a, error_a), (b, error_b)) = (column(&path), column(&other));
            assert!(a > 0.0, "{word} does not occur");
            let error = error_a.hypot(error_b);
            assert!((a - b).abs() < SIGMAS * error, "{method:?}, {word}: {b} ± {error_b}, path {a} ± {error_a}");
        }
    }
}

fn moments(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}
