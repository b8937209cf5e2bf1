//! The walk of a ray through the hierarchy. Nothing is allocated.

use super::Bvh;
use super::packet::Packet;
use super::query::Query;
use super::wide::{Child, ChildKind};
use crate::geometry::{Primitive, Ray};

/// Levels of wide nodes that [`super::collapse`] never exceeds.
pub const MAX_DEPTH: usize = 36;
/// Each level leaves at most seven siblings behind, and the last one eight.
const FULL_STACK: usize = 256;
const _: () = assert!(7 * MAX_DEPTH < FULL_STACK);

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
    /// The closest hit, or with `ANY` the first one met. Small hierarchies get a small stack, which costs less to clear.
    #[inline(always)]
    pub(super) fn dispatch<const ANY: bool>(&self, ray: &Ray, leaving: u32) -> Option<Best> {
        let query = Query::new(ray, leaving, &self.frame)?;
        Some(match self.stack {
            0 => self.flat::<ANY>(&query, ray),
            1..=64 => self.traverse::<ANY, 64>(&query, ray),
            _ => self.traverse::<ANY, FULL_STACK>(&query, ray),
        })
    }

    /// Without nodes: all packets are filtered, then all candidates refined. No branch until then depends on the ray,
    /// which for a few packets is faster than any hierarchy.
    #[inline(always)]
    fn flat<const ANY: bool>(&self, query: &Query, ray: &Ray) -> Best {
        let mut best = Best::new(query);
        let mut candidates = 0u64;
        for (index, packet) in self.packets.iter().enumerate().take(FLAT_PACKETS) {
            candidates |= u64::from(packet.filter(query, best.t32)) << (8 * index);
        }
        while candidates != 0 && !(ANY && best.primitive.is_some()) {
            let bit = candidates.trailing_zeros() as usize;
            candidates &= candidates - 1;
            refine(&self.packets[bit / 8], bit % 8, query, &mut best);
        }
        for solid in &self.loose {
            if ANY && best.primitive.is_some() {
                break;
            }
            self.visit_solid(*solid, query, ray, &mut best);
        }
        best
    }

    #[inline(always)]
    fn traverse<const ANY: bool, const N: usize>(&self, query: &Query, ray: &Ray) -> Best {
        let mut best = Best::new(query);
        let mut stack = [0u64; N];
        let mut top = 0;
        let mut child = Child::node(0);
        loop {
            match child.kind() {
                ChildKind::Node(index) => {
                    if let Some(node) = self.nodes.get(index) {
                        let (mask, enter) = node.enter(query, best.t32);
                        top = push::<N>(&mut stack, top, mask, enter.as_array(), &node.children);
                    }
                }
                ChildKind::Packet(index) => self.visit_packet::<ANY>(index, query, &mut best),
                ChildKind::Solid(index) => self.visit_solid(index, query, ray, &mut best),
            }
            if ANY && best.primitive.is_some() {
                return best;
            }
            loop {
                if top == 0 {
                    return best;
                }
                top -= 1;
                let next = stack[top];
                if f32::from_bits((next >> 32) as u32) <= best.t32 {
                    child = Child(next as u32);
                    break;
                }
            }
        }
    }

    #[inline(always)]
    fn visit_packet<const ANY: bool>(&self, index: usize, query: &Query, best: &mut Best) {
        let packet = &self.packets[index];
        let mut mask = packet.filter(query, best.t32);
        while mask != 0 && !(ANY && best.primitive.is_some()) {
            let lane = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            refine(packet, lane, query, best);
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

/// Puts the entered children on the stack, the nearest on top; gives the new top.
#[inline(always)]
fn push<const N: usize>(
    stack: &mut [u64; N],
    top: usize,
    mut mask: u32,
    enter: &[f32; 8],
    children: &[Child; 8],
) -> usize {
    let mut end = top;
    while mask != 0 {
        let lane = mask.trailing_zeros() as usize & 7;
        mask &= mask - 1;
        let new = entry(enter[lane], children[lane]);
        let mut place = end;
        while place > top && stack[place - 1] < new {
            stack[place] = stack[place - 1];
            place -= 1;
        }
        stack[place] = new;
        end += 1;
    }
    end
}
