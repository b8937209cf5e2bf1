//! Options of the methods with chains.

use crate::markov::{FilmSteps, Jumps, LargeSteps, Mutations, MutationsError, SmallStep};
use crate::path_space::{Kind, PathMutations};
use clap::{Args, ValueEnum};

/// How chains move. Each option says which methods hear it.
#[derive(Debug, Args)]
#[command(next_help_heading = "Chains (pssmlt, mmlt, rjmlt, mlt, fused)")]
pub(super) struct MutationArguments {
    /// Probability of a large step.
    #[arg(long, value_name = "P", default_value_t = 0.3, allow_negative_numbers = true)]
    large_step: f64,
    /// How jumps between techniques come about: rjmlt, fused.
    #[arg(long, value_enum, default_value_t = Jumps::Separate)]
    jumps: Jumps,
    /// Probability of a jump, where jumps are separate: rjmlt, fused.
    #[arg(long, value_name = "P", default_value_t = 0.05, allow_negative_numbers = true)]
    jump: f64,
    /// By what distribution numbers move.
    #[arg(long, value_enum, default_value_t = Distribution::Gaussian)]
    small_step: Distribution,
    /// How far they move: the standard deviation, or Kelemen's upper bound. Default: 0.01, or 1/64.
    #[arg(long, value_name = "SIZE", allow_negative_numbers = true)]
    step_size: Option<f64>,
    /// How far the film position moves: `aspect` (as far in both directions), `shares` (by the same share of width and
    /// height), or a number of pixels.
    #[arg(long, value_name = "STEPS", default_value = "aspect", allow_negative_numbers = true, value_parser = parse_film_steps)]
    film_steps: FilmSteps,
    /// Small steps leave discrete choices, of lobes and lights, as they are.
    #[arg(long)]
    keep_choices: bool,
    /// Small steps keep directions where surfaces change: mmlt, rjmlt, fused.
    #[arg(long)]
    controlled_steps: bool,
    /// Large steps of paths with at least this many edges try all techniques of two full walks: mmlt, rjmlt, and fused where
    /// nothing smooth bends light.
    #[arg(long, value_name = "EDGES")]
    tries_from: Option<usize>,
    /// Share of the small steps in whose place paths move in path space: fused.
    /// Where a pilot run finds that they pay more or less than small steps do, the odds follow.
    #[arg(long, value_name = "SHARE", default_value_t = 0.15, allow_negative_numbers = true)]
    path_step: f64,
    /// Roughness below which vertices with nothing but a microfacet lobe move with their chain: mlt, fused.
    #[arg(long, value_name = "ALPHA", default_value_t = 0.1, allow_negative_numbers = true)]
    glossy_chains: f64,
    /// How paths move in path space: mlt, fused.
    #[arg(long, value_enum, value_name = "KINDS", value_delimiter = ',', default_values_t = Kind::ALL)]
    path_mutations: Vec<Kind>,
    /// How direct light is rendered.
    #[arg(long, value_enum, default_value_t = Direct::Separate)]
    direct: Direct,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Distribution {
    /// Normal.
    Gaussian,
    /// With a uniform logarithm of the length (Kelemen et al. 2002).
    Kelemen,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Direct {
    /// By path tracing.
    Separate,
    /// By chains.
    Chains,
}

fn parse_film_steps(text: &str) -> Result<FilmSteps, String> {
    match text {
        "shares" => Ok(FilmSteps::Shares),
        "aspect" => Ok(FilmSteps::Aspect),
        _ => {
            let pixels = text.parse().ok().filter(|pixels: &f64| *pixels > 0.0 && pixels.is_finite());
            pixels.map(FilmSteps::Pixels).ok_or_else(|| "expected aspect, shares or a number of pixels above 0".into())
        }
    }
}

impl MutationArguments {
    /// The mutations, if chains can move so.
    pub(super) fn mutations(&self) -> Result<Mutations, MutationsError> {
        let small_step = match (self.small_step, self.step_size) {
            (Distribution::Gaussian, size) => SmallStep::Gaussian { deviation: size.unwrap_or(0.01) },
            (Distribution::Kelemen, None) => SmallStep::KELEMEN,
            // His bounds are a factor of 16 apart.
            (Distribution::Kelemen, Some(most)) => SmallStep::Kelemen { least: most / 16.0, most },
        };
        Mutations {
            large_step: self.large_step,
            jump: self.jump,
            jumps: self.jumps,
            small_step,
            film_steps: self.film_steps,
            keep_choices: self.keep_choices,
            controlled: self.controlled_steps,
            large_steps: self.tries_from.map_or(LargeSteps::Plain, LargeSteps::TriesFrom),
            separate_direct: self.direct == Direct::Separate,
            path_space: PathMutations {
                kinds: self.path_mutations.clone().into(),
                glossy: self.glossy_chains,
                ..PathMutations::default()
            },
            path_step: self.path_step,
        }
        .checked()
    }
}
