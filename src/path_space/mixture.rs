//! How often independent paths come about in which way.
//!
//! Before a scene is seen, all techniques are as likely. Where paths can be linked, a quarter of them are sought by random
//! seeds (if they may be), and a quarter of the others are linked, with d drawn evenly. The light that first samples have found
//! tells more. If each way is as likely as its paths have light, its share of E[f/q], the mixture is nearer to f than before
//! (a step of expectation maximisation; Douc et al. 2007, "Convergence of adaptive mixtures of importance sampling schemes").
//! Half of all paths come about as if nothing were known, so that no light that first samples have missed is worth more than
//! twice as much as it would be otherwise.

use super::{Drawn, Kind, PathMutations, Seeds};
use crate::math::pick;
use crate::scene::Scene;
use std::sync::Arc;

/// The share of paths whose way is known that are linked with a light.
const LINKED: f64 = 0.25;
/// The share of paths that a random seed links with a light.
const SOUGHT: f64 = 0.25;
/// The share of paths that come about as if nothing were known.
const KEPT: f64 = 0.5;
/// Bounds of the share of large steps in which hidden light is sought.
const SEEKING: [f64; 2] = [0.1, 0.75];

/// A way in which an independent path comes about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// By the technique with so many light vertices.
    Technique(usize),
    /// By a walk from the camera up to the vertex with this number, and a link from there to a light.
    Link(usize),
    /// By such a walk, and a random seed that sets out for a light.
    Seek(usize),
}

/// In which ways independent paths come about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ways {
    /// By those whose density is known.
    Known,
    /// By random seeds too.
    All,
}

/// How likely each way is, for paths of one length.
#[derive(Clone, Debug)]
pub struct Mixture {
    /// Of each way among all: by s = 0 … k; and, if there are links, by d = 2 … k − 1 for links and for random seeds.
    shares: Vec<f64>,
    /// What they are as long as nothing is known.
    even: Arc<[f64]>,
    /// The sum of those for random seeds.
    sought: f64,
    /// The share of hidden light, as far as it is known.
    hidden: f64,
    edges: usize,
    /// What random seeds begin with.
    pub(super) seeds: Arc<Seeds>,
}

impl Mixture {
    /// As long as nothing is known, for paths of `edges` edges.
    pub fn even(scene: &Scene, mutations: &PathMutations, edges: usize, seeds: Arc<Seeds>) -> Self {
        let links = if mutations.links(scene) { edges.saturating_sub(2) } else { 0 };
        let [linked, sought] = if links > 0 { [LINKED, SOUGHT] } else { [0.0; 2] };
        let mut shares = vec![(1.0 - linked) * (1.0 - sought) / (edges + 1) as f64; edges + 1];
        for share in [linked * (1.0 - sought), sought] {
            shares.extend((0..links).map(|_| share / links as f64));
        }
        let even = shares.clone().into();
        Self { shares, even, sought, hidden: 0.0, edges, seeds }
    }

    /// After samples of this mixture; without links it stays as it is.
    pub fn adapted<'a>(&self, samples: impl Iterator<Item = &'a Drawn>) -> Self {
        let (mut light, mut hidden) = (vec![0.0; self.shares.len()], 0.0);
        for drawn in samples {
            light[self.place(drawn.way)] += drawn.worth;
            hidden += if drawn.hidden { drawn.worth } else { 0.0 };
        }
        let total: f64 = light.iter().sum();
        if !(self.links() && total > 0.0 && total.is_finite()) {
            return self.clone();
        }
        let share = |(even, light): (&f64, f64)| KEPT * even + (1.0 - KEPT) * light / total;
        let shares: Vec<f64> = self.even.iter().zip(light).map(share).collect();
        let sought = shares[self.place(Way::Seek(2))..].iter().sum();
        Self { shares, sought, hidden: hidden / total, ..self.clone() }
    }

    /// k.
    pub fn edges(&self) -> usize {
        self.edges
    }

    /// Whether paths are linked.
    pub fn links(&self) -> bool {
        self.shares.len() > self.edges + 1
    }

    /// The share of large steps in which hidden light is sought: the root of its share of all light. In proportion to their
    /// means one would sample two kinds of light that vary as much; but what is found seldom varies more.
    pub fn seeking(&self) -> f64 {
        let [least, most] = SEEKING;
        self.hidden.sqrt().clamp(least, most)
    }

    /// Of the shares.
    fn place(&self, way: Way) -> usize {
        match way {
            Way::Technique(s) => s,
            Way::Link(d) => self.edges - 1 + d,
            Way::Seek(d) => 2 * self.edges - 3 + d,
        }
    }

    /// The way that a number in [0, 1) chooses.
    pub(super) fn draw(&self, ways: Ways, number: f64) -> Way {
        let number = if ways == Ways::All { number } else { number * (1.0 - self.sought) };
        match pick(self.shares.iter().copied(), number) {
            Some(place) if place > 2 * self.edges - 2 => Way::Seek(place + 3 - 2 * self.edges),
            Some(place) if place > self.edges => Way::Link(place + 1 - self.edges),
            place => Way::Technique(place.unwrap_or(0)),
        }
    }

    /// How much more likely a way of known density is than its share.
    fn scale(&self, ways: Ways) -> f64 {
        if ways == Ways::All { 1.0 } else { 1.0 / (1.0 - self.sought) }
    }

    /// Σ_s α_s p_s of a path whose techniques have these densities.
    pub(super) fn by_techniques(&self, ways: Ways, densities: &[f64]) -> f64 {
        let shares = self.shares.iter().zip(densities).take(self.edges + 1);
        self.scale(ways) * shares.map(|(share, density)| share * density).sum::<f64>()
    }

    /// λ_d, where there are links.
    pub(super) fn of_link(&self, ways: Ways, d: usize) -> f64 {
        self.scale(ways) * self.shares[self.place(Way::Link(d))]
    }

    /// μ_d, where there are links.
    pub(super) fn of_seed(&self, ways: Ways, d: usize) -> f64 {
        if ways == Ways::All { self.shares[self.place(Way::Seek(d))] } else { 0.0 }
    }
}

impl PathMutations {
    /// Whether independent paths come about in more ways than the techniques have.
    pub fn links(&self, scene: &Scene) -> bool {
        self.kinds.has(Kind::Connection) && scene.links()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::PathClass;
    use crate::paths::Found;
    use crate::spectrum::Spectrum;
    use glam::DVec2;

    const EDGES: usize = 5;

    /// Of paths that are linked, with shares that all differ.
    fn mixture() -> Mixture {
        let shares: Vec<f64> = (1..=EDGES + 1 + 2 * (EDGES - 2)).map(|place| place as f64 / 78.0).collect();
        let even = shares.clone().into();
        let sought = shares[EDGES + 1 + EDGES - 2..].iter().sum();
        Mixture { shares, even, sought, hidden: 0.0, edges: EDGES, seeds: Arc::default() }
    }

    #[test]
    fn ways_are_drawn_by_their_shares() {
        const DRAWS: u32 = 78_000;
        for ways in [Ways::Known, Ways::All] {
            let mixture = mixture();
            let drawn = |way: Way| {
                let number = |i: u32| (f64::from(i) + 0.5) / f64::from(DRAWS);
                (0..DRAWS).filter(|i| mixture.draw(ways, number(*i)) == way).count() as f64 / f64::from(DRAWS)
            };
            let mut total = 0.0;
            let mut same = |way: Way, share: f64| {
                assert!((drawn(way) - share).abs() < 1e-4, "{ways:?}, {way:?}: {} for {share}", drawn(way));
                total += share;
            };
            for s in 0..=EDGES {
                let alone: Vec<f64> = (0..=EDGES).map(|other| f64::from(u8::from(other == s))).collect();
                same(Way::Technique(s), mixture.by_techniques(ways, &alone));
            }
            for d in 2..EDGES {
                same(Way::Link(d), mixture.of_link(ways, d));
                same(Way::Seek(d), mixture.of_seed(ways, d));
            }
            assert!((total - 1.0).abs() < 1e-12, "{total}");
        }
    }

    #[test]
    fn half_of_the_paths_follow_the_light() {
        let (before, way) = (mixture(), Way::Seek(3));
        let (value, class, film) = (Spectrum::ONE, PathClass::LONGER, DVec2::ZERO);
        let found = Found { value, luminance: 1.0, class, film, technique: 0 };
        let drawn = Drawn { found, worth: 2.0, known: true, way, hidden: true };
        let after = before.adapted([drawn, drawn].iter()).adapted([drawn].iter());
        for (place, (before, after)) in before.shares.iter().zip(&after.shares).enumerate() {
            let light = if place == mixture().place(way) { 0.5 } else { 0.0 };
            assert!((after - 0.5 * before - light).abs() < 1e-12, "{place}");
        }
        assert_eq!(after.seeking(), SEEKING[1]);
        assert!((after.shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert_eq!(before.adapted([].iter()).shares, before.shares);
    }
}
