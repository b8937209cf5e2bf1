//! The bidirectional mutation (Veach and Guibas 1997, section 5.2): part of a path is left out and sampled anew by walks from
//! both of its ends, which are connected.
//!
//! Of x_0 … x_k the first l vertices stay and those from x_m on. With n new vertices between, any number of them may come
//! from the walk that goes on from the light's side, which are as many techniques as find the same path. So
//!
//! ```text
//! T(x → y) = P(l, m) P(n) / N Σ_s p_s(y) / (what the vertices that stay have of it),
//! ```
//!
//! over the N techniques s with l ≤ s ≤ l + n. What stays has the same density in both ways.

use super::Draft;
use crate::emitter::Start;
use crate::math::{Row, Stream, Walk, pick};
use crate::paths::{Course, Node, VertexKind};
use crate::scene::{Caster, Origin};
use glam::DVec3;

/// How long paths may become, in edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lengths {
    /// The shortest.
    pub least: usize,
    /// The longest.
    pub most: usize,
}

/// A part of a path: the vertices from `from` up to `to`, of a path with `edges` edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Range {
    from: usize,
    to: usize,
    edges: usize,
}

impl Range {
    pub(super) const fn new(from: usize, to: usize, edges: usize) -> Self {
        Self { from, to, edges }
    }

    /// What it becomes with `count` vertices in its place.
    const fn replaced(self, count: usize) -> Self {
        Self { from: self.from, to: self.from + count, edges: self.edges + count - self.len() }
    }

    /// Its vertices.
    const fn len(self) -> usize {
        self.to - self.from
    }

    /// The techniques that keep all others, by their number of light vertices: none has the lens among these.
    pub(super) fn techniques(self) -> std::ops::RangeInclusive<usize> {
        self.from..=self.to.min(self.edges)
    }

    /// How many there are.
    fn count(self) -> f64 {
        self.techniques().count() as f64
    }

    /// The fewest vertices that the part may have: the ends of a path have to be somewhere.
    fn least(self) -> usize {
        usize::from(self.from == 0) + usize::from(self.to > self.edges)
    }
}

/// What parts with so many vertices are worth leaving out: few vertices are kept more easily (Veach and Guibas 1997).
fn worth(vertices: usize) -> f64 {
    match vertices {
        0 => 0.25,
        1 => 0.5,
        _ => 0.5f64.powi(vertices as i32 + 1),
    }
}

/// What it is worth to have so many new vertices in place of `old`.
fn worth_in_place(old: usize, new: usize) -> f64 {
    match old.abs_diff(new) {
        0 => 0.5,
        1 => 0.15,
        difference => 0.2 * 0.5f64.powi(difference as i32),
    }
}

impl Lengths {
    /// How many there are.
    pub fn count(self) -> usize {
        (self.most + 1).saturating_sub(self.least)
    }

    /// The parts that may be left out of a path, with their worth.
    fn parts(self, edges: usize) -> impl Iterator<Item = (Range, f64)> + Clone {
        let fewest = usize::from(self.least == self.most);
        let of_size = move |vertices: usize| {
            // Nothing can be left out beyond the ends.
            let first = usize::from(vertices == 0);
            (first..=edges + 1 - vertices - first).map(move |from| Range { from, to: from + vertices, edges })
        };
        let weigh = move |vertices: usize| {
            let ranges = of_size(vertices);
            let share = worth(vertices) / ranges.clone().count().max(1) as f64;
            ranges.map(move |range| (range, share))
        };
        (fewest..=edges + 1).flat_map(weigh)
    }

    /// The numbers of vertices that may take the place of a part, with their worth.
    fn replacements(self, part: Range) -> impl Iterator<Item = (usize, f64)> + Clone {
        let kept = part.edges + 1 - part.len();
        let [least, most] = [self.least, self.most].map(|edges| (edges + 1).saturating_sub(kept));
        (least.max(part.least())..=most).map(move |new| (new, worth_in_place(part.len(), new)))
    }

    /// Probability that `part` is left out and `new` vertices take its place.
    fn probability(self, part: Range, new: usize) -> f64 {
        let parts = self.parts(part.edges).map(move |(other, worth)| (other == part, worth));
        let replacements = self.replacements(part).map(move |(count, worth)| (count == new, worth));
        share(parts) * share(replacements)
    }
}

/// What one of some choices is worth, relative to all.
fn share(choices: impl Iterator<Item = (bool, f64)>) -> f64 {
    let (one, all) =
        choices.fold((0.0, 0.0), |(one, all), (is, worth)| (one + if is { worth } else { 0.0 }, all + worth));
    one / all
}

/// Samples part of `old` anew; `None` where it leads nowhere. The technique is that by which the new part was found.
pub(super) fn propose(
    scene: &Caster<'_>,
    old: &Course,
    lengths: Lengths,
    stream: &mut Stream,
    new: &mut Course,
) -> Option<Draft> {
    let edges = old.edges();
    let parts = lengths.parts(edges);
    let chosen = pick(parts.clone().map(|(_, worth)| worth), stream.number())?;
    let (part, _) = parts.clone().nth(chosen)?;
    let replacements = lengths.replacements(part);
    let chosen = pick(replacements.clone().map(|(_, worth)| worth), stream.number())?;
    let (count, _) = replacements.clone().nth(chosen)?;
    let technique = resample(scene, old, part, count, stream, new)?;
    let replaced = part.replaced(count);
    let ratio = if replaced == part {
        1.0
    } else {
        lengths.probability(replaced, part.len()) / lengths.probability(part, replaced.len()) * replaced.count()
            / part.count()
    };
    Some(Draft { technique, ratio, ranges: Some([part, replaced]), linked: None })
}

/// Has `count` vertices take the place of `part`: the technique that found them.
pub(super) fn resample(
    scene: &Caster<'_>,
    old: &Course,
    part: Range,
    count: usize,
    stream: &mut Stream,
    new: &mut Course,
) -> Option<usize> {
    let (edges, replaced) = (old.edges(), part.replaced(count));
    let technique = part.from + ((stream.number() * replaced.count()) as usize).min(count);

    (new.film, new.lit) = (old.film, old.lit.filter(|_| part.from > 0));
    new.nodes.clear();
    new.nodes.extend_from_slice(&old.nodes[..part.from]);
    let back = part.from.checked_sub(2).map(|m| old.direction(scene, m)).map(|direction| direction.map(|d| -d));
    let light = Growth { walk: Walk::FromLight, start: 0, count: technique - part.from, meets_light: false };
    light.grow(scene, back.flatten(), stream, new)?;
    // The camera's part from the lens on, turned round in the end.
    new.nodes.extend(old.nodes[part.to..].iter().rev());
    let back = if part.to < edges { old.direction(scene, part.to) } else { None };
    let count = replaced.to - technique;
    let camera = Growth { walk: Walk::FromCamera, start: technique, count, meets_light: technique == 0 };
    camera.grow(scene, back, stream, new)?;
    new.nodes[technique..].reverse();
    if technique == new.edges() {
        new.look(scene)?;
    }
    if technique > 0 {
        new.nodes[technique - 1].delta = false;
        new.nodes[technique].delta = false;
        if !new.sees(scene, technique - 1) {
            return None;
        }
    }
    Some(technique)
}

/// A walk that goes on.
struct Growth {
    walk: Walk,
    /// Where its vertices begin in the course that is being made, in the order of the walk.
    start: usize,
    /// How many are added.
    count: usize,
    /// Whether the last of them is to lie on a light.
    meets_light: bool,
}

impl Growth {
    /// Adds the vertices; `back` is the unit vector from the last one to the one before, where there are two.
    fn grow(&self, scene: &Caster<'_>, back: Option<DVec3>, stream: &mut Stream, new: &mut Course) -> Option<()> {
        let Self { walk, start, count, meets_light } = *self;
        let (mut back, mut sight) = (back, None);
        for number in 1..=count {
            let row = stream.row();
            if new.nodes.len() == start {
                if walk == Walk::FromLight {
                    let (id, start, _) = scene.sample_start(row)?;
                    new.nodes.push(Node::light(id, start));
                } else {
                    new.film = scene.camera.film_position(row);
                    let (lens, direction) = scene.camera.ray(new.film, row);
                    sight = Some(direction);
                    new.nodes.push(Node::lens(lens));
                }
                continue;
            }
            let (origin, direction) = depart(scene, walk, sight.take(), back, row, new)?;
            let from_lens = matches!(new.nodes.last()?.kind, VertexKind::Camera);
            let met = if from_lens { scene.see(origin, direction) } else { scene.intersect(origin, direction) };
            let node = match met {
                Some(surface) if meets_light && number == count => {
                    new.lit = Some(surface);
                    Node::light(surface.emitter?, surface.start())
                }
                Some(surface) => Node::on(surface, false),
                None if meets_light && number == count => {
                    Node::light(scene.environment()?, Start::Infinite { towards: direction })
                }
                None => return None,
            };
            new.nodes.push(node);
            back = Some(-direction);
        }
        Some(())
    }
}

/// The ray with which a walk leaves the last vertex; `sight` is that of a lens that was just chosen.
fn depart(
    scene: &Caster<'_>,
    walk: Walk,
    sight: Option<DVec3>,
    back: Option<DVec3>,
    row: Row,
    new: &mut Course,
) -> Option<(Origin, DVec3)> {
    let last = new.nodes.last_mut()?;
    match &last.kind {
        VertexKind::Light(id, start) => {
            let (origin, direction, weight) = scene.emitter(*id).emit(start, row)?;
            let origin = if last.infinite().is_some() { origin.into() } else { last.leave(direction) };
            (!weight.is_black()).then_some((origin, direction))
        }
        VertexKind::Surface(surface) => {
            let scatter = scene.scatter(surface, surface.frame.to_local(back?), row, walk)?;
            let direction = surface.frame.to_world(scatter.direction);
            let origin = surface.leave(direction);
            last.delta = scatter.delta;
            (!scatter.weight.is_black()).then_some((origin, direction))
        }
        VertexKind::Camera => {
            if let Some(direction) = sight {
                return Some((last.position.into(), direction));
            }
            // The point of the lens stays.
            let film = scene.camera.film_position(row);
            let (lens, direction) = scene.camera.ray(film, scene.camera.invert(film, last.position, row));
            (new.film, *last) = (film, Node::lens(lens));
            Some((lens.into(), direction))
        }
        VertexKind::Environment(_) => None,
    }
}
