//! The chains of one lane, and what they do in a pass.

use super::super::chains::Mean;
use super::{Family, Share};
use crate::film::{Health, Kernel, Splats};
use crate::markov::{
    ChainState, ControlledMemory, Jump, JumpMemory, Jumps, Mutations, Tracer, Tries, controlled_step, jump, retell,
};
use crate::math::Stream;
use crate::path_space::{Gain, Kind, PathSpace, Proposed, Target, way};
use crate::paths::{Found, FullPath};
use crate::scene::{Caster, Scene};
use std::collections::BTreeMap;

/// The mutations in primary sample space; those in path space come after them.
pub(super) const PRIMARY: [&str; 3] = ["large_step", "small_step", "technique_change"];
const LARGE: usize = 0;
const SMALL: usize = 1;
const CHANGE: usize = 2;
/// How many kinds of mutations there are.
pub(super) const KINDS: usize = PRIMARY.len() + Kind::ALL.len();

/// Names of all kinds, in the order of their tallies.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    PRIMARY.into_iter().chain(Kind::ALL.map(Kind::name))
}

/// How far the target may be off, relative to itself, after the way to rows and back.
const ROUND_TRIP: f64 = 1e-6;

/// One chain.
#[derive(Clone)]
pub(super) struct Chain {
    state: ChainState,
    stream: Stream,
    current: Found,
    /// How often the current path has been counted and not yet been splatted.
    weight: f64,
    /// The path of `current`, as the technique that it came by has found it.
    path: FullPath,
    /// By kind, proposals and accepted ones. Technique changes of `mmlt` are among its small steps too.
    pub tallies: [[u64; 2]; KINDS],
    /// Jumps for which no rows could be found.
    pub failed: u64,
    /// Mutations in path space that came to nothing, by cause.
    pub rejections: BTreeMap<&'static str, u64>,
}

impl Chain {
    fn new(state: ChainState, stream: Stream, current: Found, path: FullPath) -> Self {
        let (tallies, rejections) = (Default::default(), BTreeMap::new());
        Self { state, stream, current, weight: 0.0, path, tallies, failed: 0, rejections }
    }

    /// Counts a mutation in path space that came to nothing.
    fn reject(&mut self, cause: &'static str) {
        *self.rejections.entry(cause).or_default() += 1;
    }

    fn tally(&mut self, kind: usize, accepted: bool) {
        let [proposals, successes] = &mut self.tallies[kind];
        *proposals += 1;
        *successes += u64::from(accepted);
    }
}

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
    pub large_steps: Vec<Mean>,
    pub health: Health,
}

/// One chain of each length.
pub(super) struct Lane {
    /// By length; `None` where no light has been found yet.
    pub chains: Vec<Option<Chain>>,
    family: Family,
    mutations: Mutations,
    health: Health,
    proposal: FullPath,
    tries: Tries,
    jumps: JumpMemory,
    controlled: ControlledMemory,
    path_space: PathSpace,
    /// Whether it is a pilot run.
    pilot: Option<Pilot>,
    /// What the rows of a path lead to.
    returned: FullPath,
}

/// What the mutations of one length work on in a pass.
struct Work<'a> {
    scene: &'a Caster<'a>,
    tracer: Tracer,
    kernel: &'a Kernel,
    splats: &'a mut Splats,
    /// What one mutation adds.
    worth: f64,
    /// What large steps found.
    large_steps: Mean,
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

    /// Whether independent paths come about by connections over manifolds as well.
    pub(super) fn links(&self, scene: &Caster<'_>) -> bool {
        self.family == Family::Fused && self.mutations.path_space.links(scene)
    }

    /// An independent path, with what it is worth.
    pub(super) fn draw(&mut self, scene: &Caster<'_>, tracer: Tracer, stream: &mut Stream) -> Option<(Found, f64)> {
        self.path_space.sample(scene, tracer, stream, &mut self.proposal, &mut self.health)
    }

    /// A chain that begins at the independent path that `draws` gives; `None` where its rows cannot be found.
    pub(super) fn start(
        &mut self,
        scene: &Caster<'_>,
        tracer: Tracer,
        mut state: ChainState,
        mut draws: Stream,
        mut stream: Stream,
    ) -> Option<Chain> {
        let found = if self.links(scene) {
            let (found, _) = self.draw(scene, tracer, &mut draws)?;
            self.confirm(scene, tracer, found, found.technique, &mut state, &mut stream).ok()?
        } else {
            self.find(scene, tracer, &mut state, &mut draws)?
        };
        state.accept();
        Some(Chain::new(state, stream, found, std::mem::take(&mut self.proposal)))
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
            let Share { tracer, worth, mutations, weights } = *share;
            self.path_space.weights = weights;
            let (scene, splats) = (&caster, &mut splats);
            let mut work = Work { scene, tracer, kernel, splats, worth, large_steps: Mean::default() };
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
        (index, tracer): (usize, Tracer),
        (mutations, stream): (u64, Stream),
    ) -> Pilot {
        let Some(chain) = &self.chains[index] else { return Pilot::default() };
        let mut chain = Chain { stream, ..chain.clone() };
        let (caster, mut splats) = (Caster::new(scene), Splats::new(size));
        let (scene, splats) = (&caster, &mut splats);
        let mut work = Work { scene, tracer, kernel, splats, worth: 0.0, large_steps: Mean::default() };
        self.pilot = Some(Pilot::default());
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
            return if self.mutations.tries(work.tracer.edges) {
                self.try_all(chain, work);
            } else if self.links(work.scene) {
                self.independent_step(chain, work);
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
        if self.family == Family::Fused && chain.stream.number() < self.path_share() {
            return self.path_step(chain, work);
        }
        self.small_step(chain, work);
    }

    /// Share of the small steps in whose place paths move in path space; in a pilot run many do.
    fn path_share(&self) -> f64 {
        if self.pilot.is_some() { 0.5 } else { self.mutations.path_step }
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
        let proposal = self.find(work.scene, work.tracer, &mut chain.state, &mut chain.stream);
        let luminance = proposal.map_or(0.0, |found| found.luminance);
        work.large_steps.add(luminance);
        let proposal = proposal.map(|found| (found, luminance / chain.current.luminance));
        let number = chain.stream.number();
        self.decide(chain, LARGE, proposal, number, work);
    }

    fn small_step(&mut self, chain: &mut Chain, work: &mut Work<'_>) {
        chain.state.propose(false);
        let Chain { state, stream, current, path, .. } = chain;
        let Work { scene, tracer, .. } = *work;
        let Self { proposal, health, controlled, family, .. } = self;
        let before = current.technique;
        let (technique, found) = if self.mutations.controlled {
            let found = controlled_step(tracer, scene, (path, current), state, stream, proposal, health, controlled);
            (before, found)
        } else {
            let technique = match family {
                Family::Multiplexed => tracer.technique(state.row(Tracer::TECHNIQUE_ROW, stream)[0]),
                Family::Jumping | Family::Fused => before,
            };
            let found = tracer.find(scene, technique, state, stream, proposal, health);
            (technique, found.map(|found| (found, 1.0)))
        };
        let ratio = |(found, correction): (Found, f64)| (found, correction * found.luminance / current.luminance);
        let (proposal, number) = (found.map(ratio), stream.number());
        let accepted = self.decide(chain, SMALL, proposal, number, work);
        if technique != before {
            chain.tally(CHANGE, accepted);
        }
    }

    /// A mutation in path space, of a path that keeps its technique (Otsu 2017, algorithm 1 of chapter 6).
    fn path_step(&mut self, chain: &mut Chain, work: &mut Work<'_>) {
        let Chain { stream, current, path, .. } = chain;
        let Proposed { kind, outcome } =
            self.path_space.propose(work.scene, (path, current), stream, &mut self.proposal);
        let Some(kind) = kind else {
            chain.weight += 1.0;
            return;
        };
        let proposal = outcome.map_err(|cause| chain.reject(cause.name())).ok();
        self.move_path(chain, PRIMARY.len() + kind as usize, proposal, work);
    }

    /// A large step in path space.
    fn independent_step(&mut self, chain: &mut Chain, work: &mut Work<'_>) {
        let drawn = self.draw(work.scene, work.tracer, &mut chain.stream);
        work.large_steps.add(drawn.map_or(0.0, |(_, worth)| worth));
        let proposal = drawn.and_then(|(found, worth)| {
            let before = self.path_space.worth(work.scene, (&chain.path, &chain.current))?;
            Some((found, worth / before))
        });
        self.move_path(chain, LARGE, proposal, work);
    }

    /// Accepts or rejects what path space proposes, which comes with its acceptance.
    fn move_path(&mut self, chain: &mut Chain, kind: usize, proposal: Option<(Found, f64)>, work: &mut Work<'_>) {
        chain.state.propose(false);
        let (number, technique) = (chain.stream.number(), chain.current.technique);
        // Rows are wanted of what is about to be accepted alone.
        let confirmed = proposal.and_then(|(found, ratio)| {
            if number >= ratio {
                return Some((found, ratio));
            }
            let Chain { state, stream, .. } = chain;
            let confirmed = self.confirm(work.scene, work.tracer, found, technique, state, stream);
            Some((confirmed.map_err(|cause| chain.reject(cause)).ok()?, ratio))
        });
        self.decide(chain, kind, confirmed, number, work);
    }

    /// Has the state, whose technique is `from`, lead to the proposal `found`; that must also be what its rows lead to (Otsu
    /// 2017, section 6.7.1). Fails with the cause.
    fn confirm(
        &mut self,
        scene: &Caster<'_>,
        tracer: Tracer,
        found: Found,
        from: usize,
        state: &mut ChainState,
        stream: &mut Stream,
    ) -> Result<Found, &'static str> {
        let Self { proposal, returned, health, .. } = self;
        retell(scene, proposal, from, state, stream).ok_or("inversion")?;
        let back = tracer.find(scene, found.technique, state, stream, returned, health);
        let same = |back: &Found| (back.luminance / found.luminance - 1.0).abs() < ROUND_TRIP;
        let back = back.filter(same).ok_or("round_trip")?;
        std::mem::swap(proposal, returned);
        Ok(back)
    }

    /// A large step among all techniques.
    fn try_all(&mut self, chain: &mut Chain, work: &mut Work<'_>) {
        let Chain { state, stream, current, .. } = chain;
        let Work { scene, tracer, .. } = *work;
        let known = Some(current.technique);
        let before = current.luminance + self.tries.sum(tracer, scene, known, state, stream, &mut self.health);
        state.propose(true);
        let sum = self.tries.sum(tracer, scene, None, state, stream, &mut self.health);
        work.large_steps.add(sum / tracer.techniques() as f64);
        let proposal = self.tries.choose(tracer, stream, &mut self.proposal);
        if let (Some(found), Family::Multiplexed) = (&proposal, self.family) {
            let number = (found.technique as f64 + stream.number()) / tracer.techniques() as f64;
            state.set(Tracer::TECHNIQUE_ROW, [number, 0.0, 0.0, 0.0]);
        }
        let number = chain.stream.number();
        self.decide(chain, LARGE, proposal.map(|found| (found, sum / before)), number, work);
    }

    /// Accepts the proposal, which comes with its acceptance, if `number` is less than that; says whether.
    #[inline]
    fn decide(
        &mut self,
        chain: &mut Chain,
        kind: usize,
        proposal: Option<(Found, f64)>,
        number: f64,
        work: &mut Work<'_>,
    ) -> bool {
        let acceptance = proposal.map_or(0.0, |(_, ratio)| ratio.min(1.0));
        chain.weight += 1.0 - acceptance;
        if let Some(pilot) = &mut self.pilot {
            let rays = work.scene.rays();
            let way = if acceptance > 0.0 { way(work.scene, &chain.path, &self.proposal) } else { 0.0 };
            pilot.gains[kind].add(acceptance * way, rays - std::mem::replace(&mut pilot.rays, rays));
        }
        let accepted = number < acceptance;
        chain.tally(kind, accepted);
        let Some((found, _)) = proposal else {
            chain.state.reject();
            return false;
        };
        if accepted {
            work.splat(&chain.current, std::mem::replace(&mut chain.weight, acceptance));
            chain.current = found;
            chain.state.accept();
            std::mem::swap(&mut chain.path, &mut self.proposal);
        } else {
            work.splat(&found, acceptance);
            chain.state.reject();
        }
        accepted
    }
}
