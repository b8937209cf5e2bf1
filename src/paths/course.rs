//! A path by its vertices alone, and the same path as a technique finds it.
//!
//! Mutations in path space move vertices and ask what the path contributes then. A [`Course`] is what they move: vertices,
//! and which of them scatter by a delta lobe. [`FullPath::assemble`] makes subpaths of it again, with the densities and
//! throughputs that walks by the rows of that path would have, but without casting a ray.

use super::full::FullPath;
use super::mis::Junction;
use super::subpath::{Subpath, Vertex, VertexKind};
use super::trace::{
    Walker, environment_vertex, go_on, light_offset, on_lens, on_light, shading_correction, surface_vertex,
};
use crate::bsdf::Scatter;
use crate::emitter::Start;
use crate::math::Walk;
use crate::scene::{Caster, EmitterId, Origin, Scene, Surface};
use crate::spectrum::Spectrum;
use glam::{DVec2, DVec3};

/// How far off a point of a light may be met, relative to the distance.
const SAME: f64 = 1e-7;

/// A vertex of a path, whatever walk has found it.
#[derive(Clone, Copy, Debug)]
pub struct Node {
    /// What it lies on; x_0 always on a light, x_k on the camera.
    pub kind: VertexKind,
    /// Its position; of no meaning for light from infinity.
    pub position: DVec3,
    /// Whether it scatters by a delta lobe.
    pub delta: bool,
    /// Whether it is a vertex of a chain, which follows when the chain's ends move: a delta vertex, or nearly one.
    pub linked: bool,
}

impl Node {
    /// The vertex at a point of a surface.
    pub const fn on(surface: Surface, delta: bool) -> Self {
        Self { position: surface.position, kind: VertexKind::Surface(surface), delta, linked: delta }
    }

    /// The vertex where light starts.
    pub const fn light(id: EmitterId, start: Start) -> Self {
        let position = match start {
            Start::Surface { position, .. } | Start::Point { position } => position,
            Start::Infinite { .. } | Start::Distant { .. } => DVec3::ZERO,
        };
        Self { kind: VertexKind::Light(id, start), position, delta: false, linked: false }
    }

    /// The vertex on the lens.
    pub const fn lens(position: DVec3) -> Self {
        Self { kind: VertexKind::Camera, position, delta: false, linked: false }
    }

    /// Its surface, of one that scatters.
    pub fn surface(&self) -> Option<&Surface> {
        match &self.kind {
            VertexKind::Surface(surface) => Some(surface),
            _ => None,
        }
    }

    /// Unit vector towards the light, where that comes from infinity.
    pub const fn infinite(&self) -> Option<DVec3> {
        match self.kind {
            VertexKind::Light(_, Start::Infinite { towards } | Start::Distant { towards }) => Some(towards),
            _ => None,
        }
    }

    /// Normal of the true surface, if it lies on one.
    pub const fn normal(&self) -> Option<DVec3> {
        match &self.kind {
            VertexKind::Surface(surface) => Some(surface.geometric),
            VertexKind::Light(_, Start::Surface { normal, .. }) => Some(*normal),
            _ => None,
        }
    }

    /// Cosine between `direction` and the normal, without sign; 1 where there is none.
    pub fn cos(&self, direction: DVec3) -> f64 {
        self.normal().map_or(1.0, |normal| normal.dot(direction).abs())
    }

    /// Where a ray starts that leaves it along `direction`.
    pub fn leave(&self, direction: DVec3) -> Origin {
        match &self.kind {
            VertexKind::Surface(surface) => surface.leave(direction),
            VertexKind::Light(_, Start::Surface { position, normal, .. }) => {
                (*position + *normal * light_offset(*position)).into()
            }
            _ => self.position.into(),
        }
    }
}

/// The vertices x_0 … x_k of a path.
#[derive(Clone, Debug, Default)]
pub struct Course {
    /// The vertices, from the light to the lens.
    pub nodes: Vec<Node>,
    /// What a walk from the camera meets at x_0, where that is known.
    pub lit: Option<Surface>,
    /// Film position.
    pub film: DVec2,
}

impl Course {
    /// Its length k.
    pub fn edges(&self) -> usize {
        self.nodes.len() - 1
    }

    /// Becomes the course of `path`; says whether it could.
    pub fn follow(&mut self, path: &FullPath) -> bool {
        self.nodes.clear();
        self.film = path.film;
        let Some((id, start)) = path.start() else { return false };
        self.lit = path.vertex(0).surface().copied();
        self.nodes.push(Node::light(id, start));
        self.nodes.extend((1..=path.edges()).map(|m| {
            let vertex = path.vertex(m);
            let delta = path.scatters_delta(m);
            Node { kind: vertex.kind, position: vertex.position, delta, linked: delta }
        }));
        true
    }

    /// Becomes a course of `edges` edges that ends as the camera's `walk` begins; the vertices before are yet to be set.
    pub fn begin(&mut self, walk: &Subpath, edges: usize) {
        let node = |vertex: &Vertex| {
            let Vertex { kind, position, delta, .. } = *vertex;
            Node { kind, position, delta, linked: delta }
        };
        (self.film, self.lit) = (walk.film, None);
        self.nodes.clear();
        self.nodes.resize(edges + 1 - walk.vertices.len(), Node::lens(DVec3::ZERO));
        self.nodes.extend(walk.vertices.iter().rev().map(node));
    }

    /// Unit vector from x_m to x_{m+1}.
    pub fn direction(&self, scene: &Scene, m: usize) -> Option<DVec3> {
        let (from, to) = (&self.nodes[m], &self.nodes[m + 1]);
        match (from.infinite(), &to.kind) {
            (Some(towards), _) => Some(-towards),
            (None, VertexKind::Camera) => Some(-scene.camera.sight(to.position, from.position)?.direction),
            _ => (to.position - from.position).try_normalize(),
        }
    }

    /// Sets the film position, and where the camera has no lens the end of the path, to what the camera sees of x_{k-1};
    /// `None` where it does not.
    pub fn look(&mut self, scene: &Scene) -> Option<()> {
        let k = self.edges();
        let sight = scene.camera.sight(self.nodes[k].position, self.nodes[k - 1].position)?;
        (self.film, self.nodes[k]) = (sight.film, Node::lens(sight.lens));
        Some(())
    }

    /// Finds what a walk from the camera meets at x_0, if that is not known; `None` where it meets something else.
    pub fn light_up(&mut self, scene: &Caster<'_>) -> Option<()> {
        let (light, next) = (&self.nodes[0], &self.nodes[1]);
        let VertexKind::Light(id, Start::Surface { .. }) = light.kind else { return Some(()) };
        if self.lit.is_some() {
            return Some(());
        }
        let offset = light.position - next.position;
        let direction = offset.try_normalize()?;
        let met = scene.intersect(next.leave(direction), direction)?;
        let is_there = met.emitter == Some(id) && met.position.distance(light.position) <= SAME * offset.length();
        self.lit = is_there.then_some(met);
        self.lit.map(|_| ())
    }

    /// Whether nothing lies between x_m and x_{m+1}.
    pub fn sees(&self, scene: &Caster<'_>, m: usize) -> bool {
        let (from, to) = (&self.nodes[m], &self.nodes[m + 1]);
        let Some(direction) = self.direction(scene, m) else { return false };
        if from.infinite().is_some() {
            return scene.escapes(to.leave(-direction), -direction);
        }
        match to.kind {
            VertexKind::Camera => {
                // A light that is hidden from the camera has no surface to it.
                let surface = if m == 0 { None } else { from.surface() };
                scene.seen(from.leave(direction), surface, to.position)
            }
            _ => scene.visible(to.leave(-direction), from.leave(direction).point),
        }
    }
}

impl FullPath {
    /// Becomes the path `course` as the technique with `s` light vertices finds it; `None` where it cannot. Whether the
    /// vertices see each other is left to the caller, and so is their connection.
    pub fn assemble(&mut self, scene: &Caster<'_>, course: &Course, s: usize) -> Option<()> {
        (self.film, self.junction) = (course.film, Junction::default());
        light_subpath(scene, course, s, &mut self.light)?;
        camera_subpath(scene, course, s, &mut self.camera)
    }

    /// Density of the technique by which its subpaths were found, as a product of those of the vertices. That of a delta
    /// lobe is its probability, and the density of the vertex after it is as if that probability were one of directions.
    pub fn density(&self) -> f64 {
        let lens = 1;
        let vertices = self.light.vertices.iter().chain(self.camera.vertices.iter().skip(lens));
        vertices.map(|vertex| vertex.forward.0).product()
    }
}

/// The light subpath, x_0 … x_{s-1}.
fn light_subpath(scene: &Caster<'_>, course: &Course, s: usize, path: &mut Subpath) -> Option<()> {
    path.vertices.clear();
    if s == 0 {
        return Some(());
    }
    let VertexKind::Light(id, start) = course.nodes[0].kind else { return None };
    let pdf = scene.start_pdf(id, &start);
    let vertex = on_light(id, start, pdf);
    path.vertices.push(vertex);
    if s == 1 {
        return (pdf.0 > 0.0).then_some(());
    }
    let (light, first) = (&course.nodes[0], &course.nodes[1]);
    let direction = course.direction(scene, 0)?;
    let distance_squared =
        if light.infinite().is_some() { 1.0 } else { light.position.distance_squared(first.position) };
    let emitter = scene.emitter(id);
    let arrival = first.normal()?.dot(direction);
    // Radiance times the geometric term over the density of where it arrives.
    let emitted = emitter.emit_pdf(&start, direction, arrival, distance_squared);
    let geometric_term = light.cos(direction) * arrival.abs() / distance_squared;
    let weight = emitter.radiance(&start, direction) * (geometric_term / emitted.0);
    if !(pdf.0 > 0.0 && emitted.0 > 0.0) || weight.is_black() {
        return None;
    }
    let walker = Walker::start(light.leave(direction), direction, weight * vertex.throughput);
    walk(scene, walker, Walk::FromLight, course, 1..s, path)?;
    let VertexKind::Light(id, _) = path.vertices[0].kind else { return None };
    path.vertices[0].preference = scene.preference(id, first.position);
    Some(())
}

/// The camera subpath, x_k … x_s.
fn camera_subpath(scene: &Caster<'_>, course: &Course, s: usize, path: &mut Subpath) -> Option<()> {
    path.vertices.clear();
    path.film = course.film;
    let k = course.edges();
    let lens = course.nodes[k].position;
    path.vertices.push(on_lens(lens));
    if s == k {
        return Some(());
    }
    let walker = Walker::from_lens(lens, -course.direction(scene, k - 1)?);
    walk(scene, walker, Walk::FromCamera, course, (s..k).rev(), path)
}

/// Extends `path` by `walker` and the vertices of `course` with these numbers.
fn walk(
    scene: &Caster<'_>,
    mut walker: Walker,
    mode: Walk,
    course: &Course,
    numbers: impl Iterator<Item = usize> + Clone,
    path: &mut Subpath,
) -> Option<()> {
    let mut rest = numbers;
    while let Some(m) = rest.next() {
        let surface = if m == 0 {
            match course.nodes[0].kind {
                VertexKind::Light(id, Start::Infinite { .. }) => {
                    path.vertices.push(environment_vertex(id, &walker));
                    return Some(());
                }
                _ => course.lit.as_ref()?,
            }
        } else {
            course.nodes[m].surface()?
        };
        let last = path.vertices.len() - 1;
        let vertex = surface_vertex(scene, surface, &walker, &path.vertices[last]);
        path.vertices.push(vertex);
        if rest.clone().next().is_none() {
            return Some(());
        }
        let direction = match mode {
            Walk::FromLight => course.direction(scene, m)?,
            Walk::FromCamera => -course.direction(scene, m - 1)?,
        };
        let scatter = scatter_to(scene, surface, vertex.back, direction, course.nodes[m].delta, mode)?;
        let weight = scatter.weight * shading_correction(surface, vertex.back, direction, mode);
        if weight.is_black() {
            return None;
        }
        walker = go_on(path, surface, &scatter, weight, direction, mode);
    }
    Some(())
}

/// Scattering at `surface` from `back` along `direction`, as a walk would have sampled it.
fn scatter_to(
    scene: &Scene,
    surface: &Surface,
    back: DVec3,
    direction: DVec3,
    delta: bool,
    walk: Walk,
) -> Option<Scatter> {
    let (wi, wo) = (surface.frame.to_local(back), surface.frame.to_local(direction));
    if delta {
        let row = scene.invert_scatter(surface, wi, wo, true, [0.5; 4])?;
        let scatter = scene.scatter(surface, wi, row, walk)?;
        // Rounding aside, it is the direction that was asked for; else the model has no such lobe here.
        return (scatter.delta && scatter.direction.distance_squared(wo) < 1e-10).then_some(scatter);
    }
    let found = scene.evaluate(surface, wi, wo, walk)?;
    let weight: Spectrum = found.value * (wo.z.abs() / found.pdf.0);
    let scatter = Scatter {
        direction: wo,
        weight,
        pdf: found.pdf,
        pdf_reverse: found.pdf_reverse,
        delta: false,
        letter: found.letter,
        eta: 1.0,
    };
    (found.pdf.0 > 0.0).then_some(scatter)
}
