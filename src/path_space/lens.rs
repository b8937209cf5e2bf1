//! The lens perturbation (Veach and Guibas 1997, section 5.3.1): the film position moves, and the first part of the path
//! follows, up to its first free vertex, which is connected with what the path had beyond. It suits paths that end as
//! E S* D (D|L), and those that have nothing but delta vertices on the way to the light.

use super::{Plan, next_free};
use crate::math::Walk;
use crate::paths::Course;

/// How it may move a path, if at all.
pub(super) fn plan(course: &Course) -> Option<Plan> {
    let walk = Walk::FromCamera;
    let first = next_free(course, course.edges(), walk)?;
    let connects = first == 0 || !course.nodes[first - 1].linked;
    connects.then_some(Plan { from: course.edges(), walk, stops: 1 })
}
