//! Chains that light is seen to take: what random seeds begin with.
//!
//! Walks from the lights tell which smooth boundaries light passes on its way to a surface, and which of them reflect it.
//! A chain that ends nearby is likely to be of the same kind. How likely a seed is to find a chain with them need not be
//! known (see [`super::whole`]), so that any number of them will do, as long as they stay as they are.

use super::PathMutations;
use crate::manifold::MOST_LINKS;
use crate::math::Stream;
use crate::paths::{Random, Subpath, Vertex, trace_light};
use crate::scene::{Caster, Scene};
use arrayvec::ArrayVec;
use foldhash::fast::FixedState;
use glam::{DVec3, IVec3};
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;

/// Walks from the lights in a round, in so many jobs.
const WALKS: u64 = 1 << 13;
const JOBS: u64 = 16;
/// A round for so many pixels, and the most rounds.
const PIXELS: usize = 256;
const ROUNDS: usize = 16;
/// No further round is wanted once there are so many chains.
const ENOUGH: usize = 10_000;
/// Share of the chains that are drawn from those that end nearby.
const NEARBY: f64 = 0.75;
/// How many those are, on the average of all chains.
const NEIGHBOURS: f64 = 16.0;
/// The narrowest cells, relative to the scene.
const NARROWEST: f64 = 1.0 / 256.0;

/// What light does at a smooth boundary.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bend {
    pub position: DVec3,
    pub normal: DVec3,
    pub reflected: bool,
}

/// A chain that light takes.
#[derive(Clone, Debug)]
struct Seen {
    /// Where it leads.
    end: DVec3,
    /// From there to the light.
    bends: ArrayVec<Bend, MOST_LINKS>,
}

/// Chains of one length.
#[derive(Clone, Debug, Default)]
struct Group {
    /// What the chains do, one after the other; those that end in the same cell of a grid follow each other.
    bends: Vec<Bend>,
    width: f64,
    cells: HashMap<IVec3, Range<usize>, FixedState>,
}

/// Chains that light takes.
#[derive(Clone, Debug, Default)]
pub struct Seeds {
    /// Place `n`: those of n links.
    groups: Vec<Group>,
}

impl Seeds {
    /// As walks from the lights find them, where paths are linked with lights.
    pub fn seen(scene: &Scene, mutations: &PathMutations, seed: u64) -> Self {
        if !mutations.links(scene) {
            return Self::default();
        }
        const LENGTH: u64 = WALKS / JOBS;
        let [width, height] = scene.camera.size;
        let job = |job: u64| {
            let (caster, mut path) = (Caster::new(scene), Subpath::default());
            let walks = job * LENGTH..(job + 1) * LENGTH;
            walks.filter_map(|walk| follow(&caster, &Stream::new(seed, &[6, walk]), &mut path)).collect()
        };
        let mut chains = Vec::new();
        for round in 0..(width * height / PIXELS).clamp(1, ROUNDS) as u64 {
            let jobs: Vec<Vec<Seen>> = (round * JOBS..(round + 1) * JOBS).into_par_iter().map(job).collect();
            chains.extend(jobs.into_iter().flatten());
            if chains.len() >= ENOUGH {
                break;
            }
        }
        let mut by_links = vec![Vec::new(); MOST_LINKS + 1];
        chains.into_iter().for_each(|chain| by_links[chain.bends.len()].push(chain));
        Self { groups: by_links.into_iter().map(|chains| Group::new(chains, scene.radius())).collect() }
    }

    /// One of the chains of `links` links, from its far end to the light; rather one that ends near `end`.
    pub(super) fn draw(&self, links: usize, end: DVec3, stream: &mut Stream) -> Option<&[Bend]> {
        let Group { bends, width, cells } = self.groups.get(links)?;
        let nearby = if stream.number() < NEARBY { cells.get(&cell(end, *width)) } else { None };
        let Range { start, end } = nearby.cloned().unwrap_or(0..bends.len() / links.max(1));
        let first = (start + (stream.number() * (end - start) as f64) as usize) * links;
        bends.get(first..first + links).filter(|bends| !bends.is_empty())
    }
}

impl Group {
    fn new(mut chains: Vec<Seen>, radius: f64) -> Self {
        let mut width = radius * NARROWEST;
        // As narrow as can be, so that enough chains end with another.
        while width < radius {
            chains.sort_by_key(|chain| cell(chain.end, width).to_array());
            let runs = chains.chunk_by(|a, b| cell(a.end, width) == cell(b.end, width));
            let together: f64 = runs.map(|run| (run.len() * run.len()) as f64).sum();
            if together >= NEIGHBOURS * chains.len() as f64 {
                break;
            }
            width *= 2.0;
        }
        let mut cells = HashMap::default();
        let mut start = 0;
        for run in chains.chunk_by(|a, b| cell(a.end, width) == cell(b.end, width)) {
            cells.insert(cell(run[0].end, width), start..start + run.len());
            start += run.len();
        }
        Self { bends: chains.into_iter().flat_map(|chain| chain.bends).collect(), width, cells }
    }
}

/// The cell of a grid with cells of this `width` that holds `position`.
fn cell(position: DVec3, width: f64) -> IVec3 {
    (position / width).floor().as_ivec3()
}

/// The chain that the walk takes from the light to the first surface that is no smooth boundary.
fn follow(scene: &Caster<'_>, stream: &Stream, path: &mut Subpath) -> Option<Seen> {
    // Most light comes to no boundary: that is known by the first surface.
    for most in [3, MOST_LINKS + 2] {
        trace_light(scene, &mut Random(&mut stream.clone()), most, usize::MAX, path);
        if !path.vertices.get(1)?.delta {
            return None;
        }
    }
    let links = path.vertices[1..].iter().take_while(|vertex| vertex.delta).count();
    let end = path.vertices.get(1 + links)?;
    let bend = |vertices: &[Vertex]| {
        let [_, vertex, next] = vertices else { return None };
        let surface = vertex.surface()?;
        let [from, onward] = [vertex.back, next.position - vertex.position].map(|way| way.dot(surface.geometric));
        Some(Bend { position: vertex.position, normal: surface.frame.normal, reflected: from * onward > 0.0 })
    };
    let bends = path.vertices[..links + 2].windows(3).rev().map(bend);
    let ends = links <= MOST_LINKS && end.connects && end.surface().is_some();
    ends.then(|| bends.collect::<Option<_>>())?.map(|bends| Seen { end: end.position, bends })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Chains of two links that end along a line, most of them at its far end.
    fn chains(count: usize) -> Vec<Seen> {
        let bend = |x: f64| Bend { position: DVec3::X * x, normal: DVec3::Z, reflected: x < 0.5 };
        let at = |i: usize| 1.0 - (i as f64 / count as f64).powi(2);
        (0..count).map(|i| Seen { end: DVec3::X * at(i), bends: (0..2).map(|_| bend(at(i))).collect() }).collect()
    }

    #[test]
    fn chains_that_end_nearby_are_drawn_first() {
        const DRAWS: usize = 2000;
        let mut seeds = Seeds { groups: vec![Group::default(); MOST_LINKS + 1] };
        seeds.groups[2] = Group::new(chains(1000), 10.0);
        let mut stream = Stream::new(1, &[]);
        for end in [0.2, 0.6, 0.99] {
            let drawn = || seeds.draw(2, DVec3::X * end, &mut stream).map(|bends| (bends.len(), bends[0].position.x));
            let near = std::iter::repeat_with(drawn).take(DRAWS).flatten().filter(|(links, x)| {
                assert_eq!(*links, 2);
                (x - end).abs() <= seeds.groups[2].width
            });
            let share = near.count() as f64 / DRAWS as f64;
            assert!(share > NEARBY - 0.05, "{end}: {share}");
        }
        assert!(seeds.draw(2, DVec3::Y * 9.0, &mut stream).is_some(), "where none ends, any will do");
        assert!(seeds.draw(3, DVec3::X, &mut stream).is_none());
        assert!(Seeds::default().draw(1, DVec3::X, &mut stream).is_none());
    }
}
