//! Where the primary samples of a subpath come from. Each vertex reads one row, by its place in the subpath, so that a
//! change at one vertex never ripples into later ones.
//!
//! Camera subpath: row 0 is film x, film y and the lens; row i the scattering at vertex i (lobe, two for the direction,
//! survival). Light subpath: row 0 is the choice of the light and the point on it, row 1 the direction from there (for
//! an infinite light the point on the disk), row i + 1 the scattering at vertex i.

use crate::bsdf::Bsdf;
use crate::math::{Row, Stream, Walk};
use crate::scene::{Scene, Surface};
use glam::DVec3;

/// What a number of a row is for: chains treat them differently.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    /// The film position along its width.
    FilmX,
    /// The film position along its height.
    FilmY,
    /// Makes a little change where it changes a little.
    Continuous,
    /// Chooses among things that have nothing to do with each other.
    Discrete,
    /// Nothing.
    Unused,
}

/// What a scene has rows decide. Numbers that would decide anything else are never read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Open {
    /// The point of the lens.
    pub lens: bool,
    /// The lobe by which a surface scatters.
    pub lobes: bool,
}

impl Open {
    /// What `scene` has rows decide.
    pub fn of(scene: &Scene) -> Self {
        Self { lens: scene.camera.has_lens(), lobes: scene.bsdfs().iter().any(Bsdf::chooses) }
    }
}

/// What the numbers of row `index` of a walk are for, where no Russian roulette is played. A light's triangle is chosen by
/// what also places the point within it, which counts as continuous.
pub fn uses(open: Open, walk: Walk, index: usize) -> [Use; 4] {
    use Use::{Continuous, Discrete, FilmX, FilmY, Unused};
    let lens = if open.lens { Continuous } else { Unused };
    let lobe = if open.lobes { Discrete } else { Unused };
    match (walk, index) {
        (Walk::FromCamera, 0) => [FilmX, FilmY, lens, lens],
        (Walk::FromLight, 0) => [Discrete, Continuous, Continuous, Unused],
        (Walk::FromLight, 1) => [Unused, Continuous, Continuous, Unused],
        _ => [lobe, Continuous, Continuous, Unused],
    }
}

/// A source of rows.
pub trait Rows {
    /// The row at `index`. Each index is asked for once per subpath, in ascending order.
    fn row(&mut self, index: usize) -> Row;

    /// The row at `index` for scattering at `surface`, where the walk came from `wi` in its shading frame.
    #[inline]
    fn scattering_row(&mut self, index: usize, _scene: &Scene, _surface: &Surface, _wi: DVec3) -> Row {
        self.row(index)
    }

    /// Whether walks may be ended at random by Russian roulette.
    fn roulette(&self) -> bool;
}

/// Fresh random numbers.
pub struct Random<'a>(pub &'a mut Stream);

impl Rows for Random<'_> {
    #[inline]
    fn row(&mut self, _index: usize) -> Row {
        self.0.row()
    }

    #[inline]
    fn roulette(&self) -> bool {
        true
    }
}
