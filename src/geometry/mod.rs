//! Ray, hit, shapes and the bounding volume hierarchy.
//!
//! Conventions that every caller shares:
//! - Positions and ray parameters are `f64`, in scene units; vertices are stored as `f32` and taken as exact.
//! - A hit is accepted iff `0 < t < tmax`, both strict. There is no epsilon: whoever starts a ray at a surface moves
//!   the origin off it by the distance that [`offset`] gives, which bounds the rounding of the hit point.
//! - A triangle's hit is decided by one watertight test in `f64`; everything in `f32` (boxes, packets) only filters,
//!   with error bounds, and so never changes the answer.

mod bounds;
pub mod bvh;
mod hit;
pub mod offset;
mod ray;
mod solid;

pub use bounds::Bounds;
pub use bvh::{Bvh, Dropped, NO_TRIANGLE};
pub use hit::{Hit, Primitive};
pub use offset::geometric_normal;
pub use ray::Ray;
pub use solid::{Chart, Solid, SurfacePoint};
