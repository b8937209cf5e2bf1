//! From rows to a path.

use super::state::ChainState;
use crate::film::Health;
use crate::math::{Row, Stream};
use crate::paths::{Found, FullPath, Rows, TECHNIQUES, connect, trace_camera, trace_light};
use crate::scene::Caster;

/// No vertex is the last by chance.
const NEVER: usize = usize::MAX;

/// Fresh random numbers, for walks that do not end at random.
struct Fresh<'a>(&'a mut Stream);

impl Rows for Fresh<'_> {
    fn row(&mut self, _index: usize) -> Row {
        self.0.row()
    }

    fn roulette(&self) -> bool {
        false
    }
}

/// Finds paths of one length. The rows of a state are one for the choice of the technique, those of the camera's walk, and
/// those of the light's.
#[derive(Clone, Copy, Debug)]
pub struct Tracer {
    /// Length of the paths, k.
    pub edges: usize,
}

impl Tracer {
    /// Row of the technique choice.
    pub const TECHNIQUE_ROW: usize = 0;
    /// First row of the camera's walk.
    pub const CAMERA_ROWS: usize = 1;

    /// First row of the light's walk.
    pub fn light_rows(self) -> usize {
        Self::CAMERA_ROWS + self.edges + 1
    }

    /// Number of rows.
    pub fn rows(self) -> usize {
        self.light_rows() + self.edges + 1
    }

    /// Number of techniques.
    pub fn techniques(self) -> usize {
        self.edges + 1
    }

    /// The technique that `number` chooses.
    pub fn technique(self, number: f64) -> usize {
        ((number * self.techniques() as f64) as usize).min(self.edges)
    }

    /// The path of technique `s`, left in `path`; `None` where it carries no light.
    #[inline]
    pub fn find(
        self,
        scene: &Caster<'_>,
        s: usize,
        state: &mut ChainState,
        stream: &mut Stream,
        path: &mut FullPath,
        health: &mut Health,
    ) -> Option<Found> {
        let t = self.techniques() - s;
        let first = state.row(Self::CAMERA_ROWS, stream);
        self.walk_camera(scene, first, &mut state.rows(Self::CAMERA_ROWS, false, stream), t, path)?;
        self.walk_light(scene, &mut state.rows(self.light_rows(), false, stream), s, path)?;
        self.connect(scene, path, health)
    }

    /// A path of technique `s`, left in `path`; `None` where it carries no light.
    pub fn sample(
        self,
        scene: &Caster<'_>,
        s: usize,
        stream: &mut Stream,
        path: &mut FullPath,
        health: &mut Health,
    ) -> Option<Found> {
        let first = stream.row();
        self.walk_camera(scene, first, &mut Fresh(stream), self.techniques() - s, path)?;
        self.walk_light(scene, &mut Fresh(stream), s, path)?;
        self.connect(scene, path, health)
    }

    /// The camera subpath of `t` vertices.
    #[inline]
    pub(super) fn walk_camera(
        self,
        scene: &Caster<'_>,
        first: Row,
        rows: &mut impl Rows,
        t: usize,
        path: &mut FullPath,
    ) -> Option<()> {
        path.film = scene.camera.film_position(first);
        trace_camera(scene, path.film, first, rows, t, NEVER, &mut path.camera);
        (path.camera.vertices.len() == t).then_some(())
    }

    /// The light subpath of `s` vertices.
    #[inline]
    pub(super) fn walk_light(
        self,
        scene: &Caster<'_>,
        rows: &mut impl Rows,
        s: usize,
        path: &mut FullPath,
    ) -> Option<()> {
        trace_light(scene, rows, s, NEVER, &mut path.light);
        (path.light.vertices.len() == s).then_some(())
    }

    /// What the two subpaths make together.
    #[inline]
    pub(super) fn connect(self, scene: &Caster<'_>, path: &mut FullPath, health: &mut Health) -> Option<Found> {
        let Some(found) = &connect(scene, &path.light.vertices, &path.camera.vertices, &TECHNIQUES) else {
            return None;
        };
        let value = found.value * self.techniques() as f64;
        let luminance = value.luminance();
        if !(health.accepts(value) && luminance > 0.0) {
            return None;
        }
        path.film = found.film.unwrap_or(path.film);
        path.junction = found.junction;
        let (film, technique) = (path.film, path.light.vertices.len());
        Some(Found { value, luminance, class: found.class, film, technique })
    }
}
