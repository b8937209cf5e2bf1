//! The caustic perturbation (Veach and Guibas 1997, section 5.3.2): the direction moves in which light leaves the last free
//! vertex before the chain of a caustic, and the vertex that the lens sees follows. It suits paths that end as (D|L) S⁺ D E.

use super::{Plan, next_free};
use crate::math::Walk;
use crate::paths::Course;

/// How it may move a path, if at all.
pub(super) fn plan(course: &Course) -> Option<Plan> {
    let seen = course.edges() - 1;
    if seen == 0 || course.nodes[seen].linked {
        return None;
    }
    let from = next_free(course, seen, Walk::FromCamera)?;
    (from + 1 < seen).then_some(Plan { from, walk: Walk::FromLight, stops: 1 })
}
