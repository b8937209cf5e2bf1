//! Small steps that keep directions instead of numbers (Bitterli 2015, section 5.3, algorithm 4).
//!
//! Where a walk arrives at another surface than before, the same numbers lead into another direction. A controlled step
//! asks at each vertex y_i of the new walk for the numbers u'_i that lead into the old direction there, and moves these to
//! v_i. The way back has v'_i, the numbers of the new direction at the old vertex x_i, and leads from them to u_i, so that
//! the densities of both ways are
//!
//! ```text
//! T(u → v) = Π K(u'_i → v_i),    T(v → u) = Π K(v'_i → u_i)
//! ```
//!
//! beside those of the rows that start the walks, which are as likely both ways.
//!
//! What the direction does not tell of the numbers, lobe and unused ones, has to come back too, or u_i would be found by
//! chance only. It is the γ with which the inverse gives just u_i at x_i ([`remainder`]), and goes along to y_i. So the map
//! from u_i to u'_i is one to one, and nothing is drawn for it.

use super::settings::Scales;
use super::small_step::SmallStep;
use super::state::ChainState;
use super::tracer::Tracer;
use crate::film::Health;
use crate::math::{Row, Stream, Walk};
use crate::paths::{Event, Found, FullPath, Rows};
use crate::scene::{Caster, Scene, Surface};
use glam::DVec3;

/// What of a row for scattering moves: choices too, since their lobe follows from the directions.
const SCALES: Scales = [1.0, 1.0, 1.0, 0.0];

/// The γ for which `invert` gives `row`: its first number chooses among lobes, in ascending order, and is found by
/// bisection; the others are those of the row where they are open.
pub fn remainder(row: Row, invert: impl Fn(Row) -> Option<Row>) -> Option<Row> {
    let with = |first: f64| [first, row[1], row[2], row[3]];
    if invert(row)?[0] == row[0] {
        return Some(row);
    }
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        *if invert(with(middle))?[0] < row[0] { &mut low } else { &mut high } = middle;
    }
    Some(with(low))
}

/// A vertex that has kept its direction: which, and its row before and after.
type Kept = (usize, Row, Row);

/// The rows of a controlled step, for one walk.
struct Controlled<'a> {
    path: &'a FullPath,
    walk: Walk,
    state: &'a mut ChainState,
    first: usize,
    stream: &'a mut Stream,
    kept: &'a mut Vec<Kept>,
    /// Logarithm of T(u → v).
    forth: f64,
    failed: bool,
}

/// Directions at an event as a walk meets them: where it comes from, and where it goes on.
fn along(walk: Walk, event: &Event<'_>) -> (DVec3, DVec3) {
    match walk {
        Walk::FromCamera => (event.to_camera, event.to_light),
        Walk::FromLight => (event.to_light, event.to_camera),
    }
}

/// Numbers for scattering at `there`, from `wi`, into the direction in which `row` scatters at `here`.
fn carried(scene: &Scene, walk: Walk, here: &Event<'_>, row: Row, there: &Surface, wi: DVec3) -> Option<Row> {
    let (from, onward) = along(walk, here);
    let gamma = remainder(row, |gamma| scene.invert_scatter(here.surface, from, onward, here.delta, gamma))?;
    let wo = there.frame.to_local(here.surface.frame.to_world(onward));
    scene.invert_scatter(there, wi, wo, here.delta, gamma)
}

/// Logarithm of the density of a small step from one row to the other.
fn density(step: SmallStep, from: Row, to: Row) -> f64 {
    let moving = (0..4).filter(|i| SCALES[*i] > 0.0);
    moving.map(|i| step.density(from[i], to[i], SCALES[i]).ln()).sum()
}

impl Controlled<'_> {
    /// The row with which the new walk scatters at `surface`, where the old one scattered at x_m.
    fn follow(&mut self, index: usize, m: usize, scene: &Scene, surface: &Surface, wi: DVec3) -> Option<Row> {
        let row = self.state.last(index);
        let kept = carried(scene, self.walk, &self.path.event(scene, m)?, row, surface, wi)?;
        let step = self.state.small_step();
        let moved = [0, 1, 2, 3].map(|i| match SCALES[i] {
            0.0 => kept[i],
            scale => step.moved(kept[i], scale, 1, self.stream),
        });
        self.forth += density(step, kept, moved);
        self.state.set(index, moved);
        self.kept.push((m, row, moved));
        Some(moved)
    }
}

impl Rows for Controlled<'_> {
    fn row(&mut self, index: usize) -> Row {
        self.state.row(self.first + index, self.stream)
    }

    fn scattering_row(&mut self, index: usize, scene: &Scene, surface: &Surface, wi: DVec3) -> Row {
        let m = match self.walk {
            Walk::FromCamera => self.path.edges() - index,
            Walk::FromLight => index - 1,
        };
        let row = self.follow(self.first + index, m, scene, surface, wi);
        self.failed |= row.is_none();
        row.unwrap_or_default()
    }

    fn roulette(&self) -> bool {
        false
    }
}

/// Memory of controlled steps.
#[derive(Debug, Default)]
pub struct ControlledMemory([Vec<Kept>; 2]);

/// A controlled small step of `state`, whose path `path` is by the technique of `found`: what it finds, left in `proposal`,
/// and T(v → u) / T(u → v). `None` where a direction cannot be kept, or no light is found. A proposal must be under way.
#[allow(clippy::too_many_arguments)]
pub fn controlled_step(
    tracer: Tracer,
    scene: &Caster<'_>,
    (path, found): (&FullPath, &Found),
    state: &mut ChainState,
    stream: &mut Stream,
    proposal: &mut FullPath,
    health: &mut Health,
    memory: &mut ControlledMemory,
) -> Option<(Found, f64)> {
    let s = found.technique;
    let mut forth = 0.0;
    for (walk, kept) in [Walk::FromCamera, Walk::FromLight].into_iter().zip(&mut memory.0) {
        kept.clear();
        let first = match walk {
            Walk::FromCamera => Tracer::CAMERA_ROWS,
            Walk::FromLight => tracer.light_rows(),
        };
        let mut rows = Controlled { path, walk, state, first, stream, kept, forth: 0.0, failed: false };
        match walk {
            Walk::FromCamera => {
                let film = rows.row(0);
                tracer.walk_camera(scene, film, &mut rows, tracer.techniques() - s, proposal)?;
            }
            Walk::FromLight => tracer.walk_light(scene, &mut rows, s, proposal)?,
        }
        if rows.failed {
            return None;
        }
        forth += rows.forth;
    }
    let found = tracer.connect(scene, proposal, health)?;
    let mut back = 0.0;
    for (walk, kept) in [Walk::FromCamera, Walk::FromLight].into_iter().zip(&memory.0) {
        for (m, before, after) in kept {
            let (old, new) = (path.event(scene, *m)?, proposal.event(scene, *m)?);
            let (wi, _) = along(walk, &old);
            let returning = carried(scene, walk, &new, *after, old.surface, wi)?;
            back += density(state.small_step(), returning, *before);
        }
    }
    Some((found, (back - forth).exp()))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::bsdf::{Blend, Bsdf, Conductor, Diffuse, Distribution, RoughConductor, RoughDielectric, Roughness};
    use crate::math::warp::sphere;
    use crate::spectrum::Spectrum;
    use crate::texture::Site;

    fn models() -> Vec<Bsdf> {
        let diffuse = Diffuse { reflectance: Spectrum::grey(0.7).into() };
        let metal = Conductor { index: None, specular_reflectance: Spectrum::grey(0.9).into() };
        let roughness = Roughness::isotropic(Distribution::Ggx, 0.3);
        let rough = RoughConductor { metal: metal.clone(), roughness: roughness.clone() };
        let one = Spectrum::ONE;
        let glass = RoughDielectric { eta: 1.5, roughness, specular_reflectance: one, specular_transmittance: one };
        let nested = Box::new([Bsdf::Diffuse(diffuse.clone()), Bsdf::RoughConductor(rough.clone())]);
        let blend = Bsdf::Blend(Blend { weight: 0.3.into(), nested });
        let twice = Box::new([blend.clone(), Bsdf::Conductor(metal)]);
        vec![
            Bsdf::Diffuse(diffuse),
            Bsdf::RoughConductor(rough),
            Bsdf::RoughDielectric(glass),
            blend,
            Bsdf::Blend(Blend { weight: 0.5.into(), nested: twice }),
        ]
    }

    /// The inverse gives the row back from its remainder: nothing of it is lost.
    #[test]
    fn remainders_bring_rows_back() {
        let (site, mut stream) = (Site::default(), Stream::new(3, &[]));
        for bsdf in models() {
            let mut seen = 0;
            for _ in 0..2000 {
                let [a, b, ..] = stream.row();
                let (wi, row) = (sphere::sample([a, b]), stream.row());
                let Some(scatter) = bsdf.sample(&site, wi, row, Walk::FromLight) else { continue };
                let invert = |gamma| bsdf.invert(&site, wi, scatter.direction, scatter.delta, gamma);
                let back = invert(remainder(row, invert).unwrap()).unwrap();
                let off = row.iter().zip(back).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(off < 1e-6, "{bsdf:?}: {row:?} {back:?}");
                seen += 1;
            }
            assert!(seen > 500, "{bsdf:?}");
        }
    }
}
