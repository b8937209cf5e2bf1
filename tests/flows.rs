//! Mutations in path space, and independent paths as proposals, are in detailed balance: as much goes from here to there as
//! comes back. Independent paths, each worth what a chain's target has of it, make one mutation each; what flows between
//! classes and techniques has to cancel, and so has what mutations change of paths of a class: where they are, and how much
//! they contribute.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::{SIGMAS, rooms};
use pathblend::film::{Health, PathClass};
use pathblend::markov::Tracer;
use pathblend::math::{Stream, pick};
use pathblend::path_space::{
    Drawn, Gain, Kind, Lengths, Mixture, PathMutations, PathSpace, Proposed, Radii, Seeds, Target, Ways, Weights,
};
use pathblend::paths::{Found, FullPath, TECHNIQUES, Techniques, connect_visible};
use pathblend::scene::{Caster, Scene};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;

const SIZE: usize = 8;
const LENGTHS: Lengths = Lengths { least: 3, most: 5 };
/// Wide perturbations, in which densities change much.
const WIDE: Radii = Radii { least: 0.01, most: 0.5 };
/// Paths come in so many batches.
const BATCHES: u64 = 100;
/// What fewer paths make is left alone: each way, since a flow of many paths that are worth little may come back as one that
/// is worth much.
const FEWEST: u64 = 30;

/// Flows between paths that techniques hardly find, and that are worth more than this, count in proportion less: the same for
/// both directions, so that they still cancel, and no single path decides.
const MOST_WORTH: f64 = 3.0;

/// A sum of what should cancel.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    sum: f64,
    squares: f64,
    /// Of how many terms, and how many of these are below zero.
    count: u64,
    negative: u64,
}

impl Sum {
    fn add(&mut self, value: f64) {
        self.merge(&Self { sum: value, squares: value * value, count: 1, negative: u64::from(value < 0.0) });
    }

    fn merge(&mut self, other: &Self) {
        self.sum += other.sum;
        self.squares += other.squares;
        self.count += other.count;
        self.negative += other.negative;
    }

    /// Whether there is enough of it to be judged.
    fn is_known(&self) -> bool {
        self.negative.min(self.count - self.negative) >= FEWEST
    }

    /// The sum in its standard errors.
    fn z(&self) -> f64 {
        self.sum.abs() / self.squares.sqrt().max(f64::MIN_POSITIVE)
    }
}

/// A class and a technique of it.
type Cell = (PathClass, usize);

/// What flows between cells, and how quantities change within a class, by their number.
#[derive(Clone, Debug, Default)]
struct Flows {
    between: BTreeMap<[Cell; 2], Sum>,
    drifts: BTreeMap<(PathClass, usize), Sum>,
}

impl Flows {
    fn merge(mut self, other: Self) -> Self {
        for (cells, sum) in &other.between {
            self.between.entry(*cells).or_default().merge(sum);
        }
        for (drift, sum) in &other.drifts {
            self.drifts.entry(*drift).or_default().merge(sum);
        }
        self
    }

    /// A path of this `worth` goes on.
    fn add(&mut self, target: Target, worth: f64, [from, to]: [(&Found, &FullPath); 2]) {
        // A target of paths does not tell their techniques apart, and has f where `Found` has f over a technique's density.
        let by_technique = target == Target::Technique;
        let cell = |found: &Found| (found.class, if by_technique { found.technique } else { 0 });
        let (from_cell, to_cell) = (cell(from.0), cell(to.0));
        if from_cell < to_cell {
            self.between.entry([from_cell, to_cell]).or_default().add(worth);
        } else if to_cell < from_cell {
            self.between.entry([to_cell, from_cell]).or_default().add(-worth);
        }
        if from.0.class != to.0.class {
            return;
        }
        let [before, after] = [from, to].map(|(found, path)| {
            let contribution = if by_technique { found.luminance.ln() } else { 0.0 };
            quantities(path, contribution)
        });
        for (number, (a, b)) in after.into_iter().zip(before).enumerate() {
            // What stays is off by rounding alone.
            if (a - b).abs() > 1e-9 {
                self.drifts.entry((from.0.class, number)).or_default().add(worth * (a - b));
            }
        }
    }
}

/// Where a path is, on the film, on the light and next to it; how steep its edges next to the ends are and how it bends
/// there, how long all edges are, and the logarithm of its `contribution`.
fn quantities(path: &FullPath, contribution: f64) -> [f64; 13] {
    let edges = path.edges();
    let edge = |m: usize| path.position(m + 1) - path.position(m);
    let direction = |m: usize| edge(m).normalize_or_zero();
    let [light, first] = [0, 1].map(|m| path.position(m));
    let film = path.film / SIZE as f64;
    let aside = (film - 0.5).length_squared();
    let [rise, fall] = [0, edges - 1].map(|m| direction(m).y.abs());
    let [bend, turn] = [1, edges - 1].map(|m| direction(m - 1).dot(direction(m)));
    let long = (0..edges).map(|m| edge(m).length().ln()).sum();
    [film.x, film.y, aside, light.x, light.z, first.x, first.y, rise, fall, bend, turn, long, contribution]
}

/// Each mutation alone, and two of them ten times as likely as the others.
fn cases() -> Vec<(String, Vec<Kind>, Weights)> {
    let alone = |kind: Kind| (kind.name().to_owned(), vec![kind], Weights::even(vec![kind].into()));
    let favoured = |kind: Kind| {
        let mut gains = [Gain::default(); Kind::ALL.len()];
        gains[kind as usize].add(1.0, 0);
        (format!("mostly {}", kind.name()), Kind::ALL.to_vec(), Weights::of(Kind::ALL.to_vec().into(), &gains))
    };
    Kind::ALL.into_iter().map(alone).chain([Kind::Bidirectional, Kind::Manifold].map(favoured)).collect()
}

/// A path as chains of `target` have it, and what it is worth.
fn draw(
    target: Target,
    edges: usize,
    scene: &Caster<'_>,
    stream: &mut Stream,
    path: &mut FullPath,
) -> Option<(Found, f64)> {
    let tracer = Tracer { edges };
    let technique = tracer.technique(stream.number());
    let found = tracer.sample(scene, technique, stream, path, &mut Health::default())?;
    let worth = found.luminance;
    if target == Target::Technique {
        return Some((found, worth));
    }
    let alone = connect_visible(scene, &path.light.vertices, &path.camera.vertices, &Techniques::ALONE)?;
    Some((Found { value: alone.value, luminance: alone.value.luminance(), ..found }, worth))
}

/// What a path contributes after a jump, which leaves the path as it was found.
fn jumped(path: &FullPath, found: &Found, stream: &mut Stream) -> Found {
    let (heuristic, mut densities) = (TECHNIQUES.heuristic.expect("weights"), Vec::new());
    path.densities(&mut densities);
    let weights = densities.iter().map(|density| heuristic.apply(*density));
    let technique = pick(weights, stream.number()).unwrap_or(found.technique);
    let share = |technique: usize| heuristic.apply(densities[technique]) / densities[technique];
    let factor = share(technique) / share(found.technique);
    Found { value: found.value * factor, luminance: found.luminance * factor, technique, ..*found }
}

/// How independent paths come about: in which ways, and whether these are adapted to what they find.
const DRAWS: [(Ways, bool); 3] = [(Ways::Known, false), (Ways::All, false), (Ways::All, true)];

/// An independent path.
fn independent(
    space: &mut PathSpace,
    scene: &Caster<'_>,
    (mixture, ways): (&Mixture, Ways),
    stream: &mut Stream,
    path: &mut FullPath,
) -> Option<Drawn> {
    let tracer = Tracer { edges: mixture.edges() };
    let by_technique =
        |s, stream: &mut Stream, path: &mut FullPath| tracer.sample(scene, s, stream, path, &mut Health::default());
    space.sample(scene, (mixture, ways), stream, path, by_technique)
}

/// Samples that adapt a mixture.
const SAMPLES: u64 = 5000;

/// For paths of these lengths, what they are drawn by as long as nothing is known, and once something is.
fn mixtures(scene: &Scene, lengths: Lengths) -> Vec<[Mixture; 2]> {
    let mutations = PathMutations::default();
    let seeds = Arc::new(Seeds::seen(scene, &mutations, 3));
    let both = |edges: usize| {
        let even = Mixture::even(scene, &mutations, edges, seeds.clone());
        let (caster, mut path) = (Caster::new(scene), FullPath::default());
        let mut space = PathSpace::new(mutations, Target::Technique);
        let mut draw = |number: u64| {
            let mut stream = Stream::new(4, &[edges as u64, number]);
            independent(&mut space, &caster, (&even, Ways::All), &mut stream, &mut path)
        };
        let drawn: Vec<Drawn> = (0..SAMPLES).filter_map(&mut draw).collect();
        let adapted = even.adapted(drawn.iter());
        [even, adapted]
    };
    (lengths.least..=lengths.most).map(both).collect()
}

/// What flows, by case; and by independent paths.
fn flows(
    scene: &Scene,
    (target, lengths): (Target, Lengths),
    mixtures: &[[Mixture; 2]],
    (paths, batch): (u64, u64),
) -> Vec<Flows> {
    let caster = Caster::new(scene);
    let [mut path, mut proposal] = [FullPath::default(), FullPath::default()];
    let mut stream = Stream::new(9, &[batch, lengths.least as u64]);
    let space = |(_, kinds, weights): (String, Vec<Kind>, Weights)| {
        let mutations = PathMutations { kinds: kinds.into(), angles: WIDE, ..PathMutations::default() };
        let mut space = PathSpace::new(mutations, target);
        space.weights = weights;
        (space, Flows::default())
    };
    let mut spaces: Vec<_> = cases().into_iter().map(space).collect();
    let sampler = &mut PathSpace::new(PathMutations::default(), target);
    let techniques = PathMutations { kinds: vec![Kind::Bidirectional].into(), ..PathMutations::default() };
    let mut by_techniques = PathSpace::new(techniques, target);
    let even = |edges| Mixture::even(scene, &techniques, edges, Arc::default());
    let even: Vec<Mixture> = (lengths.least..=lengths.most).map(even).collect();
    let mut damping = |(found, path): (&Found, &mut FullPath), stream: &mut Stream| {
        let mixture = &even[path.edges() - lengths.least];
        let worth = by_techniques.worth(&caster, (path, found), (mixture, Ways::Known), stream);
        worth.map_or(0.0, |worth| (MOST_WORTH / worth).min(1.0))
    };
    let mut of_independent = DRAWS.map(|_| Flows::default());
    for _ in 0..paths {
        let edges = lengths.least + (stream.number() * lengths.count() as f64) as usize;
        let Some((mut found, worth)) = draw(target, edges, &caster, &mut stream, &mut path) else { continue };
        if target == Target::Technique && stream.number() < 0.5 {
            found = jumped(&path, &found, &mut stream);
        }
        let own = damping((&found, &mut path.clone()), &mut stream);
        for (space, flows) in &mut spaces {
            let current = (&mut path.clone(), &found);
            let Proposed { outcome, .. } = space.propose(&caster, current, &mut stream, &mut proposal);
            if let Ok((next, ratio)) = outcome {
                let damped = own.min(damping((&next, &mut proposal), &mut stream));
                flows.add(target, worth * ratio.min(1.0) * damped, [(&found, &path), (&next, &proposal)]);
            }
        }
        for ((ways, adapted), flows) in DRAWS.into_iter().zip(&mut of_independent) {
            let [from, to] = [edges - lengths.least, (stream.number() * lengths.count() as f64) as usize]
                .map(|place| (&mixtures[place][usize::from(adapted)], ways));
            if let Some(next) = independent(sampler, &caster, to, &mut stream, &mut proposal)
                && next.known
                && let Some(from) = sampler.worth(&caster, (&mut path.clone(), &found), from, &mut stream)
            {
                let acceptance = (next.worth / from).min(1.0);
                let damped = own.min(damping((&next.found, &mut proposal), &mut stream));
                flows.add(target, worth * acceptance * damped, [(&found, &path), (&next.found, &proposal)]);
            }
        }
    }
    let of_mutations = spaces.into_iter().map(|(_, flows)| flows);
    of_mutations.chain(of_independent).collect()
}

/// Judges `paths` independent paths of each batch.
fn balance(scene: &Scene, paths: u64) {
    let one = |edges| (Target::Technique, Lengths { least: edges, most: edges });
    let mut failures = Vec::new();
    for (target, lengths) in [(Target::Path(LENGTHS), LENGTHS), one(3), one(4), one(5)] {
        let mixtures = mixtures(scene, lengths);
        let batches = (0..BATCHES).into_par_iter();
        let batches = batches.map(|batch| flows(scene, (target, lengths), &mixtures, (paths, batch)));
        let merge = |a: Vec<Flows>, b: Vec<Flows>| a.into_iter().zip(b).map(|(a, b)| a.merge(b)).collect();
        let of_independent = DRAWS.map(|(ways, adapted)| {
            let adapted = if adapted { ", adapted" } else { "" };
            format!("independent, {ways:?}{adapted}")
        });
        let names: Vec<String> = cases().into_iter().map(|(name, ..)| name).chain(of_independent).collect();
        let all = batches.reduce(|| vec![Flows::default(); names.len()], merge);
        for (name, Flows { between, drifts }) in names.into_iter().zip(&all) {
            let flows = between.iter().map(|(cells, sum)| (format!("{cells:?}"), sum));
            let drifts = drifts.iter().map(|(drift, sum)| (format!("drift {drift:?}"), sum));
            let judged: Vec<_> = flows.chain(drifts).filter(|(_, sum)| sum.is_known()).collect();
            let Some((what, worst)) = judged.iter().max_by(|a, b| a.1.z().total_cmp(&b.1.z())) else { continue };
            println!("| {target:?} | {lengths:?} | {name} | {} | {:.1} | {what} {worst:?}", judged.len(), worst.z());
            if worst.z() > SIGMAS {
                failures.push(format!("{target:?}, {lengths:?}, {name}: {what}: {:.1}", worst.z()));
            }
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn flows_cancel_among_balls() {
    balance(&rooms::balls(SIZE), 10_000);
}

#[test]
fn flows_cancel_under_water() {
    balance(&rooms::water(SIZE), 20_000);
}

#[test]
fn flows_cancel_among_glossy_surfaces() {
    balance(&rooms::polished(SIZE), 20_000);
}

#[test]
fn flows_cancel_where_light_is_hidden() {
    balance(&rooms::mirrored(SIZE), 20_000);
}

/// Paths of each length in a batch that tell the light of classes.
const PATHS: u64 = 8000;

/// The light of each class and length, by techniques, by independent paths, and by such that come about in adapted ways.
fn light(scene: &Scene, mixtures: &[[Mixture; 2]], batch: u64) -> BTreeMap<(usize, PathClass), [Sum; 3]> {
    let caster = Caster::new(scene);
    let (mut stream, mut path, mut health) = (Stream::new(7, &[batch]), FullPath::default(), Health::default());
    let mut space = PathSpace::new(PathMutations::default(), Target::Technique);
    let mut light: BTreeMap<_, [Sum; 3]> = BTreeMap::new();
    for _ in 0..PATHS {
        for mixtures in mixtures {
            let tracer = Tracer { edges: mixtures[0].edges() };
            let technique = tracer.technique(stream.number());
            if let Some(found) = tracer.sample(&caster, technique, &mut stream, &mut path, &mut health) {
                light.entry((tracer.edges, found.class)).or_default()[0].add(found.luminance);
            }
            for (place, mixture) in (1..).zip(mixtures) {
                let drawn = independent(&mut space, &caster, (mixture, Ways::All), &mut stream, &mut path);
                if let Some(Drawn { found, worth, .. }) = drawn {
                    light.entry((tracer.edges, found.class)).or_default()[place].add(worth);
                }
            }
        }
    }
    light
}

#[test]
fn independent_paths_have_the_light_of_every_class() {
    for scene in [rooms::balls(SIZE), rooms::water(SIZE), rooms::polished(SIZE), rooms::mirrored(SIZE)] {
        let merge = |mut all: BTreeMap<_, [Sum; 3]>, other: BTreeMap<_, [Sum; 3]>| {
            for (class, sums) in other {
                all.entry(class).or_default().iter_mut().zip(&sums).for_each(|(sum, other)| sum.merge(other));
            }
            all
        };
        let mixtures = mixtures(&scene, LENGTHS);
        let batches = (0..BATCHES).into_par_iter().map(|batch| light(&scene, &mixtures, batch));
        for ((edges, class), [techniques, independent @ ..]) in batches.reduce(BTreeMap::new, merge) {
            for independent in independent {
                if techniques.count.min(independent.count) < FEWEST {
                    continue;
                }
                let z = (techniques.sum - independent.sum).abs() / (techniques.squares + independent.squares).sqrt();
                let [a, b] = [techniques, independent].map(|sum| format!("{:.1} ± {:.1}", sum.sum, sum.squares.sqrt()));
                println!("| {edges} | {} | {a} | {b} | {z:.1} |", class.word());
                assert!(z < SIGMAS, "{edges} edges, {}: {a}, {b}", class.word());
            }
        }
    }
}
