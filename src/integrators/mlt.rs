//! Metropolis light transport (Veach and Guibas 1997; Veach 1997, chapter 11) with manifold exploration (Jakob and Marschner
//! 2012): chains of paths of all lengths, moved by the mutations of [`crate::path_space`].
//!
//! Each chain begins at one of many independent samples, drawn in proportion to their contribution, so that it has its
//! stationary distribution from the first step on, and nothing need be thrown away. b, the mean luminance of the image,
//! comes from these samples and from more of them in each pass.
//!
//! Light seen directly is rendered by path tracing, and so is direct light unless the settings say otherwise.

use super::chains::{LANES, Mean, Worth, batch_samples, independent, share, start};
use super::{Acceptance, ChainReport, Counts, path::Path, render::Settings};
use crate::film::{Film, Health, Kernel, Splats};
use crate::manifold::Rejection;
use crate::markov::Tracer;
use crate::math::Stream;
use crate::path_space::{Drawn, Kind, Lengths, Mixture, PathMutations, PathSpace, Proposed, Seeds, Target, Ways};
use crate::paths::{Found, FullPath};
use crate::scene::{Caster, Scene};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Mutations for each independent sample that refines b.
const REFINEMENT: usize = 16;

struct Chain {
    stream: Stream,
    /// Contribution over density by its technique, which has no weight.
    current: Found,
    path: FullPath,
    /// How often the current path has been counted and not yet been splatted.
    weight: f64,
    /// By kind of mutation, proposals and accepted ones.
    tallies: [[u64; 2]; Kind::ALL.len()],
    /// Mutations that came to nothing, by cause.
    rejections: BTreeMap<Rejection, u64>,
}

struct Lane {
    chain: Option<Chain>,
    mutations: PathSpace,
    proposal: FullPath,
    health: Health,
}

/// What a lane made in one pass.
struct Job {
    splats: Splats,
    rays: u64,
    health: Health,
}

/// The method with its chains.
pub(super) struct Mlt {
    seed: u64,
    direct: Path,
    lengths: Lengths,
    mutations: PathMutations,
    /// How independent paths of each length are drawn.
    mixtures: Vec<Mixture>,
    size: [usize; 2],
    mean: Mean,
    worth: Worth,
    batches: u64,
    lanes: Vec<Lane>,
}

impl Mlt {
    pub(super) fn start(scene: &Scene, settings: &Settings) -> Self {
        let direct = settings.mutations.traced_edges();
        let lengths = Lengths { least: direct + 1, most: settings.max_depth };
        let (target, mutations) = (Target::Path(lengths), settings.mutations.path_space);
        let seeds = Arc::new(Seeds::seen(scene, &mutations, settings.seed));
        let mixture = |edges| Mixture::even(scene, &mutations, edges, seeds.clone());
        Self {
            seed: settings.seed,
            direct: Path::up_to(settings, direct),
            lengths,
            mutations,
            mixtures: (lengths.least..=lengths.most).map(mixture).collect(),
            size: scene.camera.size,
            mean: Mean::default(),
            worth: Worth::default(),
            batches: 0,
            lanes: (0..LANES).map(|_| Lane::new(mutations, target)).collect(),
        }
    }

    /// Draws a batch of independent samples, and starts the chains if there are none and some sample finds light.
    fn sample(&mut self, scene: &Scene, samples: usize) -> u64 {
        let (seed, batch, lengths, mixtures) = (self.seed, self.batches, self.lengths, &self.mixtures);
        let stream = |number: usize| Stream::new(seed, &[2, 0, batch, number as u64]);
        let memory = || Lane::new(self.mutations, Target::Path(lengths));
        let targets = independent(scene, samples, memory, |caster, lane, number| {
            let drawn = lane.sample(caster, mixtures, &mut stream(number));
            drawn.map_or((0.0, false), |drawn| (drawn.worth, drawn.known))
        });
        self.batches += 1;
        targets.iter().for_each(|(target, _)| self.mean.add(*target));
        if self.lanes.iter().any(|lane| lane.chain.is_some()) {
            return samples as u64;
        }
        let caster = Caster::new(scene);
        let may_start: Vec<f64> = targets.iter().map(|(target, known)| if *known { *target } else { 0.0 }).collect();
        start(&may_start, seed, 0, |number, chosen, own| {
            self.lanes[number].start(&caster, mixtures, &mut stream(chosen), own)
        });
        samples as u64
    }

    pub(super) fn pass(&mut self, scene: &Scene, film: &mut Film, pass: u64, counts: &mut Counts) {
        self.direct.pass(scene, film, pass, counts);
        if self.lengths.count() == 0 {
            return;
        }
        let pixels = self.size[0] * self.size[1];
        let samples = if self.mean.sum == 0.0 { batch_samples(self.size, self.batches) } else { pixels / REFINEMENT };
        let samples = self.sample(scene, samples);
        let mutations = if self.mean.sum > 0.0 { pixels as u64 } else { 0 };
        let (kernel, size, worth) = (film.kernel.clone(), film.size, self.worth.next(self.mean.mean()));
        let run = |(number, lane): (usize, &mut Lane)| {
            lane.run(&Caster::new(scene), share(mutations, number, pass), worth, &kernel, size)
        };
        let jobs: Vec<Job> = self.lanes.par_iter_mut().enumerate().map(run).collect();
        jobs.iter().for_each(|job| film.report(&job.health));
        counts.add(mutations + samples, jobs.iter().map(|job| job.rays).sum());
        let splats: Vec<Splats> = jobs.into_iter().map(|job| job.splats).collect();
        film.splat(&splats);
        self.report(counts);
    }

    fn report(&self, counts: &mut Counts) {
        let chains = || self.lanes.iter().filter_map(|lane| lane.chain.as_ref());
        for kind in Kind::ALL {
            let sum = |i: usize| chains().map(|chain| chain.tallies[kind as usize][i]).sum();
            counts.acceptance.insert(kind.name(), vec![Acceptance { length: 0, proposed: sum(0), accepted: sum(1) }]);
        }
        let (mean, standard_error) = (self.mean.mean(), self.mean.error());
        counts.chains =
            vec![ChainReport { length: 0, mean, standard_error, chains: chains().count(), failed_inversions: 0 }];
        counts.rejections.clear();
        for (cause, count) in chains().flat_map(|chain| &chain.rejections) {
            *counts.rejections.entry(cause.name()).or_default() += count;
        }
    }
}

impl Lane {
    fn new(mutations: PathMutations, target: Target) -> Self {
        let mutations = PathSpace::new(mutations, target);
        Self { chain: None, mutations, proposal: FullPath::default(), health: Health::default() }
    }

    /// An independent path of any of the lengths, all as likely.
    fn sample(&mut self, scene: &Caster<'_>, mixtures: &[Mixture], stream: &mut Stream) -> Option<Drawn> {
        let mixture = mixtures.get((stream.number() * mixtures.len() as f64) as usize)?;
        let (tracer, Self { mutations, proposal, health, .. }) = (Tracer { edges: mixture.edges() }, self);
        let by_technique = |s, stream: &mut Stream, path: &mut FullPath| tracer.sample(scene, s, stream, path, health);
        let drawn = mutations.sample(scene, (mixture, Ways::All), stream, proposal, by_technique)?;
        Some(Drawn { worth: drawn.worth * mixtures.len() as f64, ..drawn })
    }

    /// Begins at the sample that `draws` gives.
    fn start(&mut self, scene: &Caster<'_>, mixtures: &[Mixture], draws: &mut Stream, stream: Stream) -> Option<()> {
        let Drawn { found: current, .. } = self.sample(scene, mixtures, draws)?;
        let (path, tallies, rejections) = (std::mem::take(&mut self.proposal), Default::default(), BTreeMap::new());
        self.chain = Some(Chain { stream, current, path, weight: 0.0, tallies, rejections });
        Some(())
    }

    fn run(&mut self, scene: &Caster<'_>, mutations: u64, worth: f64, kernel: &Kernel, size: [usize; 2]) -> Job {
        let mut splats = Splats::new(size);
        if let Some(mut chain) = self.chain.take() {
            let mut splat = |found: &Found, weight: f64| {
                if weight > 0.0 {
                    splats.add(kernel, found.film, found.class, found.value * (weight * worth / found.luminance));
                }
            };
            for _ in 0..mutations {
                self.mutate(scene, &mut chain, &mut splat);
            }
            splat(&chain.current, std::mem::take(&mut chain.weight));
            self.chain = Some(chain);
        }
        Job { splats, rays: scene.rays(), health: std::mem::take(&mut self.health) }
    }

    /// One mutation; both states count with their expected weight.
    fn mutate(&mut self, scene: &Caster<'_>, chain: &mut Chain, splat: &mut impl FnMut(&Found, f64)) {
        let Self { mutations, proposal, .. } = self;
        let Chain { stream, path, current, .. } = chain;
        let Proposed { kind, outcome } = mutations.propose(scene, (path, current), stream, proposal);
        let acceptance = outcome.map_or(0.0, |(_, ratio)| ratio.min(1.0));
        chain.weight += 1.0 - acceptance;
        let accepted = chain.stream.number() < acceptance;
        if let Some(kind) = kind {
            let [proposals, successes] = &mut chain.tallies[kind as usize];
            *proposals += 1;
            *successes += u64::from(accepted);
        }
        match outcome {
            Err(cause) => *chain.rejections.entry(cause).or_default() += 1,
            Ok((found, _)) if accepted => {
                splat(&chain.current, std::mem::replace(&mut chain.weight, acceptance));
                chain.current = found;
                std::mem::swap(&mut chain.path, proposal);
            }
            Ok((found, _)) => splat(&found, acceptance),
        }
    }
}
