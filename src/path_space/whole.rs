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

use super::{Kind, PathMutations, PathSpace, View, connection, realise};
use crate::math::Stream;
use crate::paths::{Course, Found, FullPath, Random, Techniques, trace_camera};
use crate::scene::Caster;

/// λ: the share of paths that are linked with a light over a manifold, where there are smooth boundaries at all.
const LINKED: f64 = 0.25;

impl PathMutations {
    /// λ for paths of this length.
    fn linked(&self, scene: &Caster<'_>, edges: usize) -> f64 {
        if edges > 2 && self.links(scene) { LINKED } else { 0.0 }
    }

    /// Whether independent paths come about in more ways than the techniques have.
    pub fn links(&self, scene: &Caster<'_>) -> bool {
        self.kinds.has(Kind::Connection) && scene.refracts()
    }
}

impl PathSpace {
    /// Draws a path of `edges` edges, left in `path`, with what it is worth: the luminance of f/q. `None` where it carries no
    /// light. `by_technique` draws one of any technique, all as likely.
    pub fn sample(
        &mut self,
        scene: &Caster<'_>,
        edges: usize,
        stream: &mut Stream,
        path: &mut FullPath,
        by_technique: impl FnOnce(&mut Stream, &mut FullPath) -> Option<Found>,
    ) -> Option<(Found, f64)> {
        let linked = self.mutations.linked(scene, edges);
        let technique = if linked > 0.0 && stream.number() < linked {
            self.link(scene, edges, stream, path)?;
            0
        } else {
            let found = by_technique(stream, path)?;
            self.new.follow(path).then_some(found.technique)?
        };
        let alone = realise(scene, &mut self.new, technique, (&Techniques::ALONE, 1.0), path)?;
        path.densities(&mut self.densities);
        let worth = alone.luminance / density(scene, self.mutations, &mut self.new, &self.densities, &mut self.walked);
        let found = match self.target.pick(&self.densities, stream) {
            Some(technique) => {
                let contribution = (&self.target.techniques(), self.target.count(&self.new));
                realise(scene, &mut self.new, technique, contribution, path)?
            }
            None => alone,
        };
        worth.is_finite().then_some((found, worth))
    }

    /// A path that is linked with a light, left in `self.new`.
    fn link(&mut self, scene: &Caster<'_>, edges: usize, stream: &mut Stream, path: &mut FullPath) -> Option<()> {
        let d = 2 + (stream.number() * (edges - 2) as f64) as usize;
        let (first, count) = (stream.row(), edges - d + 1);
        let film = scene.camera.film_position(first);
        trace_camera(scene, film, first, &mut Random(stream), count, usize::MAX, &mut path.camera);
        let last = path.camera.vertices.last()?;
        if path.camera.vertices.len() < count || !last.connects {
            return None;
        }
        self.old.begin(&path.camera, edges);
        connection::connect(scene, &self.old, d, stream, &mut self.new).ok()
    }

    /// What `path`, which contributes `current` to a chain, would be worth if it were drawn.
    pub fn worth(&mut self, scene: &Caster<'_>, (path, current): (&FullPath, &Found)) -> Option<f64> {
        self.old.follow(path).then_some(())?;
        path.densities(&mut self.densities);
        let weight = self.target.weight(&self.densities, current.technique);
        let alone = current.luminance / (self.target.count(&self.old) * weight);
        let worth = alone / density(scene, self.mutations, &mut self.old, &self.densities, &mut self.walked);
        (worth.is_finite() && worth > 0.0).then_some(worth)
    }
}

/// q of a course, in units of the density of the technique that `densities` are relative to.
fn density(
    scene: &Caster<'_>,
    mutations: PathMutations,
    course: &mut Course,
    densities: &[f64],
    memory: &mut FullPath,
) -> f64 {
    let (edges, linked) = (course.edges(), mutations.linked(scene, course.edges()));
    let by_techniques = densities.iter().sum::<f64>() / (edges + 1) as f64;
    if linked == 0.0 {
        return by_techniques;
    }
    let view = View { scene, technique: 0, mutations };
    let by_link = connection::joint(course).map_or(0.0, |d| connection::share(&view, course, d, memory));
    (1.0 - linked) * by_techniques + linked / (edges - 2) as f64 * densities[0] * by_link
}
