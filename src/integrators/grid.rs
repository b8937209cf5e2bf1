//! Photons by place: what lies within a radius of a point.

use glam::{DVec3, IVec3};

/// Something with a place.
pub(super) trait Located: Copy {
    /// Where it is.
    fn position(&self) -> DVec3;
}

/// Grids whose cells double in size from one to the next. Radii grow with the distance from the camera; each is served
/// by the grid whose cells are just as wide as its disk, so that no gather looks at more than eight of them.
pub(super) struct Grids<T> {
    smallest: f64,
    /// By level; `None` where no radius has that size.
    levels: Vec<Option<Grid<T>>>,
}

impl<T: Located> Grids<T> {
    /// Most levels; smaller radii are served by cells that are larger than need be.
    const LEVELS: i32 = 24;

    /// Grids of `photons` for searches within `radii`.
    pub(super) fn new(photons: &[T], radii: impl Iterator<Item = f64> + Clone) -> Self {
        let largest = radii.clone().fold(0.0, f64::max);
        let least = radii.clone().fold(f64::INFINITY, f64::min).max(largest * 0.5f64.powi(Self::LEVELS - 1));
        let mut grids = Self { smallest: least, levels: Vec::new() };
        for radius in radii {
            let level = grids.level(radius);
            grids.levels.resize_with(grids.levels.len().max(level + 1), || None);
            grids.levels[level].get_or_insert_with(|| Grid::new(photons, 2.0 * least * 2f64.powi(level as i32)));
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
            grid.within(center, radius, each);
        }
    }
}

/// Photons sorted into the cells of a hashed grid.
pub(super) struct Grid<T> {
    /// Width of a cell.
    cell: f64,
    /// Where the photons of each bucket start; one more entry than there are buckets.
    starts: Vec<u32>,
    photons: Vec<T>,
}

impl<T: Located> Grid<T> {
    /// A grid with cells of width `cell`.
    pub(super) fn new(unsorted: &[T], cell: f64) -> Self {
        let buckets = unsorted.len().next_power_of_two();
        let mut grid = Self { cell, starts: vec![0; buckets + 1], photons: unsorted.to_vec() };
        let bucket_of: Vec<usize> =
            unsorted.iter().map(|photon| grid.bucket(grid.cell_of(photon.position()))).collect();
        for bucket in &bucket_of {
            grid.starts[bucket + 1] += 1;
        }
        for bucket in 0..buckets {
            grid.starts[bucket + 1] += grid.starts[bucket];
        }
        let mut next = grid.starts.clone();
        for (photon, bucket) in unsorted.iter().zip(bucket_of) {
            grid.photons[next[bucket] as usize] = *photon;
            next[bucket] += 1;
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
    pub(super) fn within(&self, center: DVec3, radius: f64, mut each: impl FnMut(&T)) {
        let (low, high) = (self.cell_of(center - radius), self.cell_of(center + radius));
        for x in low.x..=high.x {
            for y in low.y..=high.y {
                for z in low.z..=high.z {
                    let cell = IVec3::new(x, y, z);
                    let bucket = self.bucket(cell);
                    let range = self.starts[bucket] as usize..self.starts[bucket + 1] as usize;
                    for photon in &self.photons[range] {
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
        let grids = Grids::new(&photons, radii.into_iter());
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
