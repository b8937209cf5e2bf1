//! Parallel light through glass onto a diffuse floor: how much of it arrives is known. Only walks from the light find it,
//! so these tests weigh nothing but light tracing, photons and their scattering.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::{Estimate, METHODS, Worst, build, class_mean, diffuse, estimate, glass, images, parallel, reflectance};
use glam::{DVec2, DVec3, Vec3};
use pathblend::geometry::Solid;
use pathblend::integrators::Method;
use pathblend::scene::{Builder, Mesh, Scene, Shine};
use pathblend::spectrum::Spectrum;
use std::f64::consts::{PI, TAU};

const SIZE: usize = 16;
const ETA: f64 = 1.5;
const REFLECTANCE: f64 = 0.7;
/// Of a surface that faces the light.
const IRRADIANCE: f64 = 3.0;
/// The methods that find caustics of parallel light.
const FROM_LIGHT: [Method; 6] = [Method::Bdpt, Method::Sppm, Method::Vcm, Method::Pssmlt, Method::Mmlt, Method::Rjmlt];

/// A pass of chains begins with thousands of samples of each path length without light.
fn passes(method: Method) -> u64 {
    if method.has_chains() { 16 } else { 80 }
}

/// A square floor in the plane z = 0 whose shading normal is `normal`.
fn floor(builder: &mut Builder, half: f32, normal: DVec3) {
    let paint = builder.bsdf(diffuse(REFLECTANCE));
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let positions = corners.map(|(x, y)| Vec3::new(x, y, 0.0) * half).to_vec();
    let normals = if normal == DVec3::Z { Vec::new() } else { vec![normal.as_vec3(); 4] };
    let mesh = Mesh { positions, normals, triangles: vec![[0, 1, 2], [0, 2, 3]], ..Mesh::default() };
    builder.mesh(mesh, paint, None).unwrap();
}

/// Looks straight down at a square of the floor, from so low that what is above neither blocks it nor is seen.
fn from_below(builder: Builder, half: f64) -> Scene {
    build(builder, parallel(SIZE, half, DVec3::Z * 0.3, -DVec3::Z), 7)
}

/// A plate lets (1 − R)² of the light pass directly and R² of that after a way back and forth within. Where a floor is
/// shaded as if it were tilted, it shows light by the cosine with its shading normal, whichever walk has found it (Veach
/// 1997, section 5.3).
#[test]
fn a_plate_passes_what_fresnel_says_onto_any_floor() {
    let towards = DVec3::new(0.6, 0.0, 0.8);
    let r = reflectance(towards.z.acos(), ETA);
    let mut worst = Worst::default();
    for tilt in [DVec3::ZERO, DVec3::new(-0.4, 0.3, 0.0)] {
        let normal = (DVec3::Z + tilt).normalize();
        let mut builder = Builder::new();
        // All borders are further from the view than photons are gathered: these have neighbours everywhere.
        floor(&mut builder, 0.7, normal);
        let bsdf = builder.bsdf(glass(ETA));
        for (z, side) in [(0.6, 1.0), (0.5, -1.0)] {
            builder.solid(Solid::disk(DVec3::new(0.4, 0.0, z), DVec3::Z * side, 1.0), bsdf, None).unwrap();
        }
        builder.emitter(Shine::Directional(towards, Spectrum::grey(IRRADIANCE))).unwrap();
        let scene = from_below(builder, 0.4);
        let once = REFLECTANCE / PI * IRRADIANCE * towards.dot(normal.as_vec3().as_dvec3()) * (1.0 - r).powi(2);
        for method in FROM_LIGHT {
            let images = images(&scene, method, passes(method));
            for (word, expected) in [("LSSDE", once), ("LSSSSDE", once * r * r)] {
                let found = estimate(&images, |image| class_mean(image, word));
                worst.expect(method, &format!("{word}, normal {normal}"), found, Estimate::exact(expected, 0.0));
            }
        }
    }
    worst.print();
}

/// Half the width of what is seen below the ball, its radius and its height.
const SEEN: f64 = 0.6;
const RADIUS: f64 = 0.5;
const HEIGHT: f64 = 1.0;

/// Where light that comes straight down at the distance `b` from the axis of the ball meets the floor, as a signed
/// distance from the axis, and the share of it that gets through; `None` where it does not come down. It enters at the
/// angle i, is turned by i − t at both surfaces, and leaves at the angle i too.
fn through_the_ball(b: f64) -> Option<(f64, f64)> {
    let incident = (b / RADIUS).asin();
    let turn = incident - (b / RADIUS / ETA).asin();
    let entry = DVec2::new(b, RADIUS * incident.cos());
    let inside = DVec2::new(-turn.sin(), -turn.cos());
    let exit = entry - inside * (2.0 * entry.dot(inside));
    let leaves = DVec2::new(-(2.0 * turn).sin(), -(2.0 * turn).cos());
    let distance = (HEIGHT + exit.y) / -leaves.y;
    let passes = (1.0 - reflectance(incident, ETA)).powi(2);
    (leaves.y < 0.0).then_some((exit.x + leaves.x * distance, passes))
}

/// Flux that the ball refracts into the view, for unit irradiance.
fn focused_flux() -> f64 {
    let (n, turns) = (4000, 720);
    let step = RADIUS / f64::from(n);
    let ring = |i: i32| {
        let b = step * (f64::from(i) + 0.5);
        let Some((place, passes)) = through_the_ball(b) else { return 0.0 };
        let inside = |j: &i32| {
            let at = DVec2::from_angle(TAU * (f64::from(*j) + 0.5) / f64::from(turns)) * place;
            at.abs().max_element() < SEEN
        };
        let share = (0..turns).filter(inside).count() as f64 / f64::from(turns);
        TAU * b * step * passes * share
    };
    (0..n).map(ring).sum()
}

/// Parallel light on a ball of glass: its shadow lacks the light that met the ball, its caustic has what passed. The mean
/// over a square larger than the caustic is a flux, which a radius of photons does not change.
#[test]
fn a_ball_of_glass_focuses_the_flux_that_passes_it() {
    let mut builder = Builder::new();
    floor(&mut builder, 1.2, DVec3::Z);
    let bsdf = builder.bsdf(glass(ETA));
    builder.solid(Solid::sphere(DVec3::Z * HEIGHT, RADIUS), bsdf, None).unwrap();
    builder.emitter(Shine::Directional(DVec3::Z, Spectrum::grey(IRRADIANCE))).unwrap();
    let scene = from_below(builder, SEEN);
    let per_flux = REFLECTANCE / PI * IRRADIANCE / (4.0 * SEEN * SEEN);
    let direct = per_flux * (4.0 * SEEN * SEEN - PI * RADIUS * RADIUS);
    let focused = per_flux * focused_flux();
    let mut worst = Worst::default();
    for method in METHODS {
        let images = images(&scene, method, passes(method));
        let class = |word: &str| estimate(&images, |image| class_mean(image, word));
        worst.expect(method, "LDE", class("LDE"), Estimate::exact(direct, 0.0));
        if FROM_LIGHT.contains(&method) {
            worst.expect(method, "LSSDE", class("LSSDE"), Estimate::exact(focused, 1e-4 * focused));
        }
    }
    worst.print();
}

/// A floor at the bottom of a medium: the surface lets power pass, (1 − R) of it, on the way in, and radiance, squeezed by
/// η², on the way out. Only photons find it, since both walks have to refract.
#[test]
fn a_floor_under_a_surface_shows_power_in_and_radiance_out() {
    let towards = DVec3::new(0.6, 0.0, 0.8);
    let mut builder = Builder::new();
    floor(&mut builder, 0.7, DVec3::Z);
    let bsdf = builder.bsdf(glass(ETA));
    builder.solid(Solid::disk(DVec3::Z * 0.5, DVec3::Z, 1.0), bsdf, None).unwrap();
    builder.emitter(Shine::Directional(towards, Spectrum::grey(IRRADIANCE))).unwrap();
    let scene = build(builder, parallel(SIZE, 0.4, DVec3::Z, -DVec3::Z), 5);
    let arrives = IRRADIANCE * towards.z * (1.0 - reflectance(towards.z.acos(), ETA));
    let expected = arrives * REFLECTANCE / PI * (1.0 - reflectance(0.0, ETA)) / (ETA * ETA);
    let mut worst = Worst::default();
    for method in [Method::Sppm, Method::Vcm] {
        let found = estimate(&images(&scene, method, 80), |image| class_mean(image, "LSDSE"));
        worst.expect(method, "LSDSE", found, Estimate::exact(expected, 0.0));
    }
    worst.print();
}
