//! The chains of one lane, and what they do in a pass.

use super::super::chains::Light;
use super::chain::{CHANGE, Chain, KINDS, LARGE, SMALL};
use super::{Family, Share};
use crate::film::{Health, Kernel, Splats};
use crate::markov::{
    ChainState, ControlledMemory, Jump, JumpMemory, Jumps, Mutations, Tracer, Tries, controlled_step, jump,
};
use crate::math::Stream;
use crate::path_space::{Gain, Mixture, PathSpace, Target, Ways, Weights, way};
use crate::paths::{Found, FullPath};
use crate::scene::{Caster, Scene};

/// Share of the small steps in whose place paths move in path space in a pilot run.
const PILOT_PATH_STEP: f64 = 0.5;

/// What mutations bring, by their kind.
#[derive(Clone, Copy, Default)]
pub(super) struct Pilot {
    pub gains: [Gain; KINDS],
    /// Rays cast when the last mutation ended.
    rays: u64,
}

/// What a lane made in one pass.
pub(super) struct Job {
    pub splats: Splats,
    pub rays: u64,
    /// Per length what large steps found.
    pub large_steps: Vec<Light>,
    pub health: Health,
}

/// One chain of each length.
pub(super) struct Lane {
    /// By length; `None` where no light has been found yet.
    pub chains: Vec<Option<Chain>>,
    pub family: Family,
    pub mutations: Mutations,
    pub health: Health,
    pub proposal: FullPath,
    tries: Tries,
    jumps: JumpMemory,
    controlled: ControlledMemory,
    pub path_space: PathSpace,
    /// Whether it is a pilot run.
    pilot: Option<Pilot>,
    /// What the rows of a path lead to.
    pub returned: FullPath,
}

/// What the mutations of one length work on in a pass.
pub(super) struct Work<'a> {
    pub scene: &'a Caster<'a>,
    pub tracer: Tracer,
    pub mixture: &'a Mixture,
    /// Share of the small steps in whose place paths move in path space.
    path_step: f64,
    kernel: &'a Kernel,
    splats: &'a mut Splats,
    /// What one mutation adds.
    worth: f64,
    /// What large steps found.
    pub large_steps: Light,
}

impl Work<'_> {
    #[inline]
    fn splat(&mut self, path: &Found, weight: f64) {
        if weight * self.worth > 0.0 {
            self.splats.add(self.kernel, path.film, path.class, path.value * (weight * self.worth / path.luminance));
        }
    }
}

impl Lane {
    pub(super) fn new(family: Family, mutations: Mutations, lengths: usize) -> Self {
        Self {
            chains: (0..lengths).map(|_| None).collect(),
            family,
            mutations,
            health: Health::default(),
            proposal: FullPath::default(),
            tries: Tries::default(),
            jumps: JumpMemory::default(),
            controlled: ControlledMemory::default(),
            path_space: PathSpace::new(mutations.path_space, Target::Technique),
            pilot: None,
            returned: FullPath::default(),
        }
    }

    /// The path of the state's proposal, whose technique a number of the state chooses.
    pub(super) fn find(
        &mut self,
        scene: &Caster<'_>,
        tracer: Tracer,
        state: &mut ChainState,
        stream: &mut Stream,
    ) -> Option<Found> {
        let s = tracer.technique(state.row(Tracer::TECHNIQUE_ROW, stream)[0]);
        tracer.find(scene, s, state, stream, &mut self.proposal, &mut self.health)
    }

    /// Runs each chain for the lane's part of the mutations, which `own` gives.
    pub(super) fn run(
        &mut self,
        scene: &Scene,
        kernel: &Kernel,
        plan: &[Share],
        own: impl Fn(u64) -> u64,
        size: [usize; 2],
    ) -> Job {
        let (caster, mut splats) = (Caster::new(scene), Splats::new(size));
        let mut chains = std::mem::take(&mut self.chains);
        let run = |(chain, share): (&mut Option<Chain>, &Share)| {
            let Share { tracer, worth, mutations, weights, path_step, ref mixture } = *share;
            self.path_space.weights = weights;
            let (scene, splats) = (&caster, &mut splats);
            let large_steps = Light::default();
            let mut work = Work { scene, tracer, mixture, path_step, kernel, splats, worth, large_steps };
            if let Some(chain) = chain {
                for _ in 0..own(mutations) {
                    self.mutate(chain, &mut work);
                }
                work.splat(&chain.current, std::mem::take(&mut chain.weight));
            }
            work.large_steps
        };
        let large_steps = chains.iter_mut().zip(plan).map(run).collect();
        self.chains = chains;
        Job { splats, rays: caster.rays(), large_steps, health: std::mem::take(&mut self.health) }
    }

    /// What the mutations of a chain bring, a copy of which makes `mutations` of them.
    pub(super) fn pilot(
        &mut self,
        scene: &Scene,
        kernel: &Kernel,
        size: [usize; 2],
        (index, tracer, mixture): (usize, Tracer, &Mixture),
        (mutations, stream): (u64, Stream),
    ) -> Pilot {
        let Some(chain) = &self.chains[index] else { return Pilot::default() };
        let mut chain = Chain { stream, ..chain.clone() };
        let (caster, mut splats) = (Caster::new(scene), Splats::new(size));
        let (scene, splats) = (&caster, &mut splats);
        let (path_step, large_steps) = (PILOT_PATH_STEP, Light::default());
        let mut work = Work { scene, tracer, mixture, path_step, kernel, splats, worth: 0.0, large_steps };
        self.pilot = Some(Pilot::default());
        self.path_space.weights = Weights::even(self.mutations.path_space.kinds);
        for _ in 0..mutations {
            self.mutate(&mut chain, &mut work);
        }
        self.health = Health::default();
        self.pilot.take().unwrap_or_default()
    }

    /// One mutation; both states count with their expected weight.
    fn mutate(&mut self, chain: &mut Chain, work: &mut Work<'_>) {
        let kind = chain.stream.number();
        let large = self.mutations.large_step;
        if kind < large {
            // What tries find is not told apart into hidden light and other.
            return if work.mixture.links() {
                self.independent_step(chain, work);
            } else if self.mutations.tries(work.tracer.edges) {
                self.try_all(chain, work);
            } else {
                self.large_step(chain, work);
            };
        }
        if self.family != Family::Multiplexed {
            let separate = self.mutations.jumps == Jumps::Separate;
            let alone = separate && kind < large + self.mutations.jump;
            if alone || !separate {
                self.jump(work.scene, chain);
            }
            if alone {
                chain.weight += 1.0;
                return;
            }
        }
        if work.path_step > 0.0 && chain.stream.number() < work.path_step {
            return self.path_step(chain, work);
        }
        self.small_step(chain, work);
    }

    /// Another technique for the same path.
    fn jump(&mut self, scene: &Scene, chain: &mut Chain) {
        let Chain { state, stream, current, path, .. } = chain;
        match jump(scene, path, current, state, stream, &mut self.jumps) {
            Jump::Stayed => {}
            Jump::Moved => chain.tally(CHANGE, true),
            Jump::Failed => {
                chain.tally(CHANGE, false);
                chain.failed += 1;
            }
        }
    }

    fn large_step(&mut self, chain: &mut Chain, work: &mut Work<'_>) {
        chain.state.propose(true);
        let found = &self.find(work.scene, work.tracer, &mut chain.state, &mut chain.stream);
        let luminance = found.as_ref().map_or(0.0, |found| found.luminance);
        work.large_steps.add((luminance, false), Ways::Known);
        let (ratio, number) = (luminance / chain.current.luminance, chain.stream.number());
        self.decide(chain, LARGE, (found, ratio), number, work);
    }

    fn small_step(&mut self, chain: &mut Chain, work: &mut Work<'_>) {
        chain.state.propose(false);
        let Chain { state, stream, current, path, .. } = chain;
        let Work { scene, tracer, .. } = *work;
        let Self { proposal, health, controlled, family, .. } = self;
        let before = current.technique;
        let (technique, found, correction) = if self.mutations.controlled {
            let moved = controlled_step(tracer, scene, (path, current), state, stream, proposal, health, controlled);
            (before, moved.map(|(found, _)| found), moved.map_or(0.0, |(_, correction)| correction))
        } else {
            let technique = match family {
                Family::Multiplexed => tracer.technique(state.row(Tracer::TECHNIQUE_ROW, stream)[0]),
                Family::Jumping | Family::Fused => before,
            };
            (technique, tracer.find(scene, technique, state, stream, proposal, health), 1.0)
        };
        let ratio = found.as_ref().map_or(0.0, |found| correction * found.luminance / current.luminance);
        let number = stream.number();
        let accepted = self.decide(chain, SMALL, (&found, ratio), number, work);
        if technique != before {
            chain.tally(CHANGE, accepted);
        }
    }

    /// A large step among all techniques.
    fn try_all(&mut self, chain: &mut Chain, work: &mut Work<'_>) {
        let Chain { state, stream, current, .. } = chain;
        let Work { scene, tracer, .. } = *work;
        let known = Some(current.technique);
        let before = current.luminance + self.tries.sum(tracer, scene, known, state, stream, &mut self.health);
        state.propose(true);
        let sum = self.tries.sum(tracer, scene, None, state, stream, &mut self.health);
        work.large_steps.add((sum / tracer.techniques() as f64, false), Ways::Known);
        let proposal = self.tries.choose(tracer, stream, &mut self.proposal);
        if let (Some(found), Family::Multiplexed) = (&proposal, self.family) {
            let number = (found.technique as f64 + stream.number()) / tracer.techniques() as f64;
            state.set(Tracer::TECHNIQUE_ROW, [number, 0.0, 0.0, 0.0]);
        }
        let number = chain.stream.number();
        self.decide(chain, LARGE, (&proposal, sum / before), number, work);
    }

    /// Accepts the proposal, which comes with its acceptance (0 for none), if `number` is less than that; says whether.
    #[inline]
    pub(super) fn decide(
        &mut self,
        chain: &mut Chain,
        kind: usize,
        (proposal, ratio): (&Option<Found>, f64),
        number: f64,
        work: &mut Work<'_>,
    ) -> bool {
        let acceptance = ratio.min(1.0);
        chain.weight += 1.0 - acceptance;
        if let Some(pilot) = &mut self.pilot {
            let rays = work.scene.rays();
            let way = if acceptance > 0.0 { way(work.scene, &chain.path, &self.proposal) } else { 0.0 };
            pilot.gains[kind].add(acceptance * way, rays - std::mem::replace(&mut pilot.rays, rays));
        }
        let accepted = number < acceptance;
        chain.tally(kind, accepted);
        let Some(found) = proposal else {
            chain.state.reject();
            return false;
        };
        if accepted {
            work.splat(&chain.current, std::mem::replace(&mut chain.weight, acceptance));
            (chain.current, chain.drawn) = (*found, [None; 2]);
            chain.state.accept();
            std::mem::swap(&mut chain.path, &mut self.proposal);
        } else {
            work.splat(found, acceptance);
            chain.state.reject();
        }
        accepted
    }
}
