//! How much the directions of a path change in small steps, plain ones and controlled ones (Bitterli 2015, figure 5.5):
//! `cargo run --release --example angle_change -- scenes/spheres/scene.xml figure.png`.
//!
//! Independent paths are drawn in proportion to what they contribute, as a chain visits them, and each makes one small step
//! of either kind from the same numbers. The picture has plain steps on the left and controlled ones on the right; white is
//! a mean change of half a radian or more. Prints the means over the picture, and how many radians a hundredth of all paths
//! exceeds.

use image::{GrayImage, Luma};
use pathblend::film::Health;
use pathblend::load::{self, Options};
use pathblend::markov::{ChainState, ControlledMemory, Mutations, Tracer, controlled_step};
use pathblend::math::{Discrete, Stream, Walk};
use pathblend::paths::{Found, FullPath, Open};
use pathblend::scene::{Caster, Scene};
use rayon::prelude::*;
use std::error::Error;
use std::path::Path;

/// Film side in pixels.
const SIDE: usize = 128;
/// Path lengths in edges.
const LENGTHS: [usize; 3] = [3, 4, 5];
/// Paths of each length, drawn from eight times as many, in so many batches.
const PATHS: usize = 4096;
const BATCHES: u64 = 64;
/// The mean change that is shown white, in radians.
const WHITE: f64 = 0.5;

/// A path's pixel, and by how much a plain and a controlled step change it; `None` where the step finds no light.
struct Change {
    pixel: [usize; 2],
    angles: [Option<f64>; 2],
}

/// Mean angle between the edges of two paths, in radians.
fn angle(before: &FullPath, after: &FullPath) -> f64 {
    let direction = |path: &FullPath, m: usize| (path.position(m) - path.position(m + 1)).normalize_or_zero();
    let changes = (0..before.edges()).map(|m| direction(before, m).dot(direction(after, m)).clamp(-1.0, 1.0).acos());
    changes.sum::<f64>() / before.edges() as f64
}

/// What steps do to paths of one length.
fn changes(scene: &Scene, tracer: Tracer, batch: u64) -> Vec<Change> {
    let mutations = Mutations::default();
    let walk = |walk| {
        let scales = move |index| mutations.scales(walk, index, [SIDE; 2], Open::of(scene), false);
        (0..=tracer.edges).map(scales)
    };
    let scales: Vec<_> = std::iter::once([0.0; 4]).chain(walk(Walk::FromCamera)).chain(walk(Walk::FromLight)).collect();
    let mut state = ChainState::new(mutations.small_step, scales.into());
    let (caster, mut health, mut memory) = (Caster::new(scene), Health::default(), ControlledMemory::default());
    let [mut path, mut proposal] = [FullPath::default(), FullPath::default()];
    let stream = |number: usize| Stream::new(batch, &[tracer.edges as u64, number as u64]);
    let draw = |number: usize, state: &mut ChainState, path: &mut FullPath| -> Option<(Found, Stream)> {
        state.reset();
        let mut stream = stream(number);
        let s = tracer.technique(state.row(Tracer::TECHNIQUE_ROW, &mut stream)[0]);
        let found = tracer.find(&caster, s, state, &mut stream, path, &mut Health::default())?;
        Some((found, stream))
    };
    let luminance = |number| draw(number, &mut state, &mut path).map_or(0.0, |(found, _)| found.luminance);
    let targets: Vec<f64> = (0..8 * PATHS).map(luminance).collect();
    let Some(choice) = Discrete::new(&targets) else { return Vec::new() };
    let mut choices = Stream::new(batch, &[tracer.edges as u64]);
    let mut change = |_| {
        let (chosen, _) = choice.sample(choices.number());
        let (found, mut stream) = draw(chosen, &mut state, &mut path)?;
        state.accept();
        let mut after = stream.clone();
        state.propose(false);
        let plain = tracer.find(&caster, found.technique, &mut state, &mut stream, &mut proposal, &mut health);
        let plain = plain.map(|_| angle(&path, &proposal));
        state.reject();
        state.propose(false);
        let old = (&path, &found);
        let controlled =
            controlled_step(tracer, &caster, old, &mut state, &mut after, &mut proposal, &mut health, &mut memory);
        let controlled = controlled.map(|_| angle(&path, &proposal));
        let pixel = [found.film.x, found.film.y].map(|at| (at as usize).min(SIDE - 1));
        Some(Change { pixel, angles: [plain, controlled] })
    };
    (0..PATHS).filter_map(&mut change).collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(file), Some(figure)) = (arguments.next(), arguments.next()) else {
        return Err("expected a scene file and the name of a PNG".into());
    };
    let options = Options { size: Some([SIDE; 2]), ..Options::default() };
    let scene = load::read(Path::new(&file), &options)?.scene;
    let jobs: Vec<(u64, usize)> = (0..BATCHES).flat_map(|batch| LENGTHS.map(|edges| (batch, edges))).collect();
    let found: Vec<Change> =
        jobs.into_par_iter().flat_map_iter(|(batch, edges)| changes(&scene, Tracer { edges }, batch)).collect();
    let mut picture = GrayImage::new(2 * SIDE as u32, SIDE as u32);
    println!("| small steps | mean change | exceeded by 1 % | find no light |\n|---|---|---|---|");
    for (kind, name) in ["plain", "controlled"].into_iter().enumerate() {
        let mut pixels = vec![[0.0; 2]; SIDE * SIDE];
        let mut angles = Vec::new();
        for Change { pixel: [x, y], angles: both } in &found {
            let Some(angle) = both[kind] else { continue };
            let [sum, count] = &mut pixels[y * SIDE + x];
            (*sum, *count) = (*sum + angle, *count + 1.0);
            angles.push(angle);
        }
        angles.sort_by(f64::total_cmp);
        let (mean, lost) = (angles.iter().sum::<f64>() / angles.len() as f64, found.len() - angles.len());
        let most = angles.get(angles.len() * 99 / 100).copied().unwrap_or(f64::NAN);
        println!("| {name} | {mean:.4} | {most:.3} | {:.1} % |", 100.0 * lost as f64 / found.len() as f64);
        for (i, [sum, count]) in pixels.iter().enumerate() {
            let share = if *count > 0.0 { sum / count / WHITE } else { 0.0 };
            let column = (kind * SIDE + i % SIDE) as u32;
            picture.put_pixel(column, (i / SIDE) as u32, Luma([(share.min(1.0) * 255.0) as u8]));
        }
    }
    picture.save(figure)?;
    Ok(())
}
