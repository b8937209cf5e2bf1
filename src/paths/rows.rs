//! Where the primary samples of a subpath come from. Each vertex reads one row, by its place in the subpath, so that a
//! change at one vertex never ripples into later ones.
//!
//! Camera subpath: row 0 is film x, film y and the lens; row i the scattering at vertex i (lobe, two for the direction,
//! survival). Light subpath: row 0 is the choice of the light and the point on it, row 1 the direction from there (for
//! an infinite light the point on the disk), row i + 1 the scattering at vertex i.

use crate::math::{Row, Stream};

/// A source of rows.
pub trait Rows {
    /// The row at `index`. Each index is asked for once per subpath, in ascending order.
    fn row(&mut self, index: usize) -> Row;

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
