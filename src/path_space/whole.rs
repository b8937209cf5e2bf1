//! Whole paths, independent of all others: what tells the normalisation b, where chains begin, and their large steps. Beside
//! the techniques of bidirectional path tracing, each as likely, a share λ of them is made by the [`super::connection`]: a
//! walk from the camera up to x_d, and from there a chain of smooth boundaries to a point of a light, with d drawn evenly
//! from 2 … k − 1. So light comes in that techniques hardly ever find. All ways are one density,
//!
//! ```text
//! q(x) = (1 − λ)/(k + 1) Σ_s p_s(x) + λ/(k − 2) m_d(x),
//! ```
//!
//! where d is the first free vertex from the light. f/q is what a path is worth: its mean is b, and the acceptance of an
//! independent path is the ratio of both paths' worth, where the technique is then drawn by the weights w_s, as jumps do.
//!
//! # Hidden light
//! The seed of a link sets out straight for the light and is refracted. Where another chain leads there too, one that is
//! reflected or passes another face, the path is hidden. Random seeds find some of these. Where they are sought with a share
//! μ of the paths, the density of hidden ones has a factor that nobody knows, the probability p that a random seed walks to
//! the chain that the path has:
//!
//! ```text
//! q(x) = A + B p,   A = (1 − λ − μ)/(k + 1) Σ_s p_s(x),   B = μ/(k − 2) m_d(x).
//! ```
//!
//! But 1/q can be told, since 1/(A + B p) = Σ_n r^n (1 − p)^n / (A + B) with r = B/(A + B): let K be the number of rounds
//! until one ends, either because a coin fails that shows heads with probability r, or because a fresh seed finds the chain.
//! K is geometric with the probability σ = q/(A + B), so that E[K]/(A + B) = 1/q, and f K/(A + B) is what the path is worth
//! in the mean. No walk is needed where techniques find it well (r ≈ 0), few where seeds do (p ≈ 1).
//!
//! As a large step it is exact as well. Take K into the state, with the target f σ K P(K | σ), whose sum over K is f. A path
//! that is drawn comes with the density q P(K | σ), so the ratio of target and density is f K/(A + B), again what it is
//! worth. A path that has come by another mutation draws its K anew, from K P(K | σ) σ: that is the law of K₁ + K₂ − 1 for
//! two geometric numbers. More than [`MOST_ROUNDS`] end in a rejection, for both ways alike; only b misses such paths.

use super::connection::Seed;
use super::{Kind, PathMutations, PathSpace, View, connection, realise};
use crate::emitter::Start;
use crate::math::Stream;
use crate::paths::{Course, Found, FullPath, Random, Techniques, VertexKind, trace_camera};
use crate::scene::Caster;

/// λ: the share of paths that are linked with a light over a manifold, where there are smooth boundaries at all.
const LINKED: f64 = 0.25;
/// μ: the share of paths that are linked by a random seed, where hidden light is sought.
const SOUGHT: f64 = 0.25;
/// The most rounds that tell how likely a path is.
const MOST_ROUNDS: u32 = 1000;

/// In which ways independent paths come about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ways {
    /// By techniques, and by links whose density is known.
    Known,
    /// By random seeds too.
    All,
}

/// An independent path.
#[derive(Clone, Copy, Debug)]
pub struct Drawn {
    /// What it contributes.
    pub found: Found,
    /// What it is worth: the luminance of f/q, in the mean.
    pub worth: f64,
    /// Whether its light is hidden from all but random seeds, and perhaps some technique.
    pub hidden: bool,
}

/// q of a path, in units of the density of one of its techniques.
struct Density {
    /// A.
    sure: f64,
    /// B.
    sought: f64,
    /// The first free vertex from the light, where a chain lies between that no straight seed finds.
    hidden: Option<usize>,
}

impl PathMutations {
    /// λ and μ for paths of this length.
    fn shares(&self, scene: &Caster<'_>, edges: usize, ways: Ways) -> [f64; 2] {
        let links = edges > 2 && self.links(scene);
        let linked = if links { LINKED } else { 0.0 };
        let sought = if links && ways == Ways::All { SOUGHT } else { 0.0 };
        [linked, sought]
    }

    /// Whether independent paths come about in more ways than the techniques have.
    pub fn links(&self, scene: &Caster<'_>) -> bool {
        self.kinds.has(Kind::Connection) && scene.refracts()
    }
}

impl PathSpace {
    /// Draws a path of `edges` edges, left in `path`; `None` where it carries no light. `by_technique` draws one of any
    /// technique, all as likely.
    pub fn sample(
        &mut self,
        scene: &Caster<'_>,
        (edges, ways): (usize, Ways),
        stream: &mut Stream,
        path: &mut FullPath,
        by_technique: impl FnOnce(&mut Stream, &mut FullPath) -> Option<Found>,
    ) -> Option<Drawn> {
        let [linked, sought] = self.mutations.shares(scene, edges, ways);
        let number = if linked > 0.0 { stream.number() } else { 1.0 };
        let technique = if number < linked {
            self.link(scene, edges, Seed::Straight, stream, path)?;
            0
        } else if number < linked + sought {
            self.link(scene, edges, Seed::Random, stream, path)?;
            0
        } else {
            let found = by_technique(stream, path)?;
            self.new.follow(path).then_some(found.technique)?
        };
        let alone = realise(scene, &mut self.new, technique, (&Techniques::ALONE, 1.0), path)?;
        path.densities(&mut self.densities);
        let Self { new, densities, mutations, walked, .. } = self;
        let density = density(scene, (*mutations, ways), new, densities, walked);
        if (linked..linked + sought).contains(&number) && density.sought == 0.0 {
            // Not hidden, and so none of its kind.
            return None;
        }
        let rounds = density.rounds(scene, new, stream)?;
        let worth = alone.luminance * f64::from(rounds) / (density.sure + density.sought);
        let hidden = density.hidden.is_some();
        let found = match self.target.pick(&self.densities, stream) {
            Some(technique) => {
                let contribution = (&self.target.techniques(), self.target.count(&self.new));
                realise(scene, &mut self.new, technique, contribution, path)?
            }
            None => alone,
        };
        worth.is_finite().then_some(Drawn { found, worth, hidden })
    }

    /// A path that is linked with a light, left in `self.new`.
    fn link(
        &mut self,
        scene: &Caster<'_>,
        edges: usize,
        seed: Seed,
        stream: &mut Stream,
        path: &mut FullPath,
    ) -> Option<()> {
        let d = 2 + (stream.number() * (edges - 2) as f64) as usize;
        let (first, count) = (stream.row(), edges - d + 1);
        let film = scene.camera.film_position(first);
        trace_camera(scene, film, first, &mut Random(stream), count, usize::MAX, &mut path.camera);
        let last = path.camera.vertices.last()?;
        if path.camera.vertices.len() < count || !last.connects {
            return None;
        }
        self.old.begin(&path.camera, edges);
        connection::connect(scene, &self.old, d, seed, stream, &mut self.new).ok()
    }

    /// What `path`, which contributes `current` to a chain, would be worth if it were drawn.
    pub fn worth(
        &mut self,
        scene: &Caster<'_>,
        (path, current): (&FullPath, &Found),
        ways: Ways,
        stream: &mut Stream,
    ) -> Option<f64> {
        self.old.follow(path).then_some(())?;
        path.densities(&mut self.densities);
        let weight = self.target.weight(&self.densities, current.technique);
        let alone = current.luminance / (self.target.count(&self.old) * weight);
        let Self { old, densities, mutations, walked, .. } = self;
        let density = density(scene, (*mutations, ways), old, densities, walked);
        let mut rounds = || density.rounds(scene, old, stream);
        // Of a path that is there already, many rounds are more likely.
        let rounds = if density.sought > 0.0 { rounds()? + rounds()? - 1 } else { 1 };
        let worth = alone * f64::from(rounds) / (density.sure + density.sought);
        (rounds < MOST_ROUNDS && worth.is_finite() && worth > 0.0).then_some(worth)
    }
}

impl Density {
    /// K; `None` where it is too large.
    fn rounds(&self, scene: &Caster<'_>, course: &Course, stream: &mut Stream) -> Option<u32> {
        let heads = self.sought / (self.sure + self.sought);
        let found = |stream: &mut Stream| self.hidden.is_some_and(|d| connection::finds(scene, course, d, stream));
        let ends = |stream: &mut Stream| stream.number() >= heads || found(stream);
        (1..MOST_ROUNDS).find(|_| heads == 0.0 || ends(stream))
    }
}

/// q of a course, in units of the density of the technique that `densities` are relative to.
fn density(
    scene: &Caster<'_>,
    (mutations, ways): (PathMutations, Ways),
    course: &mut Course,
    densities: &[f64],
    memory: &mut FullPath,
) -> Density {
    let edges = course.edges();
    let [linked, sought] = mutations.shares(scene, edges, ways);
    let by_techniques = (1.0 - linked - sought) * densities.iter().sum::<f64>() / (edges + 1) as f64;
    let mut density = Density { sure: by_techniques, sought: 0.0, hidden: None };
    let shines = matches!(course.nodes[0].kind, VertexKind::Light(_, Start::Surface { .. }));
    let Some(d) = connection::joint(course).filter(|_| linked > 0.0 && shines) else { return density };
    let of_link = |share: f64| share / (edges - 2) as f64 * densities[0];
    let view = View { scene, technique: 0, mutations };
    let straight = connection::share(&view, course, d, memory);
    density.sure += of_link(linked) * straight;
    if straight == 0.0 {
        density.hidden = Some(d);
        if sought > 0.0 {
            density.sought = of_link(sought) * connection::reach(scene, course, d, memory).unwrap_or(0.0);
        }
    }
    density
}
