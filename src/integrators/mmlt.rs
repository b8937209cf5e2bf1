//! Multiplexed Metropolis light transport (Hachisuka, Kaplanyan and Dachsbacher 2014; Bitterli 2015, section 3.5).
//!
//! One family of chains per path length k: the state holds the rows of both subpaths and a number that chooses the
//! technique; the target is the luminance of the technique's weighted contribution times the number of techniques, so
//! that its mean over the unit cube is b_k, the mean luminance of the image of length k. b_k comes from independent
//! samples at the start and from every large step since.
//!
//! Light seen directly and direct light (k ≤ 2) are rendered by path tracing, as in both papers on the method.

use super::{Acceptance, Counts, path::Path, render::Settings};
use crate::film::{Film, Health, Kernel, PathClass, Splats};
use crate::markov::{ChainState, LARGE_STEP_PROBABILITY};
use crate::math::{Discrete, Stream};
use crate::paths::{Heuristic, Subpath, Techniques, connect, trace_camera, trace_light};
use crate::scene::{Caster, Scene};
use crate::spectrum::Spectrum;
use glam::DVec2;
use rayon::prelude::*;
use std::ops::RangeInclusive;

/// The primary samples of a path do not know where its light is to arrive: lights are chosen by power.
const TECHNIQUES: Techniques = Techniques::connections(Heuristic::Power);

/// Longest path that is left to path tracing.
const DIRECT_DEPTH: usize = 2;

/// Chains per path length. Each lane owns one of each length, its random streams and its splats.
const LANES: usize = 16;

/// Independent samples of the first batch, over all lengths: two per pixel, within these bounds. Large steps refine what
/// they find, and lengths without light get another batch in each pass, so that they need not be many.
const BATCH_SAMPLES: RangeInclusive<usize> = 20_000..=200_000;

/// A path as the film sees it.
#[derive(Clone, Copy)]
struct Contribution {
    value: Spectrum,
    luminance: f64,
    class: PathClass,
    film: DVec2,
    technique: usize,
}

/// One path length.
struct Length {
    edges: usize,
    /// Sum of the luminances of independent samples, and their number.
    sum: f64,
    samples: u64,
    /// Batches of independent samples drawn.
    batches: u64,
}

impl Length {
    /// b_k.
    fn normalisation(&self) -> f64 {
        if self.samples == 0 { 0.0 } else { self.sum / self.samples as f64 }
    }
}

struct Chain {
    state: ChainState,
    stream: Stream,
    current: Contribution,
    /// Of large steps, small steps, and small steps that change the technique.
    tallies: [Acceptance; 3],
}

/// What a lane made in one pass.
struct Job {
    splats: Splats,
    rays: u64,
    /// Per length the sum of the luminances that large steps found, and their number.
    large_steps: Vec<(f64, u64)>,
    health: Health,
}

/// What a pass does with one length.
struct Share {
    edges: usize,
    /// Mutations by all lanes together; 0 for a length in which no light has been found yet.
    mutations: u64,
    /// What one of them is worth: b_k over their number, in units of a pixel's mean.
    worth: f64,
}

/// One chain of each length.
struct Lane {
    /// By length; `None` where no light has been found yet.
    chains: Vec<Option<Chain>>,
    camera: Subpath,
    light: Subpath,
    health: Health,
}

/// The method with its chains.
pub(super) struct Mmlt {
    seed: u64,
    direct: Path,
    /// Samples per length in a batch.
    batch: usize,
    lengths: Vec<Length>,
    lanes: Vec<Lane>,
}

/// Row of the technique choice; the rows of the camera's and of the light's walk follow.
const TECHNIQUE_ROW: usize = 0;
const CAMERA_ROWS: usize = 1;

fn light_rows(edges: usize) -> usize {
    CAMERA_ROWS + edges + 1
}

fn rows(edges: usize) -> usize {
    light_rows(edges) + edges + 2
}

impl Mmlt {
    pub(super) fn start(scene: &Scene, settings: &Settings) -> Self {
        let lengths: Vec<Length> = (DIRECT_DEPTH + 1..=settings.max_depth)
            .map(|edges| Length { edges, sum: 0.0, samples: 0, batches: 0 })
            .collect();
        let pixels: usize = scene.camera.size.iter().product();
        let samples = (2 * pixels).clamp(*BATCH_SAMPLES.start(), *BATCH_SAMPLES.end());
        Self {
            seed: settings.seed,
            direct: Path::up_to(settings, DIRECT_DEPTH),
            batch: samples.div_ceil(lengths.len().max(1)),
            lanes: (0..LANES).map(|_| Lane::new(lengths.len())).collect(),
            lengths,
        }
    }

    /// Draws a batch of independent samples of a length in which no light has been found; starts its chains where one
    /// finds some.
    fn explore(&mut self, scene: &Scene, index: usize) {
        let Length { edges, batches, .. } = self.lengths[index];
        let key = |sample: usize| [2, edges as u64, batches, sample as u64];
        let luminances = explore(scene, edges, self.batch, |sample| Stream::new(self.seed, &key(sample)));
        let length = &mut self.lengths[index];
        length.batches += 1;
        length.samples += luminances.len() as u64;
        let Some(choice) = Discrete::new(&luminances) else { return };
        length.sum += luminances.iter().sum::<f64>();
        let caster = Caster::new(scene);
        for (number, lane) in self.lanes.iter_mut().enumerate() {
            let mut stream = Stream::new(self.seed, &[3, edges as u64, number as u64]);
            let (chosen, _) = choice.sample(stream.number());
            let mut state = ChainState::new(rows(edges));
            let mut draws = Stream::new(self.seed, &key(chosen));
            let current = lane.evaluate(&caster, edges, &mut state, &mut draws);
            state.accept();
            lane.chains[index] = current.map(|current| Chain { state, stream, current, tallies: Default::default() });
        }
    }

    /// How this pass divides one mutation per pixel among the lengths: in proportion to their light.
    fn plan(&self, pixels: f64) -> Vec<Share> {
        let total: f64 = self.lengths.iter().map(Length::normalisation).sum();
        let share = |length: &Length| {
            let b = length.normalisation();
            let mutations = if b > 0.0 { (b / total * pixels).ceil() } else { 0.0 };
            Share { edges: length.edges, mutations: mutations as u64, worth: b * pixels / mutations.max(1.0) }
        };
        self.lengths.iter().map(share).collect()
    }

    pub(super) fn pass(&mut self, scene: &Scene, film: &mut Film, pass: u64, counts: &mut Counts) {
        self.direct.pass(scene, film, pass, counts);
        for index in 0..self.lengths.len() {
            if self.lengths[index].sum == 0.0 {
                self.explore(scene, index);
            }
        }
        let (kernel, size) = (film.kernel.clone(), film.size);
        let plan = self.plan((size[0] * size[1]) as f64);
        let jobs: Vec<Job> = self
            .lanes
            .par_iter_mut()
            .enumerate()
            .map(|(number, lane)| {
                let caster = Caster::new(scene);
                let mut splats = Splats::new(size);
                // What does not divide evenly goes round the lanes from pass to pass.
                let turn = (number as u64 + pass) % LANES as u64;
                let large_steps = lane.run(&caster, &kernel, &plan, turn, &mut splats);
                Job { splats, rays: caster.rays(), large_steps, health: std::mem::take(&mut lane.health) }
            })
            .collect();
        for job in &jobs {
            film.report(&job.health);
            for (length, (sum, samples)) in self.lengths.iter_mut().zip(&job.large_steps) {
                length.sum += sum;
                length.samples += samples;
            }
        }
        counts.add(plan.iter().map(|share| share.mutations).sum(), jobs.iter().map(|job| job.rays).sum());
        let splats: Vec<Splats> = jobs.into_iter().map(|job| job.splats).collect();
        film.splat(&splats);
        self.report(counts);
    }

    /// Acceptance so far, summed over the lanes.
    fn report(&self, counts: &mut Counts) {
        for (kind, name) in ["large_step", "small_step", "technique_change"].into_iter().enumerate() {
            let sum = |(index, length): (usize, &Length)| {
                let chains = self.lanes.iter().filter_map(|lane| lane.chains[index].as_ref());
                let tallies = chains.map(|chain| chain.tallies[kind]);
                tallies.fold(Acceptance { length: length.edges, ..Acceptance::default() }, |sum, one| Acceptance {
                    proposed: sum.proposed + one.proposed,
                    accepted: sum.accepted + one.accepted,
                    ..sum
                })
            };
            counts.acceptance.insert(name, self.lengths.iter().enumerate().map(sum).collect());
        }
    }
}

/// Luminances of independent paths of `edges` edges, each from its own stream.
fn explore(scene: &Scene, edges: usize, samples: usize, stream: impl Fn(usize) -> Stream + Sync) -> Vec<f64> {
    const CHUNK: usize = 256;
    let chunks: Vec<Vec<f64>> = (0..samples.div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            let caster = Caster::new(scene);
            let mut lane = Lane::new(0);
            let one = |sample| {
                let mut state = ChainState::new(rows(edges));
                lane.evaluate(&caster, edges, &mut state, &mut stream(sample)).map_or(0.0, |found| found.luminance)
            };
            (chunk * CHUNK..samples.min((chunk + 1) * CHUNK)).map(one).collect()
        })
        .collect();
    chunks.concat()
}

impl Lane {
    fn new(lengths: usize) -> Self {
        Self {
            chains: (0..lengths).map(|_| None).collect(),
            camera: Subpath::default(),
            light: Subpath::default(),
            health: Health::default(),
        }
    }

    /// The path of the state's proposal; `None` where it carries no light.
    fn evaluate(
        &mut self,
        scene: &Caster<'_>,
        edges: usize,
        state: &mut ChainState,
        stream: &mut Stream,
    ) -> Option<Contribution> {
        let techniques = edges + 1;
        let choice = state.row(TECHNIQUE_ROW, stream)[0];
        let s = ((choice * techniques as f64) as usize).min(edges);
        let t = techniques - s;
        let first = state.row(CAMERA_ROWS, stream);
        let film = DVec2::new(first[0] * scene.camera.size[0] as f64, first[1] * scene.camera.size[1] as f64);
        let never = usize::MAX;
        trace_camera(scene, film, first, &mut state.rows(CAMERA_ROWS, stream), t, never, &mut self.camera);
        if self.camera.vertices.len() != t {
            return None;
        }
        trace_light(scene, &mut state.rows(light_rows(edges), stream), s, never, &mut self.light);
        if self.light.vertices.len() != s {
            return None;
        }
        let found = connect(scene, &self.light.vertices, &self.camera.vertices, &TECHNIQUES)?;
        let value = found.value * techniques as f64;
        let luminance = value.luminance();
        (self.health.accepts(value) && luminance > 0.0).then_some(Contribution {
            value,
            luminance,
            class: found.class,
            film: found.film.unwrap_or(film),
            technique: s,
        })
    }

    /// Runs each chain for the lane's part of the mutations; returns per length the luminance and number of its large
    /// steps. The first `mutations % LANES` turns take one more.
    fn run(
        &mut self,
        scene: &Caster<'_>,
        kernel: &Kernel,
        plan: &[Share],
        turn: u64,
        splats: &mut Splats,
    ) -> Vec<(f64, u64)> {
        let mut chains = std::mem::take(&mut self.chains);
        let run = |(chain, share): (&mut Option<Chain>, &Share)| {
            let (mut sum, mut samples) = (0.0, 0);
            let lanes = LANES as u64;
            let mutations = share.mutations / lanes + u64::from(turn < share.mutations % lanes);
            if let Some(chain) = chain {
                for _ in 0..mutations {
                    if let Some(luminance) = self.mutate(scene, chain, share, kernel, splats) {
                        sum += luminance;
                        samples += 1;
                    }
                }
            }
            (sum, samples)
        };
        let found = chains.iter_mut().zip(plan).map(run).collect();
        self.chains = chains;
        found
    }

    /// One mutation; both states are splatted with their expected weight. Returns the luminance found by a large step.
    fn mutate(
        &mut self,
        scene: &Caster<'_>,
        chain: &mut Chain,
        share: &Share,
        kernel: &Kernel,
        splats: &mut Splats,
    ) -> Option<f64> {
        let large = chain.stream.number() < LARGE_STEP_PROBABILITY;
        chain.state.propose(large);
        let proposal = self.evaluate(scene, share.edges, &mut chain.state, &mut chain.stream);
        let luminance = proposal.map_or(0.0, |found| found.luminance);
        let acceptance = (luminance / chain.current.luminance).min(1.0);
        let mut splat = |path: &Contribution, weight: f64| {
            if weight > 0.0 {
                splats.add(kernel, path.film, path.class, path.value * (weight * share.worth / path.luminance));
            }
        };
        splat(&chain.current, 1.0 - acceptance);
        let accepted = chain.stream.number() < acceptance;
        let tally = |kind: &mut Acceptance| {
            kind.proposed += 1;
            kind.accepted += u64::from(accepted);
        };
        tally(&mut chain.tallies[usize::from(!large)]);
        if let Some(found) = &proposal {
            splat(found, acceptance);
            if !large && found.technique != chain.current.technique {
                tally(&mut chain.tallies[2]);
            }
        }
        match proposal.filter(|_| accepted) {
            Some(found) => {
                chain.current = found;
                chain.state.accept();
            }
            None => chain.state.reject(),
        }
        large.then_some(luminance)
    }
}
