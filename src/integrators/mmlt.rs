//! Multiplexed Metropolis light transport (Hachisuka, Kaplanyan and Dachsbacher 2014; Bitterli 2015, section 3.5).
//!
//! One family of chains per path length k: the state holds the rows of both subpaths and a number that chooses the
//! technique; the target is the luminance of the technique's weighted contribution times the number of techniques, so
//! that its mean over the unit cube is b_k, the mean luminance of the image of length k. b_k comes from independent
//! samples at the start and from every large step since.
//!
//! Light seen directly and direct light (k ≤ 2) are rendered by path tracing, as in both papers on the method.

use super::{Acceptance, Counts, path::Path, render::Settings};
use crate::film::{Film, Kernel, PathClass, Splats};
use crate::markov::{ChainState, LARGE_STEP_PROBABILITY};
use crate::math::{Discrete, Stream};
use crate::paths::{Heuristic, Subpath, connect, trace_camera, trace_light};
use crate::scene::{Caster, Scene};
use crate::spectrum::Spectrum;
use glam::DVec2;
use rayon::prelude::*;
use std::ops::RangeInclusive;

/// Longest path that is left to path tracing.
const DIRECT_DEPTH: usize = 2;

/// Chains per path length. Each lane owns one of each length, its random streams and its splats.
const LANES: usize = 16;

/// Independent samples at the start, over all lengths: two per pixel, within these bounds. Large steps refine what they
/// find, so that they need not be many.
const BOOTSTRAP_SAMPLES: RangeInclusive<usize> = 20_000..=200_000;

/// A path as the film sees it.
#[derive(Clone, Copy)]
struct Contribution {
    value: Spectrum,
    luminance: f64,
    class: PathClass,
    film: DVec2,
    technique: usize,
}

/// The normalisation of one path length.
struct Length {
    edges: usize,
    /// Sum of the luminances of independent samples, and their number.
    sum: f64,
    samples: u64,
}

impl Length {
    /// b_k.
    fn normalisation(&self) -> f64 {
        self.sum / self.samples as f64
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
}

/// One chain of each length that light takes.
struct Lane {
    chains: Vec<Chain>,
    camera: Subpath,
    light: Subpath,
}

/// The method with its chains.
pub(super) struct Mmlt {
    direct: Path,
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
        let lengths = DIRECT_DEPTH + 1..=settings.max_depth;
        let pixels: usize = scene.camera.size.iter().product();
        let samples = (2 * pixels).clamp(*BOOTSTRAP_SAMPLES.start(), *BOOTSTRAP_SAMPLES.end());
        let per_length = samples / lengths.clone().count().max(1);
        let mut this = Self {
            direct: Path::up_to(settings, DIRECT_DEPTH),
            lengths: Vec::new(),
            lanes: (0..LANES).map(|_| Lane::new()).collect(),
        };
        for edges in lengths {
            let luminances = bootstrap(scene, settings.seed, edges, per_length);
            let Some(choice) = Discrete::new(&luminances) else { continue };
            for (index, lane) in this.lanes.iter_mut().enumerate() {
                let mut stream = Stream::new(settings.seed, &[3, edges as u64, index as u64]);
                let (chosen, _) = choice.sample(stream.number());
                let mut state = ChainState::new(rows(edges));
                let caster = Caster::new(scene);
                let mut draws = bootstrap_stream(settings.seed, edges, chosen);
                let current = lane.evaluate(&caster, edges, &mut state, &mut draws);
                state.accept();
                let Some(current) = current else { continue };
                lane.chains.push(Chain { state, stream, current, tallies: Default::default() });
            }
            this.lengths.push(Length { edges, sum: luminances.iter().sum(), samples: per_length as u64 });
        }
        this
    }

    pub(super) fn pass(&mut self, scene: &Scene, film: &mut Film, pass: u64, counts: &mut Counts) {
        self.direct.pass(scene, film, pass, counts);
        let (kernel, size) = (film.kernel.clone(), film.size);
        let pixels = (size[0] * size[1]) as f64;
        let total: f64 = self.lengths.iter().map(Length::normalisation).sum();
        // Mutations per chain, in proportion to the light of the length, and what one of them is worth.
        let plan: Vec<(usize, u64, f64)> = self
            .lengths
            .iter()
            .map(|length| {
                let b = length.normalisation();
                let mutations = (b / total * pixels / LANES as f64).ceil().max(1.0);
                (length.edges, mutations as u64, b * pixels / (mutations * LANES as f64))
            })
            .collect();
        let jobs: Vec<Job> = self
            .lanes
            .par_iter_mut()
            .map(|lane| {
                let caster = Caster::new(scene);
                let mut splats = Splats::new(size);
                let large_steps = lane.run(&caster, &kernel, &plan, &mut splats);
                Job { splats, rays: caster.rays(), large_steps }
            })
            .collect();
        for job in &jobs {
            for (length, (sum, samples)) in self.lengths.iter_mut().zip(&job.large_steps) {
                length.sum += sum;
                length.samples += samples;
            }
        }
        let mutations: u64 = plan.iter().map(|(_, mutations, _)| mutations * LANES as u64).sum();
        counts.add(mutations, jobs.iter().map(|job| job.rays).sum());
        let splats: Vec<Splats> = jobs.into_iter().map(|job| job.splats).collect();
        film.splat(&splats);
        self.report(counts);
    }

    /// Acceptance so far, summed over the lanes.
    fn report(&self, counts: &mut Counts) {
        for (kind, name) in ["large_step", "small_step", "technique_change"].into_iter().enumerate() {
            let sum = |(index, length): (usize, &Length)| {
                let tallies = self.lanes.iter().map(|lane| lane.chains[index].tallies[kind]);
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

fn bootstrap_stream(seed: u64, edges: usize, index: usize) -> Stream {
    Stream::new(seed, &[2, edges as u64, index as u64])
}

/// Luminances of `samples` independent paths of `edges` edges.
fn bootstrap(scene: &Scene, seed: u64, edges: usize, samples: usize) -> Vec<f64> {
    const CHUNK: usize = 256;
    let chunks: Vec<Vec<f64>> = (0..samples.div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            let caster = Caster::new(scene);
            let mut lane = Lane::new();
            (chunk * CHUNK..samples.min((chunk + 1) * CHUNK))
                .map(|index| {
                    let mut state = ChainState::new(rows(edges));
                    let mut stream = bootstrap_stream(seed, edges, index);
                    lane.evaluate(&caster, edges, &mut state, &mut stream).map_or(0.0, |found| found.luminance)
                })
                .collect()
        })
        .collect();
    chunks.concat()
}

impl Lane {
    fn new() -> Self {
        Self { chains: Vec::new(), camera: Subpath::default(), light: Subpath::default() }
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
        let found = connect(scene, &self.light.vertices, &self.camera.vertices, Heuristic::Power)?;
        let value = found.value * techniques as f64;
        let luminance = value.luminance();
        (value.is_valid() && luminance > 0.0).then_some(Contribution {
            value,
            luminance,
            class: found.class,
            film: found.film.unwrap_or(film),
            technique: s,
        })
    }

    /// Runs each chain for its mutations; returns per length the luminance and number of its large steps.
    fn run(
        &mut self,
        scene: &Caster<'_>,
        kernel: &Kernel,
        plan: &[(usize, u64, f64)],
        splats: &mut Splats,
    ) -> Vec<(f64, u64)> {
        let mut chains = std::mem::take(&mut self.chains);
        let found = chains
            .iter_mut()
            .zip(plan)
            .map(|(chain, (edges, mutations, worth))| {
                let (mut sum, mut samples) = (0.0, 0);
                for _ in 0..*mutations {
                    if let Some(luminance) = self.mutate(scene, chain, *edges, *worth, kernel, splats) {
                        sum += luminance;
                        samples += 1;
                    }
                }
                (sum, samples)
            })
            .collect();
        self.chains = chains;
        found
    }

    /// One mutation; both states are splatted with their expected weight. Returns the luminance found by a large step.
    fn mutate(
        &mut self,
        scene: &Caster<'_>,
        chain: &mut Chain,
        edges: usize,
        worth: f64,
        kernel: &Kernel,
        splats: &mut Splats,
    ) -> Option<f64> {
        let large = chain.stream.number() < LARGE_STEP_PROBABILITY;
        chain.state.propose(large);
        let proposal = self.evaluate(scene, edges, &mut chain.state, &mut chain.stream);
        let luminance = proposal.map_or(0.0, |found| found.luminance);
        let acceptance = (luminance / chain.current.luminance).min(1.0);
        let mut splat = |path: &Contribution, weight: f64| {
            if weight > 0.0 {
                splats.add(kernel, path.film, path.class, path.value * (weight * worth / path.luminance));
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
