//! Whole paths, independent of all others: what tells the normalisation b, where chains begin, and their large steps. Beside
//! the techniques of bidirectional path tracing, some of them are made by the [`super::connection`]: a walk from the camera
//! up to x_d, and from there a chain of smooth boundaries to a point of a light. So light comes in that techniques hardly
//! ever find. All ways are one density,
//!
//! ```text
//! q(x) = Σ_s α_s p_s(x) + λ_d m_d(x),
//! ```
//!
//! where d is the first free vertex from the light, and α and λ are those of a [`Mixture`]. f/q is what a path is worth: its
//! mean is b, and the acceptance of an independent path is the ratio of both paths' worth, where the technique is then drawn
//! by the weights w_s, as jumps do.
//!
//! # Hidden light
//! The seed of a link sets out straight for the light and is refracted. Where another chain leads there too, one that is
//! reflected or passes another face, the path is hidden. Random seeds find some of these. Where they are sought with a share
//! μ_d of the paths, the density of hidden ones has a factor that nobody knows, the probability p that a random seed walks to
//! the chain that the path has:
//!
//! ```text
//! q(x) = A + B p,   A = Σ_s α_s p_s(x),   B = μ_d m_d(x).
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
//! two geometric numbers. [`MOST_ROUNDS`] or more end in a rejection, for both ways alike. For b such a path counts with as
//! many rounds: where σ is a five-hundredth, b misses an eighth of its light.
//! The mean of [`TRIALS`] such numbers stands for K, so that it varies less: of those of a path that has come by another
//! mutation, one has that law, the others the geometric one.

use super::connection::Seed;
use super::mixture::{Mixture, Way, Ways};
use super::{PathMutations, PathSpace, Seeds, View, connection, realise};
use crate::emitter::Start;
use crate::math::Stream;
use crate::paths::{Course, Found, FullPath, Random, Techniques, VertexKind, trace_camera};
use crate::scene::Caster;

/// How often K is drawn for one path; the mean of them stands for it.
const TRIALS: usize = 4;
/// The most rounds of a trial.
const MOST_ROUNDS: u32 = 1000;

/// An independent path.
#[derive(Clone, Copy, Debug)]
pub struct Drawn {
    /// What it contributes.
    pub found: Found,
    /// What it is worth: the luminance of f/q, in the mean.
    pub worth: f64,
    /// Whether that is known: else it is worth as much at least, and no chain may take it.
    pub known: bool,
    /// The way that it came by.
    pub way: Way,
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

impl PathSpace {
    /// Draws a path, left in `path`; `None` where it carries no light. `by_technique` draws one of a technique.
    pub fn sample(
        &mut self,
        scene: &Caster<'_>,
        (mixture, ways): (&Mixture, Ways),
        stream: &mut Stream,
        path: &mut FullPath,
        by_technique: impl FnOnce(usize, &mut Stream, &mut FullPath) -> Option<Found>,
    ) -> Option<Drawn> {
        let way = mixture.draw(ways, stream.number());
        let technique = match way {
            Way::Technique(s) => {
                by_technique(s, stream, path)?;
                self.new.follow(path).then_some(s)?
            }
            Way::Link(d) | Way::Seek(d) => {
                let sought = matches!(way, Way::Seek(_));
                let seed = if sought { Seed::Random(&mixture.seeds) } else { Seed::Straight };
                self.link(scene, (mixture.edges(), d), seed, stream, path)?;
                0
            }
        };
        let alone = realise(scene, &mut self.new, technique, (&Techniques::ALONE, 1.0), path)?;
        path.densities(&mut self.densities);
        let Self { new, densities, mutations, walked, .. } = self;
        let density = density(scene, *mutations, (mixture, ways), new, densities, walked);
        let hidden = density.hidden.is_some();
        if matches!((way, hidden), (Way::Seek(_), false) | (Way::Link(_), true)) {
            // None of its kind, and so not in its density.
            return None;
        }
        let (rounds, known) = density.rounds((scene, new, &mixture.seeds), false, stream);
        let worth = alone.luminance * rounds / (density.sure + density.sought);
        let found = match self.target.pick(&self.densities, stream) {
            Some(technique) => {
                let contribution = (&self.target.techniques(), self.target.count(&self.new));
                realise(scene, &mut self.new, technique, contribution, path)?
            }
            None => alone,
        };
        worth.is_finite().then_some(Drawn { found, worth, known, way, hidden })
    }

    /// A path that is linked with a light, left in `self.new`.
    fn link(
        &mut self,
        scene: &Caster<'_>,
        (edges, d): (usize, usize),
        seed: Seed<'_>,
        stream: &mut Stream,
        path: &mut FullPath,
    ) -> Option<()> {
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

    /// What `path`, which contributes `current` to a chain, would be worth if it were drawn; `None` where that cannot be known.
    /// It becomes what the technique of `current` finds.
    pub fn worth(
        &mut self,
        scene: &Caster<'_>,
        (path, current): (&mut FullPath, &Found),
        (mixture, ways): (&Mixture, Ways),
        stream: &mut Stream,
    ) -> Option<f64> {
        self.follow(scene, path, current.technique).then_some(())?;
        path.densities(&mut self.densities);
        let weight = self.target.weight(&self.densities, current.technique);
        let alone = current.luminance / (self.target.count(&self.old) * weight);
        let Self { old, densities, mutations, walked, .. } = self;
        let density = density(scene, *mutations, (mixture, ways), old, densities, walked);
        let (rounds, known) = density.rounds((scene, old, &mixture.seeds), true, stream);
        let worth = alone * rounds / (density.sure + density.sought);
        (known && worth.is_finite() && worth > 0.0).then_some(worth)
    }
}

impl Density {
    /// The mean of K over [`TRIALS`], for a path that is drawn or for one that is `there` already, and whether all of them are
    /// known: those that are not count with [`MOST_ROUNDS`].
    fn rounds(
        &self,
        (scene, course, seeds): (&Caster<'_>, &Course, &Seeds),
        there: bool,
        stream: &mut Stream,
    ) -> (f64, bool) {
        let Some(d) = self.hidden.filter(|_| self.sought > 0.0) else { return (1.0, true) };
        let heads = self.sought / (self.sure + self.sought);
        let mut trial = || {
            (1..MOST_ROUNDS)
                .find(|_| stream.number() >= heads || connection::finds(scene, course, d, seeds, stream))
                .unwrap_or(MOST_ROUNDS)
        };
        let rounds: [u32; TRIALS] = std::array::from_fn(|number| {
            // Of a path that is there, many rounds are more likely.
            let more = if there && number == 0 { trial() - 1 } else { 0 };
            (trial() + more).min(MOST_ROUNDS)
        });
        let mean = f64::from(rounds.iter().sum::<u32>()) / TRIALS as f64;
        (mean, rounds.iter().all(|rounds| *rounds < MOST_ROUNDS))
    }
}

/// q of a course, in units of the density of the technique that `densities` are relative to.
fn density(
    scene: &Caster<'_>,
    mutations: PathMutations,
    (mixture, ways): (&Mixture, Ways),
    course: &mut Course,
    densities: &[f64],
    memory: &mut FullPath,
) -> Density {
    let mut density = Density { sure: mixture.by_techniques(ways, densities), sought: 0.0, hidden: None };
    let shines = matches!(course.nodes[0].kind, VertexKind::Light(_, Start::Surface { .. }));
    let Some(d) = connection::joint(course).filter(|_| mixture.links() && shines) else { return density };
    let view = View { scene, technique: 0, mutations };
    let straight = connection::share(&view, course, d, memory);
    if straight > 0.0 {
        density.sure += mixture.of_link(ways, d) * densities[0] * straight;
        return density;
    }
    density.hidden = Some(d);
    if ways == Ways::All {
        let reach = connection::reach(scene, course, d, memory).unwrap_or(0.0);
        density.sought = mixture.of_seed(ways, d) * densities[0] * reach;
    }
    density
}
