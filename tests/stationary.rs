//! Chains keep their distribution under each mutation alone. They start with it, by resampling independent paths; without
//! large steps a mutation of wrong acceptance drives them away, and nothing brings them back.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::{Estimate, SIGMAS, build, diffuse, estimate, images, images_with, pinhole, rooms};
use glam::DVec3;
use pathblend::bsdf::Bsdf;
use pathblend::geometry::Solid;
use pathblend::image::{Image, Layer};
use pathblend::integrators::{Budget, Method, Settings, render};
use pathblend::markov::{FilmSteps, Jumps, LargeSteps, Mutations, SmallStep};
use pathblend::path_space::{Kind, PathMutations};
use pathblend::scene::{Builder, Scene};
use pathblend::spectrum::Spectrum;

const SIZE: usize = 8;

/// A ball close before the camera, within a hollow one: where a walk arrives elsewhere on them, the same direction has
/// quite other numbers.
fn balls() -> Scene {
    let mut builder = Builder::new();
    let wall = builder.bsdf(Bsdf::TwoSided(Box::new([diffuse(0.8), diffuse(0.8)])));
    builder.solid(Solid::sphere(DVec3::ZERO, 1.3), wall, None).unwrap();
    builder.solid(Solid::sphere(DVec3::new(0.0, -0.1, 0.0), 0.6), wall, None).unwrap();
    let lamp = Solid::disk(DVec3::new(0.2, 0.95, 0.4), -DVec3::Y, 0.4);
    builder.solid(lamp, wall, Some(Spectrum::grey(5.0).into())).unwrap();
    build(builder, pinhole(SIZE, 0.6, DVec3::new(0.0, 0.2, 0.95), DVec3::new(0.0, -0.2, -1.0).normalize()), 4)
}

/// The light of one class in each quarter of the image.
fn quarters(images: &[Image], class: &str) -> Vec<Estimate> {
    let quarter = |image: &Image, [left, top]: [usize; 2]| match image.layers.get(class) {
        Some(Layer::Luminance(layer)) => {
            let inside = |y: usize, x: usize| (y < SIZE / 2) == (top == 0) && (x < SIZE / 2) == (left == 0);
            let values = layer.indexed_iter().filter(|((y, x), _)| inside(*y, *x));
            values.map(|(_, v)| f64::from(*v)).sum::<f64>() / (SIZE * SIZE) as f64
        }
        _ => 0.0,
    };
    [[0, 0], [1, 0], [0, 1], [1, 1]].map(|at| estimate(images, |image| quarter(image, at))).into()
}

/// Every mutation alone, and with jumps.
fn cases() -> Vec<(&'static str, Method, Mutations)> {
    let never = Mutations { large_step: 0.0, jump: 0.0, ..Mutations::default() };
    let jumping = Mutations { jump: 0.3, ..never };
    let tries = Mutations { large_step: 1.0, large_steps: LargeSteps::TriesFrom(0), ..never };
    let kelemen = Mutations { small_step: SmallStep::KELEMEN, ..never };
    vec![
        ("small steps", Method::Mmlt, never),
        ("Kelemen's steps", Method::Mmlt, kelemen),
        ("Kelemen's steps and jumps", Method::Rjmlt, Mutations { jump: 0.3, ..kelemen }),
        ("steps by pixels", Method::Mmlt, Mutations { film_steps: FilmSteps::Pixels(2.0), ..never }),
        ("kept choices", Method::Mmlt, Mutations { keep_choices: true, ..never }),
        ("controlled steps", Method::Mmlt, Mutations { controlled: true, ..never }),
        ("controlled steps and jumps", Method::Rjmlt, Mutations { controlled: true, ..jumping }),
        ("small steps without jumps", Method::Rjmlt, never),
        ("small steps and jumps", Method::Rjmlt, jumping),
        ("jumps before small steps", Method::Rjmlt, Mutations { jumps: Jumps::Always, ..never }),
        ("jumps alone", Method::Rjmlt, Mutations { jump: 1.0, ..never }),
        ("kept choices and jumps", Method::Rjmlt, Mutations { keep_choices: true, ..jumping }),
        ("large steps", Method::Rjmlt, Mutations { large_step: 1.0, ..never }),
        ("tries", Method::Mmlt, tries),
        ("tries and jumps", Method::Rjmlt, Mutations { large_step: 0.5, jump: 0.5, ..tries }),
        ("small steps of all lengths", Method::Pssmlt, never),
        ("Kelemen's steps of all lengths", Method::Pssmlt, kelemen),
        ("kept choices of all lengths", Method::Pssmlt, Mutations { keep_choices: true, ..never }),
    ]
}

/// A class in one quarter of the image, and its light.
struct Part {
    class: String,
    quarter: usize,
    light: Estimate,
    /// Its share of the light of its length.
    of_length: f64,
    /// Its share of the light of all lengths that chains find.
    of_all: f64,
}

impl Part {
    /// Whether it has a twenty-fifth of the light of a chain's target at least: of a thousand chains forty begin there.
    fn is_large(&self, method: Method) -> bool {
        let share = if matches!(method, Method::Mlt | Method::Pssmlt) { self.of_all } else { self.of_length };
        share > 0.04
    }
}

/// The light of every class in every quarter.
fn parts(scene: &Scene, passes: u64) -> Vec<Part> {
    let truth = images(scene, Method::Bdpt, passes);
    let classes = truth[0].layers.keys().filter(|name| name.starts_with("path_"));
    let part = |class: &String| {
        let quarters = quarters(&truth, class).into_iter().enumerate();
        let part = |(quarter, light)| Part { class: class.clone(), quarter, light, of_length: 0.0, of_all: 0.0 };
        quarters.map(part).collect::<Vec<_>>()
    };
    let mut parts: Vec<Part> = classes.flat_map(part).collect();
    // Names of layers are longer by four letters than paths have edges, and two edges are left to path tracing.
    parts.retain(|part| part.class.len() > "path_LDE".len());
    let light = |length: Option<usize>| -> f64 {
        let chosen = parts.iter().filter(|part| length.is_none_or(|length| length == part.class.len()));
        chosen.map(|part| part.light.mean).sum()
    };
    let (all, lengths): (f64, Vec<f64>) = (light(None), (0..20).map(|length| light(Some(length))).collect());
    for part in &mut parts {
        let own = part.light.mean;
        (part.of_length, part.of_all) = (own / lengths[part.class.len()], own / all);
    }
    parts
}

/// Wide controlled steps.
fn controlled() -> Vec<(&'static str, Method, Mutations)> {
    let small_step = SmallStep::Gaussian { deviation: 0.1 };
    let wide = Mutations { large_step: 0.0, jump: 0.0, controlled: true, small_step, ..Mutations::default() };
    vec![
        ("wide controlled steps", Method::Mmlt, wide),
        ("wide controlled steps and jumps", Method::Rjmlt, Mutations { jump: 0.3, ..wide }),
    ]
}

/// Each mutation in path space alone, all of them, and with others.
fn in_path_space() -> Vec<(&'static str, Method, Mutations)> {
    let alone = |kinds: &[Kind]| {
        let path_space = PathMutations { kinds: kinds.to_vec().into(), ..PathMutations::default() };
        Mutations { large_step: 0.0, jump: 0.0, path_step: 1.0, path_space, ..Mutations::default() }
    };
    let kinds: [(_, &[Kind]); 6] = [
        ("bidirectional", &[Kind::Bidirectional]),
        ("lens", &[Kind::Lens]),
        ("caustic", &[Kind::Caustic]),
        ("multi-chain", &[Kind::MultiChain]),
        ("manifold", &[Kind::Manifold]),
        ("all in path space", &Kind::ALL),
    ];
    let fused = kinds.map(|(name, kind)| (name, Method::Fused, alone(kind)));
    let jumping = Mutations { jump: 0.4, ..alone(&Kind::ALL) };
    let mixed = Mutations { path_step: 0.5, jump: 0.2, ..alone(&Kind::ALL) };
    let mlt = kinds.map(|(name, kind)| (name, Method::Mlt, alone(kind)));
    let both = [("all and jumps", Method::Fused, jumping), ("both spaces", Method::Fused, mixed)];
    fused.into_iter().chain(mlt).chain(both).collect()
}

#[test]
fn path_space_keeps_the_distribution() {
    keep(&rooms::balls(SIZE), in_path_space(), 50);
}

#[test]
fn path_space_keeps_the_distribution_under_water() {
    keep(&rooms::water(SIZE), in_path_space(), 150);
}

/// Vertices that are nearly mirrors, or nearly clear, move with their chains.
#[test]
fn path_space_keeps_the_distribution_among_glossy_surfaces() {
    keep(&rooms::polished(SIZE), in_path_space(), 150);
}

#[test]
fn mutations_keep_the_distribution() {
    keep(&rooms::balls(SIZE), cases(), 150);
}

#[test]
fn controlled_steps_keep_the_distribution_on_balls() {
    keep(&balls(), controlled(), 1800);
}

/// `passes` of bdpt tell what is right, and as many of each case are judged.
fn keep(scene: &Scene, cases: Vec<(&'static str, Method, Mutations)>, passes: u64) {
    let parts = parts(scene, passes);
    let mut failures = Vec::new();
    for (name, method, mutations) in cases {
        let passes = if method == Method::Pssmlt { 40 } else { passes };
        let settings = Settings { budget: Budget::Passes(passes), mutations, ..Settings::default() };
        let found = images_with(scene, method, 64, settings);
        let mut worst = (0.0, String::new());
        let large: Vec<&Part> = parts.iter().filter(|part| part.is_large(method)).collect();
        assert!(large.len() > 4, "{} parts", large.len());
        for Part { class, quarter, light, .. } in large {
            let own = quarters(&found, class)[*quarter];
            let z = own.deviation(*light);
            if z > worst.0 {
                worst = (
                    z,
                    format!(
                        "{class}, quarter {quarter}: {:.5} ± {:.5}, expected {:.5}",
                        own.mean, own.error, light.mean
                    ),
                );
            }
        }
        println!("| {name} | {} | {:.1} | {}", method.name(), worst.0, worst.1);
        if worst.0 > SIGMAS {
            failures.push(format!("{name}: {}", worst.1));
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

/// What chains are scaled by, b of each length, is the light of paths of that length, and as uncertain as is said.
#[test]
fn normalisations_are_the_light_of_their_length() {
    let scene = rooms::balls(SIZE);
    let truth = images(&scene, Method::Bdpt, 150);
    let light_of = |edges: usize| {
        let layer = |image: &Image| {
            // `path_LDE`: two edges.
            let of_length =
                image.layers.iter().filter(|(name, _)| name.starts_with("path_") && name.len() == edges + 6);
            let sum = |layer: &Layer| match layer {
                Layer::Luminance(layer) => layer.iter().map(|v| f64::from(*v)).sum::<f64>(),
                _ => 0.0,
            };
            of_length.map(|(_, layer)| sum(layer)).sum::<f64>() / (SIZE * SIZE) as f64
        };
        estimate(&truth, layer)
    };
    for method in [Method::Mmlt, Method::Rjmlt] {
        let reports: Vec<_> = (0..64)
            .map(|seed| {
                let settings =
                    Settings { seed, max_depth: scene.max_depth, budget: Budget::Passes(8), ..Settings::default() };
                render(&scene, method, &settings, |_| {}).counts.chains
            })
            .collect();
        assert!(reports[0].len() >= 3, "{:?}", reports[0]);
        for (index, first) in reports[0].iter().enumerate() {
            let means: Vec<f64> = reports.iter().map(|reports| reports[index].mean).collect();
            let (found, expected) = (Estimate::of(&means), light_of(first.length));
            let z = found.deviation(expected);
            let claimed = reports.iter().map(|reports| reports[index].standard_error.powi(2)).sum::<f64>() / 64.0;
            let spread = found.error * 8.0 / claimed.sqrt();
            println!("| {} | {} | {:.5} | {z:.1} | {spread:.2} |", method.name(), first.length, found.mean);
            assert!(z < SIGMAS, "length {}: {found:?}, expected {expected:?}", first.length);
            assert!((0.5..2.0).contains(&spread), "length {}: spread over claim {spread}", first.length);
        }
    }
}
