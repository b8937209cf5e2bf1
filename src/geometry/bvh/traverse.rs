//! The walk of a ray through the hierarchy. Nothing is allocated.

use arrayvec::ArrayVec;
use wide::f32x8;

use super::packet::Packet;
use super::query::{Query, Slabs};
use super::wide::{Child, ChildKind, Node};
use super::{Bvh, Form};
use crate::geometry::{Primitive, Ray};

/// Levels of wide nodes that [`super::collapse`] never exceeds.
pub const MAX_DEPTH: usize = 36;
/// Each level leaves at most seven siblings behind, and the last one eight.
const STACK: usize = 256;
const _: () = assert!(7 * MAX_DEPTH < STACK);

/// The most packets that do without nodes: one bit for each of their triangles.
pub const FLAT_PACKETS: usize = 8;

/// The closest hit so far.
pub struct Best {
    /// Distance in local units.
    pub t: f64,
    /// Not below the distance from the query's `f32` origin.
    t32: f32,
    /// What it is on.
    pub primitive: Option<Primitive>,
}

impl Best {
    fn new(query: &Query) -> Self {
        let mut best = Self { t: query.tmax, t32: 0.0, primitive: None };
        best.set(query, query.tmax);
        best
    }

    #[inline(always)]
    fn set(&mut self, query: &Query, t: f64) {
        // Rounded up; from the clipped origin the scene ends before 8, and a finite limit keeps 0 * inf away.
        const UP: f32 = 1.0 + 1.0 / (1u32 << 22) as f32;
        self.t = t;
        self.t32 = ((t - query.start).min(8.0) as f32) * UP;
    }
}

/// A stack entry that sorts by distance: the bits of a non-negative `f32` are ordered as it is.
#[inline(always)]
const fn entry(t: f32, child: Child) -> u64 {
    (t.to_bits() as u64) << 32 | child.0 as u64
}

impl Bvh {
    /// The closest hit, or with `ANY` the first one met.
    #[inline(always)]
    pub(super) fn dispatch<const ANY: bool>(&self, ray: &Ray, leaving: u32) -> Option<Best> {
        let query = Query::new(ray, leaving, &self.frame)?;
        Some(match &self.form {
            Form::Flat { packets, solids } => self.flat::<ANY>(packets, solids, &query, ray),
            Form::Tree { nodes, packets } => self.traverse::<ANY>(nodes, packets, &query, ray),
        })
    }

    /// Without nodes: all packets are filtered, then all candidates refined. No branch until then depends on the ray,
    /// which for a few packets is faster than any hierarchy.
    #[inline(always)]
    fn flat<const ANY: bool>(&self, packets: &[Packet], solids: &[u32], query: &Query, ray: &Ray) -> Best {
        let mut best = Best::new(query);
        let mut candidates = 0u64;
        if let Some(off) = packets.first().map(|packet| packet.tolerance(query)) {
            for (index, packet) in packets.iter().enumerate().take(FLAT_PACKETS) {
                candidates |= u64::from(packet.filter(query, &off, best.t32)) << (8 * index);
            }
        }
        while candidates != 0 && !(ANY && best.primitive.is_some()) {
            let bit = candidates.trailing_zeros() as usize;
            candidates &= candidates - 1;
            refine(&packets[bit / 8], bit % 8, query, &mut best);
        }
        for solid in solids {
            if ANY && best.primitive.is_some() {
                break;
            }
            self.visit_solid(*solid, query, ray, &mut best);
        }
        best
    }

    #[inline(always)]
    fn traverse<const ANY: bool>(&self, nodes: &[Node], packets: &[Packet], query: &Query, ray: &Ray) -> Best {
        let (mut best, slabs) = (Best::new(query), Slabs::new(ray, query));
        let mut stack = ArrayVec::<u64, STACK>::new_const();
        let mut child = Child::node(0);
        // A prefetch in safe code: reading one word of what waits on the stack brings it into the cache meanwhile.
        let mut read = 0;
        let mut touch = |child: Child| match child.kind() {
            ChildKind::Node(index) => read ^= nodes.get(index).map_or(0, |node| node.children[0].0),
            ChildKind::Packet(index) => read ^= packets.get(index).map_or(0, |packet| packet.ids[0]),
            ChildKind::Solid(_) => {}
        };
        loop {
            match child.kind() {
                ChildKind::Node(index) => {
                    let node = &nodes[index];
                    let (mask, enter) = node.enter(&slabs, best.t32);
                    if let Some(nearest) = nearest(&mut stack, mask, &enter, &node.children, &mut touch) {
                        child = nearest;
                        continue;
                    }
                }
                ChildKind::Packet(index) => visit_packet::<ANY>(&packets[index], query, &mut best),
                ChildKind::Solid(index) => self.visit_solid(index, query, ray, &mut best),
            }
            if ANY && best.primitive.is_some() {
                return best;
            }
            loop {
                let Some(next) = stack.pop() else {
                    std::hint::black_box(read);
                    return best;
                };
                if f32::from_bits((next >> 32) as u32) <= best.t32 {
                    child = Child(next as u32);
                    break;
                }
            }
        }
    }

    #[inline(always)]
    fn visit_solid(&self, index: u32, query: &Query, ray: &Ray, best: &mut Best) {
        // In scene units and from the unshifted origin: nothing of a solid's accuracy is lost to the frame.
        let limited = Ray { tmax: best.t * self.frame.inverse, ..*ray };
        if let Some(t) = self.solids.get(index as usize).and_then(|solid| solid.intersect(&limited)) {
            best.set(query, t * self.frame.scale);
            best.primitive = Some(Primitive::Solid { index });
        }
    }
}

#[inline(always)]
fn visit_packet<const ANY: bool>(packet: &Packet, query: &Query, best: &mut Best) {
    let mut mask = packet.filter(query, &packet.tolerance(query), best.t32);
    while mask != 0 && !(ANY && best.primitive.is_some()) {
        let lane = mask.trailing_zeros() as usize;
        mask &= mask - 1;
        refine(packet, lane, query, best);
    }
}

/// Makes a candidate the best hit if it is.
#[inline(always)]
fn refine(packet: &Packet, lane: usize, query: &Query, best: &mut Best) {
    if packet.ids[lane & 7] == query.leaving {
        return;
    }
    if let Some(hit) = packet.refine(lane, query, best.t) {
        best.set(query, hit.t);
        best.primitive = Some(Primitive::Triangle { index: packet.ids[lane & 7], u: hit.u, v: hit.v });
    }
}

/// The nearest of the entered children; the others go onto the stack, the nearer above. Most nodes have one or two.
#[inline(always)]
fn nearest(
    stack: &mut ArrayVec<u64, STACK>,
    mut mask: u32,
    enter: &f32x8,
    children: &[Child; 8],
    mut touch: impl FnMut(Child),
) -> Option<Child> {
    let mut next = || {
        let lane = (mask != 0).then_some(mask.trailing_zeros() as usize & 7);
        mask &= mask.wrapping_sub(1);
        lane
    };
    let (first, second) = (next()?, next());
    if second.is_none() {
        return Some(children[first]);
    }
    let enter = enter.as_array();
    let mut nearest = entry(enter[first], children[first]);
    let bottom = stack.len();
    let mut lane = second;
    while let Some(index) = lane {
        let new = entry(enter[index], children[index]);
        let mut far = new.max(nearest);
        nearest = new.min(nearest);
        touch(Child(far as u32));
        for place in &mut stack[bottom..] {
            (*place, far) = (far.max(*place), far.min(*place));
        }
        stack.push(far);
        lane = next();
    }
    Some(Child(nearest as u32))
}
