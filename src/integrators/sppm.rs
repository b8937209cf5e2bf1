//! Stochastic progressive photon mapping (Hachisuka and Jensen 2009) in the form of Knaus and Zwicker (2011): the
//! radius shrinks by a rule that does not depend on what was found, so that every pass is an independent estimate and
//! the image is the mean over passes.
//!
//! A pass walks from the camera to the first diffuse-like vertex of each pixel. Light met on the way and direct light
//! are estimated as in path tracing. All other light is gathered from photons that met at least one surface before:
//! with N photons of power Φ and radius r, L = 1 / (N π r²) Σ f Φ. The class of a photon's path is the photon's word,
//! the letter of the gathering vertex for the two directions, and the word of the camera's walk.

use super::grid::{Grids, Located};
use super::path::{self, State, film_position};
use super::photons::{FIRST_RADIUS, JOBS, is_beside, job_range, shrinkage};
use super::{Counts, render::Settings};
use crate::film::{Band, Film, Kernel, Word};
use crate::math::{Stream, Walk};
use crate::paths::{Random, Subpath, VertexKind, trace_light};
use crate::scene::{Caster, Scene, Surface};
use crate::spectrum::Spectrum;
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::PI;

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

impl Located for Photon {
    #[inline]
    fn position(&self) -> DVec3 {
        self.position
    }
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
        self.shrink(pass);
    }

    /// What pass number `pass` leaves of the radius.
    pub(super) fn shrink(&mut self, pass: u64) {
        self.shrinkage *= shrinkage(pass);
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
        for _ in job_range(self.photons, job as usize) {
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

    fn gather(&self, scene: &Scene, grids: &Grids<Photon>, gather: &Gather, band: &mut Band) {
        let Gather { surface, radius, .. } = gather;
        let wi = surface.frame.to_local(gather.back);
        let scale = gather.throughput / (PI * radius * radius);
        grids.within(surface.position, *radius, |photon| {
            let beside = is_beside(photon.position - surface.position, surface.geometric, *radius);
            if !beside || photon.edges + gather.edges > self.max_depth {
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
