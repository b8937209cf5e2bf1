//! What tests of whole renders share: cameras, runs over seeds, and what is to be thought of their mean.

// Each file of tests is a crate of its own, and none uses all of this.
#![allow(dead_code)]

pub mod rooms;

use glam::{DVec2, DVec3, Vec3};
use pathblend::bsdf::{Bsdf, Dielectric, Diffuse};
use pathblend::camera::{Camera, Projection};
use pathblend::film::Filter;
use pathblend::image::{Image, Layer};
use pathblend::integrators::{Budget, Method, Settings, render};
use pathblend::math::Frame;
use pathblend::scene::{Builder, FilmSpec, Mesh, Scene};
use pathblend::spectrum::Spectrum;

pub const METHODS: [Method; 9] = [
    Method::Path,
    Method::Bdpt,
    Method::Sppm,
    Method::Vcm,
    Method::Pssmlt,
    Method::Mmlt,
    Method::Rjmlt,
    Method::Mlt,
    Method::Fused,
];

/// Runs of one method on one scene, each with its own seed.
pub const SEEDS: u64 = 32;

/// Threshold in standard errors. With 31 degrees of freedom a correct program exceeds it about once in 10⁷ comparisons
/// (Student's t), so a file with hundreds of them fails less than once in 10⁴ runs.
pub const SIGMAS: f64 = 7.0;

/// A mean with its standard error.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    pub mean: f64,
    pub error: f64,
}

impl Estimate {
    pub fn of(values: &[f64]) -> Self {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
        Self { mean, error: (variance / n).sqrt() }
    }

    /// A number that is known up to `error`, of which it does not stray by more: rounding, or a quadrature.
    pub fn exact(mean: f64, error: f64) -> Self {
        Self { mean, error: error / SIGMAS }
    }

    /// How far two numbers are apart, in standard errors.
    pub fn deviation(self, other: Self) -> f64 {
        // Single precision on the film keeps means from being exact where there is no noise.
        let rounding = 1e-5 * other.mean.abs() / SIGMAS;
        (self.mean - other.mean).abs() / self.error.hypot(other.error).max(rounding).max(f64::MIN_POSITIVE)
    }
}

/// The worst deviation of each method, for the tables that these tests print.
#[derive(Default)]
pub struct Worst(Vec<(Method, f64, String)>);

impl Worst {
    /// Fails where a method's `found` is too far from what it should be.
    #[track_caller]
    pub fn expect(&mut self, method: Method, what: &str, found: Estimate, expected: Estimate) {
        let z = found.deviation(expected);
        match self.0.iter_mut().find(|(of, ..)| *of == method) {
            Some(worst) if worst.1 < z => *worst = (method, z, what.to_owned()),
            Some(_) => (),
            None => self.0.push((method, z, what.to_owned())),
        }
        let Estimate { mean, error } = found;
        assert!(z < SIGMAS, "{method:?}, {what}: {mean} ± {error}, expected {expected:?}: {z:.1} standard errors");
    }

    pub fn print(&self) {
        for (method, z, what) in &self.0 {
            println!("| {} | {z:.1} | {what} |", method.name());
        }
    }
}

/// A camera with parallel rays along `towards` that sees a square of half the width `half`, from `origin` on.
pub fn parallel(size: usize, half: f64, origin: DVec3, towards: DVec3) -> Camera {
    Camera {
        origin,
        axes: Frame::around(towards.normalize()),
        size: [size, size],
        half: DVec2::splat(half),
        center: DVec2::ZERO,
        projection: Projection::Orthographic { depth: 1e3 },
    }
}

/// A pinhole camera at `origin` that sees a square of half the width `half` at distance 1.
pub fn pinhole(size: usize, half: f64, origin: DVec3, towards: DVec3) -> Camera {
    let projection = Projection::Perspective { lens_radius: 0.0, focus_distance: 1.0 };
    Camera { projection, ..parallel(size, half, origin, towards) }
}

pub fn build(builder: Builder, camera: Camera, max_depth: usize) -> Scene {
    let film = FilmSpec { size: camera.size, filter: Filter::Box };
    builder.build(camera, film, max_depth).expect("a sound scene")
}

pub fn diffuse(reflectance: f64) -> Bsdf {
    Bsdf::Diffuse(Diffuse { reflectance: Spectrum::grey(reflectance).into() })
}

pub fn glass(eta: f64) -> Bsdf {
    let one = Spectrum::ONE;
    Bsdf::Dielectric(Dielectric { eta, specular_reflectance: one, specular_transmittance: one })
}

/// What a smooth boundary to an index of `eta` reflects of unpolarised light at the angle `incident`, by Fresnel's
/// formulas in sines and tangents (Born and Wolf, *Principles of Optics*, section 1.5).
pub fn reflectance(incident: f64, eta: f64) -> f64 {
    if incident == 0.0 {
        return ((eta - 1.0) / (eta + 1.0)).powi(2);
    }
    let passed = (incident.sin() / eta).asin();
    let (difference, sum) = (incident - passed, incident + passed);
    0.5 * ((difference.sin() / sum.sin()).powi(2) + (difference.tan() / sum.tan()).powi(2))
}

/// The cube [-1, 1]³ seen from inside: every wall faces inwards.
pub fn room() -> Mesh {
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

/// The image of `method` for each seed.
#[track_caller]
pub fn images(scene: &Scene, method: Method, passes: u64) -> Vec<Image> {
    images_with(scene, method, SEEDS, Settings { budget: Budget::Passes(passes), ..Settings::default() })
}

/// The image of `method` for each of `seeds` seeds, with the scene's depth and else with `settings`.
#[track_caller]
pub fn images_with(scene: &Scene, method: Method, seeds: u64, settings: Settings) -> Vec<Image> {
    let one = |seed| {
        let outcome = render(scene, method, &Settings { seed, max_depth: scene.max_depth, ..settings }, |_| {});
        assert_eq!(outcome.health, Default::default(), "{method:?} made invalid contributions");
        outcome.image
    };
    (0..seeds).map(one).collect()
}

/// Mean and standard error of `value` over the images.
pub fn estimate(images: &[Image], value: impl Fn(&Image) -> f64) -> Estimate {
    Estimate::of(&images.iter().map(value).collect::<Vec<_>>())
}

/// Mean of the colour over pixels and channels.
pub fn colour_mean(image: &Image) -> f64 {
    image.colour.iter().map(|v| f64::from(*v)).sum::<f64>() / image.colour.len() as f64
}

/// Mean of the light of the classes that `choose` picks by their word, such as `LSDE`.
pub fn classes_mean(image: &Image, choose: impl Fn(&str) -> bool) -> f64 {
    let mean = |(name, layer): (&String, &Layer)| match layer {
        Layer::Luminance(layer) if name.strip_prefix("path_").is_some_and(&choose) => {
            layer.iter().map(|v| f64::from(*v)).sum::<f64>() / layer.len() as f64
        }
        _ => 0.0,
    };
    image.layers.iter().map(mean).sum()
}

/// Mean of the light of one class.
pub fn class_mean(image: &Image, word: &str) -> f64 {
    classes_mean(image, |other| other == word)
}
