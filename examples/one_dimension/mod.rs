//! Reversible jumps in one dimension (Bitterli et al. 2017, *Reversible Jump Metropolis Light Transport using Inverse
//! Mappings*, section 7.1): where a path is a number x in [0, 1), every distribution is known.
//!
//! The target is f(x) = 1 + 0.9 sin 4πx. Three techniques sample x with densities p_i, weighted by the balance heuristic
//! w_i = p_i / Σ p. A state is a technique i and three primary samples: one that chooses the technique where chains are
//! multiplexed, one for the position, one that the mixture chooses its part by. The target of technique i is C_i(u) =
//! w_i f / p_i, so that the chain has the joint distribution of x and i with density f(x) w_i(x).
//!
//! A jump from (i, u) to (j, v) keeps x. Its mapping has the Jacobian p_j / p_i. With j drawn evenly the acceptance is
//!
//! ```text
//! C_j p_j / (C_i p_i) = w_j / w_i,
//! ```
//!
//! and with j drawn by w_j it is 1. Without the Jacobian an even draw would be accepted with C_j / C_i = 1, which makes all
//! techniques equally likely everywhere: mistake (b). Mistake (c) has the right acceptance and draws the mixture's part
//! rightly, but leaves the number that chooses it, and every number that the new technique does not read, at the middle of
//! its interval. Small steps then find the other part too rarely.
//!
//! Large steps are off: nothing covers up what jumps do.

use pathblend::math::Stream;
use std::f64::consts::{PI, TAU};

/// Ways to sample x.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Technique {
    /// p = 4x up to the middle, 4 (1 − x) beyond.
    Triangle,
    /// p = 1/2 up to the middle, 3/2 beyond.
    Step,
    /// With probability [`SINE`] p = π/2 sin πx, else p = 2 (1 − x).
    Mixture,
}

/// All of them.
pub const TECHNIQUES: [Technique; 3] = [Technique::Triangle, Technique::Step, Technique::Mixture];

/// Share of the sinusoid in the mixture.
pub const SINE: f64 = 0.15;

/// The target, of integral 1.
pub fn target(x: f64) -> f64 {
    1.0 + 0.9 * (2.0 * TAU * x).sin()
}

/// Densities of both parts of the mixture, times their shares.
fn parts(x: f64) -> [f64; 2] {
    [SINE * 0.5 * PI * (PI * x).sin(), (1.0 - SINE) * 2.0 * (1.0 - x)]
}

/// Position and choice of the part.
pub type Numbers = [f64; 2];

impl Technique {
    /// The x that the numbers give.
    pub fn sample(self, [u, choice]: Numbers) -> f64 {
        match self {
            Self::Triangle if u < 0.5 => (0.5 * u).sqrt(),
            Self::Triangle => 1.0 - (0.5 * (1.0 - u)).sqrt(),
            Self::Step if u < 0.25 => 2.0 * u,
            Self::Step => 0.5 + (u - 0.25) / 1.5,
            Self::Mixture if choice < SINE => (1.0 - 2.0 * u).acos() / PI,
            Self::Mixture => 1.0 - (1.0 - u).sqrt(),
        }
    }

    /// Density of x.
    pub fn pdf(self, x: f64) -> f64 {
        match self {
            Self::Triangle => 4.0 * x.min(1.0 - x),
            Self::Step if x < 0.5 => 0.5,
            Self::Step => 1.5,
            Self::Mixture => parts(x).iter().sum(),
        }
    }

    /// Numbers that give x. Of `gamma` the first draws the part of the mixture in proportion to its density, the second
    /// what is open.
    pub fn invert(self, x: f64, gamma: Numbers) -> Numbers {
        match self {
            Self::Triangle if x < 0.5 => [2.0 * x * x, gamma[1]],
            Self::Triangle => [1.0 - 2.0 * (1.0 - x) * (1.0 - x), gamma[1]],
            Self::Step if x < 0.5 => [0.5 * x, gamma[1]],
            Self::Step => [0.25 + 1.5 * (x - 0.5), gamma[1]],
            Self::Mixture => {
                let [sine, line] = parts(x);
                if gamma[0] * (sine + line) < sine {
                    [0.5 * (1.0 - (PI * x).cos()), SINE * gamma[1]]
                } else {
                    [1.0 - (1.0 - x) * (1.0 - x), SINE + (1.0 - SINE) * gamma[1]]
                }
            }
        }
    }

    /// Weight by the balance heuristic.
    pub fn weight(self, x: f64) -> f64 {
        self.pdf(x) / TECHNIQUES.iter().map(|technique| technique.pdf(x)).sum::<f64>()
    }
}

/// The chains of the paper's figure 3.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Chain {
    /// (a) Small steps move the number that chooses the technique too.
    Multiplexed,
    /// (b) Jumps without their Jacobian.
    WithoutJacobian,
    /// (c) Jumps that leave open numbers at the middle of their interval.
    FixedPoint,
    /// (d) Jumps as they should be.
    ReversibleJump,
}

/// All of them.
pub const CHAINS: [Chain; 4] = [Chain::Multiplexed, Chain::WithoutJacobian, Chain::FixedPoint, Chain::ReversibleJump];

/// Deviation of small steps, and probability of a jump.
const STEP: f64 = 0.15;
const JUMP: f64 = 0.5;

/// Bins of the histogram of x, and of those by technique.
pub const BINS: usize = 32;

/// Independent chains, and steps of each.
const RUNS: usize = 16_000;
const STEPS: usize = 500;

struct State {
    technique: usize,
    choice: f64,
    numbers: Numbers,
}

impl State {
    /// A state of the right distribution: x by the target, the technique by the weights, numbers by the inverse.
    fn start(stream: &mut Stream) -> Self {
        let x = loop {
            let (x, level) = (stream.number(), stream.number());
            if 1.9 * level < target(x) {
                break x;
            }
        };
        let technique = by_weight(x, stream);
        let numbers = TECHNIQUES[technique].invert(x, [stream.number(), stream.number()]);
        Self { technique, choice: (technique as f64 + stream.number()) / 3.0, numbers }
    }

    fn x(&self) -> f64 {
        TECHNIQUES[self.technique].sample(self.numbers)
    }

    /// C_i(u).
    fn target(&self) -> f64 {
        let x = self.x();
        target(x) / TECHNIQUES.iter().map(|technique| technique.pdf(x)).sum::<f64>()
    }

    fn small_step(&mut self, chain: Chain, stream: &mut Stream) {
        let mut step = |number: f64| (number + STEP * stream.normal()).rem_euclid(1.0).min(1f64.next_down());
        let numbers = self.numbers.map(&mut step);
        let (choice, technique) = match chain {
            Chain::Multiplexed => {
                let choice = step(self.choice);
                (choice, (3.0 * choice) as usize)
            }
            _ => (self.choice, self.technique),
        };
        let proposal = Self { technique, choice, numbers };
        if stream.number() * self.target() < proposal.target() {
            *self = proposal;
        }
    }

    fn jump(&mut self, chain: Chain, stream: &mut Stream) {
        let x = self.x();
        let even = (3.0 * stream.number()) as usize;
        let ratio = TECHNIQUES[even].weight(x) / TECHNIQUES[self.technique].weight(x);
        let (technique, accepted, open) = match chain {
            Chain::Multiplexed => return,
            Chain::WithoutJacobian => (even, true, stream.number()),
            Chain::FixedPoint => (even, stream.number() < ratio, 0.5),
            Chain::ReversibleJump => (by_weight(x, stream), true, stream.number()),
        };
        if accepted {
            self.technique = technique;
            self.numbers = TECHNIQUES[technique].invert(x, [stream.number(), open]);
        }
    }
}

/// A technique drawn by the weights.
fn by_weight(x: f64, stream: &mut Stream) -> usize {
    let u = stream.number();
    let first = TECHNIQUES[0].weight(x);
    usize::from(u >= first) + usize::from(u >= first + TECHNIQUES[1].weight(x))
}

/// A share of all states, what it should be, and its standard error.
#[derive(Clone, Copy, Debug, Default)]
pub struct Bin {
    /// Found.
    pub share: f64,
    /// By quadrature.
    pub expected: f64,
    /// Of `share`, from the spread between chains.
    pub error: f64,
}

impl Bin {
    /// Deviation in standard errors.
    pub fn z(&self) -> f64 {
        (self.share - self.expected) / self.error.max(f64::MIN_POSITIVE)
    }
}

/// Where a chain has been: by x, and by technique and x.
pub struct Histograms {
    /// States.
    pub states: [Bin; BINS],
    /// States by technique.
    pub techniques: [[Bin; BINS]; 3],
}

impl Histograms {
    /// The largest deviations of both, in standard errors.
    pub fn worst(&self) -> [f64; 2] {
        let worst = |bins: &[Bin]| bins.iter().map(|bin| bin.z().abs()).fold(0.0, f64::max);
        [worst(&self.states), worst(self.techniques.as_flattened())]
    }
}

/// The integral of `f` over a bin.
fn integral(bin: usize, f: impl Fn(f64) -> f64) -> f64 {
    const POINTS: usize = 200;
    let at = |i: usize| (bin as f64 + (i as f64 + 0.5) / POINTS as f64) / BINS as f64;
    (0..POINTS).map(|i| f(at(i))).sum::<f64>() / (POINTS * BINS) as f64
}

/// Runs independent chains.
pub fn run(chain: Chain, seed: u64) -> Histograms {
    // By technique and bin, sums of the shares of single chains and of their squares.
    let mut sums = [[[0.0; 2]; BINS]; 4];
    for number in 0..RUNS {
        let mut stream = Stream::new(seed, &[number as u64]);
        let mut state = State::start(&mut stream);
        let mut counts = [[0.0; BINS]; 4];
        for _ in 0..STEPS {
            match stream.number() < JUMP && chain != Chain::Multiplexed {
                true => state.jump(chain, &mut stream),
                false => state.small_step(chain, &mut stream),
            }
            let bin = ((state.x() * BINS as f64) as usize).min(BINS - 1);
            for row in [3, state.technique] {
                counts[row][bin] += 1.0 / STEPS as f64;
            }
        }
        for (sum, share) in sums.as_flattened_mut().iter_mut().zip(counts.as_flattened()) {
            *sum = [sum[0] + share, sum[1] + share * share];
        }
    }
    let bin = |row: usize, bin: usize| {
        let [mean, square] = sums[row][bin].map(|sum| sum / RUNS as f64);
        let error = ((square - mean * mean).max(0.0) / (RUNS - 1) as f64).sqrt();
        let weight = |x: f64| if row == 3 { 1.0 } else { TECHNIQUES[row].weight(x) };
        Bin { share: mean, expected: integral(bin, |x| target(x) * weight(x)), error }
    };
    let row = |row: usize| std::array::from_fn(|index| bin(row, index));
    Histograms { states: row(3), techniques: [row(0), row(1), row(2)] }
}
