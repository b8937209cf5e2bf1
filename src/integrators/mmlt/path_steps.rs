//! What chains do in path space: mutations there, and independent paths that more than techniques find.

use super::chain::{Chain, LARGE, PRIMARY};
use super::lane::{Lane, Work};
use crate::markov::{ChainState, Tracer, retell};
use crate::math::Stream;
use crate::path_space::{Drawn, Mixture, Proposed, Ways};
use crate::paths::{Found, FullPath};
use crate::scene::Caster;

/// How far the target may be off, relative to itself, after the way to rows and back.
const ROUND_TRIP: f64 = 1e-6;

impl Lane {
    /// An independent path.
    pub(super) fn draw(
        &mut self,
        scene: &Caster<'_>,
        tracer: Tracer,
        ways: (&Mixture, Ways),
        stream: &mut Stream,
    ) -> Option<Drawn> {
        let Self { path_space, proposal, health, .. } = self;
        let by_technique = |s, stream: &mut Stream, path: &mut FullPath| tracer.sample(scene, s, stream, path, health);
        path_space.sample(scene, ways, stream, proposal, by_technique)
    }

    /// A chain that begins at the independent path that `draws` gives; `None` where its rows cannot be found.
    pub(super) fn start(
        &mut self,
        scene: &Caster<'_>,
        (tracer, mixture): (Tracer, &Mixture),
        mut state: ChainState,
        mut draws: Stream,
        mut stream: Stream,
    ) -> Option<Chain> {
        let found = if mixture.links() {
            let Drawn { found, .. } = self.draw(scene, tracer, (mixture, Ways::All), &mut draws)?;
            self.confirm(scene, tracer, found, None, &mut state, &mut stream).ok()?
        } else {
            self.find(scene, tracer, &mut state, &mut draws)?
        };
        state.accept();
        Some(Chain::new(state, stream, found, std::mem::take(&mut self.proposal)))
    }

    /// A mutation in path space, of a path that keeps its technique (Otsu 2017, algorithm 1 of chapter 6).
    pub(super) fn path_step(&mut self, chain: &mut Chain, work: &mut Work<'_>) {
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
    pub(super) fn independent_step(&mut self, chain: &mut Chain, work: &mut Work<'_>) {
        let Chain { stream, path, current, drawn: known, .. } = chain;
        // What a hidden path is worth takes long to tell.
        let ways = if stream.number() < work.mixture.seeking() { Ways::All } else { Ways::Known };
        let drawn = self.draw(work.scene, work.tracer, (work.mixture, ways), stream);
        work.large_steps.add(drawn.map_or((0.0, false), |drawn| (drawn.worth, drawn.hidden)), ways);
        let proposal = drawn.filter(|drawn| drawn.known).and_then(|Drawn { found, worth, .. }| {
            let before = &mut known[ways as usize];
            if before.is_none() {
                *before = self.path_space.worth(work.scene, (path, current), (work.mixture, ways), stream);
            }
            let before = (*before)?;
            Some((found, worth / before))
        });
        self.move_path(chain, LARGE, proposal, work);
    }

    /// Accepts or rejects what path space proposes, which comes with its acceptance.
    fn move_path(&mut self, chain: &mut Chain, kind: usize, proposal: Option<(Found, f64)>, work: &mut Work<'_>) {
        chain.state.propose(false);
        let number = chain.stream.number();
        // Rows are wanted of what is about to be accepted alone.
        let confirmed = proposal.and_then(|(found, ratio)| {
            if number >= ratio {
                return Some((found, ratio));
            }
            let Chain { state, stream, path, current, .. } = chain;
            let before = Some((&*path, current.technique));
            let confirmed = self.confirm(work.scene, work.tracer, found, before, state, stream);
            Some((confirmed.map_err(|cause| chain.reject(cause)).ok()?, ratio))
        });
        let ratio = confirmed.map_or(0.0, |(_, ratio)| ratio);
        self.decide(chain, kind, (&confirmed.map(|(found, _)| found), ratio), number, work);
    }

    /// Has the state, which leads to the path `before` if to any, lead to the proposal `found`; that must also be what its rows
    /// lead to (Otsu 2017, section 6.7.1). Fails with the cause.
    fn confirm(
        &mut self,
        scene: &Caster<'_>,
        tracer: Tracer,
        found: Found,
        before: Option<(&FullPath, usize)>,
        state: &mut ChainState,
        stream: &mut Stream,
    ) -> Result<Found, &'static str> {
        let Self { proposal, returned, health, .. } = self;
        retell(scene, proposal, before, state, stream).ok_or("inversion")?;
        let back = tracer.find(scene, found.technique, state, stream, returned, health);
        let same = |back: &Found| (back.luminance / found.luminance - 1.0).abs() < ROUND_TRIP;
        let back = back.filter(same).ok_or("round_trip")?;
        std::mem::swap(proposal, returned);
        Ok(back)
    }
}
