//! Markov chains in primary sample space (Kelemen et al. 2002; Bitterli 2015; Bitterli et al. 2017): the state of a chain,
//! how it finds a path, and one file per mutation.
//!
//! A chain of paths with k edges has the states (s, u): a technique with s light vertices, 0 ≤ s ≤ k, and the rows of both
//! walks. Its target is the luminance of
//!
//! ```text
//! (k + 1) w_s(x) f(x) / p_s(x),    x = S_s(u),
//! ```
//!
//! whose mean over techniques and rows is b_k, the mean luminance of the image of length k (Bitterli et al. 2017, eq. 4).

mod controlled;
mod jump;
mod settings;
mod small_step;
mod state;
mod tracer;
mod tries;

pub use controlled::{ControlledMemory, controlled_step, remainder};
pub use jump::{Jump, JumpMemory, jump, retell};
pub use settings::{FilmSteps, Jumps, LargeSteps, Mutations, MutationsError, Scales};
pub use small_step::SmallStep;
pub use state::{ChainState, Proposal};
pub use tracer::Tracer;
pub use tries::Tries;
