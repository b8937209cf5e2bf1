//! Walks of a chain to a new end.

use super::{Turn, derivatives, offset, transfer};
use crate::math::Frame;
use crate::paths::Node;
use crate::scene::{Caster, Patch, Scene, Surface};
use arrayvec::ArrayVec;
use glam::{DMat2, DVec2, DVec3};

/// The longest chain that walks.
pub const MOST_LINKS: usize = 12;
/// The most times that a chain is traced in a walk.
pub const MOST_STEPS: usize = 20;
/// A chain has arrived when it ends this close to the goal, relative to the longest of its edges.
const CLOSE: f64 = 1e-11;

/// The far end of a chain: a point, and a plane through it along which the chain may miss it.
#[derive(Clone, Copy, Debug)]
pub struct Goal(Patch);

impl Goal {
    /// A point and two unit vectors at right angles that span the plane.
    pub fn new(position: DVec3, tangents: [DVec3; 2]) -> Self {
        let normal = tangents[0].cross(tangents[1]);
        Self(Patch { position, tangents, normal, turning: [DVec3::ZERO; 2] })
    }

    /// Where it is.
    pub const fn position(&self) -> DVec3 {
        self.0.position
    }

    /// Where the ray from `position` along `direction` misses it, in coordinates of the plane; `None` if it never gets
    /// there.
    fn miss(&self, position: DVec3, direction: DVec3) -> Option<DVec2> {
        let Patch { position: goal, tangents: [s, t], normal, .. } = self.0;
        let distance = normal.dot(goal - position) / normal.dot(direction);
        let miss = position + direction * distance - goal;
        (distance > 0.0 && distance.is_finite()).then(|| DVec2::new(s.dot(miss), t.dot(miss)))
    }
}

/// Why a walk does not arrive, or is of no use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rejection {
    /// The chain is too long.
    TooLong,
    /// The chain as it is does not lead towards the goal, or not by laws that this knows.
    Unsuitable,
    /// A vertex has no place to go: light grazes, or media are equal.
    Singular,
    /// It does not come closer, or not soon enough.
    Lost,
    /// It arrives, but the walk back leads elsewhere.
    OneWay,
    /// Something lies in the way, or what is found carries no light.
    Dark,
}

impl Rejection {
    /// The name, as reports have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::TooLong => "too_long",
            Self::Unsuitable => "unsuitable",
            Self::Singular => "singular",
            Self::Lost => "lost",
            Self::OneWay => "one_way",
            Self::Dark => "dark",
        }
    }
}

/// A vertex of a chain.
#[derive(Clone, Copy, Debug)]
pub struct Link {
    /// Where it lies.
    pub surface: Surface,
    /// What it does.
    pub turn: Turn,
    /// How far the half-vector is off the normal, in the frame around it; zero at a delta vertex.
    pub offset: DVec2,
}

impl Link {
    /// The vertex at `surface` between two points; one that is no delta vertex keeps the half-vector that it has.
    ///
    /// # Errors
    /// [`Rejection::Unsuitable`], [`Rejection::Singular`].
    pub fn new(
        scene: &Scene,
        before: DVec3,
        (surface, delta): (&Surface, bool),
        after: DVec3,
    ) -> Result<Self, Rejection> {
        let [from, onward] = [before, after].map(|end| (end - surface.position).normalize());
        let turn = Turn::at(scene, surface, from, onward).ok_or(Rejection::Unsuitable)?;
        let mut link = Self { surface: *surface, turn, offset: DVec2::ZERO };
        if !delta {
            let patch = scene.patch(surface).ok_or(Rejection::Unsuitable)?;
            let offset = offset(before, (&patch, turn), after).ok_or(Rejection::Singular)?;
            link.offset = Frame::around(patch.normal).to_local(offset).truncate();
        }
        Ok(link)
    }

    /// Where light goes on that comes from the unit vector `from`, when the vertex lies on `surface` instead; `None` where
    /// that is another turn, or on the wrong side of the true surface.
    pub fn onward(&self, scene: &Scene, surface: &Surface, from: DVec3) -> Option<DVec3> {
        let DVec2 { x, y } = self.offset;
        let up = (1.0 - self.offset.length_squared()).max(0.0).sqrt();
        let facet = Frame::around(surface.frame.normal).to_world(DVec3::new(x, y, up));
        let onward = self.turn.onward(facet, from)?;
        let passes = from.dot(surface.geometric) * onward.dot(surface.geometric) < 0.0;
        let same = Turn::at(scene, surface, from, onward) == Some(self.turn);
        (same && passes == (self.turn != Turn::Reflected)).then_some(onward)
    }
}

/// The vertices of a chain.
#[derive(Clone, Debug)]
pub struct Chain(ArrayVec<Link, MOST_LINKS>);

/// A chain with the unit vector in which light leaves its last vertex.
struct Traced {
    chain: Chain,
    onward: DVec3,
}

impl Chain {
    /// The vertices `surfaces` between `start` and `end`; those that are not delta vertices keep the half-vector that they
    /// have.
    ///
    /// # Errors
    /// [`Rejection::TooLong`], [`Rejection::Unsuitable`].
    pub fn new(scene: &Caster<'_>, start: DVec3, surfaces: &[(Surface, bool)], end: DVec3) -> Result<Self, Rejection> {
        let mut links = ArrayVec::new();
        if surfaces.len() > MOST_LINKS {
            return Err(Rejection::TooLong);
        }
        for (i, (surface, delta)) in surfaces.iter().enumerate() {
            let before = if i == 0 { start } else { surfaces[i - 1].0.position };
            let after = surfaces.get(i + 1).map_or(end, |(next, _)| next.position);
            links.push(Link::new(scene, before, (surface, *delta), after)?);
        }
        Ok(Self(links))
    }

    /// Its vertices.
    pub fn links(&self) -> &[Link] {
        &self.0
    }

    /// Where they lie.
    pub fn surfaces(&self) -> impl ExactSizeIterator<Item = &Surface> {
        self.0.iter().map(|link| &link.surface)
    }

    /// How its first vertex moves with the goal, in the tangents of [`Scene::patch`](crate::scene::Scene::patch) and of the
    /// goal: see [`transfer`].
    ///
    /// # Errors
    /// [`Rejection::Unsuitable`] where normals have no known derivatives, [`Rejection::Singular`].
    pub fn transfer(&self, scene: &Caster<'_>, start: &Node, goal: &Goal) -> Result<DMat2, Rejection> {
        self.follow(scene, start, goal).map(|(transfer, _)| transfer)
    }

    /// [`Chain::transfer`], and the first vertex's tangents.
    fn follow(&self, scene: &Caster<'_>, start: &Node, goal: &Goal) -> Result<(DMat2, [DVec3; 2]), Rejection> {
        let patches: ArrayVec<Patch, MOST_LINKS> = self.surfaces().map_while(|surface| scene.patch(surface)).collect();
        if patches.len() < self.0.len() {
            return Err(Rejection::Unsuitable);
        }
        // It does not move, so only its place is of account.
        let fixed = Patch { position: start.position, ..goal.0 };
        let links = patches.iter().zip(&self.0).enumerate().map(|(i, (here, link))| {
            let before = if i == 0 { &fixed } else { &patches[i - 1] };
            derivatives(before, (here, link.turn), patches.get(i + 1).unwrap_or(&goal.0))
        });
        Ok((transfer(links).ok_or(Rejection::Singular)?, patches.first().unwrap_or(&goal.0).tangents))
    }

    /// How much solid angle at the near end an area of the goal's plane fills, seen along the chain, in 1 / squared scene
    /// unit.
    ///
    /// # Errors
    /// As [`Chain::transfer`].
    pub fn spread(&self, scene: &Caster<'_>, start: &Node, goal: &Goal) -> Result<f64, Rejection> {
        let first = self.surfaces().next().ok_or(Rejection::Unsuitable)?;
        let edge = first.position - start.position;
        let arriving = first.geometric.dot(edge.normalize()).abs();
        let transfer = self.transfer(scene, start, goal)?;
        Ok(arriving / edge.length_squared() * transfer.determinant().abs())
    }

    /// The generalised geometric term of the chain: how much projected solid angle at the near end an area of the goal's
    /// plane fills, seen along the chain, in 1 / squared scene unit. Two points that see each other have cos θ_0 cos θ_1 / d²;
    /// a point in space has no cosine (Jakob and Marschner 2012, section 4.3).
    ///
    /// # Errors
    /// As [`Chain::transfer`].
    pub fn geometric_term(&self, scene: &Caster<'_>, start: &Node, goal: &Goal) -> Result<f64, Rejection> {
        let first = self.surfaces().next().ok_or(Rejection::Unsuitable)?;
        Ok(start.cos((first.position - start.position).normalize()) * self.spread(scene, start, goal)?)
    }

    /// The same chain when it sets out towards `first`; `None` where it meets something else on its way.
    fn trace(&self, scene: &Caster<'_>, start: &Node, first: DVec3) -> Option<Traced> {
        let mut links = ArrayVec::new();
        let mut origin = start.leave(first - start.position);
        // From where the ray sets out, so that it meets what it is aimed at: steps end with that.
        let mut direction = (first - origin.point).try_normalize()?;
        for link in &self.0 {
            let surface = scene.intersect(origin, direction)?;
            if surface.bsdf != link.surface.bsdf {
                return None;
            }
            let onward = link.onward(scene, &surface, -direction)?;
            links.push(Link { surface, ..*link });
            origin = surface.leave(onward);
            direction = onward;
        }
        Some(Traced { chain: Self(links), onward: direction })
    }

    /// The chain from `start` to `goal` that is near this one, and how often it was traced. Whether its last edge is free
    /// is left to the caller.
    ///
    /// Each step moves the first vertex as the derivatives say, and half as far as before where that does not lead closer.
    /// It has arrived when it misses the goal by less than 1e-11 of its longest edge.
    ///
    /// # Errors
    /// What [`Rejection`] lists.
    pub fn walk(&self, scene: &Caster<'_>, start: &Node, goal: &Goal) -> Result<(Self, usize), Rejection> {
        let Some(first) = self.surfaces().next() else { return Err(Rejection::Unsuitable) };
        let mut now = self.trace(scene, start, first.position).ok_or(Rejection::Unsuitable)?;
        let mut miss = now.miss(goal).ok_or(Rejection::Unsuitable)?;
        let mut share = 1.0;
        let mut steps = 1;
        let mut planned = None;
        while miss.length() > CLOSE * now.chain.longest(start, goal) {
            if steps == MOST_STEPS {
                return Err(Rejection::Lost);
            }
            let step = match planned {
                Some(step) => step,
                None => {
                    let (transfer, [s, t]) = now.chain.follow(scene, start, goal)?;
                    let DVec2 { x, y } = transfer * -miss;
                    *planned.insert(s * x + t * y)
                }
            };
            let next = now.chain.trace(scene, start, now.chain.0[0].surface.position + step * share);
            steps += 1;
            match next.and_then(|next| next.miss(goal).map(|miss| (next, miss))) {
                Some((next, less)) if less.length() < miss.length() => {
                    (now, miss, planned) = (next, less, None);
                    share = f64::min(1.0, 2.0 * share);
                }
                _ => share *= 0.5,
            }
        }
        Ok((now.chain, steps))
    }

    fn longest(&self, start: &Node, goal: &Goal) -> f64 {
        let mut from = start.position;
        let ends = self.surfaces().map(|surface| surface.position).chain([goal.0.position]);
        ends.map(|to| to.distance(std::mem::replace(&mut from, to))).fold(0.0, f64::max)
    }
}

impl Traced {
    fn miss(&self, goal: &Goal) -> Option<DVec2> {
        goal.miss(self.chain.0.last()?.surface.position, self.onward)
    }
}
