//! Random walks.

use super::rows::Rows;
use super::subpath::{Subpath, Vertex, VertexKind};
use crate::bsdf::Scatter;
use crate::emitter::{Emitter, Start};
use crate::film::Word;
use crate::geometry::offset::OFFSET;
use crate::math::{AreaPdf, Row, SolidAnglePdf, Walk};
use crate::scene::{Caster, EmitterId, Origin, Surface};
use crate::spectrum::Spectrum;
use glam::{DVec2, DVec3};

/// Walks from the camera through the film position `film`, up to `vertices` vertices. `rows.row(0)` must have been
/// read by the caller, who made `film` of it, and is passed as `first`.
pub fn trace_camera(
    scene: &Caster<'_>,
    film: DVec2,
    first: Row,
    rows: &mut impl Rows,
    vertices: usize,
    roulette_from: usize,
    path: &mut Subpath,
) {
    path.vertices.clear();
    path.film = film;
    let (lens, direction) = scene.camera.ray(film, first);
    path.vertices.push(on_lens(lens));
    walk(scene, Walker::from_lens(lens, direction), Walk::FromCamera, rows, vertices, roulette_from, path);
}

/// Walks from a light, up to `vertices` vertices, of which the first lies on the light.
pub fn trace_light(
    scene: &Caster<'_>,
    rows: &mut impl Rows,
    vertices: usize,
    roulette_from: usize,
    path: &mut Subpath,
) {
    path.vertices.clear();
    if vertices == 0 {
        return;
    }
    let Some((id, start, pdf)) = &scene.sample_start(rows.row(0)) else { return };
    path.vertices.push(on_light(*id, *start, *pdf));
    if vertices == 1 {
        return;
    }
    let Some((origin, direction, weight)) = scene.emitter(*id).emit(start, rows.row(1)) else { return };
    let normal = if let Start::Surface { normal, .. } = start { *normal } else { DVec3::ZERO };
    let throughput = weight * path.vertices[0].throughput;
    let walker = Walker::start((origin + normal * light_offset(origin)).into(), direction, throughput);
    walk(scene, walker, Walk::FromLight, rows, vertices, roulette_from, path);
}

/// The only vertex of a light subpath for direct light at `point`.
#[inline]
pub fn light_vertex_for(scene: &Caster<'_>, point: DVec3, row: Row) -> Option<Vertex> {
    let (id, start, pdf, preference) = scene.sample_start_for(point, row)?;
    let vertex = on_light(id, start, pdf);
    // Densities are those of walks: weights account for the choice.
    Some(Vertex { forward: AreaPdf(pdf.0 / preference), preference, ..vertex })
}

/// The vertex where light starts, found with density `pdf`.
#[inline]
pub(super) fn on_light(id: EmitterId, start: Start, pdf: AreaPdf) -> Vertex {
    let position = match start {
        Start::Surface { position, .. } | Start::Point { position } => position,
        Start::Infinite { .. } | Start::Distant { .. } => DVec3::ZERO,
    };
    Vertex {
        kind: VertexKind::Light(id, start),
        position,
        back: DVec3::ZERO,
        throughput: Spectrum::ONE / pdf.0,
        forward: pdf,
        reverse: AreaPdf(0.0),
        connects: true,
        delta: false,
        word: Word::EMPTY,
        preference: 1.0,
    }
}

/// Distance by which rays are started off a light at `position`.
#[inline]
pub(super) fn light_offset(position: DVec3) -> f64 {
    4.0 * OFFSET * position.abs().max_element()
}

/// The end of a walk that goes on.
pub(super) struct Walker {
    pub origin: Origin,
    pub direction: DVec3,
    pub throughput: Spectrum,
    /// Density of `direction`; unused where a walk starts, where the density of the first surface is known at once.
    pub pdf: SolidAnglePdf,
    pub word: Word,
}

impl Walker {
    /// Leaves the point `lens` of the lens.
    pub(super) fn from_lens(lens: DVec3, direction: DVec3) -> Self {
        Self::start(lens.into(), direction, Spectrum::ONE)
    }

    /// Leaves a light or the lens.
    pub(super) fn start(origin: Origin, direction: DVec3, throughput: Spectrum) -> Self {
        Self { origin, direction, throughput, pdf: SolidAnglePdf(0.0), word: Word::EMPTY }
    }
}

/// The vertex at the point `lens` of the lens.
pub(super) fn on_lens(lens: DVec3) -> Vertex {
    Vertex {
        kind: VertexKind::Camera,
        position: lens,
        back: DVec3::ZERO,
        throughput: Spectrum::ONE,
        forward: AreaPdf(1.0),
        reverse: AreaPdf(0.0),
        connects: true,
        delta: false,
        word: Word::EMPTY,
        preference: 1.0,
    }
}

/// Extends `path`, whose first vertex is there, by `walker` and what it meets.
fn walk(
    scene: &Caster<'_>,
    mut walker: Walker,
    mode: Walk,
    rows: &mut impl Rows,
    vertices: usize,
    roulette_from: usize,
    path: &mut Subpath,
) {
    // Scattering at vertex i reads row i of a walk from the camera, row i + 1 of one from a light: row 1 is the emission.
    let row_shift = usize::from(mode == Walk::FromLight);
    let mut alive = 1.0;
    while path.vertices.len() < vertices {
        let last = path.vertices.len() - 1;
        let first = mode == Walk::FromCamera && last == 0;
        let found = match first {
            true => scene.see(walker.origin, walker.direction),
            false => scene.intersect(walker.origin, walker.direction),
        };
        let Some(surface) = &found else {
            if let (Walk::FromCamera, Some(id)) = (mode, scene.environment()) {
                path.vertices.push(environment_vertex(id, &walker));
            }
            return;
        };
        if let VertexKind::Light(id, _) = path.vertices[last].kind {
            path.vertices[last].preference = scene.preference(id, surface.position);
        }
        path.vertices.push(surface_vertex(scene, surface, &walker, &path.vertices[last]));
        if path.vertices.len() == vertices {
            return;
        }
        let back = -walker.direction;
        let wi = surface.frame.to_local(back);
        let row = rows.scattering_row(last + 1 + row_shift, scene, surface, wi);
        let Some(scatter) = &scene.scatter(surface, wi, row, mode) else { return };
        let direction = surface.frame.to_world(scatter.direction);
        let mut weight = scatter.weight * shading_correction(surface, back, direction, mode);
        // What remains of the walk's power; radiance that was squeezed by refraction is no loss.
        alive *= weight.max_element() * if mode == Walk::FromCamera { scatter.eta * scatter.eta } else { 1.0 };
        if rows.roulette() && last + 1 >= roulette_from {
            let survival = alive.min(0.95);
            if row[3] >= survival {
                return;
            }
            weight = weight / survival;
            alive /= survival;
        }
        if weight.is_black() {
            return;
        }
        walker = go_on(path, surface, scatter, weight, direction, mode);
    }
}

/// Leaves the last vertex of `path`, which lies on `surface`, along `direction`, where `weight` is what is left.
#[inline]
pub(super) fn go_on(
    path: &mut Subpath,
    surface: &Surface,
    scatter: &Scatter,
    weight: Spectrum,
    direction: DVec3,
    mode: Walk,
) -> Walker {
    let last = path.vertices.len() - 1;
    let vertex = &mut path.vertices[last];
    vertex.delta = scatter.delta;
    let (throughput, word) = (vertex.throughput * weight, vertex.word);
    path.vertices[last - 1].reverse = reverse_pdf(&path.vertices[last - 1], &path.vertices[last], scatter.pdf_reverse);
    let word = match mode {
        Walk::FromCamera => word.preceded_by(scatter.letter),
        Walk::FromLight => word.then(scatter.letter),
    };
    Walker { origin: surface.leave(direction), direction, throughput, pdf: scatter.pdf, word }
}

pub(super) fn environment_vertex(id: EmitterId, walker: &Walker) -> Vertex {
    Vertex {
        kind: VertexKind::Environment(id),
        position: walker.origin.point,
        back: -walker.direction,
        throughput: walker.throughput,
        forward: AreaPdf(walker.pdf.0),
        reverse: AreaPdf(0.0),
        connects: true,
        delta: false,
        word: walker.word,
        preference: 1.0,
    }
}

#[inline(always)]
pub(super) fn surface_vertex(scene: &Caster<'_>, surface: &Surface, walker: &Walker, previous: &Vertex) -> Vertex {
    let cos = surface.geometric.dot(walker.direction);
    let distance_squared = (surface.position - previous.position).length_squared();
    let forward = match &previous.kind {
        VertexKind::Light(id, start) => scene.emitter(*id).emit_pdf(start, walker.direction, cos, distance_squared),
        VertexKind::Camera => scene.camera.arrival_pdf(walker.direction, cos, distance_squared),
        _ => walker.pdf.to_area(cos, distance_squared),
    };
    let met = scene.met(surface, surface.frame.to_local(-walker.direction));
    Vertex {
        kind: VertexKind::Surface(*surface),
        position: surface.position,
        back: -walker.direction,
        throughput: walker.throughput,
        forward,
        reverse: AreaPdf(0.0),
        connects: !scene.bsdf(surface.bsdf).is_delta(met),
        delta: false,
        word: walker.word,
        preference: 1.0,
    }
}

/// Density of `vertex` for a walk that scatters at `next` towards it with density `pdf`.
#[inline]
pub(super) fn reverse_pdf(vertex: &Vertex, next: &Vertex, pdf: SolidAnglePdf) -> AreaPdf {
    let distance_squared = (vertex.position - next.position).length_squared();
    match &vertex.kind {
        VertexKind::Surface(surface) => pdf.to_area(surface.geometric.dot(next.back), distance_squared),
        VertexKind::Light(_, start) => Emitter::arrival_pdf(start, pdf, next.back, distance_squared),
        VertexKind::Environment(_) => AreaPdf(pdf.0),
        VertexKind::Camera => AreaPdf(0.0),
    }
}

/// Factor for walks from the light where the shading normal differs from the true one (Veach 1997, eq. 5.19):
/// |ω_i·n_s| |ω_o·n_g| / (|ω_i·n_g| |ω_o·n_s|) with ω_i back along the walk; the cosine with the shading normal that
/// the sampling weight holds is |ω_o·n_s|.
#[inline]
pub fn shading_correction(surface: &Surface, back: DVec3, onward: DVec3, mode: Walk) -> f64 {
    if mode == Walk::FromCamera || surface.frame.normal == surface.geometric {
        return 1.0;
    }
    let (shading, geometric) = (surface.frame.normal, surface.geometric);
    let denominator = (back.dot(geometric) * onward.dot(shading)).abs();
    if denominator == 0.0 { 0.0 } else { (back.dot(shading) * onward.dot(geometric)).abs() / denominator }
}
