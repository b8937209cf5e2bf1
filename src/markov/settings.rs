//! How chains move: which mutations, how often, how far.

use super::SmallStep;
use crate::math::{Row, Walk};
use crate::path_space::{PathMutations, Radii};
use crate::paths::{Open, Use, uses};
use serde::{Deserialize, Serialize};

/// How the technique jumps that keep the path come about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Jumps {
    /// As mutations of their own (Bitterli et al. 2017, section 7.2).
    Separate,
    /// Before each small step (Bitterli 2015, section 5.2.1).
    Always,
}

/// How far the film position moves in small steps (Bitterli 2015, section 4.1).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FilmSteps {
    /// By the same share of the film's width and height, like other numbers.
    Shares,
    /// As far along both, in pixels; on a square film as [`FilmSteps::Shares`].
    Aspect,
    /// Along both by the step that would be this many pixels if it were one deviation.
    Pixels(f64),
}

/// How large steps choose the technique, in fused where paths are not linked with lights over manifolds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LargeSteps {
    /// Evenly.
    Plain,
    /// Among all connections of two full walks, for paths of this length and longer (Bitterli 2015, section 4.3).
    TriesFrom(usize),
}

/// How chains move.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Mutations {
    /// Probability of a large step.
    pub large_step: f64,
    /// Probability of a technique jump, where jumps are separate; small steps have what is left.
    pub jump: f64,
    /// How technique jumps come about, in rjmlt and fused.
    pub jumps: Jumps,
    /// How far numbers move.
    pub small_step: SmallStep,
    /// How far the film position moves.
    pub film_steps: FilmSteps,
    /// Whether small steps leave numbers as they are that make discrete choices (Bitterli 2015, section 4.2).
    pub keep_choices: bool,
    /// Whether small steps keep directions instead of numbers (Bitterli 2015, section 5.3).
    pub controlled: bool,
    /// How large steps choose the technique.
    pub large_steps: LargeSteps,
    /// Whether direct light is rendered by path tracing.
    pub separate_direct: bool,
    /// How paths move in path space, in mlt and fused.
    pub path_space: PathMutations,
    /// Share of the small steps in whose place paths move in path space, in fused; where a pilot run finds that they pay more
    /// or less than small steps do, the odds follow.
    pub path_step: f64,
}

impl Default for Mutations {
    fn default() -> Self {
        Self {
            large_step: 0.3,
            jump: 0.05,
            jumps: Jumps::Separate,
            small_step: SmallStep::Gaussian { deviation: 0.01 },
            film_steps: FilmSteps::Aspect,
            keep_choices: false,
            controlled: false,
            large_steps: LargeSteps::Plain,
            separate_direct: true,
            path_space: PathMutations::default(),
            path_step: 0.15,
        }
    }
}

/// What is wrong with [`Mutations`].
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MutationsError {
    /// A probability outside [0, 1], or large steps that never happen.
    #[error("the probability of {0} is {1}; expected {2}")]
    Probability(&'static str, f64, &'static str),
    /// More than one in all.
    #[error("large steps ({0}) and technique jumps ({1}) add up to more than 1")]
    Sum(f64, f64),
    /// A length of steps that is none.
    #[error("the size of small steps is {0}; expected a number above 0, at most 0.5")]
    Step(f64),
    /// No roughness.
    #[error("the roughness of glossy chains is {0}; expected a number from 0 to 1")]
    Gloss(f64),
    /// Angles of perturbations that are none.
    #[error("the angles of perturbations go from {0} to {1}; expected ascending numbers above 0, at most 1")]
    Angles(f64, f64),
}

impl Mutations {
    /// The mutations, if chains can move so and reach everything.
    pub fn checked(self) -> Result<Self, MutationsError> {
        let large = self.large_step;
        if !(large > 0.0 && large <= 1.0) {
            return Err(MutationsError::Probability("a large step", large, "a number above 0, at most 1"));
        }
        if !(0.0..=1.0).contains(&self.jump) {
            return Err(MutationsError::Probability("a technique jump", self.jump, "a number from 0 to 1"));
        }
        if large + self.jump > 1.0 {
            return Err(MutationsError::Sum(large, self.jump));
        }
        if !(0.0..=1.0).contains(&self.path_step) {
            let expected = "a number from 0 to 1";
            return Err(MutationsError::Probability("a mutation in path space", self.path_step, expected));
        }
        let Radii { least, most } = self.path_space.angles;
        if !(least > 0.0 && least < most && most <= 1.0) {
            return Err(MutationsError::Angles(least, most));
        }
        if !(0.0..=1.0).contains(&self.path_space.glossy) {
            return Err(MutationsError::Gloss(self.path_space.glossy));
        }
        let size = self.small_step.size();
        if !(size > 0.0 && size <= 0.5) {
            return Err(MutationsError::Step(size));
        }
        Ok(self)
    }

    /// Edges of the longest paths that are left to path tracing.
    pub fn traced_edges(&self) -> usize {
        if self.separate_direct { 2 } else { 1 }
    }

    /// Whether large steps of paths with `edges` edges try all techniques.
    pub fn tries(&self, edges: usize) -> bool {
        matches!(self.large_steps, LargeSteps::TriesFrom(least) if edges >= least)
    }
}

/// By how much of a small step each number of a row moves.
pub type Scales = Row;

impl Mutations {
    /// The scales of row `index` of a walk, for a film of `size` and what is `open`; `plays_roulette` says whether the last
    /// number decides whether the walk goes on.
    pub fn scales(&self, walk: Walk, index: usize, size: [usize; 2], open: Open, plays_roulette: bool) -> Scales {
        let [width, height] = size.map(|pixels| pixels as f64);
        let [x, y] = match self.film_steps {
            FilmSteps::Shares => [1.0, 1.0],
            FilmSteps::Aspect => [(height / width).sqrt(), (width / height).sqrt()],
            FilmSteps::Pixels(pixels) => [width, height].map(|side| pixels / (side * self.small_step.size())),
        };
        let scale = |used: Use| match used {
            Use::FilmX => x,
            Use::FilmY => y,
            Use::Continuous => 1.0,
            Use::Discrete => f64::from(u8::from(!self.keep_choices)),
            Use::Unused => 0.0,
        };
        let mut scales = uses(open, walk, index).map(scale);
        // Only scattering can be survived.
        let scatters = index > usize::from(walk == Walk::FromLight);
        if plays_roulette && scatters {
            scales[3] = scale(Use::Discrete);
        }
        scales
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: Open = Open { lens: true, lobes: true };

    #[test]
    fn steps_on_the_film_are_as_long_along_both_sides() {
        let size = [160, 40];
        let along = |film_steps| {
            let mutations = Mutations { film_steps, ..Mutations::default() };
            let [x, y, ..] = mutations.scales(Walk::FromCamera, 0, size, ALL, false);
            [x * 160.0 * 0.01, y * 40.0 * 0.01]
        };
        assert_eq!(along(FilmSteps::Shares), [1.6, 0.4]);
        for (steps, expected) in [(FilmSteps::Aspect, 0.8), (FilmSteps::Pixels(3.0), 3.0)] {
            let found = along(steps);
            assert!(found.iter().all(|pixels: &f64| (pixels - expected).abs() < 1e-12), "{found:?}");
        }
    }

    #[test]
    fn choices_are_kept_where_asked() {
        let free = Mutations::default();
        let kept = Mutations { keep_choices: true, ..free };
        assert_eq!(free.scales(Walk::FromCamera, 2, [8, 8], ALL, false), [1.0, 1.0, 1.0, 0.0]);
        assert_eq!(kept.scales(Walk::FromCamera, 2, [8, 8], ALL, false), [0.0, 1.0, 1.0, 0.0]);
        assert_eq!(free.scales(Walk::FromLight, 2, [8, 8], ALL, true), [1.0, 1.0, 1.0, 1.0]);
        assert_eq!(free.scales(Walk::FromLight, 1, [8, 8], ALL, true), [0.0, 1.0, 1.0, 0.0]);
    }

    #[test]
    fn numbers_that_nothing_reads_do_not_move() {
        let (usual, none) = (Mutations::default(), Open { lens: false, lobes: false });
        assert_eq!(usual.scales(Walk::FromCamera, 0, [8, 8], none, false), [1.0, 1.0, 0.0, 0.0]);
        assert_eq!(usual.scales(Walk::FromCamera, 1, [8, 8], none, false), [0.0, 1.0, 1.0, 0.0]);
        assert_eq!(usual.scales(Walk::FromLight, 0, [8, 8], none, false), [1.0, 1.0, 1.0, 0.0]);
        assert_eq!(usual.scales(Walk::FromLight, 2, [8, 8], none, true), [0.0, 1.0, 1.0, 1.0]);
    }

    #[test]
    fn bad_mutations_are_refused() {
        let usual = Mutations::default();
        assert!(usual.checked().is_ok());
        let bad = [
            Mutations { large_step: 0.0, ..usual },
            Mutations { large_step: 1.1, ..usual },
            Mutations { large_step: f64::NAN, ..usual },
            Mutations { jump: -0.1, ..usual },
            Mutations { large_step: 0.9, jump: 0.2, ..usual },
            Mutations { small_step: SmallStep::Gaussian { deviation: 0.0 }, ..usual },
            Mutations { small_step: SmallStep::Kelemen { least: 0.1, most: 0.7 }, ..usual },
            Mutations { path_step: 1.1, ..usual },
            Mutations {
                path_space: PathMutations { angles: Radii { least: 0.1, most: 0.1 }, ..usual.path_space },
                ..usual
            },
        ];
        for mutations in bad {
            assert!(mutations.checked().is_err(), "{mutations:?}");
        }
    }
}
