//! From the caller's slices to the hierarchy: drop what cannot be hit, let obvhs build, collapse.

use glam::{DVec3, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;
use rayon::prelude::*;

use super::collapse::{Primitives, collapse};
use super::frame::Frame;
use super::groups::Groups;
use super::packet::Packet;
use super::pages::Pages;
use super::traverse::FLAT_PACKETS;
use super::{Bvh, Dropped, Form};
use crate::geometry::offset::cross;
use crate::geometry::{Bounds, Solid};

/// Beyond this a coordinate is taken for an error: one such vertex would cost all others their resolution.
const LARGEST: f64 = 1e15;

/// The most solids that do without nodes.
const LOOSE_SOLIDS: usize = 4;

/// See [`Bvh::build`].
pub fn build(vertices: &[Vec3], triangles: &[[u32; 3]], solids: &[Solid]) -> Bvh {
    let mut dropped = Dropped::default();
    let kept: Vec<u32> = (0u32..)
        .zip(triangles)
        .filter(|(_, indices)| is_sound(vertices, **indices, &mut dropped))
        .map(|(id, _)| id)
        .collect();
    let kept_solids: Vec<u32> = (0u32..)
        .zip(solids)
        .filter(|(_, solid)| {
            let valid = solid.is_valid() && solid.bounds().max_abs() <= LARGEST;
            dropped.invalid += usize::from(!valid);
            valid
        })
        .map(|(id, _)| id)
        .collect();

    let corners = kept.iter().flat_map(|id| triangles[*id as usize]).map(|index| vertices[index as usize]);
    let meshes = corners.fold(Bounds::EMPTY, |bounds, corner| bounds.including(corner.as_dvec3()));
    let bounds = kept_solids.iter().fold(meshes, |bounds, id| bounds.union(solids[*id as usize].bounds()));
    let frame = Frame::new(meshes, bounds);
    let primitives = Primitives { frame, vertices, indices: triangles, triangles: &kept, solids: &kept_solids };
    if kept.len() <= 8 * FLAT_PACKETS && kept_solids.len() <= LOOSE_SOLIDS {
        let numbers: Vec<u32> = (0..kept.len() as u32).collect();
        let mut packets: Vec<_> = numbers.chunks(8).map(|numbers| primitives.packet(numbers)).collect();
        Packet::level(&mut packets);
        let form = Form::Flat { packets, solids: kept_solids };
        return Bvh { frame, bounds, dropped, form, solids: solids.to_vec() };
    }
    let count = kept.len();
    let bounding = |i: usize| match i.checked_sub(count) {
        None => triangle_box(&primitives.corners(i)),
        Some(solid) => solid_box(&solids[kept_solids[solid] as usize], &frame),
    };
    let boxes: Vec<Aabb> = (0..count + kept_solids.len()).into_par_iter().map(bounding).collect();
    let groups = Groups::of_equal(&boxes);
    let tree = match groups.len() == boxes.len() {
        true => binary(&boxes),
        false => binary(&groups.firsts().map(|first| boxes[first as usize]).collect::<Vec<_>>()),
    };
    // Sets the bound on the memory that a scene takes to load: what is not needed again goes before more is made.
    drop(boxes);
    let wide = collapse(&tree, &groups, &primitives, bounding);
    drop((tree, groups));
    let form = Form::Tree { nodes: Pages::new(wide.nodes), packets: Pages::new(wide.packets) };
    Bvh { frame, bounds, dropped, form, solids: solids.to_vec() }
}

/// Whether a triangle can be hit; if not, it is counted.
fn is_sound(vertices: &[Vec3], indices: [u32; 3], dropped: &mut Dropped) -> bool {
    // Written so that NaN fails.
    let sound = |v: &&Vec3| v.abs().cmple(Vec3::splat(LARGEST as f32)).all();
    let corner = |i: usize| vertices.get(indices[i] as usize).filter(sound).copied();
    let (Some(a), Some(b), Some(c)) = (corner(0), corner(1), corner(2)) else {
        dropped.invalid += 1;
        return false;
    };
    let [a64, b64, c64] = [a, b, c].map(Vec3::as_dvec3);
    let flat = DVec3::from(cross((b64 - a64).to_array(), (c64 - a64).to_array())) == DVec3::ZERO;
    dropped.degenerate += usize::from(flat);
    !flat
}

fn triangle_box([a, b, c]: &[Vec3; 3]) -> Aabb {
    Aabb::new(Vec3A::from(a.min(*b).min(*c)), Vec3A::from(a.max(*b).max(*c)))
}

/// Rounded outward by at least one step of `f32`, which also covers the rounding of the bounds in `f64`.
fn solid_box(solid: &Solid, frame: &Frame) -> Aabb {
    let bounds = solid.bounds();
    let outward = |point: DVec3, step: fn(f32) -> f32| Vec3A::from(frame.to_local(point).as_vec3().map(step));
    Aabb::new(outward(bounds.min, f32::next_down), outward(bounds.max, f32::next_up))
}

/// obvhs's medium preset, without its merging of leaves: the collapse chooses leaves for packets of eight itself.
fn binary(boxes: &[Aabb]) -> Bvh2 {
    let preset = BvhBuildParams::medium_build();
    let mut tree = PlocBuilder::with_capacity(boxes.len()).build(
        preset.ploc_search_distance,
        boxes,
        (0u32..).take(boxes.len()).collect(),
        preset.sort_precision,
        preset.search_depth_threshold,
    );
    ReinsertionOptimizer::default().run(&mut tree, preset.reinsertion_batch_ratio, None);
    tree
}
