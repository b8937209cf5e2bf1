//! A node with eight children, one per SIMD lane.

use bytemuck::{Pod, Zeroable};
use wide::f32x8;

use super::query::Slabs;

/// What a node's child is: a kind in the upper two bits, an index in the rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct Child(pub u32);

/// [`Child`], taken apart.
pub enum ChildKind {
    /// Index of a node.
    Node(usize),
    /// Index of a packet.
    Packet(usize),
    /// Index of a solid.
    Solid(u32),
}

impl Child {
    const KIND: u32 = 30;
    /// The most nodes, packets or solids that can be named.
    pub const LIMIT: usize = 1 << Self::KIND;

    /// `index` is below [`Child::LIMIT`] for all three.
    pub const fn node(index: usize) -> Self {
        Self(index as u32)
    }
    /// A packet.
    pub const fn packet(index: usize) -> Self {
        Self(index as u32 | 1 << Self::KIND)
    }
    /// A solid.
    pub const fn solid(index: u32) -> Self {
        Self(index | 2 << Self::KIND)
    }
    /// Takes it apart.
    #[inline(always)]
    pub const fn kind(self) -> ChildKind {
        let index = self.0 & (Self::LIMIT as u32 - 1);
        match self.0 >> Self::KIND {
            0 => ChildKind::Node(index as usize),
            1 => ChildKind::Packet(index as usize),
            _ => ChildKind::Solid(index),
        }
    }
}

/// Eight boxes and what is in them. Lanes without a child have the empty box and are never entered.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Node {
    /// Smallest x, largest x, smallest y, …: `planes[axis][side]`, in local units.
    planes: [[f32x8; 2]; 3],
    /// The children.
    pub children: [Child; 8],
}

impl Node {
    /// A node of up to eight children with boxes `(min, max)`; further ones are ignored.
    pub fn new(children: &[(Child, [f32; 3], [f32; 3])]) -> Self {
        let mut planes = [[[f32::INFINITY; 8], [f32::NEG_INFINITY; 8]]; 3];
        let mut ids = [Child::node(0); 8];
        for (lane, (child, min, max)) in children.iter().enumerate().take(8) {
            ids[lane] = *child;
            for axis in 0..3 {
                planes[axis][0][lane] = min[axis];
                planes[axis][1][lane] = max[axis];
            }
        }
        Self { planes: planes.map(|sides| sides.map(f32x8::new)), children: ids }
    }

    /// The lanes whose box the ray meets before `limit` (bit mask) and where it enters them.
    ///
    /// Conservative: the planes are exact; the origin's rounding is in the tolerance of `slabs`; the rounding of each
    /// distance is below 3 · 2^-24 relative (inverse direction twice rounded, one fused multiply-add), and the final
    /// comparison allows for it on both sides.
    #[inline(always)]
    pub fn enter(&self, slabs: &Slabs, limit: f32) -> (u32, f32x8) {
        const SLACK: f32 = 1.0 + 1.0 / (1u32 << 20) as f32;
        let (x, y, z) = (slabs.inverse.x, slabs.inverse.y, slabs.inverse.z);
        let inverse = [f32x8::splat(x), f32x8::splat(y), f32x8::splat(z)];
        let (near_origin, far_origin) = (slabs.near_origin.to_array(), slabs.far_origin.to_array());
        let near = |i: usize| self.planes[i][slabs.near[i] & 1].mul_sub(inverse[i], f32x8::splat(near_origin[i]));
        let far = |i: usize| self.planes[i][!slabs.near[i] & 1].mul_sub(inverse[i], f32x8::splat(far_origin[i]));
        let enter = near(0).fast_max(near(1)).fast_max(near(2).fast_max(f32x8::ZERO));
        let leave = far(0).fast_min(far(1)).fast_min(far(2).fast_min(f32x8::splat(limit)));
        (enter.simd_le(leave * f32x8::splat(SLACK)).to_bitmask(), enter)
    }
}
