//! Stochastic progressive photon mapping (Hachisuka and Jensen 2009) in the form of Knaus and Zwicker (2011): the
//! radius shrinks by a rule that does not depend on what was found, so that every pass is an independent estimate and
//! the image is the mean over passes.
//!
//! A pass walks from the camera to the first diffuse-like vertex of each pixel. Light met on the way and direct light
//! are estimated as in path tracing (direct light where photons are gathered by these, if the settings say so). All other
//! light is gathered from photons that met at least one surface before: with N photons of power Φ and radius r, L = 1 / (N π r²) Σ f Φ. The class of a photon's path is the photon's word,
//! the letter of the gathering vertex for the two directions, and the word of the camera's walk.

use super::grid::{Grids, Located};
use super::path::Job;
use super::photons::{JOBS, MOST_PHOTONS, is_beside, job_range, shrinkage};
use super::{Counts, render::Settings};
use crate::film::{Band, Film, Word};
use crate::math::{Stream, Walk};
use crate::paths::{Heuristic, Random, Subpath, VertexKind, trace_light};
use crate::scene::{Caster, LightChoice, Scene, Surface};
use crate::spectrum::Spectrum;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Vertices of a photon's path before Russian roulette sets in.
const ROULETTE_FROM: usize = 3;

/// The method's settings and the radius of the next pass.
pub(super) struct Sppm {
    seed: u64,
    max_depth: usize,
    heuristic: Heuristic,
    lights: LightChoice,
    sample_direct: bool,
    photons: usize,
    /// First radius in pixels.
    radius: f64,
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
    /// Unit direction back to where it came from, up to rounding: photons are many.
    back: Vec3,
    power: [f32; 3],
    word: Word,
    /// Edges from the light.
    edges: u32,
}

impl Located for Photon {
    #[inline]
    fn position(&self) -> DVec3 {
        self.position
    }
}

impl Sppm {
    pub(super) fn start(scene: &Scene, settings: &Settings) -> Self {
        let Settings { seed, max_depth, heuristic, lights, sample_direct, radius, .. } = *settings;
        let pixels: usize = scene.camera.size.iter().product();
        let photons = settings.photons.unwrap_or(pixels.min(MOST_PHOTONS)).max(1);
        Self { seed, max_depth, heuristic, lights, sample_direct, photons, radius, shrinkage: 1.0 }
    }

    pub(super) fn pass(&mut self, scene: &Scene, film: &mut Film, pass: u64, counts: &mut Counts) {
        let kernel = film.kernel.clone();
        let size = film.size;
        let walks = film.for_each_band(|index, band| {
            let mut job = Job {
                scene: Caster::choosing(scene, self.lights),
                kernel: &kernel,
                size,
                heuristic: self.heuristic,
                stream: Stream::new(self.seed, &[0, pass, index as u64]),
            };
            let mut gathers = Vec::new();
            for pixel in band.pixels() {
                self.walk(&mut job, pixel, band, &mut gathers);
            }
            (gathers, job.scene.rays())
        });
        let (photons, photon_rays): (Vec<Vec<Photon>>, Vec<u64>) =
            (0..JOBS).into_par_iter().map(|job| self.shoot(scene, pass, job as u64)).unzip();
        let rays = walks.iter().map(|walk| walk.1).chain(photon_rays).sum();
        let grids = Grids::new(&photons, walks.par_iter().flat_map_iter(|walk| &walk.0).map(|gather| gather.radius));
        film.for_each_band(|index, band| {
            for gather in &walks[index].0 {
                self.gather(scene, &grids, gather, band);
            }
        });
        counts.add((self.photons + size[0] * size[1]) as u64, rays);
        self.shrink(pass);
    }

    /// What pass number `pass` leaves of the radius.
    pub(super) fn shrink(&mut self, pass: u64) {
        self.shrinkage *= shrinkage(pass);
    }

    /// Walks from the camera to the first diffuse-like vertex, adding light met on the way and direct light. What such a
    /// vertex scatters by delta lobes is not gathered there: by these the walk goes on.
    fn walk(&self, job: &mut Job<'_>, pixel: [usize; 2], band: &mut Band, gathers: &mut Vec<Gather>) {
        let mut state = job.at_camera(pixel);
        let mut distance = 0.0;
        for edges in 1..=self.max_depth {
            let Some(surface) = state.next(&job.scene) else {
                job.background(&state, pixel, band);
                return;
            };
            distance += surface.position.distance(state.origin.point);
            job.emission(&surface, &state, pixel, band);
            if edges == self.max_depth {
                return;
            }
            let wi = surface.frame.to_local(-state.direction);
            let bsdf = job.scene.bsdf(surface.bsdf);
            let met = job.scene.met(&surface, wi);
            let (gathered, is_delta, has_delta) = (bsdf.gathers(met), bsdf.is_delta(met), bsdf.has_delta(met));
            if !is_delta && (self.sample_direct || !gathered) {
                job.direct(&surface, wi, &state, !gathered, pixel, band);
            }
            if gathered {
                gathers.push(Gather {
                    surface,
                    back: -state.direction,
                    throughput: state.throughput,
                    word: state.word,
                    edges,
                    radius: self.radius * self.shrinkage.sqrt() * job.scene.camera.pixel_width(distance),
                    pixel,
                });
                if !has_delta {
                    return;
                }
            }
            let row = job.stream.row();
            let Some(scatter) = job.scene.scatter(&surface, wi, row, Walk::FromCamera) else { return };
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
        for _ in job_range(self.photons, job as usize) {
            trace_light(&caster, &mut Random(&mut stream), self.max_depth, ROULETTE_FROM, &mut path);
            // The first surface receives direct light, which the walks from the camera may account for.
            let first = if self.sample_direct { 2 } else { 1 };
            for (edges, vertex) in path.vertices.iter().enumerate().skip(first) {
                let VertexKind::Surface(surface) = &vertex.kind else { continue };
                let met = scene.met(surface, surface.frame.to_local(vertex.back));
                if scene.bsdf(surface.bsdf).gathers(met) {
                    photons.push(Photon {
                        position: vertex.position,
                        back: vertex.back.as_vec3(),
                        power: (vertex.throughput / self.photons as f64).to_rgb().map(|power| power as f32),
                        word: vertex.word,
                        edges: edges as u32,
                    });
                }
            }
        }
        (photons, caster.rays())
    }

    fn gather(&self, scene: &Scene, grids: &Grids<Photon>, gather: &Gather, band: &mut Band) {
        let Gather { surface, radius, .. } = gather;
        let wi = surface.frame.to_local(gather.back);
        let scale = gather.throughput / (PI * radius * radius);
        grids.within(surface.position, *radius, |photon| {
            let beside = is_beside(photon.position - surface.position, surface.geometric, *radius);
            if !beside || photon.edges as usize + gather.edges > self.max_depth {
                return;
            }
            let back = photon.back.as_dvec3().normalize();
            let wo = surface.frame.to_local(back);
            let Some(scattered) = scene.evaluate(surface, wi, wo, Walk::FromCamera) else { return };
            // Photons arrive per true area, scattering counts area seen along the shading normal.
            let geometric = back.dot(surface.geometric).abs();
            let correction = if geometric > 0.0 { wo.z.abs() / geometric } else { 0.0 };
            let [r, g, b] = photon.power.map(f64::from);
            let class = photon.word.then(scattered.letter).join(gather.word);
            band.add(gather.pixel, class, scale * scattered.value * Spectrum::rgb(r, g, b) * correction);
        });
    }
}
