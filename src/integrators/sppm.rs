//! Stochastic progressive photon mapping (Hachisuka and Jensen 2009) in the form of Knaus and Zwicker (2011): the
//! radius shrinks by a rule that does not depend on what was found, so that every pass is an independent estimate and
//! the image is the mean over passes.
//!
//! A pass walks from the camera to the first diffuse-like vertex of each pixel. Light met on the way and direct light
//! are estimated as in path tracing. All other light is gathered from photons that met at least one surface before:
//! with N photons of power Φ and radius r, L = 1 / (N π r²) Σ f Φ. The class of a photon's path is the photon's word,
//! the letter of the gathering vertex for the two directions, and the word of the camera's walk.

use super::path::{self, State, film_position};
use super::{Counts, render::Settings};
use crate::film::{Band, Film, Kernel, Word};
use crate::math::{Stream, Walk};
use crate::paths::{Random, Subpath, VertexKind, trace_light};
use crate::scene::{Caster, Scene, Surface};
use crate::spectrum::Spectrum;
use glam::{DVec3, IVec3};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Share of the photons in a radius that is kept from pass to pass (Knaus and Zwicker 2011, eq. 20); the field's usual
/// value.
const ALPHA: f64 = 2.0 / 3.0;

/// First radius in units of the size that a pixel has at the distance of the gathering vertex.
const FIRST_RADIUS: f64 = 2.5;

/// Photons whose distance from the tangent plane exceeds this share of the radius lie on another surface.
const FLATNESS: f64 = 0.3;

/// Jobs that the photons of a pass are split into, independent of the number of threads.
const JOBS: usize = 32;

/// Vertices of a photon's path before Russian roulette sets in.
const ROULETTE_FROM: usize = 3;

/// The method's settings and the radius of the next pass.
pub(super) struct Sppm {
    seed: u64,
    max_depth: usize,
    photons: usize,
    /// Square of the radius relative to the first one.
    shrinkage: f64,
}

/// Where a pixel gathers.
struct Gather {
    surface: Surface,
    back: DVec3,
    throughput: Spectrum,
    word: Word,
    /// Edges from the camera.
    edges: usize,
    radius: f64,
    pixel: [usize; 2],
}

/// A photon that met a surface.
#[derive(Clone, Copy)]
struct Photon {
    position: DVec3,
    /// Unit direction back to where it came from.
    back: DVec3,
    power: Spectrum,
    word: Word,
    /// Edges from the light.
    edges: usize,
}

impl Sppm {
    pub(super) fn start(scene: &Scene, settings: &Settings) -> Self {
        Self {
            seed: settings.seed,
            max_depth: settings.max_depth,
            photons: scene.camera.size.iter().product(),
            shrinkage: 1.0,
        }
    }

    pub(super) fn pass(&mut self, scene: &Scene, film: &mut Film, pass: u64, counts: &mut Counts) {
        let kernel = film.kernel.clone();
        let size = film.size;
        let radius = FIRST_RADIUS * self.shrinkage.sqrt();
        let walks = film.for_each_band(|index, band| {
            let caster = Caster::new(scene);
            let mut stream = Stream::new(self.seed, &[0, pass, index as u64]);
            let mut gathers = Vec::new();
            for pixel in band.pixels() {
                self.walk(&caster, &kernel, size, pixel, radius, &mut stream, band, &mut gathers);
            }
            (gathers, caster.rays())
        });
        let shot: Vec<(Vec<Photon>, u64)> =
            (0..JOBS).into_par_iter().map(|job| self.shoot(scene, pass, job as u64)).collect();
        let rays = walks.iter().map(|w| w.1).sum::<u64>() + shot.iter().map(|s| s.1).sum::<u64>();
        let photons: Vec<Photon> = shot.into_iter().flat_map(|s| s.0).collect();
        let grids = Grids::new(&photons, walks.iter().flat_map(|w| &w.0).map(|gather| gather.radius));
        film.for_each_band(|index, band| {
            for gather in &walks[index].0 {
                self.gather(scene, &grids, gather, band);
            }
        });
        counts.add((self.photons + size[0] * size[1]) as u64, rays);
        let n = (pass + 1) as f64;
        self.shrinkage *= (n + ALPHA) / (n + 1.0);
    }

    /// Walks from the camera to the first diffuse-like vertex, adding light met on the way and direct light. What such a
    /// vertex scatters by delta lobes is not gathered there: by these the walk goes on.
    #[allow(clippy::too_many_arguments)]
    fn walk(
        &self,
        scene: &Caster<'_>,
        kernel: &Kernel,
        size: [usize; 2],
        pixel: [usize; 2],
        radius_in_pixels: f64,
        stream: &mut Stream,
        band: &mut Band,
        gathers: &mut Vec<Gather>,
    ) {
        let row = stream.row();
        let mut state = State::at_camera(scene, film_position(kernel, size, pixel, row), row);
        let mut distance = 0.0;
        for edges in 1..=self.max_depth {
            let Some(surface) = state.next(scene) else {
                path::background(scene, &state, pixel, band);
                return;
            };
            distance += surface.position.distance(state.origin.point);
            path::emission(scene, &surface, &state, pixel, band);
            if edges == self.max_depth {
                return;
            }
            let wi = surface.frame.to_local(-state.direction);
            let bsdf = scene.bsdf(surface.bsdf);
            let met = scene.met(&surface, wi);
            let gathered = bsdf.gathers(met);
            if !bsdf.is_delta(met) {
                path::direct(scene, &surface, wi, &state, !gathered, stream, pixel, band);
            }
            if gathered {
                gathers.push(Gather {
                    surface,
                    back: -state.direction,
                    throughput: state.throughput,
                    word: state.word,
                    edges,
                    radius: radius_in_pixels * scene.camera.pixel_width(distance),
                    pixel,
                });
                if !bsdf.has_delta(met) {
                    return;
                }
            }
            let Some(scatter) = scene.scatter(&surface, wi, stream.row(), Walk::FromCamera) else { return };
            if gathered && !scatter.delta {
                return;
            }
            state = state.scattered(&surface, &scatter, scatter.weight);
        }
    }

    /// The photons of one job, with the number of rays that it cast.
    fn shoot(&self, scene: &Scene, pass: u64, job: u64) -> (Vec<Photon>, u64) {
        let caster = Caster::new(scene);
        let mut stream = Stream::new(self.seed, &[1, pass, job]);
        let mut path = Subpath::default();
        let mut photons = Vec::new();
        let (first, last) = (self.photons * job as usize / JOBS, self.photons * (job as usize + 1) / JOBS);
        for _ in first..last {
            trace_light(&caster, &mut Random(&mut stream), self.max_depth, ROULETTE_FROM, &mut path);
            // The first surface receives direct light, which the walks from the camera account for.
            for (edges, vertex) in path.vertices.iter().enumerate().skip(2) {
                let VertexKind::Surface(surface) = &vertex.kind else { continue };
                let met = scene.met(surface, surface.frame.to_local(vertex.back));
                if scene.bsdf(surface.bsdf).gathers(met) {
                    photons.push(Photon {
                        position: vertex.position,
                        back: vertex.back,
                        power: vertex.throughput / self.photons as f64,
                        word: vertex.word,
                        edges,
                    });
                }
            }
        }
        (photons, caster.rays())
    }

    fn gather(&self, scene: &Scene, grids: &Grids, gather: &Gather, band: &mut Band) {
        let Gather { surface, radius, .. } = gather;
        let wi = surface.frame.to_local(gather.back);
        let scale = gather.throughput / (PI * radius * radius);
        grids.within(surface.position, *radius, |photon| {
            let height = (photon.position - surface.position).dot(surface.geometric).abs();
            if height > FLATNESS * radius || photon.edges + gather.edges > self.max_depth {
                return;
            }
            let wo = surface.frame.to_local(photon.back);
            let Some(scattered) = scene.evaluate(surface, wi, wo, Walk::FromCamera) else { return };
            // Photons arrive per true area, scattering counts area seen along the shading normal.
            let geometric = photon.back.dot(surface.geometric).abs();
            let correction = if geometric > 0.0 { wo.z.abs() / geometric } else { 0.0 };
            let class = photon.word.then(scattered.letter).join(gather.word);
            band.add(gather.pixel, class, scale * scattered.value * photon.power * correction);
        });
    }
}

/// Grids whose cells double in size from one to the next. Radii grow with the distance from the camera; each is served
/// by the grid whose cells are just as wide as its disk, so that no gather looks at more than eight of them.
struct Grids {
    smallest: f64,
    /// By level; `None` where no radius has that size.
    levels: Vec<Option<Grid>>,
}

impl Grids {
    /// Most levels; smaller radii are served by cells that are larger than need be.
    const LEVELS: i32 = 24;

    fn new(photons: &[Photon], radii: impl Iterator<Item = f64> + Clone) -> Self {
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
    fn within(&self, center: DVec3, radius: f64, each: impl FnMut(&Photon)) {
        if let Some(Some(grid)) = self.levels.get(self.level(radius)) {
            grid.within(center, radius, each);
        }
    }
}

/// Photons sorted into the cells of a hashed grid.
struct Grid {
    /// Width of a cell.
    cell: f64,
    /// Where the photons of each bucket start; one more entry than there are buckets.
    starts: Vec<u32>,
    photons: Vec<Photon>,
}

impl Grid {
    fn new(unsorted: &[Photon], cell: f64) -> Self {
        let buckets = unsorted.len().next_power_of_two();
        let mut grid = Self { cell, starts: vec![0; buckets + 1], photons: unsorted.to_vec() };
        let bucket_of: Vec<usize> = unsorted.iter().map(|photon| grid.bucket(grid.cell_of(photon.position))).collect();
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
    fn within(&self, center: DVec3, radius: f64, mut each: impl FnMut(&Photon)) {
        let (low, high) = (self.cell_of(center - radius), self.cell_of(center + radius));
        for x in low.x..=high.x {
            for y in low.y..=high.y {
                for z in low.z..=high.z {
                    let cell = IVec3::new(x, y, z);
                    let bucket = self.bucket(cell);
                    let range = self.starts[bucket] as usize..self.starts[bucket + 1] as usize;
                    for photon in &self.photons[range] {
                        let near = photon.position.distance_squared(center) < radius * radius;
                        if near && self.cell_of(photon.position) == cell {
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
    use crate::math::warp::sphere;

    #[test]
    fn the_grid_finds_what_a_search_of_all_photons_finds() {
        let mut stream = Stream::new(1, &[]);
        let mut point =
            |scale: f64| DVec3::new(stream.number(), stream.number(), stream.number()) * scale - 0.5 * scale;
        let photons: Vec<Photon> = (0..5000)
            .map(|_| Photon {
                position: point(3.0),
                back: sphere::sample([0.2, 0.3]),
                power: Spectrum::ONE,
                word: Word::EMPTY,
                edges: 2,
            })
            .collect();
        let radii = [0.01, 0.1, 0.5, 1.0];
        let grids = Grids::new(&photons, radii.into_iter());
        for radius in radii {
            for _ in 0..50 {
                let center = point(3.5);
                let mut found = 0;
                grids.within(center, radius, |_| found += 1);
                let expected = photons.iter().filter(|p| p.position.distance(center) < radius).count();
                assert_eq!(found, expected);
            }
        }
    }
}
