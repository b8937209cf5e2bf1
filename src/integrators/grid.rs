//! Photons by place: what lies within a radius of a point.

use foldhash::fast::FixedState;
use glam::{DVec3, IVec3};
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;

/// Something with a place.
pub(super) trait Located: Copy + Send + Sync {
    /// Where it is.
    fn position(&self) -> DVec3;
}

/// Photons, and grids whose cells double in size from one to the next. Radii grow with the distance from the camera; each
/// is served by the grid whose cells are just as wide as its disk, so that no gather looks at more than eight of them.
///
/// The photons lie along Morton's curve through the smallest cells. It goes through every larger cell from end to end
/// before it goes on, so that what lies in a cell of any of the grids is one run of photons.
pub(super) struct Grids<T> {
    photons: Vec<T>,
    /// Width of the smallest cells.
    width: f64,
    /// By level; empty where no radius has that size.
    levels: Vec<Runs>,
}

/// The photons of each cell, by its place along the curve.
type Runs = HashMap<u64, Range<u32>, FixedState>;

impl<T: Located> Grids<T> {
    /// Most levels, so that neighbouring cells never share their place; smaller radii are served by cells that are larger
    /// than need be.
    const LEVELS: u32 = 20;

    /// Grids for searches within `radii`, of the photons of some jobs.
    pub(super) fn new(jobs: &[Vec<T>], radii: impl ParallelIterator<Item = f64> + Clone) -> Self {
        let largest = radii.clone().reduce(|| 0.0, f64::max);
        let smallest = radii.clone().reduce(|| f64::INFINITY, f64::min);
        let width = 2.0 * smallest.max(largest * 0.5f64.powi(Self::LEVELS as i32 - 1));
        let mut order: Vec<(u64, u32, u32)> = Vec::new();
        order.par_extend(jobs.par_iter().enumerate().flat_map_iter(|(job, photons)| {
            let place = move |photon: &T| along_curve(cell_of(photon.position(), width));
            (0..).zip(photons).map(move |(index, photon)| (place(photon), job as u32, index))
        }));
        order.par_sort_unstable();
        let mut photons = Vec::new();
        order.par_iter().map(|&(_, job, index)| jobs[job as usize][index as usize]).collect_into_vec(&mut photons);
        let mut grids = Self { photons, width, levels: Vec::new() };
        let used = radii.fold(|| 0u32, |used, radius| used | 1 << grids.level(radius)).reduce(|| 0, |a, b| a | b);
        grids.levels = (0..u32::BITS - used.leading_zeros())
            .into_par_iter()
            .map(|level| if used & 1 << level == 0 { Runs::default() } else { runs(&order, level) })
            .collect();
        grids
    }

    /// The first level whose cells are at least as wide as a disk of `radius`.
    #[inline]
    fn level(&self, radius: f64) -> u32 {
        (2.0 * radius / self.width).log2().ceil().max(0.0) as u32
    }

    /// Calls `each` for the photons closer to `center` than `radius`, one of those that the grids were made for.
    #[inline]
    pub(super) fn within(&self, center: DVec3, radius: f64, mut each: impl FnMut(&T)) {
        let level = self.level(radius);
        let Some(runs) = self.levels.get(level as usize) else { return };
        let low = cell_of(center - radius, self.width) >> level;
        let high = cell_of(center + radius, self.width) >> level;
        for x in low.x..=high.x {
            for y in low.y..=high.y {
                for z in low.z..=high.z {
                    // Along the curve, a level takes three bits.
                    let place = along_curve(IVec3::new(x, y, z) << level) >> (3 * level);
                    let Some(run) = runs.get(&place) else { continue };
                    for photon in &self.photons[run.start as usize..run.end as usize] {
                        if photon.position().distance_squared(center) < radius * radius {
                            each(photon);
                        }
                    }
                }
            }
        }
    }
}

/// The cell of a grid with cells of this `width` that holds `position`.
#[inline]
fn cell_of(position: DVec3, width: f64) -> IVec3 {
    (position / width).floor().as_ivec3()
}

/// Runs of equal cells of one `level` in photons sorted by their places.
fn runs(order: &[(u64, u32, u32)], level: u32) -> Runs {
    let mut runs = Runs::default();
    let mut start = 0;
    for run in order.chunk_by(|a, b| a.0 >> (3 * level) == b.0 >> (3 * level)) {
        let end = start + run.len() as u32;
        runs.insert(run[0].0 >> (3 * level), start..end);
        start = end;
    }
    runs
}

/// Place of a cell along Morton's curve; cells 2²¹ apart share one.
fn along_curve(cell: IVec3) -> u64 {
    let spread = |coordinate: i32| {
        let mut bits = u64::from(coordinate as u32) & 0x1f_ffff;
        for (shift, mask) in [
            (32, 0x001f_0000_0000_ffff),
            (16, 0x001f_0000_ff00_00ff),
            (8, 0x100f_00f0_0f00_f00f),
            (4, 0x10c3_0c30_c30c_30c3),
            (2, 0x1249_2492_4924_9249),
        ] {
            bits = (bits | bits << shift) & mask;
        }
        bits
    };
    spread(cell.x) | spread(cell.y) << 1 | spread(cell.z) << 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Stream;

    impl Located for DVec3 {
        fn position(&self) -> DVec3 {
            *self
        }
    }

    #[test]
    fn the_grid_finds_what_a_search_of_all_photons_finds() {
        let mut stream = Stream::new(1, &[]);
        let mut point =
            |scale: f64| DVec3::new(stream.number(), stream.number(), stream.number()) * scale - 0.5 * scale;
        let photons: Vec<DVec3> = (0..5000).map(|_| point(3.0)).collect();
        let radii = [0.01, 0.1, 0.5, 1.0];
        let grids = Grids::new(&[photons[..2000].to_vec(), photons[2000..].to_vec()], radii.into_par_iter());
        for radius in radii {
            for _ in 0..50 {
                let center = point(3.5);
                let mut found = 0;
                grids.within(center, radius, |_| found += 1);
                let expected = photons.iter().filter(|p| p.distance(center) < radius).count();
                assert_eq!(found, expected);
            }
        }
    }
}
