//! Large steps that try all techniques at once (Bitterli 2015, section 4.3, after Craiu and Lemieux 2007).
//!
//! Two full walks by the same rows u have k + 1 connections of length k. One of them is chosen in proportion to its target
//! C_s(u), and with the connections of the current state's own rows u', of which those that its path does not read are
//! drawn now, the step is accepted with the probability
//!
//! ```text
//! min(1, Σ_s C_s(u) / Σ_s C_s(u')).
//! ```

use super::state::ChainState;
use super::tracer::Tracer;
use crate::film::Health;
use crate::math::{Stream, pick};
use crate::paths::{Found, FullPath, Junction, TECHNIQUES, connect};
use crate::scene::Caster;

/// The connections of two full walks.
#[derive(Debug, Default)]
pub struct Tries {
    walks: FullPath,
    found: Vec<(Found, Junction)>,
}

impl Tries {
    /// Traces both walks of the state, or of its proposal, and connects them: the sum of the targets. Technique `known` is
    /// left out.
    pub fn sum(
        &mut self,
        tracer: Tracer,
        scene: &Caster<'_>,
        known: Option<usize>,
        state: &mut ChainState,
        stream: &mut Stream,
        health: &mut Health,
    ) -> f64 {
        let Self { walks, found } = self;
        found.clear();
        let first = state.row(Tracer::CAMERA_ROWS, stream);
        // Walks that end early have the shorter connections still.
        let rows = &mut state.rows(Tracer::CAMERA_ROWS, false, stream);
        let _ = tracer.walk_camera(scene, first, rows, tracer.edges + 1, walks);
        let _ = tracer.walk_light(scene, &mut state.rows(tracer.light_rows(), false, stream), tracer.edges, walks);
        let (light, camera) = (&walks.light.vertices, &walks.camera.vertices);
        for s in (0..=tracer.edges.min(light.len())).filter(|s| Some(*s) != known) {
            let t = tracer.techniques() - s;
            if t > camera.len() {
                continue;
            }
            let Some(one) = connect(scene, &light[..s], &camera[..t], &TECHNIQUES) else { continue };
            let value = one.value * tracer.techniques() as f64;
            let luminance = value.luminance();
            if health.accepts(value) && luminance > 0.0 {
                let film = one.film.unwrap_or(walks.film);
                found.push((Found { value, luminance, class: one.class, film, technique: s }, one.junction));
            }
        }
        found.iter().map(|(found, _)| found.luminance).sum()
    }

    /// Draws one of the connections in proportion to their targets; its path is left in `path`.
    pub fn choose(&mut self, tracer: Tracer, stream: &mut Stream, path: &mut FullPath) -> Option<Found> {
        let chosen = pick(self.found.iter().map(|(found, _)| found.luminance), stream.number());
        let (found, junction) = *chosen.map_or(self.found.last(), |index| self.found.get(index))?;
        std::mem::swap(path, &mut self.walks);
        path.light.vertices.truncate(found.technique);
        path.camera.vertices.truncate(tracer.techniques() - found.technique);
        (path.film, path.junction) = (found.film, junction);
        Some(found)
    }
}
