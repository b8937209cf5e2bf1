//! Path tracing from the camera with next event estimation, both weighted by the power heuristic (Veach 1997, sections
//! 9.2 and 10.3). One path per pixel and pass.

use super::{Counts, render::Settings};
use crate::bsdf::Scatter;
use crate::emitter::Start;
use crate::film::{Band, Film, Kernel, Word};
use crate::math::{Row, SolidAnglePdf, Stream, Walk};
use crate::paths::{direct_pdf, sample_direct};
use crate::scene::{Caster, Origin, Scene, Surface};
use crate::spectrum::Spectrum;
use glam::{DVec2, DVec3};

/// Bounces before Russian roulette sets in.
const ROULETTE_FROM: usize = 5;

/// The method's settings.
pub(super) struct Path {
    seed: u64,
    max_depth: usize,
}

impl Path {
    pub(super) fn start(settings: &Settings) -> Self {
        Self { seed: settings.seed, max_depth: settings.max_depth }
    }

    /// The light of paths with at most `max_depth` edges.
    pub(super) fn up_to(settings: &Settings, max_depth: usize) -> Self {
        Self { max_depth: max_depth.min(settings.max_depth), ..Self::start(settings) }
    }

    pub(super) fn pass(&self, scene: &Scene, film: &mut Film, pass: u64, counts: &mut Counts) {
        let kernel = film.kernel.clone();
        let size = film.size;
        let rays = film.for_each_band(|index, band| {
            let caster = Caster::new(scene);
            let mut stream = Stream::new(self.seed, &[pass, index as u64]);
            for pixel in band.pixels() {
                trace(&caster, &kernel, size, pixel, self.max_depth, &mut stream, band);
            }
            caster.rays()
        });
        counts.add((size[0] * size[1]) as u64, rays.iter().sum());
    }
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
    /// The walk through the film position `film`; the lens is sampled by `row`.
    #[inline]
    pub(super) fn at_camera(scene: &Scene, film: DVec2, row: Row) -> Self {
        let (origin, direction) = scene.camera.ray(film, row);
        Self { origin: origin.into(), direction, throughput: Spectrum::ONE, word: Word::EMPTY, pdf: None }
    }

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

#[inline]
fn trace(
    scene: &Caster<'_>,
    kernel: &Kernel,
    size: [usize; 2],
    pixel: [usize; 2],
    max_depth: usize,
    stream: &mut Stream,
    band: &mut Band,
) {
    let row = stream.row();
    let mut state = State::at_camera(scene, film_position(kernel, size, pixel, row), row);
    let mut alive = 1.0;
    for depth in 1..=max_depth {
        let Some(surface) = state.next(scene) else {
            background(scene, &state, pixel, band);
            return;
        };
        emission(scene, &surface, &state, pixel, band);
        if depth == max_depth {
            return;
        }
        let wi = surface.frame.to_local(-state.direction);
        let bsdf = scene.bsdf(surface.bsdf);
        if !bsdf.is_delta(scene.met(&surface, wi)) {
            direct(scene, &surface, wi, &state, true, stream, pixel, band);
        }
        let row = stream.row();
        let Some(scatter) = scene.scatter(&surface, wi, row, Walk::FromCamera) else { return };
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
pub(super) fn background(scene: &Caster<'_>, state: &State, pixel: [usize; 2], band: &mut Band) {
    let Some(id) = scene.environment().filter(|_| !scene.hide_emitters || state.word != Word::EMPTY) else { return };
    let start = Start::Infinite { towards: state.direction };
    let radiance = scene.emitter(id).radiance(&start, -state.direction);
    let weight = state.pdf.map_or(1.0, |pdf| power(pdf, direct_pdf(scene, id, &start, state.direction, 1.0)));
    band.add(pixel, state.word.class(), state.throughput * radiance * weight);
}

/// Light that the walk has met.
#[inline]
pub(super) fn emission(scene: &Caster<'_>, surface: &Surface, state: &State, pixel: [usize; 2], band: &mut Band) {
    let Some(id) = surface.emitter else { return };
    let start = Start::Surface { position: surface.position, normal: surface.geometric, uv: surface.spot.uv };
    let radiance = scene.emitter(id).radiance(&start, -state.direction);
    if radiance.is_black() {
        return;
    }
    let weight = state.pdf.map_or(1.0, |pdf| {
        let distance = surface.position.distance(state.origin.point);
        power(pdf, direct_pdf(scene, id, &start, state.direction, distance))
    });
    band.add(pixel, state.word.class(), state.throughput * radiance * weight);
}

/// Light that reaches the surface directly; `goes_on` says whether the walk could meet the same light later.
#[inline]
#[allow(clippy::too_many_arguments)]
pub(super) fn direct(
    scene: &Caster<'_>,
    surface: &Surface,
    wi: DVec3,
    state: &State,
    goes_on: bool,
    stream: &mut Stream,
    pixel: [usize; 2],
    band: &mut Band,
) {
    let Some(light) = sample_direct(scene, surface.position, stream.row()) else { return };
    let wo = surface.frame.to_local(light.direction);
    let Some(scattered) = scene.evaluate(surface, wi, wo, Walk::FromCamera) else { return };
    if !light.arrives(scene, surface.leave(light.direction)) {
        return;
    }
    let weight = light.pdf.filter(|_| goes_on).map_or(1.0, |pdf| power(pdf, scattered.pdf));
    let value = state.throughput * scattered.value * light.radiance * (wo.z.abs() * weight);
    band.add(pixel, state.word.preceded_by(scattered.letter).class(), value);
}

/// Power heuristic for a sample of density `own`, which another technique would have made with density `other`.
#[inline]
fn power(SolidAnglePdf(own): SolidAnglePdf, SolidAnglePdf(other): SolidAnglePdf) -> f64 {
    let ratio = other / own;
    1.0 / (1.0 + ratio * ratio)
}
