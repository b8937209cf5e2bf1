//! Connections of a light subpath with a camera subpath.

use super::mis::{self, Joint, Junction, Techniques};
use super::subpath::{Vertex, VertexKind};
use super::trace::{light_offset, reverse_pdf, shading_correction};
use crate::bsdf::Evaluation;
use crate::camera::Sight;
use crate::emitter::{Emitter, Start};
use crate::film::{PathClass, Word};
use crate::math::{AreaPdf, Walk};
use crate::scene::{Caster, EmitterId, Origin};
use crate::spectrum::Spectrum;
use glam::{DVec2, DVec3};

/// What a technique contributes.
#[derive(Clone, Copy, Debug)]
pub struct Connection {
    /// Weighted contribution over density.
    pub value: Spectrum,
    /// Class of the path.
    pub class: PathClass,
    /// Film position, where the technique finds it (t = 1); else it is that of the camera subpath.
    pub film: Option<DVec2>,
    /// What the other techniques need to know of it.
    pub junction: Junction,
}

/// Connects all of `light` (s vertices) with all of `camera` (t ≥ 1 vertices): value, weight and class of the path.
/// `None` where nothing is contributed.
#[inline]
pub fn connect(scene: &Caster<'_>, light: &[Vertex], camera: &[Vertex], techniques: &Techniques) -> Option<Connection> {
    connect_if::<false>(scene, light, camera, techniques)
}

/// [`connect`] for subpaths whose ends are known to see each other.
pub fn connect_visible(
    scene: &Caster<'_>,
    light: &[Vertex],
    camera: &[Vertex],
    techniques: &Techniques,
) -> Option<Connection> {
    connect_if::<true>(scene, light, camera, techniques)
}

/// [`connect`]; `VISIBLE` says whether the ends are known to see each other.
#[inline]
fn connect_if<const VISIBLE: bool>(
    scene: &Caster<'_>,
    light: &[Vertex],
    camera: &[Vertex],
    techniques: &Techniques,
) -> Option<Connection> {
    let end = camera.last()?;
    match (light.last(), &end.kind) {
        (None, _) => see_light(scene, camera, techniques),
        (Some(_), VertexKind::Environment(_)) => None,
        (Some(start), VertexKind::Camera) => reach_camera::<VISIBLE>(scene, light, start, camera, techniques),
        (Some(start), _) => join::<VISIBLE>(scene, light, start, camera, end, techniques),
    }
}

/// s = 0: the walk from the camera met a light.
fn see_light(scene: &Caster<'_>, camera: &[Vertex], techniques: &Techniques) -> Option<Connection> {
    let [.., previous, end] = camera else { return None };
    let (id, start) = match &end.kind {
        VertexKind::Environment(id) => (*id, Start::Infinite { towards: -end.back }),
        VertexKind::Surface(surface) => (surface.emitter?, surface.start()),
        _ => return None,
    };
    if scene.hide_emitters && camera.len() == 2 {
        return None;
    }
    let emitter = scene.emitter(id);
    let radiance = emitter.radiance(&start, end.back);
    if radiance.is_black() {
        return None;
    }
    let junction = Junction {
        camera: scene.start_pdf(id, &start).0,
        camera_previous: emitted_pdf(emitter, &start, previous, end.back, previous.position - end.position).0,
        preference: scene.preference(id, previous.position),
        ..Junction::default()
    };
    let weight =
        if camera.len() == 2 { 1.0 } else { mis::weight(&[], camera, &junction, Joint::Connected, techniques) };
    Some(Connection { value: end.throughput * radiance * weight, class: end.word.class(), film: None, junction })
}

/// Density, at `vertex`, of light that leaves `start` along `direction`.
#[inline]
fn emitted_pdf(emitter: &Emitter, start: &Start, vertex: &Vertex, direction: DVec3, offset: DVec3) -> AreaPdf {
    let cos = vertex.surface().map_or(1.0, |surface| surface.geometric.dot(direction));
    emitter.emit_pdf(start, direction, cos, offset.length_squared())
}

/// One end of a connection, seen along the connecting direction.
struct End {
    /// BSDF value times cosine for a surface; radiance times cosine for a light.
    value: Spectrum,
    /// Density of the connecting direction, in a walk that comes from this end's side.
    onward: Onward,
    /// Density of the predecessor of this end, in a walk that comes over the connection.
    previous: f64,
    /// Letters up to and with this end.
    word: Word,
    /// Where the connecting ray starts.
    origin: Origin,
}

/// How the other end's density follows from this end.
enum Onward {
    Direction(crate::math::SolidAnglePdf),
    Light(EmitterId, Start),
}

/// The end of a subpath, for a connection that leaves it along `direction`.
#[inline]
fn end_of(scene: &Caster<'_>, vertices: &[Vertex], direction: DVec3, walk: Walk) -> Option<End> {
    let end = vertices.last()?;
    match &end.kind {
        VertexKind::Light(id, start) => {
            let value = scene.emitter(*id).radiance(start, direction);
            let (cos, normal) = match start {
                Start::Surface { normal, .. } => (normal.dot(direction), *normal),
                _ => (1.0, DVec3::ZERO),
            };
            let origin = (end.position + normal * light_offset(end.position)).into();
            let onward = Onward::Light(*id, *start);
            (!value.is_black()).then_some(End { value: value * cos, onward, previous: 0.0, word: Word::EMPTY, origin })
        }
        VertexKind::Surface(surface) => {
            let (wi, wo) = (surface.frame.to_local(end.back), surface.frame.to_local(direction));
            let Evaluation { value, pdf, pdf_reverse, letter } = scene.evaluate(surface, wi, wo, walk)?;
            let correction = shading_correction(surface, end.back, direction, walk);
            let previous = &vertices[vertices.len() - 2];
            let word = match walk {
                Walk::FromCamera => end.word.preceded_by(letter),
                Walk::FromLight => end.word.then(letter),
            };
            Some(End {
                value: value * (wo.z.abs() * correction),
                onward: Onward::Direction(pdf),
                previous: reverse_pdf(previous, end, pdf_reverse).0,
                word,
                origin: surface.leave(direction),
            })
        }
        VertexKind::Camera | VertexKind::Environment(_) => None,
    }
}

/// Density of `vertex` in a walk that comes over the connection along `direction`.
#[inline]
fn arrival(scene: &Caster<'_>, onward: &Onward, vertex: &Vertex, direction: DVec3, distance_squared: f64) -> f64 {
    let cos = vertex.surface().map_or(1.0, |surface| surface.geometric.dot(direction));
    match (onward, &vertex.kind) {
        (Onward::Light(id, start), _) => scene.emitter(*id).emit_pdf(start, direction, cos, distance_squared).0,
        (Onward::Direction(pdf), VertexKind::Light(_, start)) => {
            Emitter::arrival_pdf(start, *pdf, direction, distance_squared).0
        }
        (Onward::Direction(pdf), _) => pdf.to_area(cos, distance_squared).0,
    }
}

/// s ≥ 1, t ≥ 2: both ends on surfaces, or the light's end on a light.
#[inline]
fn join<const VISIBLE: bool>(
    scene: &Caster<'_>,
    light: &[Vertex],
    start: &Vertex,
    camera: &[Vertex],
    end: &Vertex,
    techniques: &Techniques,
) -> Option<Connection> {
    if !start.connects || !end.connects {
        return None;
    }
    let infinite = match &start.kind {
        VertexKind::Light(_, Start::Infinite { towards } | Start::Distant { towards }) => Some(*towards),
        _ => None,
    };
    let offset = start.position - end.position;
    let (to_light, distance_squared) = match infinite {
        Some(towards) => (towards, 1.0),
        None => (offset.normalize(), offset.length_squared()),
    };
    let Some(camera_end) = &end_of(scene, camera, to_light, Walk::FromCamera) else { return None };
    let Some(light_end) = &end_of(scene, light, -to_light, Walk::FromLight) else { return None };
    let value = start.throughput * light_end.value * camera_end.value * end.throughput / distance_squared;
    if value.is_black() {
        return None;
    }
    let clear = || match infinite {
        Some(towards) => scene.escapes(camera_end.origin, towards),
        None => scene.visible(camera_end.origin, light_end.origin.point),
    };
    if !(VISIBLE || clear()) {
        return None;
    }
    let junction = Junction {
        light: arrival(scene, &camera_end.onward, start, to_light, distance_squared),
        light_previous: light_end.previous,
        camera: arrival(scene, &light_end.onward, end, -to_light, distance_squared),
        camera_previous: camera_end.previous,
        preference: light[0].preference,
    };
    let weight = mis::weight(light, camera, &junction, Joint::Connected, techniques);
    Some(Connection { value: value * weight, class: light_end.word.join(camera_end.word), film: None, junction })
}

/// t = 1: the walk from the light is connected with the lens.
fn reach_camera<const VISIBLE: bool>(
    scene: &Caster<'_>,
    light: &[Vertex],
    start: &Vertex,
    camera: &[Vertex],
    techniques: &Techniques,
) -> Option<Connection> {
    // Lights seen directly are left to the walk from the camera, which finds every one of them.
    if light.len() == 1 {
        return None;
    }
    if !start.connects || matches!(start.kind, VertexKind::Light(_, Start::Infinite { .. } | Start::Point { .. })) {
        return None;
    }
    let Sight { lens, direction, film, density } = scene.camera.sight(camera[0].position, start.position)?;
    let light_end = end_of(scene, light, -direction, Walk::FromLight)?;
    let value = start.throughput * light_end.value * density;
    if value.is_black() || !(VISIBLE || scene.seen(light_end.origin, start.surface(), lens)) {
        return None;
    }
    let normal = match &start.kind {
        VertexKind::Light(_, Start::Surface { normal, .. }) => *normal,
        VertexKind::Surface(surface) => surface.geometric,
        _ => return None,
    };
    let junction = Junction {
        light: density * normal.dot(direction).abs(),
        light_previous: light_end.previous,
        preference: light[0].preference,
        ..Junction::default()
    };
    let weight = mis::weight(light, camera, &junction, Joint::Connected, techniques);
    Some(Connection { value: value * weight, class: light_end.word.class(), film: Some(film), junction })
}
