//! Technique jumps keep the path: what a jump says that the new technique finds is what it finds when it is traced.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use pathblend::film::Health;
use pathblend::load::{Options, read};
use pathblend::markov::{ChainState, Jump, JumpMemory, Mutations, Tracer, jump};
use pathblend::math::{Stream, Walk};
use pathblend::paths::{Found, FullPath, Open};
use pathblend::scene::{Caster, Scene};
use rayon::prelude::*;
use std::path::Path;

const SCENES: [&str; 12] =
    ["box", "spheres", "plates", "door", "torus", "ring", "lamp", "gallery", "pool", "bokeh", "porch", "window"];

fn scene(name: &str) -> Scene {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).join("scene.xml");
    read(&file, &Options { size: Some([64, 64]), ..Options::default() }).expect("an own scene").scene
}

/// What jumps of one length have done.
#[derive(Clone, Debug, Default)]
struct Tally {
    moved: usize,
    failed: usize,
    /// Relative errors of the new target, of the film position in film widths, and of the vertices' positions.
    errors: Vec<f64>,
    /// Paths that the new technique does not find again, or as of another class.
    lost: usize,
}

impl Tally {
    fn merge(mut self, other: Self) -> Self {
        self.moved += other.moved;
        self.failed += other.failed;
        self.lost += other.lost;
        self.errors.extend(other.errors);
        self
    }
}

/// Jumps from `count` random paths of `edges` edges.
fn jumps(scene: &Scene, edges: usize, count: u64, seed: u64) -> Tally {
    let tracer = Tracer { edges };
    let mutations = Mutations::default();
    let open = Open::of(scene);
    let walk = |walk| (0..=edges).map(move |index| mutations.scales(walk, index, [64, 64], open, false));
    let scales: Vec<_> = std::iter::once([1.0; 4]).chain(walk(Walk::FromCamera)).chain(walk(Walk::FromLight)).collect();
    let caster = Caster::new(scene);
    let mut state = ChainState::new(mutations.small_step, scales.into());
    let (mut stream, mut memory) = (Stream::new(seed, &[edges as u64]), JumpMemory::default());
    let [mut path, mut again] = [FullPath::default(), FullPath::default()];
    let (mut health, mut tally) = (Health::default(), Tally::default());
    // A scene may have no light of this length.
    for _ in 0..200 * count {
        if tally.moved + tally.failed >= count as usize {
            break;
        }
        state.reset();
        let s = tracer.technique(stream.number());
        let found = tracer.find(&caster, s, &mut state, &mut stream, &mut path, &mut health);
        state.accept();
        let Some(before) = found else { continue };
        let mut found = before;
        match jump(scene, &path, &mut found, &mut state, &mut stream, &mut memory) {
            Jump::Stayed => continue,
            Jump::Failed => tally.failed += 1,
            Jump::Moved => {
                tally.moved += 1;
                let traced = tracer.find(&caster, found.technique, &mut state, &mut stream, &mut again, &mut health);
                match traced.filter(|traced| traced.class == found.class) {
                    None => tally.lost += 1,
                    Some(traced) => tally.errors.push(error(scene, &found, &traced)),
                }
            }
        }
    }
    tally
}

fn error(scene: &Scene, expected: &Found, found: &Found) -> f64 {
    let width = scene.camera.size[0] as f64;
    let film = (expected.film - found.film).length() / width;
    (found.luminance / expected.luminance - 1.0).abs().max(film)
}

fn measure(name: &str, count: u64) -> Vec<(usize, Tally)> {
    const PARTS: u64 = 16;
    let scene = scene(name);
    let part = |edges: usize| {
        let parts = (0..PARTS).into_par_iter().map(|part| jumps(&scene, edges, count.div_ceil(PARTS), part));
        (edges, parts.reduce(Tally::default, Tally::merge))
    };
    (2..=10).map(part).collect()
}

/// Errors in the median and at a thousandth from the top, failures and losses as shares.
fn check(name: &str, count: u64) {
    let lengths = measure(name, count);
    let mut all = Tally::default();
    for (edges, mut tally) in lengths {
        tally.errors.sort_by(f64::total_cmp);
        let at = |share: f64| tally.errors.get((tally.errors.len() as f64 * share) as usize).copied().unwrap_or(0.0);
        println!(
            "{name} {edges}: {} moved, {} failed, {} lost, median {:.1e}, 99.9 % {:.1e}, worst {:.1e}",
            tally.moved,
            tally.failed,
            tally.lost,
            at(0.5),
            at(0.999),
            at(1.0 - 1e-9)
        );
        all = all.merge(tally);
    }
    let moved = all.moved as f64;
    all.errors.sort_by(f64::total_cmp);
    let at = |share: f64| all.errors[(all.errors.len() as f64 * share) as usize];
    assert!(at(0.5) < 1e-9 && at(0.999) < 1e-6, "{name}: errors {:e} and {:e}", at(0.5), at(0.999));
    assert!((all.failed as f64) < 1e-3 * moved, "{name}: {} of {moved} inversions failed", all.failed);
    assert!((all.lost as f64) < 1e-3 * moved, "{name}: {} of {moved} paths are not found again", all.lost);
}

#[test]
fn jumps_keep_the_path() {
    SCENES.iter().for_each(|name| check(name, 500));
}

/// A hundred thousand paths of each length of each scene.
#[test]
#[ignore = "long: cargo test --release --test jumps -- --ignored --nocapture"]
fn jumps_keep_many_paths() {
    SCENES.iter().for_each(|name| check(name, 100_000));
}
