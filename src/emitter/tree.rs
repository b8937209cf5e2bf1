//! Choice among many lights by where they are seen from (Conty Estevez and Kulla 2018, *Importance Sampling of Many
//! Lights with Adaptive Tree Splitting*): a binary tree, in which the way down takes each branch in proportion to a bound
//! on the light that it may send to the point.
//!
//! The bound is power over squared distance, times the cosine of the least angle between the direction to the point and
//! any normal below the node. Where this angle lies beyond the emission of all lights below, they cannot light the point
//! and are not chosen; everything else can be, however weak. Nothing is asked of the surface at the point, so that one
//! choice serves reflection, transmission and all walks.

use super::Emitter;
use super::extent::Extent;
use crate::math::Discrete;
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Below this level branches are split evenly: with 24 more levels the way to any of 2³² lights fits into 64 bits.
const PLANNED_DEPTH: usize = 40;

/// Least and largest probability of the lights without a place, where there are any, beside the tree.
const FAR_SHARE: [f64; 2] = [0.1, 0.9];

/// Least cosine in a bound, so that rounding leaves no light without a chance.
const LEAST_COSINE: f64 = 1e-3;

/// The choice.
#[derive(Clone, Debug)]
pub struct LightTree {
    /// In preorder: a branch's first child follows it.
    nodes: Vec<Node>,
    /// By emitter: its way down, the first turn in the lowest bit.
    trails: Vec<u64>,
    /// Emitters without a place.
    infinite: Vec<u32>,
    /// Choice among these by power.
    far: Option<Discrete>,
    /// What they send to any point, as [`Node::importance`] counts it.
    far_importance: f64,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    centre: DVec3,
    radius: f64,
    axis: DVec3,
    /// Sine and cosine of the angle of the cone of normals.
    normals: [f64; 2],
    /// Cosine of the largest angle to a normal under which there is light.
    spread: f64,
    power: f64,
    next: Next,
}

#[derive(Clone, Copy, Debug)]
enum Next {
    /// Where the second child is.
    Branch(u32),
    Leaf(u32),
}

/// A light to be put into the tree.
struct Light {
    emitter: u32,
    extent: Extent,
    power: f64,
}

impl LightTree {
    /// The tree of `emitters`; `None` where there are less than two to choose from by place.
    pub fn new(emitters: &[Emitter]) -> Option<Self> {
        let (mut lights, mut infinite, mut densities) = (Vec::new(), Vec::new(), Vec::new());
        for (emitter, found) in (0u32..).zip(emitters) {
            let power = found.power();
            match (found.extent(), found.reach()) {
                _ if power <= 0.0 => {}
                (Some(extent), _) => lights.push(Light { emitter, extent, power }),
                (None, reach) => {
                    infinite.push(emitter);
                    densities.push(power / reach.map_or(1.0, |reach| reach.radius * reach.radius));
                }
            }
        }
        if lights.len() < 2 {
            return None;
        }
        let (far, far_importance) = (Discrete::new(&densities), densities.iter().sum());
        // Lights of no power keep a way that leads elsewhere: they have no chance, which is found at the leaf.
        let trails = vec![0; emitters.len()];
        let mut tree = Self { nodes: Vec::new(), trails, infinite, far, far_importance };
        tree.grow(&mut lights, 0, 0);
        Some(tree)
    }

    fn grow(&mut self, lights: &mut [Light], depth: usize, trail: u64) {
        let here = self.nodes.len();
        if let [light] = lights {
            self.nodes.push(Node::of(&light.extent, light.power, Next::Leaf(light.emitter)));
            self.trails[light.emitter as usize] = trail;
            return;
        }
        let Some((extent, power)) = total(lights) else { return };
        self.nodes.push(Node::of(&extent, power, Next::Branch(0)));
        let (first, second) = split(lights, depth);
        self.grow(first, depth + 1, trail);
        self.nodes[here].next = Next::Branch(self.nodes.len() as u32);
        self.grow(second, depth + 1, trail | 1 << depth);
    }

    /// Chooses an emitter for `point` by `u` in [0, 1): its index and the probability. `None` where none can light it.
    #[inline]
    pub fn sample(&self, point: DVec3, u: f64) -> Option<(usize, f64)> {
        let far = self.far_share(point);
        if u < far {
            let choice = self.far.as_ref()?;
            let (index, _) = choice.sample(u / far);
            return Some((self.infinite[index] as usize, far * choice.pdf(index)));
        }
        let (mut at, mut u, mut probability) = (0, (u - far) / (1.0 - far), 1.0 - far);
        loop {
            match self.nodes[at].next {
                Next::Leaf(emitter) => return Some((emitter as usize, probability)),
                Next::Branch(second) => {
                    let first = self.first_share(at + 1, second as usize, point)?;
                    if u < first {
                        (at, u, probability) = (at + 1, u / first, probability * first);
                    } else {
                        let rest = 1.0 - first;
                        (at, u, probability) = (second as usize, (u - first) / rest, probability * rest);
                    }
                }
            }
        }
    }

    /// Probability with which [`LightTree::sample`] chooses `emitter` for `point`.
    #[inline]
    pub fn probability(&self, point: DVec3, emitter: usize) -> f64 {
        let far = self.far_share(point);
        if let (Some(index), Some(choice)) =
            (self.infinite.iter().position(|found| *found as usize == emitter), &self.far)
        {
            return far * choice.pdf(index);
        }
        let (mut at, mut trail, mut probability) = (0, self.trails[emitter], 1.0 - far);
        loop {
            match self.nodes[at].next {
                Next::Leaf(found) if found as usize == emitter => return probability,
                Next::Leaf(_) => return 0.0,
                Next::Branch(second) => {
                    let Some(first) = self.first_share(at + 1, second as usize, point) else { return 0.0 };
                    let turns = trail & 1 == 1;
                    probability *= if turns { 1.0 - first } else { first };
                    at = if turns { second as usize } else { at + 1 };
                    trail >>= 1;
                }
            }
        }
    }

    /// Probability of the emitters without a place.
    #[inline]
    fn far_share(&self, point: DVec3) -> f64 {
        if self.far.is_none() {
            return 0.0;
        }
        let share = self.far_importance / (self.far_importance + self.nodes[0].importance(point));
        // What is near may be hidden, and what is far.
        share.clamp(FAR_SHARE[0], FAR_SHARE[1])
    }

    /// Probability of the first of two children.
    #[inline]
    fn first_share(&self, first: usize, second: usize, point: DVec3) -> Option<f64> {
        let [a, b] = [first, second].map(|node| self.nodes[node].importance(point));
        (a + b > 0.0).then(|| a / (a + b))
    }
}

impl Node {
    fn of(extent: &Extent, power: f64, next: Next) -> Self {
        let (centre, radius) = extent.bounds.bounding_sphere();
        let (sin, cos) = extent.normals.angle.sin_cos();
        Self {
            centre,
            radius,
            axis: extent.normals.axis,
            normals: [sin, cos],
            spread: extent.spread.cos(),
            power,
            next,
        }
    }

    /// A bound on the light that may reach `point`, up to a factor that is the same for all nodes.
    #[inline]
    fn importance(&self, point: DVec3) -> f64 {
        let offset = point - self.centre;
        let distance_squared = offset.length_squared();
        let radius_squared = self.radius * self.radius;
        // The distance to a large node says little about that to the light below it.
        let scale = self.power / distance_squared.max(radius_squared).max(f64::MIN_POSITIVE);
        if distance_squared <= radius_squared || distance_squared == 0.0 {
            return scale;
        }
        let cos = offset.dot(self.axis) / distance_squared.sqrt();
        // The angle to the axis, less that of the normals, less that under which the node is seen.
        let sin_seen_squared = radius_squared / distance_squared;
        let seen = [sin_seen_squared.sqrt(), (1.0 - sin_seen_squared).sqrt()];
        let [_, least] = less(less([(1.0 - cos * cos).max(0.0).sqrt(), cos], self.normals), seen);
        if least < self.spread - 1e-6 { 0.0 } else { scale * least.max(LEAST_COSINE) }
    }
}

/// Sine and cosine of the angle a − b, or of 0 where b is the larger one.
#[inline]
fn less([sin_a, cos_a]: [f64; 2], [sin_b, cos_b]: [f64; 2]) -> [f64; 2] {
    if cos_a >= cos_b { [0.0, 1.0] } else { [sin_a * cos_b - cos_a * sin_b, cos_a * cos_b + sin_a * sin_b] }
}

/// Extent and power of some lights.
fn total(lights: &[Light]) -> Option<(Extent, f64)> {
    let extent = lights.iter().map(|light| light.extent).reduce(Extent::union)?;
    Some((extent, lights.iter().map(|light| light.power).sum()))
}

/// Divides at least two lights where the halves' surface areas, solid angles and powers cost least (ibid., eq. 1 and 2).
fn split(lights: &mut [Light], depth: usize) -> (&mut [Light], &mut [Light]) {
    let mut best = (f64::INFINITY, 0, lights.len() / 2);
    for axis in 0..3 {
        sort(lights, axis);
        let behind = costs(lights.iter().rev());
        for (i, before) in costs(lights.iter()).into_iter().enumerate().take(lights.len() - 1) {
            let cost = before + behind[lights.len() - 2 - i];
            if cost < best.0 && depth < PLANNED_DEPTH {
                best = (cost, axis, i + 1);
            }
        }
    }
    sort(lights, best.1);
    lights.split_at_mut(best.2)
}

fn sort(lights: &mut [Light], axis: usize) {
    let place = |light: &Light| light.extent.bounds.centre()[axis];
    lights.sort_by(|a, b| place(a).total_cmp(&place(b)).then(a.emitter.cmp(&b.emitter)));
}

/// The cost of the first light, of the first two, and so on.
fn costs<'a>(lights: impl Iterator<Item = &'a Light>) -> Vec<f64> {
    let mut sum: Option<(Extent, f64)> = None;
    let cost = |light: &Light| {
        let (extent, power) = match sum {
            None => (light.extent, light.power),
            Some((extent, power)) => (extent.union(light.extent), power + light.power),
        };
        sum = Some((extent, power));
        let size = extent.bounds.max - extent.bounds.min;
        let area = size.x * size.y + size.y * size.z + size.z * size.x;
        // Lights in a row or at one point still cost by their length.
        let extended = area + 1e-3 * size.length_squared();
        power * solid_angle(&extent) * extended
    };
    lights.map(cost).collect()
}

/// Solid angle of all directions of light, those far from the normals counting less (ibid., section 4.1).
fn solid_angle(extent: &Extent) -> f64 {
    let normals = extent.normals.angle;
    let widest = (normals + extent.spread.min(FRAC_PI_2)).min(PI);
    let (sin, cos) = normals.sin_cos();
    TAU * (1.0 - cos) + FRAC_PI_2 * (2.0 * widest * sin - (normals - 2.0 * widest).cos() - 2.0 * normals * sin + cos)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::emitter::{Area, Constant, Point, Reach, Spot, Start, Surface};
    use crate::geometry::Solid;
    use crate::math::{Stream, warp::sphere};
    use crate::spectrum::Spectrum;
    use glam::{DVec2, Vec2};

    /// Lights of all kinds strewn over a cube.
    fn lights(count: usize, stream: &mut Stream) -> Vec<Emitter> {
        let one = |i: usize| {
            let [x, y, z, w] = stream.row();
            let position = 10.0 * DVec3::new(x, y, z);
            let [u, v, a, b] = stream.row();
            let axis = sphere::sample([u, v]);
            let intensity = Spectrum::grey(w * w * 5.0);
            match i % 5 {
                0 => Emitter::Point(Point { position, intensity }),
                1 => Emitter::Spot(Spot { position, axis, intensity, cutoff: 0.1 + a, beam: 0.1 }),
                2 => Emitter::Area(Area::new(intensity.into(), Surface::Solid(Solid::disk(position, axis, 0.01 + b)))),
                3 => Emitter::Area(Area::new(intensity.into(), Surface::Solid(Solid::sphere(position, 0.01 + b)))),
                _ => {
                    let corners = [position, position + axis, position + DVec3::new(a, b, u)];
                    let surface = Surface::triangles(0, [(corners, [Vec2::ZERO; 3])].into_iter()).unwrap();
                    Emitter::Area(Area::new(intensity.into(), surface))
                }
            }
        };
        (0..count).map(one).collect()
    }

    #[test]
    fn choices_follow_their_probabilities_and_leave_out_no_light() {
        let mut stream = Stream::new(1, &[]);
        let reach = Reach { center: DVec3::ZERO, radius: 1.0 };
        let mut emitters = lights(60, &mut stream);
        emitters.push(Emitter::Constant(Constant { radiance: Spectrum::ONE, reach }));
        emitters.push(Emitter::Point(Point { position: DVec3::ONE, intensity: Spectrum::BLACK }));
        let tree = LightTree::new(&emitters).unwrap();
        for _ in 0..50 {
            let [x, y, z, _] = stream.row();
            let point = DVec3::new(x, y, z) * 14.0 - 2.0;
            let probabilities: Vec<f64> = (0..emitters.len()).map(|i| tree.probability(point, i)).collect();
            let n = 20_000;
            let mut counts = vec![0.0; emitters.len()];
            let mut none = 0.0;
            for i in 0..n {
                match tree.sample(point, (f64::from(i) + 0.5) / f64::from(n)) {
                    Some((emitter, probability)) => {
                        assert!((probability - probabilities[emitter]).abs() < 1e-9);
                        counts[emitter] += 1.0 / f64::from(n);
                    }
                    None => none += 1.0 / f64::from(n),
                }
            }
            assert!((probabilities.iter().sum::<f64>() + none - 1.0).abs() < 1e-3);
            for (emitter, (count, probability)) in emitters.iter().zip(counts.iter().zip(&probabilities)) {
                assert!((count - probability).abs() < 2e-3, "{count} {probability}");
                let shines = (0..200).any(|_| {
                    let (start, _) = emitter.start(stream.row());
                    let direction = match start {
                        Start::Surface { position, .. } | Start::Point { position } => (point - position).normalize(),
                        Start::Infinite { towards } | Start::Distant { towards } => -towards,
                    };
                    !emitter.radiance(&start, direction).is_black()
                });
                assert!(*probability > 0.0 || !shines, "{emitter:?} {point}");
            }
        }
    }

    #[test]
    fn near_lights_are_preferred() {
        let light = |x| Emitter::Point(Point { position: DVec3::X * x, intensity: Spectrum::ONE });
        let tree = LightTree::new(&[light(0.0), light(10.0)]).unwrap();
        assert!((tree.probability(DVec3::X, 0) - 81.0 / 82.0).abs() < 1e-12);
        assert!(LightTree::new(&[light(0.0)]).is_none());
    }

    /// A thousand lights at one point and in one line do not make it fail, nor deep.
    #[test]
    fn equal_lights_are_told_apart() {
        for step in [0.0, 1.0] {
            let light = |i| Point { position: DVec3::X * (f64::from(i) * step), intensity: Spectrum::ONE };
            let emitters: Vec<Emitter> = (0..1000).map(|i| Emitter::Point(light(i))).collect();
            let tree = LightTree::new(&emitters).unwrap();
            let sum: f64 = (0..1000).map(|i| tree.probability(DVec3::new(3.5, 1.0, DVec2::ONE.y), i)).sum();
            assert!((sum - 1.0).abs() < 1e-9, "{sum}");
        }
    }
}
