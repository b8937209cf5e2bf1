//! Metropolis light transport in the primary sample space of bidirectional path tracing (Kelemen et al. 2002; Bitterli
//! 2015, section 3.7).
//!
//! A state holds the rows of one walk from the camera and one from a light; all their connections are splatted. The target
//! is the luminance of the sum of all contributions, each weighted by the power heuristic as in `bdpt`. So a state is worth
//! what bidirectional path tracing makes of it, and the image stays the expectation of the latter. Kelemen et al. kept the
//! connection of the largest density only, so that long walks would not be worth more than short ones for their number of
//! connections; here walks end by Russian roulette, the weights of one path's techniques add up to one, and no light is
//! discarded that has been computed.
//!
//! Light seen directly is rendered by path tracing, and so is direct light unless the settings say otherwise.

use super::bdpt::ROULETTE_FROM;
use super::chains::{LANES, Mean, Worth, batch_samples, independent, share, start};
use super::{Acceptance, ChainReport, Counts, path::Path, render::Settings};
use crate::film::{Film, Health, Kernel, PathClass, Splats};
use crate::markov::{ChainState, Mutations};
use crate::math::{Stream, Walk};
use crate::path_space::Lengths;
use crate::paths::{FullPath, Open, TECHNIQUES, connect, trace_camera, trace_light};
use crate::scene::{Caster, Scene};
use crate::spectrum::Spectrum;
use glam::DVec2;
use rayon::prelude::*;

/// All that a state finds.
#[derive(Clone, Default)]
struct Contributions {
    paths: Vec<(Spectrum, PathClass, DVec2)>,
    /// Luminance of their sum.
    luminance: f64,
}

struct Chain {
    state: ChainState,
    stream: Stream,
    current: Contributions,
    /// Proposals and accepted ones, of large and of small steps.
    tallies: [[u64; 2]; 2],
}

/// What one lane needs.
#[derive(Default)]
struct Lane {
    chain: Option<Chain>,
    walks: FullPath,
    proposal: Contributions,
    health: Health,
}

/// What a lane made in one pass.
struct Job {
    splats: Splats,
    rays: u64,
    large_steps: Mean,
    health: Health,
}

/// The method with its chains.
pub(super) struct Pssmlt {
    seed: u64,
    mutations: Mutations,
    direct: Path,
    lengths: Lengths,
    size: [usize; 2],
    open: Open,
    mean: Mean,
    worth: Worth,
    batches: u64,
    lanes: Vec<Lane>,
}

/// First row of the light's walk; those of the camera's come before.
fn light_rows(lengths: Lengths) -> usize {
    lengths.most + 1
}

impl Pssmlt {
    pub(super) fn start(scene: &Scene, settings: &Settings) -> Self {
        let direct = settings.mutations.traced_edges();
        Self {
            seed: settings.seed,
            mutations: settings.mutations,
            direct: Path::up_to(settings, direct),
            lengths: Lengths { least: direct + 1, most: settings.max_depth },
            size: scene.camera.size,
            open: Open::of(scene),
            mean: Mean::default(),
            worth: Worth::default(),
            batches: 0,
            lanes: (0..LANES).map(|_| Lane::default()).collect(),
        }
    }

    /// A state none of whose rows has been drawn.
    fn state(&self) -> ChainState {
        let rows =
            |walk| (0..=self.lengths.most).map(move |i| self.mutations.scales(walk, i, self.size, self.open, true));
        let scales: Vec<_> = rows(Walk::FromCamera).chain(rows(Walk::FromLight)).collect();
        ChainState::new(self.mutations.small_step, scales.into())
    }

    /// Draws independent samples, and starts the chains where some find light.
    fn explore(&mut self, scene: &Scene) {
        let (seed, batches, lengths, state) = (self.seed, self.batches, self.lengths, self.state());
        let stream = |sample: usize| Stream::new(seed, &[2, 0, batches, sample as u64]);
        let memory = || (Lane::default(), state.clone());
        let targets = independent(scene, batch_samples(self.size, batches), memory, |caster, (lane, state), sample| {
            state.reset();
            lane.find(caster, lengths, state, &mut stream(sample));
            lane.proposal.luminance
        });
        self.batches += 1;
        targets.iter().for_each(|target| self.mean.add(*target));
        let caster = Caster::new(scene);
        start(&targets, seed, 0, |number, chosen, own| {
            let (lane, mut state) = (&mut self.lanes[number], state.clone());
            lane.find(&caster, lengths, &mut state, &mut stream(chosen));
            state.accept();
            let current = std::mem::take(&mut lane.proposal);
            lane.chain = Some(Chain { state, stream: own, current, tallies: Default::default() });
            Some(())
        });
    }

    pub(super) fn pass(&mut self, scene: &Scene, film: &mut Film, pass: u64, counts: &mut Counts) {
        self.direct.pass(scene, film, pass, counts);
        if self.lengths.count() == 0 {
            return;
        }
        if self.mean.sum == 0.0 {
            self.explore(scene);
        }
        let pixels = (self.size[0] * self.size[1]) as u64;
        let mutations = if self.mean.sum > 0.0 { pixels } else { 0 };
        let (kernel, size, worth) = (film.kernel.clone(), film.size, self.worth.next(self.mean.mean()));
        let (lengths, large) = (self.lengths, self.mutations.large_step);
        let run = |(number, lane): (usize, &mut Lane)| {
            let mutations = share(mutations, number, pass);
            lane.run(&Caster::new(scene), lengths, mutations, large, worth, &kernel, size)
        };
        let jobs: Vec<Job> = self.lanes.par_iter_mut().enumerate().map(run).collect();
        for job in &jobs {
            film.report(&job.health);
            self.mean.merge(&job.large_steps);
        }
        counts.add(mutations, jobs.iter().map(|job| job.rays).sum());
        let splats: Vec<Splats> = jobs.into_iter().map(|job| job.splats).collect();
        film.splat(&splats);
        self.report(counts);
    }

    fn report(&self, counts: &mut Counts) {
        let chains = || self.lanes.iter().filter_map(|lane| lane.chain.as_ref());
        for (kind, name) in ["large_step", "small_step"].into_iter().enumerate() {
            let sum = |i: usize| chains().map(|chain| chain.tallies[kind][i]).sum();
            counts.acceptance.insert(name, vec![Acceptance { length: 0, proposed: sum(0), accepted: sum(1) }]);
        }
        let (mean, standard_error) = (self.mean.mean(), self.mean.error());
        counts.chains =
            vec![ChainReport { length: 0, mean, standard_error, chains: chains().count(), failed_inversions: 0 }];
    }
}

impl Lane {
    /// All paths of the state's proposal.
    fn find(&mut self, scene: &Caster<'_>, lengths: Lengths, state: &mut ChainState, stream: &mut Stream) {
        let Self { walks, proposal, health, .. } = self;
        proposal.paths.clear();
        let first = state.row(0, stream);
        let film = scene.camera.film_position(first);
        let (camera, light) = (&mut walks.camera, &mut walks.light);
        trace_camera(scene, film, first, &mut state.rows(0, true, stream), lengths.most + 1, ROULETTE_FROM, camera);
        let rows = &mut state.rows(light_rows(lengths), true, stream);
        trace_light(scene, rows, lengths.most, ROULETTE_FROM, light);
        let (camera, light) = (&camera.vertices, &light.vertices);
        let mut sum = Spectrum::BLACK;
        for t in 1..=camera.len() {
            for s in (lengths.least + 1).saturating_sub(t)..=light.len().min((lengths.most + 1).saturating_sub(t)) {
                let Some(found) = connect(scene, &light[..s], &camera[..t], &TECHNIQUES) else { continue };
                if health.accepts(found.value) && !found.value.is_black() {
                    sum += found.value;
                    proposal.paths.push((found.value, found.class, found.film.unwrap_or(film)));
                }
            }
        }
        proposal.luminance = sum.luminance();
    }

    #[allow(clippy::too_many_arguments)]
    fn run(
        &mut self,
        scene: &Caster<'_>,
        lengths: Lengths,
        mutations: u64,
        large: f64,
        worth: f64,
        kernel: &Kernel,
        size: [usize; 2],
    ) -> Job {
        let (mut splats, mut large_steps) = (Splats::new(size), Mean::default());
        if let Some(mut chain) = self.chain.take() {
            for _ in 0..mutations {
                let is_large = chain.stream.number() < large;
                chain.state.propose(is_large);
                self.find(scene, lengths, &mut chain.state, &mut chain.stream);
                if is_large {
                    large_steps.add(self.proposal.luminance);
                }
                self.decide(&mut chain, is_large, |found, weight| {
                    for (value, class, film) in found.paths.iter().filter(|_| weight > 0.0) {
                        splats.add(kernel, *film, *class, *value * (weight * worth / found.luminance));
                    }
                });
            }
            self.chain = Some(chain);
        }
        Job { splats, rays: scene.rays(), large_steps, health: std::mem::take(&mut self.health) }
    }

    /// Accepts or rejects the proposal; both states are splatted with their expected weight.
    fn decide(&mut self, chain: &mut Chain, is_large: bool, mut splat: impl FnMut(&Contributions, f64)) {
        let acceptance = (self.proposal.luminance / chain.current.luminance).min(1.0);
        splat(&chain.current, 1.0 - acceptance);
        splat(&self.proposal, acceptance);
        let accepted = chain.stream.number() < acceptance;
        let [proposals, successes] = &mut chain.tallies[usize::from(!is_large)];
        *proposals += 1;
        *successes += u64::from(accepted);
        if accepted {
            chain.state.accept();
            std::mem::swap(&mut chain.current, &mut self.proposal);
        } else {
            chain.state.reject();
        }
    }
}
