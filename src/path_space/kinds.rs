//! Which mutations there are.

use super::Radii;
use serde::{Deserialize, Serialize};

/// The mutations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Part of the path is sampled anew.
    Bidirectional,
    /// The film position moves.
    Lens,
    /// The last part of a caustic moves.
    Caustic,
    /// The film position moves, and directions further on.
    MultiChain,
    /// A vertex moves, and a chain follows.
    Manifold,
    /// A vertex is connected with a light through smooth boundaries.
    Connection,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Bidirectional, Self::Lens, Self::Caustic, Self::MultiChain, Self::Manifold, Self::Connection];

    /// The name, as reports have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bidirectional => "bidirectional",
            Self::Lens => "lens_perturbation",
            Self::Caustic => "caustic_perturbation",
            Self::MultiChain => "multi_chain_perturbation",
            Self::Manifold => "manifold_perturbation",
            Self::Connection => "manifold_connection",
        }
    }
}

/// Some of the mutations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "Vec<Kind>", from = "Vec<Kind>")]
pub struct Kinds([bool; Kind::ALL.len()]);

impl Kinds {
    /// Not any.
    pub const NONE: Self = Self([false; Kind::ALL.len()]);

    /// Whether `kind` is one of them.
    pub const fn has(self, kind: Kind) -> bool {
        self.0[kind as usize]
    }
}

impl From<Vec<Kind>> for Kinds {
    fn from(kinds: Vec<Kind>) -> Self {
        Self(Kind::ALL.map(|kind| kinds.contains(&kind)))
    }
}

impl From<Kinds> for Vec<Kind> {
    fn from(kinds: Kinds) -> Self {
        Kind::ALL.into_iter().filter(|kind| kinds.has(*kind)).collect()
    }
}

/// Which mutations there are, and how far they go.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PathMutations {
    /// Those that may be drawn.
    pub kinds: Kinds,
    /// How far directions move, in radians.
    pub angles: Radii,
    /// Roughness α below which a vertex that has nothing but one microfacet lobe is one of a chain: it keeps its half-vector.
    pub glossy: f64,
}

impl Default for PathMutations {
    fn default() -> Self {
        Self { kinds: Kinds([true; Kind::ALL.len()]), angles: Radii { least: 1e-4, most: 0.1 }, glossy: 0.1 }
    }
}
