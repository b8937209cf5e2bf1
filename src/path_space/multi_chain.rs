//! The multi-chain perturbation (Veach and Guibas 1997, section 5.3.3): the film position moves, and at each free vertex
//! that lies between two chains the direction in which the path goes on. It suits paths that end as E S* (D S⁺)⁺ (D|L), as
//! caustics that are seen through glass.

use super::{Plan, next_free};
use crate::math::Walk;
use crate::paths::Course;

/// How it may move a path, if at all.
pub(super) fn plan(course: &Course) -> Option<Plan> {
    let walk = Walk::FromCamera;
    let from = course.edges();
    let mut at = next_free(course, from, walk)?;
    let mut stops = 1;
    while at > 0 && course.nodes[at - 1].linked {
        at = next_free(course, at, walk)?;
        stops += 1;
    }
    (stops > 1).then_some(Plan { from, walk, stops })
}
