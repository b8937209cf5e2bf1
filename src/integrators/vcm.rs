//! Vertex connection and merging (Georgiev et al. 2012): bidirectional path tracing whose techniques include mergers of
//! light subpaths with camera subpaths that end close by, so that diffuse light, caustics and their mirror images are all
//! found by a technique that is good at them.
//!
//! A pass traces light subpaths, connects each with the lens and keeps their vertices; then it walks from the camera
//! through every pixel, connects with the vertices of one light subpath, and merges with those of all. The radius is the
//! same everywhere, as the weights need a density that depends on the path alone; it starts at what a pixel usually covers
//! and shrinks from pass to pass by the rule of Knaus and Zwicker (2011), so that passes are independent estimates.

use super::bdpt::{ROULETTE_FROM, connect_all, connect_with_lens};
use super::grid::{Grids, Located};
use super::path::film_position;
use super::photons::{JOBS, is_beside, job_range, shrinkage};
use super::{Counts, render::Settings};
use crate::film::{Film, Kernel, Splats};
use crate::math::Stream;
use crate::paths::{Heuristic, Random, Subpath, Techniques, Vertex, merge, trace_camera, trace_light};
use crate::scene::{Caster, LightChoice, Scene};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Most light subpaths of a pass by default: their vertices take some 350 bytes each.
const MOST_PATHS: usize = 1 << 17;

/// Pixels along an axis that are probed for the first radius.
const PROBES: usize = 64;

/// The method's settings and the radius of the next pass.
pub(super) struct Vcm {
    seed: u64,
    max_depth: usize,
    heuristic: Heuristic,
    lights: LightChoice,
    /// Light subpaths per pass.
    paths: usize,
    /// Radius of the next pass; 0 where nothing can be merged.
    radius: f64,
}

/// The light subpaths of one job, one after the other.
struct Bundle {
    vertices: Vec<Vertex>,
    /// Where each subpath ends.
    ends: Vec<usize>,
    splats: Splats,
    rays: u64,
}

impl Bundle {
    fn path(&self, index: usize) -> &[Vertex] {
        let start = if index == 0 { 0 } else { self.ends[index - 1] };
        &self.vertices[start..self.ends[index]]
    }
}

/// The end of a part of a light subpath that may be merged.
#[derive(Clone, Copy)]
struct Photon {
    position: DVec3,
    job: u32,
    /// Where the subpath starts, and one past the vertex itself.
    start: u32,
    end: u32,
}

impl Located for Photon {
    #[inline]
    fn position(&self) -> DVec3 {
        self.position
    }
}

impl Vcm {
    pub(super) fn start(scene: &Scene, settings: &Settings) -> Self {
        let pixels: usize = scene.camera.size.iter().product();
        let Settings { seed, max_depth, heuristic, lights, .. } = *settings;
        let radius = settings.radius * usual_footprint(scene, settings);
        let paths = settings.photons.unwrap_or(pixels.min(MOST_PATHS)).max(1);
        Self { seed, max_depth, heuristic, lights, paths, radius }
    }

    pub(super) fn pass(&mut self, scene: &Scene, film: &mut Film, pass: u64, counts: &mut Counts) {
        let (kernel, size) = (film.kernel.clone(), film.size);
        let pixels = size[0] * size[1];
        let merging = self.paths as f64 * PI * self.radius * self.radius;
        let techniques = Techniques { heuristic: Some(self.heuristic), merging };
        let bundles: Vec<Bundle> =
            (0..JOBS).into_par_iter().map(|job| self.shoot(scene, &kernel, size, &techniques, pass, job)).collect();
        let grids = (self.radius > 0.0).then(|| Grids::new(&photons(&bundles), rayon::iter::once(self.radius)));
        let rays = film.for_each_band(|index, band| {
            let caster = Caster::choosing(scene, self.lights);
            let mut stream = Stream::new(self.seed, &[0, pass, index as u64]);
            let mut camera = Subpath::default();
            for pixel in band.pixels() {
                let first = stream.row();
                let film = film_position(&kernel, size, pixel, first);
                let rows = &mut Random(&mut stream);
                trace_camera(&caster, film, first, rows, self.max_depth + 1, ROULETTE_FROM, &mut camera);
                let number = (pixel[1] * size[0] + pixel[0]) % self.paths;
                let light = path(&bundles, self.paths, number);
                connect_all(
                    &caster,
                    light,
                    &camera.vertices[..],
                    2,
                    self.max_depth,
                    &techniques,
                    &mut stream,
                    |found| {
                        band.add(pixel, found.class, found.value);
                    },
                );
                let Some(grids) = &grids else { continue };
                self.merge_all(&caster, grids, &bundles, &camera.vertices, &techniques, |found| {
                    band.add(pixel, found.class, found.value);
                });
            }
            caster.rays()
        });
        let rays = rays.iter().sum::<u64>() + bundles.iter().map(|bundle| bundle.rays).sum::<u64>();
        counts.add((self.paths + pixels) as u64, rays);
        let splats: Vec<Splats> = bundles.into_iter().map(|bundle| bundle.splats).collect();
        film.splat(&splats);
        self.shrink(pass);
    }

    /// What pass number `pass` leaves of the radius.
    pub(super) fn shrink(&mut self, pass: u64) {
        self.radius *= shrinkage(pass).sqrt();
    }

    /// The light subpaths of one job, connected with the lens.
    fn shoot(
        &self,
        scene: &Scene,
        kernel: &Kernel,
        size: [usize; 2],
        techniques: &Techniques,
        pass: u64,
        job: usize,
    ) -> Bundle {
        let caster = Caster::choosing(scene, self.lights);
        let mut stream = Stream::new(self.seed, &[1, pass, job as u64]);
        let mut light = Subpath::default();
        let mut lens = Subpath::default();
        let mut bundle = Bundle { vertices: Vec::new(), ends: Vec::new(), splats: Splats::new(size), rays: 0 };
        // Every pixel counts on one light subpath.
        let share = (size[0] * size[1]) as f64 / self.paths as f64;
        for _ in job_range(self.paths, job) {
            trace_light(&caster, &mut Random(&mut stream), self.max_depth, ROULETTE_FROM, &mut light);
            connect_with_lens(&caster, &light.vertices, &mut lens, techniques, &mut stream, |film, found| {
                bundle.splats.add(kernel, film, found.class, found.value * share);
            });
            bundle.vertices.extend_from_slice(&light.vertices);
            bundle.ends.push(bundle.vertices.len());
        }
        bundle.rays = caster.rays();
        bundle
    }

    /// Mergers of the photons around each vertex of a walk from the camera.
    fn merge_all(
        &self,
        scene: &Caster<'_>,
        grids: &Grids<Photon>,
        bundles: &[Bundle],
        camera: &[Vertex],
        techniques: &Techniques,
        mut add: impl FnMut(crate::paths::Connection),
    ) {
        for t in 2..=camera.len() {
            let end = &camera[t - 1];
            let Some(surface) = end.surface().filter(|_| end.connects) else { continue };
            grids.within(end.position, self.radius, |photon| {
                let beside = is_beside(photon.position - end.position, surface.geometric, self.radius);
                let light = &bundles[photon.job as usize].vertices[photon.start as usize..photon.end as usize];
                // Both subpaths hold the vertex: a path of s + t − 1 vertices has s + t − 2 edges.
                if !beside || light.len() + t - 2 > self.max_depth {
                    return;
                }
                if let Some(found) = merge(scene, light, &camera[..t], techniques) {
                    add(found);
                }
            });
        }
    }
}

/// Light subpath number `number` of all.
fn path(bundles: &[Bundle], paths: usize, number: usize) -> &[Vertex] {
    let guess = number * JOBS / paths;
    let job = if job_range(paths, guess).contains(&number) { guess } else { guess + 1 };
    bundles[job].path(number - job_range(paths, job).start)
}

/// The vertices of each bundle at which light subpaths may be merged.
fn photons(bundles: &[Bundle]) -> Vec<Vec<Photon>> {
    let of_bundle = |(job, bundle): (usize, &Bundle)| {
        let mut photons = Vec::new();
        let mut start = 0;
        for &end in &bundle.ends {
            for (index, vertex) in bundle.vertices[..end].iter().enumerate().skip(start + 1) {
                if vertex.connects {
                    let (job, start, end) = (job as u32, start as u32, index as u32 + 1);
                    photons.push(Photon { position: vertex.position, job, start, end });
                }
            }
            start = end;
        }
        photons
    };
    bundles.par_iter().enumerate().map(of_bundle).collect()
}

/// Median over the film of the size that a pixel has at the first vertex of its walk that can be merged; 0 where there is
/// none.
fn usual_footprint(scene: &Scene, settings: &Settings) -> f64 {
    let caster = Caster::new(scene);
    let [width, height] = scene.camera.size;
    let mut stream = Stream::new(settings.seed, &[2]);
    let mut camera = Subpath::default();
    let mut footprints = Vec::new();
    for y in 0..height.min(PROBES) {
        for x in 0..width.min(PROBES) {
            let place = |i: usize, pixels: usize| (i as f64 + 0.5) * pixels as f64 / pixels.min(PROBES) as f64;
            let film = DVec2::new(place(x, width), place(y, height));
            let first = stream.row();
            let rows = &mut Random(&mut stream);
            trace_camera(&caster, film, first, rows, settings.max_depth, ROULETTE_FROM, &mut camera);
            let mut distance = 0.0;
            for pair in camera.vertices.windows(2) {
                if pair[1].surface().is_none() {
                    break;
                }
                distance += pair[1].position.distance(pair[0].position);
                if pair[1].connects {
                    footprints.push(scene.camera.pixel_width(distance));
                    break;
                }
            }
        }
    }
    let middle = footprints.len() / 2;
    if footprints.is_empty() { 0.0 } else { *footprints.select_nth_unstable_by(middle, f64::total_cmp).1 }
}
