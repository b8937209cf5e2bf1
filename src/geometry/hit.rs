//! What a ray met.

/// The closest hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray, in scene units; strictly between 0 and the ray's `tmax`.
    pub t: f64,
    /// What was hit, and where on it.
    pub primitive: Primitive,
}

/// A primitive of the scene and the place on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Primitive {
    /// A triangle: the point is `(1 - u - v) p0 + u p1 + v p2`, with `u`, `v`, `1 - u - v` in \[0, 1\] up to rounding.
    Triangle {
        /// Index into the triangles that the hierarchy was built from.
        index: u32,
        /// Barycentric coordinate of vertex 1.
        u: f64,
        /// Barycentric coordinate of vertex 2.
        v: f64,
    },
    /// An analytic shape: the point is [`super::Solid::surface_point`] of the ray's point at `t`.
    Solid {
        /// Index into the solids that the hierarchy was built from.
        index: u32,
    },
}
