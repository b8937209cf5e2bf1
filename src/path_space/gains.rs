//! Which mutations pay. A pilot run, whose chains are thrown away, tells how far each mutation takes a chain for what it
//! costs; what follows of that stays as it is for the whole render, so that chains keep their distribution.
//!
//! How far a path goes is a number from 0 to 1: the squared way on the film, and that of the vertices, each up to a bound
//! beyond which a path counts as another one. Proposals count by their acceptance. What a mutation costs is one, and one
//! for each ray.

use super::{Kind, Kinds};
use crate::paths::FullPath;
use crate::scene::Scene;
use std::f64::consts::PI;

/// How often each mutation is drawn, relative to the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights([f64; Kind::ALL.len()]);

/// What a mutation is worth that pays least, relative to the one that pays best: a pilot run may err.
const LEAST: f64 = 0.1;

/// How far the odds between path space and primary sample space may turn from the usual ones.
const MOST_ODDS: f64 = 4.0;

impl Weights {
    /// All of `kinds` alike.
    pub fn even(kinds: Kinds) -> Self {
        Self(Kind::ALL.map(|kind| f64::from(u8::from(kinds.has(kind)))))
    }

    /// By what each of `kinds` has gained for its cost.
    pub fn of(kinds: Kinds, gains: &[Gain; Kind::ALL.len()]) -> Self {
        let best = gains.iter().map(|gain| gain.rate()).fold(0.0, f64::max);
        if best == 0.0 {
            return Self::even(kinds);
        }
        Self(Kind::ALL.map(|kind| if kinds.has(kind) { (gains[kind as usize].rate() / best).max(LEAST) } else { 0.0 }))
    }

    /// Which share of a chain's small steps path space has, of which it has the share `usual` where both ways pay as much: the
    /// odds follow what it pays beside `primary`, the small steps in primary sample space, within bounds.
    pub fn share(&self, usual: f64, gains: &[Gain; Kind::ALL.len()], primary: &Gain) -> f64 {
        let mut path = Gain::default();
        for (gain, weight) in gains.iter().zip(self.0) {
            path.merge(&Gain { way: weight * gain.way, cost: weight * gain.cost });
        }
        let [path, primary] = [path.rate(), primary.rate()];
        let ratio = if path + primary > 0.0 { (path / primary).clamp(1.0 / MOST_ODDS, MOST_ODDS) } else { 1.0 };
        usual * ratio / (usual * ratio + 1.0 - usual)
    }

    /// That of `kind`; 0 where it is not drawn.
    #[inline]
    pub fn get(&self, kind: Kind) -> f64 {
        self.0[kind as usize]
    }
}

/// What mutations of one kind have brought.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gain {
    way: f64,
    cost: f64,
}

impl Gain {
    /// One mutation more: how far it goes, how likely, for so many rays.
    pub fn add(&mut self, way: f64, rays: u64) {
        self.way += way;
        self.cost += 1.0 + rays as f64;
    }

    /// Adds those of another run.
    pub fn merge(&mut self, other: &Self) {
        self.way += other.way;
        self.cost += other.cost;
    }

    /// How far chains go for a unit of cost.
    pub fn rate(&self) -> f64 {
        if self.cost > 0.0 { self.way / self.cost } else { 0.0 }
    }
}

/// Beyond this share of the scene's radius a vertex is elsewhere.
const ELSEWHERE: f64 = 0.1;

/// How far it is from one path to another, from 0 to 1.
pub fn way(scene: &Scene, from: &FullPath, to: &FullPath) -> f64 {
    let size = scene.camera.size;
    // As wide as perturbations go on the film at most.
    let on_film = (from.film - to.film).length_squared() / (0.05 * (size[0] * size[1]) as f64 / PI);
    let vertices = if from.edges() == to.edges() {
        let bound = (ELSEWHERE * scene.radius()).powi(2);
        let moved = |m: usize| (from.position(m).distance_squared(to.position(m)) / bound).min(1.0);
        (0..from.edges()).map(moved).sum::<f64>() / from.edges() as f64
    } else {
        1.0
    };
    0.5 * (on_film.min(1.0) + vertices)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_space_that_pays_has_more_steps() {
        let gain = |way| Gain { way, cost: 2.0 };
        let gains = [gain(1.0); Kind::ALL.len()];
        let share = |usual, primary| Weights::even(Kind::ALL.to_vec().into()).share(usual, &gains, &gain(primary));
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} for {b}");
        close(share(0.15, 1.0), 0.15);
        close(share(0.2, 0.5), 0.2 * 2.0 / (0.2 * 2.0 + 0.8));
        close(share(0.2, 1e-3), 0.2 * MOST_ODDS / (0.2 * MOST_ODDS + 0.8));
        close(share(0.2, 0.0), share(0.2, 1e-3));
        close(share(0.2, 1e3), 0.2 / (0.2 + 0.8 * MOST_ODDS));
        close(share(0.0, 1.0), 0.0);
        close(share(1.0, 7.0), 1.0);
        let nothing = [Gain::default(); Kind::ALL.len()];
        close(Weights::even(vec![Kind::Lens].into()).share(0.2, &nothing, &gain(0.0)), 0.2);
    }

    #[test]
    fn what_pays_is_drawn() {
        let mut gains = [Gain::default(); Kind::ALL.len()];
        for (i, gain) in gains.iter_mut().enumerate() {
            gain.add(i as f64, 3);
            gain.add(0.0, 3);
        }
        let weights = Weights::of(Kind::ALL.to_vec().into(), &gains);
        assert_eq!(weights, Weights([0.1, 0.2, 0.4, 0.6, 0.8, 1.0]));
        let some = Weights::of(vec![Kind::Lens].into(), &gains);
        assert_eq!((some.get(Kind::Manifold), some.get(Kind::Lens)), (0.0, 0.2));
        let nothing = [Gain::default(); Kind::ALL.len()];
        assert_eq!(Weights::of(vec![Kind::Lens].into(), &nothing), Weights::even(vec![Kind::Lens].into()));
    }
}
