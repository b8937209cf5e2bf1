//! Bidirectional path tracing with all techniques (Veach 1997, chapter 10). A pass takes one walk from the camera and
//! one from a light per pixel; techniques with one light vertex sample a fresh one.

use super::path::film_position;
use super::{Counts, render::Settings};
use crate::film::{Band, Film, Kernel, Splats};
use crate::math::Stream;
use crate::paths::{
    Connection, Random, Subpath, Techniques, Vertex, connect, light_vertex_for, trace_camera, trace_light,
};
use crate::scene::{Caster, LightChoice, Scene};
use glam::DVec2;

/// Vertices of a subpath before Russian roulette sets in.
pub(super) const ROULETTE_FROM: usize = 5;

/// The method's settings.
pub(super) struct Bdpt {
    seed: u64,
    max_depth: usize,
    techniques: Techniques,
    lights: LightChoice,
}

/// What one job needs, reused from path to path.
struct Job<'a> {
    scene: Caster<'a>,
    kernel: &'a Kernel,
    size: [usize; 2],
    stream: Stream,
    camera: Subpath,
    light: Subpath,
    splats: Splats,
}

impl Bdpt {
    pub(super) fn start(settings: &Settings) -> Self {
        let Settings { seed, max_depth, heuristic, lights, .. } = *settings;
        Self { seed, max_depth, techniques: Techniques::connections(heuristic), lights }
    }

    pub(super) fn pass(&self, scene: &Scene, film: &mut Film, pass: u64, counts: &mut Counts) {
        let kernel = film.kernel.clone();
        let size = film.size;
        let jobs = film.for_each_band(|index, band| {
            let mut job = Job {
                scene: Caster::choosing(scene, self.lights),
                kernel: &kernel,
                size,
                stream: Stream::new(self.seed, &[pass, index as u64]),
                camera: Subpath::default(),
                light: Subpath::default(),
                splats: Splats::new(size),
            };
            for pixel in band.pixels() {
                job.sample(pixel, self, band);
            }
            (job.splats, job.scene.rays())
        });
        counts.add((size[0] * size[1]) as u64, jobs.iter().map(|job| job.1).sum());
        let splats: Vec<Splats> = jobs.into_iter().map(|job| job.0).collect();
        film.splat(&splats);
    }
}

impl Job<'_> {
    fn sample(&mut self, pixel: [usize; 2], bdpt: &Bdpt, band: &mut Band) {
        let max_depth = bdpt.max_depth;
        let first = self.stream.row();
        let film = film_position(self.kernel, self.size, pixel, first);
        let rows = &mut Random(&mut self.stream);
        trace_camera(&self.scene, film, first, rows, max_depth + 1, ROULETTE_FROM, &mut self.camera);
        // s = 0 takes all edges from the camera; t = 1 leaves one edge to the connection.
        trace_light(&self.scene, rows, max_depth, ROULETTE_FROM, &mut self.light);
        let Self { scene, kernel, stream, camera, light, splats, .. } = self;
        let (camera, light) = (&camera.vertices, &light.vertices);
        connect_all(scene, light, camera, 1, max_depth, &bdpt.techniques, stream, |found| match found.film {
            Some(film) => splats.add(kernel, film, found.class, found.value),
            None => band.add(pixel, found.class, found.value),
        });
    }
}

/// Connects all parts of `light` that have left the light with the lens, at a point of its own: film position and what is
/// found. `lens` is memory for the vertex there.
#[inline]
pub(super) fn connect_with_lens(
    scene: &Caster<'_>,
    light: &[Vertex],
    lens: &mut Subpath,
    techniques: &Techniques,
    stream: &mut Stream,
    mut add: impl FnMut(DVec2, Connection),
) {
    let row = stream.row();
    trace_camera(scene, DVec2::ZERO, row, &mut Random(stream), 1, ROULETTE_FROM, lens);
    for s in 2..=light.len() {
        let found = connect(scene, &light[..s], &lens.vertices, techniques);
        if let Some((found, film)) = found.and_then(|found| Some((found, found.film?))) {
            add(film, found);
        }
    }
}

/// Connects all parts of `light` with all parts of `camera` that have at least `least` vertices, up to paths of
/// `max_depth` edges.
#[inline]
#[allow(clippy::too_many_arguments)]
pub(super) fn connect_all(
    scene: &Caster<'_>,
    light: &[Vertex],
    camera: &[Vertex],
    least: usize,
    max_depth: usize,
    techniques: &Techniques,
    stream: &mut Stream,
    mut add: impl FnMut(Connection),
) {
    for t in least..=camera.len() {
        for s in 0..=light.len().min(max_depth + 1 - t) {
            if s + t < 2 {
                continue;
            }
            let fresh;
            let start = if s == 1 {
                // Lights that the camera sees are left to s = 0, and a walk may end in the environment.
                let Some(surface) = camera[t - 1].surface() else { continue };
                let Some(vertex) = light_vertex_for(scene, surface.position, stream.row()) else { continue };
                fresh = [vertex];
                &fresh[..]
            } else {
                &light[..s]
            };
            if let Some(found) = connect(scene, start, &camera[..t], techniques) {
                add(found);
            }
        }
    }
}
