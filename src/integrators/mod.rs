//! The methods. Each adds one estimate of the whole image to the film per pass, so that the mean over passes is the
//! image, whatever the method; what a pass is made of is the method's own business.
//!
//! A new method: its file with `start` and `pass`, and one arm in each match below.

mod bdpt;
mod chains;
mod checkpoint;
mod grid;
mod light;
mod merge;
mod mlt;
mod mmlt;
mod path;
mod photons;
mod pssmlt;
mod reference;
mod render;
mod sppm;
mod vcm;

pub use checkpoint::CheckpointError;
pub use merge::{MergeError, merge, summary as merge_summary};
pub use photons::MOST_PHOTONS;
pub use reference::{Keep, ReferenceError, reference, usual_method};
pub use render::{Budget, LEAST_PASSES, Outcome, Progress, Settings, render};

use crate::film::Film;
use crate::scene::Scene;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The methods by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Path tracing from the camera with next event estimation.
    Path,
    /// Path tracing from the lights: what no mirror and no smooth glass hides from them.
    Light,
    /// Bidirectional path tracing, all techniques.
    Bdpt,
    /// Stochastic progressive photon mapping.
    Sppm,
    /// Vertex connection and merging.
    Vcm,
    /// Metropolis light transport in the primary sample space of bidirectional path tracing.
    Pssmlt,
    /// Multiplexed Metropolis light transport.
    Mmlt,
    /// The same with reversible jumps between techniques.
    Rjmlt,
    /// Metropolis light transport in path space, with manifold exploration.
    Mlt,
    /// The two before in one: jumps between techniques, and mutations in both spaces.
    Fused,
}

impl Method {
    /// The name, as the command line and the files have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Path => "path",
            Self::Light => "light",
            Self::Bdpt => "bdpt",
            Self::Sppm => "sppm",
            Self::Vcm => "vcm",
            Self::Pssmlt => "pssmlt",
            Self::Mmlt => "mmlt",
            Self::Rjmlt => "rjmlt",
            Self::Mlt => "mlt",
            Self::Fused => "fused",
        }
    }

    /// Whether it walks by Markov chains, from pass to pass.
    pub fn has_chains(self) -> bool {
        match self {
            Self::Path | Self::Light | Self::Bdpt | Self::Sppm | Self::Vcm => false,
            Self::Pssmlt | Self::Mmlt | Self::Rjmlt | Self::Mlt | Self::Fused => true,
        }
    }

    /// Whether a render can go on from its film: its passes know nothing of each other but their number.
    pub fn resumes(self) -> bool {
        !self.has_chains()
    }
}

/// How often a kind of mutation was proposed and accepted, for one path length.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Acceptance {
    /// Path length in edges; 0 for chains with paths of all lengths.
    pub length: usize,
    /// Proposals.
    pub proposed: u64,
    /// Accepted proposals.
    pub accepted: u64,
}

/// What a render did.
#[derive(Clone, Debug, Default)]
pub struct Counts {
    /// Paths from the camera, light paths or mutations.
    pub samples: u64,
    /// Rays cast.
    pub rays: u64,
    /// Acceptance by mutation, then by length.
    pub acceptance: BTreeMap<&'static str, Vec<Acceptance>>,
    /// Chains by length.
    pub chains: Vec<ChainReport>,
    /// Mutations in path space that came to nothing, by cause.
    pub rejections: BTreeMap<&'static str, u64>,
}

/// Chains of one target.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChainReport {
    /// Length of their paths in edges; 0 where they have paths of all lengths.
    pub length: usize,
    /// Mean of the target: the mean luminance of their image, b, by independent samples.
    pub mean: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// Their number; 0 where no light has been found.
    pub chains: usize,
    /// Technique changes that failed because no primary samples could be found for the new technique.
    pub failed_inversions: u64,
}

impl Counts {
    fn add(&mut self, samples: u64, rays: u64) {
        self.samples += samples;
        self.rays += rays;
    }
}

/// A running method.
enum Integrator {
    Path(path::Path),
    Light(light::Light),
    Bdpt(bdpt::Bdpt),
    Sppm(sppm::Sppm),
    Vcm(vcm::Vcm),
    Pssmlt(Box<pssmlt::Pssmlt>),
    Mmlt(Box<mmlt::Mmlt>),
    Mlt(Box<mlt::Mlt>),
}

impl Integrator {
    fn start(method: Method, scene: &Scene, settings: &Settings) -> Self {
        match method {
            Method::Path => Self::Path(path::Path::start(settings)),
            Method::Light => Self::Light(light::Light::start(settings)),
            Method::Bdpt => Self::Bdpt(bdpt::Bdpt::start(settings)),
            Method::Sppm => Self::Sppm(sppm::Sppm::start(scene, settings)),
            Method::Vcm => Self::Vcm(vcm::Vcm::start(scene, settings)),
            Method::Pssmlt => Self::Pssmlt(Box::new(pssmlt::Pssmlt::start(scene, settings))),
            Method::Mmlt => Self::Mmlt(Box::new(mmlt::Mmlt::start(scene, settings, mmlt::Family::Multiplexed))),
            Method::Rjmlt => Self::Mmlt(Box::new(mmlt::Mmlt::start(scene, settings, mmlt::Family::Jumping))),
            Method::Fused => Self::Mmlt(Box::new(mmlt::Mmlt::start(scene, settings, mmlt::Family::Fused))),
            Method::Mlt => Self::Mlt(Box::new(mlt::Mlt::start(scene, settings))),
        }
    }

    /// Goes on after `passes` as if it had made them. Only what depends on the number of a pass can be skipped: chains are
    /// where they have walked to, so a render by chains must not go on from a film alone ([`Method::resumes`]).
    fn skip(&mut self, passes: u64) {
        match self {
            Self::Path(_) | Self::Light(_) | Self::Bdpt(_) | Self::Pssmlt(_) | Self::Mmlt(_) | Self::Mlt(_) => {}
            Self::Sppm(sppm) => (0..passes).for_each(|pass| sppm.shrink(pass)),
            Self::Vcm(vcm) => (0..passes).for_each(|pass| vcm.shrink(pass)),
        }
    }

    /// Adds the estimate of pass number `pass` to `film`.
    fn pass(&mut self, scene: &Scene, film: &mut Film, pass: u64, counts: &mut Counts) {
        match self {
            Self::Path(path) => path.pass(scene, film, pass, counts),
            Self::Light(light) => light.pass(scene, film, pass, counts),
            Self::Bdpt(bdpt) => bdpt.pass(scene, film, pass, counts),
            Self::Sppm(sppm) => sppm.pass(scene, film, pass, counts),
            Self::Vcm(vcm) => vcm.pass(scene, film, pass, counts),
            Self::Pssmlt(pssmlt) => pssmlt.pass(scene, film, pass, counts),
            Self::Mmlt(mmlt) => mmlt.pass(scene, film, pass, counts),
            Self::Mlt(mlt) => mlt.pass(scene, film, pass, counts),
        }
    }
}
