//! Multiplexed Metropolis light transport (Hachisuka, Kaplanyan and Dachsbacher 2014; Bitterli 2015, section 3.8), and with
//! reversible jumps between techniques (Bitterli et al. 2017).
//!
//! One family of chains per path length k, each with the target of [`crate::markov`], whose mean is b_k, the mean luminance
//! of the image of length k. b_k comes from independent samples at the start and from every large step since.
//!
//! In `mmlt` a number of the state chooses the technique, and moves in small steps like the others. In `rjmlt` the
//! technique stands apart: small steps keep it, and jumps change it without changing the path. `fused` is `rjmlt` whose paths
//! also move in path space (Otsu 2017, chapter 6).
//!
//! Light seen directly is rendered by path tracing, and so is direct light unless the settings say otherwise, as in both
//! papers.

mod chain;
mod lane;
mod path_steps;

use super::chains::{LANES, Light, Worth, batch_samples, independent, share, start};
use super::{Acceptance, ChainReport, Counts, path::Path, render::Settings};
use crate::film::{Film, Kernel, Splats};
use crate::markov::{ChainState, Mutations, Scales, Tracer};
use crate::math::{Stream, Walk};
use crate::path_space::{Drawn, Gain, Kinds, Mixture, Seeds, Ways, Weights};
use crate::paths::Open;
use crate::scene::{Caster, Scene};
use lane::{Job, Lane};
use rayon::prelude::*;
use std::sync::Arc;

/// Where a chain has its technique from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Family {
    /// From a number of the state: `mmlt`.
    Multiplexed,
    /// From jumps: `rjmlt`.
    Jumping,
    /// From jumps, while paths also move in path space: `fused`.
    Fused,
}

/// The most first samples in two batches, where paths may be linked.
const LINKED_SAMPLES: [usize; 2] = [25_000, 50_000];
/// The most mutations of pilot runs.
const PILOT_MUTATIONS: usize = 50_000;

/// One path length.
struct Length {
    tracer: Tracer,
    scales: Arc<[Scales]>,
    light: Light,
    /// Batches of independent samples drawn.
    batches: u64,
    worth: Worth,
    /// How often each mutation in path space is drawn.
    weights: Weights,
    /// Share of the small steps in whose place paths move in path space.
    path_step: f64,
    /// How independent paths in path space are drawn.
    mixture: Arc<Mixture>,
}

/// What a pass does with one length.
struct Share {
    tracer: Tracer,
    /// Mutations by all lanes together; 0 for a length in which no light has been found yet.
    mutations: u64,
    /// What one of them is worth: the pass's part of b_k over their number, in units of a pixel's mean.
    worth: f64,
    /// How often each mutation in path space is drawn.
    weights: Weights,
    /// Share of the small steps in whose place paths move in path space.
    path_step: f64,
    /// How independent paths in path space are drawn.
    mixture: Arc<Mixture>,
}

/// The method with its chains.
pub(super) struct Mmlt {
    seed: u64,
    family: Family,
    mutations: Mutations,
    direct: Path,
    size: [usize; 2],
    lengths: Vec<Length>,
    lanes: Vec<Lane>,
}

impl Mmlt {
    pub(super) fn start(scene: &Scene, settings: &Settings, family: Family) -> Self {
        let mut mutations = settings.mutations;
        if family != Family::Fused {
            (mutations.path_space.kinds, mutations.path_step) = (Kinds::NONE, 0.0);
        }
        let direct = mutations.traced_edges();
        let (size, open) = (scene.camera.size, Open::of(scene));
        let seeds = Arc::new(Seeds::seen(scene, &mutations.path_space, settings.seed));
        let lengths: Vec<Length> = (direct + 1..=settings.max_depth)
            .map(|edges| {
                let tracer = Tracer { edges };
                let scales = scales(tracer, &mutations, size, open);
                let weights = Weights::even(mutations.path_space.kinds);
                let (light, worth) = (Light::default(), Worth::default());
                let mixture = Arc::new(Mixture::even(scene, &mutations.path_space, edges, seeds.clone()));
                Length { tracer, scales, light, batches: 0, worth, weights, path_step: mutations.path_step, mixture }
            })
            .collect();
        Self {
            seed: settings.seed,
            family,
            mutations,
            direct: Path::up_to(settings, direct),
            size,
            lanes: (0..LANES).map(|_| Lane::new(family, mutations, lengths.len())).collect(),
            lengths,
        }
    }

    /// Draws independent samples of a length in which no light has been found; starts its chains where one finds some, and
    /// finds out how its paths had better move.
    fn explore(&mut self, scene: &Scene, kernel: &Kernel, index: usize) {
        let samples = batch_samples(self.size, self.lengths[index].batches);
        // What the first of two batches finds tells how the second is drawn. Paths that may be linked take several times as
        // long, so that there are at most so many.
        let batches: &[usize] = if self.lengths[index].mixture.links() { &LINKED_SAMPLES } else { &[usize::MAX] };
        for most in batches {
            self.begin(scene, index, samples.min(*most).div_ceil(self.lengths.len()));
        }
        if self.lengths[index].path_step > 0.0 {
            self.adapt(scene, kernel, index);
        }
    }

    /// Draws a batch of independent samples, where the chains of a length begin.
    fn begin(&mut self, scene: &Scene, index: usize, samples: usize) {
        let length = &mut self.lengths[index];
        let (tracer, batches, edges) = (length.tracer, length.batches, length.tracer.edges as u64);
        let key = |sample: usize| [2, edges, batches, sample as u64];
        let state = ChainState::new(self.mutations.small_step, length.scales.clone());
        let memory = || (Lane::new(self.family, self.mutations, 0), state.clone());
        let mixture = &*length.mixture;
        let targets = independent(scene, samples, memory, |caster, (lane, state), sample| {
            let mut stream = Stream::new(self.seed, &key(sample));
            if mixture.links() {
                let drawn = lane.draw(caster, tracer, (mixture, Ways::All), &mut stream);
                return (drawn.map_or(0.0, |drawn| drawn.worth), drawn);
            }
            state.reset();
            (lane.find(caster, tracer, state, &mut stream).map_or(0.0, |found| found.luminance), None)
        });
        length.batches += 1;
        for (target, drawn) in &targets {
            length.light.add((*target, drawn.is_some_and(|drawn| drawn.hidden)), Ways::All);
        }
        let caster = Caster::new(scene);
        let may_start = |(target, drawn): &(f64, Option<Drawn>)| match drawn {
            Some(Drawn { known: false, .. }) => 0.0,
            _ => *target,
        };
        let luminances: Vec<f64> = targets.iter().map(may_start).collect();
        start(&luminances, self.seed, edges, |number, chosen, stream| {
            let (lane, draws) = (&mut self.lanes[number], Stream::new(self.seed, &key(chosen)));
            let chain = lane.start(&caster, (tracer, mixture), state.clone(), draws, stream)?;
            lane.chains[index] = Some(chain);
            Some(())
        });
        length.mixture = Arc::new(mixture.adapted(targets.iter().filter_map(|(_, drawn)| drawn.as_ref())));
    }

    /// Finds how often paths had better move how, by a run whose chains are thrown away.
    fn adapt(&mut self, scene: &Scene, kernel: &Kernel, index: usize) {
        let (seed, size, kinds) = (self.seed, self.size, self.mutations.path_space.kinds);
        let mutations = (batch_samples(size, 0).min(PILOT_MUTATIONS) / (self.lengths.len() * LANES)) as u64;
        let length = &mut self.lengths[index];
        let (tracer, mixture) = (length.tracer, &*length.mixture);
        let run = |(number, lane): (usize, &mut Lane)| {
            let stream = Stream::new(seed, &[5, tracer.edges as u64, number as u64]);
            lane.pilot(scene, kernel, size, (index, tracer, mixture), (mutations, stream)).gains
        };
        let runs: Vec<_> = self.lanes.par_iter_mut().enumerate().map(run).collect();
        let mut gains = [Gain::default(); chain::KINDS];
        for run in &runs {
            gains.iter_mut().zip(run).for_each(|(gain, other)| gain.merge(other));
        }
        let path = std::array::from_fn(|kind| gains[chain::PRIMARY.len() + kind]);
        length.weights = Weights::of(kinds, &path);
        length.path_step = length.weights.share(self.mutations.path_step, &path, &gains[chain::SMALL]);
    }

    /// How a pass divides one mutation per pixel among the lengths: in proportion to their light, or to what is due to it.
    fn plan(&mut self, pixels: f64) -> Vec<Share> {
        let fused = self.family == Family::Fused;
        let due = |length: &Length| if fused { length.light.due() } else { length.light.mean() };
        let total: f64 = self.lengths.iter().map(due).sum();
        let part = |length: &mut Length| {
            let b = length.light.mean();
            let mutations = if b > 0.0 { (due(length) / total * pixels).ceil() } else { 0.0 };
            let worth = length.worth.next(b) * pixels / mutations.max(1.0);
            let Length { tracer, weights, path_step, ref mixture, .. } = *length;
            Share { tracer, mutations: mutations as u64, worth, weights, path_step, mixture: mixture.clone() }
        };
        self.lengths.iter_mut().map(part).collect()
    }

    pub(super) fn pass(&mut self, scene: &Scene, film: &mut Film, pass: u64, counts: &mut Counts) {
        self.direct.pass(scene, film, pass, counts);
        for index in 0..self.lengths.len() {
            if self.lengths[index].light.mean() == 0.0 {
                self.explore(scene, &film.kernel, index);
            }
        }
        let (kernel, size) = (film.kernel.clone(), film.size);
        let plan = self.plan((size[0] * size[1]) as f64);
        let jobs: Vec<Job> = self
            .lanes
            .par_iter_mut()
            .enumerate()
            .map(|(number, lane)| lane.run(scene, &kernel, &plan, |mutations| share(mutations, number, pass), size))
            .collect();
        for job in &jobs {
            film.report(&job.health);
            for (length, found) in self.lengths.iter_mut().zip(&job.large_steps) {
                length.light.merge(found);
            }
        }
        counts.add(plan.iter().map(|share| share.mutations).sum(), jobs.iter().map(|job| job.rays).sum());
        let splats: Vec<Splats> = jobs.into_iter().map(|job| job.splats).collect();
        film.splat(&splats);
        self.report(counts);
    }

    /// What the chains have done so far, summed over the lanes.
    fn report(&self, counts: &mut Counts) {
        let chains = |index: usize| self.lanes.iter().filter_map(move |lane| lane.chains[index].as_ref());
        for (kind, name) in chain::names().enumerate() {
            let sum = |(index, length): (usize, &Length)| {
                let tallies = chains(index).map(|chain| chain.tallies[kind]);
                let [proposed, accepted] = tallies.fold([0; 2], |[a, b], tally| [a + tally[0], b + tally[1]]);
                Acceptance { length: length.tracer.edges, proposed, accepted }
            };
            let lengths: Vec<Acceptance> = self.lengths.iter().enumerate().map(sum).collect();
            if kind < chain::PRIMARY.len() || lengths.iter().any(|length| length.proposed > 0) {
                counts.acceptance.insert(name, lengths);
            }
        }
        let report = |(index, length): (usize, &Length)| ChainReport {
            length: length.tracer.edges,
            mean: length.light.mean(),
            standard_error: length.light.error(),
            chains: chains(index).count(),
            failed_inversions: chains(index).map(|chain| chain.failed).sum(),
        };
        counts.chains = self.lengths.iter().enumerate().map(report).collect();
        counts.rejections.clear();
        for (cause, count) in (0..self.lengths.len()).flat_map(chains).flat_map(|chain| &chain.rejections) {
            *counts.rejections.entry(cause).or_default() += count;
        }
    }
}

/// How far the numbers of each row of a state move.
fn scales(tracer: Tracer, mutations: &Mutations, size: [usize; 2], open: Open) -> Arc<[Scales]> {
    let technique = [1.0, 0.0, 0.0, 0.0];
    let walk = |walk| (0..=tracer.edges).map(move |index| mutations.scales(walk, index, size, open, false));
    let rows = std::iter::once(technique).chain(walk(Walk::FromCamera)).chain(walk(Walk::FromLight));
    rows.collect()
}
