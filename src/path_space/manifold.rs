//! The manifold perturbation (Jakob and Marschner 2012, section 5.2): a free vertex is left in another direction, the next
//! free one moves, and the chain beyond follows it, while its far end stays. It suits every path with a chain between two
//! free vertices, one of which may lie on a light or on the lens; with several of them, one is drawn evenly.

use super::{Plan, next_free};
use crate::camera::Projection;
use crate::math::Walk;
use crate::paths::Course;
use crate::scene::Caster;

/// Adds the ways in which it may move a path.
pub(super) fn plans(scene: &Caster<'_>, course: &Course, plans: &mut Vec<Plan>) {
    let flat = matches!(scene.camera.projection, Projection::Orthographic { .. });
    for walk in [Walk::FromCamera, Walk::FromLight] {
        for from in (0..=course.edges()).filter(|m| !course.nodes[*m].linked) {
            let Some(moved) = next_free(course, from, walk) else { continue };
            let Some(end) = next_free(course, moved, walk) else { continue };
            // Chains to parallel light, or to a camera without a lens, have no end that stays.
            let stays = course.nodes[end].infinite().is_none() && !(end == course.edges() && flat);
            if stays && end.abs_diff(moved) > 1 {
                plans.push(Plan { from, walk, stops: 1 });
            }
        }
    }
}
