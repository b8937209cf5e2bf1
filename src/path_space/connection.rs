//! The connection over a manifold: the light's end of a path is left out, and a vertex that stays is linked with a new point
//! of a light through smooth boundaries, by a walk on the manifold (Hanika, Droske and Fascione 2015, "Manifold Next Event
//! Estimation"). So a chain comes upon caustics that walks hardly ever find.
//!
//! x_0 … x_{d-1} are replaced by as many vertices. With probability 1/2 they are a point of a light, drawn as for direct
//! light, and the chain to which a seed walks: the straight way there, bent where it meets boundaries. Else they are sampled
//! anew as by [`super::bidirectional`]. Both ways are one density,
//!
//! ```text
//! T(x → y) ∝ p_A(y_0) [y has the chain to which the seed walks] + 1/(d + 1) Σ_{s ≤ d} p_s(y) / (what stays has of it),
//! ```
//!
//! so that a chain leaves a caustic by the one as it came to it by the other. The seed depends on nothing but the ends.

use super::bidirectional::{Range, resample};
use super::gamma::Part;
use super::seeds::Bend;
use super::{Draft, Seeds, View};
use crate::emitter::Start;
use crate::manifold::{Chain, Goal, MOST_LINKS, Rejection, Turn};
use crate::math::{Frame, Stream, Walk};
use crate::paths::{Course, FullPath, Node, VertexKind};
use crate::scene::{Caster, Surface};
use arrayvec::ArrayVec;
use glam::DVec3;

/// Two chains are the same if their vertices are no further apart, relative to the distance of their ends.
const SAME: f64 = 1e-7;

/// Share of the random seeds that begin with a chain that light is seen to take.
const AS_SEEN: f64 = 0.75;
/// Share of the random seeds that take the way that they try as it is.
const AS_TRIED: f64 = 0.25;
/// How far others turn from there towards the light's image: as far as can be.
const SHARES: [f64; 4] = [1.0, 0.5, 0.25, 0.125];
/// Two sides of things are the same if the cosine between their normals is above this.
const ALIKE: f64 = 0.9;

/// Whether some vertex could be linked.
pub(super) fn suits(scene: &Caster<'_>, course: &Course) -> bool {
    scene.links() && (2..course.edges()).any(|d| is_free(course, d))
}

/// The first free vertex from the light on, if there are smooth boundaries before it: the one that the connection would have
/// linked.
pub(super) fn joint(course: &Course) -> Option<usize> {
    let d = 1 + course.nodes[1..].iter().take_while(|node| node.delta).count();
    (d > 1 && d < course.edges() && is_free(course, d)).then_some(d)
}

fn is_free(course: &Course, d: usize) -> bool {
    let node = &course.nodes[d];
    node.surface().is_some() && !node.delta
}

/// Replaces the light's end of `old`.
pub(super) fn propose(
    view: &View<'_>,
    old: &Course,
    stream: &mut Stream,
    new: &mut Course,
) -> Result<Draft, Rejection> {
    let edges = old.edges();
    // Of all vertices, whether they suit or not: for both ways with the same probability.
    let d = 2 + (stream.number() * edges.saturating_sub(2) as f64) as usize;
    if d >= edges || !is_free(old, d) {
        return Err(Rejection::Unsuitable);
    }
    let part = Range::new(0, d, edges);
    let technique = if stream.number() < 0.5 {
        connect(view.scene, old, d, Seed::Straight, stream, new)?;
        0
    } else {
        resample(view.scene, old, part, d, stream, new).ok_or(Rejection::Dark)?
    };
    if !is_free(new, d) {
        return Err(Rejection::Dark);
    }
    Ok(Draft { technique, ratio: 1.0, ranges: None, linked: Some(d) })
}

/// Where a walk to a light begins.
#[derive(Clone, Copy, Debug)]
pub(super) enum Seed<'a> {
    /// The straight way there, bent where it meets boundaries: it depends on nothing but the ends.
    Straight,
    /// A way that scatters at random where the link begins, and is reflected or refracted at random at each boundary (Zeltner,
    /// Georgiev and Jakob 2020, "Specular Manifold Sampling"); or one that goes as some light is seen to come.
    Random(&'a Seeds),
}

/// Links x_d with a light.
pub(super) fn connect(
    scene: &Caster<'_>,
    old: &Course,
    d: usize,
    seed: Seed<'_>,
    stream: &mut Stream,
    new: &mut Course,
) -> Result<(), Rejection> {
    let (id, start, _) = scene.sample_start(stream.row()).ok_or(Rejection::Unsuitable)?;
    let light = Node::light(id, start);
    let chain = match seed {
        Seed::Straight => straight(scene, &old.nodes[d], &light, d - 1)?,
        Seed::Random(seeds) => random(scene, (old, d), &light, seeds, stream)?,
    };
    new.clone_from(old);
    for (link, node) in chain.links().iter().zip(new.nodes[1..d].iter_mut().rev()) {
        *node = Node::on(link.surface, true);
    }
    // What a walk from the camera meets there is the light as such a walk has it.
    (new.nodes[0], new.lit) = (light, None);
    new.light_up(scene).ok_or(Rejection::Dark)?;
    new.nodes[0] = Node::light(id, new.lit.ok_or(Rejection::Dark)?.start());
    Ok(())
}

/// The chain of `count` smooth boundaries from `from` to a point of a light to which the straight seed walks.
fn straight(scene: &Caster<'_>, from: &Node, light: &Node, count: usize) -> Result<Chain, Rejection> {
    let VertexKind::Light(_, Start::Surface { .. }) = light.kind else { return Err(Rejection::Unsuitable) };
    let direction = (light.position - from.position).try_normalize().ok_or(Rejection::Singular)?;
    let bend = |surface: &Surface, direction: DVec3| pass(scene, surface, direction);
    Trail::trace(scene, from, count, direction, bend)?.settle(scene, from, light)
}

/// Where light goes that passes a smooth boundary along `direction`; `None` where it is reflected totally, or no law is known.
fn pass(scene: &Caster<'_>, surface: &Surface, direction: DVec3) -> Option<DVec3> {
    Turn::at(scene, surface, -direction, direction)?.onward(surface.frame.normal, -direction)
}

/// The chain from x_d to a point of a light to which a random seed walks. The way that it tries tells which surfaces it meets,
/// and which of them reflect. Where some do, most seeds unfold it: they set out for the light's image in the planes of these,
/// as the straight one does for the light, or as far towards it as they meet the same sides of things.
fn random(
    scene: &Caster<'_>,
    (course, d): (&Course, usize),
    light: &Node,
    seeds: &Seeds,
    stream: &mut Stream,
) -> Result<Chain, Rejection> {
    let VertexKind::Light(_, Start::Surface { .. }) = light.kind else { return Err(Rejection::Unsuitable) };
    let from = &course.nodes[d];
    let seen = if stream.number() < AS_SEEN { seeds.draw(d - 1, from.position, stream) } else { None };
    let mut own = ArrayVec::new();
    let (tried, traced, bends) = match seen {
        Some(seen) => ((seen[0].position - from.position).try_normalize().ok_or(Rejection::Singular)?, None, seen),
        None => {
            let (tried, way) = attempt(scene, (course, d), stream, &mut own)?;
            (tried, Some(way), &*own)
        }
    };
    let follow = |direction: DVec3| {
        let mut planned = bends.iter();
        let bend = |surface: &Surface, direction: DVec3| match planned.next()?.reflected {
            true => reflect(surface, direction),
            false => pass(scene, surface, direction),
        };
        Trail::trace(scene, from, d - 1, direction, bend)
    };
    let mut mirrors = bends.iter().rev().filter(|bend| bend.reflected).peekable();
    if mirrors.peek().is_some() && stream.number() >= AS_TRIED {
        let image = mirrors.fold(light.position, |image, Bend { position, normal, .. }| {
            image - normal * (2.0 * normal.dot(image - position))
        });
        let unfolded = (image - from.position).try_normalize().ok_or(Rejection::Singular)?;
        let towards = |share: f64| follow(tried.lerp(unfolded, share).try_normalize()?).ok();
        let way = SHARES.into_iter().filter_map(towards).find(|way| way.is_like(bends));
        if let Some(way) = way {
            return way.settle(scene, from, light);
        }
    }
    traced.map_or_else(|| follow(tried), Ok)?.settle(scene, from, light)
}

/// Tries a way from x_d through smooth boundaries, at each of which it passes or is reflected by chance: where it sets out,
/// and where it leads. What it does is left in `bends`.
fn attempt(
    scene: &Caster<'_>,
    (course, d): (&Course, usize),
    stream: &mut Stream,
    bends: &mut ArrayVec<Bend, MOST_LINKS>,
) -> Result<(DVec3, Trail), Rejection> {
    let from = &course.nodes[d];
    let surface = from.surface().ok_or(Rejection::Unsuitable)?;
    let back = course.direction(scene, d).ok_or(Rejection::Singular)?;
    let scatter = scene.scatter(surface, surface.frame.to_local(back), stream.row(), Walk::FromCamera);
    let scatter = scatter.filter(|scatter| !scatter.delta).ok_or(Rejection::Unsuitable)?;
    let direction = surface.frame.to_world(scatter.direction);
    let way = Trail::trace(scene, from, d - 1, direction, |surface, direction| {
        let passed = if stream.number() < 0.5 { pass(scene, surface, direction) } else { None };
        let (position, normal) = (surface.position, surface.frame.normal);
        bends.try_push(Bend { position, normal, reflected: passed.is_none() }).ok()?;
        passed.or_else(|| reflect(surface, direction))
    })?;
    Ok((direction, way))
}

/// Where light goes that a surface reflects.
fn reflect(surface: &Surface, direction: DVec3) -> Option<DVec3> {
    Turn::Reflected.onward(surface.frame.normal, -direction)
}

/// A way through smooth boundaries, which need not lead to a light.
struct Trail {
    surfaces: ArrayVec<(Surface, bool), MOST_LINKS>,
    /// Where it leads.
    direction: DVec3,
}

impl Trail {
    /// Sets out along `direction` and meets `count` surfaces, at each of which it goes on as `bend` says.
    fn trace(
        scene: &Caster<'_>,
        from: &Node,
        count: usize,
        mut direction: DVec3,
        mut bend: impl FnMut(&Surface, DVec3) -> Option<DVec3>,
    ) -> Result<Self, Rejection> {
        let mut origin = from.leave(direction);
        let mut surfaces = ArrayVec::new();
        for _ in 0..count {
            let surface = scene.intersect(origin, direction).ok_or(Rejection::Unsuitable)?;
            let met = surface.frame.to_local(-direction);
            if surface.up.z < 1.0 || !scene.bsdf(surface.bsdf).is_delta(met) {
                return Err(Rejection::Unsuitable);
            }
            direction = bend(&surface, direction).ok_or(Rejection::Unsuitable)?;
            origin = surface.leave(direction);
            surfaces.try_push((surface, true)).map_err(|_| Rejection::TooLong)?;
        }
        Ok(Self { surfaces, direction })
    }

    /// Whether it meets the same sides of things, as far as normals tell.
    fn is_like(&self, bends: &[Bend]) -> bool {
        self.surfaces.iter().zip(bends).all(|((surface, _), bend)| surface.frame.normal.dot(bend.normal) > ALIKE)
    }

    /// The chain nearby that leads to a point of a light.
    fn settle(&self, scene: &Caster<'_>, from: &Node, light: &Node) -> Result<Chain, Rejection> {
        let Self { surfaces, direction } = self;
        let (last, _) = surfaces.last().ok_or(Rejection::Unsuitable)?;
        let Frame { tangent, bitangent, .. } = Frame::around(*direction);
        let goal = Goal::new(light.position, [tangent, bitangent]);
        let end = last.position + *direction * last.position.distance(light.position);
        Ok(Chain::new(scene, from.position, surfaces, end)?.walk(scene, from, &goal)?.0)
    }
}

/// Whether `course` has this chain between x_d and the light.
fn has(course: &Course, d: usize, chain: &Chain) -> bool {
    let close = SAME * course.nodes[0].position.distance(course.nodes[d].position);
    let same = |(link, node): (&Surface, &Node)| link.position.distance(node.position) <= close;
    chain.surfaces().zip(course.nodes[1..d].iter().rev()).all(same)
}

/// Whether a random seed from x_d finds the chain that `course` has.
pub(super) fn finds(scene: &Caster<'_>, course: &Course, d: usize, seeds: &Seeds, stream: &mut Stream) -> bool {
    random(scene, (course, d), &course.nodes[0], seeds, stream).is_ok_and(|chain| has(course, d, &chain))
}

/// How likely the connection is, relative to the walk from the camera, to make of x_d the light's end that `course` has.
pub(super) fn share(view: &View<'_>, course: &mut Course, d: usize, memory: &mut FullPath) -> f64 {
    let seeded = || {
        let chain = straight(view.scene, &course.nodes[d], &course.nodes[0], d - 1).ok()?;
        has(course, d, &chain).then_some(())
    };
    let delta = course.nodes[1..d].iter().all(|node| node.delta);
    if !delta || seeded().is_none() {
        return 0.0;
    }
    reach(view.scene, course, d, memory).unwrap_or(0.0)
}

/// The same for a seed that is sure to find the chain.
pub(super) fn reach(scene: &Caster<'_>, course: &mut Course, d: usize, memory: &mut FullPath) -> Option<f64> {
    let VertexKind::Light(id, start) = course.nodes[0].kind else { return None };
    course.light_up(scene)?;
    memory.assemble(scene, course, 0)?;
    let walked: f64 = (0..d).map(|m| memory.camera.vertices[course.edges() - m].forward.0).product();
    let gamma = Part { course, from: d, to: 0, walk: Walk::FromCamera }.gamma(scene).ok()?;
    Some(scene.start_pdf(id, &start).0 / (walked * gamma))
}
