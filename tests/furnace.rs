//! White furnaces: every scattering model under light of radiance 1 from everywhere, by every method.
//!
//! What such a surface shows is its albedo for the direction of view, which these tests compute by quadrature over
//! [`Bsdf::evaluate`] and from the lobes without density, of which only [`Bsdf::sample`] knows. A model that loses nothing
//! shows 1 and cannot be told from the light behind it; no model shows more.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::{
    Estimate, METHODS, SEEDS, SIGMAS, Worst, build, classes_mean, colour_mean, estimate, glass, images, images_with,
    parallel, pinhole, room,
};
use glam::{DVec2, DVec3};
use pathblend::bsdf::{
    Blend, Bsdf, Coating, Conductor, Diffuse, Distribution, Mask, Phong, Plastic, Principled, RoughCoat,
    RoughConductor, RoughDielectric, RoughPlastic, Roughness, ThinDielectric,
};
use pathblend::geometry::Solid;
use pathblend::integrators::{Budget, Method, Settings};
use pathblend::math::Walk;
use pathblend::paths::Heuristic;
use pathblend::scene::{Builder, Caster, Scene, Shine, Surface};
use pathblend::spectrum::Spectrum;
use pathblend::texture::{Colour, Number};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

const SIZE: usize = 16;

fn colour(r: f64, g: f64, b: f64) -> Colour {
    Spectrum::rgb(r, g, b).into()
}

fn paint() -> Bsdf {
    Bsdf::Diffuse(Diffuse { reflectance: colour(0.2, 0.5, 0.9) })
}

fn gold() -> Conductor {
    let index = Some((Spectrum::rgb(0.14, 0.37, 1.44), Spectrum::rgb(3.98, 2.39, 1.6)));
    Conductor { index, specular_reflectance: Spectrum::ONE.into() }
}

fn mirror() -> Bsdf {
    let one_side = Bsdf::Conductor(Conductor { index: None, specular_reflectance: Spectrum::ONE.into() });
    Bsdf::TwoSided(Box::new([one_side.clone(), one_side]))
}

fn roughness(distribution: Distribution, [u, v]: [f64; 2]) -> Roughness {
    Roughness { distribution, alpha_u: u.into(), alpha_v: v.into(), visible: true }
}

fn rough_gold(distribution: Distribution, alpha: [f64; 2]) -> Bsdf {
    Bsdf::RoughConductor(RoughConductor { metal: gold(), roughness: roughness(distribution, alpha) })
}

fn frosted(distribution: Distribution, alpha: f64) -> Bsdf {
    let one = Spectrum::ONE;
    let roughness = roughness(distribution, [alpha; 2]);
    Bsdf::RoughDielectric(RoughDielectric {
        eta: 1.5,
        roughness,
        specular_reflectance: one,
        specular_transmittance: one,
    })
}

fn pane() -> Bsdf {
    let one = Spectrum::ONE;
    Bsdf::ThinDielectric(ThinDielectric { eta: 1.5, specular_reflectance: one, specular_transmittance: one })
}

fn plastic() -> Bsdf {
    Bsdf::Plastic(Plastic::new(1.5, colour(0.2, 0.5, 0.9), colour(1.0, 0.9, 0.8), true))
}

fn rough_plastic(distribution: Distribution, alpha: f64) -> Bsdf {
    let coat = RoughCoat::new(1.5, (distribution, alpha, true));
    Bsdf::RoughPlastic(Box::new(RoughPlastic::new(coat, colour(0.2, 0.5, 0.8), Spectrum::ONE.into(), false)))
}

fn phong(exponent: f64) -> Bsdf {
    Bsdf::Phong(Phong {
        exponent: exponent.into(),
        specular_reflectance: colour(0.3, 0.4, 0.5),
        diffuse_reflectance: colour(0.4, 0.3, 0.2),
    })
}

/// Burley's model with roughness, metallic, spec_trans, anisotropic, and strengths of sheen and coat.
fn principled([roughness, metallic, spec_trans, anisotropic]: [f64; 4], sheen: f64, coat: f64) -> Bsdf {
    Bsdf::Principled(Box::new(Principled {
        base_color: colour(0.5, 0.3, 0.1),
        roughness: roughness.into(),
        anisotropic: anisotropic.into(),
        metallic: metallic.into(),
        spec_trans: spec_trans.into(),
        spec_tint: 0.5.into(),
        sheen: sheen.into(),
        sheen_tint: 0.5.into(),
        flatness: 0.3.into(),
        clearcoat: coat.into(),
        clearcoat_gloss: 0.2.into(),
        eta: 1.5,
    }))
}

fn coating(depth: f64, rough: Option<f64>, nested: Bsdf) -> Bsdf {
    let rough = rough.map(|alpha| RoughCoat::new(1.5, (Distribution::Ggx, alpha, true)));
    let (depth, specular_reflectance) = (Spectrum::grey(depth), Spectrum::ONE.into());
    Bsdf::Coating(Box::new(Coating { eta: 1.5, depth, rough, specular_reflectance, nested: Box::new(nested) }))
}

fn mask(opacity: f64, nested: Bsdf) -> Bsdf {
    Bsdf::Mask(Mask { opacity: Number::Constant(opacity), nested: Box::new(nested) })
}

fn blend(weight: f64, first: Bsdf, second: Bsdf) -> Bsdf {
    Bsdf::Blend(Blend { weight: Number::Constant(weight), nested: Box::new([first, second]) })
}

/// Models that reflect, and lose something.
fn reflecting() -> Vec<(&'static str, Bsdf)> {
    use Distribution::{Beckmann, Ggx};
    vec![
        ("diffuse", paint()),
        ("conductor", Bsdf::Conductor(gold())),
        ("rough conductor ggx", rough_gold(Ggx, [0.3; 2])),
        ("rough conductor beckmann", rough_gold(Beckmann, [0.15; 2])),
        ("rough conductor anisotropic", rough_gold(Ggx, [0.15, 0.5])),
        ("plastic", plastic()),
        ("rough plastic ggx", rough_plastic(Ggx, 0.15)),
        ("rough plastic beckmann", rough_plastic(Beckmann, 0.4)),
        ("phong", phong(30.0)),
        ("principled", principled([0.5, 0.0, 0.0, 0.0], 0.5, 1.0)),
        ("principled metal", principled([0.6, 1.0, 0.0, 0.7], 0.0, 0.0)),
        ("coating of diffuse", coating(0.1, None, paint())),
        ("coating of metal", coating(0.4, None, rough_gold(Ggx, [0.4; 2]))),
        ("rough coating of diffuse", coating(0.2, Some(0.2), paint())),
        ("blend", blend(0.3, paint(), rough_gold(Ggx, [0.2, 0.4]))),
        ("turned plastic", Bsdf::Turned(Box::new(plastic()))),
        ("two-sided", Bsdf::TwoSided(Box::new([phong(20.0), paint()]))),
    ]
}

/// Models that let light pass and lose something on the way, or because the radiance of what is refracted is squeezed.
fn transmitting() -> Vec<(&'static str, Bsdf)> {
    use Distribution::{Beckmann, Ggx};
    vec![
        ("half of glass", glass(1.5)),
        ("half of rough glass ggx", frosted(Ggx, 0.3)),
        ("half of rough glass beckmann", frosted(Beckmann, 0.15)),
        ("half of principled glass", principled([0.5, 0.0, 1.0, 0.0], 0.0, 0.0)),
        ("mask of diffuse", mask(0.3, paint())),
        ("mask of rough glass", mask(0.6, frosted(Ggx, 0.4))),
        ("blend of rough glass, plastic", blend(0.6, frosted(Ggx, 0.3), plastic())),
    ]
}

/// Models that lose nothing, as closed bodies.
fn clear() -> Vec<(&'static str, Bsdf)> {
    vec![
        ("dielectric", glass(1.5)),
        ("dielectric of lower index", glass(0.7)),
        ("turned dielectric", Bsdf::Turned(Box::new(glass(1.0 / 1.5)))),
        ("thin dielectric", pane()),
        ("null", Bsdf::Null),
        ("mirror", mirror()),
        ("mask of a mirror", mask(0.5, mirror())),
        ("blend of glass, null", blend(0.5, glass(1.5), Bsdf::Null)),
    ]
}

/// A disk whose normal is ±z, seen by parallel rays at an angle of 53° that lies askew to its tangents.
fn disk(bsdf: Bsdf, side: f64) -> Scene {
    let mut builder = Builder::new();
    let bsdf = builder.bsdf(bsdf);
    builder.solid(Solid::disk(DVec3::ZERO, DVec3::Z * side, 1.0), bsdf, None).unwrap();
    builder.emitter(Shine::Environment(Spectrum::ONE)).unwrap();
    let back = DVec3::new(0.48, 0.64, 0.6);
    // The view and the photons around it end well before the rim: beyond there are none to be gathered.
    build(builder, parallel(SIZE, 0.35, back * 5.0, -back), 2)
}

/// Mean over the channels.
fn grey(value: Spectrum) -> f64 {
    value.to_rgb().iter().sum::<f64>() / 3.0
}

/// Albedo of what the camera sees in the middle of its film, by the middles of `n` by 2`n` cells of the sphere.
fn albedo(scene: &Scene, n: usize) -> f64 {
    let caster = Caster::new(scene);
    let (origin, direction) = scene.camera.ray(DVec2::splat(0.5 * SIZE as f64), [0.5; 4]);
    let surface = caster.see(origin.into(), direction).expect("the disk");
    let wi = surface.frame.to_local(-direction);
    smooth_albedo(scene, &surface, wi, n) + delta_albedo(scene, &surface, wi)
}

fn smooth_albedo(scene: &Scene, surface: &Surface, wi: DVec3, n: usize) -> f64 {
    let step = PI / n as f64;
    let ring = |i: usize| -> f64 {
        let (sin, cos) = (step * (i as f64 + 0.5)).sin_cos();
        let value = |j: usize| {
            let (y, x) = (TAU * (j as f64 + 0.5) / (2 * n) as f64).sin_cos();
            let wo = DVec3::new(sin * x, sin * y, cos);
            scene.evaluate(surface, wi, wo, Walk::FromCamera).map_or(0.0, |found| grey(found.value))
        };
        (0..2 * n).map(value).sum::<f64>() * cos.abs() * sin * step * step
    };
    (0..n).into_par_iter().map(ring).sum()
}

/// The first number of a row chooses among all lobes, so an even choice of it finds them with their probabilities.
fn delta_albedo(scene: &Scene, surface: &Surface, wi: DVec3) -> f64 {
    let n = 200_000;
    let weight = |i: usize| {
        let row = [(i as f64 + 0.5) / f64::from(n), 0.5, 0.5, 0.5];
        let scatter = scene.scatter(surface, wi, row, Walk::FromCamera).filter(|scatter| scatter.delta);
        scatter.map_or(0.0, |scatter| grey(scatter.weight))
    };
    (0..n as usize).into_par_iter().map(weight).sum::<f64>() / f64::from(n)
}

/// A disk of each model, from both sides where these differ, by each method, against the albedo by quadrature.
#[test]
fn every_model_shows_its_albedo() {
    let mut worst = Worst::default();
    for (name, bsdf) in reflecting().into_iter().chain(transmitting()).chain(clear()) {
        let backs = bsdf.transmits() || matches!(bsdf, Bsdf::TwoSided(_) | Bsdf::Turned(_));
        for side in if backs { [1.0, -1.0].as_slice() } else { &[1.0] } {
            let scene = disk(bsdf.clone(), *side);
            let expected = albedo(&scene, 400);
            // How far it is from one of twice the step bounds what is left of its error.
            let error = (albedo(&scene, 200) - expected).abs() + 1e-5;
            assert!(error < 1e-3, "{name}: the quadrature is too coarse: {error}");
            // Half of a glass body is a lens for radiance: from within, what comes in from outside is η² times as bright.
            let most = if bsdf.transmits() { 1.5f64.powi(2) } else { 1.0 };
            assert!(expected <= most + error, "{name} makes light: {expected}");
            for method in METHODS {
                let found = estimate(&images(&scene, method, 4), colour_mean);
                worst.expect(method, &format!("{name}, side {side}"), found, Estimate::exact(expected, error));
            }
        }
    }
    worst.print();
}

/// The simplest model by many paths, so that a density which is off by a few parts in a hundred shows, although it has a
/// share in the weights only; by walks from the sky alone, where nothing else hides what they are worth; and by vertex
/// connection with next to no merging, which has most of the weight elsewhere, and weights that let the lens see a few parts
/// in a hundred of all light by itself.
#[test]
fn paint_under_an_even_sky_is_exact() {
    let mut worst = Worst::default();
    let scene = disk(paint(), 1.0);
    let expected = Estimate::exact((0.2 + 0.5 + 0.9) / 3.0, 0.0);
    for method in METHODS {
        worst.expect(method, "diffuse", estimate(&images(&scene, method, 100), colour_mean), expected);
    }
    worst.expect(Method::Light, "diffuse", estimate(&images(&scene, Method::Light, 1000), colour_mean), expected);
    let heuristic = Heuristic::Balance;
    let connecting = Settings { radius: 0.01, heuristic, budget: Budget::Passes(400), ..Settings::default() };
    let found = estimate(&images_with(&scene, Method::Vcm, SEEDS, connecting), colour_mean);
    worst.expect(Method::Vcm, "diffuse, small radius", found, expected);
    worst.print();
}

/// Balls of all that loses nothing, seen as a whole.
#[test]
fn clear_models_are_invisible() {
    let mut worst = Worst::default();
    for (name, bsdf) in clear() {
        let mut builder = Builder::new();
        let bsdf = builder.bsdf(bsdf);
        builder.solid(Solid::sphere(DVec3::ZERO, 1.0), bsdf, None).unwrap();
        builder.emitter(Shine::Environment(Spectrum::ONE)).unwrap();
        let scene = build(builder, parallel(8, 1.0, DVec3::new(0.0, 0.0, -4.0), DVec3::Z), 40);
        for method in METHODS {
            // Only roulette makes noise, and so rarely that it takes many paths to tell. Chains know no roulette, and look
            // for light of dozens of lengths in each pass.
            let passes = if method.has_chains() { 4 } else { 64 };
            let found = estimate(&images(&scene, method, passes), colour_mean);
            worst.expect(method, name, found, Estimate::exact(1.0, 0.0));
        }
    }
    worst.print();
}

/// A pane of rough glass with a mirror around its rim, where light scatters on both faces many times over: no closed form,
/// but all methods agree with path tracing, path length by path length, and none shows more than 1. Faces are flat and
/// the rim is many thicknesses away, so that a photon's neighbour sees the same light of each length.
#[test]
fn panes_of_rough_glass_lose_but_do_not_gain() {
    let mut worst = Worst::default();
    for (name, bsdf) in [
        ("rough glass ggx", frosted(Distribution::Ggx, 0.3)),
        ("rough glass beckmann", frosted(Distribution::Beckmann, 0.5)),
        ("principled glass", principled([0.6, 0.0, 1.0, 0.0], 0.0, 0.0)),
    ] {
        let mut builder = Builder::new();
        let (bsdf, mirror) = (builder.bsdf(bsdf), builder.bsdf(mirror()));
        let half_height = DVec3::Z * 0.1;
        builder.solid(Solid::disk(half_height, DVec3::Z, 1.0), bsdf, None).unwrap();
        builder.solid(Solid::disk(-half_height, -DVec3::Z, 1.0), bsdf, None).unwrap();
        builder.solid(Solid::cylinder(-half_height, half_height, 1.0), mirror, None).unwrap();
        builder.emitter(Shine::Environment(Spectrum::ONE)).unwrap();
        let back = DVec3::new(0.48, 0.0, 0.8772684879784524);
        let scene = build(builder, parallel(SIZE, 0.3, back * 5.0 + half_height, -back), 5);
        agree(&scene, name, 32, &mut worst);
    }
    worst.print();
}

/// A room whose walls shine with radiance 1 and scatter by the model: light of one bounce and of more, by path length.
#[test]
fn rooms_of_every_model_agree() {
    let mut worst = Worst::default();
    for (name, bsdf) in reflecting() {
        let mut builder = Builder::new();
        let bsdf = builder.bsdf(bsdf);
        builder.mesh(room(), bsdf, Some(Spectrum::ONE.into())).unwrap();
        // Off the corners: there a photon gather's disk reaches past the wall.
        let camera = pinhole(SIZE, 0.3, DVec3::new(0.1, 0.2, 0.0), DVec3::new(0.05, 0.02, 1.0));
        agree(&build(builder, camera, 4), name, 4, &mut worst);
    }
    worst.print();
}

/// All methods against path tracing, by path length; light of any one length has no more than radiance 1.
#[track_caller]
fn agree(scene: &Scene, name: &str, passes: u64, worst: &mut Worst) {
    let light = |method| -> Vec<Estimate> {
        let images = images(scene, method, passes);
        // A word has a letter less than its path has edges, and two more for the ends.
        let length = |edges: usize| estimate(&images, |image| classes_mean(image, |word| word.len() == edges + 1));
        (2..=scene.max_depth).map(length).collect()
    };
    let path = light(Method::Path);
    for method in METHODS {
        for (index, (found, expected)) in light(method).into_iter().zip(&path).enumerate() {
            // Of light that few photons carry, a spread over runs says nothing.
            if expected.mean < 0.02 {
                continue;
            }
            let what = format!("{name}, {} edges", index + 2);
            assert!(found.mean < 1.0 + SIGMAS * found.error + 1e-5, "{method:?}, {what}: {found:?} is too bright");
            worst.expect(method, &what, found, *expected);
        }
    }
}
