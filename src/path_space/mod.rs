//! Mutations in path space (Veach and Guibas 1997; Jakob and Marschner 2012): they move the vertices of a path, and may keep
//! most of it as it is.
//!
//! # The measure
//! The vertices that scatter by no delta lobe are where they are, each with its area as measure; the others follow from
//! these, as the light's laws say. Between two free vertices a and b with delta vertices between, the contribution f holds
//! the generalised geometric term instead of the plain one, with dω_a / dA_b along the chain ([`Chain::spread`]). A walk that
//! passes the chain from a to b has the same factor in its density. Where f and the density T of a mutation both have it,
//! nothing of it is left, and the product of cos θ / d² over the edges does as well, which [`FullPath::density`] takes
//! instead. Only where f has been found by a walk that passes a chain the other way round than the mutation does, or where
//! the mutation has not traced the chain but walked there on its manifold, the factor
//!
//! ```text
//! Γ(a → b) = dω_a / dA_b  /  Π cos θ_{i+1} / d²
//! ```
//!
//! is left over ([`gamma`]).
//!
//! A glossy vertex of a chain has its area as measure, but keeps its half-vector in perturbations. So T has its density by
//! the solid angle that it scatters into ([`offset_density`]), where others have that of a lobe.
//!
//! # The acceptance
//! With C(x) = w_s f / p_s as the technique (s, t) finds it, the acceptance is (Otsu 2017, eq. 6.24)
//!
//! ```text
//! a(x → y) = w_s(y) f(y) T(y → x) / (w_s(x) f(x) T(x → y)) = C(y) p_s(y) T(y → x) / (C(x) p_s(x) T(x → y)),
//! ```
//!
//! where all weights are one for a chain that has no techniques.
//!
//! A mutation is drawn by its weight among those that suit the path, so that T has the sum of their weights, too.
//! Perturbations keep which vertices scatter by delta lobes and how; both ways have the same choice. Only [`bidirectional`]
//! and [`connection`] change them.
//!
//! [`offset_density`]: crate::manifold::offset_density
//! [`Chain::spread`]: crate::manifold::Chain::spread
//! [`FullPath::density`]: crate::paths::FullPath::density

mod bidirectional;
mod caustic;
mod connection;
mod gains;
mod gamma;
mod judge;
mod kinds;
mod lens;
mod link;
mod manifold;
mod mixture;
mod multi_chain;
mod perturb;
mod retrace;
mod seeds;
mod steps;
mod whole;

pub use bidirectional::Lengths;
pub use gains::{Gain, Weights, way};
pub use kinds::{Kind, Kinds, PathMutations};
pub use mixture::{Mixture, Way, Ways};
pub use seeds::Seeds;
pub use steps::Radii;
pub use whole::Drawn;

use judge::realise;

use crate::manifold::Rejection;
use crate::math::{Stream, Walk, pick};
use crate::paths::{Course, Found, FullPath, Node, TECHNIQUES, Techniques};
use crate::scene::{Caster, Scene};
use glam::DVec3;

/// What a chain's target is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// w_s f of paths of one length, times the number of techniques, with a technique that stays.
    Technique,
    /// f of paths of these lengths, in edges.
    Path(Lengths),
}

impl Target {
    const fn techniques(self) -> Techniques {
        match self {
            Self::Technique => TECHNIQUES,
            Self::Path(_) => Techniques::ALONE,
        }
    }

    /// The weight of a technique among others with these densities.
    fn weight(self, densities: &[f64], technique: usize) -> f64 {
        let Some(heuristic) = self.techniques().heuristic else { return 1.0 };
        heuristic.apply(densities[technique]) / densities.iter().map(|density| heuristic.apply(*density)).sum::<f64>()
    }

    /// Draws a technique by the weights, if there are any.
    fn pick(self, densities: &[f64], stream: &mut Stream) -> Option<usize> {
        let heuristic = self.techniques().heuristic?;
        pick(densities.iter().map(|density| heuristic.apply(*density)), stream.number())
    }

    /// What the contribution of a technique is multiplied by.
    fn count(self, course: &Course) -> f64 {
        if self == Self::Technique { (course.edges() + 1) as f64 } else { 1.0 }
    }
}

/// Where a perturbation begins, and how far it goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Plan {
    /// The vertex that the path leaves in another direction.
    from: usize,
    /// The walk that goes that way.
    walk: Walk,
    /// Free vertices that move.
    stops: usize,
}

/// A path's surroundings, as a mutation sees them.
struct View<'a> {
    scene: &'a Caster<'a>,
    /// Light vertices of the technique that the contribution is that of, and by which the path is found.
    technique: usize,
    mutations: PathMutations,
}

impl View<'_> {
    /// The walk in which the technique passes the chain of delta vertices between two others.
    fn passes(&self, one: usize, other: usize) -> Walk {
        if self.technique > one.max(other) { Walk::FromLight } else { Walk::FromCamera }
    }

    /// Whether a vertex is one of a chain although it is no delta vertex, met from the unit vector `back`.
    fn is_glossy(&self, node: &Node, back: DVec3) -> bool {
        let Some(surface) = node.surface().filter(|surface| !node.delta && surface.up.z >= 1.0) else { return false };
        let alpha = self.scene.bsdf(surface.bsdf).gloss(&surface.site, surface.frame.to_local(back));
        alpha.is_some_and(|alpha| alpha < self.mutations.glossy)
    }

    /// Marks the vertices of chains.
    fn mark(&self, course: &mut Course) {
        for m in 1..course.edges() {
            let back = course.direction(self.scene, m).unwrap_or(DVec3::ZERO);
            let node = course.nodes[m];
            course.nodes[m].linked = node.delta || self.is_glossy(&node, back);
        }
    }
}

/// What a mutation has made of a path, before anything is known of its contribution.
struct Draft {
    /// Light vertices of a technique that finds it.
    technique: usize,
    /// T(y → x) / T(x → y), without what `ranges` stand for.
    ratio: f64,
    /// For paths that were sampled anew: the techniques that would sample the same, of the old path and of the new one.
    ranges: Option<[bidirectional::Range; 2]>,
    /// The vertex that was linked with a light over a manifold, or might have been.
    linked: Option<usize>,
}

/// A proposal.
#[derive(Clone, Copy, Debug)]
pub struct Proposed {
    /// The mutation; `None` where none suits the path.
    pub kind: Option<Kind>,
    /// The path that is proposed, with the acceptance; or why there is none.
    pub outcome: Result<(Found, f64), Rejection>,
}

/// Mutations in path space, with their memory.
#[derive(Debug)]
pub struct PathSpace {
    mutations: PathMutations,
    /// How often each is drawn.
    pub weights: Weights,
    target: Target,
    old: Course,
    new: Course,
    plans: Vec<Plan>,
    densities: Vec<f64>,
    /// A path as the walk from the camera finds it.
    walked: FullPath,
}

impl PathSpace {
    /// No path is known yet.
    pub fn new(mutations: PathMutations, target: Target) -> Self {
        let (old, new) = (Course::default(), Course::default());
        let weights = Weights::even(mutations.kinds);
        Self {
            mutations,
            weights,
            target,
            old,
            new,
            plans: Vec::new(),
            densities: Vec::new(),
            walked: FullPath::default(),
        }
    }

    /// Mutates `path`, which contributes `current`, and becomes what the technique of that finds, if it was another's; the new
    /// path is left in `proposal`.
    pub fn propose(
        &mut self,
        scene: &Caster<'_>,
        (path, current): (&mut FullPath, &Found),
        stream: &mut Stream,
        proposal: &mut FullPath,
    ) -> Proposed {
        if !self.follow(scene, path, current.technique) {
            return Proposed { kind: None, outcome: Err(Rejection::Unsuitable) };
        }
        let view = View { scene, technique: path.light.vertices.len(), mutations: self.mutations };
        view.mark(&mut self.old);
        let weights = suitable(&self.weights, scene, &self.old, &mut self.plans);
        let Some(kind) = pick(weights.into_iter(), stream.number()).map(|index| Kind::ALL[index]) else {
            return Proposed { kind: None, outcome: Err(Rejection::Unsuitable) };
        };
        let outcome = self.mutate(kind, &view, stream).and_then(|draft| {
            let found = match draft.linked {
                Some(d) => self.judge_linked(&view, (&draft, d), (path, current), stream, proposal),
                None => self.judge(scene, &draft, (path, current), proposal),
            };
            let found = found.ok_or(Rejection::Dark)?;
            let choice = match kind {
                Kind::Bidirectional | Kind::Connection => {
                    view.mark(&mut self.new);
                    let new = suitable(&self.weights, scene, &self.new, &mut self.plans);
                    weights.iter().sum::<f64>() / new.iter().sum::<f64>()
                }
                _ => 1.0,
            };
            Ok((found.0, found.1 * choice))
        });
        Proposed { kind: Some(kind), outcome }
    }

    /// Has the old course be that of `path`, and `path` be what `technique` finds: jumps leave it as another has found it. Says
    /// whether it could.
    fn follow(&mut self, scene: &Caster<'_>, path: &mut FullPath, technique: usize) -> bool {
        let Self { old, walked, target, .. } = self;
        if !old.follow(path) {
            return false;
        }
        if path.light.vertices.len() == technique {
            return true;
        }
        let found = realise(scene, old, technique, (&target.techniques(), 1.0), walked);
        if found.is_some() {
            std::mem::swap(path, walked);
        }
        found.is_some()
    }

    /// Draws a new course.
    fn mutate(&mut self, kind: Kind, view: &View<'_>, stream: &mut Stream) -> Result<Draft, Rejection> {
        let Self { old, new, plans, .. } = self;
        let View { scene, technique, .. } = *view;
        if kind == Kind::Bidirectional {
            let lengths = match self.target {
                Target::Technique => Lengths { least: old.edges(), most: old.edges() },
                Target::Path(lengths) => lengths,
            };
            let mut draft = bidirectional::propose(scene, old, lengths, stream, new).ok_or(Rejection::Dark)?;
            if self.target == Target::Technique {
                draft.technique = technique;
            }
            return Ok(draft);
        }
        if kind == Kind::Connection {
            return connection::propose(view, old, stream, new);
        }
        plans.clear();
        plan(kind, scene, old, plans);
        let number = (stream.number() * plans.len() as f64) as usize;
        let plan = plans.get(number).ok_or(Rejection::Unsuitable)?;
        let ratio = perturb::propose(view, old, plan, stream, new)?;
        Ok(Draft { technique, ratio, ranges: None, linked: None })
    }
}

/// The weights of the mutations that suit a course, 0 for others.
fn suitable(weights: &Weights, scene: &Caster<'_>, course: &Course, plans: &mut Vec<Plan>) -> [f64; Kind::ALL.len()] {
    Kind::ALL.map(|kind| {
        let weight = weights.get(kind);
        let suits = weight > 0.0
            && match kind {
                Kind::Bidirectional => true,
                Kind::Connection => connection::suits(scene, course),
                _ => {
                    plans.clear();
                    plan(kind, scene, course, plans);
                    !plans.is_empty()
                }
            };
        if suits { weight } else { 0.0 }
    })
}

/// Adds the ways in which a perturbation may move a path.
fn plan(kind: Kind, scene: &Caster<'_>, course: &Course, plans: &mut Vec<Plan>) {
    match kind {
        Kind::Bidirectional | Kind::Connection => {}
        Kind::Lens => plans.extend(lens::plan(course)),
        Kind::Caustic => plans.extend(caustic::plan(course)),
        Kind::MultiChain => plans.extend(multi_chain::plan(course)),
        Kind::Manifold => manifold::plans(scene, course, plans),
    }
}

/// The next free vertex from x_m on, one that is none of a chain, as `walk` goes; `None` where the path ends.
fn next_free(course: &Course, m: usize, walk: Walk) -> Option<usize> {
    let mut at = onward(course, m, walk)?;
    while course.nodes[at].linked {
        at = onward(course, at, walk)?;
    }
    Some(at)
}

/// The next vertex from x_m on that is no delta vertex.
fn next_fixed(course: &Course, m: usize, walk: Walk) -> Option<usize> {
    let mut at = onward(course, m, walk)?;
    while course.nodes[at].delta {
        at = onward(course, at, walk)?;
    }
    Some(at)
}

/// The next vertex.
fn onward(course: &Course, m: usize, walk: Walk) -> Option<usize> {
    match walk {
        Walk::FromCamera => m.checked_sub(1),
        Walk::FromLight => (m < course.edges()).then_some(m + 1),
    }
}

/// Unit vector from x_m to the next vertex.
fn direction_onward(scene: &Scene, course: &Course, m: usize, walk: Walk) -> Option<DVec3> {
    match walk {
        Walk::FromCamera => Some(-course.direction(scene, m.checked_sub(1)?)?),
        Walk::FromLight => course.direction(scene, m),
    }
}

/// The other way round.
const fn reverse(walk: Walk) -> Walk {
    match walk {
        Walk::FromCamera => Walk::FromLight,
        Walk::FromLight => Walk::FromCamera,
    }
}
