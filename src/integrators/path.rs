//! Path tracing from the camera with next event estimation, both weighted by the power or the balance heuristic (Veach
//! 1997, sections 9.2 and 10.3). One path per pixel and pass.

use super::{Counts, render::Settings};
use crate::bsdf::Scatter;
use crate::emitter::Start;
use crate::film::{Band, Film, Kernel, Word};
use crate::math::{Row, SolidAnglePdf, Stream, Walk};
use crate::paths::{Heuristic, direct_pdf, sample_direct};
use crate::scene::{Caster, EmitterId, LightChoice, Origin, Scene, Surface};
use crate::spectrum::Spectrum;
use glam::{DVec2, DVec3};

/// Bounces before Russian roulette sets in.
const ROULETTE_FROM: usize = 5;

/// The method's settings.
pub(super) struct Path {
    seed: u64,
    max_depth: usize,
    heuristic: Heuristic,
    lights: LightChoice,
}

impl Path {
    pub(super) fn start(settings: &Settings) -> Self {
        let Settings { seed, max_depth, heuristic, lights, .. } = *settings;
        Self { seed, max_depth, heuristic, lights }
    }

    /// The light of paths with at most `max_depth` edges.
    pub(super) fn up_to(settings: &Settings, max_depth: usize) -> Self {
        Self { max_depth: max_depth.min(settings.max_depth), ..Self::start(settings) }
    }

    pub(super) fn pass(&self, scene: &Scene, film: &mut Film, pass: u64, counts: &mut Counts) {
        let kernel = film.kernel.clone();
        let size = film.size;
        let rays = film.for_each_band(|index, band| {
            let mut job = Job {
                scene: Caster::choosing(scene, self.lights),
                kernel: &kernel,
                size,
                heuristic: self.heuristic,
                stream: Stream::new(self.seed, &[pass, index as u64]),
            };
            for pixel in band.pixels() {
                job.trace(pixel, self.max_depth, band);
            }
            job.scene.rays()
        });
        counts.add((size[0] * size[1]) as u64, rays.iter().sum());
    }
}

/// What walks from the camera need that keep no vertices.
pub(super) struct Job<'a> {
    pub scene: Caster<'a>,
    pub kernel: &'a Kernel,
    pub size: [usize; 2],
    pub heuristic: Heuristic,
    pub stream: Stream,
}

/// Film position for a pixel, from the first two numbers of a row.
#[inline]
pub(super) fn film_position(kernel: &Kernel, size: [usize; 2], pixel: [usize; 2], row: [f64; 4]) -> DVec2 {
    DVec2::new(kernel.sample(row[0], pixel[0], size[0]), kernel.sample(row[1], pixel[1], size[1]))
}

/// The end of a walk from the camera.
pub(super) struct State {
    pub origin: Origin,
    pub direction: DVec3,
    pub throughput: Spectrum,
    pub word: Word,
    /// Density of `direction`; `None` after a delta lobe or from the camera: then light met has no other technique.
    pub pdf: Option<SolidAnglePdf>,
}

impl State {
    /// What the walk meets next.
    #[inline]
    pub(super) fn next(&self, scene: &Caster<'_>) -> Option<Surface> {
        if self.word == Word::EMPTY {
            scene.see(self.origin, self.direction)
        } else {
            scene.intersect(self.origin, self.direction)
        }
    }

    /// The walk after `scatter` at `surface`, weighted by `weight`.
    #[inline]
    pub(super) fn scattered(self, surface: &Surface, scatter: &Scatter, weight: Spectrum) -> Self {
        let direction = surface.frame.to_world(scatter.direction);
        Self {
            origin: surface.leave(direction),
            direction,
            throughput: self.throughput * weight,
            word: self.word.preceded_by(scatter.letter),
            pdf: (!scatter.delta).then_some(scatter.pdf),
        }
    }
}

impl Job<'_> {
    /// A walk through `pixel`.
    #[inline]
    pub(super) fn at_camera(&mut self, pixel: [usize; 2]) -> State {
        let row: Row = self.stream.row();
        let (origin, direction) = self.scene.camera.ray(film_position(self.kernel, self.size, pixel, row), row);
        State { origin: origin.into(), direction, throughput: Spectrum::ONE, word: Word::EMPTY, pdf: None }
    }

    #[inline]
    fn trace(&mut self, pixel: [usize; 2], max_depth: usize, band: &mut Band) {
        let mut state = self.at_camera(pixel);
        let mut alive = 1.0;
        for depth in 1..=max_depth {
            let Some(surface) = state.next(&self.scene) else {
                self.background(&state, pixel, band);
                return;
            };
            self.emission(&surface, &state, pixel, band);
            if depth == max_depth {
                return;
            }
            let wi = surface.frame.to_local(-state.direction);
            if !self.scene.bsdf(surface.bsdf).is_delta(self.scene.met(&surface, wi)) {
                self.direct(&surface, wi, &state, true, pixel, band);
            }
            let row = self.stream.row();
            let Some(scatter) = self.scene.scatter(&surface, wi, row, Walk::FromCamera) else { return };
            let mut weight = scatter.weight;
            alive *= weight.max_element() * scatter.eta * scatter.eta;
            if depth >= ROULETTE_FROM {
                let survival = f64::min(alive, 0.95);
                if row[3] >= survival {
                    return;
                }
                weight = weight / survival;
                alive /= survival;
            }
            state = state.scattered(&surface, &scatter, weight);
        }
    }

    /// Light from the environment, where the walk has left the scene.
    #[inline]
    pub(super) fn background(&self, state: &State, pixel: [usize; 2], band: &mut Band) {
        let scene = &self.scene;
        let hidden = scene.hide_emitters && state.word == Word::EMPTY;
        let Some(id) = scene.environment().filter(|_| !hidden) else { return };
        let start = Start::Infinite { towards: state.direction };
        let radiance = scene.emitter(id).radiance(&start, -state.direction);
        band.add(pixel, state.word.class(), state.throughput * radiance * self.weight_of_hit(state, id, &start));
    }

    /// Light that the walk has met.
    #[inline]
    pub(super) fn emission(&self, surface: &Surface, state: &State, pixel: [usize; 2], band: &mut Band) {
        let Some(id) = surface.emitter else { return };
        let start = surface.start();
        let radiance = self.scene.emitter(id).radiance(&start, -state.direction);
        if radiance.is_black() {
            return;
        }
        band.add(pixel, state.word.class(), state.throughput * radiance * self.weight_of_hit(state, id, &start));
    }

    /// Weight of light that a walk has met at `start`.
    #[inline]
    fn weight_of_hit(&self, state: &State, id: EmitterId, start: &Start) -> f64 {
        state.pdf.map_or(1.0, |pdf| {
            self.weight(pdf, direct_pdf(&self.scene, state.origin.point, id, start, state.direction))
        })
    }

    /// Light that reaches the surface directly; `goes_on` says whether the walk could meet the same light later.
    #[inline]
    pub(super) fn direct(
        &mut self,
        surface: &Surface,
        wi: DVec3,
        state: &State,
        goes_on: bool,
        pixel: [usize; 2],
        band: &mut Band,
    ) {
        let scene = &self.scene;
        let Some(light) = sample_direct(scene, surface.position, self.stream.row()) else { return };
        let wo = surface.frame.to_local(light.direction);
        let Some(scattered) = scene.evaluate(surface, wi, wo, Walk::FromCamera) else { return };
        if !light.arrives(scene, surface.leave(light.direction)) {
            return;
        }
        let weight = light.pdf.filter(|_| goes_on).map_or(1.0, |pdf| self.weight(pdf, scattered.pdf));
        let value = state.throughput * scattered.value * light.radiance * (wo.z.abs() * weight);
        band.add(pixel, state.word.preceded_by(scattered.letter).class(), value);
    }

    /// Weight of a sample of density `own`, which another technique would have made with density `other`.
    #[inline]
    fn weight(&self, SolidAnglePdf(own): SolidAnglePdf, SolidAnglePdf(other): SolidAnglePdf) -> f64 {
        1.0 / (1.0 + self.heuristic.apply(other / own))
    }
}
