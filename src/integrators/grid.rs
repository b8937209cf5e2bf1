//! Photons by place: what lies within a radius of a point.

use glam::{DVec3, IVec3};
use rayon::prelude::*;

/// Something with a place.
pub(super) trait Located: Copy + Send + Sync {
    /// Where it is.
    fn position(&self) -> DVec3;
}

/// Photons, and grids whose cells double in size from one to the next. Radii grow with the distance from the camera; each
/// is served by the grid whose cells are just as wide as its disk, so that no gather looks at more than eight of them.
pub(super) struct Grids<T> {
    /// Along a curve that keeps neighbours close.
    photons: Vec<T>,
    smallest: f64,
    /// By level; `None` where no radius has that size.
    levels: Vec<Option<Grid>>,
}

impl<T: Located> Grids<T> {
    /// Most levels; smaller radii are served by cells that are larger than need be.
    const LEVELS: i32 = 24;

    /// Grids of `photons` for searches within `radii`.
    pub(super) fn new(mut photons: Vec<T>, radii: impl Iterator<Item = f64> + Clone) -> Self {
        let largest = radii.clone().fold(0.0, f64::max);
        let smallest = radii.clone().fold(f64::INFINITY, f64::min).max(largest * 0.5f64.powi(Self::LEVELS - 1));
        photons.par_sort_by_cached_key(|photon| along_curve((photon.position() / smallest).floor().as_ivec3()));
        let mut grids = Self { photons, smallest, levels: Vec::new() };
        for radius in radii {
            let level = grids.level(radius);
            grids.levels.resize_with(grids.levels.len().max(level + 1), || None);
            let cell = 2.0 * smallest * 2f64.powi(level as i32);
            grids.levels[level].get_or_insert_with(|| Grid::new(&grids.photons, cell));
        }
        grids
    }

    /// The first level whose cells are at least as wide as a disk of `radius`.
    #[inline]
    fn level(&self, radius: f64) -> usize {
        (radius / self.smallest).log2().ceil().max(0.0) as usize
    }

    /// Calls `each` for the photons closer to `center` than `radius`, one of those that the grids were made for.
    #[inline]
    pub(super) fn within(&self, center: DVec3, radius: f64, each: impl FnMut(&T)) {
        if let Some(Some(grid)) = self.levels.get(self.level(radius)) {
            grid.within(&self.photons, center, radius, each);
        }
    }
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

/// Numbers of photons, sorted into the cells of a hashed grid.
struct Grid {
    /// Width of a cell.
    cell: f64,
    /// Where the photons of each bucket start; one more entry than there are buckets.
    starts: Vec<u32>,
    numbers: Vec<u32>,
}

impl Grid {
    /// A grid with cells of width `cell`.
    fn new<T: Located>(photons: &[T], cell: f64) -> Self {
        let buckets = photons.len().next_power_of_two();
        let mut grid = Self { cell, starts: vec![0; buckets + 1], numbers: vec![0; photons.len()] };
        let bucket_of: Vec<u32> =
            photons.par_iter().map(|photon| grid.bucket(grid.cell_of(photon.position())) as u32).collect();
        // Counted two places further on, so that after the sums a bucket's start stands where its end is to be, and moves
        // there as its photons come in.
        for &bucket in &bucket_of {
            if let Some(count) = grid.starts.get_mut(bucket as usize + 2) {
                *count += 1;
            }
        }
        for bucket in 1..buckets {
            grid.starts[bucket + 1] += grid.starts[bucket];
        }
        for (number, bucket) in (0u32..).zip(bucket_of) {
            let end = &mut grid.starts[bucket as usize + 1];
            grid.numbers[*end as usize] = number;
            *end += 1;
        }
        grid
    }

    #[inline]
    fn cell_of(&self, position: DVec3) -> IVec3 {
        (position / self.cell).floor().as_ivec3()
    }

    #[inline]
    fn bucket(&self, cell: IVec3) -> usize {
        // Teschner et al. 2003, *Optimized Spatial Hashing*.
        let hash = (cell.x as u32).wrapping_mul(73_856_093)
            ^ (cell.y as u32).wrapping_mul(19_349_663)
            ^ (cell.z as u32).wrapping_mul(83_492_791);
        hash as usize & (self.starts.len() - 2)
    }

    /// Calls `each` for the photons closer to `center` than `radius`.
    #[inline]
    fn within<T: Located>(&self, photons: &[T], center: DVec3, radius: f64, mut each: impl FnMut(&T)) {
        let (low, high) = (self.cell_of(center - radius), self.cell_of(center + radius));
        for x in low.x..=high.x {
            for y in low.y..=high.y {
                for z in low.z..=high.z {
                    let cell = IVec3::new(x, y, z);
                    let bucket = self.bucket(cell);
                    let range = self.starts[bucket] as usize..self.starts[bucket + 1] as usize;
                    for number in &self.numbers[range] {
                        let photon = &photons[*number as usize];
                        let near = photon.position().distance_squared(center) < radius * radius;
                        if near && self.cell_of(photon.position()) == cell {
                            each(photon);
                        }
                    }
                }
            }
        }
    }
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
        let grids = Grids::new(photons.clone(), radii.into_iter());
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
